#include <string.h>

#include "crc16.h"
#include "settings.h"

#define COMPLETE   0xA5u
#define FORMAT     1u
#define HEAD_BYTES 7u
#define ERASED     0xFFu
#define CLEARED    0x00u

static uint16_t payload_bytes(uint8_t entries)
{
    uint16_t bytes = 0;
    settings_entry_t entry;
    for (uint8_t i = 0; i < entries; i++) {
        settings_entry(i, &entry);
        bytes = (uint16_t)(bytes + (uint16_t)entry.count * parameter_width(entry.type));
    }
    return bytes;
}

static uint16_t base_of(uint8_t slot)
{
    return slot == 0 ? 0u : SETTINGS_SLOT_BYTES;
}

static uint16_t read_word(const settings_storage_t *storage, uint16_t address)
{
    const uint16_t low = storage->read(storage->context, address);
    const uint16_t high = storage->read(storage->context, (uint16_t)(address + 1u));
    return (uint16_t)(low | (uint16_t)(high << 8));
}

/* --- reading -------------------------------------------------------------------------------- */

typedef enum { SLOT_EMPTY, SLOT_DAMAGED, SLOT_FOREIGN, SLOT_WHOLE } slot_state_t;

typedef struct {
    slot_state_t state;
    uint16_t sequence;
    uint8_t entries;
} slot_t;

/* To settings. Fails (false), with some of it changed, if and only if a value is outside the limits
 * of the table. */
static bool read_values(const settings_storage_t *storage, uint16_t address, uint8_t entries,
                        settings_t *settings)
{
    settings_entry_t entry;
    for (uint8_t i = 0; i < entries; i++) {
        settings_entry(i, &entry);
        for (uint8_t element = 0; element < entry.count; element++) {
            uint8_t bytes[4];
            for (uint8_t octet = 0; octet < parameter_width(entry.type); octet++) {
                bytes[octet] = storage->read(storage->context, address++);
            }
            if (settings_set(settings, i, element, parameter_get(bytes, entry.type)) !=
                SETTINGS_OK) {
                return false;
            }
        }
    }
    return true;
}

/* settings is changed where there is a record. */
static slot_t examine(const settings_storage_t *storage, uint16_t base, settings_t *settings)
{
    slot_t slot = {SLOT_DAMAGED, 0, 0};
    const uint8_t complete = storage->read(storage->context, base);
    const uint8_t format = storage->read(storage->context, (uint16_t)(base + 1u));
    if (complete == ERASED && format == ERASED) {
        slot.state = SLOT_EMPTY;
        return slot;
    }
    if (complete != COMPLETE) {
        return slot;
    }
    slot.sequence = read_word(storage, (uint16_t)(base + 2u));
    slot.entries = storage->read(storage->context, (uint16_t)(base + 6u));
    const bool known = format == FORMAT && slot.entries <= settings_count();
    if (!known) {
        /* Its length is unknown, so nothing can be checked: not ours to judge. */
        slot.state = SLOT_FOREIGN;
        return slot;
    }
    const uint16_t covered = (uint16_t)(HEAD_BYTES + payload_bytes(slot.entries));
    uint16_t crc = CRC16_START;
    for (uint16_t i = 1; i < covered; i++) {
        crc = crc16_add(crc, storage->read(storage->context, (uint16_t)(base + i)));
    }
    if (crc != read_word(storage, (uint16_t)(base + covered))) {
        return slot;
    }
    if (read_word(storage, (uint16_t)(base + 4u)) != settings_fingerprint(slot.entries)) {
        slot.state = SLOT_FOREIGN;
        return slot;
    }
    if (read_values(storage, (uint16_t)(base + HEAD_BYTES), slot.entries, settings)) {
        slot.state = SLOT_WHOLE;
    }
    return slot;
}

/* Of two whole slots the one with the later sequence number, as serial numbers go (RFC 1982). */
static uint8_t newest(const slot_t slot[2])
{
    if (slot[0].state != SLOT_WHOLE) {
        return 1;
    }
    if (slot[1].state != SLOT_WHOLE) {
        return 0;
    }
    return (uint16_t)(slot[1].sequence - slot[0].sequence) < 0x8000u ? 1u : 0u;
}

