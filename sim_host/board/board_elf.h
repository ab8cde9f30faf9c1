/* What it is for: reads an AVR program from an ELF file: flash and EEPROM images, symbols.
 * What it owns: the images and the symbol table.
 * What it never does: guess: what is not an ATmega2560 program is refused with a reason. */
#ifndef BOARD_ELF_H
#define BOARD_ELF_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define BOARD_FLASH_SIZE 0x40000u
#define BOARD_RAM_OFFSET 0x800000u /* of data addresses in the ELF */

typedef struct {
    char *name;
    uint32_t address; /* as in the ELF: flash in bytes, RAM at BOARD_RAM_OFFSET */
    uint32_t size;
} board_symbol_t;

typedef struct {
    uint8_t flash[BOARD_FLASH_SIZE];
    uint32_t flash_used; /* one past the last byte */
    uint32_t ram_static; /* bytes of RAM that .data, .bss and .noinit take */
    board_symbol_t *symbols;
    size_t symbol_count;
} board_elf_t;

/* Fails (NULL, with one line in `error`) if and only if the file cannot be read or is no program
 * for this chip. */
board_elf_t *board_elf_read(const char *path, char *error, size_t error_size);
void board_elf_free(board_elf_t *elf);
/* NULL if there is none of that name, nor NAME.something: a copy that the linker specialised. */
const board_symbol_t *board_elf_symbol(const board_elf_t *elf, const char *name);

#ifdef __cplusplus
}
#endif
#endif
