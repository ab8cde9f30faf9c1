/* Prints the board's figures: speed against bare simavr, cycles, load, stack, memory, boot time. */
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstring>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "bare_simavr.h"
#include "simulated_board.h"
#include "text_file.h"

using namespace ninespring;

namespace
{

constexpr double CYCLES_PER_S = BOARD_FREQUENCY_HZ;
constexpr double TICK_MS = 20.0;

nlohmann::ordered_json figures = nlohmann::ordered_json::array();

void figure(const std::string &name, double value, const std::string &unit,
            const std::string &target)
{
    fmt::print("{:<58} {:>12.4g} {:<8} {}\n", name, value, unit, target);
    figures.push_back({{"figure", name},
                       {"value", value},
                       {"unit", unit},
                       {"target", target},
                       {"command", "bench_board"}});
}

struct plant_owner {
    plant_t *plant = plant_create(3, 3);
    ~plant_owner() { plant_destroy(plant); }
};

template <typename work_t> double seconds(work_t work)
{
    const auto begin = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/* Everything on, so that sensors, model and outputs have work. */
void drive_all(simulated_board &board)
{
    board.run_ms(300.0);
    board.command("unlock");
    board.command("telemetry off");
    board.command("on all");
}

/* All take turns in short slices, so that what else this machine does hits them alike. */
void speed(const std::string &elf, double simulated_s)
{
    plant_owner owner;
    simulated_board board(elf, owner.plant, 1);
    bare_simavr_t *bare = bare_simavr_create(elf.c_str(), true);
    bare_simavr_t *stock = bare_simavr_create(elf.c_str(), false);
    if (bare == nullptr || stock == nullptr) {
        throw work_error(fmt::format("{}: simavr does not load it", elf));
    }
    drive_all(board);
    const auto slice = static_cast<std::uint64_t>(0.05 * CYCLES_PER_S);
    bare_simavr_run(bare, static_cast<std::uint64_t>(0.3 * CYCLES_PER_S));
    bare_simavr_run(stock, static_cast<std::uint64_t>(0.3 * CYCLES_PER_S));
    const auto awake = [&] { return board_cycle(board.get()) - board_idle_cycles(board.get()); };
    const std::uint64_t board_begin = awake();
    const std::uint64_t bare_begin = bare_simavr_idle_cycles(bare);
    double board_s = 0.0;
    double bare_s = 0.0;
    double stock_s = 0.0;
    double done_s = 0.0;
    double stock_done_s = 0.0;
    while (done_s < simulated_s) {
        board_s += seconds([&] { board.run_until(board_cycle(board.get()) + slice); });
        bare_s += seconds([&] { bare_simavr_run(bare, slice); });
        done_s += 0.05;
        if (done_s > 5.0 * stock_done_s) { /* it is slow: fewer slices do */
            stock_s += seconds([&] { bare_simavr_run(stock, slice); });
            stock_done_s += 0.05;
        }
    }
    /* The firmware sleeps when it has nothing to do, and sleep costs a simulator nothing; without
     * sensors and springs it has less to do. So the speeds are compared by the cycles in which it
     * was awake. */
    const double board_awake = static_cast<double>(awake() - board_begin);
    const double bare_awake =
        done_s * CYCLES_PER_S - static_cast<double>(bare_simavr_idle_cycles(bare) - bare_begin);
    bare_simavr_destroy(bare);
    bare_simavr_destroy(stock);
    figure("board simulation, speed relative to bare simavr",
           100.0 * (board_awake / board_s) / (bare_awake / bare_s), "%", ">= 80");
    figure("board simulation, cycles awake per second", board_awake / board_s / 1e6, "MHz", "");
    figure("bare simavr, cycles awake per second", bare_awake / bare_s / 1e6, "MHz", "");
    figure("board simulation", done_s / board_s, "x real", "");
    figure("bare simavr, timers 3 to 5 idle", done_s / bare_s, "x real", "about 5");
    figure("bare simavr as it is, timers 3 to 5 at 20 kHz", stock_done_s / stock_s, "x real",
           "0.9");
}

double mean_cycles(simulated_board &board, const char *function, unsigned calls,
                   const std::string &name, const std::string &target)
{
    board_measurement_t result{};
    if (!board_measure(board.get(), function, calls, 1500.0, &result) || result.calls == 0) {
        fmt::print("{:<58} not in this ELF\n", name);
        return 0.0;
    }
    const double mean = static_cast<double>(result.total_cycles) / result.calls;
    figure(name + ", mean", mean, "cycles", "");
    figure(name + ", longest", static_cast<double>(result.maximum_cycles), "cycles", target);
    return mean;
}

void cycles(const std::string &elf, const std::string &driver)
{
    plant_owner owner;
    simulated_board board(elf, owner.plant, 1);
    drive_all(board);
    mean_cycles(board, "controller_tick", 25, fmt::format("controller_tick ({} driver)", driver),
                "<= 100000");
    mean_cycles(board, "thermal_model_step", 5,
                fmt::format("thermal_model_step ({} driver)", driver), "");
    mean_cycles(board, "current_sensor_read", 25,
                fmt::format("nine sensors read over I2C ({} driver)", driver), "");
}

/* The longest time between bytes of the banner: from power-on until the console has answered. */
void boot(const std::string &elf)
{
    plant_owner owner;
    simulated_board board(elf, owner.plant, 1);
    std::string text;
    while (text.find('\n') == std::string::npos && board_time_s(board.get()) < 2.0) {
        board.run_ms(0.1);
        text += board.take_output();
    }
    figure("boot: power-on to the end of the first line", 1000.0 * board_time_s(board.get()), "ms",
           "");
}

void load(const std::string &elf, const std::string &driver)
{
    plant_owner owner;
    simulated_board board(elf, owner.plant, 1);
    drive_all(board);
    board.run_ms(1000.0);
    const std::uint64_t idle = board_idle_cycles(board.get());
    const std::uint64_t begin = board_cycle(board.get());
    board.run_ms(5000.0);
    const double slept = static_cast<double>(board_idle_cycles(board.get()) - idle);
    const double passed = static_cast<double>(board_cycle(board.get()) - begin);
    figure(fmt::format("load at 50 Hz, I2C included ({} driver)", driver),
           100.0 * (1.0 - slept / passed), "%", "<= 40");
    figure(fmt::format("flash ({} driver)", driver), board_flash_bytes(board.get()), "bytes",
           "<= 163840");
    figure(fmt::format("static RAM ({} driver)", driver), board_static_ram_bytes(board.get()),
           "bytes", "<= 6144");
    figure(fmt::format("stack high-water mark ({} driver)", driver),
           board_stack_high_water(board.get()), "bytes", "");
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App app{"Figures of the firmware on the simulated board"};
    std::string json;
    std::string elf = default_elf("firmware.elf");
    std::string adafruit = default_elf("firmware_adafruit.elf");
    double simulated_s = 5.0;
    app.add_option("--json", json, "Also write the figures to this file");
    app.add_option("--elf", elf, "Firmware with the integer driver")->capture_default_str();
    app.add_option("--adafruit", adafruit, "Firmware with the Adafruit library")
        ->capture_default_str();
    app.add_option("--seconds", simulated_s, "Simulated seconds of the speed comparison")
        ->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        speed(elf, simulated_s);
        boot(elf);
        cycles(elf, "integer");
        load(elf, "integer");
        if (FILE *file = std::fopen(adafruit.c_str(), "rb")) {
            std::fclose(file);
            cycles(adafruit, "Adafruit");
            load(adafruit, "Adafruit");
        } else {
            fmt::print("Adafruit driver: LEFT OUT, {} is not there (set ADAFRUIT_INA219_ROOT and "
                       "ADAFRUIT_BUSIO_ROOT)\n",
                       adafruit);
        }
        if (!json.empty()) {
            write_file_whole(json, figures.dump(2) + "\n");
        }
    } catch (const std::exception &error) {
        fmt::print(stderr, "bench_board: {}\n", error.what());
        return 1;
    }
    return 0;
}
