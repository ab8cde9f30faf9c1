/* What it is for: the plant's parameters and effects by the names that a user wrote.
 * What it owns: the advice where a name or a value is wrong.
 * What it never does: hold a name or a limit of its own: they are the plant's. */
#ifndef PLANT_NAMES_H
#define PLANT_NAMES_H

#include <string>
#include <string_view>
#include <vector>

#include "plant.h"
#include "text_file.h"

namespace ninespring
{

/* One parameter `name` or `name[3]`, with the plant's own reason if it refuses. */
void set_plant_parameter(plant_t *plant, const std::string &name, double value,
                         const source_place &place);
void set_plant_effect(plant_t *plant, const std::string &name, const source_place &place);
/* The parameter's table entry, or null. */
const plant_parameter_t *find_plant_parameter(std::string_view name);
std::vector<std::string> plant_effect_names();

} // namespace ninespring
#endif
