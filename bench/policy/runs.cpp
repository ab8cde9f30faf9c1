#include "runs.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <fmt/format.h>
#include <memory>
#include <mutex>
#include <thread>

#include "electrics.h"
#include "loop.h"

namespace policy_bench
{

namespace
{

struct plant_deleter {
    void operator()(plant_t *plant) const { plant_destroy(plant); }
};
using plant_owner = std::unique_ptr<plant_t, plant_deleter>;

struct loop_deleter {
    void operator()(loop_t *loop) const { loop_destroy(loop); }
};
using loop_owner = std::unique_ptr<loop_t, loop_deleter>;

constexpr double baseline_dt_s = 0.1;

plant_owner build(const world_t &world)
{
    plant_owner plant(plant_create(3, 3));
    plant_set_effect(plant.get(), "latent_heat", true);
    plant_set_effect(plant.get(), "resistance_phase", true);
    plant_set(plant.get(), "orthogonal_w_per_k", 586e-6 * world.orthogonal);
    plant_set(plant.get(), "diagonal_w_per_k", 293e-6 * world.diagonal);
    plant_set(plant.get(), "ambient_c", world.ambient_c);
    for (std::size_t k = 0; k < springs; k++) {
        const auto set = [&](const char *name, double value) {
            plant_set(plant.get(), fmt::format("{}[{}]", name, k + 1).c_str(), value);
        };
        const double martensite_ohm = 0.175 * world.resistance[k];
        set("heat_capacity_j_per_k", 0.300 * world.capacity[k]);
        set("loss_w_per_k", 5.8e-3 * world.loss[k]);
        set("resistance_martensite_ohm", martensite_ohm);
        set("resistance_austenite_ohm",
            martensite_ohm * (1.0 + (0.219 / 0.175 - 1.0) * world.change[k]));
    }
    plant_reset(plant.get());
    return plant;
}

outcome_t blank()
{
    outcome_t result{};
    for (int k = 0; k < springs; k++) {
        result.full_s[k] = result.least_phase[k] = none;
    }
    result.release_s = none;
    result.band_low_c = 1e9;
    result.band_high_c = -1e9;
    return result;
}

void watch(outcome_t &result, const plant_t *plant, const run_t &wanted, double time_s, double dt_s)
{
    if (time_s >= wanted.band_from_s) {
        result.band_low_c = std::min(result.band_low_c, plant_temperature_c(plant, centre));
        result.band_high_c = std::max(result.band_high_c, plant_temperature_c(plant, centre));
    }
    for (int k = 0; k < springs; k++) {
        const double phase = plant_austenite(plant, k);
        const double temperature_c = plant_temperature_c(plant, k);
        result.highest_c = std::max(result.highest_c, temperature_c);
        result.energy_j += plant_power_w(plant, k) * dt_s;
        if (!is_on(wanted.pattern, k)) {
            result.undriven_phase = std::max(result.undriven_phase, phase);
        } else if (std::isnan(result.full_s[k])) {
            if (phase >= 0.99) {
                result.full_s[k] = time_s;
                result.least_phase[k] = phase;
            }
        } else {
            result.least_phase[k] = std::min(result.least_phase[k], phase);
        }
        if (time_s > wanted.duration_s - 30.0)
            result.end_c[k] += temperature_c * dt_s / 30.0;
    }
}

// Mean currents of an interval, so that the dither is not sampled.
class tracer
{
public:
    explicit tracer(const run_t &wanted) : file_(wanted.trace)
    {
        if (file_ == nullptr)
            return;
        std::fprintf(file_, "time_s");
        for (int k = 1; k <= springs; k++)
            std::fprintf(file_, ",t%d_c,x%d,i%d_a,m%d_c", k, k, k, k);
        std::fprintf(file_, "\n");
    }

