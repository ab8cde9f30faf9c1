/* What it is for: the simulated array that a scenario describes.
 * What it owns: the order in which pitch, effects and parameters act, and where a refusal stands in
 * the file.
 * What it never does: know the chip, the events, or a log. */
#ifndef SCENARIO_PLANT_H
#define SCENARIO_PLANT_H

#include <string_view>

#include "command.h"
#include "scenario_file.h"

namespace ninespring
{

/* At rest at its ambient. Fails (input_error) if the plant refuses what the scenario says of it. */
plant_pointer scenario_plant(const scenario &plan);

/* Of a command that has a board of its own, and takes from a scenario only what stands around it.
 */
struct plant_arguments {
    std::string scenario_path; /* empty: the paper's array, 3 x 3, no effects, no noise */
    std::vector<std::string> sets;
};
struct described_plant {
    plant_pointer plant;
    std::uint64_t seed;
    double shunt_noise_v;
    double bus_noise_v;
};
void add_plant_options(CLI::App &command, plant_arguments &arguments);
/* Fails (input_error) as read_scenario and scenario_plant do. */
described_plant describe_plant(const plant_arguments &arguments);

/* Where the scenario sets a plant parameter that `message` names: the last one, or the file. */
source_place place_of(const scenario &plan, std::string_view message);

/* The event `set`: a parameter of a plant, in mid-run. Fails (input_error at the event's place) if
 * the plant refuses it, or its effect is off, so that it would do nothing. */
void set_plant(plant_t *plant, const scenario_event &event);

} // namespace ninespring
#endif
