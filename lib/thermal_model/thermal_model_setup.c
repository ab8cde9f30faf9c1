#include "thermal_model_internal.h"

#include <stddef.h>
#include <string.h>

#include "fixed_point.h"

#define STEP_GAIN_UJ_PER_MS 281474976711u /* 2^48 / 1e3: thermal_model_spring_t.step_gain */
#define NODE_GAIN_UJ_PER_MS 35184372089u  /* 2^45 / 1e3: thermal_model_slow_node_t.gain */
#define CAPACITY_UJ_PER_MS  132u          /* least: STEP_GAIN_UJ_PER_MS over this fits 31 bits */
#define WIDTH_MIN_CC        200
#define WIDTH_MAX_CC        10000
#define LOWEST_CC           (-3000)
#define HIGHEST_CC          20000

/* Of the plate, to all springs and to ambient: of 64 springs below 2^32 / 1000 uW/K. */
static uint32_t plate_conductance(const thermal_model_parameters_t *p)
{
    return (uint32_t)p->plate_coupling_uw_per_k * (spring_index_t)(p->rows * p->columns) +
           p->plate_loss_uw_per_k;
}

uint32_t thermal_model_spring_capacity(const thermal_model_parameters_t *p, spring_index_t i)
{
    return (uint32_t)p->heat_capacity_mj_per_k * p->heat_capacity_scale_permille[i];
}

static thermal_model_refusal_t check_array(const thermal_model_parameters_t *p)
{
    uint16_t outside;
    if (!parameter_check(PARAMETER_PART_MODEL, p, &outside)) {
        return REFUSED(RANGE, outside);
    }
    if (p->step_ms < 1u || p->step_ms > 1000u) {
        return REFUSED(RANGE, PARAMETER_COUNT);
    }
    if ((uint16_t)p->rows * p->columns > THERMAL_MODEL_MAX_SPRINGS) {
        REFUSE(RANGE, columns);
    }
    for (spring_index_t i = 0; i < (spring_index_t)(p->rows * p->columns); i++) {
        const uint32_t capacity = thermal_model_spring_capacity(p, i);
        if (capacity < 1000u || capacity < (uint32_t)p->step_ms * CAPACITY_UJ_PER_MS) {
            REFUSE(RANGE, heat_capacity_j_per_k);
        }
    }
    return 0;
}

static bool is_width(int16_t from_cc, int16_t to_cc)
{
    const int16_t width_cc = (int16_t)(to_cc - from_cc);
    return width_cc >= WIDTH_MIN_CC && width_cc <= WIDTH_MAX_CC;
}

static thermal_model_refusal_t check_phase(const thermal_model_parameters_t *p)
{
    const int16_t finish_m = p->martensite_finish_cc;
    const int16_t start_m = p->martensite_start_cc;
    const int16_t start_a = p->austenite_start_cc;
    const int16_t finish_a = p->austenite_finish_cc;
    if (start_m <= finish_m) {
        REFUSE(ORDER, martensite_start_c);
    }
    if (!is_width(finish_m, start_m)) {
        REFUSE(RANGE, martensite_start_c);
    }
    if (start_a < start_m) {
        REFUSE(ORDER, austenite_start_c);
    }
    if (finish_a <= start_a) {
        REFUSE(ORDER, austenite_finish_c);
    }
    if (!is_width(start_a, finish_a)) {
        REFUSE(RANGE, austenite_finish_c);
    }
    const uint32_t latent_cc = p->latent_heat_mj * (uint32_t)100 / p->heat_capacity_mj_per_k;
    if (latent_cc > LATENT_MAX_K * 100u) {
        REFUSE(RANGE, latent_heat_j);
    }
    const int16_t least_width_cc = (int16_t)(((int16_t)latent_cc + 19) / 20);
    if (least_width_cc > start_m - finish_m || least_width_cc > finish_a - start_a ||
        (int16_t)latent_cc > HIGHEST_CC - finish_a) {
        REFUSE(RANGE, latent_heat_j);
    }
    for (spring_index_t i = 0; i < (spring_index_t)(p->rows * p->columns); i++) {
        const int16_t shift_cc = p->transformation_shift_cc[i];
        if (finish_m + shift_cc < LOWEST_CC ||
            finish_a + shift_cc > HIGHEST_CC - (int16_t)latent_cc) {
            REFUSE(RANGE, transformation_shift_k);
        }
    }
    return 0;
}

static thermal_model_refusal_t check_plate(const thermal_model_parameters_t *p)
{
    if (p->plate_coupling_uw_per_k == 0) {
        return 0;
    }
    if (p->plate_heat_capacity_mj_per_k == 0) {
        REFUSE(RANGE, plate_heat_capacity_j_per_k);
    }
    const uint32_t total = plate_conductance(p);
    if (THERMAL_MODEL_MAX_SPRINGS > 64 && total > UINT32_MAX / 1000u) {
        REFUSE(OVERFLOW, plate_coupling_w_per_k);
    }
    if ((total * p->step_ms + 499999u) / 500000u > p->plate_heat_capacity_mj_per_k) {
        REFUSE(UNSTABLE, plate_heat_capacity_j_per_k);
    }
    return 0;
}

static thermal_model_refusal_t check(const thermal_model_parameters_t *p)
{
    thermal_model_refusal_t refusal = check_array(p);
    if (refusal == 0) {
        refusal = check_phase(p);
    }
    for (spring_index_t i = 0; refusal == 0 && i < (spring_index_t)(p->rows * p->columns); i++) {
        refusal = thermal_model_check_flows(p, i);
    }
    return refusal != 0 ? refusal : check_plate(p);
}

