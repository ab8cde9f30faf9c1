/* sources: lib/parameters/parameters.c */
#include "parameters.h"

#include "prove.h"

void main(void)
{
    safety_parameters_t safety;
    current_control_parameters_t current;
    board_settings_t board;
    uint16_t bad;
    safety_parameters_default(&safety);
    current_control_parameters_default(&current);
    board_settings_default(&board);
    (void)parameter_check(PARAMETER_PART_SAFETY, &safety, &bad);
    (void)parameter_check(PARAMETER_PART_CURRENT, &current, NULL);
    (void)parameter_check(PARAMETER_PART_BOARD, &board, &bad);
    /*@ loop unroll PARAMETER_COUNT; */
    for (uint16_t row = 0; row < PARAMETER_COUNT; row++) {
        (void)parameter_partner(row);
    }
}
