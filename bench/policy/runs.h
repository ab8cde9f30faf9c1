// What it is for: one run of ten minutes or so: the policy, or a baseline, on one array and one
//                 pattern.
// What it owns:   how an array is drawn, how it is driven, what is noted of a run.
// What it never does: print, judge, or set the chip otherwise than a new board is set.
#ifndef POLICY_RUNS_H
#define POLICY_RUNS_H

#include <array>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "controller.h"

namespace policy_bench
{

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr int springs = 9;
constexpr int centre = 4;
constexpr double minutes_ten_s = 600.0;

using pattern_t = unsigned; // bit k: spring k is on
constexpr pattern_t all = 0x1FF;
constexpr pattern_t ring = all & ~(1u << centre);
constexpr pattern_t patterns = 512;

constexpr bool is_on(pattern_t pattern, int spring)
{
    return ((pattern >> spring) & 1u) != 0;
}

// Of the declared array's: 1 is as declared.
struct world_t {
    std::array<double, springs> capacity, loss, resistance, change; // change: R_A / R_M - 1
    double orthogonal, diagonal, ambient_c;
};

world_t nominal();

// Each +-15 %, uniform: heat capacity, loss and resistance of every spring, both couplings; ambient
// +-3 degC, of which the chip is not told; the change of every spring's resistance +-change_spread.
// In every second world capacity and loss are one draw for all springs.
world_t drawn(std::uint64_t seed, unsigned index, double change_spread);

struct outcome_t {
    double end_c[springs];       // mean of the last 30 s
    double full_s[springs];      // first time at 99 % austenite, NaN never
    double least_phase[springs]; // driven: least after 99 % was reached, NaN never
    double highest_c, highest_sum_a, energy_j, undriven_phase;
    double estimate_square_k2, estimate_count; // chip less plant, all springs, every second
    double band_low_c, band_high_c;            // of the centre, from band_from_s
    double release_s;                          // centre from off to 99 % martensite
    int faults;
};

enum class drive_t { policy, policy_without_observer, kept_at_105, plain_current };
enum class release_t { no, yes };

struct run_t {
    world_t world = nominal();
    pattern_t pattern = 0;
    drive_t drive = drive_t::policy;
    double duration_s = minutes_ten_s;
    release_t release = release_t::no; // the centre, at the end
    double current_a = 1.5;            // plain_current; kept_at_105: until it is there
    double supply_a = none;            // baselines: what the driven springs share evenly at most
    double band_from_s = none;
    std::uint64_t seed = 0; // of the sensors
    // of a trace
    std::FILE *trace = nullptr;
    double trace_s = 1.0;
    std::function<void(controller_settings_t &)> set;           // before it starts
    std::function<void(controller_t &, double time_s)> command; // before each tick
};

outcome_t run(const run_t &wanted);

// Runs job(0..count-1) in `workers` threads; progress on stderr.
std::vector<outcome_t> sweep(unsigned count, unsigned workers, const std::string &what,
                             const std::function<outcome_t(unsigned)> &job);

// Slowest of the driven springs to 99 % austenite, s; NaN if one never is.
double slowest_s(const outcome_t &outcome, pattern_t pattern);

// 32 of the 512 patterns: fraction 0..15 of the 2^(9-4) design of resolution IV. In each fraction
// every spring is on in half of the runs and any three springs are in each of their eight states
// equally often; the 16 fractions together are all 512. Box, Hunter and Hunter, Statistics for
// Experimenters, 1978, table 12.15.
std::array<pattern_t, 32> fraction_of_patterns(unsigned fraction);

// Steady temperature (degC) and phase of a spring after an hour at a constant current from cold.
struct steady_t {
    double temperature_c, phase;
};
steady_t steady_at(double current_a, pattern_t pattern, int spring);

} // namespace policy_bench
#endif
