/* ninespring-sim hil: the plant around a real board that runs firmware_hil. The board is the clock.
 */
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <fmt/format.h>
#include <limits>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include "controller.h"
#include "electrics.h"
#include "hil_frame.h"
#include "scenario_plant.h"

namespace ninespring
{

namespace
{

constexpr int SPRINGS = HIL_FRAME_MAX_SPRINGS;
constexpr double TICK_S = CONTROLLER_TICK_MS / 1000.0;
constexpr double PART_S = 0.001; /* the sensors see the plant in parts of a tick */
constexpr unsigned SENSOR_SAMPLES = 8;
constexpr double FIRST_FRAME_LIMIT_S = 10.0;
constexpr double SILENCE_LIMIT_S = 5.0;

volatile std::sig_atomic_t interrupted = 0;

void on_signal(int)
{
    interrupted = 1;
}

using clock = std::chrono::steady_clock;

double seconds_since(clock::time_point begin)
{
    return std::chrono::duration<double>(clock::now() - begin).count();
}

class serial_port
{
public:
    explicit serial_port(const std::string &path) : path_(path)
    {
        file_ = open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
        if (file_ < 0) {
            throw input_error(fmt::format("--port {}: {}", in_quotes(path), std::strerror(errno)));
        }
        termios settings{};
        if (tcgetattr(file_, &settings) != 0) {
            close(file_);
            throw input_error(fmt::format("--port {}: not a serial port", in_quotes(path)));
        }
        cfmakeraw(&settings);
        settings.c_cflag |= CLOCAL | CREAD;
        cfsetspeed(&settings, B115200);
        tcsetattr(file_, TCSANOW, &settings);
        while (!read_some().empty()) {
            /* what has piled up is of ticks that are over */
        }
    }
    ~serial_port() { close(file_); }
    serial_port(const serial_port &) = delete;
    serial_port &operator=(const serial_port &) = delete;

    [[nodiscard]] int file() const { return file_; }

    std::string read_some()
    {
        char bytes[512];
        const ssize_t count = read(file_, bytes, sizeof bytes);
        if (count < 0 && errno != EAGAIN && errno != EINTR) {
            throw work_error(fmt::format("{}: {}", path_, std::strerror(errno)));
        }
        return count > 0 ? std::string(bytes, static_cast<std::size_t>(count)) : std::string();
    }

    void write_all(const std::string &bytes)
    {
        std::size_t done = 0;
        while (done < bytes.size()) {
            const ssize_t count = write(file_, bytes.data() + done, bytes.size() - done);
            if (count > 0) {
                done += static_cast<std::size_t>(count);
            } else if (errno == EAGAIN) {
                pollfd wait{file_, POLLOUT, 0};
                poll(&wait, 1, 100);
            } else if (errno != EINTR) {
                throw work_error(fmt::format("{}: {}", path_, std::strerror(errno)));
            }
        }
    }

private:
    std::string path_;
    int file_;
};

struct hil_statistics {
    std::uint64_t ticks = 0;
    std::uint64_t lost_frames = 0;
    std::uint64_t bad_frames = 0;
    unsigned restarts = 0;
    unsigned max_lag_ticks = 0;
    double max_answer_ms = 0.0;
    double simulated_s = 0.0;
    double highest_c = 0.0;
    std::array<double, SPRINGS> final_current_a{};
};

/* The springs and their sensors, moved by the board's ticks. */
class hil_world
{
public:
    explicit hil_world(described_plant array)
        : plant_(std::move(array.plant)), springs_(plant_spring_count(plant_.get()))
    {
        if (springs_ > SPRINGS) {
            throw input_error(
                fmt::format("the board drives {} springs, the plant has {}", SPRINGS, springs_));
        }
        for (unsigned k = 0; k < SPRINGS; ++k) {
            electrics_ina219_init(&sensors_[k], SENSOR_SAMPLES, array.shunt_noise_v,
                                  array.bus_noise_v, array.seed + k);
        }
    }

    /* From then on its switch is closed, whatever the board says. */
    void close_switch(int spring, double from_s)
    {
        if (spring < 1 || spring > springs_) {
            throw input_error(fmt::format("--closed {}: there is no such spring; write 1 to {}",
                                          spring, springs_));
        }
        closed_from_s_[static_cast<std::size_t>(spring - 1)] = from_s;
    }

    void advance(unsigned ticks)
    {
        const auto parts = static_cast<unsigned>(std::lround(ticks * TICK_S / PART_S));
        for (unsigned part = 0; part < parts; ++part) {
            plant_step(plant_.get(), PART_S);
            for (int k = 0; k < SPRINGS; ++k) { /* nothing flows where no spring is connected */
                electrics_ina219_advance(&sensors_[static_cast<std::size_t>(k)], PART_S,
                                         current_a(k),
                                         k < springs_ ? plant_voltage_v(plant_.get(), k) : 0.0);
            }
        }
    }

