// What it is for: the figures of the drive policy beside two baselines, from the native loop, and
//                 its cost from the simulated board.
// What it owns:   which runs make a figure, their seeds and the table. What it never does: assert,
//                 or tune: the chip's settings are the defaults in every row.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "runs.h"
#include "traces.h"
#ifdef POLICY_BENCH_BOARD
#include "simulated_board.h"
#endif

using namespace policy_bench;

namespace
{

struct row_t {
    std::string figure;
    double value;
    std::string unit, target;
    double b105, b15; // NaN: does not apply
};

class table_t
{
public:
    void add(std::string figure, double value, std::string unit, std::string target,
             double b105 = none, double b15 = none)
    {
        rows_.push_back({std::move(figure), value, std::move(unit), std::move(target), b105, b15});
        const row_t &row = rows_.back();
        fmt::print("{:<76} {:>9} {:<6} reach {:<8} B105 {:>8} B1.5 {:>8}\n", row.figure,
                   number(row.value), row.unit, row.target, number(row.b105), number(row.b15));
        std::fflush(stdout);
    }
    void write_json(const std::string &path, const std::string &command) const
    {
        nlohmann::ordered_json list = nlohmann::ordered_json::array();
        for (const row_t &row : rows_) {
            const auto put = [&](const std::string &figure, double value, const std::string &goal) {
                if (std::isnan(value))
                    return;
                nlohmann::ordered_json entry;
                entry["figure"] = figure;
                entry["value"] = std::stod(number(value));
                entry["unit"] = row.unit;
                entry["target"] = goal;
                entry["command"] = command;
                list.push_back(entry);
            };
            put(row.figure, row.value, row.target);
            put(row.figure + " - B105", row.b105, "");
            put(row.figure + " - B1.5", row.b15, "");
        }
        store(path, list.dump(1) + "\n");
    }
    void write_markdown(const std::string &path) const
    {
        std::string text = "| figure | reach | policy | B105 | B1.5 |\n|---|---|---|---|---|\n";
        for (const row_t &row : rows_)
            text += fmt::format("| {} | {} | {} {} | {} | {} |\n", row.figure, row.target,
                                number(row.value), row.unit == "1" ? "" : row.unit,
                                number(row.b105), number(row.b15));
        store(path, text);
    }

private:
    static std::string number(double value)
    {
        if (std::isnan(value))
            return "-";
        if (value == std::floor(value) && std::fabs(value) < 1e9)
            return fmt::format("{:.0f}", value);
        return std::fabs(value) >= 100.0 ? fmt::format("{:.1f}", value)
                                         : fmt::format("{:.3f}", value);
    }
    static void store(const std::string &path, const std::string &text)
    {
        const std::string part = path + ".part";
        std::ofstream file(part);
        file << text;
        file.close();
        if (!file || std::rename(part.c_str(), path.c_str()) != 0)
            throw std::runtime_error("cannot write " + path);
    }
    std::vector<row_t> rows_;
};

struct options_t {
    std::uint64_t seed = 2718; // not a seed that anything was developed with
    unsigned plants = 200;
    unsigned workers = 2;
    double change_spread = 0.15; // part ratio
    bool every_pattern = false;
    bool verbose = false;
};

constexpr std::array<drive_t, 3> drives = {drive_t::policy, drive_t::kept_at_105,
                                           drive_t::plain_current};
using three_t = std::array<outcome_t, 3>; // policy, B105, B1.5

three_t run_three(run_t wanted)
{
    three_t outcomes{};
    for (std::size_t d = 0; d < drives.size(); d++) {
        wanted.drive = drives[d];
        outcomes[d] = run(wanted);
    }
    return outcomes;
}

template <class figure_t>
void add_three(table_t &table, const std::string &name, const std::string &unit,
               const std::string &target, const figure_t &figure)
{
    table.add(name, figure(0), unit, target, figure(1), figure(2));
}

void nominal_rows(table_t &table, const options_t &options)
{
    run_t wanted;
    wanted.seed = options.seed;
    wanted.pattern = ring;
    const three_t eight = run_three(wanted);
    const double kept_k = eight[1].end_c[centre] - 20.0;
    add_three(table, "rise of the undriven centre, eight held 10 min", "K",
              fmt::format("<= {:.1f}", 0.75 * kept_k),
              [&](std::size_t d) { return eight[d].end_c[centre] - 20.0; });
    add_three(table, "the same, of B105's", "1", "<= 0.75",
              [&](std::size_t d) { return (eight[d].end_c[centre] - 20.0) / kept_k; });

    for (const auto &[name, spring] :
         {std::pair("centre", centre), std::pair("edge", 1), std::pair("corner", 0)}) {
        wanted.pattern = 1u << spring;
        const three_t one = run_three(wanted);
        add_three(table, fmt::format("one spring ({}) from 20 degC to 99 % austenite", name), "s",
                  "<= 26", [&](std::size_t d) { return slowest_s(one[d], wanted.pattern); });
    }
    wanted.pattern = all;
    wanted.release = release_t::yes;
    wanted.supply_a = 15.0;
    const three_t nine = run_three(wanted);
    add_three(table, "all nine, within 15 A (B105: 1.67 A each, B1.5: 1.5 A each)", "s", "<= 65",
              [&](std::size_t d) { return slowest_s(nine[d], all); });
    wanted = {};
    wanted.seed = options.seed;
    wanted.pattern = 1u << centre;
    wanted.band_from_s = 330.0; // the search is over, and what it cost is heated back
    for (const bool neighbours : {false, true}) {
        wanted.command = [=](controller_t &controller, double time_s) {
            for (int k = 0; k < springs; k++)
                if (k != centre)
                    controller_set_target(&controller, static_cast<std::uint8_t>(k),
                                          neighbours && time_s >= 350.0 && time_s < 500.0 ? 1000
                                                                                          : 0);
        };
        const outcome_t one = run(wanted);
        table.add(neighbours ? "  the same, all eight neighbours switched on, and off after 150 s"
                             : "the centre, held: between its coldest and hottest, neighbours off",
                  one.band_high_c - one.band_low_c, "K", "");
    }
    table.add("release: centre of eight held, to 99 % martensite", nine[0].release_s, "s", "< B105",
              nine[1].release_s);
}

/* What a constant current cannot do: hold a spring anywhere in the transformation. */
void constant_current_rows(table_t &table)
{
    for (const auto &[name, pattern] :
         {std::pair("neighbours off", pattern_t(1u << centre)), std::pair("centre of nine", all)}) {
        table.add(fmt::format("1.5 A for ever, {}: settles at", name), none, "degC", "", none,
                  steady_at(1.5, pattern, centre).temperature_c);
        steady_t below{}, above{};
        double current_a = 1.0;
        do {
            current_a += 0.002;
            below = above;
            above = steady_at(current_a, pattern, centre);
        } while (above.phase < 0.99 && current_a < 3.0);
        table.add(fmt::format("least constant current that transforms it, {}", name), none, "A", "",
                  none, current_a);
        table.add("  where that leaves it", none, "degC", "", none, above.temperature_c);
        table.add("  where 2 mA less leave it", none, "degC", "", none, below.temperature_c);
    }
}

double worst_spread_k(const std::vector<outcome_t> &runs, const std::vector<pattern_t> &patterns_of,
                      std::size_t first, std::size_t count)
{
    double worst = 0.0;
    for (int k = 0; k < springs; k++) {
        double low = 1e9, high = -1e9;
        for (std::size_t n = first; n < first + count; n++)
            if (is_on(patterns_of[n], k)) {
                low = std::min(low, runs[n].end_c[k]);
                high = std::max(high, runs[n].end_c[k]);
            }
        worst = std::max(worst, high - low);
    }
    return worst;
}

double most(const std::vector<outcome_t> &runs, double outcome_t::*field)
{
    double value = 0.0;
    for (const outcome_t &one : runs)
        value = std::max(value, one.*field);
    return value;
}

using sweeps_t = std::array<std::vector<outcome_t>, 3>;

sweeps_t sweep_three(const std::string &what, unsigned workers, unsigned count,
                     const std::function<run_t(unsigned)> &wanted)
{
    static constexpr std::array<const char *, 3> names = {"policy", "B105", "B1.5"};
    sweeps_t runs;
    for (std::size_t d = 0; d < drives.size(); d++)
        runs[d] = sweep(count, workers, fmt::format("{}, {}", what, names[d]), [&](unsigned k) {
            run_t one = wanted(k);
            one.drive = drives[d];
            return run(one);
        });
    return runs;
}

struct held_t {
    int driven = 0, never = 0, lost = 0;
    double least = 1.0;
};

held_t count_held(const std::vector<outcome_t> &runs, const std::vector<pattern_t> &patterns_of)
{
    held_t held;
    for (std::size_t n = 0; n < runs.size(); n++)
        for (int k = 0; k < springs; k++)
            if (is_on(patterns_of[n], k)) {
                held.driven++;
                held.never += std::isnan(runs[n].full_s[k]);
                held.lost += runs[n].least_phase[k] < 0.98;
                held.least = std::min(held.least, runs[n].least_phase[k]); // NaN is not less
            }
    return held;
}

double energy_of_kept(const sweeps_t &runs, std::size_t drive, bool worst)
{
    double value = 0.0, count = 0.0;
    for (std::size_t n = 0; n < runs[drive].size(); n++)
        if (runs[1][n].energy_j > 0.0) {
            const double ratio = runs[drive][n].energy_j / runs[1][n].energy_j;
            value = worst ? std::max(value, ratio) : value + ratio;
            count += 1.0;
        }
    return worst ? value : value / count;
}

/* The rows that nominal patterns and Monte Carlo have in common. */
void common_rows(table_t &table, const std::string &where, const sweeps_t &runs,
                 const std::vector<pattern_t> &patterns_of)
{
    std::array<held_t, 3> held;
    for (std::size_t d = 0; d < drives.size(); d++)
        held[d] = count_held(runs[d], patterns_of);
    const auto row = [&](const std::string &name, const char *unit, const char *target,
                         const auto &figure) {
        add_three(table, name + ", " + where, unit, target, figure);
    };
    row("highest temperature of any spring", "degC", "<= 115",
        [&](std::size_t d) { return most(runs[d], &outcome_t::highest_c); });
    row("most austenite in an undriven spring", "%", "<= 1",
        [&](std::size_t d) { return 100.0 * most(runs[d], &outcome_t::undriven_phase); });
    row("held springs that lose phase (< 98 %)", "", "0",
        [&](std::size_t d) { return held[d].lost; });
    row("  least phase of a held spring", "%", ">= 98", [&](std::size_t d) {
        return held[d].never == held[d].driven ? none : 100.0 * held[d].least;
    });
    row("driven springs that never reach 99 %", "", "0",
        [&](std::size_t d) { return held[d].never; });
    table.add("  of so many driven, " + where, held[0].driven, "", "");
    row("energy over 10 min, of B105's, worst", "1", "<= 0.8",
        [&](std::size_t d) { return energy_of_kept(runs, d, true); });
    row("energy over 10 min, of B105's, mean", "1", "<= 0.8",
        [&](std::size_t d) { return energy_of_kept(runs, d, false); });
    row("highest sum of currents", "A", "<= 15",
        [&](std::size_t d) { return most(runs[d], &outcome_t::highest_sum_a); });
}

void pattern_rows(table_t &table, const options_t &options)
{
    std::vector<pattern_t> patterns_of(patterns);
    for (pattern_t p = 0; p < patterns; p++)
        patterns_of[p] = p;
    const sweeps_t runs = sweep_three("512 patterns", options.workers, patterns, [&](unsigned p) {
        run_t wanted;
        wanted.pattern = p;
        wanted.seed = options.seed + p;
        return wanted;
    });
    add_three(table, "spread of a spring's hold temperature, worst spring, 512 patterns", "K",
              "<= 2",
              [&](std::size_t d) { return worst_spread_k(runs[d], patterns_of, 0, patterns); });
    common_rows(table, "512 patterns", runs, patterns_of);
}

/* Which patterns plant w runs. */
std::vector<pattern_t> patterns_of_plant(unsigned w, bool every)
{
    std::vector<pattern_t> chosen;
    if (every) {
        for (pattern_t p = 0; p < patterns; p++)
            chosen.push_back(p);
    } else {
        const auto fraction = fraction_of_patterns(w % 16);
        chosen.assign(fraction.begin(), fraction.end());
        chosen.push_back(all);
        chosen.push_back(ring);
    }
    return chosen;
}

void robust_rows(table_t &table, const options_t &options, double change_spread,
                 const std::string &where)
{
    std::vector<pattern_t> patterns_of;
    std::vector<unsigned> plant_of;
    for (unsigned w = 0; w < options.plants; w++)
        for (const pattern_t p : patterns_of_plant(w, options.every_pattern)) {
            patterns_of.push_back(p);
            plant_of.push_back(w);
        }
    const auto count = static_cast<unsigned>(patterns_of.size());
    const std::size_t each = count / options.plants;
    const auto wanted = [&](unsigned n) {
        run_t one;
        one.world = drawn(options.seed, plant_of[n], change_spread);
        one.pattern = patterns_of[n];
        one.seed = options.seed + n;
        return one;
    };
    const sweeps_t runs = sweep_three(where, options.workers, count, wanted);
    const auto blind =
        sweep(options.plants, options.workers, where + ", without observer", [&](unsigned w) {
            run_t one = wanted(static_cast<unsigned>((w + 1) * each - 1)); // the ring, or all 512's
            one.pattern = ring;
            one.drive = drive_t::policy_without_observer;
            return run(one);
        });

    table.add("plants, " + where, options.plants, "", "200");
    table.add("  patterns of each plant", static_cast<double>(each), "", "");
    table.add(
        "  different patterns in all",
        static_cast<double>(std::set<pattern_t>(patterns_of.begin(), patterns_of.end()).size()), "",
        "512");
    add_three(table, "spread of a spring's hold temperature, worst spring and plant, " + where, "K",
              "<= 6", [&](std::size_t d) {
                  double worst = 0.0;
                  for (unsigned w = 0; w < options.plants; w++)
                      worst = std::max(worst, worst_spread_k(runs[d], patterns_of, w * each, each));
                  return worst;
              });
    add_three(table, "  the same over all plants too", "K", "",
              [&](std::size_t d) { return worst_spread_k(runs[d], patterns_of, 0, count); });
    common_rows(table, where, runs, patterns_of);

    double square = 0.0, samples = 0.0, ring_square = 0.0, ring_samples = 0.0, faults = 0.0;
    double blind_square = 0.0, blind_samples = 0.0;
    for (unsigned n = 0; n < count; n++) {
        const outcome_t &one = runs[0][n];
        square += one.estimate_square_k2;
        samples += one.estimate_count;
        faults += one.faults;
        if (patterns_of[n] == ring) {
            ring_square += one.estimate_square_k2;
            ring_samples += one.estimate_count;
        }
    }
    for (const outcome_t &one : blind) {
        blind_square += one.estimate_square_k2;
        blind_samples += one.estimate_count;
    }
    table.add("estimate against plant, with observer, " + where, std::sqrt(square / samples),
              "K rms", "<= 3");
    table.add("  the same, eight held only", std::sqrt(ring_square / ring_samples), "K rms",
              "<= 3");
    table.add("  the same, eight held, without observer", std::sqrt(blind_square / blind_samples),
              "K rms", "figure");
    table.add("faults, " + where, faults, "", "0");

    for (unsigned n = 0; options.verbose && n < count; n++)
        for (int k = 0; k < springs; k++) {
            const outcome_t &one = runs[0][n];
            if (is_on(patterns_of[n], k) &&
                (std::isnan(one.full_s[k]) || one.least_phase[k] < 0.98 || one.highest_c > 112.0))
                fmt::print("  plant {} pattern {:#05x} spring {}: full {:.1f} s least {:.4f} end "
                           "{:.1f} highest {:.1f}\n",
                           plant_of[n], patterns_of[n], k + 1, one.full_s[k], one.least_phase[k],
                           one.end_c[k], one.highest_c);
        }
}

#ifdef POLICY_BENCH_BOARD
/* The flashed program with nine springs driven for `after_s`. */
class driven_board
{
public:
    driven_board(const char *policy, double after_s, std::uint64_t seed)
        : plant_(plant_create(3, 3), plant_destroy)
    {
        plant_set_effect(plant_.get(), "latent_heat", true);
        plant_set_effect(plant_.get(), "resistance_phase", true);
        board_.emplace(ninespring::default_elf("firmware.elf"), plant_.get(), seed);
        board_->run_ms(100.0);
        for (const char *line : {"model cold", policy, "on all"})
            if (board_->command(line).find("ok") == std::string::npos)
                throw std::runtime_error(fmt::format("the board refuses {}", line));
        board_->run_ms(1000.0 * after_s);
    }

