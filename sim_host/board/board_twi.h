/* What it is for: the Mega's I2C master with the bus's true timing, in place of simavr 1.6's (one
 * microsecond a bit).
 * What it owns: TWCR, TWDR and TWSR of the simulated chip, and the state of the bus.
 * What it never does: be a slave, or know what hangs on the bus: devices are functions. Source:
 * ATmega2560 data sheet, section 24 (two-wire interface), tables 24-2 and 24-3. */
#ifndef BOARD_TWI_H
#define BOARD_TWI_H

#include <stdbool.h>
#include <stdint.h>

#include <simavr/sim_avr.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    void *context;
    bool (*begin)(void *context, uint8_t address, bool read); /* whether it was acknowledged */
    void (*write)(void *context, uint8_t address, uint8_t byte);
    uint8_t (*read)(void *context, uint8_t address);
} board_twi_devices_t;

typedef enum {
    BOARD_TWI_NOTHING = 0,
    BOARD_TWI_START,
    BOARD_TWI_ADDRESS,
    BOARD_TWI_TRANSMIT,
    BOARD_TWI_RECEIVE,
    BOARD_TWI_STOP
} board_twi_operation_t;

typedef struct {
    avr_t *avr;
    avr_int_vector_t *vector;
    board_twi_devices_t devices;
    board_twi_operation_t operation; /* under way */
    bool start_follows_stop;
    bool owns_bus;  /* between our START and our STOP */
    bool addressed; /* a slave has acknowledged */
    bool fresh;     /* the next byte is an address */
    bool reading;
    bool acknowledge; /* TWEA when the byte began */
    uint8_t address;
    bool sda_stuck_low;
    double stretch; /* of the clock */
} board_twi_t;

/* Takes the registers over from simavr's own model. */
void board_twi_attach(board_twi_t *twi, avr_t *avr, const board_twi_devices_t *devices);
/* After a reset of the chip. */
void board_twi_reset(board_twi_t *twi);
/* While SDA is held low nothing can begin or end on the bus; on release what waits goes on. */
void board_twi_hold_sda(board_twi_t *twi, bool low);

#ifdef __cplusplus
}
#endif
#endif
