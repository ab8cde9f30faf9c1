#include "board_eeprom.h"

#include <string.h>

#include "board_registers.h"

#define EEPM            0x30u
#define EEPM_ERASE_ONLY 0x10u
#define EEPM_WRITE_ONLY 0x20u
#define EERIE           0x08u
#define EEMPE           0x04u
#define EEPE            0x02u
#define EERE            0x01u
#define ENABLE_CYCLES   4u
#define BOTH_US         3400u
#define EITHER_US       1800u
#define CYCLES_PER_US   16u

static avr_cycle_count_t write_us(const board_eeprom_t *eeprom)
{
    return (eeprom->avr->data[REGISTER_EECR] & EEPM) == 0 ? BOTH_US : EITHER_US;
}

static void finish(board_eeprom_t *eeprom)
{
    uint8_t mode = eeprom->avr->data[REGISTER_EECR] & EEPM;
    uint8_t *cell = &eeprom->cell[eeprom->address];
    if (eeprom->worn) {
        ; /* as it was */
    } else if (mode == EEPM_ERASE_ONLY) {
        *cell = 0xFF;
    } else if (mode == EEPM_WRITE_ONLY) {
        *cell &= eeprom->value;
    } else {
        *cell = eeprom->value;
    }
    eeprom->writing = false;
    eeprom->writes++;
}

static void raise_level(board_eeprom_t *eeprom)
{
    uint8_t control = eeprom->avr->data[REGISTER_EECR];
    if ((control & EERIE) != 0 && (control & EEPE) == 0) {
        avr_raise_interrupt(eeprom->avr, eeprom->vector);
    }
}

static avr_cycle_count_t written(avr_t *avr, avr_cycle_count_t when, void *param)
{
    board_eeprom_t *eeprom = param;
    (void)when;
    finish(eeprom);
    avr->data[REGISTER_EECR] &= (uint8_t)~EEPE;
    raise_level(eeprom);
    return 0;
}

static avr_cycle_count_t enable_over(avr_t *avr, avr_cycle_count_t when, void *param)
{
    board_eeprom_t *eeprom = param;
    (void)when;
    eeprom->enabled = false;
    avr->data[REGISTER_EECR] &= (uint8_t)~EEMPE;
    return 0;
}

static void write_control(avr_t *avr, avr_io_addr_t register_address, uint8_t value, void *param)
{
    board_eeprom_t *eeprom = param;
    uint8_t *control = &avr->data[register_address];
    uint16_t address =
        (uint16_t)(((unsigned)avr->data[REGISTER_EEARH] << 8 | avr->data[REGISTER_EEARL]) &
                   (BOARD_EEPROM_SIZE - 1u));
    uint8_t mode = eeprom->writing ? (*control & EEPM) : (value & EEPM);
    *control = (uint8_t)((*control & (EEPE | EEMPE)) | mode | (value & EERIE));
    if ((value & EEMPE) != 0 && (value & EEPE) == 0) {
        eeprom->enabled = true;
        *control |= EEMPE;
        avr_cycle_timer_register(avr, ENABLE_CYCLES, enable_over, eeprom);
    }
    if ((value & EEPE) != 0 && eeprom->enabled && !eeprom->writing) {
        avr_cycle_timer_cancel(avr, enable_over, eeprom);
        eeprom->enabled = false;
        eeprom->writing = true;
        eeprom->address = address;
        eeprom->value = avr->data[REGISTER_EEDR];
        eeprom->begun_cycle = avr->cycle;
        *control = (uint8_t)((*control & ~EEMPE) | EEPE);
        avr_cycle_timer_register(avr, write_us(eeprom) * CYCLES_PER_US, written, eeprom);
    } else if ((value & EERE) != 0 && !eeprom->writing) {
        avr->data[REGISTER_EEDR] = eeprom->cell[address];
    }
    raise_level(eeprom);
}

/* The interrupt is a level too: it comes again when its routine returns. */
static void interrupt_running(struct avr_irq_t *irq, uint32_t running, void *param)
{
    (void)irq;
    if (running == 0) {
        raise_level(param);
    }
}

void board_eeprom_attach(board_eeprom_t *eeprom, avr_t *avr)
{
    memset(eeprom, 0, sizeof *eeprom);
    memset(eeprom->cell, 0xFF, sizeof eeprom->cell);
    eeprom->avr = avr;
    eeprom->vector = board_find_vector(avr, VECTOR_EE_READY);
    avr_irq_register_notify(eeprom->vector->irq + AVR_INT_IRQ_RUNNING, interrupt_running, eeprom);
    board_take_register(avr, REGISTER_EECR, NULL, write_control, eeprom);
}

void board_eeprom_reset(board_eeprom_t *eeprom)
{
    if (eeprom->writing) {
        finish(eeprom);
    }
    eeprom->enabled = false;
}

void board_eeprom_power_cut(board_eeprom_t *eeprom)
{
    if (!eeprom->writing) {
        return;
    }
    uint64_t half = write_us(eeprom) * CYCLES_PER_US / 2u;
    uint64_t elapsed = eeprom->avr->cycle - eeprom->begun_cycle;
    uint8_t *cell = &eeprom->cell[eeprom->address];
    if (elapsed < half) {
        *cell = 0xFF;
    } else {
        *cell = (uint8_t)(eeprom->value | (0xFFu << ((elapsed - half) * 8u / half)));
    }
    eeprom->writing = false;
}