    void add(const run_t &wanted, const plant_t *plant, const loop_t *loop,
             const controller_t *controller)
    {
        if (file_ == nullptr)
            return;
        for (int k = 0; k < springs; k++)
            sum_a_[k] += loop == nullptr ? plant_current_a(plant, k) : loop_current_a(loop, k);
        count_++;
        if (count_ * (loop == nullptr ? baseline_dt_s : LOOP_TICK_S) < wanted.trace_s - 1e-9)
            return;
        std::fprintf(file_, "%.2f", loop == nullptr ? plant_time_s(plant) : loop_time_s(loop));
        for (int k = 0; k < springs; k++) {
            std::fprintf(file_, ",%.2f,%.4f,%.3f,", plant_temperature_c(plant, k),
                         plant_austenite(plant, k), sum_a_[k] / count_);
            if (controller != nullptr)
                std::fprintf(file_, "%.2f",
                             controller_temperature_c7(controller, static_cast<std::uint8_t>(k)) /
                                 128.0);
        }
        std::fprintf(file_, "\n");
        std::fill(std::begin(sum_a_), std::end(sum_a_), 0.0);
        count_ = 0;
    }

private:
    std::FILE *file_;
    double sum_a_[springs] = {};
    int count_ = 0;
};

outcome_t run_policy(const run_t &wanted)
{
    const plant_owner plant = build(wanted.world);
    controller_settings_t settings;
    controller_settings_default(&settings);
    settings.policy.policy = DRIVE_POLICY_PRECOMPENSATE;
    settings.policy.observer = wanted.drive == drive_t::policy ? 1 : 0;
    if (wanted.set)
        wanted.set(settings);
    loop_options_t options;
    loop_options_default(&options);
    options.ambient_error_c = 20.0 - wanted.world.ambient_c;
    const loop_owner owner(loop_create(&settings, plant.get(), &options, wanted.seed, nullptr));
    loop_t *loop = owner.get();
    controller_t *controller = loop_controller(loop);
    // what is measured is the drive, not the start: the console's `model cold`
    controller_set_temperature(controller, controller->ambient_c7);
    outcome_t result = blank();
    tracer trace(wanted);
    for (int k = 0; k < springs; k++)
        controller_set_target(controller, static_cast<std::uint8_t>(k),
                              is_on(wanted.pattern, k) ? 1000 : 0);
    const long ticks = std::lround(wanted.duration_s / LOOP_TICK_S);
    for (long tick = 1; tick <= ticks; tick++) {
        if (wanted.command)
            wanted.command(*controller, loop_time_s(loop));
        loop_tick(loop);
        watch(result, loop_plant(loop), wanted, loop_time_s(loop), LOOP_TICK_S);
        trace.add(wanted, loop_plant(loop), loop, controller);
        for (int k = 0; tick % 50 == 0 && k < springs; k++) {
            const double error =
                controller_temperature_c7(controller, static_cast<std::uint8_t>(k)) / 128.0 -
                plant_temperature_c(loop_plant(loop), k);
            result.estimate_square_k2 += error * error;
            result.estimate_count += 1.0;
        }
    }
    if (wanted.release == release_t::yes) {
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
    return result;
}

// B105: 3.0 A until 105 degC, then kept there; B1.5: 1.5 A from the start.
outcome_t run_baseline(const run_t &wanted)
{
    const plant_owner owner = build(wanted.world);
    plant_t *plant = owner.get();
    const bool kept = wanted.drive == drive_t::kept_at_105;
    int driven = 0;
    for (int k = 0; k < springs; k++)
        driven += is_on(wanted.pattern, k) ? 1 : 0;
    double current_a = kept ? 3.0 : wanted.current_a;
    if (!std::isnan(wanted.supply_a))
        current_a = std::min(current_a, wanted.supply_a / driven);
    outcome_t result = blank();
    tracer trace(wanted);
    std::array<bool, springs> arrived{};
    for (int k = 0; k < springs; k++)
        plant_drive(plant, k, PLANT_DRIVE_CURRENT, is_on(wanted.pattern, k) ? current_a : 0.0);
    const long steps = std::lround(wanted.duration_s / baseline_dt_s);
    for (long step = 1; step <= steps; step++) {
        double sum_a = 0.0;
        for (int k = 0; k < springs; k++)
            sum_a += plant_current_a(plant, k);
        result.highest_sum_a = std::max(result.highest_sum_a, sum_a);
        plant_step(plant, baseline_dt_s);
        watch(result, plant, wanted, plant_time_s(plant), baseline_dt_s);
        trace.add(wanted, plant, nullptr, nullptr);
        for (int k = 0; kept && k < springs; k++) {
            auto &there = arrived[static_cast<std::size_t>(k)];
            if (!there && is_on(wanted.pattern, k) && plant_temperature_c(plant, k) >= 105.0) {
                there = true;
                plant_drive(plant, k, PLANT_DRIVE_TEMPERATURE, 105.0);
            }
        }
    }
    if (wanted.release == release_t::yes) {
        plant_drive(plant, centre, PLANT_DRIVE_POWER, 0.0);
        const double from_s = plant_time_s(plant);
        while (plant_austenite(plant, centre) > 0.01 && plant_time_s(plant) < from_s + 3600)
            plant_step(plant, baseline_dt_s);
        result.release_s = plant_time_s(plant) - from_s;
    }
    return result;
}

} // namespace

world_t nominal()
{
    world_t world{};
    world.capacity.fill(1.0);
    world.loss.fill(1.0);
    world.resistance.fill(1.0);
    world.change.fill(1.0);
    world.orthogonal = world.diagonal = 1.0;
    world.ambient_c = 20.0;
    return world;
}

world_t drawn(std::uint64_t seed, unsigned index, double change_spread)
{
    electrics_noise_t noise;
    electrics_noise_seed(&noise, seed * 1000003u + index);
    const auto draw = [&](double width) {
        return width * (2.0 * electrics_noise_uniform(&noise) - 1.0);
    };
    world_t world = nominal();
    const double capacity = 1.0 + draw(0.15);
    const double loss = 1.0 + draw(0.15);
    for (std::size_t k = 0; k < springs; k++) {
        world.capacity[k] = index % 2 == 0 ? capacity : 1.0 + draw(0.15);
        world.loss[k] = index % 2 == 0 ? loss : 1.0 + draw(0.15);
        world.resistance[k] = 1.0 + draw(0.15);
        world.change[k] = 1.0 + draw(change_spread);
    }
    world.orthogonal = 1.0 + draw(0.15);
    world.diagonal = 1.0 + draw(0.15);
    world.ambient_c = 20.0 + draw(3.0);
    return world;
}

outcome_t run(const run_t &wanted)
{
    return wanted.drive == drive_t::policy || wanted.drive == drive_t::policy_without_observer
               ? run_policy(wanted)
               : run_baseline(wanted);
}

std::vector<outcome_t> sweep(unsigned count, unsigned workers, const std::string &what,
                             const std::function<outcome_t(unsigned)> &job)
{
    std::vector<outcome_t> results(count);
    std::atomic<unsigned> next{0};
    std::mutex speaking;
    const unsigned step = std::max(count / 10, 1u);
    const auto work = [&] {
        for (unsigned k = next++; k < count; k = next++) {
            results[k] = job(k);
            if ((k + 1) % step == 0) {
                const std::lock_guard<std::mutex> lock(speaking);
                fmt::print(stderr, "{}: {} of {}\n", what, k + 1, count);
            }
        }
    };
    std::vector<std::thread> threads;
    for (unsigned w = 0; w < workers; w++)
        threads.emplace_back(work);
    for (std::thread &thread : threads)
        thread.join();
    return results;
}

double slowest_s(const outcome_t &outcome, pattern_t pattern)
{
    double time_s = 0.0;
    for (int k = 0; k < springs; k++)
        if (is_on(pattern, k))
            time_s = std::isnan(outcome.full_s[k]) ? none : std::max(time_s, outcome.full_s[k]);
    return time_s;
}

std::array<pattern_t, 32> fraction_of_patterns(unsigned fraction)
{
    std::array<pattern_t, 32> chosen{};
    for (pattern_t base = 0; base < 32; base++) {
        const auto factor = [&](int k) { return (base >> k) & 1u; };
        const pattern_t parity = factor(0) ^ factor(1) ^ factor(2) ^ factor(3) ^ factor(4);
        pattern_t pattern = base;
        // F = BCDE, G = ACDE, H = ABDE, J = ABCE, each as it is or inverted
        for (int g = 0; g < 4; g++)
            pattern |= (parity ^ factor(g) ^ ((fraction >> g) & 1u)) << (5 + g);
        chosen[base] = pattern;
    }
    return chosen;
}

steady_t steady_at(double current_a, pattern_t pattern, int spring)
{
    const plant_owner plant = build(nominal());
    for (int k = 0; k < springs; k++)
        plant_drive(plant.get(), k, PLANT_DRIVE_CURRENT, is_on(pattern, k) ? current_a : 0.0);
    plant_step(plant.get(), 3600.0);
    return {plant_temperature_c(plant.get(), spring), plant_austenite(plant.get(), spring)};
}

} // namespace policy_bench
