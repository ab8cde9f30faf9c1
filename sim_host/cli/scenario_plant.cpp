#include "scenario_plant.h"

#include <fmt/format.h>

#include "electrics.h"
#include "paper.h"
#include "plant_names.h"

namespace ninespring
{

namespace
{

/* True if `message` holds `name` as a whole word: by it a refusal finds its place in a file. */
bool mentions(std::string_view message, std::string_view name)
{
    const auto of_a_name = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
    };
    for (std::size_t at = message.find(name); at != std::string_view::npos;
         at = message.find(name, at + 1)) {
        const std::size_t end = at + name.size();
        if ((at == 0 || !of_a_name(message[at - 1])) &&
            (end == message.size() || !of_a_name(message[end]))) {
            return true;
        }
    }
    return false;
}

} // namespace

source_place place_of(const scenario &plan, std::string_view message)
{
    source_place found{plan.name, 0, 0};
    for (const scenario_entry &entry : plan.plant) {
        if (mentions(message, std::string_view(entry.key).substr(0, entry.key.find('[')))) {
            found = entry.place;
        }
    }
    return found;
}

plant_pointer scenario_plant(const scenario &plan)
{
    plant_pointer plant(plant_create_layers(plan.rows, plan.cols, plan.layers));
    if (plant == nullptr) {
        throw input_error(plan.name, 0, 0, "there is no plant of these rows and cols");
    }
    /* The pitch gives the paper's loss and couplings; what [plant] says comes after it. */
    if (plan.pitch_mm && paper_configure(plant.get(), *plan.pitch_mm) != PLANT_OK) {
        throw plan.pitch_place.error("pitch_mm: the spacing law holds for 1 to 100 mm");
    }
    for (const scenario_entry &effect : plan.effects) {
        set_plant_effect(plant.get(), effect.key, effect.place);
    }
    /* What is said of all springs first, so that the order in the file does not matter. */
    for (const bool one_spring : {false, true}) {
        for (const scenario_entry &entry : plan.plant) {
            if ((entry.key.find('[') != std::string::npos) != one_spring) {
                continue;
            }
            double value = 0.0;
            const std::string problem = parse_number(entry.value, value);
            if (!problem.empty()) {
                throw entry.place.error(fmt::format("{}: {}", entry.key, problem));
            }
            const std::string_view name =
                std::string_view(entry.key).substr(0, entry.key.find('['));
            set_plant_parameter(plant.get(), entry.key, value,
                                find_plant_parameter(name) == nullptr ? entry.key_place
                                                                      : entry.place);
        }
    }
    const char *message = nullptr;
    if (plant_check(plant.get(), &message) != PLANT_OK) {
        throw place_of(plan, message == nullptr ? "" : message)
            .error(fmt::format("[plant] {}", message == nullptr ? "is refused" : message));
    }
    plant_reset(plant.get());
    return plant;
}

void set_plant(plant_t *plant, const scenario_event &event)
{
    set_plant_parameter(plant, event.parameter, event.amount, event.place);
    const std::string name = event.parameter.substr(0, event.parameter.find('['));
    const char *effect = find_plant_parameter(name)->effect;
    if (effect != nullptr &&
        !plant_effect_is_on(plant, static_cast<std::size_t>(plant_effect_index(effect)))) {
        throw event.place.error(fmt::format(
            "{} belongs to {}, which is off; name it in [plant] effects", name, in_quotes(effect)));
    }
    const char *message = nullptr;
    if (plant_check(plant, &message) != PLANT_OK) {
        throw event.place.error(message == nullptr ? "the plant refuses this" : message);
    }
}

void add_plant_options(CLI::App &command, plant_arguments &arguments)
{
    command.add_option("--scenario", arguments.scenario_path,
                       "The array around the board: [array], [plant], [noise] and seed of this "
                       "scenario; its events and [chip] are the console's business here");
    command
        .add_option("--set", arguments.sets,
                    "key=value as if the scenario said so, as with run; again for another")
        ->take_all()
        ->allow_extra_args(false);
}

described_plant describe_plant(const plant_arguments &arguments)
{
    const scenario plan =
        arguments.scenario_path.empty()
            ? parse_scenario(make_text_file("(no scenario)",
                                            "[scenario]\nduration_s = 1\n[plant]\neffects = "
                                            "latent_heat, resistance_phase\n"),
                             arguments.sets)
            : read_scenario(arguments.scenario_path, arguments.sets);
    if (plan.layers > 1) {
        throw input_error(plan.name, 0, 0, "[array] layers = 2, but a board is of one layer");
    }
    return {scenario_plant(plan), plan.seed, plan.noise_current_a * ELECTRICS_INA219_SHUNT_OHM,
            plan.noise_voltage_v};
}

} // namespace ninespring