    void drive(const hil_frame_duties_t &duties)
    {
        for (int k = 0; k < std::min<int>(springs_, duties.springs); ++k) {
            const double steps = std::min<double>(duties.duty[k], CONTROLLER_DUTY_MAX);
            const bool closed = time_s() >= closed_from_s_[static_cast<std::size_t>(k)];
            plant_drive(plant_.get(), k, PLANT_DRIVE_DUTY,
                        closed ? 1.0 : steps / CONTROLLER_DUTY_MAX);
            highest_c_ = std::max(highest_c_, plant_temperature_c(plant_.get(), k));
        }
        plant_set_fan(plant_.get(), std::min<double>(duties.fan_percent, 100.0) / 100.0);
    }

    std::string readings(std::uint16_t tick)
    {
        hil_frame_sensors_t frame{};
        frame.tick = tick;
        frame.springs = SPRINGS;
        frame.ambient_c7 =
            static_cast<std::int16_t>(std::lround(plant_ambient_c(plant_.get()) * 128.0));
        for (std::size_t k = 0; k < SPRINGS; ++k) {
            double current_a = 0.0;
            double voltage_v = 0.0;
            const bool fresh = electrics_ina219_take(&sensors_[k], &current_a, &voltage_v);
            frame.sensor[k].status = fresh ? CONTROLLER_SENSOR_OK : CONTROLLER_SENSOR_STALE;
            frame.sensor[k].current_ma = static_cast<std::int16_t>(std::lround(current_a * 1000.0));
            frame.sensor[k].voltage_mv = static_cast<std::int16_t>(std::lround(voltage_v * 1000.0));
        }
        char line[HIL_FRAME_MAX_LINE];
        return {line, hil_frame_encode_sensors(&frame, line)};
    }

    [[nodiscard]] double current_a(int k) const
    {
        return k < springs_ ? plant_current_a(plant_.get(), k) : 0.0;
    }
    [[nodiscard]] double time_s() const { return plant_time_s(plant_.get()); }
    [[nodiscard]] double highest_c() const { return highest_c_; }

private:
    plant_pointer plant_;
    int springs_;
    std::vector<double> closed_from_s_ =
        std::vector<double>(SPRINGS, std::numeric_limits<double>::infinity());
    double highest_c_ = -std::numeric_limits<double>::infinity();
    electrics_ina219_t sensors_[SPRINGS];
};

class hil_session
{
public:
    hil_session(serial_port &port, described_plant array) : port_(port), world_(std::move(array))
    {
        hil_frame_decoder_init(&decoder_);
    }

    /* Takes what has come; answers the newest duties. */
    void turn()
    {
        const std::string bytes = port_.read_some();
        const clock::time_point arrived = clock::now();
        unsigned frames = 0;
        for (const char c : bytes) {
            const hil_frame_event_t event =
                hil_frame_decode(&decoder_, static_cast<std::uint8_t>(c));
            if (event == HIL_FRAME_OUTSIDE) {
                std::fputc(c, stdout);
                note_answer(c);
            } else if (event == HIL_FRAME_BAD) {
                ++statistics_.bad_frames;
            } else if (event == HIL_FRAME_DUTIES) {
                take_duties();
                ++frames;
            }
        }
        std::fflush(stdout);
        if (frames > 0) {
            port_.write_all(world_.readings(tick_));
            last_frame_ = clock::now();
            statistics_.max_lag_ticks = std::max(statistics_.max_lag_ticks, frames);
            statistics_.max_answer_ms =
                std::max(statistics_.max_answer_ms, 1000.0 * seconds_since(arrived));
        }
        const double limit_s = statistics_.ticks == 0 ? FIRST_FRAME_LIMIT_S : SILENCE_LIMIT_S;
        if (seconds_since(last_frame_) > limit_s) {
            throw work_error(fmt::format(
                "no duties from the board for {} s; is it running firmware_hil?", limit_s));
        }
    }

    hil_world &world() { return world_; }
    [[nodiscard]] const hil_statistics &statistics() const { return statistics_; }
    /* Lines that the board's console has answered: `ok` or `error:...`. */
    [[nodiscard]] std::size_t answers() const { return answers_; }

private:
    void note_answer(char c)
    {
        if (c != '\n') {
            line_ += c;
            return;
        }
        if (line_.rfind("ok", 0) == 0 || line_.rfind("error:", 0) == 0) {
            ++answers_;
        }
        line_.clear();
    }

    void take_duties()
    {
        hil_frame_duties_t duties{};
        hil_frame_get_duties(&decoder_, &duties);
        if (statistics_.ticks > 0) {
            const auto passed = static_cast<std::uint16_t>(duties.tick - tick_);
            if (passed > 0x7FFF || passed == 0) {
                ++statistics_.restarts; /* its tick number went back */
            } else {
                statistics_.lost_frames += passed - 1u;
                world_.advance(passed);
            }
        }
        world_.drive(duties);
        tick_ = duties.tick;
        ++statistics_.ticks;
        statistics_.simulated_s = world_.time_s();
        statistics_.highest_c = world_.highest_c();
        for (int k = 0; k < SPRINGS; ++k) {
            statistics_.final_current_a[static_cast<std::size_t>(k)] = world_.current_a(k);
        }
    }

