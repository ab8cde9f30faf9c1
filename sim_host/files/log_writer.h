/* What it is for: the text of a log (docs/files.md), column by column and row by row.
 * What it owns: its form: comments, header, decimals, empty fields.
 * What it never does: read one: that is the Python tool's, with all that a log must be. */
#ifndef LOG_WRITER_H
#define LOG_WRITER_H

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace ninespring
{

/* Collects rows and gives the text of a log. Numbers have a fixed count of decimals, so equal runs
 * give equal bytes. */
class log_writer
{
public:
    void comment(std::string_view key, std::string_view value);
    /* All columns before the first row. */
    void column(std::string name, int decimals);
    /* As many values as columns, in their order; NaN leaves the field empty. */
    void row(const std::vector<double> &values);
    [[nodiscard]] const std::string &text() const { return text_; }

private:
    std::vector<std::pair<std::string, int>> columns_;
    bool header_done_ = false;
    std::string text_;
};

} // namespace ninespring
#endif
