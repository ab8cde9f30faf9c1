/* Worlds and faults that nobody told the board of: from power-on, with the README's words and no
 * hint. No spring becomes too hot, none acts that was not asked to, and each is where it was asked
 * to be, or that is said. board_native holds this loop to the ELF. */
#include <cmath>
#include <functional>
#include <memory>
#include <string>

#include "../run_tests.h"

#include "loop.h"

namespace
{

constexpr int SPRINGS = 9;
constexpr int CENTRE = 4;
constexpr double HOTTEST_C = 120.0;
constexpr unsigned FIRST_START_S = 180; /* of a board that has learnt nothing */
constexpr double ON = 0.95;
constexpr double LEFT = 0.9;      /* below it, it has left */
constexpr unsigned UNSAID_S = 20; /* for so long it may have, without a word */
constexpr double UNDRIVEN_ON = 0.05;
constexpr double FAULT_S = 2.0; /* in which what cannot be a circuit has its fault */
/* What says on the console and in telemetry that a spring is not where it was asked to be. */
constexpr unsigned SAYS = DRIVE_POLICY_LIMIT_SAFETY | DRIVE_POLICY_LIMIT_TRIP |
                          DRIVE_POLICY_LIMIT_BLIND | DRIVE_POLICY_LIMIT_COOLING |
                          DRIVE_POLICY_LIMIT_AWAY;

struct deleter {
    void operator()(plant_t *plant) const { plant_destroy(plant); }
    void operator()(loop_t *loop) const { loop_destroy(loop); }
};

using differs_t = std::function<void(plant_t *)>;

void set(plant_t *plant, const char *name, double value)
{
    TEST_ASSERT_EQUAL_MESSAGE(PLANT_OK, plant_set(plant, name, value), name);
}

void switch_on(plant_t *plant, const char *effect)
{
    TEST_ASSERT_EQUAL_MESSAGE(PLANT_OK, plant_set_effect(plant, effect, true), effect);
}

/* A board around nine springs that differ from what is declared, told what the README types. */
class world
{
public:
    explicit world(const differs_t &differs = {}, double ambient_error_c = 0.0)
    {
        std::unique_ptr<plant_t, deleter> drawn(plant_create(3, 3));
        switch_on(drawn.get(), "latent_heat");
        switch_on(drawn.get(), "resistance_phase");
        if (differs) {
            differs(drawn.get());
        }
        plant_reset(drawn.get());
        controller_settings_t settings;
        controller_settings_default(&settings);
        settings.policy.policy = DRIVE_POLICY_PRECOMPENSATE;
        loop_options_t options;
        loop_options_default(&options);
        options.ambient_error_c = ambient_error_c;
        loop.reset(loop_create(&settings, drawn.get(), &options, 1, nullptr));
        TEST_ASSERT_NOT_NULL(loop.get());
        bool on[CONTROLLER_MAX_SPRINGS] = {};
        for (int k = 0; k < SPRINGS; ++k) {
            on[k] = k != CENTRE;
        }
        controller_set_pattern(chip(), on);
    }

    controller_t *chip() { return loop_controller(loop.get()); }
    plant_t *plant() { return loop_plant(loop.get()); }
    double phase(int k) { return plant_austenite(plant(), k); }
    bool driven(int k) { return controller_duty(chip(), static_cast<std::uint8_t>(k)) > 0; }
    safety_fault_t fault(int k) { return controller_fault(chip(), static_cast<std::uint8_t>(k)); }
    std::string what()
    {
        std::string text;
        for (int k = 0; k < SPRINGS; ++k) {
            const auto one = static_cast<std::uint8_t>(k);
            text += "spring " + std::to_string(k + 1) + ": fault " + std::to_string(fault(k)) +
                    ", limits " + std::to_string(controller_limits(chip(), one)) + ", " +
                    std::to_string(plant_temperature_c(plant(), k)) + " degC, austenite " +
                    std::to_string(phase(k)) + "\n";
        }
        return text;
    }

    /* Goes on to a time since power-on, and looks once a second. */
    void until(unsigned end_s)
    {
        for (; now_s_ < end_s; ++now_s_) {
            loop_advance(loop.get(), 1.0);
            for (int k = 0; k < SPRINGS; ++k) {
                TEST_ASSERT_TRUE_MESSAGE(plant_temperature_c(plant(), k) < HOTTEST_C,
                                         what().c_str());
                if (k != CENTRE) {
                    look_at_driven(k);
                }
            }
            TEST_ASSERT_TRUE_MESSAGE(phase(CENTRE) < UNDRIVEN_ON, what().c_str());
        }
    }

    void expect_eight_on()
    {
        for (int k = 0; k < SPRINGS; ++k) {
            TEST_ASSERT_TRUE_MESSAGE(k == CENTRE || phase(k) >= ON, what().c_str());
        }
    }

    /* Spring 1 and no other; the others have at least so much austenite. */
    void expect_only_the_first(safety_fault_t wanted, double least = ON)
    {
        TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(chip()));
        for (int k = 0; k < SPRINGS; ++k) {
            TEST_ASSERT_EQUAL_MESSAGE(k == 0 ? wanted : SAFETY_FAULT_NONE, fault(k),
                                      what().c_str());
            if (k == 0 && wanted != SAFETY_FAULT_NONE) {
                TEST_ASSERT_FALSE(driven(0));
            } else if (k != CENTRE) {
                TEST_ASSERT_TRUE_MESSAGE(phase(k) >= least, what().c_str());
            }
        }
    }

