#include "runner.h"

#include <fmt/format.h>

namespace ninespring
{

std::unique_ptr<runner> make_runner(const std::string &board, const runner_request &request)
{
    if (board == "native") {
        return make_native_runner(request);
    }
#ifdef NINESPRING_BOARD
    if (board == "avr" && request.settings->size() > 1) {
        throw input_error("--board avr is one board, of one layer; leave out [array] board_rows, "
                          "board_cols and layers");
    }
    if (board == "avr") {
        return make_avr_runner(request);
    }
#endif
    throw input_error(fmt::format("--board {}: this build has no such board; use native", board));
}

std::string setting_name(std::uint16_t row)
{
    return row < PARAMETER_COUNT ? fmt::format("${}", parameter_row(row).name) : "a setting";
}

} // namespace ninespring
