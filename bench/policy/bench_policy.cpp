// What it is for: the figures of the drive policy beside two baselines, from the native loop.
// What it owns:   the runs, their seeds and the table. What it never does: assert, or tune: the
// chip's settings are the defaults in every row.
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <fstream>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "electrics.h"
#include "loop.h"

namespace
{

constexpr double nan_d = std::numeric_limits<double>::quiet_NaN();
constexpr int springs = 9;
constexpr int centre = 4;
constexpr double minutes_ten_s = 600.0;
using pattern_t = unsigned; // bit k: spring k is on

struct world_t {
    std::array<double, springs> capacity, loss, resistance;
    double orthogonal, diagonal, ambient_c;
};

world_t nominal()
{
    world_t world{};
    world.capacity.fill(1.0);
    world.loss.fill(1.0);
    world.resistance.fill(1.0);
    world.orthogonal = world.diagonal = 1.0;
    world.ambient_c = 20.0;
    return world;
}

/* +-15 % uniform on heat capacity, loss, couplings, resistance, +-3 degC ambient. Capacity and loss
 * are one draw for all springs in every second world, one per spring in the others. */
world_t drawn(std::uint64_t seed, unsigned index)
{
    electrics_noise_t noise;
    electrics_noise_seed(&noise, seed * 1000003u + index);
    auto draw = [&](double width) { return width * (2.0 * electrics_noise_uniform(&noise) - 1.0); };
    world_t world = nominal();
    const double capacity = 1.0 + draw(0.15);
    const double loss = 1.0 + draw(0.15);
    for (std::size_t k = 0; k < springs; k++) {
        world.capacity[k] = index % 2 == 0 ? capacity : 1.0 + draw(0.15);
        world.loss[k] = index % 2 == 0 ? loss : 1.0 + draw(0.15);
        world.resistance[k] = 1.0 + draw(0.15);
    }
    world.orthogonal = 1.0 + draw(0.15);
    world.diagonal = 1.0 + draw(0.15);
    world.ambient_c = 20.0 + draw(3.0);
    return world;
}

plant_t *build(const world_t &world)
{
    plant_t *plant = plant_create(3, 3);
    plant_set_effect(plant, "latent_heat", true);
    plant_set_effect(plant, "resistance_phase", true);
    plant_set(plant, "orthogonal_w_per_k", 586e-6 * world.orthogonal);
    plant_set(plant, "diagonal_w_per_k", 293e-6 * world.diagonal);
    plant_set(plant, "ambient_c", world.ambient_c);
    for (std::size_t k = 0; k < springs; k++) {
        const auto set = [&](const char *name, double value) {
            plant_set(plant, fmt::format("{}[{}]", name, k + 1).c_str(), value);
        };
        set("heat_capacity_j_per_k", 0.300 * world.capacity[k]);
        set("loss_w_per_k", 5.8e-3 * world.loss[k]);
        set("resistance_martensite_ohm", 0.175 * world.resistance[k]);
        set("resistance_austenite_ohm", 0.219 * world.resistance[k]);
    }
    plant_reset(plant);
    return plant;
}

struct outcome_t {
    double end_c[springs];       // mean of the last 30 s
    double full_s[springs];      // first time at 99 % austenite, NaN never
    double least_phase[springs]; // driven: least after 99 % was reached
    double highest_c, highest_sum_a, energy_j, undriven_phase;
    double estimate_square_k2, estimate_count; // all springs, every second
    double release_s;                          // centre to 99 % martensite
    int faults;
};

outcome_t blank()
{
    outcome_t result{};
    for (int k = 0; k < springs; k++) {
        result.full_s[k] = nan_d;
        result.least_phase[k] = 1.0;
    }
    result.release_s = nan_d;
    return result;
}

void watch(outcome_t &result, const plant_t *plant, pattern_t pattern, double time_s,
           double duration_s, double dt_s)
{
    for (int k = 0; k < springs; k++) {
        const double phase = plant_austenite(plant, k);
        const double temperature_c = plant_temperature_c(plant, k);
        result.highest_c = std::max(result.highest_c, temperature_c);
        result.energy_j += plant_power_w(plant, k) * dt_s;
        if (((pattern >> k) & 1u) == 0) {
            result.undriven_phase = std::max(result.undriven_phase, phase);
        } else if (std::isnan(result.full_s[k])) {
            if (phase >= 0.99)
                result.full_s[k] = time_s;
        } else {
            result.least_phase[k] = std::min(result.least_phase[k], phase);
        }
        if (time_s > duration_s - 30.0)
            result.end_c[k] += temperature_c * dt_s / 30.0;
    }
}

enum class release_t { no, yes };

outcome_t run_policy(const world_t &world, pattern_t pattern, double duration_s, bool observer,
                     std::uint64_t seed, release_t release = release_t::no,
                     std::FILE *trace = nullptr)
{
    plant_t *plant = build(world);
    controller_settings_t settings;
    controller_settings_default(&settings);
    settings.policy.policy = DRIVE_POLICY_PRECOMPENSATE;
    settings.policy.observer = observer ? 1 : 0;
    loop_options_t options;
    loop_options_default(&options);
    options.ambient_error_c = 20.0 - world.ambient_c;
    loop_t *loop = loop_create(&settings, plant, &options, seed, nullptr);
    controller_t *controller = loop_controller(loop);
    outcome_t result = blank();
    for (int k = 0; k < springs; k++)
        controller_set_target(controller, static_cast<std::uint8_t>(k),
                              ((pattern >> k) & 1u) != 0 ? 1000 : 0);
    const long ticks = std::lround(duration_s / LOOP_TICK_S);
    for (long tick = 1; tick <= ticks; tick++) {
        loop_tick(loop);
        watch(result, loop_plant(loop), pattern, loop_time_s(loop), duration_s, LOOP_TICK_S);
        if (tick % 50 == 0) {
            for (int k = 0; k < springs; k++) {
                const double error =
                    controller_temperature_c7(controller, static_cast<std::uint8_t>(k)) / 128.0 -
                    plant_temperature_c(loop_plant(loop), k);
                result.estimate_square_k2 += error * error;
                result.estimate_count += 1.0;
            }
        }
        if (trace != nullptr && tick % 25 == 0) {
            std::fprintf(trace, "%.2f", loop_time_s(loop));
            for (int k = 0; k < springs; k++)
                std::fprintf(
                    trace, ",%.3f,%.4f,%.3f,%.3f", plant_temperature_c(loop_plant(loop), k),
                    plant_austenite(loop_plant(loop), k), loop_current_a(loop, k),
                    controller_temperature_c7(controller, static_cast<std::uint8_t>(k)) / 128.0);
            std::fprintf(trace, "\n");
        }
    }
    if (release == release_t::yes) {
        controller_set_target(controller, centre, 0);
        const double from_s = loop_time_s(loop);
        while (plant_austenite(loop_plant(loop), centre) > 0.01 && loop_time_s(loop) < from_s + 600)
            loop_tick(loop);
        result.release_s = loop_time_s(loop) - from_s;
    }
    result.highest_sum_a = loop_highest_sum_current_a(loop);
    for (int k = 0; k < springs; k++)
        result.faults += controller_fault(controller, static_cast<std::uint8_t>(k)) != 0;
    result.faults += controller_board_fault(controller) != 0;
    loop_destroy(loop);
    plant_destroy(plant);
    return result;
}

/* B105: 3.0 A until 105 degC, then kept there; B1.5: 1.5 A from the start. No supply limit. */
outcome_t run_baseline(const world_t &world, pattern_t pattern, double duration_s, bool kept,
                       release_t release = release_t::no)
{
    plant_t *plant = build(world);
    outcome_t result = blank();
    const double dt_s = 0.1;
    std::array<bool, springs> arrived{};
    for (int k = 0; k < springs; k++) {
        if (((pattern >> k) & 1u) != 0)
            plant_drive(plant, k, PLANT_DRIVE_CURRENT, kept ? 3.0 : 1.5);
        else
            plant_drive(plant, k, PLANT_DRIVE_POWER, 0.0);
    }
    const long steps = std::lround(duration_s / dt_s);
    for (long step = 1; step <= steps; step++) {
        plant_step(plant, dt_s);
        watch(result, plant, pattern, plant_time_s(plant), duration_s, dt_s);
        for (std::size_t k = 0; k < springs; k++) {
            const int spring = static_cast<int>(k);
            if (kept && !arrived[k] && ((pattern >> k) & 1u) != 0 &&
                plant_temperature_c(plant, spring) >= 105.0) {
                arrived[k] = true;
                plant_drive(plant, spring, PLANT_DRIVE_TEMPERATURE, 105.0);
            }
        }
    }
    if (release == release_t::yes) {
        plant_drive(plant, centre, PLANT_DRIVE_POWER, 0.0);
        const double from_s = plant_time_s(plant);
        while (plant_austenite(plant, centre) > 0.01 && plant_time_s(plant) < from_s + 3600)
            plant_step(plant, dt_s);
        result.release_s = plant_time_s(plant) - from_s;
    }
    plant_destroy(plant);
    return result;
}

/* Runs job(0..count-1) in two processes; the results lie in shared memory. */
std::vector<outcome_t> sweep(unsigned count, const std::function<outcome_t(unsigned)> &job,
                             const char *what)
{
    const std::size_t bytes = count * sizeof(outcome_t);
    void *shared = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (shared == MAP_FAILED)
        throw std::runtime_error("no memory for the results");
    auto *results = static_cast<outcome_t *>(shared);
    constexpr unsigned workers = 2;
    std::array<pid_t, workers> child{};
    for (unsigned w = 0; w < workers; w++) {
        child[w] = fork();
        if (child[w] < 0)
            throw std::runtime_error("cannot start a second process");
        if (child[w] == 0) {
            for (unsigned k = w; k < count; k += workers) {
                results[k] = job(k);
                if (w == 0 && k % 64 == 0)
                    fmt::print(stderr, "{}: {} of {}\n", what, k, count);
            }
            _exit(0);
        }
    }
    bool good = true;
    for (const pid_t pid : child) {
        int status = 0;
        waitpid(pid, &status, 0);
        good = good && WIFEXITED(status) && WEXITSTATUS(status) == 0;
    }
    std::vector<outcome_t> copy(results, results + count);
    munmap(shared, bytes);
    if (!good)
        throw std::runtime_error(fmt::format("{}: a worker failed", what));
    return copy;
}

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
             double b105 = nan_d, double b15 = nan_d)
    {
        rows_.push_back({std::move(figure), value, std::move(unit), std::move(target), b105, b15});
        const row_t &row = rows_.back();
        fmt::print("{:<66} {:>9} {:<6} reach {:<18} B105 {:>8} B1.5 {:>8}\n", row.figure,
                   number(row.value), row.unit, row.target, number(row.b105), number(row.b15));
        std::fflush(stdout);
    }
    void write_json(const std::string &path, const std::string &command) const
    {
        nlohmann::ordered_json list = nlohmann::ordered_json::array();
        for (const row_t &row : rows_) {
            const auto put = [&](const std::string &figure, double value, const std::string &goal) {
                nlohmann::ordered_json entry;
                entry["figure"] = figure;
                if (std::isnan(value))
                    entry["value"] = nullptr;
                else
                    entry["value"] = std::stod(number(value));
                entry["unit"] = row.unit;
                entry["target"] = goal;
                entry["command"] = command;
                list.push_back(entry);
            };
            put(row.figure, row.value, row.target);
            if (!std::isnan(row.b105))
                put(row.figure + " - B105", row.b105, "");
            if (!std::isnan(row.b15))
                put(row.figure + " - B1.5", row.b15, "");
        }
        store(path, list.dump(1) + "\n");
    }
    void write_markdown(const std::string &path) const
    {
        std::string text = "| figure | reach | policy | B105 | B1.5 |\n|---|---|---|---|---|\n";
        for (const row_t &row : rows_)
            text += fmt::format("| {} | {} | {} {} | {} | {} |\n", row.figure, row.target,
                                number(row.value), row.unit, number(row.b105), number(row.b15));
        store(path, text);
    }