settings_loaded_t settings_load(settings_store_t *store, const settings_storage_t *storage,
                                settings_t *settings)
{
    const slot_t slot[2] = {examine(storage, base_of(0), settings),
                            examine(storage, base_of(1), settings)};
    const uint8_t chosen = newest(slot);
    const bool found = slot[chosen].state == SLOT_WHOLE;

    memset(store, 0, sizeof *store);
    store->storage = storage;
    store->base = base_of(found ? (uint8_t)(1u - chosen) : 0u);
    store->sequence = found ? (uint16_t)(slot[chosen].sequence + 1u) : 0u;
    store->entries = settings_count();
    store->fingerprint = settings_fingerprint(store->entries);

    settings_default(settings);
    if (found) {
        read_values(storage, (uint16_t)(base_of(chosen) + HEAD_BYTES), slot[chosen].entries,
                    settings);
        const slot_state_t other = slot[1u - chosen].state;
        if (other == SLOT_DAMAGED || other == SLOT_FOREIGN) {
            return SETTINGS_LOADED_OTHER;
        }
        return slot[chosen].entries < settings_count() ? SETTINGS_LOADED_MIGRATED : SETTINGS_LOADED;
    }
    if (slot[0].state == SLOT_EMPTY && slot[1].state == SLOT_EMPTY) {
        return SETTINGS_EMPTY;
    }
    if (slot[0].state == SLOT_FOREIGN || slot[1].state == SLOT_FOREIGN) {
        return SETTINGS_FOREIGN;
    }
    return SETTINGS_DAMAGED;
}

/* --- writing -------------------------------------------------------------------------------- */

/* Phases of a save. The completion byte is the first to go and, once everything else has been read
 * back, the last to come: at no byte in between can the slot be taken for a record. */
enum { PHASE_CLEAR, PHASE_WRITE, PHASE_CHECK, PHASE_COMPLETE };

static void rewind_cursor(settings_store_t *store)
{
    store->position = 1;
    store->crc = CRC16_START;
    store->entry = 0;
    store->element = 0;
    store->octet = 0;
}

void settings_save_start(settings_store_t *store, const settings_t *settings, uint8_t entries)
{
    store->settings = settings;
    if (entries != 0 && entries < settings_count()) {
        store->entries = entries;
        store->fingerprint = settings_fingerprint(entries);
    }
    rewind_cursor(store);
    store->phase = PHASE_CLEAR;
    store->state = SETTINGS_SAVE_BUSY;
}

static uint8_t head_byte(const settings_store_t *store)
{
    switch (store->position) {
    case 1:
        return FORMAT;
    case 2:
        return (uint8_t)(store->sequence & 0xFFu);
    case 3:
        return (uint8_t)(store->sequence >> 8);
    case 4:
        return (uint8_t)(store->fingerprint & 0xFFu);
    case 5:
        return (uint8_t)(store->fingerprint >> 8);
    default:
        return store->entries;
    }
}

/* The byte of a value under the cursor; then the cursor moves on. */
static uint8_t value_byte(settings_store_t *store)
{
    settings_entry_t entry;
    settings_entry(store->entry, &entry);
    const uint8_t width = parameter_width(entry.type);
    const uint8_t out = ((const uint8_t *)store->settings)[(
        uint16_t)(entry.offset + (uint8_t)(store->element * width) + store->octet)];
    if (++store->octet == width) {
        store->octet = 0;
        if (++store->element == entry.count) {
            store->element = 0;
            store->entry++;
        }
    }
    return out;
}

/* The next byte of the record, from byte 1 to the last of the crc. False after that. */
static bool next_byte(settings_store_t *store, uint8_t *out)
{
    if (store->position < HEAD_BYTES) {
        *out = head_byte(store);
    } else if (store->entry < store->entries) {
        *out = value_byte(store);
    } else if (store->octet <
               2u) { /* the cursor is past the values: it counts the crc's two bytes */
        *out = (uint8_t)(store->crc >> (8u * store->octet));
        store->octet++;
        store->position++;
        return true;
    } else {
        return false;
    }
    store->crc = crc16_add(store->crc, *out);
    store->position++;
    return true;
}

static void finish(settings_store_t *store, settings_save_state_t state)
{
    store->state = (uint8_t)state;
    if (state == SETTINGS_SAVE_DONE) {
        store->base = store->base == 0 ? SETTINGS_SLOT_BYTES : 0u;
        store->sequence++;
    }
}

settings_save_state_t settings_save_step(settings_store_t *store)
{
    const settings_storage_t *const storage = store->storage;
    if (store->state != SETTINGS_SAVE_BUSY || !storage->ready(storage->context)) {
        return (settings_save_state_t)store->state;
    }
    const uint16_t address = (uint16_t)(store->base + store->position);
    uint8_t out;
    switch (store->phase) {
    case PHASE_CLEAR:
        storage->write(storage->context, store->base, CLEARED);
        store->phase = PHASE_WRITE;
        break;
    case PHASE_WRITE:
        if (next_byte(store, &out)) {
            storage->write(storage->context, address, out);
        } else {
            rewind_cursor(store);
            store->phase = PHASE_CHECK;
        }
        break;
    case PHASE_CHECK:
        if (!next_byte(store, &out)) {
            storage->write(storage->context, store->base, COMPLETE);
            store->phase = PHASE_COMPLETE;
        } else if (storage->read(storage->context, address) != out) {
            finish(store, SETTINGS_SAVE_FAILED);
        }
        break;
    default:
        finish(store, storage->read(storage->context, store->base) == COMPLETE
                          ? SETTINGS_SAVE_DONE
                          : SETTINGS_SAVE_FAILED);
        break;
    }
    return (settings_save_state_t)store->state;
}
