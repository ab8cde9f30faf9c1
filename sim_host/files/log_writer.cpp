#include "log_writer.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fmt/format.h>

namespace ninespring
{

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
