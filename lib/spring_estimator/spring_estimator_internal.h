/* What it is for: what the files of spring_estimator share.
 * What it owns: nothing.
 * What it never does: serve anyone else. Reasons for every number: docs/believing.md. */
#ifndef SPRING_ESTIMATOR_INTERNAL_H
#define SPRING_ESTIMATOR_INTERNAL_H

#include "spring_estimator.h"

/* Largest temperature coefficient in print; per kelvin of heat, where the heat capacity is 15 %
 * less than declared. */
#define COEFFICIENT_MOST_PER_K      0.0015f
#define COEFFICIENT_MOST_PER_HEAT_K (COEFFICIENT_MOST_PER_K / 0.85f)

/* And the least; learnt with what noise and offset add. */
#define COEFFICIENT_IN_PRINT_PER_K   (-0.0003f)
#define COEFFICIENT_LEAST_PER_K      (COEFFICIENT_IN_PRINT_PER_K - 0.00025f)
#define COEFFICIENT_LEAST_PER_HEAT_K (COEFFICIENT_IN_PRINT_PER_K / 0.85f)

/* A reading at less is coarse: 4 mV are 3 % of its voltage. */
#define STRONG_A 0.8f
/* The same on the way down to a hold, where what noise and steps do at more is counted. */
#define WEAK_A 0.6f

#define SURE_SDS 5.0f /* what noise never does in months */

#define UNIFORM_SD 0.29f /* of a width that is evenly filled: 1 / sqrt(12) */

#define SHIFT_SD_K    3.0f /* of declared transformation temperatures; a seen one's place */
#define SHIFT_BOUND_K 8.0f /* 2.6 of it, or a load */

#define LEAST_SD_K 0.6f /* parts of one spring differ by so much */

#define TRUST_SD_K 5.0f /* of ambient, or of what a reset has kept */

#define SLOW_TURNS 16 /* of the average: 4 s, six periods of the dither */
#define SLOW_SHARE (1.0f / SLOW_TURNS)
/* Of an average that is worth comparing: three times as sure as one. */
#define ANCHOR_TURNS 8

/* Of a phase, by resistances that were learnt at another current, or declared. */
#define LOOK_SD 0.12f

#define LEARNT_AT_C 20.0f /* a learnt martensite's resistance is that at this temperature */

#define LOSS_TOLERANCE 0.2f  /* of a declared loss, either way; a draught, a door */
#define LOSS_SD        0.12f /* of that, evenly */
#define LEAST_LOSS     (1.0f - LOSS_TOLERANCE)
#define CAPACITY_SD    0.09f   /* of a declared heat capacity: 15 %, evenly */
#define LOSS_MOST      0.45f   /* of the declared loss: no more is ever believed */
#define LOSS_FLOOR     (-0.8f) /* and no less: under a cloth it is a third */

#define LOSS_LEAST    0.0012f /* of the resistance: what a sensor's steps leave in the average */
#define COARSE_V      0.0001f /* unit of what they may leave where all of a sweep is rounded alike */
#define ANCHOR_K      3.0f    /* 0.45 % of the resistance by the largest coefficient */
#define CROSSING_SD_K 1.0f

#define OFFSET_MOST_V 0.012f /* no sensor's is larger */

/* ---- what is noted of a sight, for whoever asks why; nothing is decided by it ---- */

/* What is believed before a sight. */
typedef struct {
    int16_t distance_c7; /* to martensite start */
    float sd_k;          /* 0: nothing is known */
    float shift_k;
    float loss_w_per_k;
} spring_before_t;

spring_before_t spring_before(const spring_belief_t *belief, const thermal_model_t *model,
                              uint8_t spring);
/* A sight that puts it at seen_c, give or take sd_k (0: at no place), and what has become of what
 * was believed. */
void spring_note(spring_estimator_t *estimator, const thermal_model_t *model, uint8_t spring,
                 spring_sight_kind_t kind, const spring_before_t *before, float seen_c, float sd_k);
/* The same of one that is seen turn after turn: all of it is one sight. */
void spring_note_on(spring_estimator_t *estimator, const thermal_model_t *model, uint8_t spring,
                    spring_sight_kind_t kind, const spring_before_t *before, float seen_c,
                    float sd_k);
/* Of the sight that was noted last: what was read less what was predicted, relative, and how
 * unsure that is. */
void spring_note_read(spring_estimator_t *estimator, uint8_t spring, float read, float sd);
/* What is done about it; SPRING_DID_ bits. */
void spring_note_did(spring_estimator_t *estimator, uint8_t spring, uint8_t did);

#define SLOW_NOISE_MOST 0.01f /* of an average: more is no noise */

float spring_clamp(float value, float low, float high);
/* The value with its bounds, SPRING_ESTIMATOR_BOUND_SDS either way. */
spring_bounds_t spring_around(float value, float sd);
float spring_now_c(const thermal_model_t *model, uint8_t spring);
float spring_ambient_c(const thermal_model_t *model);
float spring_above_ambient_k(const thermal_model_t *model, uint8_t spring);

