/* The drive policy as it is flashed: what the springs of a plant do when the console asks for it.
 */
#include <algorithm>
#include <cmath>

#include "board_test.h"

using namespace board_test;

namespace
{

constexpr unsigned SPRINGS = BOARD_CHANNELS;
constexpr unsigned CENTRE = 4;
constexpr double SUPPLY_A = 15.0;
constexpr unsigned BUDGET_MA = 14800; /* less the default reserve */

/* A board around the paper's springs, with their phase, under precompensate; with the hint `model
 * cold` (boot), for tests that are not about the beginning. */
std::unique_ptr<rig> powered(const char *settings = "")
{
    auto mega = std::make_unique<rig>();
    make_niti(mega->plant.get());
    mega->boot();
    mega->expect_ok("policy precompensate");
    std::string line;
    for (const char *c = settings; *c != '\0'; ++c) {
        if (*c == ' ') {
            mega->expect_ok(line);
            line.clear();
        } else {
            line += *c;
        }
    }
    if (!line.empty()) {
        mega->expect_ok(line);
    }
    return mega;
}

double temperature(const rig &mega, unsigned k)
{
    return plant_temperature_c(mega.plant.get(), static_cast<int>(k));
}

/* One control tick; what is asked of the supply and what flows stay below its limits. */
board_view_t tick(rig &mega)
{
    mega.run_ms(CONTROLLER_TICK_MS);
    const board_view_t seen = mega.view();
    unsigned target_ma = 0;
    int measured_ma = 0;
    double flowing_a = 0.0;
    for (unsigned k = 0; k < SPRINGS; ++k) {
        target_ma += seen.spring[k].target_ma;
        measured_ma += seen.spring[k].measured_ma;
        flowing_a += board_current_a(mega.raw(), k);
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT(BUDGET_MA, target_ma);
    TEST_ASSERT_LESS_OR_EQUAL_INT(static_cast<int>(1000.0 * SUPPLY_A), measured_ma);
    TEST_ASSERT_TRUE(flowing_a <= SUPPLY_A);
    return seen;
}

/* Advances, and gives the highest temperature of any spring. */
double run(rig &mega, double seconds)
{
    double highest_c = -100.0;
    for (long n = std::lround(seconds * 1000.0 / CONTROLLER_TICK_MS); n > 0; --n) {
        tick(mega);
        for (unsigned k = 0; k < SPRINGS; ++k) {
            highest_c = std::max(highest_c, temperature(mega, k));
        }
    }
    return highest_c;
}

TEST(heats_then_holds_above_martensite_start_then_lets_go)
{
    auto mega = powered("$unsure_margin_k=3");
    mega->expect_ok("on 5");
    TEST_ASSERT_TRUE(run(*mega, 35.0) < 110.0);
    TEST_ASSERT_TRUE(phase(*mega, CENTRE) >= 0.99);
    run(*mega, 25.0); /* it coasts down to the band */
    for (int n = 0; n < 5; ++n) {
        run(*mega, 2.0);
        TEST_ASSERT_EQUAL_UINT8(DRIVE_POLICY_STAGE_HOLD, mega->view().spring[CENTRE].stage);
        TEST_ASSERT_TRUE(phase(*mega, CENTRE) >= 0.98);
        TEST_ASSERT_TRUE(temperature(*mega, CENTRE) > 77.0);
        TEST_ASSERT_TRUE(temperature(*mega, CENTRE) < 84.0);
        TEST_ASSERT_DOUBLE_WITHIN(3.0, temperature(*mega, CENTRE),
                                  mega->view().spring[CENTRE].temperature_c7 / 128.0);
    }
    mega->expect_ok("off 5");
    mega->run_ms(2.0 * CONTROLLER_TICK_MS);
    TEST_ASSERT_TRUE(board_all_off(mega->raw()));
    run(*mega, 45.0);
    TEST_ASSERT_TRUE(phase(*mega, CENTRE) <= 0.01);
}

TEST(readings_lost_in_a_hold_cost_neither_safety_nor_the_neighbours)
{
    auto mega = powered();
    mega->expect_ok("pattern 100010001");
    run(*mega, 35.0);
    for (unsigned k : {0u, 4u, 8u}) {
        TEST_ASSERT_EQUAL_UINT8(DRIVE_POLICY_STAGE_HOLD, mega->view().spring[k].stage);
    }
    /* single readings: below what a fault needs, the hold goes on */
    for (int n = 0; n < 30; ++n) {
        const board_fault_t fault = n % 2 == 0 ? BOARD_FAULT_NACK : BOARD_FAULT_STALE;
        board_set_fault(mega->raw(), fault, CENTRE, true);
        tick(*mega);
        board_set_fault(mega->raw(), fault, CENTRE, false);
        run(*mega, 0.08);
    }
    TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, mega->view().spring[CENTRE].fault);
    TEST_ASSERT_TRUE(phase(*mega, CENTRE) >= 0.98);
    TEST_ASSERT_TRUE(temperature(*mega, CENTRE) < 100.0);
    /* for good: that spring is off with the fault that says why, the others are held */
    board_set_fault(mega->raw(), BOARD_FAULT_NACK, CENTRE, true);
    board_set_fault(mega->raw(), BOARD_FAULT_STALE, 8, true);
    run(*mega, 1.0);
    TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_SENSOR_ABSENT, mega->view().spring[CENTRE].fault);
    TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_SENSOR_STALE, mega->view().spring[8].fault);
    TEST_ASSERT_TRUE(board_duty(mega->raw(), CENTRE) == 0.0 && board_duty(mega->raw(), 8) == 0.0);
    TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_SAFETY, mega->view().spring[CENTRE].limits);
    run(*mega, 2.0);
    TEST_ASSERT_EQUAL_UINT8(DRIVE_POLICY_STAGE_HOLD, mega->view().spring[0].stage);
    TEST_ASSERT_TRUE(phase(*mega, 0) >= 0.98);
    /* repaired before they have cooled: the hold is taken up again */
    board_set_fault(mega->raw(), BOARD_FAULT_NACK, CENTRE, false);
    board_set_fault(mega->raw(), BOARD_FAULT_STALE, 8, false);
    run(*mega, 0.1);
    mega->expect_ok("clear");
    mega->expect_ok("pattern 100010001");
    TEST_ASSERT_TRUE(run(*mega, 20.0) < 115.0);
    for (unsigned k : {0u, 4u, 8u}) {
        TEST_ASSERT_TRUE(phase(*mega, k) >= 0.98);
    }
}

} // namespace
