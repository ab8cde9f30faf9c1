#include "model_file.h"

#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <initializer_list>
#include <set>

/* toml++ 3.3 asserts on some malformed keys, and in release builds reads on: here that is one more
 * way to refuse. */
namespace
{
struct toml_assertion {
};
[[noreturn]] void refuse_assertion()
{
    throw toml_assertion();
}
} // namespace
#undef NDEBUG
#define TOML_ASSERT(expr) ((expr) ? static_cast<void>(0) : refuse_assertion())
#define TOML_HEADER_ONLY  1
#include <toml++/toml.h>

namespace ninespring
{

namespace
{

constexpr double PI = 3.14159265358979323846;

/* One TOML table with places for messages. */
class reader
{
public:
    reader(std::string file, const toml::table &table, std::string where)
        : file_(std::move(file)), table_(table), where_(std::move(where))
    {
    }

    [[nodiscard]] source_place place(const toml::source_region &region) const
    {
        return {file_, region.begin.line, region.begin.column};
    }
    [[nodiscard]] source_place place() const
    {
        const source_place own = place(table_.source());
        return own.line == 0 ? source_place{file_, 1, 1} : own;
    }

    void refuse_unknown(std::initializer_list<const char *> known) const
    {
        std::vector<std::string> names(known.begin(), known.end());
        for (const auto &[key, node] : table_) {
            bool found = false;
            for (const std::string &name : names) {
                found = found || key.str() == name;
            }
            if (!found) {
                std::string list;
                for (const std::string &name : names) {
                    list += (list.empty() ? "" : ", ") + name;
                }
                throw place(key.source())
                    .error(fmt::format("{} has no key {}{}; it has {}", where_,
                                       in_quotes(key.str()), did_you_mean(key.str(), names), list));
            }
        }
    }

    [[nodiscard]] const toml::node *find(const char *key) const { return table_.get(key); }

    [[nodiscard]] const toml::node &need(const char *key) const
    {
        const toml::node *node = table_.get(key);
        if (node == nullptr) {
            throw place().error(fmt::format("{} is without {}; add it", where_, key));
        }
        return *node;
    }

    [[nodiscard]] double number(const toml::node &node, const char *key, double low,
                                double high) const
    {
        double value = 0.0;
        if (const auto *real = node.as_floating_point()) {
            value = real->get();
        } else if (const auto *integer = node.as_integer()) {
            value = static_cast<double>(integer->get());
        } else {
            throw place(node.source())
                .error(
                    fmt::format("{} {} must be a number, like 1.5, without quotes", where_, key));
        }
        if (!(value >= low && value <= high)) {
            throw place(node.source())
                .error(
                    fmt::format("{} {} is {}; it must be {} to {}", where_, key, value, low, high));
        }
        return value;
    }

    [[nodiscard]] int integer(const toml::node &node, const char *key, int low, int high) const
    {
        const auto *found = node.as_integer();
        if (found == nullptr || found->get() < low || found->get() > high) {
            throw place(node.source())
                .error(
                    fmt::format("{} {} must be a whole number, {} to {}", where_, key, low, high));
        }
        return static_cast<int>(found->get());
    }

    [[nodiscard]] std::string text(const toml::node &node, const char *key) const
    {
        const auto *found = node.as_string();
        if (found == nullptr) {
            throw place(node.source())
                .error(fmt::format("{} {} must be text in quotes", where_, key));
        }
        return found->get();
    }

    [[nodiscard]] const toml::array &list(const toml::node &node, const char *key) const
    {
        const auto *found = node.as_array();
        if (found == nullptr) {
            throw place(node.source())
                .error(fmt::format("{} {} must be a list in [ ]", where_, key));
        }
        return *found;
    }

    [[nodiscard]] reader table(const toml::node &node, const char *key) const
    {
        const auto *found = node.as_table();
        if (found == nullptr) {
            throw place(node.source()).error(fmt::format("[{}] must be a table", key));
        }
        return {file_, *found, fmt::format("[{}]", key)};
    }

