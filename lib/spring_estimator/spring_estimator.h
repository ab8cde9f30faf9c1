/* What it is for: what is known of each spring, and how surely: its distance to the transformation,
 * its phase, its own numbers (docs/believing.md).
 * What it owns: the average of its readings, the error of the model's temperature with its standard
 * deviation and its correction, the phases that nothing has excluded, what was learnt of this very
 * spring, whose turn it is.
 * What it never does: choose a current, touch hardware, allocate. It uses floating point, one
 * spring at a time. */
#ifndef SPRING_ESTIMATOR_H
#define SPRING_ESTIMATOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "spring_sights.h"
#include "thermal_model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SPRING_ESTIMATOR_MAX_SPRINGS THERMAL_MODEL_MAX_SPRINGS
/* between two updates of a spring */
#define SPRING_ESTIMATOR_TURN_S       (1.0f / SPRING_SIGHTS_TURNS_PER_S)
#define SPRING_ESTIMATOR_HOTTEST_C    120.0f /* that a spring may be when the power comes on */
#define SPRING_ESTIMATOR_REST_TURNS   40u    /* 10 s: the average of the readings has settled */
#define SPRING_ESTIMATOR_BOUND_SDS    2.6f  /* standard deviations: 99 % of a normal distribution */
#define SPRING_ESTIMATOR_LIKELY_SDS   2.0f  /* 95 % */
#define SPRING_ESTIMATOR_NEIGHBOUR_SD 0.25f /* of the rise that neighbours make: couplings */
/* Ticks with a turn, each of one spring in ten; in every fifth tick, as the model steps, is none.
 */
#define SPRING_ESTIMATOR_ROUND   10u
#define SPRING_ESTIMATOR_NO_TURN UINT8_MAX

/* Phases that nothing has excluded; bits. */
enum {
    SPRING_PHASE_MARTENSITE = 1,
    SPRING_PHASE_BETWEEN = 2,
    SPRING_PHASE_AUSTENITE = 4,
    SPRING_PHASE_ANY = 7
};

/* degC of a temperature of the model. */
float spring_c(int16_t temperature_c7);

/* A spring's own numbers, what stays of it over power-off. */
typedef struct {
    float austenite_ohm;  /* when it had just transformed; 0: it was never seen to */
    float change;         /* from martensite to austenite, of austenite_ohm; below 0: it falls */
    float martensite_ohm; /* at 20 degC; 0: it was never seen from cold */
    float martensite_rise_per_k; /* of that, relative */
    float loss_w_per_k;          /* beyond the declared one */
    float loss_sd_w_per_k;
    float offset_v;   /* of its sensor: of what is read of the voltage */
    float slow_noise; /* of its sensor: standard deviation of a resistance over 4 s, relative */
} spring_learnt_t;

/* Of the running heating. */
typedef struct {
    float begun_c;  /* where it began, at the coldest */
    float heat_k;   /* taken up, over heat capacity; less while it waits for its turn */
    float peak_k;   /* the most of it */
    float mark_k;   /* where the resistance was last compared, */
    float mark_ohm; /* and its mean until there; 0: nowhere yet */
    float sum_ohm;  /* of the turns since */
    float onset_ohm;
    float onset_k;  /* heat taken up until then; until it is seen, until its change began */
    float cold_ohm; /* at its beginning, martensite; 0: it was not */
    float cold_c;
    float rise;    /* of it while that was surely martensite, */
    float rise_k;  /* over so much heat */
    float excess;  /* change that no temperature coefficient explains; signed */
    float flat_k;  /* heat since, without such a change */
    float was_ohm; /* its austenite's as it began; 0: not known */
    uint8_t turns; /* in sum_ohm */
} spring_heat_t;

/* Of the running hold. */
typedef struct {
    float ohm;        /* what it reads while it keeps its phase; 0: none yet */
    float a;          /* at this current */
    float variance;   /* of the line itself, relative */
    float way_k;      /* how far its temperature has moved since */
    float slow_k;     /* the same, averaged as the readings are */
    float rise_per_k; /* what a kelvin adds to it, relative */
    float rise_sd_per_k;
    float was_ohm[2]; /* its average 4 and 8 s earlier; 0: it was begun anew since */
    uint16_t turns;   /* since then */
    float trial_ohm;  /* as its trial began */
} spring_line_t;

