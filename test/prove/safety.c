/* sources: lib/safety/safety.c lib/text/text.c lib/fixed_point/fixed_point.c
 * sources: test/prove/stand_ins/parameter_check.c
 * options: -eva-slevel-function text_item:600 */
#include "safety.h"

#include "prove.h"

static void any_settings(safety_parameters_t *values)
{
#define SAFETY PROVE_ANY
#include "parameters.def"
}

static safety_sample_t any_sample(void)
{
    return (safety_sample_t){.sensor_status = any_u8(),
                             .current_ma = any_s16(),
                             .voltage_mv = any_s16(),
                             .off = any_bool(),
                             .may_be_dead = (any_u8() & 1u) != 0,
                             .expected_ma = any_u16(),
                             .temperature_c7 = any_s16()};
}

void main(void)
{
    safety_t safety;
    safety_parameters_t settings;
    uint16_t bad;
    any_settings(&settings);
    if (!safety_init(&safety, &settings, any_u8(), &bad)) {
        return;
    }
    while (any_bool()) {
        const uint8_t spring = any_u8();
        if (spring >= safety.springs) {
            continue;
        }
        const safety_sample_t sample = any_sample();
        switch (any_u8()) {
        case 0:
            any_settings(&settings);
            (void)safety_apply(&safety, &settings, NULL);
            break;
        case 1:
            safety_clear(&safety);
            break;
        case 2:
            safety_trip(&safety, spring, SAFETY_FAULT_LIMIT_TRIP);
            break;
        case 3:
            safety_emergency_stop(&safety);
            safety_lock(&safety);
            break;
        case 4:
            safety_host_silent(&safety);
            safety_unlock(&safety);
            break;
        case 5:
            safety_tick_board(&safety, any_u32());
            break;
        default:
            (void)safety_tick_spring(&safety, spring, &sample);
            break;
        }
        (void)safety_allows(&safety, spring);
        (void)safety_cuts_supply(&safety);
        (void)safety_fault(&safety, spring);
        (void)safety_board_fault(&safety);
    }
    /*@ loop unroll SAFETY_FAULT_COUNT + 1; */
    for (uint8_t fault = 0; fault <= SAFETY_FAULT_COUNT; fault++) {
        (void)safety_fault_name((safety_fault_t)fault);
    }
}
