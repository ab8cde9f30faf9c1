/* What it is for: a record of bytes that outlives the power, in an EEPROM, whatever the record is.
 * What it owns: two slots a kind of record, which of them is the newer, a save under way.
 * What it never does: wait for a byte to be written, or know what the bytes mean. */
#ifndef RECORD_STORE_H
#define RECORD_STORE_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A save writes the older slot. Bytes of a slot:
 *   0      0xA5 once the record is complete: cleared first, written last
 *   1      kind: what is kept, and in which format
 *   2..3   sequence number, low byte first; the higher (as a serial number) is the newer
 *   4..5   bytes that follow, without the last two
 *   6..    these
 *   last 2 CRC-16 over bytes 1 to here
 * So a cut at any byte leaves the other slot. */
#define RECORD_OVERHEAD_BYTES 8u

typedef struct {
    void *context;
    uint8_t (*read)(void *context, uint16_t address);
    bool (*ready)(void *context); /* a write may be started */
    void (*write)(void *context, uint16_t address, uint8_t value);
} record_storage_t;

/* The record's byte at a position; called with 0, 1, 2, ... as each is about to be written. */
typedef uint8_t (*record_byte_t)(void *context, uint16_t position);

typedef enum {
    RECORD_LOADED = 0,
    RECORD_LOADED_OTHER, /* one slot is damaged or was cut short; the other one is it */
    RECORD_EMPTY,        /* nothing was ever saved */
    RECORD_DAMAGED,      /* no slot is whole */
    RECORD_FOREIGN       /* of another kind, which this version does not know */
} record_found_t;

typedef enum {
    RECORD_SAVE_IDLE = 0,
    RECORD_SAVE_BUSY,
    RECORD_SAVE_DONE,
    RECORD_SAVE_FAILED
} record_save_t;

/* Internal, filled by record_store_open. */
typedef struct {
    const record_storage_t *storage;
    uint16_t base; /* address of the first slot; the second follows */
    uint16_t slot_bytes;
    uint8_t kind;
    uint8_t slot;      /* of the newest record: 0 or 1 */
    uint16_t length;   /* its bytes; 0: there is none */
    uint16_t sequence; /* its number */
    record_byte_t byte;
    void *context;
    uint16_t saved_length;
    uint16_t position; /* in the slot: what is written next */
    uint16_t crc;
    uint8_t phase;
    uint8_t written; /* the byte before */
    uint8_t state;   /* record_save_t */
} record_store_t;

/* Finds the newest whole record of that kind in the two slots. O(slot_bytes). */
record_found_t record_store_open(record_store_t *store, const record_storage_t *storage,
                                 uint16_t base, uint16_t slot_bytes, uint8_t kind);
/* Of the newest record; 0: there is none. */
uint16_t record_store_length(const record_store_t *store);
/* position must be below record_store_length. */
uint8_t record_store_read(const record_store_t *store, uint16_t position);

/* Starts a save of `length` bytes, at most slot_bytes - RECORD_OVERHEAD_BYTES, after
 * record_store_open. */
void record_store_save(record_store_t *store, record_byte_t byte, void *context, uint16_t length);
/* Reads back the byte written last and writes the next one, only when the storage is ready: O(1).
 * FAILED if and only if a byte does not read back as written; the other slot then still holds the
 * record before.
 */
record_save_t record_store_step(record_store_t *store);

#ifdef __cplusplus
}
#endif
#endif
