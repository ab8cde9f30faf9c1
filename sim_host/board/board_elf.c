#include "board_elf.h"

#include <errno.h>
#include <fcntl.h>
#include <gelf.h>
#include <libelf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MACHINE_AVR 83
#define RAM_END     0x2200u

static bool load_segments(board_elf_t *image, Elf *elf, const char *bytes, size_t size)
{
    size_t count = 0;
    if (elf_getphdrnum(elf, &count) != 0) {
        return false;
    }
    for (size_t k = 0; k < count; k++) {
        GElf_Phdr segment;
        if (gelf_getphdr(elf, (int)k, &segment) == NULL) {
            return false;
        }
        if (segment.p_type != PT_LOAD || segment.p_filesz == 0 || segment.p_paddr >= 0x800000u) {
            continue;
        }
        if (segment.p_paddr + segment.p_filesz > BOARD_FLASH_SIZE ||
            segment.p_offset + segment.p_filesz > size) {
            return false;
        }
        memcpy(image->flash + segment.p_paddr, bytes + segment.p_offset, segment.p_filesz);
        if (segment.p_paddr + segment.p_filesz > image->flash_used) {
            image->flash_used = (uint32_t)(segment.p_paddr + segment.p_filesz);
        }
    }
    return image->flash_used > 0;
}

static bool load_symbol(board_elf_t *image, Elf *elf, size_t names, const GElf_Sym *symbol)
{
    const char *name = elf_strptr(elf, names, symbol->st_name);
    if (name == NULL || name[0] == '\0') {
        return true;
    }
    board_symbol_t *entry = &image->symbols[image->symbol_count];
    entry->name = strdup(name);
    entry->address = (uint32_t)symbol->st_value;
    entry->size = (uint32_t)symbol->st_size;
    if (entry->name == NULL) {
        return false;
    }
    image->symbol_count++;
    return true;
}

static bool load_sections(board_elf_t *image, Elf *elf)
{
    for (Elf_Scn *section = elf_nextscn(elf, NULL); section != NULL;
         section = elf_nextscn(elf, section)) {
        GElf_Shdr header;
        if (gelf_getshdr(section, &header) == NULL) {
            return false;
        }
        if ((header.sh_flags & SHF_ALLOC) != 0 && header.sh_addr >= BOARD_RAM_OFFSET &&
            header.sh_addr < BOARD_RAM_OFFSET + RAM_END) {
            image->ram_static += (uint32_t)header.sh_size;
        }
        if (header.sh_type != SHT_SYMTAB || header.sh_entsize == 0) {
            continue;
        }
        size_t count = header.sh_size / header.sh_entsize;
        Elf_Data *data = elf_getdata(section, NULL);
        free(image->symbols);
        image->symbol_count = 0;
        image->symbols = calloc(count > 0 ? count : 1, sizeof *image->symbols);
        if (data == NULL || image->symbols == NULL) {
            return false;
        }
        for (size_t k = 0; k < count; k++) {
            GElf_Sym symbol;
            if (gelf_getsym(data, (int)k, &symbol) == NULL ||
                !load_symbol(image, elf, header.sh_link, &symbol)) {
                return false;
            }
        }
    }
    return true;
}

static const char *load(board_elf_t *image, int file)
{
    const char *complaint = NULL;
    Elf *elf = elf_begin(file, ELF_C_READ, NULL);
    size_t size = 0;
    char *bytes = elf != NULL ? elf_rawfile(elf, &size) : NULL;
    GElf_Ehdr header;
    if (bytes == NULL || elf_kind(elf) != ELF_K_ELF || gelf_getehdr(elf, &header) == NULL) {
        complaint = "not an ELF file: give the firmware.elf of the avr build";
    } else if (header.e_machine != MACHINE_AVR) {
        complaint = "an ELF file for another processor: give the firmware.elf of the avr build";
    } else if (!load_segments(image, elf, bytes, size) || !load_sections(image, elf)) {
        complaint = "damaged, or too large for an ATmega2560: build it again";
    }
    if (elf != NULL) {
        elf_end(elf);
    }
    return complaint;
}

board_elf_t *board_elf_read(const char *path, char *error, size_t error_size)
{
    board_elf_t *image = calloc(1, sizeof *image);
    int file = open(path, O_RDONLY);
    const char *complaint = NULL;
    if (image == NULL || file < 0) {
        complaint = strerror(errno);
    } else if (elf_version(EV_CURRENT) == EV_NONE) {
        complaint = "libelf is of another version than its header";
    } else {
        memset(image->flash, 0xFF, sizeof image->flash);
        complaint = load(image, file);
    }
    if (file >= 0) {
        close(file);
    }
    if (complaint != NULL) {
        snprintf(error, error_size, "%s: %s", path, complaint);
        board_elf_free(image);
        return NULL;
    }
    return image;
}

void board_elf_free(board_elf_t *elf)
{
    if (elf == NULL) {
        return;
    }
    for (size_t k = 0; k < elf->symbol_count; k++) {
        free(elf->symbols[k].name);
    }
    free(elf->symbols);
    free(elf);
}

const board_symbol_t *board_elf_symbol(const board_elf_t *elf, const char *name)
{
    const size_t length = strlen(name);
    const board_symbol_t *clone = NULL;
    for (size_t k = 0; k < elf->symbol_count; k++) {
        const char *found = elf->symbols[k].name;
        if (strcmp(found, name) == 0) {
            return &elf->symbols[k];
        }
        if (strncmp(found, name, length) == 0 && found[length] == '.') {
            clone = &elf->symbols[k];
        }
    }
    return clone;
}
