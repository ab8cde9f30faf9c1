#include "text_file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <unistd.h>

namespace ninespring
{

namespace
{

std::string place_text(const std::string &file, std::size_t line, std::size_t column)
{
    if (line == 0) {
        return file;
    }
    if (column == 0) {
        return fmt::format("{}:{}", file, line);
    }
    return fmt::format("{}:{}:{}", file, line, column);
}

} // namespace

std::string read_bytes(const std::string &path)
{
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) {
        throw input_error(path, 0, 0, "is a folder; name a file");
    }
    std::FILE *file = std::fopen(path.c_str(), "rb");
    if (file == nullptr) {
        throw input_error(path, 0, 0,
                          fmt::format("cannot be read ({}); check the name", std::strerror(errno)));
    }
    std::string bytes;
    std::array<char, 1U << 16U> block{};
    std::size_t count = 0;
    while ((count = std::fread(block.data(), 1, block.size(), file)) > 0) {
        bytes.append(block.data(), count);
    }
    const bool failed = std::ferror(file) != 0;
    std::fclose(file);
    if (failed) {
        throw input_error(path, 0, 0, "cannot be read to its end; check the disk");
    }
    return bytes;
}

input_error::input_error(const std::string &file, std::size_t line, std::size_t column,
                         const std::string &message)
    : std::runtime_error(place_text(file, line, column) + ": " + message)
{
}

text_file make_text_file(const std::string &name, std::string text, std::size_t max_line)
{
    if (text.size() >= 2 &&
        ((text[0] == '\xFF' && text[1] == '\xFE') || (text[0] == '\xFE' && text[1] == '\xFF'))) {
        throw input_error(name, 1, 1, "the file is UTF-16; save it as UTF-8");
    }
    if (text.compare(0, 3, "\xEF\xBB\xBF") == 0) {
        text.erase(0, 3);
    }
    if (text.empty()) {
        throw input_error(name, 1, 1, "the file is empty; was it written to its end?");
    }
    std::size_t line = 1;
    std::size_t start = 0;
    while (start < text.size()) {
        const void *found = std::memchr(text.data() + start, '\n', text.size() - start);
        const std::size_t end =
            found == nullptr
                ? text.size()
                : static_cast<std::size_t>(static_cast<const char *>(found) - text.data());
        if (end - start > max_line) {
            throw input_error(name, line, max_line + 1,
                              fmt::format("the line has {} characters, at most {} are allowed; "
                                          "check how the file was written",
                                          end - start, max_line));
        }
        const void *zero = std::memchr(text.data() + start, '\0', end - start);
        if (zero != nullptr) {
            const auto column =
                static_cast<std::size_t>(static_cast<const char *>(zero) - text.data()) - start + 1;
            throw input_error(name, line, column, "a zero byte: this is not a text file");
        }
        start = end + 1;
        ++line;
    }
    return text_file{name, std::move(text)};
}

text_file read_text_file(const std::string &path, std::size_t max_line)
{
    return make_text_file(path, read_bytes(path), max_line);
}

std::string_view next_line(std::string_view text, std::size_t &position)
{
    const std::size_t start = position;
    std::size_t end = text.find('\n', start);
    if (end == std::string_view::npos) {
        end = text.size();
        position = end;
    } else {
        position = end + 1;
    }
    if (end > start && text[end - 1] == '\r') {
        --end;
    }
    return text.substr(start, end - start);
}

std::string in_quotes(std::string_view text)
{
    constexpr std::size_t most = 40;
    std::string result = "'";
    for (std::size_t k = 0; k < text.size() && k < most; ++k) {
        const char c = text[k];
        result += (c >= ' ' && c <= '~') ? c : '?';
    }
    if (text.size() > most) {
        result += "...";
    }
    return result + "'";
}

std::string parse_number(std::string_view text, double &value)
{
    std::string_view digits = text;
    if (!digits.empty() && digits.front() == '+') {
        digits.remove_prefix(1);
        if (!digits.empty() && (digits.front() == '-' || digits.front() == '+')) {
            return fmt::format("{} is not a number; write it like 12.5", in_quotes(text));
        }
    }
    if (digits.empty()) {
        return "a number is missing; write it like 12.5";
    }
    double parsed = 0.0;
    const auto [end, status] =
        std::from_chars(digits.data(), digits.data() + digits.size(), parsed);
    if (status == std::errc::result_out_of_range) {
        return fmt::format("{} is too large or too small for a number", in_quotes(text));
    }
    if (status != std::errc() || end != digits.data() + digits.size()) {
        if (status == std::errc() && *end == ',') {
            return fmt::format("{} has a decimal comma; write a decimal point", in_quotes(text));
        }
        if (status == std::errc() && *end == '%') {
            return fmt::format("{} is a percentage; write a fraction of 1", in_quotes(text));
        }
        return fmt::format("{} is not a number; write it like 12.5", in_quotes(text));
    }
    if (!std::isfinite(parsed)) {
        return fmt::format("{} is not a finite number", in_quotes(text));
    }
    value = parsed;
    return {};
}

