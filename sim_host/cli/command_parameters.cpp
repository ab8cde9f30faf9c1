#include "command.h"

#include <fmt/format.h>

#include "plant_names.h"

namespace ninespring
{

namespace
{

void list_parameters(const std::string &json_path)
{
    const bool wants_table = check_outputs({json_path}, {});
    std::string table = fmt::format("{:<34} {:>12} {:<8} {:>10} {:>10}  {}\n", "parameter",
                                    "default", "unit", "least", "most", "what it is");
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    std::string effect = "-";
    for (std::size_t k = 0; k < plant_parameter_count(); ++k) {
        const plant_parameter_t &one = *plant_parameter(k);
        const std::string own = one.effect == nullptr ? "" : one.effect;
        if (own != effect) {
            effect = own;
            table += fmt::format("{}\n",
                                 effect.empty() ? "[always]" : fmt::format("[effect {}]", effect));
        }
        table +=
            fmt::format("{:<34} {:>12.6g} {:<8} {:>10.4g} {:>10.4g}  {}\n",
                        fmt::format("{}{}", one.name, one.per_spring ? "[K]" : ""),
                        one.default_value, one.unit, one.minimum, one.maximum, one.description);
        list.push_back({{"name", one.name},
                        {"unit", one.unit},
                        {"effect", own.empty() ? nlohmann::ordered_json(nullptr)
                                               : nlohmann::ordered_json(own)},
                        {"default", one.default_value},
                        {"minimum", one.minimum},
                        {"maximum", one.maximum},
                        {"per_spring", one.per_spring},
                        {"description", one.description}});
    }
    if (!json_path.empty()) {
        write_file_whole(json_path, json_text({{"schema", "ninespring.parameters/1"},
                                               {"effects", plant_effect_names()},
                                               {"parameters", list}}));
    }
    if (wants_table) {
        fmt::print("{}", table);
    }
}

} // namespace

void add_command_parameters(CLI::App &app)
{
    CLI::App *command = app.add_subcommand(
        "parameters", "Lists the plant's parameters: names, units, limits, and their effects");
    auto json_path = std::make_shared<std::string>();
    add_output_option(*command, "--json", *json_path, "Write the list to this JSON file");
    command->callback([json_path] { list_parameters(*json_path); });
}

} // namespace ninespring
