/* Worlds and faults that nobody told the board of: from power-on, with the README's words and no
 * hint. No spring becomes too hot, none acts that was not asked to, and each is where it was asked
 * to be, or that is said. */
#include <functional>

#include "board_test.h"

using namespace board_test;

namespace
{

constexpr unsigned SPRINGS = BOARD_CHANNELS;
constexpr unsigned CENTRE = 4;
constexpr double HOTTEST_C = 120.0;
constexpr unsigned FIRST_START_S = 180; /* of a board that has learnt nothing */
constexpr double ON = 0.95;
constexpr double LEFT = 0.9;      /* below it, it has left */
constexpr unsigned UNSAID_S = 20; /* for so long it may have, without a word */
constexpr double UNDRIVEN_ON = 0.05;
constexpr double FAULT_MS = 2000.0; /* in which what cannot be a circuit has its fault */
/* What says on the console and in telemetry that a spring is not where it was asked to be. */
constexpr unsigned SAYS = DRIVE_POLICY_LIMIT_SAFETY | DRIVE_POLICY_LIMIT_TRIP |
                          DRIVE_POLICY_LIMIT_BLIND | DRIVE_POLICY_LIMIT_COOLING |
                          DRIVE_POLICY_LIMIT_AWAY;

using differs_t = std::function<void(plant_t *)>;

void set(plant_t *plant, const char *name, double value)
{
    TEST_ASSERT_EQUAL_MESSAGE(PLANT_OK, plant_set(plant, name, value), name);
}

/* A board around nine springs that differ from what is declared; the README's words are typed. */
class world
{
public:
    explicit world(const differs_t &differs = {}, double shunt_noise_v = 0.0,
                   double bus_noise_v = 0.0)
        : mega(elf(), 1, shunt_noise_v, bus_noise_v)
    {
        make_niti(plant());
        if (differs) {
            differs(plant());
        }
        plant_reset(plant());
        mega.boot(false);
        mega.expect_ok("pattern 111101111");
        mega.expect_ok("policy precompensate");
    }

    plant_t *plant() { return mega.plant.get(); }
    double phase(unsigned k) { return board_test::phase(mega, k); }
    std::string what() { return mega.say("faults") + mega.say("model"); }

    /* Goes on to a time since power-on, and looks once a second. */
    void until(unsigned end_s)
    {
        for (; now_s_ < end_s; ++now_s_) {
            mega.run_ms(1000.0);
            const board_view_t seen = mega.view();
            for (unsigned k = 0; k < SPRINGS; ++k) {
                TEST_ASSERT_TRUE_MESSAGE(
                    plant_temperature_c(plant(), static_cast<int>(k)) < HOTTEST_C, what().c_str());
                if (k != CENTRE) {
                    look_at_driven(k, seen.spring[k]);
                }
            }
            TEST_ASSERT_TRUE_MESSAGE(phase(CENTRE) < UNDRIVEN_ON, what().c_str());
        }
    }

    void expect_eight_on()
    {
        for (unsigned k = 0; k < SPRINGS; ++k) {
            TEST_ASSERT_TRUE_MESSAGE(k == CENTRE || phase(k) >= ON, what().c_str());
        }
    }

    /* Spring 1 and no other; the others have at least so much austenite. */
    void expect_only_the_first(safety_fault_t fault, double least = ON)
    {
        const board_view_t seen = mega.view();
        TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, seen.board_fault);
        for (unsigned k = 0; k < SPRINGS; ++k) {
            TEST_ASSERT_EQUAL_UINT8_MESSAGE(k == 0 ? fault : SAFETY_FAULT_NONE,
                                            seen.spring[k].fault, what().c_str());
            if (k == 0 && fault != SAFETY_FAULT_NONE) {
                TEST_ASSERT_TRUE(board_duty(mega.raw(), 0) == 0.0);
            } else if (k != CENTRE) {
                TEST_ASSERT_TRUE_MESSAGE(phase(k) >= least, what().c_str());
            }
        }
    }

    /* Of what `model` prints: "spring 1: 80.9 degC, 66.4 to 95.3, ...". */
    void expect_truth_within_bounds()
    {
        const std::string model = mega.say("model");
        for (unsigned k = 0; k < SPRINGS; ++k) {
            const std::size_t at = model.find("spring " + std::to_string(k + 1) + ": ");
            double value_c = 0.0, low_c = 0.0, high_c = 0.0;
            TEST_ASSERT_TRUE(at != std::string::npos);
            TEST_ASSERT_EQUAL_INT(3, std::sscanf(model.c_str() + at,
                                                 "spring %*u: %lf degC, %lf to %lf", &value_c,
                                                 &low_c, &high_c));
            const double true_c = plant_temperature_c(plant(), static_cast<int>(k));
            TEST_ASSERT_TRUE_MESSAGE(low_c <= true_c && true_c <= high_c, model.c_str());
            TEST_ASSERT_TRUE(low_c <= value_c && value_c <= high_c);
        }
    }