    [[nodiscard]] const toml::table &raw() const { return table_; }
    [[nodiscard]] const std::string &file() const { return file_; }

private:
    std::string file_;
    const toml::table &table_;
    std::string where_;
};

bool asserts(std::string_view text)
{
    try {
        (void)toml::parse(text);
    } catch (const toml::parse_error &) {
    } catch (const toml_assertion &) {
        return true;
    }
    return false;
}

toml::table parse(const text_file &file)
{
    try {
        return toml::parse(file.text, file.name);
    } catch (const toml::parse_error &error) {
        std::string description(error.description());
        for (char &c : description) {
            c = (c >= ' ' && c <= '~') ? c : '?';
        }
        throw input_error(file.name, error.source().begin.line, error.source().begin.column,
                          fmt::format("this is not TOML ({}); correct it", description));
    } catch (const toml_assertion &) {
        /* It does not say where: the first line with which it happens. */
        std::size_t line = 1;
        std::size_t position = 0;
        for (; position < file.text.size(); ++line) {
            (void)next_line(file.text, position);
            if (asserts(std::string_view(file.text).substr(0, position))) {
                break;
            }
        }
        throw input_error(file.name, line, 1, "this is not TOML (a malformed key); correct it");
    }
}

struct key_limit {
    const char *key;
    double low;
    double high;
};

constexpr key_limit SPRING_KEYS[] = {{"wire_diameter_mm", 0.01, 10.0},
                                     {"coil_diameter_mm", 0.1, 100.0},
                                     {"turns", 0.1, 1000.0},
                                     {"wire_length_mm", 1.0, 10000.0}};
constexpr key_limit MATERIAL_KEYS[] = {
    {"density_kg_per_m3", 500.0, 20000.0},          {"heat_capacity_j_per_kgk", 50.0, 5000.0},
    {"latent_heat_j_per_kg", 0.0, 100000.0},        {"resistivity_martensite_uohm_cm", 1.0, 1000.0},
    {"resistivity_austenite_uohm_cm", 1.0, 1000.0}, {"martensite_finish_c", -50.0, 200.0},
    {"martensite_start_c", -50.0, 200.0},           {"austenite_start_c", -50.0, 200.0},
    {"austenite_finish_c", -50.0, 200.0},           {"emissivity", 0.0, 1.0}};

template <std::size_t N>
std::vector<array_description::entry> read_numbers(const reader &table, const key_limit (&keys)[N],
                                                   const char *where)
{
    std::vector<array_description::entry> entries;
    std::vector<std::string> names;
    for (const key_limit &key : keys) {
        names.emplace_back(key.key);
    }
    for (const auto &[key, node] : table.raw()) {
        const key_limit *found = nullptr;
        for (const key_limit &one : keys) {
            found = key.str() == one.key ? &one : found;
        }
        if (found == nullptr) {
            std::string list;
            for (const std::string &name : names) {
                list += (list.empty() ? "" : ", ") + name;
            }
            throw table.place(key.source())
                .error(fmt::format("{} has no key {}{}; it has {}", where, in_quotes(key.str()),
                                   did_you_mean(key.str(), names), list));
        }
        const double value = table.number(node, found->key, found->low, found->high);
        entries.push_back({found->key, value, table.place(node.source())});
    }
    return entries;
}

array_description read_array_tables(const reader &root)
{
    array_description array;
    const reader table = root.table(root.need("array"), "array");
    table.refuse_unknown({"rows", "cols", "pitch_mm"});
    array.rows = table.integer(table.need("rows"), "rows", 1, PLANT_MAX_SPRINGS);
    array.cols = table.integer(table.need("cols"), "cols", 1, PLANT_MAX_SPRINGS);
    if (array.rows * array.cols > PLANT_MAX_SPRINGS) {
        throw table.place(table.need("cols").source())
            .error(fmt::format("{} x {} are more than {} springs", array.rows, array.cols,
                               PLANT_MAX_SPRINGS));
    }
    if (const toml::node *pitch = table.find("pitch_mm")) {
        array.pitch_mm = table.number(*pitch, "pitch_mm", 0.1, 1000.0);
    }
    if (const toml::node *node = root.find("spring")) {
        array.spring = read_numbers(root.table(*node, "spring"), SPRING_KEYS, "[spring]");
    }
    if (const toml::node *node = root.find("material")) {
        array.material = read_numbers(root.table(*node, "material"), MATERIAL_KEYS, "[material]");
    }
    if (const toml::node *node = root.find("sensor")) {
        const reader sensor = root.table(*node, "sensor");
        sensor.refuse_unknown({"kind", "noise_c"});
        if (const toml::node *kind = sensor.find("kind")) {
            array.sensor_kind = sensor.text(*kind, "kind");
        }
        if (const toml::node *noise = sensor.find("noise_c")) {
            array.noise_c = sensor.number(*noise, "noise_c", 0.0, 50.0);
        }
    }
    return array;
}

std::vector<std::pair<std::string, source_place>> read_effects(const reader &root)
{
    std::vector<std::pair<std::string, source_place>> effects;
    const toml::node *node = root.find("effects");
    if (node == nullptr) {
        return effects;
    }
    const std::vector<std::string> names = plant_effect_names();
    for (const toml::node &one : root.list(*node, "effects")) {
        const std::string name = root.text(one, "effects");
        bool known = false;
        for (const std::string &effect : names) {
            known = known || effect == name;
        }
        if (!known) {
            throw root.place(one.source())
                .error(fmt::format("there is no effect {}{}", in_quotes(name),
                                   did_you_mean(name, names)));
        }
        for (const auto &[seen, place] : effects) {
            if (seen == name) {
                throw root.place(one.source())
                    .error(fmt::format("effect {} appears twice; remove one", name));
            }
        }
        effects.emplace_back(name, root.place(one.source()));
    }
    return effects;
}

std::vector<std::string> plant_parameter_names()
{
    std::vector<std::string> names;
    for (std::size_t k = 0; k < plant_parameter_count(); ++k) {
        names.emplace_back(plant_parameter(k)->name);
    }
    return names;
}

model_parameter read_parameter(const reader &entry, int springs)
{
    entry.refuse_unknown({"name", "value", "unit", "stderr", "spring", "effect"});
    model_parameter parameter;
    const toml::node &name_node = entry.need("name");
    parameter.name = entry.text(name_node, "name");
    parameter.place = entry.place(name_node.source());
    const plant_parameter_t *known = find_plant_parameter(parameter.name);
    if (known == nullptr) {
        throw parameter.place.error(fmt::format(
            "there is no parameter {}{}; `ninespring-sim parameters` lists them",
            in_quotes(parameter.name), did_you_mean(parameter.name, plant_parameter_names())));
    }
    const toml::node &value = entry.need("value");
    parameter.value = entry.number(value, parameter.name.c_str(), known->minimum, known->maximum);
    parameter.place = entry.place(value.source());
    const toml::node &unit_node = entry.need("unit");
    const std::string unit = entry.text(unit_node, "unit");
    if (unit != known->unit) {
        throw entry.place(unit_node.source())
            .error(fmt::format("{} is in '{}', not in {}; convert the value", parameter.name,
                               known->unit, in_quotes(unit)));
    }
    if (const toml::node *node = entry.find("stderr")) {
        parameter.stderr_value = entry.number(*node, "stderr", 0.0, 1e12);
    }
    parameter.spring = 0;
    if (const toml::node *node = entry.find("spring")) {
        parameter.spring = entry.integer(*node, "spring", 1, springs);
        if (!known->per_spring) {
            throw entry.place(node->source())
                .error(fmt::format("{} is of the whole array; remove spring", parameter.name));
        }
    }
    if (const toml::node *node = entry.find("effect")) {
        const std::string effect = entry.text(*node, "effect");
        const std::string expected = known->effect == nullptr ? "" : known->effect;
        if (effect != expected) {
            throw entry.place(node->source())
                .error(expected.empty()
                           ? fmt::format("{} belongs to no effect; remove effect", parameter.name)
                           : fmt::format("{} belongs to effect {}, not to {}", parameter.name,
                                         expected, in_quotes(effect)));
        }
    }
    return parameter;
}

/* The paper's spring, for what the file leaves out (docs/physics.md). */
struct spring_geometry {
    double wire_diameter_mm = 0.8;
    double wire_length_mm = 110.0;
    double density_kg_per_m3 = 6450.0;
    double heat_capacity_j_per_kgk = 840.0;
    double latent_heat_j_per_kg = 24200.0;
    double resistivity_martensite_uohm_cm = 80.0;
    double resistivity_austenite_uohm_cm = 100.0;
};

const array_description::entry *find_entry(const std::vector<array_description::entry> &entries,
                                           const char *key)
{
    for (const array_description::entry &one : entries) {
        if (one.key == key) {
            return &one;
        }
    }
    return nullptr;
}

void take(const std::vector<array_description::entry> &entries, const char *key, double &value)
{
    const array_description::entry *found = find_entry(entries, key);
    if (found != nullptr) {
        value = found->value;
    }
}

void check_provenance(const reader &root)
{
    const toml::node *node = root.find("provenance");
    if (node == nullptr) {
        return;
    }
    const reader table = root.table(*node, "provenance");
    table.refuse_unknown(
        {"tool", "date", "logs", "rmse_before_c", "rmse_after_c", "hottest_c", "note"});
    for (const char *key : {"tool", "date", "note"}) {
        if (const toml::node *text = table.find(key)) {
            (void)table.text(*text, key);
        }
    }
    for (const char *key : {"rmse_before_c", "rmse_after_c", "hottest_c"}) {
        if (const toml::node *number = table.find(key)) {
            (void)table.number(*number, key, -100.0, 1e6);
        }
    }
    if (const toml::node *logs = table.find("logs")) {
        for (const toml::node &one : table.list(*logs, "logs")) {
            const reader log = table.table(one, "provenance.logs");
            log.refuse_unknown({"file", "sha256"});
            (void)log.text(log.need("file"), "file");
            (void)log.text(log.need("sha256"), "sha256");
        }
    }
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

namespace
{

/* The springs of an array into a plant of the same rows and columns. */
void apply_array(plant_t *plant, const array_description &array)
{
    for (const array_description::entry &one : array.material) {
        if (one.key == "emissivity" || one.key.find("_start_c") != std::string::npos ||
            one.key.find("_finish_c") != std::string::npos) {
            set_plant_parameter(plant, one.key, one.value, one.place);
        }
    }
    const bool given = !array.spring.empty() || array.material.size() > 0;
    if (!given) {
        return;
    }
    spring_geometry spring;
    take(array.spring, "wire_diameter_mm", spring.wire_diameter_mm);
    const array_description::entry *coil = find_entry(array.spring, "coil_diameter_mm");
    const array_description::entry *turns = find_entry(array.spring, "turns");
    if (coil != nullptr || turns != nullptr) {
        spring.wire_length_mm =
            PI * (coil != nullptr ? coil->value : 3.45) * (turns != nullptr ? turns->value : 10.0);
    }
    take(array.spring, "wire_length_mm", spring.wire_length_mm);
    take(array.material, "density_kg_per_m3", spring.density_kg_per_m3);
    take(array.material, "heat_capacity_j_per_kgk", spring.heat_capacity_j_per_kgk);
    take(array.material, "latent_heat_j_per_kg", spring.latent_heat_j_per_kg);
    take(array.material, "resistivity_martensite_uohm_cm", spring.resistivity_martensite_uohm_cm);
    take(array.material, "resistivity_austenite_uohm_cm", spring.resistivity_austenite_uohm_cm);
    const double section_mm2 = PI / 4.0 * spring.wire_diameter_mm * spring.wire_diameter_mm;
    const double mass_kg = section_mm2 * spring.wire_length_mm * 1e-9 * spring.density_kg_per_m3;
    const double ohm_per_uohm_cm =
        1e-5 * spring.wire_length_mm / section_mm2; /* 1 uohm cm = 1e-5 ohm mm */
    const source_place place =
        array.spring.empty() ? array.material[0].place : array.spring[0].place;
    const auto set = [&](const char *name, double value) {
        set_plant_parameter(plant, name, value, place);
    };
    set("wire_diameter_mm", spring.wire_diameter_mm);
    set("surface_mm2", PI * spring.wire_diameter_mm * spring.wire_length_mm);
    set("heat_capacity_j_per_k", mass_kg * spring.heat_capacity_j_per_kgk);
    set("latent_heat_j", mass_kg * spring.latent_heat_j_per_kg);
    set("resistance_martensite_ohm", ohm_per_uohm_cm * spring.resistivity_martensite_uohm_cm);
    set("resistance_austenite_ohm", ohm_per_uohm_cm * spring.resistivity_austenite_uohm_cm);
    set("resistance_ohm", ohm_per_uohm_cm * spring.resistivity_austenite_uohm_cm);
}

} // namespace

model_description parse_model(const text_file &file)
{
    const toml::table table = parse(file);
    const reader root(file.name, table, "the file");
    root.refuse_unknown(
        {"schema", "array", "spring", "material", "sensor", "effects", "parameter", "provenance"});
    const toml::node &schema = root.need("schema");
    if (root.text(schema, "schema") != MODEL_FILE_SCHEMA) {
        throw root.place(schema.source())
            .error(fmt::format("schema is {}; this version reads \"{}\"",
                               in_quotes(root.text(schema, "schema")), MODEL_FILE_SCHEMA));
    }
    model_description model;
    model.name = file.name;
    model.array = read_array_tables(root);
    model.effects = read_effects(root);
    std::set<std::pair<std::string, int>> seen;
    if (const toml::node *node = root.find("parameter")) {
        for (const toml::node &one : root.list(*node, "parameter")) {
            const reader entry = root.table(one, "[parameter]");
            model_parameter parameter = read_parameter(entry, model.array.rows * model.array.cols);
            if (!seen.insert({parameter.name, parameter.spring}).second) {
                throw parameter.place.error(
                    fmt::format("parameter {} appears twice; remove one", parameter.name));
            }
            model.parameters.push_back(std::move(parameter));
        }
    }
    check_provenance(root);
    return model;
}

model_description read_model(const std::string &path)
{
    return parse_model(read_text_file(path));
}

void apply_model(plant_t *plant, const model_description &model)
{
    apply_array(plant, model.array);
    for (const auto &[effect, place] : model.effects) {
        set_plant_effect(plant, effect, place);
    }
    /* What is said of all springs first, so that the order in the file does not matter. */
    for (const bool one_spring : {false, true}) {
        for (const model_parameter &parameter : model.parameters) {
            if ((parameter.spring != 0) == one_spring) {
                const std::string name =
                    one_spring ? fmt::format("{}[{}]", parameter.name, parameter.spring)
                               : parameter.name;
                set_plant_parameter(plant, name, parameter.value, parameter.place);
            }
        }
    }
}

} // namespace ninespring
