/* ninespring-sim board: the firmware's ELF in a simulated Mega, in real time, behind a
 * pseudo-terminal. */
#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <thread>

#include "bench.h"
#include "board.h"
#include "board_pty.h"
#include "scenario_plant.h"
#include "simulated_board.h"
#include "thermometers.h"

namespace ninespring
{

namespace
{

volatile std::sig_atomic_t interrupted = 0;

void on_signal(int)
{
    interrupted = 1;
}

struct board_arguments {
    plant_arguments array;
    thermometer_arguments thermometers;
    bench_arguments wiring;
    std::string elf;
    std::string speed = "1";
    std::string eeprom;
    double duration_s = 0.0; /* 0: until interrupted */
};

/* 0 is as fast as it goes. */
double speed_of(const std::string &text)
{
    if (text == "max") {
        return 0.0;
    }
    double speed = 0.0;
    const std::string problem = parse_number(text, speed);
    if (!problem.empty() || !(speed >= 0.01 && speed <= 100.0)) {
        throw input_error(
            fmt::format("--speed {}: write max, or a number from 0.01 to 100", in_quotes(text)));
    }
    return speed;
}

/* Keeps simulated time from running ahead of the clock on the wall. */
class pace
{
public:
    explicit pace(double speed) : speed_(speed), begun_(std::chrono::steady_clock::now()) {}

    void wait(double simulated_s)
    {
        if (speed_ == 0.0) {
            return;
        }
        const double now_s = elapsed_s();
        const double ahead_s = (simulated_s - shift_s_) / speed_ - now_s;
        if (ahead_s > 0.0) {
            std::this_thread::sleep_for(std::chrono::duration<double>(ahead_s));
        } else if (ahead_s < -MAX_BEHIND_S) {
            shift_s_ = simulated_s - now_s * speed_; /* does not hurry after a pause */
            lost_s_ -= ahead_s;
        }
    }
    [[nodiscard]] double lost_s() const { return lost_s_; }

private:
    static constexpr double MAX_BEHIND_S = 0.2;
    [[nodiscard]] double elapsed_s() const
    {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun_).count();
    }
    double speed_;
    std::chrono::steady_clock::time_point begun_;
    double shift_s_ = 0.0;
    double lost_s_ = 0.0;
};

/* Has time stand still until a client has read what was written: as fast as it goes is faster than
 * anybody reads, and would make an instant's delay of the reader a long one. A port that is left
 * alone is not awaited. */
class reader
{
public:
    reader(const board_pty_t *pty, std::size_t unread_most, std::chrono::seconds left_alone)
        : pty_(pty), unread_most_(unread_most), left_alone_(left_alone)
    {
    }
    void await()
    {
        if (pty_ == nullptr) {
            return;
        }
        const auto until = std::chrono::steady_clock::now() + left_alone_;
        bool behind = board_pty_unread(pty_) > unread_most_;
        while (behind && reads_ && interrupted == 0) {
            std::this_thread::sleep_for(LOOK_AGAIN);
            behind = board_pty_unread(pty_) > unread_most_;
            reads_ = std::chrono::steady_clock::now() < until;
        }
        reads_ = reads_ || !behind;
    }

private:
    static constexpr std::chrono::microseconds LOOK_AGAIN{200};
    const board_pty_t *pty_;
    std::size_t unread_most_;
    std::chrono::seconds left_alone_;
    bool reads_ = false;
};

/* Whoever is heard now and then by the clock on the wall is never silent for longer by the board's:
 * as fast as it goes, an instant between a client's words would be seconds, and `host_timeout_s` is
 * by the board's clock. A client that is silent for long has left: then time is free again. */
class listener
{
public:
    listener(const board_pty_t *pty, std::chrono::seconds left_alone)
        : pty_(pty), left_alone_s_(static_cast<double>(left_alone.count()))
    {
    }
    void heard(double board_s)
    {
        heard_board_s_ = board_s;
        heard_ = std::chrono::steady_clock::now();
        somebody_ = true;
    }
    void await(double board_s)
    {
        const double silent_s = board_s - heard_board_s_;
        if (!somebody_ || silent_s < FREE_S) {
            return;
        }
        const double wall_s =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - heard_).count();
        somebody_ = wall_s < left_alone_s_;
        if (somebody_ && silent_s > wall_s) {
            board_pty_await(pty_, std::min(silent_s, left_alone_s_) - wall_s);
        }
    }

private:
    static constexpr double FREE_S = 1.5; /* more than from one word of a host to the next */
    const board_pty_t *pty_;
    double left_alone_s_;
    double heard_board_s_ = 0.0;
    std::chrono::steady_clock::time_point heard_;
    bool somebody_ = false;
};

