/* What a hold and the end of a heating make of the resistance. Readings are those of a fine sensor;
 * the model is not stepped: its temperature is what the test or a correction puts it to. */
#include <stddef.h>

#include "fixture.h"
#include "unity.h"

#define KELVIN 128 /* of a temperature in 1/128 K */
#define WINDOW 13u /* ticks in which each spring is updated once, at least */

static double left_mv; /* what the last voltage was rounded by */

static drive_policy_spring_t *const spring = &policy.spring[0];

/* Anew, with the defaults. */
static void make_row(uint8_t springs)
{
    setUp();
    make(1, springs);
    left_mv = 0.0;
}

static void apply(void)
{
    TEST_ASSERT_TRUE(drive_policy_apply(&policy, &parameters, NULL));
    drive_policy_prepare(&policy, &model);
}

static double ohm_of(int permille)
{
    return (175.0 + 44.0 * permille / 1000.0) / 1000.0;
}

/* One tick; spring 0 reads as a resistance. */
static void read_ohm(double ohm)
{
    double mv = target_ma[0] * ohm + left_mv;
    valid[0] = true;
    measured_ma[0] = (int16_t)target_ma[0];
    measured_mv[0] = (int16_t)mv;
    left_mv = mv - measured_mv[0];
    (void)tick();
}

/* Spring 0 reads a phase for so many windows. */
static void read_phase(int permille, unsigned windows)
{
    for (unsigned n = windows * WINDOW; n != 0; n--) {
        read_ohm(ohm_of(permille));
    }
}

/* The same while the spring is where its hold wants it. */
static void hold_phase(int permille, unsigned windows)
{
    for (unsigned n = windows * WINDOW; n != 0; n--) {
        if (spring->stage == DRIVE_POLICY_STAGE_HOLD) {
            thermal_model_set_temperature(
                &model, 0,
                (int16_t)(thermal_model_transformation(&model, 0).martensite_start_c7 +
                          spring->margin_c7));
        }
        read_ohm(ohm_of(permille));
    }
}

/* Its own martensite is known, and all averages are at a phase. */
static void knows(int permille)
{
    resistance_observer_t *observer = &spring->observer;
    observer->learnt = 100;
    observer->readings = 0;
    observer->current_sum_ma = observer->voltage_sum_mv = 0;
    observer->ratio_q14 = (uint16_t)(16384.0 * ohm_of(permille) / ohm_of(0));
    observer->inverse_q14 = (uint16_t)(16384.0 * ohm_of(0) / ohm_of(permille));
    resistance_observer_restart_average(observer);
}

/* The average now shows so much less phase than the hold began with. */
static void lose(int permille)
{
    spring->observer.slow_q22 =
        (uint32_t)(spring->reference_q14 - 16384.0 * 44.0 / 175.0 * permille / 1000.0) << 8;
}

static int loss(void)
{
    return -resistance_observer_drift_permille(&spring->observer, &policy.alloy,
                                               spring->reference_q14);
}

/* A hold with the wide margin, just begun. */
static void begin_hold_in_row(uint8_t springs, int permille)
{
    make_row(springs);
    thermal_model_set_temperature(&model, 0, 110 * KELVIN);
    thermal_model_set_temperature(
        &model, 0,
        (int16_t)(thermal_model_transformation(&model, 0).martensite_start_c7 +
                  policy.unsure_margin_c7));
    level[0] = 1000;
    knows(permille);
    read_phase(permille, 1);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
}

static void begin_hold(int permille)
{
    begin_hold_in_row(1, permille);
}

/* The average settles and the margin narrows to so much. */
static void narrow_to(int16_t margin_c7)
{
    for (unsigned n = 0; n < 1000 && spring->margin_c7 > margin_c7; n++) {
        hold_phase(1000, 1);
    }
    TEST_ASSERT_INT16_WITHIN(KELVIN / 4, margin_c7, spring->margin_c7);
}

static void search_down_to(int16_t margin_c7)
{
    begin_hold(1000);
    narrow_to(margin_c7);
    TEST_ASSERT_EQUAL_INT16(0, spring->bias_uw_per_k);
}

static void begin_search(void)
{
    search_down_to(6 * KELVIN);
}

static bool is_just_below_start(void)
{
    int16_t below_c7 = (int16_t)(thermal_model_transformation(&model, 0).martensite_start_c7 -
                                 thermal_model_temperature_c7(&model, 0));
    return below_c7 > 0 && below_c7 < 3 * KELVIN;
}

static bool has_sighted(void)
{
    return spring->margin_c7 == policy.hold_margin_c7 && is_just_below_start();
}

