/* The tick as a whole: order, commands, faults, the shared supply, missing readings, settings that
 * change while running. The array outside is a resistor per spring and a perfect sensor; physics is
 * in test/host_loop. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "../fakes/belief_inside.h"
#include "../run_tests.h"
#include "controller.h"
#include "fixed_point.h"

#define AMBIENT_C7 (20 * 128)

static controller_t controller;
static controller_settings_t settings;
static controller_inputs_t inputs;
static controller_outputs_t outputs;
static int32_t spring_mohm[CONTROLLER_MAX_SPRINGS];

static int32_t supply_mv;

static void start(void)
{
    memset(&controller, 0xA5, sizeof controller); /* what was in memory must not matter */
    TEST_ASSERT_TRUE(controller_init(&controller, &settings, AMBIENT_C7, NULL));
    memset(&inputs, 0, sizeof inputs);
    memset(&outputs, 0, sizeof outputs);
    inputs.ambient_c7 = AMBIENT_C7;
}

void setUp(void)
{
    controller_settings_default(&settings);
    settings.policy.policy =
        DRIVE_POLICY_OPEN; /* most of these are of the tick, not of the policy */
    for (int k = 0; k < CONTROLLER_MAX_SPRINGS; k++) {
        spring_mohm[k] = 175;
    }
    supply_mv = 5000;
    start();
}

/* What the duties bring, 180 mohm beyond the spring. Failing sensors are left as they are. */
static void respond(void)
{
    for (int k = 0; k < CONTROLLER_MAX_SPRINGS; k++) {
        if (inputs.sensor[k].status != CONTROLLER_SENSOR_OK) {
            continue;
        }
        int32_t current_ma =
            spring_mohm[k] < 0
                ? 0
                : (int32_t)outputs.duty[k] * (supply_mv + supply_mv / 4) / (spring_mohm[k] + 180);
        int32_t voltage_mv = spring_mohm[k] < 0 ? supply_mv * outputs.duty[k] / 800
                                                : current_ma * spring_mohm[k] / 1000;
        inputs.sensor[k].current_ma = (int16_t)(current_ma > 3200 ? 3200 : current_ma);
        inputs.sensor[k].voltage_mv = (int16_t)voltage_mv;
    }
}

static void run(uint32_t ticks)
{
    for (uint32_t n = 0; n < ticks; n++) {
        controller_tick(&controller, &inputs, &outputs);
        respond();
    }
}

static void all_on(void)
{
    bool on[CONTROLLER_MAX_SPRINGS];
    memset(on, 1, sizeof on);
    controller_set_pattern(&controller, on);
}

static bool all_off(void)
{
    for (int k = 0; k < CONTROLLER_MAX_SPRINGS; k++) {
        if (outputs.duty[k] != 0) {
            return false;
        }
    }
    return true;
}

TEST(a_driven_spring_gets_its_current_and_only_that_one)
{
    TEST_ASSERT_TRUE(controller_set_target(&controller, 4, 1000));
    run(200);
    for (uint8_t k = 0; k < 9; k++) {
        TEST_ASSERT_INT_WITHIN(30, k == 4 ? 1500 : 0, controller_measured_ma(&controller, k));
        TEST_ASSERT_EQUAL_UINT16(outputs.duty[k], controller_duty(&controller, k));
    }
    TEST_ASSERT_INT_WITHIN(30, 265, controller_measured_mv(&controller, 4));
    TEST_ASSERT_EQUAL_UINT16(1500, controller_target_ma(&controller, 4));
}

/* Eight are on as a ninth is switched on: it waits while what flows leaves it nothing. */
TEST(none_rises_while_what_flows_leaves_nothing)
{
    static const int16_t each_ma[] = {1500, 1860};
    for (int beyond = 0; beyond < 2; beyond++) {
        setUp();
        for (uint8_t k = 0; k < 8; k++) {
            TEST_ASSERT_TRUE(controller_set_target(&controller, k, 1000));
        }
        run(200);
        TEST_ASSERT_TRUE(controller_set_target(&controller, 8, 1000));
        for (int tick = 0; tick < 8; tick++) {
            for (int k = 0; k < 8; k++) {
                inputs.sensor[k].current_ma = each_ma[beyond];
            }
            run(1);
        }
        TEST_ASSERT_EQUAL(beyond == 0, outputs.duty[8] > 0);
        TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(&controller));
    }
}

/* Of one spring alone more supply is learnt, as far as it is within its tolerance; 7 V are none,
 * and a switch that lets current pass beside its duty shows as much. */
TEST(what_is_no_circuit_teaches_nothing_of_the_supply)
{
    for (unsigned wrong = 0; wrong < 2; wrong++) {
        setUp();
        supply_mv = wrong != 0 ? 7000 : 5400;
        TEST_ASSERT_TRUE(controller_set_target(&controller, 4, 1000));
        run(200);
        const circuit_source_t *const source = controller_source(&controller);
        TEST_ASSERT_EQUAL(wrong == 0, circuit_source_supply_mv(source) > 5100.0f);
        TEST_ASSERT_EQUAL(wrong != 0, source->before < 0.5f);
        TEST_ASSERT_EQUAL(wrong != 0 ? SAFETY_FAULT_SENSOR_MISMATCH : SAFETY_FAULT_NONE,
                          controller_fault(&controller, 4));
    }
}

