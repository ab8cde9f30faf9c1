#include <math.h>

#include "spring_estimator_internal.h"

#define QUIET_K     0.08f /* a turn's: 0.3 K/s */
#define QUIET_TURNS 40    /* 10 s: the average has settled */
/* Of a turn, 60 s: what the line follows is no loss of phase. */
#define LINE_SHARE    (1.0f / 240.0f)
#define LOSS_LEAST    0.0012f /* of the resistance: what a sensor's steps leave in the average */
#define LEAST_AT_A    1.4f    /* at this current, and as 1 / I below it */
#define NOISE_IN_SLOW 0.18f   /* of one turn's, with all turns in it: sqrt(share / (2 - share)) */
/* Mean size of a second difference of averages, each of which still has a third of the one before
 * in it. */
#define SLOW_BEND_TO_SD   0.68f
#define SLOW_NOISE_RISES  280.0f /* turns, 70 s: what is taken for a loss is heated */
#define SLOW_NOISE_FALLS  560.0f
#define SLOW_NOISE_BEGINS 64.0f /* what was known before a rest counts as so many turns of it */
#define SLOW_NOISE_GROWS  2.0f  /* in one reading of it, at the most */
#define ANCHOR_K          3.0f  /* 0.45 % of the resistance by the largest coefficient */
#define SURE_SDS          5.0f
#define SUSPECTED         0.6f /* of what is sure: 3 of 5 */
#define OTHER_WAY         3.0f /* times as much: an intermediate phase, where drifts go either way */
#define STEP_OF_RISE      0.3f /* of it goes where the losses grow by 43 %: a draught, a door */
#define CONFIRM_TURNS     2
#define LASTING_TURNS     60    /* 15 s of suspicion are as sure */
#define LARGE_LOSS        0.04f /* no hold drifts so far: the transformation may have moved */
#define LARGE_SD_K        5.0f
#define CROSSING_SD_K     1.0f
#define APART_PER_A       0.5f    /* between two currents, as of 3 and 1.2 A */
#define OFFSET_LEAST_V    0.0005f /* what a turn's steps of 4 mV leave, and its noise */
#define OFFSET_SDS        3.0f
#define AWAY_LEAST_K      1.0f /* less tells nothing of a coefficient */
/* Of an average: so little phase may be lost unseen, and it tells anew in 2 x 16 turns. */
#define LINE_VARIANCE (32.0f * LOSS_LEAST * LOSS_LEAST)
#define BACK_SHARE    0.5f  /* of a loss: as near to being back as to being gone */
#define BACK_LEAST    0.01f /* twice what a line differs by from one heating to the next */
#define STILL_K       0.5f  /* below where it would be seen */
#define COSINE_BEGINS 0.64f /* 2 / pi: x where a cosine has sqrt(lost) = (pi / 2) x */

/* Where it is on its way down, having lost so much: the beginning of the cosine, (1 - cos pi x)
 * / 2. */
static float lost_at_c(const thermal_model_t *model, uint8_t k, float lost)
{
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    const float width_k = spring_c((int16_t)(t.martensite_start_c7 - t.martensite_finish_c7));
    const float depth = lost > 0.0f ? COSINE_BEGINS * sqrtf(fminf(lost, 1.0f)) : 0.0f;
    return spring_c(t.martensite_start_c7) - width_k * depth;
}

static void average_anew(spring_belief_t *b)
{
    b->slow_ohm = b->ohm;
    b->slow_a = b->current_a;
    b->averaged = 1;
    b->run.line.slow_k = b->run.line.way_k;
}

static float slow_variance(const spring_belief_t *b, float share)
{
    const float averages = b->averaged < SLOW_TURNS ? share : NOISE_IN_SLOW * NOISE_IN_SLOW;
    return fmaxf(b->noise * b->noise * averages, b->learnt.slow_noise * b->learnt.slow_noise);
}

/* What it reads on average now is what it reads with the phase that it has. Rough: it still moves,
 * another one follows when it is at rest. */