/* A search that has sighted martensite start. */
static void sight(void)
{
    lose(15);
    read_phase(985, 1);
    TEST_ASSERT_TRUE(has_sighted());
}

/* The loss is known and confirmed. */
static void learn(void)
{
    begin_search();
    sight();
    lose(6);
    hold_phase(994, 60);
    TEST_ASSERT_EQUAL_INT16(policy.hold_margin_c7, spring->margin_c7);
}

static void switch_off_and_on(int16_t temperature_c7)
{
    level[0] = 0;
    read_phase(0, 4);
    thermal_model_set_temperature(&model, 0, 110 * KELVIN);
    thermal_model_set_temperature(&model, 0, temperature_c7);
    level[0] = 1000;
    read_phase(1000, 1);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
}

/* ---- sightings ---- */

static void large_loss_is_martensite_start_at_once(void)
{
    begin_search();
    lose(15);
    read_phase(985, 1);
    TEST_ASSERT_TRUE(has_sighted());
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
    TEST_ASSERT_GREATER_THAN_INT16(100, spring->bias_uw_per_k); /* it was colder than the model */
}

static void sighting_makes_the_model_austenite_whatever_it_had(void)
{
    begin_search();
    int16_t there_c7 = thermal_model_temperature_c7(&model, 0);
    for (int16_t t_c7 = thermal_model_transformation(&model, 0).martensite_start_c7;
         thermal_model_austenite(&model, 0) > 30500; t_c7--) {
        thermal_model_set_temperature(&model, 0, t_c7);
    }
    thermal_model_set_temperature(&model, 0, there_c7); /* with 93 % */
    sight();
    TEST_ASSERT_GREATER_THAN_UINT16(32000, thermal_model_austenite(&model, 0));
}

static void small_loss_is_martensite_start_and_a_smaller_one_is_not(void)
{
    begin_search();
    lose(4);
    read_phase(996, 30);
    TEST_ASSERT_FALSE(has_sighted());
    begin_search();
    lose(7);
    read_phase(993, 1);
    TEST_ASSERT_TRUE(has_sighted());
}

static void loss_farther_off_than_any_array_is_followed_as_the_averages_own(void)
{
    search_down_to(11 * KELVIN);
    lose(15);
    read_phase(985, 2);
    TEST_ASSERT_FALSE(has_sighted());
    TEST_ASSERT_LESS_THAN_INT(3, loss());
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
}

static void least_loss_is_no_sighting_however_long(void)
{
    begin_search();
    for (unsigned n = 0; n < 60; n++) {
        lose(1);
        hold_phase(999, 1);
    }
    TEST_ASSERT_EQUAL_INT16(0, spring->bias_uw_per_k);
    TEST_ASSERT_GREATER_THAN_INT16(policy.hold_margin_c7, spring->margin_c7);
}

static void readings_of_a_spring_that_slowly_loses_phase_are_a_sighting(void)
{
    begin_search();
    for (int permille = 1000; permille > 980 && !has_sighted(); permille--) {
        read_phase(permille, 4); /* a permille a second */
    }
    TEST_ASSERT_TRUE(has_sighted());
    TEST_ASSERT_GREATER_THAN_INT16(960, drive_policy_phase_permille(&policy, 0));
}

static void first_doubt_pauses_the_search_at_a_little_more_power(void)
{
    begin_search();
    int16_t margin_c7 = spring->margin_c7;
    hold_phase(1000, 10);
    TEST_ASSERT_LESS_THAN_INT16(margin_c7, spring->margin_c7);
    margin_c7 = spring->margin_c7;
    int16_t there_c7 =
        (int16_t)(thermal_model_transformation(&model, 0).martensite_start_c7 + margin_c7);
    thermal_model_set_temperature(&model, 0, there_c7);
    read_phase(1000, 1);
    margin_c7 = spring->margin_c7;
    uint16_t before_ma = spring->wanted_ma;
    lose(4);
    read_phase(996, 8);
    TEST_ASSERT_EQUAL_INT16(margin_c7, spring->margin_c7);
    TEST_ASSERT_EQUAL_INT16(there_c7, thermal_model_temperature_c7(&model, 0));
    TEST_ASSERT_GREATER_THAN_UINT16(before_ma + 20, spring->wanted_ma);
    TEST_ASSERT_LESS_THAN_UINT16(before_ma + 150, spring->wanted_ma);
    lose(0);
    hold_phase(1000, 10);
    TEST_ASSERT_LESS_THAN_INT16(margin_c7, spring->margin_c7);
}

/* ---- what becomes of a sighting once the average has settled ---- */

