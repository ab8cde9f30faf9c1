#include "board_internal.h"

#define RAM_BEGIN      0x200u
#define FIRMWARE_PAINT 0xC5u /* what firmware/board_mega.c paints its free RAM with */

/* --- RAM at power-on: garbage that can be told from what a stack leaves --- */

static uint8_t garbage(uint64_t seed, unsigned address)
{
    uint64_t mixed = (seed + address + 1u) * 0x9E3779B97F4A7C15u;
    return (uint8_t)(mixed >> 56);
}

void board_fill_ram(board_t *board)
{
    for (unsigned address = RAM_BEGIN; address <= board->avr->ramend; address++) {
        board->avr->data[address] = garbage(board->options.seed, address);
    }
}

const uint8_t *board_variable(const board_t *board, const char *symbol, uint32_t *size)
{
    const board_symbol_t *entry = board_elf_symbol(board->elf, symbol);
    if (entry == NULL || entry->address < BOARD_RAM_OFFSET ||
        entry->address + entry->size > BOARD_RAM_OFFSET + board->avr->ramend + 1u) {
        return NULL;
    }
    if (size != NULL) {
        *size = entry->size;
    }
    return board->avr->data + (entry->address - BOARD_RAM_OFFSET);
}

uint32_t board_flash_bytes(const board_t *board)
{
    return board->elf->flash_used;
}

uint32_t board_static_ram_bytes(const board_t *board)
{
    return board->elf->ram_static;
}

/* One past the heap, which an Arduino library may have used; avr-libc keeps it in __brkval, 0
 * before the first use. */
static unsigned heap_end(const board_t *board)
{
    unsigned statics_end = RAM_BEGIN + board->elf->ram_static;
    const uint8_t *variable = board_variable(board, "__brkval", NULL);
    unsigned end = variable != NULL ? variable[0] | (unsigned)variable[1] << 8 : 0;
    return end > statics_end ? end : statics_end;
}

uint32_t board_stack_high_water(const board_t *board)
{
    unsigned address = heap_end(board);
    while (address <= board->avr->ramend &&
           (board->avr->data[address] == garbage(board->options.seed, address) ||
            board->avr->data[address] == FIRMWARE_PAINT)) {
        address++;
    }
    return board->avr->ramend + 1u - address;
}

uint64_t board_idle_cycles(const board_t *board)
{
    return board->idle_cycles;
}

/* --- counting cycles of a function --- */

typedef struct {
    bool inside;
    unsigned stack_pointer;
    unsigned nesting;        /* interrupt routines running when it began */
    uint64_t begun, foreign; /* cycles; those of interrupt routines */
} probe_t;

static unsigned stack_pointer(const avr_t *avr)
{
    return avr->data[R_SPL] | (unsigned)avr->data[R_SPH] << 8;
}

static void probe_left(const probe_t *probe, uint64_t now, board_measurement_t *result)
{
    uint64_t cycles = now - probe->begun - probe->foreign;
    result->calls++;
    result->total_cycles += cycles;
    if (result->calls == 1 || cycles < result->minimum_cycles) {
        result->minimum_cycles = cycles;
    }
    if (cycles > result->maximum_cycles) {
        result->maximum_cycles = cycles;
    }
}

bool board_measure(board_t *board, const char *function, unsigned calls, double limit_ms,
                   board_measurement_t *result)
{
    const board_symbol_t *symbol = board_elf_symbol(board->elf, function);
    avr_t *avr = board->avr;
    uint64_t limit = avr->cycle + (uint64_t)(limit_ms * BOARD_CYCLES_PER_MS);
    probe_t probe = {0};
    *result = (board_measurement_t){0};
    if (symbol == NULL) {
        return false;
    }
    board_take_complaints(board);
    while (result->calls < calls && avr->cycle < limit && board_state(board) == BOARD_RUNNING) {
        avr->run_cycle_limit = 1;
        avr->run_cycle_count = 1;
        if (probe.inside && stack_pointer(avr) > probe.stack_pointer) {
            probe_left(&probe, avr->cycle, result);
            probe.inside = false;
        }
        if (!probe.inside && avr->pc == symbol->address) {
            probe = (probe_t){.inside = true,
                              .stack_pointer = stack_pointer(avr),
                              .nesting = avr->interrupts.running_ptr,
                              .begun = avr->cycle};
        }
        uint64_t before = avr->cycle;
        bool foreign = probe.inside && avr->interrupts.running_ptr > probe.nesting;
        board_step_core(board);
        if (foreign) {
            probe.foreign += avr->cycle - before;
        }
    }
    avr->run_cycle_limit = BOARD_RUN_CYCLES_LIMIT;
    return true;
}
