#include "record_store.h"

#include <stddef.h>
#include <string.h>

#include "crc16.h"

#define COMPLETE   0xA5u
#define HEAD_BYTES 6u
#define ERASED     0xFFu
#define CLEARED    0x00u

static uint16_t address_of(const record_store_t *store, uint8_t slot, uint16_t position)
{
    return (uint16_t)(store->base + (slot == 0 ? 0u : store->slot_bytes) + position);
}

static uint8_t slot_byte(const record_store_t *store, uint8_t slot, uint16_t position)
{
    return store->storage->read(store->storage->context, address_of(store, slot, position));
}

static uint16_t slot_word(const record_store_t *store, uint8_t slot, uint16_t position)
{
    const uint16_t low = slot_byte(store, slot, position);
    return (uint16_t)(low | (uint16_t)slot_byte(store, slot, (uint16_t)(position + 1u)) << 8);
}

/* --- reading -------------------------------------------------------------------------------- */

static record_found_t examine(const record_store_t *store, uint8_t slot)
{
    const uint8_t complete = slot_byte(store, slot, 0);
    const uint8_t kind = slot_byte(store, slot, 1);
    if (complete == ERASED && kind == ERASED) {
        return RECORD_EMPTY;
    }
    if (complete != COMPLETE) {
        return RECORD_DAMAGED;
    }
    if (kind != store->kind) {
        return RECORD_FOREIGN; /* its layout is unknown, so nothing can be checked */
    }
    const uint16_t length = slot_word(store, slot, 4);
    if (length > store->slot_bytes - RECORD_OVERHEAD_BYTES) {
        return RECORD_DAMAGED;
    }
    const uint16_t covered = (uint16_t)(HEAD_BYTES + length);
    uint16_t crc = CRC16_START;
    for (uint16_t i = 1; i < covered; i++) {
        crc = crc16_add(crc, slot_byte(store, slot, i));
    }
    return crc == slot_word(store, slot, covered) ? RECORD_LOADED : RECORD_DAMAGED;
}

record_found_t record_store_open(record_store_t *store, const record_storage_t *storage,
                                 uint16_t base, uint16_t slot_bytes, uint8_t kind)
{
    memset(store, 0, sizeof *store);
    store->storage = storage;
    store->base = base;
    store->slot_bytes = slot_bytes;
    store->kind = kind;
    const record_found_t found[2] = {examine(store, 0), examine(store, 1)};
    const uint16_t sequence[2] = {slot_word(store, 0, 2), slot_word(store, 1, 2)};
    store->slot = 1; /* where there is none, the first save writes slot 0 */
    if (found[0] == RECORD_LOADED || found[1] == RECORD_LOADED) {
        /* of two the one with the later sequence number, as serial numbers go (RFC 1982) */
        const bool second_is_later = (uint16_t)(sequence[1] - sequence[0]) < 0x8000u;
        store->slot = found[0] != RECORD_LOADED || (found[1] == RECORD_LOADED && second_is_later);
        store->length = slot_word(store, store->slot, 4);
        store->sequence = sequence[store->slot];
        const record_found_t other = found[1u - store->slot];
        return other == RECORD_DAMAGED || other == RECORD_FOREIGN ? RECORD_LOADED_OTHER
                                                                  : RECORD_LOADED;
    }
    if (found[0] == found[1]) {
        return found[0];
    }
    return found[0] == RECORD_FOREIGN || found[1] == RECORD_FOREIGN ? RECORD_FOREIGN
                                                                    : RECORD_DAMAGED;
}

uint16_t record_store_length(const record_store_t *store)
{
    return store->length;
}

uint8_t record_store_read(const record_store_t *store, uint16_t position)
{
    return slot_byte(store, store->slot, (uint16_t)(HEAD_BYTES + position));
}

/* --- writing -------------------------------------------------------------------------------- */

/* Phases of a save. The completion byte is the first to go and, once everything else has been read
 * back, the last to come: at no byte in between can the slot be taken for a record. */
enum { PHASE_CLEAR, PHASE_WRITE, PHASE_COMPLETE };

void record_store_save(record_store_t *store, record_byte_t byte, void *context, uint16_t length)
{
    store->byte = byte;
    store->context = context;
    store->saved_length = length;
    store->phase = PHASE_CLEAR;
    store->position = 1;
    store->crc = CRC16_START;
    store->state = RECORD_SAVE_BUSY;
}

static uint8_t head_byte(const record_store_t *store)
{
    const uint16_t sequence = (uint16_t)(store->sequence + 1u);
    const uint8_t head[HEAD_BYTES] = {COMPLETE,
                                      store->kind,
                                      (uint8_t)(sequence & 0xFFu),
                                      (uint8_t)(sequence >> 8),
                                      (uint8_t)(store->saved_length & 0xFFu),
                                      (uint8_t)(store->saved_length >> 8)};
    return head[store->position];
}

/* The next byte of the slot, from byte 1 to the last of the crc. False after that. */
static bool next_byte(record_store_t *store, uint8_t *out)
{
    const uint16_t covered = (uint16_t)(HEAD_BYTES + store->saved_length);
    if (store->position >= covered + 2u) {
        return false;
    }
    if (store->position >= covered) {
        *out = (uint8_t)(store->position == covered ? store->crc & 0xFFu : store->crc >> 8);
    } else {
        *out = store->position < HEAD_BYTES
                   ? head_byte(store)
                   : store->byte(store->context, (uint16_t)(store->position - HEAD_BYTES));
        store->crc = crc16_add(store->crc, *out);
    }
    store->position++;
    return true;
}

record_save_t record_store_step(record_store_t *store)
{
    const record_storage_t *const storage = store->storage;
    if (store->state != RECORD_SAVE_BUSY || !storage->ready(storage->context)) {
        return (record_save_t)store->state;
    }
    const uint8_t slot = (uint8_t)(1u - store->slot);
    const uint16_t position = store->position;
    switch (store->phase) {
    case PHASE_CLEAR:
        store->written = CLEARED;
        storage->write(storage->context, address_of(store, slot, 0), CLEARED);
        store->phase = PHASE_WRITE;
        break;
    case PHASE_WRITE:
        if (slot_byte(store, slot, (uint16_t)(position - 1u)) != store->written) {
            store->state = RECORD_SAVE_FAILED;
        } else if (next_byte(store, &store->written)) {
            storage->write(storage->context, address_of(store, slot, position), store->written);
        } else {
            storage->write(storage->context, address_of(store, slot, 0), COMPLETE);
            store->phase = PHASE_COMPLETE;
        }
        break;
    default:
        if (slot_byte(store, slot, 0) != COMPLETE) {
            store->state = RECORD_SAVE_FAILED;
            break;
        }
        store->slot = slot;
        store->sequence++;
        store->length = store->saved_length;
        store->state = RECORD_SAVE_DONE;
        break;
    }
    return (record_save_t)store->state;
}