/* From martensite to austenite, whichever has more. */
TEST(each_current_loop_is_told_its_springs_resistance)
{
    for (int falling = 0; falling < 2; falling++) {
        if (falling) {
            settings.model.resistance_martensite_uohm = 9219000;
            settings.model.resistance_austenite_uohm = 219000;
        }
        start();
        for (uint8_t k = 0; k < 9; k++) {
            thermal_model_set_temperature(&controller.model, k, (int16_t)((85 + 2 * k) * 128));
        }
        run(30); /* a round: two in each turn in which no circuit and no ceiling is judged */
        for (uint8_t k = 0; k < 9; k++) {
            current_control_t told = controller.current;
            uint32_t resistance_uohm = thermal_model_resistance_uohm(&controller.model, k);
            current_control_set_resistance(&told, k, (uint16_t)((resistance_uohm + 500u) / 1000u));
            TEST_ASSERT_INT16_WITHIN(2, told.channel[k].estimate_q16,
                                     controller.current.channel[k].estimate_q16);
        }
    }
}

/* A sensor lost for hold_ticks: the heat goes on being counted at its last value; then the output
 * is off and none is. */
TEST(missing_readings_keep_the_last_power_while_the_output_is_on)
{
    settings.safety.bad_samples = 50;
    start();
    controller_set_target(&controller, 4, 1000);
    run(200);
    uint32_t before_uw = controller_power_uw(&controller, 4);
    TEST_ASSERT_UINT_WITHIN(20000, 394000, before_uw);
    inputs.sensor[4].status = CONTROLLER_SENSOR_BUS;
    inputs.sensor[4].current_ma = 12345; /* never a number */
    inputs.sensor[4].voltage_mv = -12345;
    for (int n = 0; n < settings.current.hold_ticks; n++) {
        run(1);
        TEST_ASSERT_EQUAL_UINT32(before_uw, controller_power_uw(&controller, 4));
        TEST_ASSERT_NOT_EQUAL(0, outputs.duty[4]);
    }
    run(1);
    TEST_ASSERT_EQUAL_UINT16(0, outputs.duty[4]);
    run(1);
    TEST_ASSERT_EQUAL_UINT32(0, controller_power_uw(&controller, 4));
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_fault(&controller, 4));
    inputs.sensor[4].status = CONTROLLER_SENSOR_OK;
    run(200);
    TEST_ASSERT_INT_WITHIN(30, 1500, controller_measured_ma(&controller, 4));
}

TEST(current_in_an_output_that_is_off_stops_the_board)
{
    controller_set_target(&controller, 0, 1000);
    run(100);
    inputs.sensor[5].current_ma = 400;
    inputs.sensor[5].voltage_mv = 70;
    TEST_ASSERT_TRUE(outputs.supply);
    for (unsigned n = 0; n < SAFETY_STUCK_TICKS; n++) {
        TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(&controller));
        controller_tick(&controller, &inputs, &outputs);
        TEST_ASSERT_FALSE(outputs.supply); /* from the first such reading on */
    }
    TEST_ASSERT_EQUAL(SAFETY_FAULT_STUCK_ON, controller_board_fault(&controller));
    TEST_ASSERT_EQUAL(SAFETY_FAULT_STUCK_ON, controller_fault(&controller, 5));
    TEST_ASSERT_TRUE(all_off());
}

TEST(hot_model_trips)
{
    controller_set_target(&controller, 4, 1000);
    run(100);
    thermal_model_set_temperature(&controller.model, 4, 150 * 128);
    run(settings.safety.bad_samples);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_OVER_TEMPERATURE, controller_fault(&controller, 4));
    TEST_ASSERT_EQUAL_UINT16(0, outputs.duty[4]);
}

/* What is believed is cold for ever, what is measured goes on: the ceiling ends it, and lets a
 * current pass that keeps it below the trip for ever. It begins where it was given nothing yet. */
TEST(ceiling_trips_whatever_is_believed)
{
    for (int trips = 0; trips < 2; trips++) {
        settings.policy.open_current_ma = trips ? 3000 : 1500;
        start();
        TEST_ASSERT_EQUAL_FLOAT(20.0f, temperature_ceiling_c(&controller.ceiling, 4));
        controller_set_target(&controller, 4, 1000);
        uint32_t ticks = 0;
        while (controller_fault(&controller, 4) == SAFETY_FAULT_NONE && ticks < 50u * 600u) {
            thermal_model_set_temperature(&controller.model, 4, 30 * 128);
            run(1);
            ticks++;
        }
        TEST_ASSERT_EQUAL(trips ? SAFETY_FAULT_OVER_TEMPERATURE : SAFETY_FAULT_NONE,
                          controller_fault(&controller, 4));
        TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_fault(&controller, 3));
        TEST_ASSERT_EQUAL(trips, outputs.duty[4] == 0);
    }
}

static void warm_reset(void)
{
    thermal_model_state_t state;
    temperature_ceiling_t delivered;
    const bool known = controller_knows_cold(&controller);
    controller_get_model_state(&controller, &state);
    controller_get_delivered(&controller, &delivered);
    TEST_ASSERT_TRUE(controller_init(&controller, &settings, AMBIENT_C7, NULL));
    TEST_ASSERT_EQUAL(known, controller_resume(&controller, &delivered, known ? &state : NULL));
}

/* What would tell that a sensor has begun to lie is lost by a reset: a spring that is warm waits,
 * however often; one that is cold does not, and air and plate are as they were. */
