/* What it is for: tests of what a hold tells: phase that is lost, or a contact, or the sensor.
 * What it owns: nothing. What it never does: run by itself; test_spring_estimator.c runs them. */
#ifndef LOST_PHASE_H
#define LOST_PHASE_H

void phase_lost_on_the_way_to_the_hold_is_counted(void);
void coefficient_is_no_loss_above_the_transformation(void);
void contact_is_not_taken_for_phase(void);
void contact_that_comes_and_goes_is_blind_for_a_while(void);
void jump_on_the_way_to_a_hold_is_a_jump(void);
void load_that_comes_within_a_second_is_no_contact(void);
void what_a_loose_contact_seemed_to_lose_is_taken_back(void);
void loss_that_does_not_come_back_stays_in_doubt(void);
void heating_ends_where_it_reads_what_it_did_when_it_had_transformed(void);
void heating_that_a_limit_ended_proves_nothing(void);
void loss_too_small_to_tell_stays_in_doubt(void);
void heating_for_a_loss_that_was_none_ends(void);
void noise_slower_than_a_turn_is_no_loss(void);
void noise_that_was_learnt_is_no_loss_of_the_next_start(void);
void loss_that_was_a_sensor_is_said_and_stays_in_doubt(void);
void restored_spring_is_not_overheated(void);

#endif
