#include "spring_estimator.h"

#include <math.h>

#include "invariant.h"
#include "spring_estimator_internal.h"

#define TICKS_PER_REST 5u /* of them one, as the model steps, has no turn: a round takes 1/4 s */

#define NOISE_FIRST 0.002f

#define LOSS_DRIFT_SD 0.0005f /* of the declared loss, in a second: 3 % in an hour */
#define LOSS_DRIFT    (SPRING_ESTIMATOR_TURN_S * LOSS_DRIFT_SD * LOSS_DRIFT_SD)
#define SHIFT_MOST_K  30.0f
#define OFFSET_SD_V   0.005f  /* 8 mV, and 5 mA in 0.2 ohm: evenly */
#define FORGETS       0.9998f /* a turn's: a disturbance is forgotten within 20 minutes */

#define TRUST_STILL_SDS 0.7f /* where the transformation may never show: probably over */
#define TRUST_ONSET_SDS 1.3f /* where its beginning was seen: certainly, but for 10 % */

#define READS_MISSING 0.02f  /* of the phase: nobody feels it */
#define READS_TURNS   8      /* at least, of a step's mean */
#define READS_NOISE   0.354f /* of the mean of so many, 1 / sqrt(8); no less of more */
#define TWO_NOISE     0.707f /* of two */

#define EXPLAINED_LEAST 0.005f /* of a resistance: what a sensor's steps leave in one turn */

#define LOOK_MOST    0.4f
#define LOOK_TURNS   3
#define LOOK_HOT_K   50.0f /* above a hold: 120 degC at the most */
#define LOOK_WARMS_K 3.0f  /* beyond the hottest that it may be */

float spring_clamp(float value, float low, float high)
{
    return value < low ? low : value > high ? high : value;
}

float spring_c(int16_t temperature_c7)
{
    return (float)temperature_c7 * (1.0f / 128.0f);
}

static int16_t as_c7(float temperature_c)
{
    return (int16_t)(spring_clamp(temperature_c, -40.0f, 215.0f) * 128.0f);
}

float spring_now_c(const thermal_model_t *model, uint8_t k)
{
    return spring_c(thermal_model_temperature_c7(model, k));
}

float spring_ambient_c(const thermal_model_t *model)
{
    return spring_c(thermal_model_ambient_c7(model));
}

float spring_above_ambient_k(const thermal_model_t *model, uint8_t k)
{
    return spring_c(
        (int16_t)(thermal_model_temperature_c7(model, k) - thermal_model_ambient_c7(model)));
}

float spring_declared_w(const thermal_model_t *model, uint8_t k, float temperature_c)
{
    return 1e-6f * (float)thermal_model_power_to_hold_uw(model, k, as_c7(temperature_c));
}

/* The temperature, its phase as if it came from martensite, or from austenite. */
void spring_set_temperature(thermal_model_t *model, uint8_t k, float temperature_c, uint8_t from)
{
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    thermal_model_set_temperature(model, k,
                                  (int16_t)(from == SPRING_PHASE_AUSTENITE
                                                ? t.austenite_finish_c7 + 128
                                                : t.martensite_finish_c7 - 128));
    thermal_model_set_temperature(model, k, as_c7(temperature_c));
}

float spring_distance_k2(const spring_belief_t *b)
{
    return b->variance_k2 + b->capacity_k * b->capacity_k;
}

/* ---- beginning ---- */

void spring_estimator_prepare(spring_estimator_t *e, const thermal_model_t *model, bool observes)
{
    const thermal_model_parameters_t *p = &model->parameters;
    e->observes = observes;
    e->heat_capacity_j_per_k = (float)p->heat_capacity_mj_per_k * 1e-3f;
    e->turn_k_per_w = SPRING_ESTIMATOR_TURN_S / e->heat_capacity_j_per_k;
    e->loss_w_per_k = (float)p->loss_uw_per_k * 1e-6f;
    e->loss_drift = LOSS_DRIFT * e->loss_w_per_k * e->loss_w_per_k;
    e->latent_k = (float)p->latent_heat_mj * 1e-3f / e->heat_capacity_j_per_k;
    const float width_k = 0.01f * (float)(p->austenite_finish_cc - p->austenite_start_cc);
    e->transforms_k_per_k = width_k / (width_k + e->latent_k);
    e->martensite_ohm = (float)p->resistance_martensite_uohm * 1e-6f;
    e->change = 1.0f - (float)p->resistance_martensite_uohm / (float)p->resistance_austenite_uohm;
    for (uint8_t k = 0; k < model->springs; k++) {
        if (e->spring[k].learnt.austenite_ohm == 0.0f && spring_is_sound(e, k)) {
            e->spring[k].learnt.change = e->change; /* the declared one stands in */
            spring_seal(e, k);
        }
    }
}