/* The model's temperature, its phase as if it came there from martensite, or from austenite
 * (SPRING_PHASE_MARTENSITE or _AUSTENITE). */
void spring_set_temperature(thermal_model_t *model, uint8_t spring, float temperature_c,
                            uint8_t from);
/* What the model declares it to give off there, beside its neighbours as they are. */
float spring_declared_w(const thermal_model_t *model, uint8_t spring, float temperature_c);
/* Variance of the distance. */
float spring_distance_k2(const spring_belief_t *belief);
/* What 1 K more gives off, with what was found to be lost beyond the declared loss. */
float spring_stiffness_w_per_k(const spring_belief_t *belief);
/* The spring was seen at a place of its transformation, give or take sd_k: the one update of
 * distance, shift and loss. The model's temperature is set, its phase reached from `from`
 * (SPRING_PHASE_MARTENSITE or _AUSTENITE). Returns the error found, K. */
float spring_see(const spring_estimator_t *estimator, spring_belief_t *belief,
                 thermal_model_t *model, uint8_t spring, float seen_c, float sd_k, uint8_t from);
/* A loss beyond the declared one, within what is ever believed. */
float spring_loss_ever(const spring_estimator_t *estimator, float loss_w_per_k);
/* Of its loss beyond the declared one, within what is ever believed. */
void spring_correct_loss(const spring_estimator_t *estimator, spring_belief_t *belief,
                         float more_w_per_k);
/* It is not colder than limit_c, or that would be seen: as much as it would teach of the loss, but
 * no surer than before. */
void spring_keep_above(spring_estimator_t *estimator, spring_belief_t *belief,
                       thermal_model_t *model, uint8_t spring, float limit_c);

/* A spring was found colder, or reads hotter, than anything known explains: whether another one was
 * so, the same way, lately. Then it is the surroundings that have changed; of one alone it may be a
 * touch, or its contact. */
bool spring_steps_with_others(spring_estimator_t *estimator, uint8_t spring, bool hotter);
/* It is found in error_k (below 0: colder), by a sight that is sure to sd_k. Where that is farther
 * off than all that was known of it explains, one spring alone may have been touched, or its
 * contact has moved; where another was found so lately, the surroundings have stepped: the losses
 * of both are opened to it, so that what is seen from here on tells how much of it lasts: true. */
bool spring_open_to_step(spring_estimator_t *estimator, spring_belief_t *belief, uint8_t spring,
                         float error_k, float sd_k);
/* By keeping its phase it has come to give off less than is likely, and less than the other held
 * springs have on average since they were seen: no surroundings do that to one. O(springs). */
bool spring_keeps_alone(const spring_estimator_t *estimator, const spring_belief_t *belief,
                        uint8_t spring);

/* What springs of one wire have in common: nothing is known of it yet. */
void spring_begin_alloy(spring_estimator_t *estimator);
/* In a first heating the errors of alloy, heat capacity, latent heat and room are largely common.
 * It is martensite, and may be heated: what others have shown so far is in its temperature. */
void spring_begin_shared_heating(const spring_estimator_t *estimator, spring_belief_t *belief,
                                 const thermal_model_t *model, uint8_t spring);
/* In a turn of its first heating: it is moved as others were found to be. No surer by that. */
void spring_heat_as_others(const spring_estimator_t *estimator, spring_belief_t *belief,
                           thermal_model_t *model, uint8_t spring);
/* Its first heating begins to transform it, at seen_c: what others had moved it by tells of its
 * loss and shift as if it had been seen; and what is left tells of the others. To be called before
 * spring_see. */
void spring_share_onset(spring_estimator_t *estimator, spring_belief_t *belief,
                        const thermal_model_t *model, uint8_t spring, float seen_c);
/* A resistance has left its line for certain, the way of lost phase or the other one. */
void spring_alloy_sees(spring_estimator_t *estimator, bool other_way);
/* Standard deviation of that of one of its springs: what is unknown of the alloy, and its own. */
float spring_alloy_rise_sd_per_k(const spring_estimator_t *estimator);
/* By all that were seen so far the other way is an intermediate phase's; else it is a temperature's
 * or a contact's. */
bool spring_alloy_has_r_phase(const spring_estimator_t *estimator);
/* A spring that was austenite for certain has read so much more for a kelvin, relative: so do all
 * of its alloy. */
void spring_alloy_shows_rise(spring_estimator_t *estimator, float rise_per_k, float variance);

/* What is believed of a spring, or shared, is as it was sealed: before it is used in a turn, and
 * before a change of it is sealed, as else what has changed by itself would count as right.
 * O(bytes), as is a seal. */