static void loss_that_is_still_there_keeps_what_was_learnt(void)
{
    learn();
    int16_t bias = spring->bias_uw_per_k;
    TEST_ASSERT_GREATER_THAN_INT16(100, bias);
    hold_phase(994, 200);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
    TEST_ASSERT_EQUAL_INT16(policy.hold_margin_c7, spring->margin_c7);
    TEST_ASSERT_EQUAL_INT16(bias, spring->bias_uw_per_k);
}

/* A boost that ends at once, then the search down to a margin. */
static void heat_back_and_search_down_to(int16_t margin_c7)
{
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, spring->stage);
    thermal_model_set_temperature(&model, 0, 110 * KELVIN);
    knows(1000);
    read_phase(1000, 8);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
    TEST_ASSERT_LESS_THAN_INT16(policy.unsure_margin_c7, spring->margin_c7);
    narrow_to(margin_c7);
}

static void loss_that_is_gone_is_heated_back_and_believed_when_seen_again(void)
{
    begin_search();
    sight();
    lose(0);
    hold_phase(1000, 60);
    heat_back_and_search_down_to(0);
    sight();
    lose(0); /* and gone again: two are no chance */
    hold_phase(1000, 200);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
    TEST_ASSERT_EQUAL_INT16(policy.hold_margin_c7, spring->margin_c7);
    lose(6); /* a third is a first one again */
    read_phase(994, 1);
    TEST_ASSERT_TRUE(has_sighted());
    lose(0);
    hold_phase(1000, 60);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, spring->stage);
}

static void doubtful_loss_after_a_confirmed_one_is_heated_back(void)
{
    learn();
    lose(6);
    read_phase(994, 1);
    TEST_ASSERT_TRUE(has_sighted());
    lose(0);
    hold_phase(1000, 60);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, spring->stage);
}

static void large_confirmed_loss_is_heated_back(void)
{
    begin_search();
    sight();
    lose(14);
    hold_phase(986, 30);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage); /* not before it is confirmed */
    hold_phase(986, 30);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, spring->stage);
}

static void coasting_from_a_boost_with_a_known_loss_sights_nothing(void)
{
    learn();
    switch_off_and_on(
        (int16_t)(thermal_model_transformation(&model, 0).martensite_start_c7 + 6 * KELVIN));
    TEST_ASSERT_GREATER_THAN_INT16(policy.hold_margin_c7 + 2 * KELVIN, spring->margin_c7);
    knows(1000);
    parameters.search_mk_per_s = 0; /* it stays where it coasts */
    apply();
    hold_phase(1000, 60);
    int16_t temperature_c7 = thermal_model_temperature_c7(&model, 0);
    int16_t bias = spring->bias_uw_per_k;
    lose(8);
    hold_phase(992, 100);
    TEST_ASSERT_EQUAL_INT16(temperature_c7, thermal_model_temperature_c7(&model, 0));
    TEST_ASSERT_EQUAL_INT16(bias, spring->bias_uw_per_k);
    hold_phase(992, 300);
    TEST_ASSERT_LESS_THAN_INT(3, loss()); /* the reference has followed, all the way */
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
}

static void narrow_from(uint16_t unsure_margin_cc, uint16_t hold_margin_cc, int16_t margin_c7)
{
    begin_hold(1000);
    parameters.unsure_margin_cc = unsure_margin_cc;
    parameters.hold_margin_cc = hold_margin_cc;
    apply();
    spring->margin_c7 = policy.unsure_margin_c7;
    narrow_to(margin_c7);
    TEST_ASSERT_EQUAL_INT16(0, spring->bias_uw_per_k);
}

static void wide_and_narrow_margins_are_searched_as_far_as_they_reach(void)
{
    narrow_from(2000, 250, 16 * KELVIN);
    sight();
    narrow_from(50, 50, 0);
    sight();
}

static void sighting_that_is_far_off_is_heated_back_and_looked_for_again(void)
{
    search_down_to(8 * KELVIN);
    sight();
    lose(5); /* this would confirm a nearer one */
    hold_phase(995, 60);
    TEST_ASSERT_GREATER_THAN_INT16(100, spring->bias_uw_per_k);
    heat_back_and_search_down_to(0); /* past the margin of a loss that is known */
    sight();
    hold_phase(1000, 60);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
}

static void once_held_the_reference_follows_only_a_little(void)
{
    learn();
    lose(-12); /* more phase than before, as the average wanders */
    hold_phase(1006, 400);
    TEST_ASSERT_LESS_THAN_INT(-6, loss());
}

