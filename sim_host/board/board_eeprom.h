/* What it is for: the Mega's EEPROM with its true write time, so that power can fail in the middle
 * of a byte.
 * What it owns: EECR of the simulated chip and the 4096 bytes.
 * What it never does: keep a file; simavr 1.6's model writes at once and never shows EEPE set.
 * Source: ATmega2560 data sheet, section 8.3; 3.4 ms a byte (erase and write), 1.8 ms for either
 * alone. */
#ifndef BOARD_EEPROM_H
#define BOARD_EEPROM_H

#include <stdbool.h>
#include <stdint.h>

#include <simavr/sim_avr.h>

#ifdef __cplusplus
extern "C" {
#endif

#define BOARD_EEPROM_SIZE 4096u

typedef struct {
    avr_t *avr;
    avr_int_vector_t *vector;
    uint8_t cell[BOARD_EEPROM_SIZE];
    bool writing;
    bool enabled; /* EEMPE's four cycles */
    bool worn;    /* keeps nothing that is written */
    uint16_t address;
    uint8_t value;
    uint64_t begun_cycle;
    uint64_t writes; /* bytes completed since the board was made */
} board_eeprom_t;

void board_eeprom_attach(board_eeprom_t *eeprom, avr_t *avr);
/* After a reset of the chip with the supply up: a write under way runs to its end (here: at once).
 */
void board_eeprom_reset(board_eeprom_t *eeprom);
/* The supply fails now: a byte under way is left erased (0xFF) in its first half, and with only
 * some of its bits programmed in its second. */
void board_eeprom_power_cut(board_eeprom_t *eeprom);

#ifdef __cplusplus
}
#endif
#endif
