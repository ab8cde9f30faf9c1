/* What it is for: tables of steady states (docs/files.md), one row a state.
 * What it owns: which columns such a table has and the advice when they are wrong.
 * What it never does: settle a plant. */
#ifndef STEADY_FILE_H
#define STEADY_FILE_H

#include <string>
#include <vector>

#include "text_file.h"

namespace ninespring
{

struct steady_state {
    std::string name; /* column `case`; the line's number where there is none */
    double pitch_mm;  /* NaN where there is no column */
    double fan;       /* 0..1 */
    double ambient_c; /* NaN where there is no column */
    /* Per spring; NaN: not given. */
    std::vector<double> current_a;
    std::vector<double> hold_c;
    std::vector<double> temperature_c;
};

/* Fails (input_error) if and only if the file breaks docs/files.md. springs: 0 to take the highest
 * number found. */
std::vector<steady_state> read_steady(const std::string &path, std::size_t springs = 0);
std::vector<steady_state> parse_steady(const text_file &file, std::size_t springs = 0);

} // namespace ninespring
#endif