/* Where a step is long against the node's own time, its own flow is taken implicitly, so that any
 * step is stable. */
static void derive_node(thermal_model_slow_node_t *node, uint32_t capacity_mj_per_k,
                        uint32_t conductance_uw_per_k, uint32_t loss_uw_per_k, uint16_t step_ms)
{
    const uint32_t exchanged_uj_per_k =
        fixed_point_multiply_divide(conductance_uw_per_k, step_ms, 1000u);
    uint32_t capacity_uj_per_k = capacity_mj_per_k * 1000u;
    node->loss_uw_per_k = loss_uw_per_k;
    node->quick = exchanged_uj_per_k > capacity_uj_per_k / 4u;
    if (node->quick) {
        capacity_uj_per_k += exchanged_uj_per_k;
    }
    if (capacity_uj_per_k == 0) {
        capacity_uj_per_k = 1; /* a node without flows: nothing moves it */
    }
    node->gain =
        (int64_t)((NODE_GAIN_UJ_PER_MS * step_ms + capacity_uj_per_k / 2u) / capacity_uj_per_k);
}

static uint16_t position_factor(int16_t width_c7)
{
    return (uint16_t)((0x200000u + (uint16_t)width_c7 / 2u) / (uint16_t)width_c7);
}

static void derive_spring(thermal_model_t *model, spring_index_t i)
{
    const thermal_model_parameters_t *p = &model->parameters;
    thermal_model_spring_t *spring = &model->spring[i];
    const uint32_t capacity_uj_per_k = thermal_model_spring_capacity(p, i);
    spring->step_gain =
        (int32_t)((STEP_GAIN_UJ_PER_MS * p->step_ms + capacity_uj_per_k / 2u) / capacity_uj_per_k);
    spring->transformation_shift_c7 = fixed_point_c7_from_cc(p->transformation_shift_cc[i]);
    const uint32_t contact_q16 = fixed_point_multiply_divide(p->contact_uohm[i], 65536u, 1000000u);
    spring->contact_q16 = contact_q16 > UINT16_MAX ? UINT16_MAX : (uint16_t)contact_q16;
}

static void derive(thermal_model_t *model)
{
    const thermal_model_parameters_t *p = &model->parameters;
    model->springs = (spring_index_t)(p->rows * p->columns);
    model->latent_full_c8 =
        (uint16_t)fixed_point_multiply_divide(p->latent_heat_mj, 256u, p->heat_capacity_mj_per_k);
    const int16_t highest_c7 = (int16_t)(SPAN_K * 128 - model->latent_full_c8 / 2u);
    model->highest_c7 =
        highest_c7 < THERMAL_MODEL_HIGHEST_C7 ? highest_c7 : (int16_t)THERMAL_MODEL_HIGHEST_C7;
    thermal_model_transformation_t *points = &model->transformation;
    points->martensite_finish_c7 = fixed_point_c7_from_cc(p->martensite_finish_cc);
    points->martensite_start_c7 = fixed_point_c7_from_cc(p->martensite_start_cc);
    points->austenite_start_c7 = fixed_point_c7_from_cc(p->austenite_start_cc);
    points->austenite_finish_c7 = fixed_point_c7_from_cc(p->austenite_finish_cc);
    model->heating_position =
        position_factor((int16_t)(points->austenite_finish_c7 - points->austenite_start_c7));
    model->cooling_position =
        position_factor((int16_t)(points->martensite_start_c7 - points->martensite_finish_c7));

    for (spring_index_t i = 0; i < model->springs; i++) {
        derive_spring(model, i);
    }
    derive_node(&model->air, p->air_heat_capacity_mj_per_k,
                thermal_model_derive_flows(model) + p->air_exchange_uw_per_k,
                p->air_exchange_uw_per_k, p->step_ms);
    derive_node(&model->plate, p->plate_heat_capacity_mj_per_k, plate_conductance(p),
                p->plate_loss_uw_per_k, p->step_ms);
    thermal_model_apply_fan(model);
}

static thermal_model_status_t judged(const thermal_model_parameters_t *parameters, uint16_t *bad)
{
    const thermal_model_refusal_t refusal = check(parameters);
    if (refusal != 0 && bad != NULL) {
        *bad = refusal >> 8;
    }
    return (thermal_model_status_t)(-(int)(refusal & 0xFFu));
}

thermal_model_status_t thermal_model_init(thermal_model_t *model,
                                          const thermal_model_parameters_t *parameters,
                                          uint16_t *bad)
{
    const thermal_model_status_t status = judged(parameters, bad);
    if (status != THERMAL_MODEL_OK) {
        return status;
    }
    const thermal_model_parameters_t taken = *parameters; /* may be the model's own */
    memset(model, 0, sizeof *model);
    model->parameters = taken;
    derive(model);
    model->ambient_c7 = 20 * 128;
    thermal_model_reset(model, 20 * 128);
    return THERMAL_MODEL_OK;
}

thermal_model_status_t thermal_model_declare(thermal_model_t *model,
                                             const thermal_model_parameters_t *parameters,
                                             uint16_t *bad)
{
    const thermal_model_status_t status = judged(parameters, bad);
    if (status != THERMAL_MODEL_OK) {
        return status;
    }
    uint16_t austenite[THERMAL_MODEL_MAX_SPRINGS];
    for (spring_index_t i = 0; i < model->springs; i++) {
        austenite[i] = thermal_model_austenite(model, i);
    }
    model->parameters = *parameters;
    derive(model);
    thermal_model_fit_state(model, austenite);
    return THERMAL_MODEL_OK;
}
