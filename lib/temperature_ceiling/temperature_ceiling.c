#include "temperature_ceiling.h"

#include "sum16.h"

/* The rise that trips the model is this share of the one that trips the ceiling: as hot as declared
 * numbers make an array whose heat capacity, losses, couplings and transformation are off by as
 * much as bench/worlds draws them, the ceiling stays a tenth below. */
#define RISE_SHARE_NUMERATOR   9
#define RISE_SHARE_DENOMINATOR 10
/* Of the power that duty and supply give: with a supply a fifth lower than declared it is no less.
 * At 4.2 V for 5 with 0.04 ohm more in the wiring it is a tenth less than this. */
#define POWER_SHARE 0.64f

#define GIVEN_W 0.01f /* more than a sensor's offset makes of nothing */

#define WHOLE_SHARE TEMPERATURE_CEILING_WHOLE_SHARE
#define ODD_SHARE   43690u     /* two thirds: a fifth less of one, and a fifth more of the other */
#define ODD_C7      (20 * 128) /* of air, in a hold: a fifth of the losses is 13 K of it */
/* Between these the declared loss is compared. */
#define COOL_C 20
#define HOT_C  120

#define HIGHEST_C7 (215 * 128)
#define HIGHEST_C  215.0f
#define LOWEST_C   (-40.0f)

static float from_c7(int16_t c7)
{
    return (float)c7 * (1.0f / 128.0f);
}

static float clamp(float value, float low, float high)
{
    return value < low ? low : value > high ? high : value;
}

/* Q9.23, as the model keeps its own: the upper half is the temperature in Q9.7. */
static int16_t c7_of(int32_t temperature_c23)
{
    return (int16_t)(temperature_c23 >> 16);
}

static uint16_t checksum(const temperature_ceiling_t *c, uint8_t k)
{
    uint16_t sum = SUM16_START;
    sum = sum16_add_bytes(sum, &c->temperature_c23[k], sizeof c->temperature_c23[k]);
    sum = sum16_add_bytes(sum, &c->austenite[k], sizeof c->austenite[k]);
    const uint16_t shares[] = {c->loss_share[k], c->capacity_share[k]};
    sum = sum16_add_bytes(sum, shares, sizeof shares);
    return sum16_add_bytes(sum, &c->rest_turns[k], sizeof c->rest_turns[k]);
}

static void seal(temperature_ceiling_t *c, uint8_t k)
{
    c->seal[k] = checksum(c, k);
}

static void set_ambient(temperature_ceiling_t *c, int16_t ambient_c7)
{
    c->ambient_c7 = ambient_c7;
    c->not_ambient_c7 = (int16_t)~ambient_c7;
}

static void count_broken(temperature_ceiling_t *c)
{
    if (c->broken_seals < UINT8_MAX) {
        c->broken_seals++;
    }
}

/* To be called before what is kept of a spring is used for what is kept next. */
static void open_spring(temperature_ceiling_t *c, const thermal_model_t *model, uint8_t k)
{
    if (c->not_ambient_c7 != (int16_t)~c->ambient_c7) {
        set_ambient(c, thermal_model_ambient_c7(model));
        count_broken(c);
    }
    if (c->seal[k] != checksum(c, k)) {
        c->temperature_c23[k] = (int32_t)TEMPERATURE_CEILING_BROKEN_C * 8388608;
        c->austenite[k] = THERMAL_MODEL_AUSTENITE_FULL;
        c->loss_share[k] = c->capacity_share[k] = WHOLE_SHARE;
        c->rest_turns[k] = 0;
        c->delivered = true;
        count_broken(c);
    }
}

void temperature_ceiling_begin(temperature_ceiling_t *ceiling, int16_t ambient_c7)
{
    for (uint8_t k = 0; k < THERMAL_MODEL_MAX_SPRINGS; k++) {
        ceiling->temperature_c23[k] = (int32_t)ambient_c7 * 65536;
        ceiling->austenite[k] = 0;
        ceiling->loss_share[k] = ceiling->capacity_share[k] = WHOLE_SHARE;
        ceiling->rest_turns[k] = TEMPERATURE_CEILING_NEVER;
        seal(ceiling, k);
    }
    set_ambient(ceiling, ambient_c7);
    ceiling->delivered = false;
    ceiling->doubtful = false;
    ceiling->broken_seals = 0;
}

static bool is_above_ambient(const temperature_ceiling_t *ceiling, uint8_t k)
{
    return temperature_ceiling_c(ceiling, k) >
           from_c7(ceiling->ambient_c7) + TEMPERATURE_CEILING_WARM_K;
}