static void begin_line(spring_belief_t *b, bool rough, float share)
{
    b->run.line.ohm = b->slow_ohm;
    b->run.line.a = b->slow_a;
    b->run.line.variance = slow_variance(b, share);
    b->run.line.from_k += b->run.line.slow_k;
    b->run.line.way_k -= b->run.line.slow_k;
    b->run.line.slow_k = 0.0f;
    b->rough = rough;
    b->losing = 0;
}

static float start_c(const thermal_model_t *model, uint8_t k)
{
    return spring_c(thermal_model_transformation(model, k).martensite_start_c7);
}

static void see_crossing(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                         uint8_t k, float lost, float lost_sd)
{
    const spring_before_t before = spring_before(b, model, k);
    const float was_w_per_k = b->learnt.loss_w_per_k;
    const bool searched = spring_estimator_sd_k(b) > 3.0f * CROSSING_SD_K;
    if (lost > LARGE_LOSS) {
        /* nearer to it by as much as more is lost up there */
        const float above_k = fmaxf(spring_now_c(model, k) - spring_ambient_c(model), 1.0f);
        const float by_loss = spring_stiffness_w_per_k(b) / above_k;
        const float moved_k2 = LARGE_SD_K * LARGE_SD_K;
        b->shift_variance_k2 += moved_k2;
        b->variance_k2 += moved_k2;
        b->covariance -= moved_k2 * by_loss;
        b->loss_variance += moved_k2 * by_loss * by_loss;
    }
    const bool first = b->lost == 0.0f;
    b->lost = fminf(b->lost + lost, 1.0f);
    const float seen_c = lost_at_c(model, k, b->lost);
    const float unsure_k = seen_c - lost_at_c(model, k, b->lost + lost_sd);
    const float sd_k = sqrtf(CROSSING_SD_K * CROSSING_SD_K + unsure_k * unsure_k);
    /* what goes on is the same step; and what goes the other way in two springs may be warmth */
    const bool opened = first && b->gone * b->learnt.change < 0.0f &&
                        spring_open_to_step(e, b, k, seen_c - spring_now_c(model, k), sd_k);
    const float error_k = spring_see(e, b, model, k, seen_c, sd_k, SPRING_PHASE_AUSTENITE);
    spring_note(e, model, k, SPRING_SIGHT_LOST, &before, seen_c, sd_k);
    spring_note_did(e, k, opened ? SPRING_DID_OPEN : 0);
    if (!searched && -error_k > b->disturbance_k) {
        b->disturbance_k = -error_k;
    }
    b->gone_k -= error_k;
    b->gone_w_per_k += b->learnt.loss_w_per_k - was_w_per_k;
}

/* It is where it was believed before, as unsure as it was found wrong. */
void spring_take_back(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k)
{
    const spring_before_t before = spring_before(b, model, k);
    const float more_k = b->gone_k;
    const float less_w_per_k = b->gone_w_per_k;
    spring_set_temperature(model, k, spring_now_c(model, k) + more_k, SPRING_PHASE_AUSTENITE);
    b->last_c7 = thermal_model_temperature_c7(model, k);
    b->seen = true;
    spring_correct_loss(e, b, -less_w_per_k);
    b->variance_k2 += more_k * more_k;
    b->loss_variance += less_w_per_k * less_w_per_k;
    b->covariance -= more_k * less_w_per_k;
    b->gone_k = b->gone_w_per_k = 0.0f;
    b->unproven = false;
    spring_note(e, model, k, SPRING_SIGHT_TAKEN_BACK, &before, 0.0f, 0.0f);
}

bool spring_comes_back(const spring_belief_t *b, float missing)
{
    return missing * b->gone <= BACK_SHARE * b->gone * b->gone;
}

void spring_is_back(spring_belief_t *b)
{
    b->full_ohm = b->gone = b->gone_k = b->gone_w_per_k = 0.0f;
    b->unproven = false;
}

/* Phase that was lost comes back with heat. What has not was a contact, or the sensor; where still
 * more is gone, it has been lost on the way down. */
