#include "csv_reader.h"

#include <fmt/format.h>
#include <set>

namespace ninespring
{

namespace
{

std::string_view trimmed(std::string_view text)
{
    while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) {
        text.remove_prefix(1);
    }
    while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) {
        text.remove_suffix(1);
    }
    return text;
}

} // namespace

csv_reader::csv_reader(const text_file &file) : file_(file)
{
    std::string_view text;
    if (!next_data_line(text)) {
        throw input_error(file_.name, line_, 1,
                          "there is no line with column names; is the file cut short?");
    }
    header_line_ = line_;
    for (const char other : {';', '\t'}) {
        if (text.find(',') == std::string_view::npos &&
            text.find(other) != std::string_view::npos) {
            throw error(text.find(other) + 1,
                        fmt::format("columns are separated by {}; separate them by ',' and write "
                                    "numbers with a decimal point",
                                    other == ';' ? "';'" : "tabs"));
        }
    }
    split(text, header_);
    std::set<std::string_view> seen;
    for (const csv_field &field : header_) {
        if (field.text.empty()) {
            throw error(field.column, "a column has no name; name it or remove it");
        }
        if (!seen.insert(field.text).second) {
            throw error(field.column, fmt::format("column {} appears twice; remove or rename one",
                                                  in_quotes(field.text)));
        }
    }
}

bool csv_reader::next_data_line(std::string_view &text)
{
    while (position_ < file_.text.size()) {
        text = next_line(file_.text, position_);
        ++line_;
        const std::string_view content = trimmed(text);
        if (content.empty()) {
            continue;
        }
        if (content.front() != '#') {
            return true;
        }
    }
    return false;
}

void csv_reader::split(std::string_view text, std::vector<csv_field> &fields) const
{
    fields.clear();
    std::size_t start = 0;
    for (;;) {
        std::size_t first = start;
        while (first < text.size() && (text[first] == ' ' || text[first] == '\t')) {
            ++first;
        }
        std::size_t end = 0;
        std::string_view content;
        if (first < text.size() && text[first] == '"') {
            const std::size_t closing = text.find('"', first + 1);
            if (closing == std::string_view::npos) {
                throw error(first + 1, "the quote is not closed; is the file cut short?");
            }
            content = trimmed(text.substr(first + 1, closing - first - 1));
            end = closing + 1;
            while (end < text.size() && (text[end] == ' ' || text[end] == '\t')) {
                ++end;
            }
            if (end < text.size() && text[end] != ',') {
                throw error(end + 1, "text after a closing quote; put a ',' between columns");
            }
        } else {
            end = text.find(',', start);
            if (end == std::string_view::npos) {
                end = text.size();
            }
            content = trimmed(text.substr(start, end - start));
        }
        fields.push_back({content, first + 1});
        if (end >= text.size()) {
            return;
        }
        start = end + 1;
    }
}

bool csv_reader::next(std::vector<csv_field> &fields)
{
    std::string_view text;
    if (!next_data_line(text)) {
        return false;
    }
    split(text, fields);
    if (fields.size() > header_.size()) {
        throw error(fields[header_.size()].column,
                    fmt::format("{} values, but line {} names {} columns; if these are decimal "
                                "commas, write decimal points",
                                fields.size(), header_line_, header_.size()));
    }
    if (fields.size() < header_.size()) {
        throw error(text.size() + 1,
                    fmt::format("{} values, but line {} names {} columns; {}", fields.size(),
                                header_line_, header_.size(),
                                position_ >= file_.text.size()
                                    ? "the file is cut short: remove this row or copy it again"
                                    : "complete the row or remove it"));
    }
    return true;
}

} // namespace ninespring