bool temperature_ceiling_is_warm(const temperature_ceiling_t *ceiling, uint8_t k)
{
    return ceiling->delivered && is_above_ambient(ceiling, k);
}

void temperature_ceiling_raise(temperature_ceiling_t *ceiling, const thermal_model_t *model)
{
    for (uint8_t k = 0; k < model->springs; k++) {
        open_spring(ceiling, model, k);
        if (!ceiling->delivered) { /* then warmer air that was told just now is no heat */
            set_ambient(ceiling, thermal_model_ambient_c7(model));
        }
        const int32_t model_c23 = (int32_t)thermal_model_temperature_c7(model, k) * 65536;
        if (model_c23 > ceiling->temperature_c23[k]) {
            ceiling->temperature_c23[k] = model_c23;
            ceiling->austenite[k] = thermal_model_austenite(model, k);
            ceiling->delivered = ceiling->delivered || is_above_ambient(ceiling, k);
        }
        seal(ceiling, k);
    }
}

uint16_t temperature_ceiling_rest_s(const temperature_ceiling_t *ceiling, uint8_t k)
{
    const uint16_t turns = ceiling->rest_turns[k];
    return turns == TEMPERATURE_CEILING_NEVER
               ? TEMPERATURE_CEILING_NEVER
               : (uint16_t)(TEMPERATURE_CEILING_TURN_S * (float)turns);
}

void temperature_ceiling_give(temperature_ceiling_t *ceiling, const thermal_model_t *model,
                              uint8_t k)
{
    open_spring(ceiling, model, k);
    ceiling->rest_turns[k] = 0;
    ceiling->delivered = true;
    seal(ceiling, k);
}

/* Nobody calls it cold while it is given power, however little it has got by now; nor, once it was
 * given any, while another size of the array has it not: its time stands still. */
static bool is_cold(const temperature_ceiling_t *ceiling, const thermal_model_t *model, uint8_t k)
{
    return k < model->springs
               ? ceiling->rest_turns[k] != 0 && !temperature_ceiling_is_warm(ceiling, k)
               : ceiling->rest_turns[k] == TEMPERATURE_CEILING_NEVER;
}

/* Given, or until the springs are cold again. */
static void account(temperature_ceiling_t *ceiling, const thermal_model_t *model, uint8_t k,
                    float power_w)
{
    const int16_t ambient_c7 = thermal_model_ambient_c7(model);
    if (k == 0) {
        bool cold = true;
        for (uint8_t j = 0; j < THERMAL_MODEL_MAX_SPRINGS && cold; j++) {
            cold = is_cold(ceiling, model, j);
        }
        if (cold) {
            ceiling->delivered = false;
            for (uint8_t j = 0; j < model->springs; j++) {
                open_spring(ceiling, model, j);
                ceiling->loss_share[j] = ceiling->capacity_share[j] = WHOLE_SHARE;
                seal(ceiling, j);
            }
        }
        if (cold || ambient_c7 > ceiling->ambient_c7) {
            set_ambient(ceiling, ambient_c7);
        }
    }
    if (power_w > GIVEN_W) {
        ceiling->rest_turns[k] = 0;
        ceiling->delivered = true;
    } else if (ceiling->rest_turns[k] < TEMPERATURE_CEILING_NEVER) {
        ceiling->rest_turns[k]++;
    }
}

static float capacity_j_per_k(const thermal_model_t *model, uint8_t k)
{
    const thermal_model_parameters_t *p = &model->parameters;
    return 1e-6f *
           (float)((uint32_t)p->heat_capacity_scale_permille[k] * p->heat_capacity_mj_per_k);
}

/* What joins it with its neighbours. */
static uint32_t couplings_uw_per_k(const thermal_model_t *model, uint8_t k)
{
    uint32_t sum_uw_per_k = 0;
    for (uint8_t j = 0; j < model->springs; j++) {
        sum_uw_per_k += thermal_model_coupling_uw_per_k(model, k, j);
    }
    return sum_uw_per_k;
}

