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
    if (board == "avr") {
        return make_avr_runner(request);
    }
#endif
    throw input_error(fmt::format("--board {}: this build has no such board; use native", board));
}

std::string setting_name(std::size_t offset)
{
    static_assert(offsetof(settings_t, controller) == 0, "offsets of both structs are the same");
    for (std::uint8_t k = 0; k < settings_count(); ++k) {
        settings_entry_t entry{};
        settings_entry(k, &entry);
        const std::size_t size = parameter_width(entry.type);
        if (offset >= entry.offset && offset < entry.offset + size * entry.count) {
            return entry.count == 1 ? fmt::format("${}", settings_name(k))
                                    : fmt::format("${}_{}", settings_name(k),
                                                  (offset - entry.offset) / size + 1);
        }
    }
    return "a setting";
}

} // namespace ninespring
