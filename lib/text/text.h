/* What it is for: short lines of text out and decimal numbers in, without printf, float or
 * division.
 * What it owns: nothing; buffers are the caller's.
 * What it never does: write past a buffer: what does not fit is cut. */
#ifndef TEXT_H
#define TEXT_H

#include <stdbool.h>
#include <stdint.h>

#include "flash_memory.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Where text goes. write is only called with no more bytes than room returned. */
typedef struct {
    void *context;
    uint16_t (*room)(void *context); /* bytes that can be taken at once, now */
    void (*write)(void *context, const char *bytes, uint8_t length);
} text_output_t;

typedef enum {
    TEXT_OK = 0,
    TEXT_NOT_A_NUMBER, /* not digits with at most one point; more decimals than wanted */
    TEXT_TOO_LARGE     /* beyond +-2147483647 */
} text_result_t;

/* "0.0058" with 6 decimals becomes 5800. Sign allowed; no exponent, no blanks. */
text_result_t text_parse_decimal(const char *text, uint8_t decimals, int32_t *value);

#define TEXT_DECIMAL_SIZE 14 /* sign, ten digits, point, zero; and one to spare */
/* 5800 with 6 decimals becomes "0.005800"; decimals at most 9. Returns the length. By subtraction:
 * 3 digits of a temperature cost a tenth of what the AVR's 32-bit division does. */
uint8_t text_format_decimal(int32_t value, uint8_t decimals, char *text);

/* Since the start, for as long as a board runs: 68 years. */
typedef struct {
    uint32_t s;
    uint16_t ms; /* 0..999 */
} text_time_t;

/* by_ms later. O(1), divides where a second is full. */
void text_time_add(text_time_t *time, uint32_t by_ms);

/* A line under construction. */
typedef struct {
    char *bytes;
    uint8_t size;
    uint8_t length;
} text_line_t;

void text_line_start(text_line_t *line, char *bytes, uint8_t size);
void text_add_char(text_line_t *line, char character);
void text_add(text_line_t *line, const char *text);
/* text as given by FLASH_TEXT or a FLASH_MEMORY array. */
void text_add_flash(text_line_t *line, const char *text);
void text_add_decimal(text_line_t *line, int32_t value, uint8_t decimals);
/* The same as text_add_flash, but each "#" and the digit after it become the next of `values`, with
 * so many decimals. */
void text_add_values(text_line_t *line, const char *text, const int32_t values[]);

/* "12.340" s. */
void text_add_time_s(text_line_t *line, const text_time_t *time);
/* "12340" ms. */
void text_add_time_ms(text_line_t *line, const text_time_t *time);

/* Of texts in flash, one behind the other with its terminating zero, the one with that index. */
const char *text_item(const char *texts, uint8_t index);

/* Q9.7 degC in 1/100 degC, rounded. */
int16_t text_centi_from_c7(int16_t temperature_c7);

#ifdef __cplusplus
}
#endif
#endif