static temperature_ceiling_fan_t with_fan(const thermal_model_t *model, uint8_t k,
                                          uint16_t loss_uw_per_k, uint16_t orthogonal_uw_per_k,
                                          uint16_t diagonal_uw_per_k)
{
    const thermal_model_neighbours_t neighbours = thermal_model_neighbours(&model->parameters, k);
    return (temperature_ceiling_fan_t){.loss_uw_per_k = loss_uw_per_k,
                                       /* conductances fit 16 bits, or the model has refused them */
                                       .neighbours_uw_per_k =
                                           (uint16_t)(neighbours.orthogonals * orthogonal_uw_per_k +
                                                      neighbours.diagonals * diagonal_uw_per_k)};
}

temperature_ceiling_declared_t temperature_ceiling_declared(const thermal_model_t *model, uint8_t k)
{
    /* the difference: what flows at one temperature is its neighbours', too */
    const int32_t more_uw = thermal_model_power_to_hold_uw(model, k, HOT_C * 128) -
                            thermal_model_power_to_hold_uw(model, k, COOL_C * 128);
    const thermal_model_parameters_t *const p = &model->parameters;
    const float plate_w_per_k = 1e-6f * (float)p->plate_coupling_uw_per_k;
    const float neighbours_w_per_k = 1e-6f * (float)couplings_uw_per_k(model, k);
    const float loss_w_per_k =
        1e-6f / (float)(HOT_C - COOL_C) * (float)more_uw - plate_w_per_k - neighbours_w_per_k;
    const float capacity = capacity_j_per_k(model, k);
    return (temperature_ceiling_declared_t){
        .now = {.own_w_per_k = loss_w_per_k,
                .with_plate_w_per_k = loss_w_per_k + plate_w_per_k,
                .with_neighbours_w_per_k = loss_w_per_k + neighbours_w_per_k},
        .capacity_j_per_k = capacity,
        .heat_j = capacity *
                  (TEMPERATURE_CEILING_HEATED_K + (float)model->latent_full_c8 * (1.0f / 256.0f)),
        .still = with_fan(model, k, model->spring[k].loss_natural_uw_per_k, p->orthogonal_uw_per_k,
                          p->diagonal_uw_per_k),
        .blown = with_fan(model, k, model->spring[k].loss_fan_uw_per_k, p->orthogonal_fan_uw_per_k,
                          p->diagonal_fan_uw_per_k),
        .half_share = 1e-3f * (float)p->fan_half_share_permille};
}

static float of_share(float value, uint16_t share)
{
    return 1.0f / (float)WHOLE_SHARE * (float)share * value;
}

/* Of several changes that one share has to do for, the larger one: a single number that is declared
 * moves all of them the same way, and taken back it takes back as much. */
static float larger(float one, float other)
{
    const bool same_way = (one < 1.0f) == (other < 1.0f);
    const bool one_is_larger = one < 1.0f ? (same_way ? one < other : one * other < 1.0f)
                                          : (same_way ? one > other : one * other > 1.0f);
    return one_is_larger ? one : other;
}

/* What was declared before is so many times what is now. */
static float change(float before, float now)
{
    return clamp(now > 0.0f ? before / now : (float)WHOLE_SHARE, 1.0f / (float)WHOLE_SHARE,
                 (float)WHOLE_SHARE);
}

/* As much as before, or all of what is declared now; rounded to the careful side: declarations that
 * raise it by less than a share's step would raise what it goes by. */
static uint16_t share_of(uint16_t share, float kept)
{
    return (uint16_t)clamp((float)share * kept, 1.0f, (float)WHOLE_SHARE);
}

/* At a fan between still and blown. */
static temperature_ceiling_losses_t losses_at(const temperature_ceiling_declared_t *d, float fan)
{
    const float loss_w_per_k = 1e-6f * ((1.0f - fan) * (float)d->still.loss_uw_per_k +
                                        fan * (float)d->blown.loss_uw_per_k);
    return (temperature_ceiling_losses_t){
        .own_w_per_k = loss_w_per_k,
        .with_plate_w_per_k = loss_w_per_k + (d->now.with_plate_w_per_k - d->now.own_w_per_k),
        .with_neighbours_w_per_k =
            loss_w_per_k + 1e-6f * ((1.0f - fan) * (float)d->still.neighbours_uw_per_k +
                                    fan * (float)d->blown.neighbours_uw_per_k)};
}

static float change_at(temperature_ceiling_losses_t before, temperature_ceiling_losses_t now)
{
    const float loss = change(before.own_w_per_k, now.own_w_per_k);
    const float plate = change(before.with_plate_w_per_k, now.with_plate_w_per_k);
    const float neighbours = change(before.with_neighbours_w_per_k, now.with_neighbours_w_per_k);
    return larger(larger(loss, plate), neighbours);
}