static void look_back(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k)
{
    const float above_k = spring_now_c(model, k) - start_c(model, k);
    const float full_ohm = b->full_ohm * (1.0f + b->run.line.rise_per_k * above_k);
    const float missing = b->slow_ohm / full_ohm - 1.0f;
    const float per_change = -1.0f / b->learnt.change;
    if (missing * per_change > (fabsf(b->gone) + BACK_LEAST) * fabsf(per_change)) {
        b->gone = missing;
        see_crossing(e, b, model, k, missing * per_change, BACK_LEAST * fabsf(per_change));
        spring_note_read(e, k, missing, BACK_LEAST);
        return;
    }
    if (b->unproven) {
        return; /* a limit ended the heating too soon to tell */
    }
    if (fabsf(b->gone) > BACK_LEAST) {
        if (spring_comes_back(b, missing)) {
            const spring_before_t before = spring_before(b, model, k);
            spring_is_back(b);
            spring_note(e, model, k, SPRING_SIGHT_BACK, &before, 0.0f, 0.0f);
        } else {
            spring_take_back(e, b, model, k);
        }
        spring_note_read(e, k, missing, BACK_LEAST);
    }
    b->full_ohm = b->gone = 0.0f; /* too little to tell: it stays in doubt */
}

/* The current has dropped, the spring is what it was a moment ago: what reads otherwise is the
 * sensor's offset. Returns whether this turn told one. */
static bool learn_offset(spring_belief_t *b)
{
    const float less_a = b->run.line.a - b->current_a;
    const float product_a2 = b->current_a * b->run.line.a;
    if (less_a < APART_PER_A * product_a2 || b->run.line.way_k < -ANCHOR_K) {
        /* as a rule: no division. Over a longer way a coefficient may have made as much */
        return false;
    }
    const float apart_a = product_a2 / less_a;
    const float moved_v = COEFFICIENT_MOST_PER_K * b->run.line.way_k * b->run.line.ohm * apart_a;
    const float noise_v = b->noise * b->ohm * apart_a;
    const float prior_v2 = b->offset_sd_v * b->offset_sd_v;
    const float read_v2 = OFFSET_LEAST_V * OFFSET_LEAST_V + noise_v * noise_v + moved_v * moved_v;
    const float gain = prior_v2 / (prior_v2 + read_v2);
    const float more_v = gain * (b->ohm - b->run.line.ohm) * apart_a;
    if (fabsf(b->learnt.offset_v + more_v) > OFFSET_MOST_V) {
        return false; /* no offset is so large */
    }
    b->learnt.offset_v += more_v;
    b->offset_sd_v = sqrtf(gain * read_v2);
    const float more_ohm = more_v / b->run.line.a;
    b->run.line.ohm -= more_ohm;
    b->learnt.austenite_ohm -= b->learnt.austenite_ohm > 0.0f ? more_ohm : 0.0f;
    b->ohm -= more_v / b->current_a;
    average_anew(b); /* what was read before is off by it */
    b->seen = true;  /* it is acted on in the next turn */
    return true;
}

float spring_offset_may_show(const spring_belief_t *b, float ohm, float from_a, float to_a)
{
    return OFFSET_SDS * b->offset_sd_v * fabsf(from_a - to_a) / (from_a * to_a * ohm);
}

/* By how much, squared, the resistance may have left its line with the phase kept: its temperature
 * moves it, and another current shows another share of the sensor's offset. */
static float may_move_squared(const spring_belief_t *b)
{
    const float moves = SPRING_ESTIMATOR_BOUND_SDS * b->run.line.rise_sd_per_k * b->run.line.slow_k;
    const float offset = spring_offset_may_show(b, b->run.line.ohm, b->run.line.a, b->slow_a);
    return moves * moves + offset * offset;
}