TEST(after_a_warm_reset_only_what_is_cold_is_known)
{
    controller_settings_default(&settings);
    settings.model.plate_coupling_uw_per_k = 2000;
    start();
    warm_reset(); /* guesses: it makes none of them certain */
    TEST_ASSERT_FALSE(controller_knows_cold(&controller));
    controller_set_temperature(&controller, AMBIENT_C7);
    controller_set_target(&controller, 0, 1000);
    run(50u * 20u);
    const int32_t plate_c23 = controller.model.state.plate_c23;
    TEST_ASSERT_TRUE(controller_delivered_c(&controller, 0) > 80.0f);
    TEST_ASSERT_TRUE(plate_c23 > AMBIENT_C7 * 65536);
    for (int n = 0; n < 2; n++) {
        warm_reset();
        TEST_ASSERT_EQUAL_INT32(plate_c23, controller.model.state.plate_c23);
        TEST_ASSERT_TRUE(controller_delivered_c(&controller, 0) > 80.0f);
        TEST_ASSERT_TRUE(doubts_inside(&controller.estimator));
        TEST_ASSERT_FLOAT_WITHIN(10.0f, 80.0f, controller_cooling_s(&controller, 0));
        TEST_ASSERT_EQUAL_FLOAT(0.0f, controller_cooling_s(&controller, 8));
        TEST_ASSERT_TRUE(controller_knows_cold(&controller));
        TEST_ASSERT_FALSE(controller_is_known(&controller));
    }
    /* openly nobody waits: where its model took it to be as warm as any, it came to 143 degC */
    TEST_ASSERT_TRUE(controller_temperature_c7(&controller, 0) < 75 * 128);
    TEST_ASSERT_TRUE(controller_set_policy(&controller, DRIVE_POLICY_OPEN));
    TEST_ASSERT_INT16_WITHIN(1, (int16_t)(128.0f * controller_delivered_c(&controller, 0)),
                             controller_temperature_c7(&controller, 0));
    TEST_ASSERT_TRUE(controller_set_policy(&controller, DRIVE_POLICY_PRECOMPENSATE));
    warm_reset();
    /* no look at what it reads makes it known: by what was learnt, a sensor that shows half of its
     * current shows austenite for ever, and each of a few resets had it heated again: 192 degC */
    const spring_learnt_t learnt = {.austenite_ohm = 0.219f, .change = 0.2f};
    controller_restore_learnt(&controller, 0, &learnt);
    for (int t = 0; t < 50 * 10; t++) {
        all_on();
        run(1);
        TEST_ASSERT_EQUAL_UINT16(0, outputs.duty[0]);
    }
    TEST_ASSERT_EQUAL_UINT16(DRIVE_POLICY_LIMIT_COOLING, controller_limits(&controller, 0));
    run(50u * 80u);
    TEST_ASSERT_TRUE(controller_limits(&controller, 0) != DRIVE_POLICY_LIMIT_COOLING);
}

/* Nor is a spring called cold that was warm as the power was cut, until it has waited; what is
 * guessed of it meanwhile is no heat that was given. */
TEST(what_was_warm_as_the_power_was_cut_is_called_cold_by_nobody)
{
    controller_settings_default(&settings);
    start();
    TEST_ASSERT_FALSE(controller_may_be_warm(&controller));
    TEST_ASSERT_FALSE(controller_is_doubtful(&controller, 4));
    controller_doubt_cold(&controller);
    for (int s = 0; s < 60; s++) {
        const float wait_s = controller_cooling_s(&controller, 4);
        TEST_ASSERT_TRUE(wait_s > 0.0f);
        controller_set_temperature(&controller, AMBIENT_C7);
        TEST_ASSERT_EQUAL_FLOAT(wait_s, controller_cooling_s(&controller, 4));
        TEST_ASSERT_TRUE(controller_is_doubtful(&controller, 4));
        TEST_ASSERT_FALSE(controller_is_warm(&controller, 4));
        TEST_ASSERT_TRUE(controller_may_be_warm(&controller));
        run(50u);
    }
    run(50u * 40u);
    TEST_ASSERT_FALSE(controller_is_doubtful(&controller, 4));
    TEST_ASSERT_FALSE(controller_may_be_warm(&controller));
    controller_set_temperature(&controller, AMBIENT_C7);
    TEST_ASSERT_EQUAL_INT16(AMBIENT_C7, controller_temperature_c7(&controller, 4));
    settings.model.rows = 1; /* another size is waited for anew, but no longer in doubt */
    TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
    TEST_ASSERT_FALSE(controller_is_doubtful(&controller, 1));
    for (int heated = 0; heated < 2; heated++) { /* what it reads is, once heat was given */
        settings.model.rows = (uint8_t)(2 + heated);
        TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
        TEST_ASSERT_EQUAL(heated, doubts_inside(&controller.estimator));
        controller_set_temperature(&controller, AMBIENT_C7);
        all_on();
        run(50u);
    }
}