    /* As `model` prints them. */
    void expect_truth_within_bounds()
    {
        for (int k = 0; k < SPRINGS; ++k) {
            const spring_bounds_t bounds =
                controller_temperature_bounds_c(chip(), static_cast<std::uint8_t>(k));
            const double true_c = plant_temperature_c(plant(), k);
            TEST_ASSERT_TRUE_MESSAGE(static_cast<double>(bounds.low) <= true_c &&
                                         true_c <= static_cast<double>(bounds.high),
                                     what().c_str());
            TEST_ASSERT_TRUE(bounds.low <= bounds.value && bounds.value <= bounds.high);
        }
    }

    /* Heatings that have begun so far, of all springs. */
    unsigned heatings() const { return heatings_; }

    std::unique_ptr<loop_t, deleter> loop;

private:
    void look_at_driven(int k)
    {
        const auto one = static_cast<std::uint8_t>(k);
        arrived_[k] = arrived_[k] || phase(k) >= ON;
        const bool missing = arrived_[k] ? phase(k) < LEFT : now_s_ >= FIRST_START_S;
        const bool said =
            fault(k) != SAFETY_FAULT_NONE || (controller_limits(chip(), one) & SAYS) != 0;
        unsaid_s_[k] = missing && !said ? unsaid_s_[k] + 1 : 0;
        TEST_ASSERT_TRUE_MESSAGE(unsaid_s_[k] <= UNSAID_S, what().c_str());
        const bool heats = controller_stage(chip(), one) == DRIVE_POLICY_STAGE_HEAT;
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

void eight_come_and_stay(const differs_t &differs, unsigned end_s)
{
    world w(differs);
    w.until(FIRST_START_S);
    w.expect_eight_on();
    w.until(end_s);
    w.expect_only_the_first(SAFETY_FAULT_NONE);
    w.expect_truth_within_bounds();
}

TEST(a_resistance_that_rises_with_temperature_overheats_nothing)
{
    for (const double rise_per_k : {0.0004, 0.0006, 0.001}) {
        eight_come_and_stay(
            [rise_per_k](plant_t *plant) {
                switch_on(plant, "resistance_temperature");
                set(plant, "resistance_martensite_rise_per_k", rise_per_k);
                set(plant, "resistance_austenite_rise_per_k", rise_per_k);
            },
            300);
    }
}

/* A supply at either end of what is declared. */
TEST(another_supply_is_no_fault)
{
    for (const double supply_v : {4.2, 5.5}) {
        eight_come_and_stay([supply_v](plant_t *plant) { set(plant, "supply_v", supply_v); }, 200);
    }
}

TEST(a_room_ten_kelvin_warmer_than_the_setting_leaves_no_spring_unsettled)
{
    world w([](plant_t *plant) { set(plant, "ambient_c", 30.0); }, -10.0);
    w.until(600);
    w.expect_eight_on();
    const unsigned before = w.heatings();
    w.until(1200);
    w.expect_only_the_first(SAFETY_FAULT_NONE);
    TEST_ASSERT_LESS_OR_EQUAL_UINT(8u * 2u / 6u, w.heatings() - before); /* two an hour */
}

/* ---- a touch ---- */

TEST(a_fingertip_on_every_spring_is_lived_with_within_bounds)
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

/* It shows no current, and so it does for ever: as a broken spring would. */
TEST(a_sensor_that_froze_while_the_board_waited_is_found_when_its_spring_is_driven)
{
    for (const unsigned frozen_s : {45u, 100u}) {
        world w;
        w.until(frozen_s);
        TEST_ASSERT_FALSE(w.driven(0));
        TEST_ASSERT_TRUE(loop_act(w.loop.get(), LOOP_ACTION_SENSOR_FREEZE, 0));
        w.until(FIRST_START_S);
        const safety_fault_t fault = w.fault(0);
        TEST_ASSERT_TRUE_MESSAGE(fault == SAFETY_FAULT_OPEN_SPRING ||
                                     fault == SAFETY_FAULT_SENSOR_MISMATCH,
                                 w.what().c_str());
        TEST_ASSERT_TRUE(plant_temperature_c(w.plant(), 0) < 60.0); /* it never got warm */
        w.until(240);
        w.expect_only_the_first(fault);
    }
}

TEST(sensors_that_are_swapped_switch_their_springs_off_in_two_seconds)
{
    for (const int other : {1, CENTRE}) { /* a driven one; one that is off */
        world w;
        w.until(200);
        TEST_ASSERT_TRUE(loop_swap_sensors(w.loop.get(), 0, other));
        loop_advance(w.loop.get(), FAULT_S);
        TEST_ASSERT_TRUE(w.fault(other) != SAFETY_FAULT_NONE);
        /* current where nothing is driven switches all off, before the other is named */
        TEST_ASSERT_TRUE(w.fault(0) != SAFETY_FAULT_NONE ||
                         w.fault(other) == SAFETY_FAULT_STUCK_ON);
        TEST_ASSERT_FALSE(w.driven(0));
        TEST_ASSERT_FALSE(w.driven(other));
    }
}

/* Within what can be a circuit, and bounded: a fifth too little of either. */
TEST(a_sensor_that_shows_a_fifth_too_little_overheats_nothing)
{
    world w;
    TEST_ASSERT_TRUE(loop_scale_sensor(w.loop.get(), 0, 0.8, 0.8));
    w.until(300);
}

/* The near miss of all of them: both numbers off by as much as a bad sensor's may be. */
TEST(a_sensor_that_is_a_little_off_is_no_fault)
{
    world w;
    TEST_ASSERT_TRUE(loop_scale_sensor(w.loop.get(), 0, 0.95, 1.05));
    w.until(FIRST_START_S);
    w.expect_eight_on();
    w.until(400);
    w.expect_only_the_first(SAFETY_FAULT_NONE);
}

} // namespace
