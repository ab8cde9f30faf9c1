/* What it is for: an EEPROM in memory, for the tests of what is kept in one.
 * What it owns: its bytes, how many writes the power lasts for, and a cell that keeps nothing.
 * What it never does: be busy, or take a write outside what a test allows. */
#ifndef FAKE_EEPROM_H
#define FAKE_EEPROM_H

#include <limits.h>

#include "../run_tests.h"
#include "settings.h"

#define EEPROM_BYTES (SETTINGS_LEARNT_BASE + 2u * SETTINGS_LEARNT_SLOT_BYTES)

static uint8_t memory[EEPROM_BYTES];
static unsigned memory_begin, memory_end = EEPROM_BYTES; /* where writes may go */
static unsigned writes;
static unsigned writes_left = UINT_MAX; /* before the power goes */
static unsigned worn = EEPROM_BYTES;    /* this cell keeps nothing */

static uint8_t memory_read(void *context, uint16_t address)
{
    (void)context;
    TEST_ASSERT_LESS_THAN_UINT(memory_end, address);
    return memory[address];
}

static bool memory_ready(void *context)
{
    (void)context;
    return true;
}

static void memory_write(void *context, uint16_t address, uint8_t value)
{
    (void)context;
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(memory_begin, address);
    TEST_ASSERT_LESS_THAN_UINT(memory_end, address);
    writes++;
    if (writes_left == 0 || address == worn) {
        return;
    }
    writes_left--;
    memory[address] = value;
}

static const record_storage_t storage = {NULL, memory_read, memory_ready, memory_write};

#endif