/* All that can be said of a spring which this board has heated: none of it takes a kelvin away. */
TEST(no_hint_takes_heat_that_was_given)
{
    controller_settings_t other;
    for (int hint = 0; hint < 8; hint++) {
        controller_settings_default(&settings);
        settings.policy.policy = DRIVE_POLICY_OPEN;
        start();
        controller_set_temperature(&controller, AMBIENT_C7);
        TEST_ASSERT_EQUAL_INT16(AMBIENT_C7, controller_temperature_c7(&controller, 4));
        controller_set_target(&controller, 4, 1000);
        run(50u * 60u);
        controller_stop(&controller);
        run(50u * 12u);
        other = settings;
        const int16_t before_c7 = controller_temperature_c7(&controller, 4);
        const float given_c = controller_delivered_c(&controller, 4);
        TEST_ASSERT_GREATER_THAN_INT16(40 * 128, before_c7);
        TEST_ASSERT_TRUE(controller_is_warm(&controller, 4));
        TEST_ASSERT_UINT16_WITHIN(1, 12, controller_rest_s(&controller, 4));
        bool model_stays = true;
        switch (hint) {
        case 0:
            break;
        case 1:
            warm_reset();
            model_stays = false;
            break;
        case 2: /* another size and back: what is believed begins anew, from unknown */
            other.model.rows = 1;
            TEST_ASSERT_TRUE(controller_apply_settings(&controller, &other, NULL));
            TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
            model_stays = false;
            break;
        case 3: /* it seems to cool at once */
            inputs.ambient_c7 = -40 * 128;
            run(50u * 10u);
            inputs.ambient_c7 = AMBIENT_C7;
            model_stays = false;
            break;
        case 4:
            other.model.loss_uw_per_k = 60000;
            other.model.loss_fan_uw_per_k = 60000;
            TEST_ASSERT_TRUE(controller_apply_settings(&controller, &other, NULL));
            TEST_ASSERT_EQUAL_INT16(before_c7, controller_temperature_c7(&controller, 4));
            run(50u * 10u);
            model_stays = false;
            break;
        case 5: /* without it the others are cold */
            other.model.rows = 1;
            TEST_ASSERT_TRUE(controller_apply_settings(&controller, &other, NULL));
            run(50u * 2u);
            TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
            run(50u * 2u);
            model_stays = false;
            break;
        case 6:
            other.model.heat_capacity_mj_per_k *= 4u;
            TEST_ASSERT_TRUE(controller_apply_settings(&controller, &other, NULL));
            break;
        default:
            other.model.heat_capacity_mj_per_k /= 2u;
            other.model.loss_scale_permille[4] = 2000;
            TEST_ASSERT_TRUE(controller_apply_settings(&controller, &other, NULL));
            break;
        }
        controller_set_temperature(&controller, AMBIENT_C7); /* `model cold` */
        TEST_ASSERT_TRUE(controller_is_warm(&controller, 4));
        TEST_ASSERT_TRUE(controller_delivered_c(&controller, 4) > given_c - 8.0f);
        if (model_stays) {
            TEST_ASSERT_INT16_WITHIN(1, before_c7, controller_temperature_c7(&controller, 4));
        }
    }
    run(50u * 900u); /* and when it has cooled, the hint is taken again */
    TEST_ASSERT_FALSE(controller_is_warm(&controller, 4));
    controller_set_temperature(&controller, AMBIENT_C7);
    TEST_ASSERT_EQUAL_INT16(AMBIENT_C7, controller_temperature_c7(&controller, 4));
}

/* Whatever air is told for a while, and then the right one. */
TEST(no_air_that_may_be_told_takes_heat_that_was_given)
{
    settings.policy.open_current_ma = 1900;
    start();
    controller_set_target(&controller, 4, 1000);
    run(50u * 60u);
    controller_stop(&controller);
    inputs.ambient_c7 = fixed_point_c7_from_cc((int16_t)parameter_row(PARAMETER_ambient_c).maximum);
    run(50u * 2u);
    inputs.ambient_c7 = AMBIENT_C7;
    run(50u * 2u);
    const float given_c = controller_delivered_c(&controller, 4);
    TEST_ASSERT_FLOAT_WITHIN(8.0f, 75.0f, given_c);
    controller_set_temperature(&controller, AMBIENT_C7);
    TEST_ASSERT_TRUE(controller_is_warm(&controller, 4));
    TEST_ASSERT_TRUE(controller_temperature_c7(&controller, 4) > 55 * 128);
}

/* 2.35 A take it beyond 120 degC by what was declared as it became warm, and the belief is talked
 * away: the ceiling ends that at the trip, or at temperature_limit_c where another declaration
 * contradicts, be it from the first ticks of power on. */
TEST(where_declarations_contradict_the_ceiling_trips_at_the_limit)
{
    static const struct {
        float loss, capacity;
        int16_t air_c7;
        uint16_t before; /* ticks */
        bool trips;
    } row[] = {{1.0f, 1.0f, AMBIENT_C7, 3000, false}, {2.0f, 1.0f, AMBIENT_C7, 3000, true},
               {1.0f, 4.0f, AMBIENT_C7, 3000, true},  {1.0f, 1.0f, -30 * 128, 3000, true},
               {2.0f, 1.0f, AMBIENT_C7, 5, true},     {1.0f, 4.0f, AMBIENT_C7, 5, true},
               {2.0f, 1.0f, AMBIENT_C7, 40, true},    {1.0f, 4.0f, AMBIENT_C7, 40, true}};
    for (unsigned n = 0; n < ROWS(row); n++) {
        setUp();
        settings.policy.open_current_ma = 2350;
        start();
        controller_set_target(&controller, 4, 1000);
        run(row[n].before);
        settings.model.loss_uw_per_k = (uint16_t)(row[n].loss * settings.model.loss_uw_per_k);
        settings.model.heat_capacity_mj_per_k =
            (uint16_t)(row[n].capacity * settings.model.heat_capacity_mj_per_k);
        TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
        inputs.ambient_c7 = row[n].air_c7;
        for (uint32_t m = 0; m < 50u * 240u; m++) {
            thermal_model_set_temperature(&controller.model, 4, 30 * 128);
            run(1);
            if (controller_fault(&controller, 4) != SAFETY_FAULT_NONE) {
                break;
            }
        }
        const float limit_c = 110.0f;
        TEST_ASSERT_EQUAL(row[n].trips ? SAFETY_FAULT_OVER_TEMPERATURE : SAFETY_FAULT_NONE,
                          controller_fault(&controller, 4));
        TEST_ASSERT_TRUE(controller_delivered_c(&controller, 4) > limit_c - 0.5f);
        TEST_ASSERT_TRUE(!row[n].trips || controller_delivered_c(&controller, 4) < limit_c + 3.0f);
    }
}

static void heat_for_4_s(void)
{
    settings.policy.policy = DRIVE_POLICY_PRECOMPENSATE;
    start();
    controller_set_temperature(&controller, AMBIENT_C7);
    controller_set_target(&controller, 4, 1000);
    run(200);
}

