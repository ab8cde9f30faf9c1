#include "log_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <limits>

#include "csv_reader.h"

namespace ninespring
{

namespace
{

enum class kind { time, current, voltage, command, temperature, fan, ambient, extra };

struct column {
    kind what;
    std::size_t spring; /* 0-based */
    std::string name;
};

/* `prefix` digits `suffix`: the digits' number from 1, or 0 where the name has another form. */
std::size_t numbered(std::string_view name, std::string_view prefix, std::string_view suffix)
{
    if (name.size() <= prefix.size() + suffix.size() || name.substr(0, prefix.size()) != prefix ||
        name.substr(name.size() - suffix.size()) != suffix) {
        return 0;
    }
    const std::string_view digits =
        name.substr(prefix.size(), name.size() - prefix.size() - suffix.size());
    std::size_t number = 0;
    const auto [end, status] =
        std::from_chars(digits.data(), digits.data() + digits.size(), number);
    if (status != std::errc() || end != digits.data() + digits.size() || digits.front() == '0') {
        return 0;
    }
    return number;
}

std::string lower(std::string_view text)
{
    std::string result(text);
    for (char &c : result) {
        if (c >= 'A' && c <= 'Z') {
            c = static_cast<char>(c - 'A' + 'a');
        }
    }
    return result;
}

/* What to do about a column whose name is not one of a log's. */
std::string advice(std::string_view name)
{
    struct wrong_unit {
        const char *prefix;
        const char *suffix;
        const char *text;
    };
    static constexpr std::array<wrong_unit, 18> units = {{
        {"t", "_f", "temperatures are in degC: convert with (F - 32) / 1.8 and name it t{}_c"},
        {"t", "_degf", "temperatures are in degC: convert with (F - 32) / 1.8 and name it t{}_c"},
        {"t", "_k", "temperatures are in degC: subtract 273.15 and name it t{}_c"},
        {"t", "_degc", "name it t{}_c"},
        {"t", "", "a temperature names its unit: if it is degC, name it t{}_c"},
        {"i", "_ma", "currents are in ampere: divide by 1000 and name it i{}_a"},
        {"i", "", "a current names its unit: if it is ampere, name it i{}_a"},
        {"v", "_mv", "voltages are in volt: divide by 1000 and name it v{}_v"},
        {"v", "", "a voltage names its unit: if it is volt, name it v{}_v"},
        {"q", "_pct", "a command is 0..1: divide by 100 and name it u{}"},
        {"u", "_pct", "a command is 0..1: divide by 100 and name it u{}"},
        {"u", "_percent", "a command is 0..1: divide by 100 and name it u{}"},
        {"q", "", "a command is 0..1: if it is percent, divide by 100, and name it u{}"},
        {"p", "_w", "a log holds current and voltage: give i{}_a and v{}_v"},
        {"temp", "", "name it t{}_c if it is in degC"},
        {"temperature", "", "name it t{}_c if it is in degC"},
        {"temp", "_c", "name it t{}_c"},
        {"current", "", "name it i{}_a if it is in ampere"},
    }};
    const std::string plain = lower(name);
    for (const wrong_unit &unit : units) {
        const std::size_t number = numbered(plain, unit.prefix, unit.suffix);
        if (number != 0) {
            return fmt::format(fmt::runtime(unit.text), number, number);
        }
    }
    if (plain == "time" || plain == "t" || plain == "t_s" || plain == "time_sec" ||
        plain == "seconds" || plain == "time (sec)" || plain == "timestamp") {
        return "name it time_s if it is in seconds";
    }
    if (plain == "time_ms" || plain == "t_ms" || plain == "ms") {
        return "times are in seconds: divide by 1000 and name it time_s";
    }
    if (plain == "time_min") {
        return "times are in seconds: multiply by 60 and name it time_s";
    }
    if (plain == "ambient_f") {
        return "temperatures are in degC: convert with (F - 32) / 1.8 and name it ambient_c";
    }
    if (plain == "ambient" || plain == "t_air" || plain == "air") {
        return "name it ambient_c if it is in degC";
    }
    if (plain == "fan_pct" || plain == "fan_percent") {
        return "the fan is 0..1: divide by 100 and name it fan";
    }
    for (const char *known : {"t_c", "i_a", "v_v"}) {
        if (plain == known) {
            return "say which spring, like t1_c, i1_a, v1_v";
        }
    }
    if (plain != name) {
        return "column names are in lower case, like time_s, i1_a, t1_c";
    }
    return "a log has time_s, i1_a, v1_v, u1, t1_c, fan, ambient_c; rename it, or call it note_... "
           "to have it skipped";
}

column identify(std::string_view name)
{
    std::string own(name);
    if (name == "time_s") {
        return {kind::time, 0, own};
    }
    if (name == "fan") {
        return {kind::fan, 0, own};
    }
    if (name == "ambient_c") {
        return {kind::ambient, 0, own};
    }
    std::size_t number = 0;
    if ((number = numbered(name, "i", "_a")) != 0) {
        return {kind::current, number - 1, own};
    }
    if ((number = numbered(name, "v", "_v")) != 0) {
        return {kind::voltage, number - 1, own};
    }
    if ((number = numbered(name, "u", "")) != 0) {
        return {kind::command, number - 1, own};
    }
    if ((number = numbered(name, "t", "_c")) != 0) {
        return {kind::temperature, number - 1, own};
    }
    return {kind::extra, 0, own};
}

struct limit {
    double low;
    double high;
    const char *text;
};

limit limit_of(kind what)
{
    switch (what) {
    case kind::current:
        return {-1.0, 30.0, "a spring's current is -1..30 A; if it is in mA, divide by 1000"};
    case kind::voltage:
        return {-1.0, 60.0, "a spring's voltage is -1..60 V; if it is in mV, divide by 1000"};
    case kind::command:
        return {0.0, 1.0, "a command is 0..1; if it is in percent, divide by 100"};
    case kind::fan:
        return {0.0, 1.0, "the fan is 0..1; if it is in percent, divide by 100"};
    case kind::temperature:
    case kind::ambient:
        return {-100.0, 500.0,
                "a temperature is -100..500 degC; leave the field empty where it was not measured"};
    case kind::time:
    case kind::extra:
        break;
    }
    return {-std::numeric_limits<double>::max(), std::numeric_limits<double>::max(), ""};
}

std::vector<double> *values_of(log_data &log, const column &which)
{
    switch (which.what) {
    case kind::time:
        return &log.time_s;
    case kind::current:
        return &log.springs[which.spring].current_a;
    case kind::voltage:
        return &log.springs[which.spring].voltage_v;
    case kind::command:
        return &log.springs[which.spring].command;
    case kind::temperature:
        return &log.springs[which.spring].temperature_c;
    case kind::fan:
        return &log.fan;
    case kind::ambient:
        return &log.ambient_c;
    case kind::extra:
        break;
    }
    return nullptr;
}

/* A column that the simulator (m{k}_c, x{k}, p{k}_c, px{k}, s{k}_a, limits{k}, cut{k}_a, y{k}_c) or
 * the board (m{k}_c, d{k}, state) writes beside the measured ones, or note_...: skipped. */
bool is_skipped(std::string_view name)
{
    if (name.substr(0, 5) == "note_" || name == "state") {
        return true;
    }
    struct form {
        const char *prefix;
        const char *suffix;
    };
    static constexpr std::array<form, 9> forms = {{{"m", "_c"},
                                                   {"x", ""},
                                                   {"p", "_c"},
                                                   {"px", ""},
                                                   {"s", "_a"},
                                                   {"limits", ""},
                                                   {"cut", "_a"},
                                                   {"y", "_c"},
                                                   {"d", ""}}};
    for (const form &one : forms) {
        if (numbered(name, one.prefix, one.suffix) != 0) {
            return true;
        }
    }
    return false;
}

/* Which columns there are, checked against each other: each spring must say what drove it. */
std::vector<column> identify_header(const csv_reader &reader, const std::string &file,
                                    std::size_t &springs)
{
    std::vector<column> columns;
    bool has_time = false;
    std::size_t highest = 0;
    for (const csv_field &field : reader.header()) {
        column found = identify(field.text);
        if (found.what == kind::extra && !is_skipped(field.text)) {
            throw reader.error(field.column,
                               fmt::format("column {} is not one of a log's; {}",
                                           in_quotes(field.text), advice(field.text)));
        }
        if (found.spring >= (springs != 0 ? springs : LOG_MAX_SPRINGS)) {
            throw reader.error(
                field.column,
                springs != 0
                    ? fmt::format("column {} is of spring {}, but the array has {} springs; check "
                                  "rows and cols, or the log's columns",
                                  found.name, found.spring + 1, springs)
                    : fmt::format("column {} is of spring {}; an array has at most {}", found.name,
                                  found.spring + 1, LOG_MAX_SPRINGS));
        }
        has_time = has_time || found.what == kind::time;
        if (found.what == kind::current || found.what == kind::voltage ||
            found.what == kind::command || found.what == kind::temperature) {
            highest = std::max(highest, found.spring + 1);
        }
        columns.push_back(std::move(found));
    }
    const std::size_t line = reader.header_line();
    if (!has_time) {
        throw input_error(file, line, 1, "there is no column time_s; add the time in seconds");
    }
    if (highest == 0) {
        throw input_error(file, line, 1,
                          "there is no spring in the log; add i1_a (or u1) and t1_c");
    }
    if (springs == 0) {
        springs = highest;
    }
    for (std::size_t k = 0; k < springs; ++k) {
        bool driven = false;
        bool current = false;
        std::size_t voltage_column = 0;
        for (std::size_t c = 0; c < columns.size(); ++c) {
            if (columns[c].spring != k) {
                continue;
            }
            current = current || columns[c].what == kind::current;
            driven = driven || columns[c].what == kind::current || columns[c].what == kind::command;
            if (columns[c].what == kind::voltage) {
                voltage_column = reader.header()[c].column;
            }
        }
        if (voltage_column != 0 && !current) {
            throw input_error(file, line, voltage_column,
                              fmt::format("v{0}_v is without i{0}_a; power needs both", k + 1));
        }
        if (!driven) {
            throw input_error(file, line, 1,
                              fmt::format("spring {0} has neither i{0}_a nor u{0}; add the column "
                                          "(0 where it was not driven)",
                                          k + 1));
        }
    }
    return columns;
}

} // namespace

log_data parse_log(const text_file &file, std::size_t springs)
{
    csv_reader reader(file);
    const std::vector<column> columns = identify_header(reader, file.name, springs);
    log_data log;
    log.name = file.name;
    log.springs.resize(springs);

    std::vector<std::vector<double> *> targets;
    std::vector<limit> limits;
    for (const column &one : columns) {
        targets.push_back(values_of(log, one));
        limits.push_back(limit_of(one.what));
    }

    std::vector<csv_field> fields;
    while (reader.next(fields)) {
        for (std::size_t c = 0; c < columns.size(); ++c) {
            const column &one = columns[c];
            if (one.what == kind::extra) {
                continue;
            }
            if (one.what == kind::temperature && fields[c].text.empty()) {
                targets[c]->push_back(std::numeric_limits<double>::quiet_NaN());
                continue;
            }
            double value = 0.0;
            const std::string problem = parse_number(fields[c].text, value);
            if (!problem.empty()) {
                const std::string word = lower(fields[c].text);
                const bool missing = one.what == kind::temperature &&
                                     (word == "nan" || word == "na" || word == "null" ||
                                      word == "none" || word == "-");
                throw reader.error(
                    fields[c].column,
                    fmt::format("column {}: {}", one.name,
                                missing ? in_quotes(fields[c].text) +
                                              " is not a temperature; leave the field empty where "
                                              "it was not measured"
                                        : problem));
            }
            if (!(value >= limits[c].low && value <= limits[c].high)) {
                throw reader.error(fields[c].column,
                                   fmt::format("column {}: {} is out of range; {}", one.name,
                                               in_quotes(fields[c].text), limits[c].text));
            }
            if (one.what == kind::time && !log.time_s.empty() && !(value > log.time_s.back())) {
                throw reader.error(
                    fields[c].column,
                    fmt::format("time_s does not rise: {} after {}; {}", value, log.time_s.back(),
                                value == log.time_s.back()
                                    ? "remove the duplicate row"
                                    : "sort the rows, or split the log where its clock was reset"));
            }
            targets[c]->push_back(value);
        }
    }
    if (log.time_s.empty()) {
        throw input_error(file.name, reader.line(), 1,
                          "there is no row after the column names; is the file cut short?");
    }
    if (log.fan.empty()) {
        log.fan.assign(log.time_s.size(), 0.0);
    }
    return log;
}

log_data read_log(const std::string &path, std::size_t springs)
{
    return parse_log(read_text_file(path), springs);
}

void log_writer::comment(std::string_view key, std::string_view value)
{
    std::string one_line(value);
    std::replace(one_line.begin(), one_line.end(), '\n', ' ');
    text_ += fmt::format("# {}: {}\n", key, one_line);
}

void log_writer::column(std::string name, int decimals)
{
    columns_.emplace_back(std::move(name), decimals);
}

void log_writer::row(const std::vector<double> &values)
{
    if (!header_done_) {
        header_done_ = true;
        for (std::size_t k = 0; k < columns_.size(); ++k) {
            text_ += k == 0 ? "" : ",";
            text_ += columns_[k].first;
        }
        text_ += '\n';
    }
    std::array<char, 400> digits{};
    for (std::size_t k = 0; k < columns_.size() && k < values.size(); ++k) {
        if (k != 0) {
            text_ += ',';
        }
        if (!std::isfinite(values[k])) {
            continue;
        }
        const auto result = std::to_chars(digits.data(), digits.data() + digits.size(), values[k],
                                          std::chars_format::fixed, columns_[k].second);
        std::string_view number(digits.data(),
                                static_cast<std::size_t>(result.ptr - digits.data()));
        if (number.front() == '-' && number.find_first_not_of("-0.") == std::string_view::npos) {
            number.remove_prefix(1); /* -0.000 is 0.000 */
        }
        text_ += number;
    }
    text_ += '\n';
}

} // namespace ninespring
