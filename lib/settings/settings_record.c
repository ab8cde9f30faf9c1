#include "settings.h"

#define ENTRY_HEAD_BYTES 2u /* id; type in the lower two bits, elements less one in the others */

/* Bytes of all entries. Counted by the compiler, so that a row too many does not get by. */
#define BYTES_OF_U8      1u
#define BYTES_OF_U16     2u
#define BYTES_OF_S16     2u
#define BYTES_OF_U32     4u
#define ELEMENTS_OF_ONE  1u
#define ELEMENTS_OF_EACH THERMAL_MODEL_MAX_SPRINGS
#define SETTINGS_EEPROM  4096u /* of the Mega */
enum {
    RECORD_BYTES = 0
#define PARAMETER(part, id, name, unit, decimals, type, count, ...)                                \
    +ENTRY_HEAD_BYTES + BYTES_OF_##type *ELEMENTS_OF_##count
#include "parameters.def"
};
_Static_assert(RECORD_BYTES + RECORD_OVERHEAD_BYTES <= SETTINGS_SLOT_BYTES,
               "a record of the settings must fit its slot");
#ifdef __AVR__
_Static_assert(SETTINGS_LEARNT_BASE + 2u * SETTINGS_LEARNT_SLOT_BYTES <= SETTINGS_EEPROM,
               "all records must fit the EEPROM");
#endif
_Static_assert(THERMAL_MODEL_MAX_SPRINGS <= 64, "an entry's elements have six bits");
_Static_assert(PARAMETER_COUNT <= 255, "rows, and their ids, have eight bits in a record");

static uint16_t values_bytes(uint8_t count, uint8_t type)
{
    return (uint16_t)((uint16_t)count * parameter_width(type));
}

static uint8_t shape_of(const parameter_row_t *row)
{
    return (uint8_t)((uint8_t)((row->count - 1u) << 2) | row->type);
}

/* --- reading -------------------------------------------------------------------------------- */

static uint16_t row_with(uint8_t id)
{
    uint16_t k = 0;
    while (k < PARAMETER_COUNT && parameter_row(k).id != id) {
        k++;
    }
    return k;
}

/* One entry's values. Fails (false), with what fits taken, if and only if something does not. */
static bool take(settings_t *settings, const record_store_t *record, uint16_t row, uint16_t at,
                 uint8_t count, uint8_t type)
{
    const uint8_t known = row < PARAMETER_COUNT ? parameter_row(row).count : 0u;
    bool all = true;
    for (uint8_t element = 0; element < count; element++) {
        uint8_t bytes[4];
        for (uint8_t k = 0; k < parameter_width(type); k++) {
            bytes[k] = record_store_read(record, at++);
        }
        all = element < known &&
              settings_set(settings, row, element, parameter_decode(bytes, type)) == SETTINGS_OK &&
              all;
    }
    return all;
}

settings_loaded_t settings_load(settings_store_t *store, const record_storage_t *storage,
                                settings_t *settings)
{
    settings_loaded_t loaded = {record_store_open(&store->record, storage, SETTINGS_BASE,
                                                  SETTINGS_SLOT_BYTES, SETTINGS_RECORD_KIND),
                                PARAMETER_COUNT, 0, 0};
    const uint16_t length = record_store_length(&store->record);
    settings_default(settings);
    for (uint16_t at = 0; at + ENTRY_HEAD_BYTES <= length;) {
        const uint8_t id = record_store_read(&store->record, at);
        const uint8_t shape = record_store_read(&store->record, (uint16_t)(at + 1u));
        const uint8_t type = shape & 3u;
        const uint8_t count = (uint8_t)((shape >> 2) + 1u);
        const uint16_t bytes = values_bytes(count, type);
        const uint16_t row = row_with(id);
        at = (uint16_t)(at + ENTRY_HEAD_BYTES);
        if (bytes > length - at) {
            break; /* not written by any version of this: whole by its CRC, and still no record */
        }
        loaded.missing = (uint8_t)(loaded.missing - (row < PARAMETER_COUNT ? 1u : 0u));
        if (!take(settings, &store->record, row, at, count, type) && loaded.dropped++ == 0) {
            loaded.dropped_id = id;
        }
        at = (uint16_t)(at + bytes);
    }
    return loaded;
}

/* --- writing -------------------------------------------------------------------------------- */

static uint8_t record_byte(void *context, uint16_t position)
{
    settings_store_t *const store = context;
    if (position == 0) {
        store->row = 0;
        store->row_position = 0;
    }
    parameter_row_t row = parameter_row(store->row);
    uint16_t within = (uint16_t)(position - store->row_position);
    if (within == ENTRY_HEAD_BYTES + values_bytes(row.count, row.type)) {
        store->row_position = position;
        within = 0;
        row = parameter_row(++store->row);
    }
    if (within < ENTRY_HEAD_BYTES) {
        return within == 0 ? row.id : shape_of(&row);
    }
    within = (uint16_t)(within - ENTRY_HEAD_BYTES);
    const uint8_t width = parameter_width(row.type);
    const int32_t value = settings_get(store->settings, store->row, (uint8_t)(within / width));
    return (uint8_t)((uint32_t)value >> (8u * (uint8_t)(within % width)));
}

void settings_save_start(settings_store_t *store, const settings_t *settings)
{
    store->settings = settings;
    record_store_save(&store->record, record_byte, store, RECORD_BYTES);
}