static bool is_alike(temperature_ceiling_losses_t a, temperature_ceiling_losses_t b)
{
    return a.own_w_per_k == b.own_w_per_k && a.with_plate_w_per_k == b.with_plate_w_per_k &&
           a.with_neighbours_w_per_k == b.with_neighbours_w_per_k;
}

/* At the present fan and at those that may be told next, off, full, and half where what that does
 * is another share of both: at a fan between, losses change by no more than at one of these. Each
 * takes divisions, and no tick runs meanwhile: what is as it was takes none. */
static float loss_change(const temperature_ceiling_declared_t *before,
                         const temperature_ceiling_declared_t *now, uint8_t fan_percent)
{
    const bool other_half = before->half_share != now->half_share;
    float most = change_at(before->now, now->now);
    for (uint8_t percent = 0; percent <= 100; percent = (uint8_t)(percent + 50)) {
        if (percent == fan_percent || (percent == 50 && !other_half)) {
            continue;
        }
        const float fan = 0.01f * (float)percent;
        const temperature_ceiling_losses_t was =
            losses_at(before, percent == 50 ? before->half_share : fan);
        const temperature_ceiling_losses_t is =
            losses_at(now, percent == 50 ? now->half_share : fan);
        if (!is_alike(was, is)) {
            most = larger(most, change_at(was, is));
        }
    }
    return most;
}

void temperature_ceiling_declare(temperature_ceiling_t *ceiling, const thermal_model_t *model,
                                 uint8_t k, const temperature_ceiling_declared_t *before)
{
    open_spring(ceiling, model, k);
    if (ceiling->delivered) {
        const temperature_ceiling_declared_t now = temperature_ceiling_declared(model, k);
        const float capacity = change(before->capacity_j_per_k, now.capacity_j_per_k);
        const float heat = change(before->heat_j, now.heat_j);
        ceiling->loss_share[k] =
            share_of(ceiling->loss_share[k], loss_change(before, &now, model->fan_percent));
        ceiling->capacity_share[k] = share_of(ceiling->capacity_share[k], larger(capacity, heat));
    }
    seal(ceiling, k);
}

bool temperature_ceiling_contradicts(const temperature_ceiling_t *ceiling,
                                     const thermal_model_t *model, uint8_t k)
{
    return ceiling->loss_share[k] < ODD_SHARE || ceiling->capacity_share[k] < ODD_SHARE ||
           thermal_model_ambient_c7(model) < ceiling->ambient_c7 - ODD_C7;
}

/* What is declared that it gives off, beside the model's neighbours, W. */
static float given_off_w(const temperature_ceiling_t *ceiling, const thermal_model_t *model,
                         uint8_t k)
{
    /* as in the warmest air that was told: not colder by what was said since */
    const int16_t dropped_c7 = (int16_t)(ceiling->ambient_c7 - thermal_model_ambient_c7(model));
    const int16_t at_c7 =
        (int16_t)(c7_of(ceiling->temperature_c23[k]) - (dropped_c7 > 0 ? dropped_c7 : 0));
    return 1e-6f * (float)thermal_model_power_to_hold_uw(model, k, at_c7);
}

float temperature_ceiling_c(const temperature_ceiling_t *ceiling, uint8_t k)
{
    return (float)ceiling->temperature_c23[k] * (1.0f / 8388608.0f);
}

/* Along the line from none at low to all at high, with the heat that there is. */
static uint16_t phase_on(int16_t low_c7, int16_t high_c7, float heat_c, float latent_k)
{
    const float beyond_k = heat_c - from_c7(low_c7);
    if (beyond_k <= 0.0f) { /* as a rule: no division */
        return 0;
    }
    const float width_k = from_c7((int16_t)(high_c7 - low_c7)) + latent_k;
    return beyond_k < width_k
               ? (uint16_t)((float)THERMAL_MODEL_AUSTENITE_FULL * (beyond_k / width_k))
               : THERMAL_MODEL_AUSTENITE_FULL;
}