/* It keeps its phase: how what it reads goes with a moving temperature is its slope. */
static void tell_slope(spring_line_t *line, float way_k, float left, float variance)
{
    const float prior = line->rise_sd_per_k * line->rise_sd_per_k;
    const float gain = prior * way_k / (prior * way_k * way_k + variance);
    line->rise_per_k = spring_clamp(line->rise_per_k + gain * left, -COEFFICIENT_MOST_PER_K,
                                    COEFFICIENT_MOST_PER_K);
    line->rise_sd_per_k = sqrtf(prior * (1.0f - gain * way_k));
}

static void begin_slope(spring_belief_t *b)
{
    /* any in print: no phase's coefficient tells the other's */
    b->run.line.rise_per_k = 0.5f * (COEFFICIENT_MOST_PER_K + COEFFICIENT_IN_PRINT_PER_K);
    b->run.line.rise_sd_per_k =
        0.5f * (COEFFICIENT_MOST_PER_K - COEFFICIENT_IN_PRINT_PER_K) / SPRING_ESTIMATOR_BOUND_SDS;
}

/* On the way down, for certain above martensite start: by all of the way so far, as what a sensor's
 * steps leave is the same over a short one. */
static void tell_slope_on_way(spring_belief_t *b, float noise2, float least)
{
    spring_line_t *line = &b->run.line;
    const float way_k = line->from_k + line->slow_k;
    const float offset =
        spring_offset_may_show(b, b->run.line.ohm, b->run.line.a, b->slow_a) * (1.0f / OFFSET_SDS);
    begin_slope(b);
    const float left = b->slow_ohm / line->from_ohm - 1.0f - line->rise_per_k * way_k;
    tell_slope(line, way_k, left, noise2 + 2.0f * least * least + offset * offset);
    b->seen = true; /* it is acted on in the next turn */
}

void spring_begin_hold_line(spring_belief_t *b, bool now)
{
    b->run.line = (spring_line_t){0};
    begin_slope(b);
    if (now) {
        average_anew(b);
        begin_line(b, true, 1.0f);
    }
}

/* And at rest the line follows what it reads. */
static void follow(spring_belief_t *b, float left)
{
    if (fabsf(b->run.line.slow_k) > AWAY_LEAST_K && fabsf(left) < LOSS_LEAST) {
        tell_slope(&b->run.line, b->run.line.slow_k, left, LINE_VARIANCE);
    }
    b->run.line.ohm += b->run.line.ohm * left * LINE_SHARE;
    b->run.line.way_k -= b->run.line.slow_k * LINE_SHARE;
    b->run.line.slow_k -= b->run.line.slow_k * LINE_SHARE;
    b->run.line.variance -= 2.0f * b->run.line.variance * LINE_SHARE;
}

/* Of what the resistance has left its line by, the part that lost phase may explain. */
static float as_lost(const spring_belief_t *b, const thermal_model_t *model, uint8_t k, float left,
                     float distance_k2)
{
    const float less = b->learnt.change < 0.0f ? left : -left;
    if (less > 0.0f) {
        return less;
    }
    /* the other way is an intermediate phase, which comes where it may be cold enough, also after
     * a step of the surroundings that nothing has told; else the last of the austenite comes */
    const float above_k = spring_now_c(model, k) - start_c(model, k);
    const float most_k2 = SPRING_ESTIMATOR_BOUND_SDS * SPRING_ESTIMATOR_BOUND_SDS * distance_k2;
    const float step_k = STEP_OF_RISE * (spring_now_c(model, k) - spring_ambient_c(model));
    return above_k < step_k || above_k * above_k < most_k2 ? -less * (1.0f / OTHER_WAY) : 0.0f;
}

/* For certain above martensite start, where nothing is lost. */
static bool is_above(const spring_belief_t *b, const thermal_model_t *model, uint8_t k,
                     float distance_k2)
{
    const float above_k = spring_now_c(model, k) - start_c(model, k) - b->disturbance_k;
    const float sds = SPRING_ESTIMATOR_BOUND_SDS;
    return above_k > 0.0f && above_k * above_k > sds * sds * distance_k2;
}

/* On its way down to the hold: to martensite start even if a gust takes as much heat again, and a
 * load has moved that. Else what changes is a contact or the sensor. */