/* What is believed of one spring. Nobody but this module looks into it: what others may know of it
 * is what the functions below say.
 *
 * The model keeps the temperature on the declared scale: there the transformation lies where it is
 * declared, and the distance to it is what readings tell. shift_k is how much of that is believed
 * to be the transformation's own (a load, another batch) and not the temperature's. */
typedef struct {
    /* the running turn's readings: each tick writes them, so they alone have no seal
     * (spring_seal.c) */
    uint8_t readings;
    uint8_t settling;   /* to be left out, after a jump of the current */
    bool cut_short : 1; /* there was such a jump in the running turn */
    bool left : 1;      /* nothing is asked of it any more: the next turn ends what ran */
    uint8_t coarse : 4; /* so far apart its average voltages may be, 0.1 mV, by its sensor's steps
                         * alone; told anew all the time, too */
    uint16_t current_sum_ma;
    uint16_t voltage_sum_mv;
    /* the error of that temperature: variances of what the loss explains, and of the heat capacity
     */
    float variance_k2;
    float covariance;    /* of distance and loss, W */
    float loss_variance; /* (W/K)^2 */
    float capacity_k;    /* a standard deviation, signed: it shrinks again on the way back */
    float shift_k;
    float shift_variance_k2;
    float declared_stiffness_w_per_k; /* what 1 K more of this spring gives off */
    int32_t extra_loss_uw;            /* what it loses beyond the model, now */
    float gives_w;                    /* what it gives off in all, in the last turn */
    float disturbance_k;              /* how far it was found from where it was believed, lately */
    union {
        float hottest_c; /* while nothing is known: the most that it can be by now */
        float shared_k;  /* in its first heating: how much hotter it is by what others showed */
    };
    float kept_w_per_k; /* taken off the loss since it was last seen, as nothing was seen */
    float lost;         /* phase lost since it had transformed, 0..1 */
    uint8_t possible;   /* SPRING_PHASE_ bits */
    uint8_t fresh;      /* turns with readings since current flows, saturating */
    uint8_t quiet;      /* turns in which its temperature hardly moved; saturating */
    uint8_t losing;     /* turns on end in which it seems to lose phase */
    uint8_t averaged;   /* turns in slow_ohm, saturating */
    uint16_t unsteady;  /* turns, of all that a contact or the sensor has jumped lately */
    /* bits: of nine springs they are a good part of the RAM that is spare */
    bool unproven : 1;  /* that its heating has transformed it: its contact came and went, a limit
                         * ended it, or what it reads lacks phase */
    bool odd : 1;       /* the turn before read what no phase changes to so fast */
    bool reads : 1;     /* the last turn had readings fit for use */
    bool unread : 1;    /* a turn without them lies before those that it goes by */
    bool anew : 1;      /* the last turn has found it changed by itself, and began it anew */
    bool seen : 1;      /* the last turn has moved it to where it was seen */
    bool blind : 1;     /* a heating that must have transformed it did not show */
    bool heating : 1;   /* between spring_estimator_begin_heating and _begin_hold */
    bool onset : 1;     /* this heating was seen to begin to transform it */
    bool rough : 1;     /* the line is of few turns, not of a spring at rest */
    bool steep : 1;     /* and its resistance still changes as only that explains */
    bool changes : 1;   /* so it does, whether its beginning was seen or not */
    bool untested : 1;  /* as it began nothing was known, or someone said that it is martensite;
                         * what it reads has not been compared with what was learnt since */
    bool trial : 1;     /* held with less power, to tell what its resistance has changed by */
    bool hot : 1;       /* in its hold it reads beyond what its austenite read when that was hot */
    bool from_full : 1; /* this heating began fully on */
    bool single : 1;    /* its next step of heat is compared with one turn, not with a mean */
    bool unlike : 1;    /* this heating's martensite was not of the declared resistance */
    spring_learnt_t learnt;

    float current_a; /* of the last turn that had readings */
    float ohm;
    float ohm_before[2]; /* one and two turns earlier; 0: at another current */
    float slow_ohm;      /* over 4 s */
    float slow_a;        /* the current over the same */
    float phase_ohm;     /* the last at a strong current: what tells the phase */
    float offset_sd_v;   /* of its sensor's offset */
    float noise;         /* standard deviation of one turn's, relative */
    int16_t last_c7;     /* the model's temperature a turn ago */
    int16_t moved_c7;    /* by how much the last turn has moved it */
    /* doubt: what it lost may have been none */
    float gone_k;       /* what its distance */
    float gone_w_per_k; /* and loss were moved by */
    /* it heats, or it does not */
    union {
        spring_heat_t heat; /* while heating */
        spring_line_t line;
    } run;
} spring_belief_t;