    /* Heatings that have begun so far, of all springs. */
    unsigned heatings() const { return heatings_; }

    rig mega;

private:
    void look_at_driven(unsigned k, const board_view_spring_t &seen)
    {
        arrived_[k] = arrived_[k] || phase(k) >= ON;
        const bool missing = arrived_[k] ? phase(k) < LEFT : now_s_ >= FIRST_START_S;
        const bool said = seen.fault != SAFETY_FAULT_NONE || (seen.limits & SAYS) != 0;
        unsaid_s_[k] = missing && !said ? unsaid_s_[k] + 1 : 0;
        TEST_ASSERT_TRUE_MESSAGE(unsaid_s_[k] <= UNSAID_S, what().c_str());
        const bool heats = seen.stage == DRIVE_POLICY_STAGE_HEAT;
        heatings_ += heats && !heated_[k] ? 1u : 0u;
        heated_[k] = heats;
    }

    unsigned now_s_ = 0;
    unsigned heatings_ = 0;
    unsigned unsaid_s_[SPRINGS] = {};
    bool arrived_[SPRINGS] = {};
    bool heated_[SPRINGS] = {};
};

/* ---- arrays and rooms ---- */

void eight_come_and_stay(const differs_t &differs, unsigned by_s, unsigned end_s,
                         double shunt_noise_v = 0.0, double bus_noise_v = 0.0)
{
    world w(differs, shunt_noise_v, bus_noise_v);
    w.until(by_s);
    w.expect_eight_on();
    w.until(end_s);
    w.expect_only_the_first(SAFETY_FAULT_NONE);
    w.expect_truth_within_bounds();
}

void a_resistance_that_rises_with_temperature_overheats_nothing()
{
    for (const double rise_per_k : {0.0004, 0.0006, 0.001}) {
        eight_come_and_stay(
            [rise_per_k](plant_t *plant) {
                switch_on(plant, "resistance_temperature");
                set(plant, "resistance_martensite_rise_per_k", rise_per_k);
                set(plant, "resistance_austenite_rise_per_k", rise_per_k);
            },
            FIRST_START_S, 300);
    }
}

void a_resistance_that_falls_where_it_should_rise_is_no_loss_of_phase()
{
    eight_come_and_stay(
        [](plant_t *plant) { set(plant, "resistance_austenite_ohm", 0.85 * 0.175); }, FIRST_START_S,
        400);
}

/* One conversion: 4 mV, and 0.4 mV on the shunt, 4 mA. */
void noise_of_a_step_of_the_sensor_is_no_loss_of_phase()
{
    eight_come_and_stay({}, FIRST_START_S, 300, 0.4e-3, 4e-3);
}

/* A supply at either end of what is declared. */
void another_supply_is_no_fault()
{
    for (const double supply_v : {4.2, 5.5}) {
        eight_come_and_stay([supply_v](plant_t *plant) { set(plant, "supply_v", supply_v); },
                            FIRST_START_S, 200);
    }
}

void a_room_ten_kelvin_warmer_than_the_setting_leaves_no_spring_unsettled()
{
    world w([](plant_t *plant) { set(plant, "ambient_c", 30.0); });
    w.until(600);
    w.expect_eight_on();
    const unsigned before = w.heatings();
    w.until(1200);
    w.expect_only_the_first(SAFETY_FAULT_NONE);
    TEST_ASSERT_LESS_OR_EQUAL_UINT(8u * 2u / 6u, w.heatings() - before); /* two an hour */
}

/* ---- a touch ---- */

void a_fingertip_on_every_spring_is_lived_with_within_bounds()
{
    world w;
    w.until(200);
    w.expect_eight_on();
    switch_on(w.plant(), "transformation_shift");
    set(w.plant(), "transformation_shift_k", 8.0);
    w.until(500);
    /* 5 % of phase are as much as a line differs by from one heating to the next */
    w.expect_only_the_first(SAFETY_FAULT_NONE, LEFT);
    w.expect_truth_within_bounds();
}

/* ---- sensors ---- */