    double awake_cycles_per_tick()
    {
        constexpr double ticks = 250.0;
        const auto cycles = board_cycle(board_->get());
        const auto idle = board_idle_cycles(board_->get());
        board_->run_ms(ticks * CONTROLLER_TICK_MS);
        return (static_cast<double>(board_cycle(board_->get()) - cycles) -
                static_cast<double>(board_idle_cycles(board_->get()) - idle)) /
               ticks;
    }

    /* NaN if the linker left no such function. */
    double longest_cycles(const char *function)
    {
        board_measurement_t seen{};
        return board_measure(board_->get(), function, 100, 3000.0, &seen) && seen.calls > 0
                   ? static_cast<double>(seen.maximum_cycles)
                   : none;
    }

private:
    std::unique_ptr<plant_t, void (*)(plant_t *)> plant_;
    std::optional<ninespring::simulated_board> board_;
};
#endif

/* Cycles of the flashed program, which are exact; B1.5's column is `policy open`. */
void cost_rows(table_t &table, const options_t &options)
{
#ifdef POLICY_BENCH_BOARD
    const std::string what = "on the chip, nine driven: ";
    for (const auto &[when, after_s] : {std::pair("heating", 5.0), std::pair("holding", 90.0)}) {
        driven_board policy("policy precompensate", after_s, options.seed);
        driven_board open("policy open", after_s, options.seed);
        table.add(fmt::format("{}awake in a 20 ms tick, I2C included, {}", what, when),
                  std::round(policy.awake_cycles_per_tick()), "cycles", "<= 112000", none,
                  std::round(open.awake_cycles_per_tick()));
        for (const auto &[function, target] :
             {std::pair("drive_policy_tick", ""), std::pair("controller_tick", "<= 100000")}) {
            const double longest = policy.longest_cycles(function);
            if (std::isnan(longest))
                fmt::print(stderr, "bench_policy: the linker left no {}\n", function);
            else
                table.add(fmt::format("{}{}, longest of 100, {}", what, function, when), longest,
                          "cycles", target, none, open.longest_cycles(function));
        }
    }
#else
    (void)table;
    (void)options;
    fmt::print(stderr, "bench_policy: built without the simulated board: no cost on the chip\n");
#endif
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App app{
        "Figures of the drive policy beside B105 (driven springs kept at 105 degC) and "
        "B1.5 (a plain 1.5 A from cold). Every run begins with the hint `model cold`: what is "
        "measured is the drive, not the start\n(bench/worlds measures that).\n"
        "Monte Carlo: each plant runs 32 of the 512 patterns, one of the 16 fractions of "
        "the 2^(9-4) design of\nresolution IV in turn, so that 16 plants run all 512 "
        "once, and two more: all on, and all but the centre. Part robust varies R_A and R_M "
        "together,\npart ratio also what lies between them."};
    std::string json, markdown, trace_directory;
    options_t options;
    bool quick = false;
    std::vector<std::string> parts{"nominal", "constant", "patterns", "robust", "ratio", "cost"};
    app.add_option("--json", json, "Writes the figures for programs");
    app.add_option("--markdown", markdown, "Writes the table for docs/results.md");
    app.add_option("--traces", trace_directory,
                   "Writes the runs behind the plots into a directory");
    app.add_option("--seed", options.seed, "Of plants and sensors")->capture_default_str();
    app.add_option("--plants", options.plants, "Of the Monte Carlo")
        ->check(CLI::Range(1, 10000))
        ->capture_default_str();
    app.add_option("--change-spread", options.change_spread,
                   "Of R_A / R_M - 1 in part ratio, as a fraction")
        ->check(CLI::Range(0.0, 0.9))
        ->capture_default_str();
    app.add_option("--jobs", options.workers, "Threads")
        ->check(CLI::Range(1, 64))
        ->capture_default_str();
    app.add_flag("--every-pattern", options.every_pattern,
                 "Monte Carlo: all 512 patterns of every plant; hours");
    app.add_flag("--quick", quick, "16 plants: a minute or two");
    app.add_option("--part", parts, "Of the figures; \"none\" for traces alone")
        ->check(
            CLI::IsMember({"nominal", "constant", "patterns", "robust", "ratio", "cost", "none"}))
        ->capture_default_str();
    app.add_flag("--verbose", options.verbose, "One line for each run that misses a figure");
    CLI11_PARSE(app, argc, argv);
    if (quick)
        options.plants = std::min(options.plants, 16u);
    try {
        table_t table;
        for (const std::string &part : parts) {
            if (part == "nominal")
                nominal_rows(table, options);
            else if (part == "constant")
                constant_current_rows(table);
            else if (part == "patterns")
                pattern_rows(table, options);
            else if (part == "robust")
                robust_rows(table, options, 0.0, "Monte Carlo");
            else if (part == "ratio")
                robust_rows(table, options, options.change_spread, "Monte Carlo, R_A/R_M too");
            else if (part == "cost")
                cost_rows(table, options);
        }
        if (!trace_directory.empty())
            write_traces(trace_directory, options.seed);
        const std::string command = "build/host/bench/policy/bench_policy";
        if (!json.empty())
            table.write_json(json, command);
        if (!markdown.empty())
            table.write_markdown(markdown);
    } catch (const std::exception &error) {
        fmt::print(stderr, "bench_policy: {}\n", error.what());
        return 1;
    }
    return 0;
}
