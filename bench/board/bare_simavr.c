#include "bare_simavr.h"

#include <simavr/avr_extint.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdlib.h>
#include <string.h>

/* In place of simavr's, which waits for the wall clock. There is no room for a count in avr_t:
 * time_base is unused then. */
static void count_sleep(avr_t *avr, avr_cycle_count_t cycles)
{
    avr->time_base += cycles + 1u;
}

uint64_t bare_simavr_idle_cycles(const bare_simavr_t *core)
{
    return core->time_base;
}

static void store(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    (void)param;
    avr->data[address] = value;
}

bare_simavr_t *bare_simavr_create(const char *elf, bool idle_pwm)
{
    static const avr_io_addr_t clock_select[3] = {0x91, 0xA1, 0x121}; /* TCCR3B, TCCR4B, TCCR5B */
    elf_firmware_t firmware;
    memset(&firmware, 0, sizeof firmware);
    avr_t *avr = avr_make_mcu_by_name("atmega2560");
    if (avr == NULL || elf_read_firmware(elf, &firmware) != 0) {
        return NULL;
    }
    avr_init(avr);
    avr->log = LOG_NONE;
    firmware.frequency = 16000000;
    avr_load_firmware(avr, &firmware);
    avr->sleep = count_sleep;
    for (unsigned k = 0; idle_pwm && k < 3; k++) {
        avr->io[AVR_DATA_TO_IO(clock_select[k])].w.c = store;
        avr->io[AVR_DATA_TO_IO(clock_select[k] - 1)].w.c = store;
    }
    for (uint8_t k = 0; idle_pwm && k < EXTINT_COUNT; k++) {
        avr_extint_set_strict_lvl_trig(avr, k, 0);
    }
    return avr;
}

void bare_simavr_run(bare_simavr_t *core, uint64_t cycles)
{
    uint64_t end = core->cycle + cycles;
    while (core->cycle < end && avr_run(core) != cpu_Crashed) {
    }
}

void bare_simavr_destroy(bare_simavr_t *core)
{
    avr_terminate(core);
    free(core);
}