/* It acknowledges, converts, and shows the same for ever. */
void a_sensor_that_freezes_while_its_spring_is_driven_is_found_in_two_seconds()
{
    for (const unsigned frozen_s : {112u, 250u}) { /* it heats; it is held */
        world w;
        w.until(frozen_s);
        TEST_ASSERT_TRUE(board_duty(w.mega.raw(), 0) > 0.0);
        board_set_fault(w.mega.raw(), BOARD_FAULT_FREEZE, 0, true);
        w.mega.run_ms(FAULT_MS);
        TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_SENSOR_MISMATCH, w.mega.view().spring[0].fault);
        const std::string faults = w.mega.say("faults");
        TEST_ASSERT_TRUE_MESSAGE(contains(faults, "spring 1: fault 15 sensor_mismatch"),
                                 faults.c_str());
        w.until(300);
        w.expect_only_the_first(SAFETY_FAULT_SENSOR_MISMATCH);
    }
}

/* It shows no current, and so it does for ever: as a broken spring would. */
void a_sensor_that_froze_while_the_board_waited_is_found_when_its_spring_is_driven()
{
    for (const unsigned frozen_s : {45u, 100u}) {
        world w;
        w.until(frozen_s);
        TEST_ASSERT_TRUE(board_duty(w.mega.raw(), 0) == 0.0);
        board_set_fault(w.mega.raw(), BOARD_FAULT_FREEZE, 0, true);
        w.until(FIRST_START_S);
        const int fault = w.mega.view().spring[0].fault;
        TEST_ASSERT_TRUE_MESSAGE(fault == SAFETY_FAULT_OPEN_SPRING ||
                                     fault == SAFETY_FAULT_SENSOR_MISMATCH,
                                 w.what().c_str());
        TEST_ASSERT_TRUE(plant_temperature_c(w.plant(), 0) < 60.0); /* it never got warm */
        w.until(240);
        w.expect_only_the_first(static_cast<safety_fault_t>(fault));
    }
}

void sensors_that_are_swapped_switch_their_springs_off_in_two_seconds()
{
    for (const unsigned other : {1u, CENTRE}) { /* a driven one; one that is off */
        world w;
        w.until(200);
        board_swap_sensors(w.mega.raw(), 0, other);
        w.mega.run_ms(FAULT_MS);
        const board_view_t seen = w.mega.view();
        TEST_ASSERT_TRUE(seen.spring[other].fault != SAFETY_FAULT_NONE);
        /* current where nothing is driven switches all off, before the other is named */
        TEST_ASSERT_TRUE(seen.spring[0].fault != SAFETY_FAULT_NONE ||
                         seen.spring[other].fault == SAFETY_FAULT_STUCK_ON);
        TEST_ASSERT_TRUE(board_duty(w.mega.raw(), 0) == 0.0);
        TEST_ASSERT_TRUE(board_duty(w.mega.raw(), other) == 0.0);
    }
}

/* Within what can be a circuit, and bounded: a fifth too little of either. */
void a_sensor_that_shows_a_fifth_too_little_overheats_nothing()
{
    world w;
    board_scale_sensor(w.mega.raw(), 0, 0.8, 0.8);
    w.until(300);
}

/* The near miss of all of them: gains and offsets as its data sheet allows. */
void a_sensor_within_its_data_sheet_is_no_fault()
{
    world w;
    board_scale_sensor(w.mega.raw(), 0, 0.97, 1.03);
    w.until(FIRST_START_S);
    w.expect_eight_on();
    w.until(400);
    w.expect_only_the_first(SAFETY_FAULT_NONE);
}

} // namespace

void setUp() {}
void tearDown() {}

int main()
{
    need_elf(elf());
    UNITY_BEGIN();
    RUN_TEST(a_resistance_that_rises_with_temperature_overheats_nothing);
    RUN_TEST(a_resistance_that_falls_where_it_should_rise_is_no_loss_of_phase);
    RUN_TEST(noise_of_a_step_of_the_sensor_is_no_loss_of_phase);
    RUN_TEST(another_supply_is_no_fault);
    RUN_TEST(a_room_ten_kelvin_warmer_than_the_setting_leaves_no_spring_unsettled);
    RUN_TEST(a_fingertip_on_every_spring_is_lived_with_within_bounds);
    RUN_TEST(a_sensor_that_freezes_while_its_spring_is_driven_is_found_in_two_seconds);
    RUN_TEST(a_sensor_that_froze_while_the_board_waited_is_found_when_its_spring_is_driven);
    RUN_TEST(sensors_that_are_swapped_switch_their_springs_off_in_two_seconds);
    RUN_TEST(a_sensor_that_shows_a_fifth_too_little_overheats_nothing);
    RUN_TEST(a_sensor_within_its_data_sheet_is_no_fault);
    return UNITY_END();
}