/* A temperature that is known to sd_k, and where its transformation lies as declared. */
static void begin(spring_belief_t *b, float temperature_c, float sd_k, uint8_t possible)
{
    const spring_learnt_t learnt = b->learnt;
    const float stiffness_w_per_k = b->declared_stiffness_w_per_k;
    *b = (spring_belief_t){.declared_stiffness_w_per_k = stiffness_w_per_k,
                           .variance_k2 = sd_k * sd_k + SHIFT_SD_K * SHIFT_SD_K,
                           .shift_variance_k2 = SHIFT_SD_K * SHIFT_SD_K,
                           .loss_variance = learnt.loss_sd_w_per_k * learnt.loss_sd_w_per_k,
                           .possible = possible,
                           .noise = NOISE_FIRST,
                           .offset_sd_v = OFFSET_SD_V,
                           .learnt = learnt,
                           .last_c7 = as_c7(temperature_c)};
}

/* All but its own numbers is going to be written anew, and these, where they are not kept. */
static void open_anew(spring_estimator_t *e, uint8_t k, bool keeps_learnt)
{
    if (!keeps_learnt || !spring_is_sound(e, k)) {
        e->spring[k].learnt = (spring_learnt_t){0};
    }
    spring_seal(e, k);
}

static void begin_unknown(spring_estimator_t *e, thermal_model_t *model, uint8_t k)
{
    spring_belief_t *b = &e->spring[k];
    spring_learnt_t learnt = b->learnt;
    learnt.loss_w_per_k = spring_loss_ever(e, learnt.loss_w_per_k);
    const float coldest_c = spring_ambient_c(model);
    const float width_k = SPRING_ESTIMATOR_HOTTEST_C - coldest_c;
    const float middle_c = coldest_c + 0.5f * width_k;
    spring_estimator_forget(e, k);
    spring_estimator_restore(e, k, &learnt);
    begin(b, middle_c, UNIFORM_SD * width_k + TRUST_SD_K /* of ambient */, SPRING_PHASE_ANY);
    b->hottest_c = SPRING_ESTIMATOR_HOTTEST_C;
    b->untested = true;
    spring_set_temperature(model, k, middle_c, SPRING_PHASE_MARTENSITE);
    spring_seal(e, k);
}

static void begin_all(spring_estimator_t *e, thermal_model_t *model, bool keeps_learnt)
{
    e->springs = model->springs;
    e->tick = e->turn = e->stiffness_turn = 0;
    e->last_turn = SPRING_ESTIMATOR_NO_TURN;
    spring_begin_shared(e);
    e->sights.numbers = 0;
    e->broken_seals = 0;
    e->doubtful = false;
    spring_seal_shared(e);
    for (uint8_t k = 0; k < e->springs; k++) {
        open_anew(e, k, keeps_learnt);
    }
    spring_estimator_prepare(e, model, true);
    for (uint8_t k = 0; k < e->springs; k++) {
        begin_unknown(e, model, k);
        spring_estimator_look_at_stiffness(e, model, k); /* from here on one in each round */
    }
}

void spring_estimator_init(spring_estimator_t *e, thermal_model_t *model)
{
    begin_all(e, model, false);
}

void spring_estimator_restart(spring_estimator_t *e, thermal_model_t *model)
{
    begin_all(e, model, true);
}

void spring_estimator_doubt(spring_estimator_t *e)
{
    spring_open_shared(e);
    e->doubtful = true;
    spring_seal_shared(e);
}

