/* What it is for: measured and simulated logs (docs/files.md), read whole and written.
 * What it owns: which columns a log has, their units and limits, and the advice when they are
 * wrong.
 * What it never does: interpolate, resample, or guess a unit. */
#ifndef LOG_FILE_H
#define LOG_FILE_H

#include <string>
#include <utility>
#include <vector>

#include "text_file.h"

namespace ninespring
{

constexpr std::size_t LOG_MAX_SPRINGS = 64;

/* What one spring's columns hold, one value a row. Empty vector: no such column. */
struct log_spring {
    std::vector<double> current_a;
    std::vector<double> voltage_v;
    std::vector<double> command;       /* 0..1 */
    std::vector<double> temperature_c; /* NaN: not measured */
};

struct log_data {
    std::string name;
    std::vector<double> time_s;
    std::vector<log_spring> springs;
    std::vector<double> fan;       /* 0..1; always filled, 0 where there is no column */
    std::vector<double> ambient_c; /* empty: no such column */
};

/* Reads a log. Columns i, v, u, t per spring, fan, ambient_c; the columns that `ninespring-sim`
 * adds and any `note_...` column are skipped. springs: how many the array has, 0
 * to take the highest number found. Fails (input_error) if and only if the file breaks
 * docs/files.md; the message names line and column. */
log_data read_log(const std::string &path, std::size_t springs = 0);
log_data parse_log(const text_file &file, std::size_t springs = 0);

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