static bool may_have_cooled(const spring_belief_t *b, const thermal_model_t *model, uint8_t k,
                            float sd_k)
{
    const float now_c = spring_now_c(model, k);
    const float cooled_k = fmaxf(-b->run.line.way_k, 0.0f);
    const float most_k = cooled_k + SPRING_ESTIMATOR_BOUND_SDS * sd_k + SHIFT_BOUND_K;
    return now_c - most_k < start_c(model, k);
}

/* A coefficient in print explains, give or take tolerance, what it reads by now on its way down. */
static bool slope_explains(const spring_belief_t *b, float tolerance)
{
    const spring_line_t *line = &b->run.line;
    const bool longer = line->from_ohm > 0.0f;
    const float way_k = longer ? line->from_k + line->slow_k : line->slow_k;
    const float moved = b->slow_ohm / (longer ? line->from_ohm : line->ohm) - 1.0f;
    const float most = COEFFICIENT_MOST_PER_K * way_k;
    const float least = COEFFICIENT_IN_PRINT_PER_K * way_k;
    return moved > fminf(most, least) - tolerance && moved < fmaxf(most, least) + tolerance;
}

/* Noise that the average does not take away, as it is slower than a turn. Second differences, 4 s
 * apart: neither a phase nor a temperature that goes steadily shows in them. */
static void take_slow_noise(spring_belief_t *b)
{
    spring_line_t *line = &b->run.line;
    if (b->quiet == 0 || b->averaged < SLOW_TURNS) {
        line->turns = 0;
        line->was_ohm[0] = line->was_ohm[1] = 0.0f;
        return;
    }
    line->turns++;
    if (line->turns % SLOW_TURNS != 0) {
        return;
    }
    if (line->was_ohm[1] > 0.0f) {
        const float bend = fabsf(b->slow_ohm - 2.0f * line->was_ohm[0] + line->was_ohm[1]);
        /* a loss bends it once where it begins; and noise that is less than this is none */
        const float known = fmaxf(b->learnt.slow_noise, LOSS_LEAST / SURE_SDS);
        const float most = fminf(SLOW_NOISE_GROWS * known, SLOW_NOISE_MOST);
        const float seen_ohm = fminf(SLOW_BEND_TO_SD * bend, most * b->slow_ohm);
        const float more_ohm = seen_ohm - b->learnt.slow_noise * b->slow_ohm;
        const float over = more_ohm > 0.0f ? SLOW_NOISE_RISES : SLOW_NOISE_FALLS;
        const float turns = fminf(SLOW_NOISE_BEGINS + (float)line->turns, over);
        b->learnt.slow_noise += SLOW_TURNS * more_ohm / (turns * b->slow_ohm);
    }
    line->was_ohm[1] = line->was_ohm[0];
    line->was_ohm[0] = b->slow_ohm;
}