void spring_estimator_trust_spring(spring_estimator_t *e, const thermal_model_t *model, uint8_t k)
{
    if (!spring_is_sound(e, k)) {
        return; /* its turn finds it so */
    }
    const uint16_t austenite = thermal_model_austenite(model, k);
    begin(&e->spring[k], spring_now_c(model, k), TRUST_SD_K,
          austenite == 0                              ? SPRING_PHASE_MARTENSITE
          : austenite == THERMAL_MODEL_AUSTENITE_FULL ? SPRING_PHASE_AUSTENITE
                                                      : SPRING_PHASE_BETWEEN);
    e->spring[k].untested = austenite == 0;
    spring_open_shared(e);
    spring_note(e, model, k, SPRING_SIGHT_TOLD, &(spring_before_t){0}, 0.0f, 0.0f);
    spring_seal_shared(e);
    spring_seal(e, k);
}

void spring_estimator_trust_model(spring_estimator_t *e, const thermal_model_t *model)
{
    for (uint8_t k = 0; k < e->springs; k++) {
        spring_estimator_trust_spring(e, model, k);
    }
}

/* ---- one turn ---- */

/* It moves with the fan and the air: slowly. */
void spring_estimator_look_at_stiffness(spring_estimator_t *e, const thermal_model_t *model,
                                        uint8_t k)
{
    if (spring_is_sound(e, k)) { /* else its turn finds it so */
        const float now_c = spring_now_c(model, k);
        e->spring[k].declared_stiffness_w_per_k =
            (spring_declared_w(model, k, now_c + 8.0f) - spring_declared_w(model, k, now_c)) *
            0.125f;
        spring_seal(e, k);
    }
}

float spring_stiffness_w_per_k(const spring_belief_t *b)
{
    return b->declared_stiffness_w_per_k + b->learnt.loss_w_per_k;
}

/* How the errors of distance and loss go on in a turn. Returns the heat taken up, K. */
static float predict(const spring_estimator_t *e, spring_belief_t *b, const thermal_model_t *model,
                     uint8_t k, float power_w)
{
    const int16_t now_c7 = thermal_model_temperature_c7(model, k);
    const float rise_k = spring_c((int16_t)(now_c7 - b->last_c7));
    const float balance_w = 1e-6f * (float)thermal_model_power_to_hold_uw(model, k, now_c7);
    const float per_w = e->turn_k_per_w;
    const float above_k = spring_above_ambient_k(model, k);
    const float by_loss = -per_w * above_k;
    const float extra_w = b->learnt.loss_w_per_k * above_k;
    b->extra_loss_uw = (int32_t)(1e6f * extra_w);
    b->gives_w = balance_w + extra_w;
    const float keeps = 1.0f - per_w * spring_stiffness_w_per_k(b);
    const float kept = keeps * b->covariance;
    const float joins = by_loss * b->loss_variance;
    b->variance_k2 = keeps * keeps * b->variance_k2 + by_loss * (kept + kept + joins);
    b->covariance = kept + joins;
    b->loss_variance += e->loss_drift;
    b->capacity_k = keeps * b->capacity_k + CAPACITY_SD * rise_k;
    if (b->variance_k2 < LEAST_SD_K * LEAST_SD_K) {
        b->variance_k2 = LEAST_SD_K * LEAST_SD_K;
    }
    const float heat_k = per_w * (power_w - b->gives_w);
    if (b->gone_k > 0.0f) {
        /* where a contact has moved, what it takes up to transform may warm it */
        const bool by_contact = b->heating && b->unsteady != 0;
        const float latent_k = by_contact ? fmaxf(heat_k - rise_k, 0.0f) : 0.0f;
        b->gone_k = keeps * b->gone_k + per_w * above_k * b->gone_w_per_k + latent_k;
    }
    b->last_c7 = now_c7;
    return heat_k;
}

void spring_correct_loss(const spring_estimator_t *e, spring_belief_t *b, float more_w_per_k)
{
    const float most = LOSS_MOST * e->loss_w_per_k;
    const float least = LOSS_FLOOR * e->loss_w_per_k;
    const float now = b->learnt.loss_w_per_k; /* beyond it after another declaration: no farther */
    b->learnt.loss_w_per_k = spring_clamp(now + more_w_per_k, fminf(now, least), fmaxf(now, most));
}