/* Of a client, by the clock on the wall. */
constexpr std::chrono::seconds LEFT_ALONE{10};

/* A row of nine springs: to wait after each byte would cost more than the simulation. */
constexpr std::size_t BOARD_UNREAD_MOST = 256;

class terminal
{
public:
    terminal()
    {
        if (board_pty_open(&pty_) != 0) {
            throw work_error(fmt::format("no pseudo-terminal to be had: {}", std::strerror(errno)));
        }
    }
    ~terminal() { board_pty_close(&pty_); }
    terminal(const terminal &) = delete;
    terminal &operator=(const terminal &) = delete;
    board_pty_t *get() { return &pty_; }

private:
    board_pty_t pty_{};
};

void run_board(const board_arguments &arguments)
{
    const double speed = speed_of(arguments.speed);
    const described_plant array = describe_plant(arguments.array);
    simulated_board board(arguments.elf, array.plant.get(), array.seed, array.shunt_noise_v,
                          array.bus_noise_v);
    bench around(arguments.wiring, board.get());
    eeprom_file eeprom(arguments.eeprom, board.get());
    terminal port;
    thermometers logger(arguments.thermometers, array.plant.get(), array.seed);
    std::signal(SIGINT, on_signal);
    std::signal(SIGTERM, on_signal);
    fmt::print("{}\n", port.get()->name);
    if (!logger.name().empty()) {
        fmt::print("{}\n", logger.name());
    }
    fmt::print(stderr, "board on {} at 115200 baud, {}; Ctrl-C ends it\n", port.get()->name,
               speed == 0.0 ? std::string("as fast as it goes")
                            : fmt::format("{} x real time", speed));
    std::fflush(stdout);

    pace clock(speed);
    reader of_board(port.get(), BOARD_UNREAD_MOST, LEFT_ALONE);
    listener to_client(port.get(), LEFT_ALONE);
    reader of_logger(logger.port(), 0, std::chrono::seconds(1));
    std::uint8_t bytes[256];
    while (interrupted == 0 &&
           (arguments.duration_s == 0.0 || board_time_s(board.get()) < arguments.duration_s)) {
        if (board_send_backlog(board.get()) < sizeof bytes) {
            const std::size_t count = board_pty_read(port.get(), bytes, sizeof bytes);
            if (count > 0) {
                around.look_again(); /* before what comes is obeyed */
                to_client.heard(board_time_s(board.get()));
            }
            board_send(board.get(), bytes, count);
        }
        board.run_ms(1.0);
        const std::string text = board.take_output();
        board_pty_write(port.get(), reinterpret_cast<const std::uint8_t *>(text.data()),
                        text.size());
        logger.follow(board_time_s(board.get()));
        if (speed == 0.0) {
            of_board.await();
            of_logger.await();
            to_client.await(board_time_s(board.get()));
        }
        eeprom.save_when_idle();
        clock.wait(board_time_s(board.get()));
    }
    eeprom.save();
    if (clock.lost_s() > 0.0) {
        fmt::print(stderr, "this machine was too slow: {:.1f} s were lost against the wall clock\n",
                   clock.lost_s());
    }
}

} // namespace

void add_command_board(CLI::App &app)
{
    auto arguments = std::make_shared<board_arguments>();
    arguments->elf = default_elf("firmware.elf");
    CLI::App *command =
        app.add_subcommand("board", "A simulated board on a pseudo-terminal, for any serial "
                                    "terminal: prints its name and runs until Ctrl-C");
    command->add_option("--elf", arguments->elf, "The firmware")->capture_default_str();
    command->add_option("--speed", arguments->speed, "Times real time, or max")
        ->capture_default_str();
    command->add_option("--eeprom", arguments->eeprom,
                        "File that keeps the EEPROM; made if it is not there");
    add_plant_options(*command, arguments->array);
    add_bench_options(*command, arguments->wiring);
    add_thermometer_options(*command, arguments->thermometers);
    add_seconds_option(*command, "--duration", arguments->duration_s,
                       "Simulated seconds after which it ends; 0: never");
    command->callback([arguments] { run_board(*arguments); });
}

} // namespace ninespring