/* It heats as much with a contact that is declared as without: that may not be there. */
TEST(ceiling_believes_no_contact)
{
    float delivered_c[2];
    for (unsigned n = 0; n < 2; n++) {
        setUp();
        settings.policy.open_current_ma = 2350;
        settings.model.contact_uohm[4] = n * 100000u;
        start();
        controller_set_target(&controller, 4, 1000);
        run(1000);
        delivered_c[n] = controller_delivered_c(&controller, 4);
    }
    TEST_ASSERT_TRUE(delivered_c[0] > 50.0f);
    TEST_ASSERT_FLOAT_WITHIN(2.0f, delivered_c[0], delivered_c[1]);
}

/* 0.1 ohm of 0.175 leave no spring, declared before it heats, as it heats, or of hot austenite in a
 * hold; in series with one they are its contact. Of what is off nothing is compared. */
TEST(contact_that_is_not_there_is_no_circuit)
{
    static const struct {
        int32_t mohm;
        bool first, off, hot;
        safety_fault_t fault;
    } row[] = {{175, true, false, false, SAFETY_FAULT_SENSOR_MISMATCH},
               {175, false, false, false, SAFETY_FAULT_SENSOR_MISMATCH},
               {175, false, false, true, SAFETY_FAULT_SENSOR_MISMATCH},
               {175, false, true, false, SAFETY_FAULT_NONE},
               {275, true, false, false, SAFETY_FAULT_NONE},
               {275, false, false, false, SAFETY_FAULT_NONE}};
    for (unsigned n = 0; n < ROWS(row); n++) {
        setUp();
        spring_mohm[4] = row[n].mohm;
        settings.model.contact_uohm[4] = row[n].first ? 100000u : 0u;
        heat_for_4_s();
        if (row[n].off) {
            controller_set_target(&controller, 4, 0);
            run(2);
        }
        if (row[n].hot) {
            spring_belief_t *const b = belief_inside(&controller.estimator, 4);
            b->heating = false;
            b->possible = SPRING_PHASE_AUSTENITE;
            b->learnt.austenite_ohm = 0.22f;
            seal_inside(&controller.estimator, 4);
        }
        settings.model.contact_uohm[4] = 100000u;
        TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
        run(row[n].hot ? 1 : 100);
        TEST_ASSERT_EQUAL(row[n].fault, controller_fault(&controller, 4));
    }
}

/* What is read of a hurried tick is left out. Of a window of such nothing is judged, and it ends no
 * row of those before; one in which a host types settings all the time tells as any other. */
TEST(readings_of_hurried_ticks_are_left_out)
{
    static const struct {
        uint32_t every; /* so many ticks one is hurried */
        bool lies_then; /* and no other */
        uint8_t unbalanced;
        safety_fault_t fault;
    } table[] = {{UINT32_MAX, false, CIRCUIT_CHECK_BALANCE_WINDOWS, SAFETY_FAULT_SENSOR_MISMATCH},
                 {1, false, CIRCUIT_CHECK_BALANCE_WINDOWS - 1u, SAFETY_FAULT_NONE},
                 {6, false, CIRCUIT_CHECK_BALANCE_WINDOWS, SAFETY_FAULT_SENSOR_MISMATCH},
                 {6, true, 0, SAFETY_FAULT_NONE}};
    for (size_t n = 0; n < sizeof table / sizeof table[0]; n++) {
        setUp();
        heat_for_4_s();
        while (controller.circuit[4].readings != 0) {
            run(1);
        }
        controller.circuit[4].unbalanced = CIRCUIT_CHECK_BALANCE_WINDOWS - 1u;
        const circuit_peer_t peer = controller.peers.spring[4];
        for (uint32_t tick = 1; tick <= CIRCUIT_CHECK_TICKS; tick++) {
            const bool hurried = tick % table[n].every == 0;
            if (hurried || !table[n].lies_then) {
                inputs.sensor[4].voltage_mv = (int16_t)(2 * inputs.sensor[4].voltage_mv);
            }
            if (hurried) {
                controller_hurry(&controller);
            }
            run(1);
        }
        row(n);
        TEST_ASSERT_EQUAL_UINT8(table[n].unbalanced, controller.circuit[4].unbalanced);
        TEST_ASSERT_EQUAL(table[n].fault, controller_fault(&controller, 4));
        if (table[n].every == 1) {
            TEST_ASSERT_EQUAL_MEMORY(&peer, &controller.peers.spring[4], sizeof peer);
        }
    }
}

static void tick_with_half_a_sensor(void)
{
    run(1);
    inputs.sensor[4].current_ma = (int16_t)(inputs.sensor[4].current_ma / 2);
}

/* A sensor that shows half from 4 s on, and a user who clears and tries again each second: the
 * first time at once, then when the spring has rested for its time constant (52 s). */