float spring_see(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k,
                 float seen_c, float sd_k, uint8_t from)
{
    const float error_k = seen_c - spring_now_c(model, k);
    const float per_total = 1.0f / (spring_distance_k2(b) + sd_k * sd_k);
    const float gain = spring_distance_k2(b) * per_total;
    const float left = 1.0f - gain;
    const float by_loss = b->covariance * per_total;
    spring_set_temperature(model, k, seen_c - left * error_k, from);
    b->last_c7 = thermal_model_temperature_c7(model, k);
    b->seen = true;
    b->shift_k = spring_clamp(b->shift_k - fminf(b->shift_variance_k2 * per_total, gain) * error_k,
                              -SHIFT_MOST_K, SHIFT_MOST_K);
    spring_correct_loss(e, b, by_loss * error_k);
    b->kept_w_per_k = 0.0f;
    b->loss_variance -= by_loss * b->covariance;
    b->covariance *= left;
    b->capacity_k *= left;
    b->shift_variance_k2 *= left;
    b->variance_k2 = fmaxf(b->variance_k2 * left, LEAST_SD_K * LEAST_SD_K);
    INVARIANT(b->loss_variance >= 0.0f && b->variance_k2 > 0.0f);
    return error_k;
}

void spring_keep_above(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k,
                       float limit_c)
{
    const float error_k = limit_c - spring_now_c(model, k);
    if (error_k > 0.0f) {
        spring_before_t before = spring_before(b, model, k);
        before.loss_w_per_k -= b->kept_w_per_k; /* since it was last seen, as all of this sight */
        const float less_w_per_k = b->covariance / spring_distance_k2(b) * error_k;
        spring_correct_loss(e, b, less_w_per_k);
        b->kept_w_per_k += less_w_per_k;
        if (b->possible == SPRING_PHASE_AUSTENITE && !b->trial && !b->hot &&
            spring_keeps_alone(e, b, k)) {
            /* it hardly can lose so little: what is read may not be its phase. If it is, the loss
             * is right, and the declared one would overheat it: it stays. */
            b->blind = true;
            b->lost = 1.0f;
        }
        spring_set_temperature(model, k, limit_c, SPRING_PHASE_AUSTENITE);
        b->last_c7 = thermal_model_temperature_c7(model, k);
        spring_note_on(e, model, k, SPRING_SIGHT_KEPT, &before, limit_c, 0.0f);
    }
}

/* After power-on what was learnt before tells the phase, and so between which temperatures it is.
 * While nobody watched, a crimp or a sensor may have become another one: then hot austenite reads
 * as martensite did, or the other way round. So it is believed where what is known without it says
 * the same, that springs may be hot or cannot be; else its spring waits until it is cold. Where
 * someone said that it is martensite, it tells whether that can be. */
static void look(spring_estimator_t *e, thermal_model_t *model, uint8_t k)
{
    spring_belief_t *b = &e->spring[k];
    const spring_learnt_t *l = &b->learnt;
    const bool told = b->possible == SPRING_PHASE_MARTENSITE;
    if (!b->untested || (b->possible != SPRING_PHASE_ANY && !told) || b->current_a < STRONG_A ||
        b->fresh < LOOK_TURNS) {
        return;
    }
    const float unsure = LOOK_SD + SPRING_ESTIMATOR_BOUND_SDS * b->noise / fabsf(l->change);
    b->untested = !told && unsure > LOOK_MOST; /* told: of one that was heated nobody said it */
    if (l->austenite_ohm == 0.0f || unsure > LOOK_MOST) {
        return;
    }
    const bool may_be_hot = told || e->doubtful;
    const float austenite = 1.0f - (1.0f - b->slow_ohm / l->austenite_ohm) / l->change;
    const float hotter = COEFFICIENT_MOST_PER_K * LOOK_HOT_K / fabsf(l->change);
    if (!told && austenite > 1.0f + unsure + hotter) {
        b->untested = false; /* no phase reads that: its sensor lies */
        return;
    }
    if (may_be_hot ? austenite <= 1.0f - unsure : austenite >= unsure) {
        return;
    }
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    const int16_t low_c7 = may_be_hot ? t.martensite_start_c7 : thermal_model_ambient_c7(model);
    const int16_t high_c7 = may_be_hot ? t.austenite_finish_c7 : t.austenite_start_c7;
    const uint8_t phase = may_be_hot ? SPRING_PHASE_AUSTENITE : SPRING_PHASE_MARTENSITE;
    const float middle_c = 0.5f * (spring_c(low_c7) + spring_c(high_c7));
    const uint8_t fresh = b->fresh;
    const bool heating = b->heating;
    const spring_before_t before = spring_before(b, model, k);
    const float sd_k = UNIFORM_SD * spring_c((int16_t)(high_c7 - low_c7));
    begin(b, middle_c, sd_k, phase);
    spring_set_temperature(model, k, middle_c, phase);
    b->last_c7 = thermal_model_temperature_c7(model, k);
    b->fresh = fresh;
    b->seen = true;
    spring_note(e, model, k, SPRING_SIGHT_LOOKED, &before, middle_c, sd_k);
    if (heating) {
        spring_estimator_begin_heating(e, model, k);
        b->run.heat.begun_c = spring_c(low_c7);
    }
}

