#include "learnt_store.h"

#include <math.h>
#include <string.h>

/* A resistance is worth a save when it differs by so much of itself; its rise per kelvin when that
 * makes as much over a heating. */
#define WORTH_SHARE     0.02f
#define WORTH_HEATING_K 80.0f

/* --- bytes ---------------------------------------------------------------------------------- */

/* What the record has of a spring: its struct's bytes, alike on the Mega and on a host. False where
 * it has nothing. */
static bool unpack(const record_store_t *record, uint8_t spring, spring_learnt_t *learnt)
{
    const uint16_t at = LEARNT_STORE_BYTES(spring);
    uint8_t *const bytes = (uint8_t *)learnt;
    if (at + sizeof *learnt > record_store_length(record)) {
        return false;
    }
    for (uint8_t k = 0; k < sizeof *learnt; k++) {
        bytes[k] = record_store_read(record, (uint16_t)(at + k));
    }
    return learnt->austenite_ohm > 0.0f;
}

/* Its losses were learnt beside the model that the controller has. */
static bool fits_model(const learnt_store_t *store, const controller_t *controller)
{
    const record_store_t *const record = &store->record;
    return learnt_store_keeps(store) && (uint16_t)(record_store_read(record, 0) |
                                                   (uint16_t)record_store_read(record, 1) << 8u) ==
                                            controller_model_mark(controller);
}

/* A spring goes on learning while others are written: its numbers are taken all at once. */
static uint8_t byte_of(void *context, uint16_t position)
{
    learnt_store_t *const store = context;
    if (position < LEARNT_STORE_MARK_BYTES) {
        return (uint8_t)(controller_model_mark(store->controller) >> (8u * position));
    }
    position = (uint16_t)(position - LEARNT_STORE_MARK_BYTES);
    const uint8_t within = (uint8_t)(position % sizeof store->written);
    if (within == 0) {
        store->written =
            controller_to_keep(store->controller, (uint8_t)(position / sizeof store->written));
    }
    return ((const uint8_t *)&store->written)[within];
}

static void save(learnt_store_t *store, uint16_t length)
{
    store->since_s = 0;
    record_store_save(&store->record, byte_of, store, length);
}

/* --- when ----------------------------------------------------------------------------------- */

static bool differs(float a, float b, float by)
{
    return fabsf(a - b) > by;
}

typedef enum { WORTH_NOTHING, WORTH_REFINES, WORTH_NEW } worth_t;

static worth_t worth_of(const learnt_store_t *store, const controller_t *controller, uint8_t spring)
{
    const spring_learnt_t now = controller_to_keep(controller, spring);
    spring_learnt_t kept;
    if (!(now.austenite_ohm > 0.0f)) {
        return WORTH_NOTHING;
    }
    if (!unpack(&store->record, spring, &kept)) {
        return WORTH_NEW;
    }
    const bool refines =
        differs(now.austenite_ohm, kept.austenite_ohm, WORTH_SHARE * now.austenite_ohm) ||
        differs(now.martensite_ohm, kept.martensite_ohm, WORTH_SHARE * now.martensite_ohm) ||
        differs(now.change, kept.change, WORTH_SHARE) ||
        differs(now.martensite_rise_per_k, kept.martensite_rise_per_k,
                WORTH_SHARE / WORTH_HEATING_K) ||
        differs(now.loss_w_per_k, kept.loss_w_per_k, now.loss_sd_w_per_k) ||
        2.0f * now.loss_sd_w_per_k < kept.loss_sd_w_per_k ||
        now.slow_noise > 2.0f * kept.slow_noise;
    return refines ? WORTH_REFINES : WORTH_NOTHING;
}

/* At least one is driven, and those that are, are held. */
static bool all_held(const controller_t *controller)
{
    bool any = false;
    for (uint8_t k = 0; k < controller_springs(controller); k++) {
        if (controller_level_permille(controller, k) == 0) {
            continue;
        }
        if (controller_stage(controller, k) != DRIVE_POLICY_STAGE_HOLD) {
            return false;
        }
        any = true;
    }
    return any;
}

void learnt_store_second(learnt_store_t *store, const controller_t *controller)
{
    const uint8_t springs = controller_springs(controller);
    if (store->since_s < UINT16_MAX) {
        store->since_s++;
    }
    if (!all_held(controller)) {
        store->held_s = 0;
    } else if (store->held_s < LEARNT_STORE_HELD_S) {
        store->held_s++;
    }
    if (store->since_s < LEARNT_STORE_PAUSE_S || store->held_s < LEARNT_STORE_HELD_S) {
        return;
    }
    worth_t worth =
        learnt_store_keeps(store) && !fits_model(store, controller) ? WORTH_NEW : WORTH_NOTHING;
    for (uint8_t k = 0; k < springs && worth != WORTH_NEW; k++) {
        const worth_t of_spring = worth_of(store, controller, k);
        worth = of_spring > worth ? of_spring : worth;
    }
    if (worth == WORTH_NOTHING ||
        (worth == WORTH_REFINES &&
         store->since_s < (uint16_t)(LEARNT_STORE_PAUSE_S << store->refined))) {
        return;
    }
    if (worth == WORTH_REFINES && store->refined < LEARNT_STORE_LONGEST_SHIFT) {
        store->refined++;
    }
    save(store, LEARNT_STORE_BYTES(springs));
}

record_save_t learnt_store_step(learnt_store_t *store)
{
    return record_store_step(&store->record);
}

void learnt_store_clear(learnt_store_t *store, controller_t *controller)
{
    for (uint8_t k = 0; k < controller_springs(controller); k++) {
        controller_forget_learnt(controller, k);
    }
    save(store, 0);
}

bool learnt_store_keeps(const learnt_store_t *store)
{
    return record_store_length(&store->record) != 0;
}

record_found_t learnt_store_open(learnt_store_t *store, const record_storage_t *storage,
                                 uint16_t base, uint16_t slot_bytes, controller_t *controller)
{
    spring_learnt_t learnt;
    memset(store, 0, sizeof *store);
    store->since_s = LEARNT_STORE_PAUSE_S;
    store->controller = controller;
    const record_found_t found =
        record_store_open(&store->record, storage, base, slot_bytes, LEARNT_STORE_KIND);
    const bool fits = fits_model(store, controller);
    for (uint8_t k = 0; k < controller_springs(controller); k++) {
        if (unpack(&store->record, k, &learnt)) {
            if (!fits) { /* before: beside this model it may be none that a spring has */
                learnt.loss_w_per_k = learnt.loss_sd_w_per_k = 0.0f;
            }
            controller_restore_learnt(controller, k, &learnt);
            if (!fits) {
                controller_forget_loss(controller, k);
            }
        }
    }
    return found;
}
