#include "command.h"

#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <unistd.h>

namespace ninespring
{

CLI::Option *add_output_option(CLI::App &command, const std::string &names, std::string &path,
                               const std::string &text)
{
    return command.add_option(names, path, text)
        ->check(CLI::Validator(
            [](const std::string &value) {
                return std::string(value.empty() ? "is empty; name a file to write" : "");
            },
            ""));
}

CLI::Validator number_from_to(double least, double most)
{
    return {[least, most](const std::string &value) {
                double parsed = 0.0;
                std::string problem = parse_number(value, parsed);
                if (problem.empty() && !(parsed >= least && parsed <= most)) {
                    problem = fmt::format("{} must be {} to {}", in_quotes(value), least, most);
                }
                return problem;
            },
            ""};
}

void add_seconds_option(CLI::App &command, const std::string &name, double &seconds,
                        const std::string &text)
{
    constexpr double year_s = 31536000.0;
    command.add_option(name, seconds, text)->check(number_from_to(0.0, year_s));
}

bool check_outputs(const std::vector<std::string> &outputs, const std::vector<std::string> &inputs)
{
    namespace fs = std::filesystem;
    std::error_code ignored;
    const auto whole = [&](const std::string &path) {
        return path == "-" ? fs::path(path) : fs::weakly_canonical(fs::absolute(path), ignored);
    };
    bool table = true;
    for (const std::string &output : outputs) {
        if (output.empty()) {
            continue;
        }
        for (const std::string &other : outputs) {
            if (&other != &output && !other.empty() && whole(other) == whole(output)) {
                throw input_error(output, 0, 0, "is named for two outputs; use two files");
            }
        }
        if (output == "-") {
            table = false;
            continue;
        }
        check_place(output);
        for (const std::string &input : inputs) {
            if (!input.empty() && fs::equivalent(output, input, ignored)) {
                throw input_error(output, 0, 0,
                                  "is an input of this command; write to another file");
            }
        }
        check_replaceable(output);
    }
    return table;
}

std::string json_text(const nlohmann::ordered_json &value)
{
    return value.dump(2, ' ', true, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

progress_line::progress_line(std::string what)
    : what_(std::move(what)), terminal_(isatty(STDERR_FILENO) != 0)
{
}

progress_line::~progress_line()
{
    if (shown_percent_ >= 0) {
        std::fputs("\r\033[K", stderr);
    }
}

void progress_line::show(double fraction)
{
    const int percent = static_cast<int>(100.0 * fraction);
    if (terminal_ && percent != shown_percent_) {
        shown_percent_ = percent;
        fmt::print(stderr, "\r{}: {} %", what_, percent);
        std::fflush(stderr);
    }
}

} // namespace ninespring
