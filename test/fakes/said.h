/* What it is for: a text output in memory, for the tests of what is said.
 * What it owns: what was said since it was forgotten, and the room that is left for more.
 * What it never does: take more than it has said that it has room for. */
#ifndef FAKE_SAID_H
#define FAKE_SAID_H

#include <string.h>

#include "../run_tests.h"
#include "text.h"

static char said[65536];
static size_t said_length;
static uint16_t room;
static bool room_fills; /* what is said takes room until a test gives it back */

static uint16_t out_room(void *context)
{
    (void)context;
    return room;
}

static void out_write(void *context, const char *bytes, uint8_t length)
{
    (void)context;
    TEST_ASSERT_LESS_OR_EQUAL_UINT(room, length);
    TEST_ASSERT_LESS_THAN_UINT(sizeof said - 1u, said_length + length);
    memcpy(said + said_length, bytes, length);
    said_length += length;
    said[said_length] = '\0';
    room = (uint16_t)(room - (room_fills ? length : 0u));
}

static const text_output_t output = {NULL, out_room, out_write};

static inline void forget(void)
{
    said_length = 0;
    said[0] = '\0';
}

static inline unsigned occurrences(const char *part)
{
    unsigned count = 0;
    for (const char *at = said; (at = strstr(at, part)) != NULL; at++) {
        count++;
    }
    return count;
}

static inline void expect_said(const char *part)
{
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, part), said);
}

#endif