static void doubt_when_readings_fail_takes_back_what_was_learnt(void)
{
    begin_search();
    sight();
    TEST_ASSERT_GREATER_THAN_INT16(100, spring->bias_uw_per_k);
    for (unsigned n = 0; n < 8; n++) { /* nothing changes so from one window to the next */
        read_phase(n % 2 == 0 ? -500 : 1000, 1);
    }
    TEST_ASSERT_FALSE(drive_policy_observes(&policy, 0));
    TEST_ASSERT_EQUAL_INT16(0, spring->bias_uw_per_k);
    switch_off_and_on(
        (int16_t)(thermal_model_transformation(&model, 0).martensite_start_c7 + 12 * KELVIN));
    TEST_ASSERT_EQUAL_INT16(policy.unsure_margin_c7, spring->margin_c7);
}

static void failing_readings_leave_a_confirmed_loss(void)
{
    learn();
    int16_t bias = spring->bias_uw_per_k;
    for (unsigned n = 0; n < 8; n++) {
        read_phase(n % 2 == 0 ? -500 : 1000, 1);
    }
    TEST_ASSERT_FALSE(drive_policy_observes(&policy, 0));
    TEST_ASSERT_EQUAL_INT16(bias, spring->bias_uw_per_k);
    switch_off_and_on(
        (int16_t)(thermal_model_transformation(&model, 0).martensite_start_c7 + 12 * KELVIN));
    TEST_ASSERT_LESS_THAN_INT16(policy.unsure_margin_c7, spring->margin_c7);
}

/* A sighting with this margin and bias where the model already is right. */
static int16_t bias_after_sighting(int16_t margin_c7, int16_t bias_uw_per_k)
{
    begin_search();
    spring->margin_c7 = margin_c7;
    spring->bias_uw_per_k = bias_uw_per_k;
    thermal_model_set_temperature(
        &model, 0,
        (int16_t)(thermal_model_transformation(&model, 0).martensite_start_c7 - policy.event_c7));
    sight();
    return spring->bias_uw_per_k;
}

static void bias_seen_while_pulled_below_start_is_less_by_the_fall(void)
{
    TEST_ASSERT_GREATER_THAN_INT16(50, policy.falling_uw_per_k);
    TEST_ASSERT_INT16_WITHIN(2, -1000 + policy.falling_uw_per_k, bias_after_sighting(-90, -1000));
    TEST_ASSERT_EQUAL_INT16(0, bias_after_sighting(-90, -30)); /* and no gain becomes a loss */
    TEST_ASSERT_INT16_WITHIN(2, 500, bias_after_sighting(-90, 500));
    TEST_ASSERT_INT16_WITHIN(2, -1000, bias_after_sighting(KELVIN, -1000)); /* not pulled */
}

/* ---- too little phase in a hold ---- */

/* One window reads so much, whatever was read before. */
static void glance(int permille)
{
    uint8_t fresh = spring->fresh;
    uint32_t slow_q22 = spring->observer.slow_q22;
    for (unsigned n = 0; n < 2u * WINDOW && spring->fresh == fresh; n++) {
        spring->observer.ratio_q14 = (uint16_t)(16384.0 * ohm_of(permille) / ohm_of(0));
        read_ohm(ohm_of(permille));
    }
    spring->observer.slow_q22 = slow_q22;
}

static void one_window_of_too_little_phase_does_not_end_a_hold_several_do(void)
{
    begin_hold(1000);
    hold_phase(1000, 8);
    for (unsigned n = 0; n < 10; n++) {
        glance(850);
        TEST_ASSERT_LESS_THAN_INT16(900, drive_policy_phase_permille(&policy, 0));
        glance(1000);
        TEST_ASSERT_TRUE(drive_policy_observes(&policy, 0));
    }
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
    for (unsigned n = 0; n < 6 && spring->stage == DRIVE_POLICY_STAGE_HOLD; n++) {
        glance(850);
    }
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, spring->stage);
    TEST_ASSERT_TRUE(drive_policy_observes(&policy, 0));
}

static void impossible_loss_lets_go_of_the_reading_and_does_not_heat(void)
{
    begin_hold(300);
    hold_phase(300, 12);
    TEST_ASSERT_FALSE(drive_policy_observes(&policy, 0));
    TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_BLIND, drive_policy_limits(&policy, 0));
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
    /* above austenite finish first, where it is austenite whatever it was */
    TEST_ASSERT_GREATER_THAN_INT16(thermal_model_transformation(&model, 0).austenite_finish_c7,
                                   thermal_model_transformation(&model, 0).martensite_start_c7 +
                                       spring->margin_c7);
}

static void loss_beyond_what_a_search_costs_is_heated_back_at_once(void)
{
    begin_search();
    lose(35);
    read_phase(965, 1);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, spring->stage);
    TEST_ASSERT_TRUE(drive_policy_observes(&policy, 0));
}

