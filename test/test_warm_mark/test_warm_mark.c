#include "warm_mark.h"

#include <string.h>

#include "../fakes/eeprom.h"

#define BASE 100u

static bool busy;

static bool is_ready(void *context)
{
    (void)context;
    return !busy;
}

static uint8_t read_ready(void *context, uint16_t address)
{
    TEST_ASSERT_FALSE_MESSAGE(busy, "it would wait");
    return memory_read(context, address);
}

static const record_storage_t eeprom = {NULL, read_ready, is_ready, memory_write};

void setUp(void)
{
    memset(memory, 0xFF, sizeof memory);
    memory_begin = BASE;
    memory_end = BASE + WARM_MARK_BYTES;
    writes = 0;
    writes_left = UINT_MAX;
    worn = EEPROM_BYTES;
    busy = false;
}

void tearDown(void) {}

/* A minute of each. */
static void minute(bool warm, uint32_t from_s)
{
    for (uint32_t s = 0; s < 60; s++) {
        warm_mark_second(&eeprom, BASE, warm, from_s + s);
        TEST_ASSERT_EQUAL(warm, warm_mark_is_set(&eeprom, BASE));
    }
}

TEST(a_drive_takes_two_writes)
{
    minute(false, 0);
    TEST_ASSERT_EQUAL_UINT(0, writes);
    minute(true, 60);
    TEST_ASSERT_EQUAL_UINT(1, writes);
    minute(false, 120);
    TEST_ASSERT_EQUAL_UINT(2, writes);
}

/* Of 160 drives that begin at any second each cell takes its share. */
TEST(drives_wear_one_cell_as_much_as_another)
{
    for (uint8_t cell = 0; cell < WARM_MARK_BYTES; cell++) {
        warm_mark_second(&eeprom, BASE, true, 4294967280u + cell);
        TEST_ASSERT_EQUAL_HEX8(0x00, memory[BASE + cell]);
        warm_mark_second(&eeprom, BASE, false, 0);
        TEST_ASSERT_EQUAL_HEX8(0xFF, memory[BASE + cell]);
    }
}

/* Whatever the cut has left in the cell, but that it was erased: then the power began just now. */
TEST(a_write_that_was_cut_short_is_a_mark)
{
    for (unsigned left = 0; left < 255u; left++) {
        setUp();
        memory[BASE + left % WARM_MARK_BYTES] = (uint8_t)left;
        TEST_ASSERT_TRUE(warm_mark_is_set(&eeprom, BASE));
        warm_mark_second(&eeprom, BASE, true, 0);
        TEST_ASSERT_EQUAL_UINT(0, writes);
        warm_mark_second(&eeprom, BASE, false, 0);
        TEST_ASSERT_FALSE(warm_mark_is_set(&eeprom, BASE));
    }
}

TEST(a_worn_cell_leaves_the_mark_to_another)
{
    worn = BASE + 3u;
    warm_mark_second(&eeprom, BASE, true, 3);
    TEST_ASSERT_FALSE(warm_mark_is_set(&eeprom, BASE));
    minute(true, 4);
    TEST_ASSERT_EQUAL_UINT(2, writes);
}

/* What was there before this program had the cells: all of it goes, one a second. */
TEST(what_others_left_is_taken_away)
{
    memset(memory, 0x5A, sizeof memory);
    for (uint32_t s = 0; s < WARM_MARK_BYTES; s++) {
        TEST_ASSERT_TRUE(warm_mark_is_set(&eeprom, BASE));
        warm_mark_second(&eeprom, BASE, false, s);
    }
    TEST_ASSERT_FALSE(warm_mark_is_set(&eeprom, BASE));
}

TEST(what_is_being_written_is_waited_for_by_nobody)
{
    busy = true;
    warm_mark_second(&eeprom, BASE, true, 0);
    TEST_ASSERT_EQUAL_UINT(0, writes);
    busy = false;
    warm_mark_second(&eeprom, BASE, true, 1);
    TEST_ASSERT_EQUAL_UINT(1, writes);
}