TEST(who_clears_again_and_again_heats_no_spring_whose_sensor_lies)
{
    heat_for_4_s();
    uint32_t heated = 0, cleared = 0, last = 0, rested = UINT32_MAX;
    for (uint32_t tick = 0; tick < 120u * 50u; tick++) {
        tick_with_half_a_sensor();
        if (outputs.duty[4] != 0) {
            rested = heated > 0 && tick - last > 100 && tick - last < rested ? tick - last : rested;
            heated++;
            last = tick;
        }
        if (tick % 50u == 49u && controller_fault(&controller, 4) != SAFETY_FAULT_NONE) {
            const uint16_t wait_s = controller_clear_wait_s(&controller, 4);
            TEST_ASSERT_LESS_OR_EQUAL_UINT16(52, wait_s);
            controller_clear_faults(&controller);
            TEST_ASSERT_EQUAL(wait_s == 0 ? SAFETY_FAULT_NONE : SAFETY_FAULT_SENSOR_MISMATCH,
                              controller_fault(&controller, 4));
            cleared += wait_s == 0;
            controller_set_target(&controller, 4, 1000);
        }
    }
    TEST_ASSERT_EQUAL_UINT32(3, cleared);
    TEST_ASSERT_LESS_THAN_UINT32(4u * 120u, heated);
    TEST_ASSERT_EQUAL_UINT16(0, controller_clear_wait_s(&controller, 0));
    /* no setting makes a sensor honest: where it takes away what told of the lie, it has to rest */
    for (unsigned n = 0; n < 2; n++) {
        controller_clear_faults(&controller);
        safety_clear(&controller.safety);
        settings.current.integral_permille = (uint16_t)(500 + 10 * n);
        settings.current.wiring_mohm = (uint16_t)(80 + 10 * n);
        controller.peers.spring[0].odd = 1;
        TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
        TEST_ASSERT_EQUAL_UINT8(n == 0, controller.peers.spring[0].odd);
        TEST_ASSERT_EQUAL(n == 0 ? SAFETY_FAULT_NONE : SAFETY_FAULT_SENSOR_MISMATCH,
                          controller_fault(&controller, 4));
        TEST_ASSERT_EQUAL(n != 0, controller_clear_wait_s(&controller, 4) != 0);
    }
}

/* Nothing is forgotten of a spring that has no fault: the first is found as if nobody cleared. */
TEST(who_clears_each_second_hides_no_sensor_that_lies)
{
    heat_for_4_s();
    uint32_t ticks = 0;
    for (; controller_fault(&controller, 4) == SAFETY_FAULT_NONE && ticks < 400; ticks++) {
        tick_with_half_a_sensor();
        if (ticks % 50u == 25u) {
            controller_clear_faults(&controller);
            controller_set_target(&controller, 4, 1000);
        }
    }
    TEST_ASSERT_LESS_THAN_UINT32(200, ticks);
}

/* A welded switch: the first clear closes the supply again, the second one when it has rested. */
TEST(who_clears_a_welded_switch_again_waits)
{
    for (unsigned n = 0; n < 3; n++) {
        safety_trip(&controller.safety, 4, SAFETY_FAULT_STUCK_ON);
        controller.ceiling.rest_turns[4] = 10;
        controller_clear_faults(&controller);
        TEST_ASSERT_EQUAL(n == 0, controller_board_fault(&controller) == SAFETY_FAULT_NONE);
        TEST_ASSERT_EQUAL(n == 0, controller_set_supply(&controller, true));
    }
    controller.ceiling.rest_turns[4] = 100;
    controller_clear_faults(&controller);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(&controller));
    TEST_ASSERT_TRUE(controller_set_supply(&controller, true));
}

/* Without a relay nothing is off; what was switched off is so still where there is one after all.
 */
TEST(a_relay_that_is_declared_again_is_as_it_was)
{
    TEST_ASSERT_TRUE(controller_set_supply(&controller, false));
    for (uint8_t cut_off = 0; cut_off < 2; cut_off++) {
        settings.safety.cut_off = cut_off;
        TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
        run(100);
        TEST_ASSERT_EQUAL(cut_off != 0, controller_supply_is_off(&controller));
        TEST_ASSERT_EQUAL(0, controller_supply_is_held(&controller));
    }
    TEST_ASSERT_TRUE(controller_set_supply(&controller, true));
    TEST_ASSERT_FALSE(controller_supply_is_off(&controller));
}

/* Above the policy's limit, below safety's: after trip_time_s it is off, and says why. */
TEST(limit_that_stays_is_a_fault_until_cleared)
{
    settings.policy.trip_time_s = 2;
    start();
    controller_set_target(&controller, 4, 1000);
    run(100);
    for (int n = 0; n < 160; n++) {
        thermal_model_set_temperature(&controller.model, 4, 120 * 128);
        run(1);
        if (n == 60) {
            TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_fault(&controller, 4));
        }
    }
    TEST_ASSERT_EQUAL(SAFETY_FAULT_LIMIT_TRIP, controller_fault(&controller, 4));
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(&controller));
    TEST_ASSERT_EQUAL_UINT16(0, outputs.duty[4]);
    thermal_model_set_temperature(&controller.model, 4, 60 * 128);
    run(500);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_LIMIT_TRIP, controller_fault(&controller, 4));
    TEST_ASSERT_EQUAL_UINT16(0, outputs.duty[4]);
    controller_clear_faults(&controller);
    controller_set_target(&controller, 4, 1000);
    run(100);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_fault(&controller, 4));
    TEST_ASSERT_INT_WITHIN(30, 1500, controller_measured_ma(&controller, 4));
}

TEST(stop_acts_in_the_next_tick)
{
    all_on();
    run(100);
    controller_stop(&controller);
    run(1);
    TEST_ASSERT_TRUE(all_off());
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(&controller));
    all_on();
    run(100);
    controller_emergency_stop(&controller);
    run(1);
    TEST_ASSERT_TRUE(all_off());
    TEST_ASSERT_EQUAL(SAFETY_FAULT_EMERGENCY_STOP, controller_board_fault(&controller));
    all_on();
    run(100);
    TEST_ASSERT_TRUE(all_off());
    controller_clear_faults(&controller);
    all_on();
    run(13); /* a round of the policy */
    TEST_ASSERT_FALSE(all_off());
}

TEST(commands_out_of_range_change_nothing)
{
    controller_t before = controller;
    TEST_ASSERT_FALSE(controller_set_target(&controller, 9, 1000));
    TEST_ASSERT_FALSE(controller_set_target(&controller, 0, 1001));
    TEST_ASSERT_FALSE(controller_set_policy(&controller, (drive_policy_kind_t)9));
    TEST_ASSERT_FALSE(controller_set_fan(&controller, 101));
    TEST_ASSERT_EQUAL_MEMORY(&before, &controller, sizeof controller);
    TEST_ASSERT_TRUE(controller_set_fan(&controller, 100));
    run(1);
    TEST_ASSERT_EQUAL_UINT8(100, outputs.fan_percent);
}