std::string did_you_mean(std::string_view wrong, const std::vector<std::string> &names)
{
    if (wrong.size() > 64) {
        return {};
    }
    std::size_t best_distance = std::max<std::size_t>(1, wrong.size() / 3);
    const std::string *best = nullptr;
    for (const std::string &name : names) {
        if (!wrong.empty() && name.size() > wrong.size() &&
            name.compare(0, wrong.size(), wrong) == 0 && best == nullptr) {
            best = &name; /* the beginning of a name, unless a nearer one comes */
        }
        std::vector<std::size_t> row(name.size() + 1);
        for (std::size_t k = 0; k < row.size(); ++k) {
            row[k] = k;
        }
        for (std::size_t i = 0; i < wrong.size(); ++i) {
            std::size_t diagonal = row[0];
            row[0] = i + 1;
            for (std::size_t k = 0; k < name.size(); ++k) {
                const std::size_t above = row[k + 1];
                row[k + 1] =
                    std::min({above + 1, row[k] + 1, diagonal + (wrong[i] == name[k] ? 0U : 1U)});
                diagonal = above;
            }
        }
        if (row[name.size()] <= best_distance) {
            best_distance = row[name.size()];
            best = &name;
            if (best_distance == 0) {
                break;
            }
            --best_distance; /* the first of equals stays */
        }
    }
    return best == nullptr ? std::string() : fmt::format("; did you mean {}?", *best);
}

namespace
{

/* The first line of what this tool writes: its version may be another one. */
bool is_own(const std::string &path)
{
    constexpr std::string_view csv = "# tool: ninespring-sim ";
    constexpr std::string_view json = "{\n  \"schema\": \"ninespring.";
    std::array<char, 64> bytes{};
    std::FILE *file = std::fopen(path.c_str(), "rb");
    if (file == nullptr) {
        return false;
    }
    const std::string_view begin(bytes.data(), std::fread(bytes.data(), 1, bytes.size(), file));
    std::fclose(file);
    return begin.empty() || begin.substr(0, csv.size()) == csv ||
           begin.substr(0, json.size()) == json;
}

} // namespace

void check_place(const std::string &path)
{
    namespace fs = std::filesystem;
    std::error_code ignored;
    if (!fs::is_directory(fs::absolute(path, ignored).parent_path(), ignored)) {
        throw input_error(path, 0, 0, "its folder does not exist; make it first");
    }
    if (fs::is_directory(path, ignored)) {
        throw input_error(path, 0, 0, "is a folder; name a file to write");
    }
}

void check_replaceable(const std::string &path)
{
    std::error_code ignored;
    if (std::filesystem::is_regular_file(path, ignored) && !is_own(path)) {
        throw input_error(path, 0, 0,
                          "was not written by ninespring-sim, and may be a measurement; name "
                          "another file, or remove it first");
    }
}

void write_file_whole(const std::string &path, const std::string &content)
{
    if (path == "-") {
        if (std::fwrite(content.data(), 1, content.size(), stdout) != content.size() ||
            std::fflush(stdout) != 0) {
            throw work_error("standard output: cannot be written");
        }
        return;
    }
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) {
        throw input_error(path, 0, 0, "is a folder; name a file to write");
    }
    const bool special =
        std::filesystem::exists(path, ignored) && !std::filesystem::is_regular_file(path, ignored);
    const std::string temporary =
        special ? path : fmt::format("{}.{}.tmp", path, static_cast<long>(getpid()));
    std::FILE *file = std::fopen(temporary.c_str(), "wb");
    if (file == nullptr) {
        throw work_error(fmt::format("{}: cannot be written ({})", path, std::strerror(errno)));
    }
    const bool written = std::fwrite(content.data(), 1, content.size(), file) == content.size();
    const bool closed = std::fclose(file) == 0;
    const bool moved =
        written && closed && (special || std::rename(temporary.c_str(), path.c_str()) == 0);
    if (!moved) {
        const int reason = errno;
        if (!special) {
            std::remove(temporary.c_str());
        }
        throw work_error(fmt::format("{}: cannot be written ({})", path, std::strerror(reason)));
    }
}

} // namespace ninespring
