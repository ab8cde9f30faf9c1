#include "board_registers.h"

#include <stddef.h>

avr_int_vector_t *board_find_vector(avr_t *avr, uint8_t number)
{
    for (int k = 0; k < avr->interrupts.vector_count; k++) {
        if (avr->interrupts.vector[k]->vector == number) {
            return avr->interrupts.vector[k];
        }
    }
    return NULL;
}

void board_take_register(avr_t *avr, avr_io_addr_t address, avr_io_read_t read,
                         avr_io_write_t write, void *param)
{
    avr_io_addr_t io = (avr_io_addr_t)AVR_DATA_TO_IO(address);
    avr->io[io].r.c = read;
    avr->io[io].r.param = param;
    avr->io[io].w.c = write;
    avr->io[io].w.param = param;
}

void board_plain_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    (void)param;
    avr->data[address] = value;
}
