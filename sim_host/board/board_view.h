/* What it is for: what the firmware's controller knows, read from the simulated chip's memory
 * without a word said.
 * What it owns: the chip's layout of controller_t, checked against the ELF's symbol by its size.
 * What it never does: change the memory, or guess when the sizes differ. */
#ifndef BOARD_VIEW_H
#define BOARD_VIEW_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    int16_t measured_ma, measured_mv;
    uint16_t target_ma, duty, level_permille;
    int16_t temperature_c7;
    uint8_t fault; /* safety_fault_t */
    uint8_t stage;
    uint16_t limits;    /* drive_policy_stage_t, bits of drive_policy_limit_t */
    uint16_t wanted_ma; /* what the policy would give without them */
    /* where its phase stands: see thermal_model_spring_state_t */
    int16_t heating_c7, cooling_c7, transformation_shift_c7;
    uint16_t amplitude;
    uint8_t branch;
    uint32_t belief_at; /* what is believed of it: bytes behind the symbol */
} board_view_spring_t;

typedef struct {
    uint8_t springs;
    uint8_t board_fault;
    bool locked;
    uint8_t fan_percent;
    int16_t ambient_c7;
    int16_t austenite_start_c7, austenite_finish_c7;
    int16_t martensite_start_c7, martensite_finish_c7;
    uint16_t heating_position, cooling_position;
    board_view_spring_t spring[BOARD_CHANNELS];
} board_view_t;

/* Fails (false) if and only if the ELF has no controller_t of that name with the layout of this
 * build. */
bool board_view(const board_t *board, const char *symbol, board_view_t *view);
/* Bytes of controller_t on the chip. */
uint32_t board_view_size(void);

#ifdef __cplusplus
}
#endif
#endif
