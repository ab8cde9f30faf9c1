/* Runs an ELF of test/avr on simavr's ATmega2560 and counts the cycles between its marks.
 *
 *   avr_runner ELF [NAME MAX_CYCLES]...   exit 0: it said PASS, no named count is above its
 * maximum, and its stack has not come near its variables
 *
 * Prints each name with its smallest and largest count. The simulation counts cycles exactly. */
#include <errno.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <avr_uart.h>
#include <sim_avr.h>
#include <sim_elf.h>
#include <sim_io.h>

#define GPIOR0_ADDRESS 0x3e
#define GPIOR1_ADDRESS 0x4a
#define NAMES_MAX      32
#define CYCLES_MAX     2000000000u
#define RAM_BEGIN      0x200u
#define PAINT          0xC5
#define RAM_BYTES      8192u
#define PAINTED_BYTES  64u /* above the variables: that the stack must leave as they are */

typedef struct {
    char name[40];
    uint64_t least;
    uint64_t most;
} figure_t;

typedef struct {
    figure_t figures[NAMES_MAX];
    int count;
    int current;
    uint64_t started;
    char line[200];
    size_t length;
    bool passed;
    size_t variable_bytes;
    uint8_t kept[RAM_BYTES]; /* the variables, at the program's wish */
} runner_t;

static int figure_named(runner_t *runner, const char *name)
{
    for (int k = 0; k < runner->count; k++) {
        if (strcmp(runner->figures[k].name, name) == 0) {
            return k;
        }
    }
    if (runner->count == NAMES_MAX) {
        return -1;
    }
    figure_t *figure = &runner->figures[runner->count];
    memccpy(figure->name, name, '\0', sizeof figure->name - 1);
    figure->least = UINT64_MAX;
    figure->most = 0;
    return runner->count++;
}

static void on_mark(avr_t *avr, avr_io_addr_t address, uint8_t value, void *parameter)
{
    runner_t *runner = parameter;
    avr->data[address] = value;
    if (value != 0) {
        runner->started = avr->cycle;
    } else if (runner->current >= 0) {
        figure_t *figure = &runner->figures[runner->current];
        uint64_t cycles = avr->cycle - runner->started;
        cycles = cycles > 1u ? cycles - 1u : 0u; /* the stop mark's OUT */
        figure->least = cycles < figure->least ? cycles : figure->least;
        figure->most = cycles > figure->most ? cycles : figure->most;
    }
}

static void on_keep(avr_t *avr, avr_io_addr_t address, uint8_t value, void *parameter)
{
    runner_t *runner = parameter;
    avr->data[address] = value;
    if (value == 1) {
        memcpy(runner->kept, avr->data + RAM_BEGIN, runner->variable_bytes);
    } else {
        memcpy(avr->data + RAM_BEGIN, runner->kept, runner->variable_bytes);
    }
}

static void on_byte(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq;
    runner_t *runner = parameter;
    if (value != '\n') {
        if (runner->length + 1 < sizeof runner->line) {
            runner->line[runner->length++] = (char)value;
        }
        return;
    }
    runner->line[runner->length] = '\0';
    runner->length = 0;
    if (runner->line[0] == '@') {
        runner->current = figure_named(runner, runner->line + 1);
    } else if (runner->line[0] == '#') {
        printf("%s\n", runner->line + 1);
    } else if (strcmp(runner->line, "PASS") == 0) {
        runner->passed = true;
    } else {
        printf("target: %s\n", runner->line);
    }
}

static bool is_painted(const uint8_t *at)
{
    for (unsigned k = 0; k < PAINTED_BYTES; k++) {
        if (at[k] != PAINT) {
            return false;
        }
    }
    return true;
}

int main(int argc, char **argv)
{
    if (argc < 2 || argc % 2 != 0) {
        fprintf(stderr, "usage: %s ELF [NAME MAX_CYCLES]...\n", argv[0]);
        return 2;
    }
    elf_firmware_t firmware;
    memset(&firmware, 0, sizeof firmware);
    if (elf_read_firmware(argv[1], &firmware) != 0) {
        fprintf(stderr, "%s: not an ELF that can be read; build the avr target first\n", argv[1]);
        return 2;
    }
    avr_t *avr = avr_make_mcu_by_name("atmega2560");
    if (avr == NULL) {
        fprintf(stderr, "this simavr does not know the atmega2560\n");
        return 2;
    }
    avr_init(avr);
    firmware.frequency = 16000000;
    avr_load_firmware(avr, &firmware);
    static runner_t runner = {.current = -1};
    runner.variable_bytes = (size_t)firmware.datasize + firmware.bsssize;
    if (runner.variable_bytes > RAM_BYTES - PAINTED_BYTES) {
        fprintf(stderr, "%s: its variables leave no room for a stack\n", argv[1]);
        return 2;
    }
    uint8_t *const above_variables = avr->data + RAM_BEGIN + runner.variable_bytes;
    memset(above_variables, PAINT, PAINTED_BYTES);
    avr_register_io_write(avr, GPIOR0_ADDRESS, on_mark, &runner);
    avr_register_io_write(avr, GPIOR1_ADDRESS, on_keep, &runner);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT),
                            on_byte, &runner);
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)AVR_UART_FLAG_STDIO;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);

    int state = cpu_Running;
    while (state != cpu_Done && state != cpu_Crashed && avr->cycle < CYCLES_MAX) {
        state = avr_run(avr);
    }
    bool good = runner.passed && state == cpu_Done;
    if (!good) {
        printf("the program did not end with PASS\n");
    }
    if (!is_painted(above_variables)) {
        printf("the stack has met the variables\n");
        good = false;
    }
    for (int k = 0; k < runner.count; k++) {
        printf("%s %" PRIu64 " %" PRIu64 "\n", runner.figures[k].name, runner.figures[k].least,
               runner.figures[k].most);
    }
    for (int k = 2; k + 1 < argc; k += 2) {
        char *end;
        errno = 0;
        unsigned long limit = strtoul(argv[k + 1], &end, 10);
        if (errno != 0 || *end != '\0') {
            fprintf(stderr, "%s: not a number of cycles\n", argv[k + 1]);
            return 2;
        }
        int index = figure_named(&runner, argv[k]);
        if (index < 0 || runner.figures[index].most == 0 || runner.figures[index].most > limit) {
            printf("%s: above %lu cycles, or never counted\n", argv[k], limit);
            good = false;
        }
    }
    return good ? 0 : 1;
}