private:
    static std::string number(double value)
    {
        if (std::isnan(value))
            return "-";
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

double slowest(const outcome_t &result, pattern_t pattern)
{
    double time_s = 0.0;
    for (int k = 0; k < springs; k++)
        if (((pattern >> k) & 1u) != 0)
            time_s = std::isnan(result.full_s[k]) ? nan_d : std::max(time_s, result.full_s[k]);
    return time_s;
}

constexpr pattern_t all = 0x1FF;
constexpr pattern_t ring = all & ~(1u << centre);

void nominal_rows(table_t &table, std::uint64_t seed)
{
    const world_t world = nominal();
    const outcome_t eight = run_policy(world, ring, minutes_ten_s, true, seed);
    const outcome_t eight_kept = run_baseline(world, ring, minutes_ten_s, true);
    const outcome_t eight_plain = run_baseline(world, ring, minutes_ten_s, false);
    const double kept_k = eight_kept.end_c[centre] - 20.0;
    table.add("rise of the undriven centre, eight held 10 min", eight.end_c[centre] - 20.0, "K",
              fmt::format("<= {:.1f}", 0.75 * kept_k), kept_k, eight_plain.end_c[centre] - 20.0);
    table.add("the same, of B105's", (eight.end_c[centre] - 20.0) / kept_k, "1", "<= 0.75", 1.0,
              (eight_plain.end_c[centre] - 20.0) / kept_k);

    const pattern_t one = 1u << centre;
    table.add("one spring (centre) from 20 degC to 99 % austenite",
              slowest(run_policy(world, one, 120.0, true, seed), one), "s", "<= 26",
              slowest(run_baseline(world, one, 120.0, true), one),
              slowest(run_baseline(world, one, 600.0, false), one));
    table.add("one spring (corner) from 20 degC to 99 % austenite",
              slowest(run_policy(world, 1u, 120.0, true, seed), 1u), "s", "<= 26",
              slowest(run_baseline(world, 1u, 120.0, true), 1u),
              slowest(run_baseline(world, 1u, 600.0, false), 1u));
    table.add("all nine, within 15 A", slowest(run_policy(world, all, 200.0, true, seed), all), "s",
              "<= 65", nan_d, slowest(run_baseline(world, all, 600.0, false), all));
    table.add("release: centre of eight held, to 99 % martensite",
              run_policy(world, all, minutes_ten_s, true, seed, release_t::yes).release_s, "s",
              "< B105", run_baseline(world, all, minutes_ten_s, true, release_t::yes).release_s);
}

void pattern_rows(table_t &table, std::uint64_t seed)
{
    const world_t world = nominal();
    const auto policy = sweep(
        512, [&](unsigned p) { return run_policy(world, p, minutes_ten_s, true, seed + p); },
        "512 patterns");
    const auto kept = sweep(
        512, [&](unsigned p) { return run_baseline(world, p, minutes_ten_s, true); }, "B105");
    const auto plain = sweep(
        512, [&](unsigned p) { return run_baseline(world, p, minutes_ten_s, false); }, "B1.5");
    const auto spread = [](const std::vector<outcome_t> &runs) {
        double worst = 0.0;
        for (int k = 0; k < springs; k++) {
            double low = 1e9, high = -1e9;
            for (pattern_t p = 0; p < 512; p++)
                if (((p >> k) & 1u) != 0) {
                    low = std::min(low, runs[p].end_c[k]);
                    high = std::max(high, runs[p].end_c[k]);
                }
            worst = std::max(worst, high - low);
        }
        return worst;
    };
    table.add("spread of a driven spring's hold temperature, 512 patterns, worst spring",
              spread(policy), "K", "<= 2", spread(kept), spread(plain));
    const auto most = [](const std::vector<outcome_t> &runs, double outcome_t::*field) {
        double value = 0.0;
        for (const outcome_t &run : runs)
            value = std::max(value, run.*field);
        return value;
    };
    table.add("highest temperature, 512 patterns", most(policy, &outcome_t::highest_c), "degC",
              "<= 115", most(kept, &outcome_t::highest_c), most(plain, &outcome_t::highest_c));
    table.add("austenite in an undriven spring, 512 patterns",
              100.0 * most(policy, &outcome_t::undriven_phase), "%", "<= 1",
              100.0 * most(kept, &outcome_t::undriven_phase),
              100.0 * most(plain, &outcome_t::undriven_phase));
    table.add("highest sum of currents, 512 patterns", most(policy, &outcome_t::highest_sum_a), "A",
              "<= 15");
    double worst_energy = 0.0, mean_energy = 0.0, plain_energy = 0.0;
    for (pattern_t p = 1; p < 512; p++) {
        worst_energy = std::max(worst_energy, policy[p].energy_j / kept[p].energy_j);
        mean_energy += policy[p].energy_j / kept[p].energy_j / 511.0;
        plain_energy += plain[p].energy_j / kept[p].energy_j / 511.0;
    }
    table.add("energy over 10 min, of B105's, worst of 511 patterns", worst_energy, "1", "<= 0.8",
              1.0);
    table.add("energy over 10 min, of B105's, mean of 511 patterns", mean_energy, "1", "<= 0.8",
              1.0, plain_energy);
}

void robust_rows(table_t &table, std::uint64_t seed, unsigned plants, bool verbose)
{
    /* The centre is driven in all but the last; its neighbours are none, all, rings and draws. */
    constexpr std::array<pattern_t, 10> patterns = {0x010, 0x1FF, 0x0BA, 0x155, 0x01F,
                                                    0x1D0, 0x092, 0x11B, 0x0F6, ring};
    const auto count = static_cast<unsigned>(patterns.size());
    const auto runs = sweep(
        plants * count,
        [&](unsigned k) {
            return run_policy(drawn(seed, k / count), patterns[k % count], minutes_ten_s, true,
                              seed + k);
        },
        "Monte Carlo");
    const auto blind = sweep(
        plants,
        [&](unsigned k) {
            return run_policy(drawn(seed, k), ring, minutes_ten_s, false, seed + k);
        },
        "Monte Carlo without observer");
    const auto plain = sweep(
        plants,
        [&](unsigned k) { return run_baseline(drawn(seed, k), ring, minutes_ten_s, false); },
        "Monte Carlo B1.5");
    double spread_k = 0.0, highest_c = 0.0, false_phase = 0.0, least = 1.0, sum_a = 0.0;
    double square = 0.0, samples = 0.0, blind_square = 0.0, blind_samples = 0.0, plain_c = 0.0;
    double ring_square = 0.0, ring_samples = 0.0, low_all = 1e9, high_all = -1e9;
    int never = 0, lost = 0, held = 0, faults = 0;
    for (unsigned w = 0; w < plants; w++) {
        double low = 1e9, high = -1e9;
        for (unsigned n = 0; n < count; n++) {
            const outcome_t &run = runs[w * count + n];
            const pattern_t pattern = patterns[n];
            if (((pattern >> centre) & 1u) != 0) {
                low = std::min(low, run.end_c[centre]);
                high = std::max(high, run.end_c[centre]);
            }
            highest_c = std::max(highest_c, run.highest_c);
            false_phase = std::max(false_phase, run.undriven_phase);
            sum_a = std::max(sum_a, run.highest_sum_a);
            faults += run.faults;
            square += run.estimate_square_k2;
            samples += run.estimate_count;
            if (pattern == ring) {
                ring_square += run.estimate_square_k2;
                ring_samples += run.estimate_count;
            }
            for (int k = 0; k < springs; k++)
                if (((pattern >> k) & 1u) != 0) {
                    held++;
                    never += std::isnan(run.full_s[k]);
                    lost += run.least_phase[k] < 0.98;
                    least = std::min(least, run.least_phase[k]);
                    if (verbose && (std::isnan(run.full_s[k]) || run.least_phase[k] < 0.98 ||
                                    run.highest_c > 112.0))
                        fmt::print("  world {} pattern {:#x} spring {}: full {:.1f} s least {:.4f} "
                                   "end {:.1f} highest {:.1f}\n",
                                   w, pattern, k, run.full_s[k], run.least_phase[k], run.end_c[k],
                                   run.highest_c);
                }
        }
        if (verbose)
            fmt::print("  world {} centre {:.2f}..{:.2f}\n", w, low, high);
        spread_k = std::max(spread_k, high - low);
        low_all = std::min(low_all, low);
        high_all = std::max(high_all, high);
        blind_square += blind[w].estimate_square_k2;
        blind_samples += blind[w].estimate_count;
        plain_c = std::max(plain_c, plain[w].highest_c);
    }
    table.add("spread of the centre's hold temperature over patterns, Monte Carlo, worst plant",
              spread_k, "K", "<= 6");
    table.add("the same over all plants too", high_all - low_all, "K", "");
    table.add("highest temperature of any spring, Monte Carlo", highest_c, "degC", "<= 115", nan_d,
              plain_c);
    table.add("most austenite in an undriven spring, Monte Carlo", 100.0 * false_phase, "%",
              "<= 1");
    table.add("held springs that lose phase (< 98 %), Monte Carlo", lost, "", "0");
    table.add("  of so many held", held, "", "");
    table.add("  least phase of a held spring, Monte Carlo", 100.0 * least, "%", ">= 98");
    table.add("driven springs that never reach 99 %, Monte Carlo", never, "", "0");
    table.add("estimate against plant, Monte Carlo, with observer", std::sqrt(square / samples),
              "K rms", "<= 3");
    table.add("  the same, eight held only", std::sqrt(ring_square / ring_samples), "K rms",
              "<= 3");
    table.add("  the same, eight held, without observer", std::sqrt(blind_square / blind_samples),
              "K rms", "figure");
    table.add("highest sum of currents, Monte Carlo", sum_a, "A", "<= 15");
    table.add("faults, Monte Carlo", faults, "", "0");
}

void traces(const std::string &directory, std::uint64_t seed)
{
    const auto open = [&](const char *name) {
        std::FILE *file = std::fopen((directory + "/" + name).c_str(), "w");
        if (file == nullptr)
            throw std::runtime_error("cannot write into " + directory);
        std::fprintf(file, "time_s");
        for (int k = 1; k <= springs; k++)
            std::fprintf(file, ",t%d_c,x%d,i%d_a,m%d_c", k, k, k, k);
        std::fprintf(file, "\n");
        return file;
    };
    const auto trace = [&](const char *name, const world_t &world, pattern_t pattern,
                           double time_s) {
        std::FILE *file = open(name);
        run_policy(world, pattern, time_s, true, seed, release_t::no, file);
        std::fclose(file);
    };
    trace("policy_eight.csv", nominal(), ring, minutes_ten_s);
    trace("policy_nine.csv", nominal(), all, 120.0);
    world_t lossy = nominal();
    lossy.loss.fill(1.15);
    lossy.capacity.fill(1.15);
    trace("policy_lossy.csv", lossy, ring, minutes_ten_s);
    for (const bool kept : {true, false}) {
        std::FILE *file = open(kept ? "policy_b105.csv" : "policy_b15.csv");
        plant_t *plant = build(nominal());
        for (int k = 0; k < springs; k++)
            if (k != centre)
                plant_drive(plant, k, PLANT_DRIVE_CURRENT, kept ? 3.0 : 1.5);
        for (int step = 1; step <= 6000; step++) {
            plant_step(plant, 0.1);
            for (int k = 0; kept && k < springs; k++)
                if (k != centre && plant_temperature_c(plant, k) >= 105.0)
                    plant_drive(plant, k, PLANT_DRIVE_TEMPERATURE, 105.0);
            if (step % 5 != 0)
                continue;
            std::fprintf(file, "%.2f", plant_time_s(plant));
            for (int k = 0; k < springs; k++)
                std::fprintf(file, ",%.3f,%.4f,%.3f,", plant_temperature_c(plant, k),
                             plant_austenite(plant, k), plant_current_a(plant, k));
            std::fprintf(file, "\n");
        }
        plant_destroy(plant);
        std::fclose(file);
    }
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App app{"Figures of the drive policy beside B105 (driven springs kept at 105 degC) and "
                 "B1.5 (a plain 1.5 A)"};
    std::string json, markdown, trace_directory;
    std::uint64_t seed = 2718; // not a seed that anything was developed with
    unsigned plants = 200;
    bool verbose = false;
    std::vector<std::string> parts{"nominal", "patterns", "robust"};
    app.add_option("--json", json, "writes the figures for programs");
    app.add_option("--markdown", markdown, "writes the table for docs/results.md");
    app.add_option("--traces", trace_directory,
                   "writes the runs behind the plots into a directory");
    app.add_option("--seed", seed, "of plants and sensors");
    app.add_option("--plants", plants, "of the Monte Carlo")->check(CLI::Range(1, 10000));
    app.add_option("--part", parts, "nominal, patterns, robust");
    app.add_flag("--verbose", verbose, "one line a plant");
    CLI11_PARSE(app, argc, argv);
    try {
        table_t table;
        for (const std::string &part : parts) {
            if (part == "nominal")
                nominal_rows(table, seed);
            else if (part == "patterns")
                pattern_rows(table, seed);
            else if (part == "robust")
                robust_rows(table, seed, plants, verbose);
        }
        if (!trace_directory.empty())
            traces(trace_directory, seed);
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