static void add_heat(temperature_ceiling_t *ceiling, const thermal_model_t *model, uint8_t k,
                     float gain_k)
{
    const uint16_t share = ceiling->capacity_share[k];
    float whole_k = (float)model->latent_full_c8 * (1.0f / 256.0f);
    /* Where less heat capacity counts than is declared, it takes up as much less latent heat, for a
     * scale is of both; and gives back the same heat, for the other number is not. */
    if (share != WHOLE_SHARE && gain_k < 0.0f) {
        whole_k = whole_k * (float)WHOLE_SHARE / (float)share;
    }
    const float per_q15 = whole_k * (1.0f / (float)THERMAL_MODEL_AUSTENITE_FULL);
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    const uint16_t before = ceiling->austenite[k];
    const float heat_c = temperature_ceiling_c(ceiling, k) + gain_k + per_q15 * (float)before;
    uint16_t after = phase_on(t.austenite_start_c7, t.austenite_finish_c7, heat_c, whole_k);
    if (after <= before && before > 0) {
        const uint16_t cooled =
            phase_on(t.martensite_finish_c7, t.martensite_start_c7, heat_c, whole_k);
        after = cooled < before ? cooled : before;
    }
    ceiling->austenite[k] = after;
    ceiling->temperature_c23[k] =
        (int32_t)(clamp(heat_c - per_q15 * (float)after, LOWEST_C, HIGHEST_C) * 8388608.0f);
}

void temperature_ceiling_step(temperature_ceiling_t *ceiling, const thermal_model_t *model,
                              uint8_t k, float power_w)
{
    const thermal_model_parameters_t *p = &model->parameters;
    open_spring(ceiling, model, k);
    account(ceiling, model, k, power_w);
    /* What the model's neighbours take beyond those of the ceiling, uW / 128: a spring's couplings
     * and the span of temperatures keep it within 32 bits. */
    int32_t colder = 0;
    uint32_t stiffness_uw_per_k =
        (uint32_t)model->spring[k].loss_uw_per_k + p->plate_coupling_uw_per_k;
    for (uint8_t j = 0; j < model->springs; j++) {
        const uint16_t coupling_uw_per_k = thermal_model_coupling_uw_per_k(model, k, j);
        if (coupling_uw_per_k != 0) {
            stiffness_uw_per_k += coupling_uw_per_k;
            colder +=
                (int32_t)coupling_uw_per_k * (c7_of(ceiling->temperature_c23[j]) -
                                              (int32_t)thermal_model_temperature_c7(model, j));
        }
    }
    const float leaves_w = given_off_w(ceiling, model, k) - 1e-6f * (float)(colder / 128);
    const uint16_t share = leaves_w > 0.0f ? ceiling->loss_share[k] : WHOLE_SHARE;
    /* stable whatever the heat capacity: the flow's own change is taken at the end of the step */
    const float gain_k =
        (power_w - of_share(leaves_w, share)) * TEMPERATURE_CEILING_TURN_S /
        (of_share(capacity_j_per_k(model, k), ceiling->capacity_share[k]) +
         1e-6f * TEMPERATURE_CEILING_TURN_S * of_share((float)stiffness_uw_per_k, share));
    add_heat(ceiling, model, k, gain_k);
    seal(ceiling, k);
}

bool temperature_ceiling_trips(const temperature_ceiling_t *ceiling, uint8_t k, int16_t trip_cc)
{
    const int16_t c7 = c7_of(ceiling->temperature_c23[k]);
    const int32_t ambient = 100 * (int32_t)ceiling->ambient_c7; /* degC / 12800 */
    return c7 >= HIGHEST_C7 - 128 ||
           (100 * (int32_t)c7 - ambient) * RISE_SHARE_NUMERATOR >
               (128 * (int32_t)trip_cc - ambient) * RISE_SHARE_DENOMINATOR;
}

void temperature_ceiling_prepare(temperature_ceiling_drive_t *drive, const thermal_model_t *model,
                                 const current_control_parameters_t *circuit)
{
    const float ohm = 1e-6f * (float)model->parameters.resistance_austenite_uohm;
    const float fixed_ohm = 1e-3f * (float)((int32_t)circuit->shunt_mohm + circuit->wiring_mohm);
    drive->drop_v = 1e-3f * (float)circuit->freewheel_mv;
    drive->v_per_step =
        1e-3f / 800.0f * (float)((int32_t)circuit->supply_mv + circuit->freewheel_mv);
    drive->w_per_v2 = POWER_SHARE * ohm / ((ohm + fixed_ohm) * (ohm + fixed_ohm));
}

float temperature_ceiling_power_w(const temperature_ceiling_drive_t *drive, float duty,
                                  float more_drop_v)
{
    const float behind_v =
        drive->v_per_step * duty - drive->drop_v - more_drop_v * (1.0f - duty * (1.0f / 800.0f));
    return behind_v > 0.0f ? drive->w_per_v2 * behind_v * behind_v : 0.0f;
}
