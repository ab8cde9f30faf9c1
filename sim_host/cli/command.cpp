#include "command.h"

#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <unistd.h>

namespace ninespring
{

void check_outputs(const std::vector<std::string> &outputs, const std::vector<std::string> &inputs)
{
    namespace fs = std::filesystem;
    std::error_code ignored;
    for (const std::string &output : outputs) {
        if (output.empty() || output == "-") {
            continue;
        }
        const fs::path folder = fs::absolute(output, ignored).parent_path();
        if (!fs::is_directory(folder, ignored)) {
            throw input_error(output, 0, 0, "its folder does not exist; make it first");
        }
        if (fs::is_directory(output, ignored)) {
            throw input_error(output, 0, 0, "is a folder; name a file to write");
        }
        for (const std::string &input : inputs) {
            if (!input.empty() && fs::equivalent(output, input, ignored)) {
                throw input_error(output, 0, 0,
                                  "is an input of this command; write to another file");
            }
        }
        for (const std::string &other : outputs) {
            if (&other != &output && other == output) {
                throw input_error(output, 0, 0, "is named for two outputs; use two files");
            }
        }
    }
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