static void refuses(const controller_settings_t *changed, uint16_t row)
{
    controller_t before = controller;
    uint16_t bad = UINT16_MAX;
    TEST_ASSERT_FALSE(controller_apply_settings(&controller, changed, &bad));
    TEST_ASSERT_EQUAL_UINT16(row, bad);
    TEST_ASSERT_EQUAL_MEMORY(&before, &controller, sizeof controller);
    bad = UINT16_MAX;
    TEST_ASSERT_FALSE(controller_init(&controller, changed, AMBIENT_C7, &bad));
    TEST_ASSERT_EQUAL_UINT16(row, bad);
    TEST_ASSERT_EQUAL_MEMORY(&before, &controller, sizeof controller);
}

TEST(refused_settings_change_nothing_and_are_found)
{
    all_on();
    run(100);
#define REFUSES(field, value, name)                                                                \
    do {                                                                                           \
        controller_settings_t changed = settings;                                                  \
        changed.field = (value);                                                                   \
        refuses(&changed, PARAMETER_##name);                                                       \
    } while (0)
    REFUSES(model.rows, 0, rows);
    REFUSES(model.step_ms, 50, COUNT);
    REFUSES(model.austenite_finish_cc, 8700, austenite_finish_c);
    REFUSES(current.supply_mv, 0, supply_v);
    REFUSES(safety.bad_samples, 0, fault_bad_samples);
    REFUSES(policy.open_current_ma, 3201, open_current_a);
#undef REFUSES
}

/* Phases, too: what had transformed is not to be heated through it again, whatever transformation
 * is declared. */
TEST(accepted_settings_keep_temperatures_phases_currents_and_faults)
{
    all_on();
    spring_mohm[8] = 5;
    run(3000);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_SHORT_SPRING, controller_fault(&controller, 8));
    int16_t temperature_c7 = controller_temperature_c7(&controller, 4);
    int16_t current_ma = controller_measured_ma(&controller, 4);
    TEST_ASSERT_GREATER_THAN_INT16(50 * 128, temperature_c7);
    thermal_model_set_temperature(&controller.model, 2, 110 * 128);
    thermal_model_set_temperature(&controller.model, 2, 83 * 128);
    settings.model.martensite_start_cc = 7600;
    settings.model.loss_uw_per_k = 7000;
    settings.policy.open_current_ma = 1400;
    TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
    TEST_ASSERT_EQUAL_INT16(temperature_c7, controller_temperature_c7(&controller, 4));
    TEST_ASSERT_EQUAL_INT16(83 * 128, controller_temperature_c7(&controller, 2));
    TEST_ASSERT_EQUAL_UINT16(1000, controller_austenite_permille(&controller, 2));
    TEST_ASSERT_EQUAL(SAFETY_FAULT_SHORT_SPRING, controller_fault(&controller, 8));
    run(2);
    TEST_ASSERT_INT_WITHIN(130, current_ma, controller_measured_ma(&controller, 4));
    run(50);
    TEST_ASSERT_INT_WITHIN(30, 1400, controller_measured_ma(&controller, 4));
}

/* What was learnt of a loss was learnt of all that the spring gives off, whatever is declared of
 * it; of the rest nothing changes. */
TEST(another_model_keeps_what_a_spring_gives_off)
{
    const spring_learnt_t own = {.austenite_ohm = 0.22f,
                                 .change = 0.2f,
                                 .martensite_ohm = 0.176f,
                                 .loss_w_per_k = -0.0008f,
                                 .loss_sd_w_per_k = 0.0001f};
    controller_restore_learnt(&controller, 3, &own);
    settings.policy.hold_margin_cc++;
    settings.safety.temperature_trip_cc--;
    TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
    TEST_ASSERT_EQUAL_FLOAT(-0.0008f, controller_learnt(&controller, 3).loss_w_per_k);
    settings.model.martensite_start_cc -= 200;
    TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, -0.0008f, controller_learnt(&controller, 3).loss_w_per_k);
    settings.model.loss_uw_per_k += 800;
    TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
    const spring_learnt_t left = controller_learnt(&controller, 3);
    TEST_ASSERT_FLOAT_WITHIN(5e-5f, -0.0016f, left.loss_w_per_k);
    TEST_ASSERT_FLOAT_WITHIN(2e-6f, 0.0001f, left.loss_sd_w_per_k);
    TEST_ASSERT_EQUAL_FLOAT(0.22f, left.austenite_ohm);
    TEST_ASSERT_EQUAL_FLOAT(0.176f, left.martensite_ohm);
    TEST_ASSERT_EQUAL_FLOAT(0.2f, left.change);
    /* of another nothing was learnt: it is as declared, within the tolerance of that */
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.0f, controller_learnt(&controller, 4).loss_w_per_k);
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.12f * 0.0066f,
                             controller_learnt(&controller, 4).loss_sd_w_per_k);
    settings.model.resistance_austenite_uohm = settings.model.resistance_martensite_uohm * 2u;
    TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
    TEST_ASSERT_EQUAL_FLOAT(0.5f, controller_learnt(&controller, 4).change);
    TEST_ASSERT_EQUAL_FLOAT(0.2f, controller_learnt(&controller, 3).change);
    inputs.fan_percent = 100; /* it turns: that is no loss that changed */
    run(10);
    controller_restore_learnt(&controller, 3, &own);
    settings.model.martensite_start_cc -= 200;
    TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
    TEST_ASSERT_FLOAT_WITHIN(2e-5f, -0.0008f, controller_learnt(&controller, 3).loss_w_per_k);
}

