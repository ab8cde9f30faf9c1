#include "traces.h"

#include <fmt/format.h>
#include <memory>
#include <stdexcept>

#include "runs.h"

namespace policy_bench
{

namespace
{

struct closer_t {
    void operator()(std::FILE *file) const { std::fclose(file); }
};
using file_t = std::unique_ptr<std::FILE, closer_t>;

file_t open(const std::string &directory, const char *name)
{
    const std::string path = fmt::format("{}/policy_{}.csv", directory, name);
    file_t file(std::fopen(path.c_str(), "w"));
    if (!file)
        throw std::runtime_error("cannot write " + path);
    return file;
}

void trace(const std::string &directory, const char *name, run_t wanted)
{
    const file_t file = open(directory, name);
    wanted.trace = file.get();
    run(wanted);
    if (std::ferror(file.get()) != 0)
        throw std::runtime_error(fmt::format("cannot write policy_{}.csv", name));
}

} // namespace

void write_traces(const std::string &directory, std::uint64_t seed)
{
    run_t base;
    base.seed = seed;
    base.trace_s = 2.56; // four sweeps of the dither

    run_t eight = base;
    eight.pattern = ring;
    trace(directory, "eight", eight);
    eight.drive = drive_t::kept_at_105;
    trace(directory, "b105", eight);
    eight.drive = drive_t::plain_current;
    trace(directory, "b15", eight);

    // the centre is held; at 350 s its neighbours are switched on
    run_t neighbours = base;
    neighbours.pattern = 1u << centre;
    neighbours.command = [](controller_t &controller, double time_s) {
        for (std::uint8_t k = 0; time_s >= 350.0 && k < springs; k++)
            controller_set_target(&controller, k, 1000);
    };
    trace(directory, "neighbours", neighbours);

    run_t lossy = base;
    lossy.pattern = ring;
    lossy.world.loss.fill(1.15);
    lossy.world.capacity.fill(1.15);
    trace(directory, "lossy", lossy);

    run_t nine = base;
    nine.pattern = all;
    nine.duration_s = 100.0;
    nine.trace_s = 0.64;
    trace(directory, "nine", nine);

    run_t levels = base;
    levels.pattern = 0;
    levels.duration_s = 400.0;
    levels.trace_s = 1.28;
    levels.command = [](controller_t &controller, double time_s) {
        const std::uint16_t level = time_s < 120.0 ? 500 : time_s < 220.0 ? 250 : 800;
        controller_set_target(&controller, centre, time_s < 320.0 ? level : 1000);
    };
    trace(directory, "levels", levels);

    // limits far below the defaults, so that they show: 60 degC, and undriven springs below 38
    run_t limits = base;
    limits.pattern = 1u;
    limits.duration_s = 60.0;
    limits.trace_s = 0.64;
    limits.set = [](controller_settings_t &settings) {
        settings.policy.temperature_limit_cc = 6000;
    };
    trace(directory, "own_limit", limits);
    limits.pattern = ring;
    limits.duration_s = 300.0;
    limits.trace_s = 1.28;
    limits.set = [](controller_settings_t &settings) { settings.policy.undriven_margin_cc = 5000; };
    trace(directory, "undriven_limit", limits);

    const file_t file = open(directory, "constant");
    std::fprintf(file.get(), "current_a,alone_c,nine_c\n");
    for (int centi_a = 100; centi_a <= 200; centi_a++)
        std::fprintf(file.get(), "%.2f,%.2f,%.2f\n", centi_a / 100.0,
                     steady_at(centi_a / 100.0, 1u << centre, centre).temperature_c,
                     steady_at(centi_a / 100.0, all, centre).temperature_c);
}

} // namespace policy_bench