static void phase_that_no_hold_can_gain_lets_go_of_the_reading(void)
{
    begin_search();
    lose(-80);
    read_phase(1080, 1);
    TEST_ASSERT_FALSE(drive_policy_observes(&policy, 0));
    TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_BLIND, drive_policy_limits(&policy, 0));
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
}

static void start_that_is_never_seen_lets_go_of_the_reading(void)
{
    search_down_to(0);
    hold_phase(1000, 40); /* and on, half a kelvin below and more */
    TEST_ASSERT_TRUE(drive_policy_observes(&policy, 0));
    TEST_ASSERT_LESS_THAN_INT16(0, spring->bias_uw_per_k); /* the model falls more than it can */
    hold_phase(1000, 1500);
    TEST_ASSERT_FALSE(drive_policy_observes(&policy, 0));
    TEST_ASSERT_EQUAL_INT16(0, spring->bias_uw_per_k);
    TEST_ASSERT_GREATER_OR_EQUAL_INT16(policy.unsure_margin_c7, spring->margin_c7);
}

/* ---- the end of heating ---- */

/* Heating from cold has come to a phase in the model and to another one in the reading. */
static void begin_heating(int model_permille, int permille)
{
    make_row(1);
    level[0] = 1000;
    read_phase(0, 8);
    knows(permille);
    for (int16_t t_c7 = thermal_model_transformation(&model, 0).austenite_start_c7;
         thermal_model_austenite(&model, 0) * 1000 / 32768 < model_permille; t_c7++) {
        thermal_model_set_temperature(&model, 0, t_c7);
    }
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, spring->stage);
}

static void resistance_that_stands_still_ends_a_heating_though_the_model_lags(void)
{
    begin_heating(800, 850);
    read_phase(850, 4);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, spring->stage);
    TEST_ASSERT_LESS_THAN_INT16(thermal_model_transformation(&model, 0).austenite_finish_c7 -
                                    KELVIN,
                                thermal_model_temperature_c7(&model, 0));
    read_phase(850, 8);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
    TEST_ASSERT_INT16_WITHIN(4, thermal_model_transformation(&model, 0).austenite_finish_c7,
                             thermal_model_temperature_c7(&model, 0));
}

static void resistance_that_still_rises_does_not_end_a_heating(void)
{
    begin_heating(600, 600);
    for (int permille = 600; permille < 840; permille += 20) { /* 25 permille a window and less */
        read_phase(permille, 1);
    }
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, spring->stage);
}

static void spring_that_waits_for_supply_has_not_finished_heating(void)
{
    begin_heating(800, 850);
    supply_limit_ma = 2200; /* so that it has 2 A of 3 */
    read_phase(850, 40);
    TEST_ASSERT_GREATER_THAN_UINT16(1900, target_ma[0]);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, spring->stage);
}

static void nearly_all_the_current_it_asks_for_is_enough_to_finish_heating(void)
{
    begin_heating(800, 850);
    supply_limit_ma = 3000; /* so that it has 2.8 A of 3 */
    read_phase(850, 12);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
}

static void more_than_fully_on_says_nothing_of_the_temperature(void)
{
    begin_heating(1000, 1100);
    int16_t before_c7 = thermal_model_temperature_c7(&model, 0);
    read_phase(1100, 1);
    TEST_ASSERT_TRUE(drive_policy_observes(&policy, 0));
    TEST_ASSERT_EQUAL_INT16(before_c7, thermal_model_temperature_c7(&model, 0));
}

static void what_it_read_when_it_had_transformed_is_fully_on_when_heated_again(void)
{
    begin_heating(985, 880);
    spring->full_permille = 880;
    int16_t before_c7 = thermal_model_temperature_c7(&model, 0);
    read_phase(880, 1);
    TEST_ASSERT_EQUAL_INT16(before_c7, thermal_model_temperature_c7(&model, 0));
}

static void too_little_phase_until_heating_goes_on_changes_nothing(void)
{
    begin_heating(950, 850);
    int16_t temperature_c7 =
        (int16_t)(thermal_model_transformation(&model, 0).austenite_start_c7 + 2 * KELVIN);
    thermal_model_set_temperature(&model, 0, temperature_c7);
    uint16_t austenite = thermal_model_austenite(&model, 0);
    read_phase(850, 8);
    TEST_ASSERT_EQUAL_INT16(temperature_c7, thermal_model_temperature_c7(&model, 0));
    TEST_ASSERT_EQUAL_UINT16(austenite, thermal_model_austenite(&model, 0));
}