TEST(each_number_of_the_model_changes_its_mark)
{
    thermal_model_parameters_t *const values = &controller.model.parameters;
    const uint16_t mark = controller_model_mark(&controller);
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        for (spring_index_t n = 0; row.part == PARAMETER_PART_MODEL && n < row.count; n++) {
            const int32_t value = parameter_get(values, &row, n);
            parameter_set(values, &row, n, value ^ 1);
            TEST_ASSERT_TRUE(mark != controller_model_mark(&controller));
            parameter_set(values, &row, n, value);
        }
    }
    TEST_ASSERT_EQUAL_UINT16(mark, controller_model_mark(&controller));
}

TEST(another_size_starts_anew_but_stays_locked)
{
    all_on();
    run(500);
    controller_lock(&controller);
    controller_emergency_stop(&controller);
    safety_trip(&controller.safety, 1, SAFETY_FAULT_SENSOR_MISMATCH);
    safety_trip(&controller.safety, 8, SAFETY_FAULT_SENSOR_MISMATCH);
    settings.model.rows = 1;
    settings.model.columns = 2;
    TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
    TEST_ASSERT_EQUAL_UINT8(2, controller_springs(&controller));
    TEST_ASSERT_TRUE(controller_is_locked(&controller));
    TEST_ASSERT_EQUAL(SAFETY_FAULT_EMERGENCY_STOP, controller_board_fault(&controller));
    run(1);
    TEST_ASSERT_TRUE(all_off());
    TEST_ASSERT_FALSE(controller_set_target(&controller, 2, 1000));
    TEST_ASSERT_EQUAL(SAFETY_FAULT_SENSOR_MISMATCH, controller_fault(&controller, 1));
    controller_unlock(&controller);
    controller_clear_faults(&controller);
    all_on();
    run(100);
    TEST_ASSERT_INT_WITHIN(30, 1500, controller_measured_ma(&controller, 1));
    TEST_ASSERT_EQUAL_UINT16(0, outputs.duty[2]);
    settings.model.rows = 3; /* nor is what was latched, or cleared once, forgotten by it */
    settings.model.columns = 3;
    TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
    TEST_ASSERT_EQUAL(SAFETY_FAULT_SENSOR_MISMATCH, controller_fault(&controller, 8));
    safety_trip(&controller.safety, 1, SAFETY_FAULT_SENSOR_MISMATCH);
    controller_clear_faults(&controller);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_SENSOR_MISMATCH, controller_fault(&controller, 1));
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_fault(&controller, 8));
}

/* ---- RAM that turns over ---- */

#define PASSES_TICKS 700 /* two passes over 64 springs */

/* One byte of each part; the last one of a stretch, where there is a choice. */
TEST(what_settings_decide_and_a_bit_turned_over_drives_nothing)
{
    void *const places[] = {&controller.model.parameters.rows,
                            &controller.model.parameters.step_ms,
                            &controller.model.springs,
                            &controller.model.highest_c7,
                            &controller.model.air.gain,
                            &controller.model.plate.quick,
                            &controller.model.spring[3].step_gain,
                            &controller.model.spring[63].upstream,
                            &controller.drive.v_per_step,
                            &controller.drive.w_per_v2,
                            &controller.current.parameters,
                            &controller.current.integral_q16,
                            &controller.safety.parameters.temperature_trip_cc,
                            &controller.safety.temperature_trip_c7,
                            &controller.safety.springs,
                            &controller.policy.parameters.boost_current_ma,
                            &controller.policy.columns,
                            &controller.estimator,
                            (uint8_t *)&controller.estimator + SPRING_ESTIMATOR_FIXED_BYTES - 4};
    settings.safety.cut_off = 1;
    for (size_t n = 0; n < ROWS(places); n++) {
        start();
        TEST_ASSERT_TRUE(controller_set_target(&controller, 0, 1000));
        run(60);
        TEST_ASSERT_TRUE(outputs.duty[0] != 0);
        TEST_ASSERT_TRUE(outputs.supply);
        *(uint8_t *)places[n] ^= 4u;
        const controller_t as_it_is = controller;
        controller_settings_t other = settings;
        other.safety.maximum_on_s = 7;
        TEST_ASSERT_FALSE_MESSAGE(controller_apply_settings(&controller, &other, NULL),
                                  "sealed by other settings");
        controller = as_it_is;
        (void)controller_set_policy(&controller, DRIVE_POLICY_OPEN);
        TEST_ASSERT_FALSE_MESSAGE(controller_is_sound(&controller), "sealed by another policy");
        controller = as_it_is;
        *(uint8_t *)places[n] ^= 4u; /* with most of them no tick is to be run */
        TEST_ASSERT_TRUE(controller_is_sound(&controller));
        controller.safety.parameters.maximum_on_s ^= 4u;
        run(PASSES_TICKS);
        TEST_ASSERT_FALSE(controller_is_sound(&controller));
        TEST_ASSERT_EQUAL_UINT(0, outputs.duty[0]);
        TEST_ASSERT_FALSE(outputs.supply);
    }
    start();
    TEST_ASSERT_TRUE(controller_is_sound(&controller));
}

/* What the fan decides of the conductances is taken anew with each pass. */
TEST(a_conductance_of_the_fan_that_turned_over_comes_back)
{
    const uint16_t loss_uw_per_k = controller.model.spring[1].loss_uw_per_k;
    controller.model.spring[1].loss_uw_per_k ^= 0x1000u;
    run(PASSES_TICKS);
    TEST_ASSERT_EQUAL_UINT(loss_uw_per_k, controller.model.spring[1].loss_uw_per_k);
    TEST_ASSERT_TRUE(controller_is_sound(&controller));
}