/* Heat capacity where the hottest possible spring is: on its way it gives off its latent heat. */
static float hottest_capacity_j_per_k(const spring_estimator_t *e, const spring_belief_t *b,
                                      const thermal_model_transformation_t *t)
{
    const float width_k = spring_c((int16_t)(t->martensite_start_c7 - t->martensite_finish_c7));
    return b->hottest_c > spring_c(t->martensite_start_c7)
               ? e->heat_capacity_j_per_k
               : e->heat_capacity_j_per_k * (1.0f + e->latent_k / width_k);
}

/* Of a spring of which nothing is known: the hottest that it can be, and whether that is
 * martensite. Its neighbours may be as hot. */
static void cool(spring_estimator_t *e, spring_belief_t *b, const thermal_model_t *model, uint8_t k,
                 float power_w)
{
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    const float above_k = b->hottest_c - spring_ambient_c(model);
    b->hottest_c += SPRING_ESTIMATOR_TURN_S * (power_w - LEAST_LOSS * e->loss_w_per_k * above_k) /
                    hottest_capacity_j_per_k(e, b, &t);
    /* what does not tell it within a second or two does not for the power of a look */
    b->untested = b->untested && b->hottest_c < SPRING_ESTIMATOR_HOTTEST_C + LOOK_WARMS_K;
    if (b->hottest_c < spring_c(t.martensite_finish_c7)) {
        const spring_before_t before = spring_before(b, model, k);
        b->possible = SPRING_PHASE_MARTENSITE;
        b->untested = false;
        spring_begin_shared_heating(e, b, model, k);
        spring_note(e, model, k, SPRING_SIGHT_COOLED, &before, 0.0f, 0.0f);
    }
}

/* In its next turn: nothing that has a seal is written in between. */
static void end_what_was_left(const spring_estimator_t *e, spring_belief_t *b)
{
    if (b->left && b->heating) {
        b->heating = b->onset = b->steep = b->unlike = false;
        spring_begin_hold_line(e, b, false);
    }
    b->left = false;
}

/* On its way down to a level, or held there: by what it reads some austenite is left for certain.
 * Then it has not come to martensite finish, whatever its temperature is believed to be. */
static bool still_reads_austenite(const spring_estimator_t *e, const spring_belief_t *b,
                                  const thermal_model_t *model, uint8_t k)
{
    return (b->possible & SPRING_PHASE_BETWEEN) != 0 && spring_estimator_sees(b) &&
           b->current_a > STRONG_A && spring_estimator_austenite(e, model, k).low > 0.0f;
}