/* Of all springs; nobody looks into it, either. */
typedef struct {
    uint8_t springs;
    bool observes; /* readings are used */
    float heat_capacity_j_per_k;
    float turn_k_per_w;       /* what 1 W adds in a turn */
    float latent_k;           /* latent heat over heat capacity */
    float transforms_k_per_k; /* what it warms by for a kelvin of heat while it transforms */
    float loss_w_per_k;
    float loss_drift; /* of its variance in a turn, (W/K)^2 */
    float martensite_ohm;
    float change; /* declared, as in spring_learnt_t */
    spring_belief_t spring[SPRING_ESTIMATOR_MAX_SPRINGS];
    uint8_t tick;           /* counts to the next that has no turn */
    uint8_t turn;           /* of the round in which each spring has one */
    uint8_t last_turn;      /* that of the last tick, or SPRING_ESTIMATOR_NO_TURN */
    uint8_t stiffness_turn; /* whose stiffness is looked at next */
    uint16_t seal[SPRING_ESTIMATOR_MAX_SPRINGS]; /* checksums, of each belief and what is shared */
    uint16_t shared_seal;
    /* what all springs share */
    float r_phase_odds; /* that cooling leads through an intermediate phase: log of them */
    float warms;        /* in a first heating, for a kelvin above ambient: more by so much */
    float rise_per_k;   /* what a kelvin adds to the resistance of its austenite, relative */
    float rise_sd_per_k;
    /* one was found colder, or read hotter, than anything known explains */
    uint16_t stepped_turns; /* of all springs: for so many more it counts as lately */
    uint8_t stepped_spring;
    bool stepped_hotter : 1;
    bool doubtful : 1; /* as they began they may have been hot: springs of which nothing is known */
    uint8_t broken_seals;   /* found so far, saturating: what was believed had changed by itself */
    spring_sights_t sights; /* for whoever asks why */
} spring_estimator_t;

/* Its first bytes are by settings alone. */
#define SPRING_ESTIMATOR_FIXED_BYTES offsetof(spring_estimator_t, spring)

typedef struct {
    float value, low, high;
} spring_bounds_t;

/* Nothing is known of any spring: any phase, from the model's ambient to
 * SPRING_ESTIMATOR_HOTTEST_C. The model's temperatures are set to the middle. */
void spring_estimator_init(spring_estimator_t *estimator, thermal_model_t *model);
/* The same, but what was learnt stays: of an estimator that was initialised, or is 0. */
void spring_estimator_restart(spring_estimator_t *estimator, thermal_model_t *model);
/* Of springs of which nothing is known: the board has heated them before, and nobody waited since.
 * What they read is martensite then for none of them, and else austenite for none. */
void spring_estimator_doubt(spring_estimator_t *estimator);
/* Takes what it needs of the model's parameters; whether readings are used. What is believed stays.
 */
void spring_estimator_prepare(spring_estimator_t *estimator, const thermal_model_t *model,
                              bool observes);
/* The model's temperatures and phases are right, to some kelvin: a hint, or what a warm reset has
 * kept. */
void spring_estimator_trust_model(spring_estimator_t *estimator, const thermal_model_t *model);
/* Those of one spring. */
void spring_estimator_trust_spring(spring_estimator_t *estimator, const thermal_model_t *model,
                                   uint8_t spring);
/* What was learnt before. Numbers that no spring has are left out. */
void spring_estimator_restore(spring_estimator_t *estimator, uint8_t spring,
                              const spring_learnt_t *learnt);
/* Nothing is known of its own numbers but the declared ones. */
void spring_estimator_forget(spring_estimator_t *estimator, uint8_t spring);
/* What the model declares the spring to give off where it is; of a colder one, 60 K above ambient,
 * W. */