/* The same at a temperature to which it has cooled with the phase that it has. */
static drive_policy_stage_t stage_of_rest_at(int16_t temperature_c7)
{
    begin_heating(850, 850);
    thermal_model_set_temperature(&model, 0, temperature_c7);
    read_phase(850, 40);
    TEST_ASSERT_TRUE(drive_policy_observes(&policy, 0));
    return (drive_policy_stage_t)spring->stage;
}

static void phase_that_rests_until_heating_goes_on_has_not_finished(void)
{
    TEST_ASSERT_EQUAL(
        DRIVE_POLICY_STAGE_HEAT,
        stage_of_rest_at(
            (int16_t)(thermal_model_transformation(&model, 0).austenite_start_c7 - 3 * KELVIN)));
    TEST_ASSERT_EQUAL(
        DRIVE_POLICY_STAGE_HEAT,
        stage_of_rest_at(
            (int16_t)(thermal_model_transformation(&model, 0).austenite_start_c7 + 4 * KELVIN)));
}

static void model_takes_half_of_what_the_phase_is_off_beyond_the_deadband(void)
{
    begin_heating(300, 330);
    int16_t before_c7 = thermal_model_temperature_c7(&model, 0);
    read_phase(330, 2);
    TEST_ASSERT_EQUAL_INT16(before_c7, thermal_model_temperature_c7(&model, 0));
    begin_heating(300, 500); /* 160 permille of 10 K */
    before_c7 = thermal_model_temperature_c7(&model, 0);
    read_phase(500, 1);
    TEST_ASSERT_INT16_WITHIN(KELVIN / 2, 4 * KELVIN / 5,
                             thermal_model_temperature_c7(&model, 0) - before_c7);
}

static void phase_below_austenite_start_shows_that_the_spring_is_hotter(void)
{
    begin_heating(0, 150);
    thermal_model_set_temperature(
        &model, 0,
        (int16_t)(thermal_model_transformation(&model, 0).austenite_start_c7 - 5 * KELVIN));
    read_phase(150, 1);
    TEST_ASSERT_INT16_WITHIN(KELVIN,
                             thermal_model_transformation(&model, 0).austenite_start_c7 + KELVIN,
                             thermal_model_temperature_c7(&model, 0));
}

static void too_little_phase_below_austenite_start_changes_nothing(void)
{
    begin_heating(850, 600);
    int16_t temperature_c7 =
        (int16_t)(thermal_model_transformation(&model, 0).austenite_start_c7 - 3 * KELVIN);
    thermal_model_set_temperature(&model, 0, temperature_c7);
    uint16_t austenite = thermal_model_austenite(&model, 0);
    read_phase(600, 40);
    TEST_ASSERT_TRUE(drive_policy_observes(&policy, 0));
    TEST_ASSERT_EQUAL_INT16(temperature_c7, thermal_model_temperature_c7(&model, 0));
    TEST_ASSERT_EQUAL_UINT16(austenite, thermal_model_austenite(&model, 0));
}

static void certain_martensite_teaches_the_scale_and_corrects_nothing(void)
{
    begin_heating(0, 300);
    int16_t temperature_c7 =
        (int16_t)(thermal_model_transformation(&model, 0).austenite_start_c7 - 30 * KELVIN);
    thermal_model_set_temperature(&model, 0, temperature_c7);
    read_phase(300, 2);
    TEST_ASSERT_TRUE(drive_policy_observes(&policy, 0));
    TEST_ASSERT_GREATER_THAN_INT16(150, drive_policy_phase_permille(&policy, 0));
    read_phase(300, 60);
    TEST_ASSERT_INT16_WITHIN(15, 0, drive_policy_phase_permille(&policy, 0));
    TEST_ASSERT_EQUAL_INT16(temperature_c7, thermal_model_temperature_c7(&model, 0));
    TEST_ASSERT_EQUAL_UINT16(0, thermal_model_austenite(&model, 0));
}

static void spring_held_at_a_level_is_heated_once_fully_on_is_wanted(void)
{
    begin_heating(500, 500);
    level[0] = 500;
    read_phase(500, 1);
    hold_phase(500, 20);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
    level[0] = 1000;
    read_phase(500, 8);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, spring->stage);
    TEST_ASSERT_TRUE(drive_policy_observes(&policy, 0));
}

/* What it reads at half is as far from the declared as what it read when fully on. */
static void level_is_held_of_what_the_spring_read_when_fully_on(void)
{
    begin_heating(500, 590);
    spring->full_permille = 1150;
    level[0] = 500;
    read_phase(590, 1);
    for (unsigned n = 0; n < 20; n++) {
        hold_phase(590, 1);
        TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
    }
}