static void take_turn(spring_estimator_t *e, thermal_model_t *model, uint8_t k)
{
    spring_belief_t *b = &e->spring[k];
    const int16_t before_c7 = b->last_c7;
    b->seen = false;
    const float share = spring_take_readings(e, model, k);
    const bool tells = b->fresh != 0 && b->current_a >= WEAK_A;
    const float power_w = b->reads ? b->current_a * b->current_a * b->ohm : 0.0f;
    const float heat_k = predict(e, b, model, k, power_w);
    const float moved_k = spring_c((int16_t)(b->last_c7 - before_c7));
    b->disturbance_k *= FORGETS;
    if (b->heating && (b->reads || b->fresh == 0)) { /* while a current settles, who knows */
        /* a spring that waits cools by no less than the least loss: more would hide a finish */
        b->run.heat.heat_k += heat_k < 0.0f ? LEAST_LOSS * heat_k : heat_k;
        /* and one that may lose more takes up less: a weak heating that looks like an end */
        if (b->onset) {
            b->run.heat.flat_k += heat_k - (1.0f - LEAST_LOSS) * e->turn_k_per_w * b->gives_w;
        }
    }
    if (b->reads && e->observes && !spring_is_loose(b)) {
        look(e, model, k);
        spring_heating_watch(e, b, model, k);
        if (!b->blind) {
            spring_holding_watch(e, b, model, k, moved_k, share);
            spring_level_watch(e, b, model, k, moved_k, share);
        }
    } else {
        b->unproven = b->unproven || spring_is_loose(b);
        if (b->heating) {
            b->run.heat.mark_ohm = 0.0f;
            b->steep = false;
        } else {
            b->run.line.ohm = 0.0f;
        }
        b->quiet = 0;
    }
    if (b->possible == SPRING_PHASE_ANY) {
        cool(e, b, model, k, power_w);
        return;
    }
    const int16_t now_c7 = thermal_model_temperature_c7(model, k);
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    if (now_c7 < t.martensite_finish_c7) {
        const float below_k = spring_c((int16_t)(t.martensite_finish_c7 - now_c7));
        if (still_reads_austenite(e, b, model, k)) {
            spring_keep_above(e, b, model, k, spring_c(t.martensite_finish_c7));
        } else if (below_k > SPRING_ESTIMATOR_BOUND_SDS * spring_estimator_sd_k(b)) {
            b->possible = SPRING_PHASE_MARTENSITE;
            b->lost = 0.0f;
            return;
        }
    }
    if (b->possible == SPRING_PHASE_AUSTENITE && !tells &&
        spring_estimator_distance_k(e, model, k).low < 0.0f) {
        b->possible = SPRING_PHASE_BETWEEN | SPRING_PHASE_AUSTENITE; /* nothing tells any more */
    }
}

bool spring_estimator_update(spring_estimator_t *e, thermal_model_t *model, uint8_t k)
{
    spring_belief_t *b = &e->spring[k];
    const int16_t before_c7 = b->last_c7;
    const bool sound = spring_is_sound(e, k);
    spring_open_shared(e);
    e->stepped_turns = e->stepped_turns > 0 ? (uint16_t)(e->stepped_turns - 1) : 0;
    if (k == 0) {
        spring_sights_turn(&e->sights);
    }
    if (sound) {
        end_what_was_left(e, b);
        take_turn(e, model, k);
    } else {
        open_anew(e, k, false);
        spring_estimator_look_at_stiffness(e, model, k);
        begin_unknown(e, model, k);
        spring_count_broken(e);
        spring_note(e, model, k, SPRING_SIGHT_ANEW, &(spring_before_t){0}, 0.0f, 0.0f);
    }
    b->anew = !sound;
    b->moved_c7 = (int16_t)(b->last_c7 - before_c7);
    spring_seal(e, k);
    spring_seal_shared(e);
    return sound;
}

void spring_estimator_tick(spring_estimator_t *e, thermal_model_t *model,
                           const int16_t measured_ma[], const int16_t measured_mv[],
                           const bool valid[])
{
    for (uint8_t k = 0; valid != NULL && k < e->springs; k++) {
        if (valid[k]) {
            spring_estimator_take(e, k, measured_ma[k], measured_mv[k]);
        }
    }
    e->tick = (uint8_t)(e->tick + 1u < TICKS_PER_REST ? e->tick + 1u : 0u);
    e->last_turn = e->tick != 0 ? e->turn : SPRING_ESTIMATOR_NO_TURN;
    if (e->tick == 0) {
        return;
    }
    for (uint16_t k = e->turn; k < e->springs; k = (uint16_t)(k + SPRING_ESTIMATOR_ROUND)) {
        (void)spring_estimator_update(e, model, (uint8_t)k);
    }
    e->turn = (uint8_t)(e->turn + 1u < SPRING_ESTIMATOR_ROUND ? e->turn + 1u : 0u);
    if (e->turn == 0) {
        e->stiffness_turn = (uint8_t)((e->stiffness_turn + 1u) % e->springs);
        spring_estimator_look_at_stiffness(e, model, e->stiffness_turn);
    }
}

/* ---- stages ---- */

/* What ohm is compared with: its austenite's. What a heating took for a contact's jump may have
 * been phase: until it ends, the one without that is kept beside it, and the nearer one counts. */
