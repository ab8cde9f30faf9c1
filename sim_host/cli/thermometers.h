/* What it is for: a thermocouple logger beside the simulated board, on a pseudo-terminal of its own
 * or in a file.
 * What it owns: which springs it measures, how often, its noise, and its lines (docs/simulator.md).
 * What it never does: know the board: it has its own clock and its own port. */
#ifndef THERMOMETERS_H
#define THERMOMETERS_H

#include <CLI/CLI.hpp>
#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "board_pty.h"
#include "electrics.h"
#include "plant.h"

namespace ninespring
{

struct thermometer_arguments {
    std::string target; /* "pty", or a file's path; empty: none */
    double rate_hz = 1.0;
    double noise_c = 0.1;
    double lag_s = 0.0; /* 0: as [plant] has it */
    std::string springs = "all";
};

void add_thermometer_options(CLI::App &command, thermometer_arguments &arguments);

class thermometers
{
public:
    /* A lag is set in the plant, whose sensors these are. Fails (input_error) if an argument is
     * wrong, (work_error) if the file or the pseudo-terminal cannot be had. */
    thermometers(const thermometer_arguments &arguments, plant_t *plant, std::uint64_t seed);
    ~thermometers();
    thermometers(const thermometers &) = delete;
    thermometers &operator=(const thermometers &) = delete;

    /* Of the pseudo-terminal, or the file; empty: there are none. */
    [[nodiscard]] const std::string &name() const { return name_; }
    /* Writes the line that is due. Fails (work_error) if the file takes it no more. */
    void follow(double time_s);
    /* nullptr: there is none. */
    [[nodiscard]] const board_pty_t *port() const { return pty_.master < 0 ? nullptr : &pty_; }

private:
    void say(const std::string &line);
    const plant_t *plant_;
    double period_s_ = 1.0;
    double noise_c_ = 0.0;
    std::vector<int> springs_;
    std::string name_;
    std::string header_;
    std::ofstream file_;
    board_pty_t pty_{-1, -1, ""};
    electrics_noise_t noise_{};
    std::uint64_t lines_ = 0;
};

} // namespace ninespring
#endif
