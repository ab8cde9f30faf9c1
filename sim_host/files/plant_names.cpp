#include "plant_names.h"

#include <fmt/format.h>

namespace ninespring
{

namespace
{

std::vector<std::string> plant_parameter_names()
{
    std::vector<std::string> names;
    for (std::size_t k = 0; k < plant_parameter_count(); ++k) {
        names.emplace_back(plant_parameter(k)->name);
    }
    return names;
}

} // namespace

std::vector<std::string> plant_effect_names()
{
    std::vector<std::string> names;
    for (std::size_t k = 0; k < plant_effect_count(); ++k) {
        names.emplace_back(plant_effect_name(k));
    }
    return names;
}

const plant_parameter_t *find_plant_parameter(std::string_view name)
{
    for (std::size_t k = 0; k < plant_parameter_count(); ++k) {
        if (name == plant_parameter(k)->name) {
            return plant_parameter(k);
        }
    }
    return nullptr;
}

void set_plant_parameter(plant_t *plant, const std::string &name, double value,
                         const source_place &place)
{
    const plant_parameter_t *known =
        find_plant_parameter(std::string_view(name).substr(0, name.find('[')));
    if (known == nullptr) {
        throw place.error(
            fmt::format("there is no parameter {}{}; `ninespring-sim parameters` lists them",
                        in_quotes(name), did_you_mean(name, plant_parameter_names())));
    }
    switch (plant_set(plant, name.c_str(), value)) {
    case PLANT_OK:
        return;
    case PLANT_ERROR_RANGE:
        throw place.error(fmt::format("{} is {}; it must be {} to {} {}", name, value,
                                      known->minimum, known->maximum, known->unit));
    case PLANT_ERROR_INDEX:
        throw place.error(fmt::format("{}: there is no such spring", in_quotes(name)));
    default:
        throw place.error(fmt::format("{} cannot be set; {}", in_quotes(name),
                                      known->per_spring
                                          ? "name it for all springs or one, like loss_w_per_k[3]"
                                          : "it is of the whole array, without [spring]"));
    }
}

void set_plant_effect(plant_t *plant, const std::string &name, const source_place &place)
{
    if (plant_set_effect(plant, name.c_str(), true) != PLANT_OK) {
        throw place.error(fmt::format("there is no effect {}{}", in_quotes(name),
                                      did_you_mean(name, plant_effect_names())));
    }
}

} // namespace ninespring