/* A phase that is kept changes the resistance no faster than temperature does. */
void spring_holding_watch(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                          uint8_t k, float moved_k, float share)
{
    if (b->heating || b->possible != SPRING_PHASE_AUSTENITE) {
        b->quiet = 0;
        return;
    }
    b->quiet = fabsf(moved_k) > QUIET_K ? 0
               : b->quiet < UINT8_MAX   ? (uint8_t)(b->quiet + 1)
                                        : UINT8_MAX;
    take_slow_noise(b);
    spring_line_t *line = &b->run.line;
    line->way_k += moved_k;
    line->slow_k += (line->way_k - line->slow_k) * share;
    if (line->ohm == 0.0f) {
        if (b->quiet == 0) {
            average_anew(b);
        }
        if (b->quiet < QUIET_TURNS) {
            b->losing = 0;
            return;
        }
        begin_line(b, false, share);
        if (b->full_ohm > 0.0f) {
            look_back(e, b, model, k);
        }
    } else if (b->quiet == 0 && b->offset_sd_v > OFFSET_LEAST_V && learn_offset(b)) {
        return;
    }
    if (b->quiet < (b->rough ? QUIET_TURNS : 1) && b->current_a < WEAK_A) {
        /* on its way to the hold: too weak to tell */
        b->slow_ohm = line->ohm * (1.0f + line->rise_per_k * line->way_k);
        b->slow_a = line->a;
        line->slow_k = line->way_k;
        b->averaged = 0;
        b->losing = 0;
        return;
    }
    const float kept_ohm = line->ohm * (1.0f + line->rise_per_k * line->slow_k);
    const float left = b->slow_ohm / kept_ohm - 1.0f;
    const float distance_k2 = spring_distance_k2(b);
    const float changed = as_lost(b, model, k, left, distance_k2);
    /* as its temperature may have moved unseen, so may the resistance */
    const float rise = line->rise_per_k;
    const float least = b->slow_a < LEAST_AT_A ? LOSS_LEAST * LEAST_AT_A / b->slow_a : LOSS_LEAST;
    const float least2 = fmaxf(least * least, rise * rise * distance_k2);
    const float noise2 = slow_variance(b, share) + line->variance;
    const float changed2 = changed * changed;
    float sure2 = fmaxf(least2, SURE_SDS * SURE_SDS * noise2);
    float suspected2 = SUSPECTED * SUSPECTED * sure2;
    if (changed2 >= suspected2) { /* as a rule not: a division is saved */
        const float moves2 = may_move_squared(b);
        sure2 += moves2;
        suspected2 += moves2;
    }
    if (changed2 < suspected2) {
        b->losing = 0;
        const bool away = fabsf(line->slow_k) > ANCHOR_K;
        if (b->rough && (b->averaged == ANCHOR_TURNS || (b->averaged > ANCHOR_TURNS && away))) {
            if (!away || line->from_ohm == 0.0f) {
                line->from_ohm = b->slow_ohm;
                line->from_k = -line->slow_k;
            } else if (is_above(b, model, k, distance_k2)) {
                tell_slope_on_way(b, noise2, least);
            }
            begin_line(b, true, share); /* a coefficient explains only the way since */
        }
        if (b->quiet >= QUIET_TURNS) {
            if (b->rough) { /* it has come to rest */
                begin_line(b, false, share);
                if (b->full_ohm > 0.0f && b->lost == 0.0f) {
                    look_back(e, b, model, k);
                    return;
                }
            }
            follow(b, left);
            spring_keep_above(e, b, model, k, lost_at_c(model, k, b->lost) - STILL_K);
        }
        return;
    }
    b->losing = b->losing < UINT8_MAX ? (uint8_t)(b->losing + 1) : UINT8_MAX;
    const bool sure = changed2 > sure2 && b->averaged >= ANCHOR_TURNS;
    if ((sure && b->losing >= CONFIRM_TURNS) || b->losing >= LASTING_TURNS) {
        if (b->rough && !may_have_cooled(b, model, k, sqrtf(distance_k2))) {
            begin_line(b, true, share);
            return;
        }
        if (b->rough && is_above(b, model, k, distance_k2) &&
            slope_explains(b, sqrtf(fmaxf(least2, SURE_SDS * SURE_SDS * noise2)))) {
            if (line->from_ohm > 0.0f) {
                tell_slope_on_way(b, noise2, least);
            }
            begin_line(b, true, share);
            return;
        }
        /* until it is back, or was found not to have been phase, all of it is one loss */
        b->full_ohm = b->full_ohm > 0.0f ? b->full_ohm : kept_ohm;
        b->gone += left;
        const float per_change = 1.0f / fabsf(b->learnt.change);
        const float sd = sqrtf(may_move_squared(b)) / SPRING_ESTIMATOR_BOUND_SDS;
        see_crossing(e, b, model, k, changed * per_change, sd * per_change);
        spring_note_read(e, k, left, sqrtf(noise2 + sd * sd));
        begin_line(b, true, share); /* the average still falls */
    }
}

float spring_estimator_hottest_c(const spring_belief_t *b, const thermal_model_t *model, uint8_t k)
{
    return spring_now_c(model, k) + b->gone_k;
}