static float austenite_ohm(const spring_belief_t *b, float ohm)
{
    const float learnt_ohm = b->learnt.austenite_ohm;
    const float was_ohm = b->heating ? b->run.heat.was_ohm : 0.0f;
    return was_ohm > 0.0f && fabsf(ohm - was_ohm) < fabsf(ohm - learnt_ohm) ? was_ohm : learnt_ohm;
}

float spring_beyond_austenite(const spring_belief_t *b, const thermal_model_t *model, uint8_t k,
                              float ohm)
{
    const int16_t finish_c7 = thermal_model_transformation(model, k).austenite_finish_c7;
    const float hotter_k = spring_now_c(model, k) - spring_c(finish_c7);
    const float explains = COEFFICIENT_MOST_PER_K * hotter_k;
    const float more = ohm / austenite_ohm(b, ohm) - 1.0f;
    const float low = fminf(explains, 0.0f);
    const float high = fmaxf(explains, 0.0f);
    return more > high ? more - high : more < low ? more - low : 0.0f;
}

float spring_read_tolerance(const spring_belief_t *b)
{
    return EXPLAINED_LEAST + SPRING_ESTIMATOR_BOUND_SDS * b->noise;
}

/* It reads less than when it had transformed last, and the difference is neither noise nor a
 * temperature coefficient. Or it is still to come: its alloy is another one, if the model is hot.
 */
bool spring_estimator_lacks_phase(const spring_belief_t *b, const thermal_model_t *model, uint8_t k)
{
    const spring_learnt_t *l = &b->learnt;
    if (b->fresh == 0 || spring_estimator_blind(b) || l->austenite_ohm == 0.0f ||
        b->current_a < STRONG_A) {
        return false;
    }
    const float beyond = spring_beyond_austenite(b, model, k, b->ohm);
    return (l->change < 0.0f ? beyond : -beyond) > spring_read_tolerance(b);
}

/* By its temperature. */
static bool surely_finished(const spring_belief_t *b, const thermal_model_t *model, uint8_t k,
                            float sds)
{
    return spring_now_c(model, k) - sds * spring_estimator_sd_k(b) >
           spring_c(thermal_model_transformation(model, k).austenite_finish_c7);
}

/* It is over, once heat changes it no more, by what it reads above austenite start, in two turns or
 * all of a step: as its austenite did when it had transformed last, but for what is not worth to
 * heat on for, and no more than a temperature makes of that. */
static bool reads_austenite(const spring_belief_t *b, const thermal_model_t *model, uint8_t k)
{
    const spring_learnt_t *l = &b->learnt;
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    const int16_t now_c7 = thermal_model_temperature_c7(model, k);
    if (!spring_estimator_sees(b) || l->austenite_ohm == 0.0f || b->current_a < STRONG_A ||
        b->changes || b->ohm_before[1] == 0.0f || now_c7 < t.austenite_start_c7) {
        return false;
    }
    const bool step = b->heating && b->run.heat.turns >= READS_TURNS;
    const float ohm = step ? b->run.heat.sum_ohm / (float)b->run.heat.turns
                           : 0.5f * (b->ohm_before[0] + b->ohm_before[1]);
    const float noise = (step ? READS_NOISE : TWO_NOISE) * b->noise;
    const float full_ohm = austenite_ohm(b, ohm);
    const float missing_ohm = l->change > 0.0f ? full_ohm - ohm : ohm - full_ohm;
    return missing_ohm < (READS_MISSING * fabsf(l->change) - noise) * full_ohm &&
           fabsf(spring_beyond_austenite(b, model, k, ohm)) < spring_read_tolerance(b);
}

bool spring_estimator_has_transformed(const spring_estimator_t *e, const thermal_model_t *model,
                                      uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    if (b->possible == SPRING_PHASE_AUSTENITE || reads_austenite(b, model, k)) {
        return true;
    }
    const float sds = spring_estimator_lacks_phase(b, model, k) ? SPRING_ESTIMATOR_BOUND_SDS
                      : b->onset                                ? TRUST_ONSET_SDS
                                                                : TRUST_STILL_SDS;
    return surely_finished(b, model, k, sds);
}

