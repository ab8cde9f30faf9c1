#include "thermometers.h"

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <sstream>

#include "command.h"
#include "text_file.h"

namespace ninespring
{

namespace
{

/* Whoever begins to listen in the middle learns the columns within so many lines. */
constexpr std::uint64_t LINES_PER_HEADER = 10;

std::vector<int> springs_of(const std::string &text, int count)
{
    std::vector<int> springs;
    if (text == "all") {
        for (int k = 0; k < count; ++k) {
            springs.push_back(k);
        }
        return springs;
    }
    std::istringstream stream(text);
    std::string word;
    while (std::getline(stream, word, ',')) {
        int spring = 0;
        const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), spring);
        if (status != std::errc() || end != word.data() + word.size() || spring < 1 ||
            spring > count || (!springs.empty() && spring - 1 <= springs.back())) {
            throw input_error(fmt::format("--thermometer-springs {}: write all, or springs from 1 "
                                          "to {}, rising, as in 1,3,5",
                                          in_quotes(text), count));
        }
        springs.push_back(spring - 1);
    }
    if (springs.empty()) {
        throw input_error("--thermometer-springs: names no spring");
    }
    return springs;
}

} // namespace

void add_thermometer_options(CLI::App &command, thermometer_arguments &arguments)
{
    CLI::Option *target = command.add_option(
        "--thermometers", arguments.target,
        "A thermocouple logger beside the board: pty (its name is the second line printed), or a "
        "file, which is replaced");
    const auto option = [&](const char *name, auto &value, const char *text) {
        return command.add_option(name, value, text)->capture_default_str()->needs(target);
    };
    option("--thermometer-rate", arguments.rate_hz, "Lines a second")
        ->check(number_from_to(0.01, 50.0));
    option("--thermometer-noise", arguments.noise_c, "Standard deviation of a reading, degC")
        ->check(number_from_to(0.0, 100.0));
    option("--thermometer-lag", arguments.lag_s, "Time constant, s; 0: as the scenario has it")
        ->check(number_from_to(0.0, 1e4));
    option("--thermometer-springs", arguments.springs, "Which have one: all, or as in 1,3,5");
}

thermometers::thermometers(const thermometer_arguments &arguments, plant_t *plant,
                           std::uint64_t seed)
    : plant_(plant), period_s_(1.0 / arguments.rate_hz), noise_c_(arguments.noise_c)
{
    if (arguments.target.empty()) {
        return;
    }
    springs_ = springs_of(arguments.springs, plant_spring_count(plant));
    header_ = "time_s";
    for (const int k : springs_) {
        header_ += fmt::format(",t{}_c", k + 1);
    }
    if (arguments.lag_s > 0.0 && (plant_set_effect(plant, "sensor_lag", true) != PLANT_OK ||
                                  plant_set(plant, "sensor_lag_s", arguments.lag_s) != PLANT_OK)) {
        throw input_error("--thermometer-lag: must be 0, or 0.001 to 10000 s");
    }
    electrics_noise_seed(&noise_, seed ^ 0x7468'6572'6d6f'6d65u); /* not the board's */
    if (arguments.target == "pty") {
        if (board_pty_open(&pty_) != 0) {
            throw work_error(fmt::format("no pseudo-terminal to be had: {}", std::strerror(errno)));
        }
        name_ = pty_.name;
    } else {
        name_ = arguments.target;
        check_place(name_);
        check_replaceable(name_);
        file_.open(name_, std::ios::trunc);
        if (!file_) {
            throw work_error(fmt::format("{}: cannot be written: {}", name_, std::strerror(errno)));
        }
        say("# tool: ninespring-sim " NINESPRING_VERSION " thermometers");
    }
}

thermometers::~thermometers()
{
    if (pty_.master >= 0) {
        board_pty_close(&pty_);
    }
}

void thermometers::say(const std::string &line)
{
    if (file_.is_open()) {
        file_ << line << '\n' << std::flush;
        if (!file_) {
            throw work_error(fmt::format("{}: cannot be written: {}", name_, std::strerror(errno)));
        }
        return;
    }
    const std::string text = line + "\r\n";
    board_pty_write(&pty_, reinterpret_cast<const std::uint8_t *>(text.data()), text.size());
}

void thermometers::follow(double time_s)
{
    if (name_.empty() || time_s < static_cast<double>(lines_) * period_s_) {
        return;
    }
    if (lines_ == 0 || (!file_.is_open() && lines_ % LINES_PER_HEADER == 0)) {
        say(header_);
    }
    std::string line = fmt::format("{:.3f}", time_s);
    for (const int k : springs_) {
        line += fmt::format(",{:.2f}", plant_measured_c(plant_, k) +
                                           noise_c_ * electrics_noise_normal(&noise_));
    }
    say(line);
    ++lines_;
}

} // namespace ninespring
