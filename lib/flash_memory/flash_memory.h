/* What it is for: constant tables and texts that stay in flash on the AVR, whose RAM is 8 KB.
 * What it owns: nothing.
 * What it never does: change anything on another machine. */
#ifndef FLASH_MEMORY_H
#define FLASH_MEMORY_H

#ifdef __AVR__
#include <avr/pgmspace.h>
#define FLASH_MEMORY               PROGMEM
#define FLASH_TEXT(text)           PSTR(text)
#define flash_copy(to, from, size) memcpy_P((to), (from), (size))
#define flash_byte(address)        pgm_read_byte(address)
#define flash_word(address)        pgm_read_word(address)
#define flash_equal(text, flash)   (strcmp_P((text), (flash)) == 0)
#else
#include <string.h>
#define FLASH_MEMORY
#define FLASH_TEXT(text)           (text)
#define flash_copy(to, from, size) memcpy((to), (from), (size))
#define flash_byte(address)        (*(const unsigned char *)(address))
#define flash_word(address)        (*(address))
#define flash_equal(text, flash)   (strcmp((text), (flash)) == 0)
#endif

#endif