/* Stage of a spring that read so much when it had transformed, and goes on to. */
static drive_policy_stage_t stage_of_hold_at(int permille)
{
    begin_heating(permille, permille);
    for (unsigned n = 0; n < 16u * WINDOW && spring->stage == DRIVE_POLICY_STAGE_HEAT; n++) {
        read_ohm(ohm_of(permille));
    }
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
    hold_phase(permille, 8);
    return (drive_policy_stage_t)spring->stage;
}

static void what_a_spring_reads_when_transformed_is_its_own_fully_on(void)
{
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, stage_of_hold_at(900));
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, stage_of_hold_at(800));
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, stage_of_hold_at(640)); /* this is not fully on */
}

/* ---- while others have the supply ---- */

static uint16_t current_at(int16_t margin_c7)
{
    thermal_model_set_temperature(
        &model, 0,
        (int16_t)(thermal_model_transformation(&model, 0).martensite_start_c7 + margin_c7));
    read_phase(1000, 2);
    return spring->wanted_ma;
}

static void margin_of_a_spring_that_coasts_grows_with_what_the_model_does_not_know(void)
{
    begin_hold_in_row(2, 1000);
    level[1] = 1000;
    (void)current_at(6 * KELVIN);
    uint16_t first_ma = current_at(6 * KELVIN);
    for (unsigned n = 0; n < 120; n++) { /* half a minute: 2 K */
        (void)current_at(6 * KELVIN);
    }
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, policy.spring[1].stage);
    TEST_ASSERT_GREATER_THAN_UINT16(first_ma + 50, spring->wanted_ma);
    TEST_ASSERT_EQUAL_INT16(policy.unsure_margin_c7, spring->margin_c7);
}

static void spring_that_has_coasted_looks_for_a_reference_only_then(void)
{
    begin_hold_in_row(2, 1000);
    level[1] = 1000;
    hold_phase(1000, 80);
    TEST_ASSERT_EQUAL_INT16(policy.unsure_margin_c7, spring->margin_c7);
    level[1] = 0;
    hold_phase(1000, 30);
    TEST_ASSERT_EQUAL_INT16(policy.unsure_margin_c7, spring->margin_c7);
    hold_phase(1000, 30);
    TEST_ASSERT_LESS_THAN_INT16(policy.unsure_margin_c7, spring->margin_c7);
}

static void search_that_has_begun_goes_on_while_another_spring_heats(void)
{
    begin_hold_in_row(2, 1000);
    hold_phase(1000, 60);
    uint16_t before_ma = current_at(spring->margin_c7);
    int16_t before_c7 = spring->margin_c7;
    level[1] = 1000;
    read_phase(1000, 4);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, policy.spring[1].stage);
    TEST_ASSERT_UINT16_WITHIN(60, before_ma, current_at(spring->margin_c7));
    hold_phase(1000, 40);
    TEST_ASSERT_LESS_THAN_INT16(before_c7 - KELVIN / 2, spring->margin_c7);
}

static void margin_that_the_supply_does_not_reach_narrows(void)
{
    begin_hold(1000);
    supply_limit_ma = (uint16_t)(parameters.supply_reserve_ma + 1000u);
    for (unsigned n = 0; n < 120; n++) {
        (void)current_at(8 * KELVIN);
    }
    TEST_ASSERT_LESS_THAN_UINT16(spring->asked_ma, spring->granted_ma);
    TEST_ASSERT_LESS_THAN_INT16(policy.unsure_margin_c7 - KELVIN, spring->margin_c7);
}

static void spring_that_waits_to_be_heated_again_keeps_its_holds_current(void)
{
    make_row(3);
    parameters.dither_ma = 0;
    apply();
    level[1] = 1000;
    read_phase(1000, 4);
    thermal_model_set_temperature(&model, 0, 110 * KELVIN);
    thermal_model_set_temperature(
        &model, 0,
        (int16_t)(thermal_model_transformation(&model, 0).martensite_start_c7 + 5 * KELVIN));
    knows(1000);
    level[0] = 1000;
    hold_phase(1000, 8);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
    spring->margin_c7 = policy.hold_margin_c7; /* no more to coast */
    hold_phase(1000, 4);
    uint16_t held_ma = spring->granted_ma;
    TEST_ASSERT_GREATER_THAN_UINT16(1000, held_ma);
    /* a boost and this hold */
    supply_limit_ma =
        (uint16_t)(parameters.boost_current_ma + held_ma + 100u + parameters.supply_reserve_ma);
    level[2] = 1000; /* would take what is left */
    hold_phase(1000, 4);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, spring->stage);
    knows(850);
    for (unsigned n = 0; n < 8u * WINDOW && spring->stage == DRIVE_POLICY_STAGE_HOLD; n++) {
        read_ohm(ohm_of(850));
    }
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HEAT, spring->stage);
    for (unsigned n = 0; n < 40u * WINDOW; n++) {
        read_ohm(ohm_of(850));
        TEST_ASSERT_UINT16_WITHIN(held_ma / 4, held_ma, target_ma[0]);
        TEST_ASSERT_GREATER_THAN_UINT16(2900, target_ma[1]);
        TEST_ASSERT_EQUAL_UINT16(0, target_ma[2]);
    }
    TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_SUPPLY, drive_policy_limits(&policy, 0));
    level[1] = level[2] = 0;
    read_phase(850, 4);
    TEST_ASSERT_GREATER_THAN_UINT16(2900, target_ma[0]);
}