bool spring_is_sound(const spring_estimator_t *estimator, uint8_t spring);
void spring_seal(spring_estimator_t *estimator, uint8_t spring);
/* Of what is shared: begun anew where it is not as it was sealed. */
void spring_open_shared(spring_estimator_t *estimator);
void spring_seal_shared(spring_estimator_t *estimator);
void spring_begin_shared(spring_estimator_t *estimator);
void spring_count_broken(spring_estimator_t *estimator);

/* Takes the turn's readings. Returns the share of them in the average. */
float spring_take_readings(spring_estimator_t *estimator, const thermal_model_t *model,
                           uint8_t spring);
/* It has jumped again and again: what it reads tells nothing. */
bool spring_is_loose(const spring_belief_t *belief);
/* All that readings are compared with jumps along: a contact, or the sensor. */
void spring_jump(spring_belief_t *belief, float by);
/* Of its own martensite at its temperature; 0: not known. */
float spring_martensite_ohm(const spring_belief_t *belief, const thermal_model_t *model, uint8_t k);
/* So they do, by `by` of what it read (below 0: less), where no phase can have: it counts as a
 * jump. */
void spring_misread(spring_estimator_t *estimator, const thermal_model_t *model, uint8_t spring,
                    float by, float noise);
/* By so much, of its austenite's, ohm is beyond what it read when it had transformed last (below 0:
 * less). 0 where as much as being hotter or colder makes of that explains it. While it is
 * heated, with what seemed to jump since that began or without, whichever is nearer. */
float spring_beyond_austenite(const spring_belief_t *belief, const thermal_model_t *model,
                              uint8_t spring, float ohm);
/* By how much of it a turn's resistance may be off, with nothing happening. */
float spring_read_tolerance(const spring_belief_t *belief);
/* It has transformed: what it reads now is its own austenite's, and the way there its change. */
void spring_learn_austenite(spring_belief_t *belief);

/* ---- a line: what a resistance is compared with while its spring is not heated ---- */

/* A hold begins. Now: what the last turn read is what it reads with the phase that it has. */
void spring_begin_hold_line(const spring_estimator_t *estimator, spring_belief_t *belief, bool now);
/* What the sensor's offset may add to a resistance from one current to another, relative. */
float spring_offset_may_show(const spring_belief_t *belief, float ohm, float from_a, float to_a);
/* The average begins with the last turn's. */
void spring_average_anew(spring_belief_t *belief);
/* Of the average, relative; share: of a turn in it. */
float spring_slow_variance(const spring_belief_t *belief, float share);
/* The current has dropped, the spring is what it was a moment ago: what reads otherwise is the
 * sensor's offset. Returns whether this turn told one. */
bool spring_learn_offset(spring_belief_t *belief);
/* What it reads on average now is what it reads with the phase that it has. Rough: it still moves,
 * another one follows when it is at rest. */
void spring_begin_line(spring_belief_t *belief, bool rough, float share);
/* By how much its resistance has left its line; on trial, since that began, what does not go back.
 */
float spring_has_left(const spring_belief_t *belief);
/* That is not the way of lost phase. */
bool spring_is_other_way(const spring_belief_t *belief, float left);
/* How a resistance that has left its line compares with all that may do so while phase is kept. */
typedef struct {
    float noise2; /* of the average and the line, relative, squared */
    float least;  /* what no average tells */
    float unsure; /* one standard deviation of what moves it otherwise; where it is sure */
    bool sure;    /* it has left it: by so much, or suspected for so long */
} spring_departure_t;
/* Of what has changed, squared; least2: what else it may be at least; sds of noise are sure. Counts
 * for how long it is suspected. */
spring_departure_t spring_departs(spring_belief_t *belief, const thermal_model_t *model,
                                  uint8_t spring, float changed2, float least2, float sds,
                                  float share);
/* Less than that may have left the line as long as it likes, and is never suspected; relative. */
float spring_unseen(const spring_departure_t *departure);
/* Where it is on its way down, having lost so much of its phase. */
float spring_lost_at_c(const thermal_model_t *model, uint8_t spring, float lost);
typedef struct {
    float c, sd_k;
} spring_place_t;
/* The same, with its standard deviation. */
spring_place_t spring_place_of(const thermal_model_t *model, uint8_t spring, float lost,
                               float lost_sd);

/* While it heats: what heat does to its resistance. */
void spring_heating_watch(spring_estimator_t *estimator, spring_belief_t *belief,
                          thermal_model_t *model, uint8_t spring);
/* While its temperature rests, moved_k in the last turn: whether it loses phase. The turn's share
 * in the average is that of its readings. */
void spring_holding_watch(spring_estimator_t *estimator, spring_belief_t *belief,
                          thermal_model_t *model, uint8_t spring, float moved_k, float share);
/* The same between the phases, on its way to a level or held there: what it loses tells that it is
 * no hotter than that. */
void spring_level_watch(spring_estimator_t *estimator, spring_belief_t *belief,
                        thermal_model_t *model, uint8_t spring, float moved_k, float share);

#endif
