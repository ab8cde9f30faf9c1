/* The chip packs its structures and has nine springs: this file alone sees them so. */
#define THERMAL_MODEL_MAX_SPRINGS    9
#define SAFETY_MAX_SPRINGS           9
#define CURRENT_CONTROL_MAX_CHANNELS 9
#define CIRCUIT_PEERS_MAX            9
#pragma pack(push, 1)
#include "controller.h"
#pragma pack(pop)

#include "board_view.h"

#include <string.h>

uint32_t board_view_size(void)
{
    return sizeof(controller_t);
}

static void view_spring(const controller_t *chip, unsigned k, board_view_spring_t *view)
{
    const thermal_model_spring_state_t *state = &chip->model.state.spring[k];
    view->measured_ma = chip->measured_ma[k];
    view->measured_mv = chip->measured_mv[k];
    view->target_ma = chip->policy.spring[k].target_ma;
    view->duty = chip->current.channel[k].duty;
    view->level_permille = chip->level_permille[k];
    view->temperature_c7 = (int16_t)(state->temperature_c23 >> 16);
    view->fault = chip->safety.spring[k].fault;
    view->stage = chip->policy.spring[k].stage;
    view->limits = chip->policy.spring[k].limits;
    view->wanted_ma = chip->policy.spring[k].wanted_ma;
    view->heating_c7 = state->heating_c7;
    view->cooling_c7 = state->cooling_c7;
    view->amplitude = state->amplitude;
    view->branch = state->branch;
    view->belief_at =
        (uint32_t)((const uint8_t *)spring_estimator_of(&chip->estimator, (uint8_t)k) -
                   (const uint8_t *)chip);
    view->transformation_shift_c7 = chip->model.spring[k].transformation_shift_c7;
}

bool board_view(const board_t *board, const char *symbol, board_view_t *view)
{
    controller_t chip;
    uint32_t size = 0;
    const uint8_t *memory = board_variable(board, symbol, &size);
    if (memory == NULL || size != sizeof chip) {
        return false;
    }
    memcpy(&chip, memory, sizeof chip);
    view->springs = chip.springs;
    view->board_fault = chip.safety.board_fault;
    view->locked = chip.safety.locked;
    view->fan_percent = chip.fan_percent;
    view->ambient_c7 = chip.model.ambient_c7;
    view->austenite_start_c7 = chip.model.transformation.austenite_start_c7;
    view->martensite_start_c7 = chip.model.transformation.martensite_start_c7;
    view->austenite_finish_c7 = chip.model.transformation.austenite_finish_c7;
    view->martensite_finish_c7 = chip.model.transformation.martensite_finish_c7;
    view->heating_position = chip.model.heating_position;
    view->cooling_position = chip.model.cooling_position;
    for (unsigned k = 0; k < BOARD_CHANNELS; k++) {
        view_spring(&chip, k, &view->spring[k]);
    }
    return true;
}