void run_hold_tests(void)
{
    Unity.TestFile = __FILE__;
    RUN_TEST(large_loss_is_martensite_start_at_once);
    RUN_TEST(sighting_makes_the_model_austenite_whatever_it_had);
    RUN_TEST(small_loss_is_martensite_start_and_a_smaller_one_is_not);
    RUN_TEST(loss_farther_off_than_any_array_is_followed_as_the_averages_own);
    RUN_TEST(least_loss_is_no_sighting_however_long);
    RUN_TEST(readings_of_a_spring_that_slowly_loses_phase_are_a_sighting);
    RUN_TEST(first_doubt_pauses_the_search_at_a_little_more_power);
    RUN_TEST(loss_that_is_still_there_keeps_what_was_learnt);
    RUN_TEST(loss_that_is_gone_is_heated_back_and_believed_when_seen_again);
    RUN_TEST(doubtful_loss_after_a_confirmed_one_is_heated_back);
    RUN_TEST(large_confirmed_loss_is_heated_back);
    RUN_TEST(coasting_from_a_boost_with_a_known_loss_sights_nothing);
    RUN_TEST(wide_and_narrow_margins_are_searched_as_far_as_they_reach);
    RUN_TEST(sighting_that_is_far_off_is_heated_back_and_looked_for_again);
    RUN_TEST(once_held_the_reference_follows_only_a_little);
    RUN_TEST(doubt_when_readings_fail_takes_back_what_was_learnt);
    RUN_TEST(failing_readings_leave_a_confirmed_loss);
    RUN_TEST(bias_seen_while_pulled_below_start_is_less_by_the_fall);
    RUN_TEST(one_window_of_too_little_phase_does_not_end_a_hold_several_do);
    RUN_TEST(impossible_loss_lets_go_of_the_reading_and_does_not_heat);
    RUN_TEST(loss_beyond_what_a_search_costs_is_heated_back_at_once);
    RUN_TEST(phase_that_no_hold_can_gain_lets_go_of_the_reading);
    RUN_TEST(start_that_is_never_seen_lets_go_of_the_reading);
    RUN_TEST(resistance_that_stands_still_ends_a_heating_though_the_model_lags);
    RUN_TEST(resistance_that_still_rises_does_not_end_a_heating);
    RUN_TEST(spring_that_waits_for_supply_has_not_finished_heating);
    RUN_TEST(nearly_all_the_current_it_asks_for_is_enough_to_finish_heating);
    RUN_TEST(more_than_fully_on_says_nothing_of_the_temperature);
    RUN_TEST(what_it_read_when_it_had_transformed_is_fully_on_when_heated_again);
    RUN_TEST(too_little_phase_until_heating_goes_on_changes_nothing);
    RUN_TEST(phase_that_rests_until_heating_goes_on_has_not_finished);
    RUN_TEST(model_takes_half_of_what_the_phase_is_off_beyond_the_deadband);
    RUN_TEST(phase_below_austenite_start_shows_that_the_spring_is_hotter);
    RUN_TEST(too_little_phase_below_austenite_start_changes_nothing);
    RUN_TEST(certain_martensite_teaches_the_scale_and_corrects_nothing);
    RUN_TEST(spring_held_at_a_level_is_heated_once_fully_on_is_wanted);
    RUN_TEST(level_is_held_of_what_the_spring_read_when_fully_on);
    RUN_TEST(what_a_spring_reads_when_transformed_is_its_own_fully_on);
    RUN_TEST(margin_of_a_spring_that_coasts_grows_with_what_the_model_does_not_know);
    RUN_TEST(spring_that_has_coasted_looks_for_a_reference_only_then);
    RUN_TEST(search_that_has_begun_goes_on_while_another_spring_heats);
    RUN_TEST(margin_that_the_supply_does_not_reach_narrows);
    RUN_TEST(spring_that_waits_to_be_heated_again_keeps_its_holds_current);
}
