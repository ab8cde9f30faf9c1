#include "steady_file.h"

#include <algorithm>
#include <charconv>
#include <fmt/format.h>
#include <limits>

#include "csv_reader.h"
#include "log_file.h"

namespace ninespring
{

namespace
{

constexpr double NOT_GIVEN = std::numeric_limits<double>::quiet_NaN();

enum class kind { name, pitch, fan, ambient, current, hold, temperature };

struct column {
    kind what;
    std::size_t spring;
};

bool spring_column(std::string_view name, std::string_view prefix, std::string_view suffix,
                   std::size_t &spring)
{
    if (name.size() <= prefix.size() + suffix.size() || name.substr(0, prefix.size()) != prefix ||
        name.substr(name.size() - suffix.size()) != suffix) {
        return false;
    }
    name = name.substr(prefix.size(), name.size() - prefix.size() - suffix.size());
    std::size_t number = 0;
    const auto [end, status] = std::from_chars(name.data(), name.data() + name.size(), number);
    if (status != std::errc() || end != name.data() + name.size() || number == 0) {
        return false;
    }
    spring = number - 1;
    return true;
}

column identify(const csv_reader &reader, const csv_field &field)
{
    column found{kind::name, 0};
    if (field.text == "case") {
        return found;
    }
    if (field.text == "pitch_mm") {
        return {kind::pitch, 0};
    }
    if (field.text == "fan") {
        return {kind::fan, 0};
    }
    if (field.text == "ambient_c") {
        return {kind::ambient, 0};
    }
    if (spring_column(field.text, "i", "_a", found.spring)) {
        found.what = kind::current;
    } else if (spring_column(field.text, "hold", "_c", found.spring)) {
        found.what = kind::hold;
    } else if (spring_column(field.text, "t", "_c", found.spring)) {
        found.what = kind::temperature;
    } else {
        throw reader.error(
            field.column, fmt::format("column {} is not one of a steady table's; it has case, "
                                      "pitch_mm, fan, ambient_c, i1_a, hold1_c, t1_c in A and degC",
                                      in_quotes(field.text)));
    }
    return found;
}

void check(const csv_reader &reader, const csv_field &field, double value, double low, double high,
           const char *text)
{
    if (!(value >= low && value <= high)) {
        throw reader.error(field.column,
                           fmt::format("{} is out of range; {}", in_quotes(field.text), text));
    }
}

} // namespace

std::vector<steady_state> parse_steady(const text_file &file, std::size_t springs)
{
    csv_reader reader(file);
    std::vector<column> columns;
    std::size_t highest = 0;
    for (const csv_field &field : reader.header()) {
        columns.push_back(identify(reader, field));
        const column &last = columns.back();
        const bool of_spring =
            last.what == kind::current || last.what == kind::hold || last.what == kind::temperature;
        if (of_spring && last.spring >= (springs != 0 ? springs : LOG_MAX_SPRINGS)) {
            throw reader.error(field.column,
                               fmt::format("spring {} is more than the array has ({})",
                                           last.spring + 1,
                                           springs != 0 ? springs : LOG_MAX_SPRINGS));
        }
        highest = of_spring ? std::max(highest, last.spring + 1) : highest;
    }
    if (highest == 0) {
        throw input_error(file.name, reader.header_line(), 1,
                          "there is no spring in the table; add i1_a or hold1_c, and t1_c");
    }
    if (springs == 0) {
        springs = highest;
    }

    std::vector<steady_state> states;
    std::vector<csv_field> fields;
    while (reader.next(fields)) {
        const std::vector<double> none(springs, NOT_GIVEN);
        steady_state state{
            std::to_string(reader.line()), NOT_GIVEN, 0.0, NOT_GIVEN, none, none, none};
        for (std::size_t c = 0; c < columns.size(); ++c) {
            const csv_field &field = fields[c];
            if (columns[c].what == kind::name) {
                state.name = field.text;
                continue;
            }
            const bool of_spring = columns[c].what != kind::pitch && columns[c].what != kind::fan &&
                                   columns[c].what != kind::ambient;
            if (field.text.empty() && of_spring) {
                continue;
            }
            const double value = reader.number(field, reader.header()[c].text);
            const std::size_t k = columns[c].spring;
            switch (columns[c].what) {
            case kind::pitch:
                check(reader, field, value, 0.1, 1000.0, "a pitch is 0.1..1000 mm");
                state.pitch_mm = value;
                break;
            case kind::fan:
                check(reader, field, value, 0.0, 1.0, "the fan is 0..1");
                state.fan = value;
                break;
            case kind::ambient:
                check(reader, field, value, -100.0, 500.0, "a temperature is -100..500 degC");
                state.ambient_c = value;
                break;
            case kind::current:
                check(reader, field, value, -1.0, 30.0, "a current is -1..30 A");
                state.current_a[k] = value;
                break;
            case kind::hold:
                check(reader, field, value, -100.0, 500.0, "a temperature is -100..500 degC");
                state.hold_c[k] = value;
                break;
            case kind::temperature:
            case kind::name:
                check(reader, field, value, -100.0, 500.0, "a temperature is -100..500 degC");
                state.temperature_c[k] = value;
                break;
            }
        }
        for (std::size_t k = 0; k < springs; ++k) {
            if (state.current_a[k] == state.current_a[k] && state.hold_c[k] == state.hold_c[k]) {
                throw reader.error(1, fmt::format("spring {0} has both i{0}_a and hold{0}_c; leave "
                                                  "one of them empty",
                                                  k + 1));
            }
        }
        states.push_back(std::move(state));
    }
    if (states.empty()) {
        throw input_error(file.name, reader.line(), 1,
                          "there is no row after the column names; is the file cut short?");
    }
    return states;
}

std::vector<steady_state> read_steady(const std::string &path, std::size_t springs)
{
    return parse_steady(read_text_file(path), springs);
}

} // namespace ninespring