void spring_estimator_begin_hold(spring_estimator_t *e, thermal_model_t *model, uint8_t k,
                                 bool full)
{
    spring_belief_t *b = &e->spring[k];
    const bool ends = full && b->heating;
    const bool unseen = ends && b->possible != SPRING_PHASE_AUSTENITE;
    const bool lacks = unseen && spring_estimator_lacks_phase(b, model, k);
    /* neither has it come to its finish, nor is that seen; or what it reads says otherwise */
    const bool unproven = lacks || (ends && !surely_finished(b, model, k, 0.0f) &&
                                    !spring_estimator_has_transformed(e, model, k));
    const spring_before_t before = spring_before(b, model, k);
    const bool was_austenite = b->possible == SPRING_PHASE_AUSTENITE;
    if (full && b->possible != SPRING_PHASE_AUSTENITE) {
        /* as hot as it may be, and what it reads shows none of it */
        b->blind = b->blind || b->possible == SPRING_PHASE_MARTENSITE;
        b->possible = SPRING_PHASE_AUSTENITE;
        spring_set_temperature(model, k, spring_now_c(model, k), SPRING_PHASE_AUSTENITE);
    } else if (!full && b->possible == SPRING_PHASE_AUSTENITE) {
        b->possible = SPRING_PHASE_BETWEEN | SPRING_PHASE_AUSTENITE;
    }
    if (ends && b->onset && !lacks && spring_estimator_sees(b) && b->current_a > STRONG_A) {
        spring_learn_austenite(b); /* hot enough, and its resistance had come to rest */
    }
    b->heating = b->left = false;
    b->unproven = unproven;
    b->kept_w_per_k = 0.0f;
    b->lost = 0.0f;
    b->quiet = 0;
    b->losing = 0;
    const bool strong = (full || was_austenite) && b->current_a > STRONG_A && b->fresh != 0;
    spring_begin_hold_line(e, b, strong);
    if (unseen) {
        spring_note(e, model, k, SPRING_SIGHT_UNSEEN, &before, 0.0f, 0.0f);
    }
    spring_note_did(e, k, SPRING_DID_HOLD);
    spring_seal(e, k);
    spring_seal_shared(e);
}

void spring_estimator_leave(spring_estimator_t *e, uint8_t k)
{
    e->spring[k].left = true;
}

/* ---- what is believed ---- */

bool spring_estimator_sees(const spring_belief_t *b)
{
    return b->reads && !spring_estimator_blind(b);
}

bool spring_estimator_blind(const spring_belief_t *b)
{
    return b->blind || spring_is_loose(b);
}

bool spring_estimator_knows(const spring_belief_t *b)
{
    return spring_estimator_sees(b) && !b->unproven;
}

float spring_estimator_cooling_s(const spring_estimator_t *e, const thermal_model_t *model,
                                 uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    const float start_c = spring_c(t.martensite_start_c7);
    const float finish_c = spring_c(t.martensite_finish_c7);
    const float ambient_c = spring_ambient_c(model);
    if (b->possible != SPRING_PHASE_ANY || finish_c <= ambient_c) {
        return 0.0f;
    }
    const float loss = LEAST_LOSS * e->loss_w_per_k;
    const float hot_c = fmaxf(b->hottest_c, start_c);
    const float left_c = fminf(b->hottest_c, start_c);
    spring_belief_t transforming = {.hottest_c = start_c};
    return e->heat_capacity_j_per_k / loss * logf((hot_c - ambient_c) / (start_c - ambient_c)) +
           hottest_capacity_j_per_k(e, &transforming, &t) / loss *
               logf((left_c - ambient_c) / (finish_c - ambient_c));
}

uint32_t spring_estimator_model_power_uw(const spring_estimator_t *e, uint8_t k, uint32_t power_uw)
{
    const int32_t own_uw = (int32_t)power_uw - e->spring[k].extra_loss_uw;
    return own_uw <= 0 ? 0 : (uint32_t)own_uw;
}

float spring_estimator_hold_w(const spring_estimator_t *e, uint8_t k, float above_k)
{
    const spring_belief_t *b = &e->spring[k];
    return b->gives_w + spring_stiffness_w_per_k(b) * above_k;
}

uint16_t spring_estimator_current_ma(const spring_estimator_t *e, uint8_t k, float power_w)
{
    const spring_belief_t *b = &e->spring[k];
    if (power_w <= 0.0f) {
        return 0;
    }
    const float current_ma =
        1000.0f * sqrtf(power_w / (b->fresh != 0 ? b->slow_ohm : e->martensite_ohm));
    return current_ma > 3200.0f ? 3200 : (uint16_t)current_ma;
}
