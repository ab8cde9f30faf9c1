/* What it is for: every value a user can set: its name, unit, limits, and the record that keeps
 * it.
 * What it owns: the one table behind `$name=value`, the stored record and the host's exports.
 * What it never does: apply a value; controller_apply_settings does, and may refuse a combination.
 */
#ifndef SETTINGS_H
#define SETTINGS_H

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"
#include "parameter.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum { SETTINGS_AMBIENT_SET = 0, SETTINGS_AMBIENT_NTC } settings_ambient_source_t;

/* What concerns the board, not the controller. */
typedef struct {
    int16_t ambient_cc;       /* 1/100 degC: used where no NTC is chosen */
    uint8_t ambient_source;   /* settings_ambient_source_t */
    uint8_t sensor_averaging; /* samples of the INA219: 8 or 16 */
    uint8_t telemetry_format; /* telemetry_format_t */
    uint8_t telemetry_hz;     /* 1..50 */
} board_settings_t;

typedef struct {
    controller_settings_t controller;
    board_settings_t board;
} settings_t;

void settings_default(settings_t *settings);

/* --- the table ------------------------------------------------------------------------------ */

#define SETTINGS_NAME_SIZE 32 /* with the terminating zero */

/* One setting. Its value is an integer in units of 10^-decimals of its unit. */
typedef struct {
    uint8_t decimals;
    uint8_t type;    /* parameter_type_t */
    uint8_t count;   /* 1, or the elements of an array */
    uint16_t offset; /* of the first element in settings_t */
    int32_t minimum;
    int32_t maximum;
} settings_entry_t;

typedef enum {
    SETTINGS_OK = 0,
    SETTINGS_UNKNOWN_NAME, /* no setting is called that */
    SETTINGS_NOT_A_NUMBER, /* not digits with at most one point; more decimals than the setting has
                            */
    SETTINGS_OUT_OF_RANGE  /* outside minimum..maximum */
} settings_result_t;

uint8_t settings_count(void); /* entries of the table */
/* One entry; here and below, index must be below settings_count(). */
void settings_entry(uint8_t index, settings_entry_t *entry);
/* Both are texts in flash. O(index). Of an array: its elements are name_1, name_2, ... */
const char *settings_name(uint8_t index);
const char *settings_unit(uint8_t index); /* "" for a plain number */
/* CRC-16 over what tells one table from another: the first `entries` names with their types,
 * decimals and counts. */
uint16_t settings_fingerprint(uint8_t entries);
/* The setting of which offsetof(controller_settings_t, ...) is `offset`, as
 * controller_apply_settings names what it refused. Fails (false) if and only if no setting is
 * there. */
bool settings_find_offset(uint16_t offset, uint8_t *index, uint8_t *element);
/* Fails (false) if and only if no setting has that name; element counts from 0. */
bool settings_find(const char *name, uint8_t *index, uint8_t *element);
/* element must exist. */
int32_t settings_get(const settings_t *settings, uint8_t index, uint8_t element);
/* SETTINGS_OK or SETTINGS_OUT_OF_RANGE; then nothing is changed. */
settings_result_t settings_set(settings_t *settings, uint8_t index, uint8_t element, int32_t value);

/* name and value as in `$name=value`. Anything but SETTINGS_OK changes nothing. */
settings_result_t settings_assign(settings_t *settings, const char *name, const char *value);

/* --- the record ----------------------------------------------------------------------------- */

/* Two slots; a save writes the older one. Bytes of a slot:
 *   0      0xA5 once the record is complete: cleared first, written last
 *   1      format, 1
 *   2..3   sequence number, low byte first; the higher (as a serial number) is the newer
 *   4..5   CRC-16 over names, types, decimals and counts of the entries that follow
 *   6      number of entries
 *   7..    the values in the order of the table, low byte first
 *   last 2 CRC-16 over bytes 1 to here
 * So a cut at any byte leaves the other slot, and a record of an earlier version, which is a prefix
 * of this table, is understood: what it lacks takes its default. */
#define SETTINGS_SLOT_BYTES 512u

typedef struct {
    void *context;
    uint8_t (*read)(void *context, uint16_t address);
    bool (*ready)(void *context); /* a write may be started */
    void (*write)(void *context, uint16_t address, uint8_t value);
} settings_storage_t;

typedef enum {
    SETTINGS_LOADED = 0,
    SETTINGS_LOADED_MIGRATED, /* record of an earlier version; new settings have their defaults */
    SETTINGS_LOADED_OTHER,    /* one slot is damaged or was cut short; the other one is loaded */
    SETTINGS_EMPTY,           /* nothing was ever saved: defaults */
    SETTINGS_DAMAGED,         /* no slot is whole: defaults */
    SETTINGS_FOREIGN          /* whole, but of another program or a later version: defaults */
} settings_loaded_t;

typedef enum {
    SETTINGS_SAVE_IDLE = 0,
    SETTINGS_SAVE_BUSY,
    SETTINGS_SAVE_DONE,
    SETTINGS_SAVE_FAILED
} settings_save_state_t;

/* Where records are kept, and a save in progress: internal, filled by settings_load. */
typedef struct {
    const settings_storage_t *storage;
    const settings_t *settings;
    uint16_t base;     /* address of the slot that the next save writes */
    uint16_t sequence; /* that it will carry */
    uint16_t fingerprint;
    uint16_t position; /* byte of the slot that is written or checked next */
    uint16_t crc;
    uint8_t entries;
    uint8_t entry; /* cursor in the table */
    uint8_t element;
    uint8_t octet;
    uint8_t phase;
    uint8_t state; /* settings_save_state_t */
} settings_store_t;

/* Reads the newest whole record; in the last three cases *settings becomes the defaults. A record
 * with a value outside the table's limits counts as damaged. */
settings_loaded_t settings_load(settings_store_t *store, const settings_storage_t *storage,
                                settings_t *settings);

/* Starts a save of the first `entries` entries (0: all), after settings_load. settings must not
 * change until it is done. */
void settings_save_start(settings_store_t *store, const settings_t *settings, uint8_t entries);
/* Writes, or reads back, at most one byte, and only when the storage is ready: O(1). FAILED if and
 * only if a byte does not read back as written; the other slot then still holds the record before.
 */
settings_save_state_t settings_save_step(settings_store_t *store);

#ifdef __cplusplus
}
#endif
#endif