float spring_estimator_declared_w(const thermal_model_t *model, uint8_t spring);
/* Another model is declared, of as many springs, and each is where it was; before_w is
 * spring_estimator_declared_w by the one until now. What was seen of a spring's loss was seen of
 * all that it gives off: that stays, as unsure as it was, beside what is declared now; where
 * nothing was seen, or so long ago that it is no surer than a declaration, what is lost beyond the
 * declared stays. To be called before spring_estimator_prepare. */
void spring_estimator_keep_loss(spring_estimator_t *estimator, const thermal_model_t *model,
                                uint8_t spring, float before_w);
/* True if and only if a contact is declared that leaves of what its martensite read in this
 * heating, or its austenite when it transformed, less than any martensite of the declared one has:
 * it is not there. */
bool spring_estimator_lacks_contact(const spring_estimator_t *estimator,
                                    const thermal_model_t *model, uint8_t spring);
/* Its loss beyond the declared one is no more known than of any spring: it was learnt beside a
 * model that nobody knows. */
void spring_estimator_forget_loss(spring_estimator_t *estimator, uint8_t spring);
/* What has been learnt, with how surely. */
spring_learnt_t spring_estimator_learnt(const spring_estimator_t *estimator, uint8_t spring);
/* The same as spring_estimator_restore takes it: a loss that another declaration left beyond the
 * most that is ever believed is that. */
spring_learnt_t spring_estimator_to_keep(const spring_estimator_t *estimator, uint8_t spring);

/* One tick of 20 ms: takes the readings, of springs of which they are valid (NULL: nothing is
 * measured), and of those whose turn it is believes what they say. */
void spring_estimator_tick(spring_estimator_t *estimator, thermal_model_t *model,
                           const int16_t measured_ma[], const int16_t measured_mv[],
                           const bool valid[]);
/* Whose turn it was in the last tick: this spring's and each SPRING_ESTIMATOR_ROUND-th one's from
 * there; SPRING_ESTIMATOR_NO_TURN: nobody's. */
static inline uint8_t spring_estimator_turn(const spring_estimator_t *estimator)
{
    return estimator->last_turn;
}

/* The parts of a tick. One reading of one spring; negative ones are left out. Inline: every tick
 * takes nine. */
static inline void spring_estimator_take(spring_estimator_t *estimator, uint8_t spring,
                                         int16_t current_ma, int16_t voltage_mv)
{
    spring_belief_t *const belief = &estimator->spring[spring];
    if (belief->settling != 0) {
        belief->settling--;
    } else if (current_ma >= 0 && voltage_mv >= 0 && current_ma < 4096 && voltage_mv < 4096 &&
               belief->readings < 15) {
        belief->current_sum_ma = (uint16_t)(belief->current_sum_ma + (uint16_t)current_ma);
        belief->voltage_sum_mv = (uint16_t)(belief->voltage_sum_mv + (uint16_t)voltage_mv);
        belief->readings++;
    }
}

/* Once in a turn: takes the readings, and moves the model's temperature and phase to what they say.
 * False if and only if it has begun anew (spring_estimator_has_begun_anew). */
bool spring_estimator_update(spring_estimator_t *estimator, thermal_model_t *model, uint8_t spring);

/* What the spring gives off per kelvin, as the model has it by now: to be called once in some
 * seconds, in a tick that has room. */
void spring_estimator_look_at_stiffness(spring_estimator_t *estimator, const thermal_model_t *model,
                                        uint8_t spring);

/* ---- what it is told of what is done to a spring ---- */

/* The current jumps: readings on the way are left out. */
void spring_estimator_disturb(spring_estimator_t *estimator, uint8_t spring);
/* By its duty's steps: a mA takes so many of them, in Q16, and its current sweeps over so many mA.
 * Where each moves the voltage by a whole step of the sensor, all of the sweep is rounded alike,
 * and averages keep what one reading has. */
void spring_estimator_sweep(spring_estimator_t *estimator, uint8_t spring, uint16_t gain_q16,
                            uint16_t sweep_ma);
/* A heating begins: what the resistance does from here on tells of the transformation. In its turn,
 * once that has been updated; as a hold does. */