    serial_port &port_;
    hil_frame_decoder_t decoder_{};
    hil_world world_;
    hil_statistics statistics_;
    std::string line_; /* of the console, not yet ended */
    std::size_t answers_ = 0;
    std::uint16_t tick_ = 0;
    clock::time_point last_frame_ = clock::now();
};

struct hil_arguments {
    plant_arguments array;
    std::string port;
    std::vector<std::string> lines;
    int closed = 0; /* spring, from 1; 0: none */
    double closed_at_s = 0.0;
    double duration_s = 0.0;
    std::string json;
};

void report(const hil_statistics &statistics, const std::string &json)
{
    fmt::print(stderr,
               "{} ticks, {:.1f} s; frames lost {}, broken {}; board restarts {}; longest lag {} "
               "tick(s) of {} allowed, "
               "longest answer {:.1f} ms\n",
               statistics.ticks, statistics.simulated_s, statistics.lost_frames,
               statistics.bad_frames, statistics.restarts, statistics.max_lag_ticks,
               HIL_FRAME_MAX_LAG_TICKS, statistics.max_answer_ms);
    if (!json.empty()) {
        nlohmann::ordered_json value;
        value["schema"] = "ninespring.hil/1";
        value["ticks"] = statistics.ticks;
        value["simulated_s"] = statistics.simulated_s;
        value["lost_frames"] = statistics.lost_frames;
        value["bad_frames"] = statistics.bad_frames;
        value["restarts"] = statistics.restarts;
        value["max_lag_ticks"] = statistics.max_lag_ticks;
        value["allowed_lag_ticks"] = HIL_FRAME_MAX_LAG_TICKS;
        value["max_answer_ms"] = statistics.max_answer_ms;
        value["highest_c"] = statistics.highest_c;
        value["final_current_a"] = statistics.final_current_a;
        write_file_whole(json, json_text(value));
    }
}

/* Lines typed here go to the board's console; its answers are printed. */
void forward_typed(serial_port &port)
{
    char bytes[256];
    const ssize_t count = read(STDIN_FILENO, bytes, sizeof bytes);
    if (count > 0) {
        port.write_all(std::string(bytes, static_cast<std::size_t>(count)));
    }
}

void run_hil(const hil_arguments &arguments)
{
    check_outputs({arguments.json}, {arguments.array.scenario_path});
    described_plant array = describe_plant(arguments.array);
    serial_port port(arguments.port);
    hil_session session(port, std::move(array));
    if (arguments.closed != 0) {
        session.world().close_switch(arguments.closed, arguments.closed_at_s);
    }
    std::signal(SIGINT, on_signal);
    std::signal(SIGTERM, on_signal);
    const bool typed = isatty(STDIN_FILENO) != 0;
    std::size_t next_line = 0;
    while (interrupted == 0 && (arguments.duration_s == 0.0 ||
                                session.statistics().simulated_s < arguments.duration_s)) {
        pollfd wait[2] = {{port.file(), POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
        poll(wait, typed ? 2 : 1, 100);
        session.turn();
        if (typed && (wait[1].revents & POLLIN) != 0) {
            forward_typed(port);
        }
        /* the next line once the last is answered, and every half second at most */
        if (next_line < arguments.lines.size() && session.answers() >= next_line &&
            session.statistics().simulated_s > 0.5 * static_cast<double>(next_line + 1)) {
            port.write_all(arguments.lines[next_line++] + "\n");
        }
    }
    report(session.statistics(), arguments.json);
    if (session.statistics().max_lag_ticks > HIL_FRAME_MAX_LAG_TICKS) {
        throw work_error(
            fmt::format("the lag was {} ticks, more than the {} that the board accepts; "
                        "readings were dropped",
                        session.statistics().max_lag_ticks, HIL_FRAME_MAX_LAG_TICKS));
    }
}

} // namespace

void add_command_hil(CLI::App &app)
{
    auto arguments = std::make_shared<hil_arguments>();
    CLI::App *command = app.add_subcommand(
        "hil", "The plant around a real board that runs firmware_hil, over its serial port");
    command->add_option("--port", arguments->port, "Serial port, such as /dev/ttyACM0")->required();
    command
        ->add_option("--send", arguments->lines,
                     "Console line for the board, half a second apart; may be repeated")
        ->allow_extra_args(false);
    CLI::Option *closed =
        command
            ->add_option("--closed", arguments->closed,
                         "Spring whose switch fails closed: full duty whatever the board says")
            ->check(number_from_to(1.0, SPRINGS));
    add_seconds_option(*command, "--closed-at", arguments->closed_at_s,
                       "Simulated seconds at which it does so");
    command->get_option("--closed-at")->needs(closed);
    add_plant_options(*command, arguments->array);
    add_seconds_option(*command, "--duration", arguments->duration_s,
                       "Simulated seconds after which it ends; 0: Ctrl-C");
    add_output_option(*command, "--json", arguments->json, "Frames, losses and lag for programs");
    command->callback([arguments] { run_hil(*arguments); });
}

} // namespace ninespring
