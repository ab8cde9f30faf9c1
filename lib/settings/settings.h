/* What it is for: the values that a user set: by name, as text, and kept over power-off.
 * What it owns: `$name=value`, and how the values lie in a stored record.
 * What it never does: apply a value; controller_apply_settings does, and may refuse a combination.
 */
#ifndef SETTINGS_H
#define SETTINGS_H

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"
#include "parameters.h"
#include "record_store.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum { SETTINGS_AMBIENT_SET = 0, SETTINGS_AMBIENT_NTC } settings_ambient_source_t;

typedef struct {
    controller_settings_t controller;
    board_settings_t board;
} settings_t;

typedef enum {
    SETTINGS_OK = 0,
    SETTINGS_UNKNOWN_NAME, /* no setting is called that */
    SETTINGS_NOT_A_NUMBER, /* not digits with at most one point; more decimals than the setting has
                            */
    SETTINGS_OUT_OF_RANGE  /* outside the row's limits */
} settings_result_t;

void settings_default(settings_t *settings);

/* Fails (false) if and only if no setting has that name. row is of parameters.def; of a row with an
 * element for each spring the names are name_1, name_2, ...; element counts from 0. */
bool settings_find(const char *name, uint16_t *row, uint8_t *element);
/* As `$$` writes it; row and element, here and below, must exist. */
#define SETTINGS_NAME_SIZE (PARAMETER_NAME_SIZE + 3)
void settings_name(uint16_t row, uint8_t element, char name[SETTINGS_NAME_SIZE]);
int32_t settings_get(const settings_t *settings, uint16_t row, uint8_t element);
/* SETTINGS_OK or SETTINGS_OUT_OF_RANGE; then nothing is changed. */
settings_result_t settings_set(settings_t *settings, uint16_t row, uint8_t element, int32_t value);
/* name and value as in `$name=value`. Anything but SETTINGS_OK changes nothing. */
settings_result_t settings_assign(settings_t *settings, const char *name, const char *value);

/* --- the record ----------------------------------------------------------------------------- */

/* Of each row: its id, its type and count (as settings_record.c packs them), its values, low byte
 * first. So a record of an earlier or later version is read as far as this one knows its ids. */
#define SETTINGS_RECORD_KIND 2u
#define SETTINGS_BASE        0u
#if THERMAL_MODEL_MAX_SPRINGS <= 16
#define SETTINGS_SLOT_BYTES        1024u
#define SETTINGS_LEARNT_SLOT_BYTES 512u
#else
#define SETTINGS_SLOT_BYTES        2048u
#define SETTINGS_LEARNT_SLOT_BYTES 2048u
#endif
/* Behind the settings lies what has been learnt of each spring (learnt_store). */
#define SETTINGS_LEARNT_BASE (SETTINGS_BASE + 2u * SETTINGS_SLOT_BYTES)
/* And behind that, whether springs may be warm (warm_mark). */
#define SETTINGS_WARM_BASE (SETTINGS_LEARNT_BASE + 2u * SETTINGS_LEARNT_SLOT_BYTES)

/* What became of the stored record. Where found is none of RECORD_LOADED..., all are defaults. */
typedef struct {
    record_found_t found;
    uint8_t missing;    /* rows that it did not hold: their defaults */
    uint8_t dropped;    /* entries of which something could not be taken: an id that this version
                           does not know, a value outside the limits, more elements than there are */
    uint8_t dropped_id; /* of the first of them */
} settings_loaded_t;

typedef struct {
    record_store_t record;
    const settings_t *settings; /* of a save under way */
    uint16_t row;               /* its cursor */
    uint16_t row_position;
} settings_store_t;

settings_loaded_t settings_load(settings_store_t *store, const record_storage_t *storage,
                                settings_t *settings);
/* Starts a save, after settings_load; then record_store_step(&store->record) until it is no longer
 * busy. settings must not change meanwhile. */
void settings_save_start(settings_store_t *store, const settings_t *settings);

#ifdef __cplusplus
}
#endif
#endif