void spring_estimator_begin_heating(spring_estimator_t *estimator, const thermal_model_t *model,
                                    uint8_t spring);
/* Nothing is asked of it any more, or by others: a heating that ran is over, and tells nothing. */
void spring_estimator_leave(spring_estimator_t *estimator, uint8_t spring);
/* A hold begins, or a cooling to a level; full: of a spring that is taken to be fully on. */
void spring_estimator_begin_hold(spring_estimator_t *estimator, thermal_model_t *model,
                                 uint8_t spring, bool full);

/* ---- what is believed of a spring ---- */

static inline const spring_belief_t *spring_estimator_of(const spring_estimator_t *estimator,
                                                         uint8_t spring)
{
    return &estimator->spring[spring];
}
/* Phases that nothing has excluded: SPRING_PHASE_ bits; SPRING_PHASE_ANY where nothing is known. */
static inline uint8_t spring_estimator_possible(const spring_belief_t *belief)
{
    return belief->possible;
}
/* What was learnt before would tell its phase, if a current flowed: it has not yet. */
static inline bool spring_estimator_may_look(const spring_estimator_t *estimator, uint8_t spring)
{
    const spring_belief_t *const belief = &estimator->spring[spring];
    return belief->untested && belief->learnt.austenite_ohm > 0.0f && estimator->observes;
}
/* It was never fully on, to be seen, and nothing says yet that it does not show. */
static inline bool spring_estimator_untried(const spring_estimator_t *estimator, uint8_t spring)
{
    const spring_belief_t *const belief = &estimator->spring[spring];
    return belief->learnt.austenite_ohm == 0.0f && !belief->blind && estimator->observes;
}
/* The heating has fully transformed it: seen, or as hot as it takes whatever it reads. */
bool spring_estimator_has_transformed(const spring_estimator_t *estimator,
                                      const thermal_model_t *model, uint8_t spring);
/* It reads less than when it had transformed last, and the difference is neither noise nor a
 * temperature coefficient. */
bool spring_estimator_lacks_phase(const spring_belief_t *belief, const thermal_model_t *model,
                                  uint8_t spring);
/* Phase that it has lost since it had transformed, 0..1. */
static inline float spring_estimator_lost(const spring_belief_t *belief)
{
    return belief->lost;
}
/* It seems to lose some, not yet for certain. */
static inline bool spring_estimator_seems_to_lose(const spring_belief_t *belief)
{
    return belief->losing != 0;
}
/* Its resistance has changed as a hotter spring's does, or a contact's, or an intermediate phase's:
 * with less power it tells which. */
static inline bool spring_estimator_on_trial(const spring_belief_t *belief)
{
    return belief->trial;
}
/* While it heats: what it reads still changes as only a transformation explains. */
static inline bool spring_estimator_changes(const spring_belief_t *belief)
{
    return belief->changes;
}
/* Turns for which its temperature has hardly moved in its hold, saturating. */
static inline bool spring_estimator_rests(const spring_belief_t *belief)
{
    return belief->quiet > SPRING_ESTIMATOR_REST_TURNS;
}
/* By how much its temperature has moved in its last turn, 1/128 K. */
static inline int16_t spring_estimator_moved_c7(const spring_belief_t *belief)
{
    return belief->moved_c7;
}
/* Its last turn has found that what was believed of it had changed by itself, as RAM may: nothing
 * is known of it from there, as when the power comes on, nor of its own numbers, and it is as if no
 * heating or hold had begun. */
static inline bool spring_estimator_has_begun_anew(const spring_belief_t *belief)
{
    return belief->anew;
}
/* Its last turn has seen it at a place of its transformation, or began anew what is compared. */
static inline bool spring_estimator_has_just_seen(const spring_belief_t *belief)
{
    return belief->seen;
}
/* The martensite of its running heating is not of the declared resistance: another circuit. */
static inline bool spring_estimator_is_unlike(const spring_belief_t *belief)
{
    return belief->unlike;
}
/* How far it was found from where it was believed, lately, K: a gust, and it may come again. */
static inline float spring_estimator_disturbance_k(const spring_belief_t *belief)
{
    return belief->disturbance_k;
}
/* How much hotter it is if what it seems to have lost was no phase, K. */
static inline float spring_estimator_doubt_k(const spring_belief_t *belief)
{
    return belief->gone_k;
}
/* By how much its transformation lies above where it is declared, K. */
static inline float spring_estimator_shift_k(const spring_belief_t *belief)
{
    return belief->shift_k;
}
/* Standard deviation of its resistance in one turn, relative. */
static inline float spring_estimator_noise(const spring_belief_t *belief)
{
    return belief->noise;
}

