/* What it is for: takes the bytes that libFuzzer gives apart, and says what must hold.
 * What it owns: how far they are used; an EEPROM in memory.
 * What it never does: draw by itself: the same bytes are the same run. */
#ifndef FUZZ_H
#define FUZZ_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "controller.h"
#include "record_store.h"
#include "settings.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

/* In every build. */
#define HOLDS(condition)                                                                           \
    ((condition) ? (void)0                                                                         \
                 : (fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #condition), \
                    abort()))

typedef struct {
    const uint8_t *next;
    size_t left;
} fuzz_t;

/* 0 where they are used up. */
static inline uint8_t fuzz_byte(fuzz_t *fuzz)
{
    if (fuzz->left == 0) {
        return 0;
    }
    fuzz->left--;
    return *fuzz->next++;
}

static inline uint16_t fuzz_word(fuzz_t *fuzz)
{
    const uint16_t low = fuzz_byte(fuzz);
    return (uint16_t)(low | (uint16_t)(fuzz_byte(fuzz) << 8));
}

#define FUZZ_EEPROM (SETTINGS_LEARNT_BASE + 2u * SETTINGS_LEARNT_SLOT_BYTES)
static uint8_t fuzz_eeprom[FUZZ_EEPROM];

static uint8_t fuzz_read(void *context, uint16_t address)
{
    (void)context;
    HOLDS(address < FUZZ_EEPROM);
    return fuzz_eeprom[address];
}

static bool fuzz_ready(void *context)
{
    (void)context;
    return true;
}

static void fuzz_write(void *context, uint16_t address, uint8_t value)
{
    (void)context;
    HOLDS(address < FUZZ_EEPROM);
    fuzz_eeprom[address] = value;
}

static const record_storage_t fuzz_storage = {NULL, fuzz_read, fuzz_ready, fuzz_write};

/* What is drawn and believed of each spring is a number, and within its range. */
static inline void fuzz_hold_outputs(const controller_t *controller,
                                     const controller_outputs_t *outputs)
{
    const bool off = controller_is_locked(controller) ||
                     controller_board_fault(controller) != SAFETY_FAULT_NONE ||
                     !controller_is_sound(controller);
    for (uint8_t k = 0; k < CONTROLLER_MAX_SPRINGS; k++) {
        HOLDS(outputs->duty[k] <= CONTROLLER_DUTY_MAX);
        const bool is_one = k < controller_springs(controller);
        HOLDS(outputs->duty[k] == 0 || (is_one && !off));
        if (!is_one) {
            continue;
        }
        HOLDS(outputs->duty[k] == 0 || controller_fault(controller, k) == SAFETY_FAULT_NONE);
        const spring_bounds_t bounds[] = {controller_temperature_bounds_c(controller, k),
                                          controller_distance_bounds_k(controller, k),
                                          controller_austenite_bounds(controller, k)};
        for (unsigned n = 0; n < 3; n++) {
            HOLDS(isfinite(bounds[n].low) && isfinite(bounds[n].value) && isfinite(bounds[n].high));
        }
        const float cooling_s = controller_cooling_s(controller, k);
        HOLDS(cooling_s >= 0.0f && cooling_s <= CONTROLLER_COOLING_MOST_S);
        HOLDS(isfinite(controller_delivered_c(controller, k)));
    }
    HOLDS(outputs->fan_percent <= 100);
    HOLDS(thermal_model_is_consistent(&controller->model));
}

#endif