/* Its resistance tells the phase. */
bool spring_estimator_sees(const spring_belief_t *belief);
/* What it reads tells nothing of its phase: it shows none, or its contact is loose. */
bool spring_estimator_blind(const spring_belief_t *belief);
/* So it is, or what it reads is not proven, or readings are not used: the model alone tells. */
static inline bool spring_estimator_by_model(const spring_estimator_t *estimator, uint8_t spring)
{
    const spring_belief_t *b = &estimator->spring[spring];
    return spring_estimator_blind(b) || b->unproven || !estimator->observes;
}
/* Its phase is known: its resistance tells it, and nothing is left that speaks against its having
 * transformed. How far from its transformation it is need not be. */
bool spring_estimator_knows(const spring_belief_t *belief);
/* Of the distance to the transformation. */
float spring_estimator_sd_k(const spring_belief_t *belief);
/* The same while it is held at its present temperature, at its largest: an error of the loss shows
 * within minutes. */
float spring_estimator_hold_sd_k(const spring_estimator_t *estimator, const thermal_model_t *model,
                                 uint8_t spring);
/* How long it may still be hot from before power-on, s; 0 where that is over. */
float spring_estimator_cooling_s(const spring_estimator_t *estimator, const thermal_model_t *model,
                                 uint8_t spring);

/* With the bounds of 99 %. Temperature in degC, as it is (with the shift); distance to martensite
 * start in K; austenite 0..1. */
spring_bounds_t spring_estimator_temperature_c(const spring_estimator_t *estimator,
                                               const thermal_model_t *model, uint8_t spring);
spring_bounds_t spring_estimator_distance_k(const spring_estimator_t *estimator,
                                            const thermal_model_t *model, uint8_t spring);
float spring_estimator_phase(const spring_estimator_t *estimator, const thermal_model_t *model,
                             uint8_t spring); /* of that the value alone */
spring_bounds_t spring_estimator_austenite(const spring_estimator_t *estimator,
                                           const thermal_model_t *model, uint8_t spring);

/* What the springs that are held lose, of what is declared, with its standard deviation: what they
 * have in common, a draught or the fan. False where fewer than two are held. O(springs). */
bool spring_estimator_losses(const spring_estimator_t *estimator, float *factor, float *sd);

/* How often that was so, of a spring or of what all share; saturating. */
static inline uint8_t spring_estimator_broken_seals(const spring_estimator_t *estimator)
{
    return estimator->broken_seals;
}
/* The last sights of all springs: why they are believed to be where they are. */
static inline const spring_sights_t *spring_estimator_sights(const spring_estimator_t *estimator)
{
    return &estimator->sights;
}

/* A CRC-16 of all that is believed of a spring and of its temperature in the model, to the last
 * bit: two that agree believe the same. */
uint16_t spring_estimator_mark(const spring_estimator_t *estimator, const thermal_model_t *model,
                               uint8_t spring);

/* What the model must be stepped with: measured power, below 2 kW, less what this spring loses
 * beyond it. */
uint32_t spring_estimator_model_power_uw(const spring_estimator_t *estimator, uint8_t spring,
                                         uint32_t power_uw);
/* Power that holds it so much above where it is, W: from what it gave off in its last turn. */
float spring_estimator_hold_w(const spring_estimator_t *estimator, uint8_t spring, float above_k);
/* Power beyond that which takes it there, at the pace of so many seconds, W. */
static inline float spring_estimator_follow_w(const spring_estimator_t *estimator, float above_k,
                                              float in_s)
{
    return above_k * estimator->heat_capacity_j_per_k / in_s;
}
/* Current for a power in the resistance that it has now, 0..3200 mA. */
uint16_t spring_estimator_current_ma(const spring_estimator_t *estimator, uint8_t spring,
                                     float power_w);

#ifdef __cplusplus
}
#endif
#endif
