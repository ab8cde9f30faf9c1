/* What it is for: model.toml (what was built, and what was fitted to it), read whole
 * (docs/files.md).
 * What it owns: the keys of the file, their units and limits, and the advice when they are
 * wrong.
 * What it never does: fit, or hold a parameter table of its own: names, units and limits are the
 * plant's. */
#ifndef MODEL_FILE_H
#define MODEL_FILE_H

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "plant.h"
#include "text_file.h"

namespace ninespring
{

constexpr const char *MODEL_FILE_SCHEMA = "ninespring.model/1";

struct array_description {
    int rows = 3;
    int cols = 3;
    std::optional<double> pitch_mm;
    /* Numbers of [spring] and [material], by key, with their place; only those that the file gives.
     */
    struct entry {
        std::string key;
        double value;
        source_place place;
    };
    std::vector<entry> spring;
    std::vector<entry> material;
    std::string sensor_kind; /* thermocouple, thermistor, camera, other; empty: not said */
    std::optional<double> noise_c;
};

struct model_parameter {
    std::string name; /* of the plant's table */
    int spring;       /* 1-based; 0: all springs */
    double value;
    std::optional<double> stderr_value;
    source_place place;
};

struct model_description {
    array_description array;
    std::vector<std::pair<std::string, source_place>> effects;
    std::vector<model_parameter> parameters;
    std::string name; /* of the file */
};

/* Fails (input_error) if and only if the file breaks docs/files.md. */
model_description read_model(const std::string &path);
model_description parse_model(const text_file &file);

/* The array's springs and the model's effects and parameters into a plant of the same rows and
 * columns. Fails (input_error) if the plant refuses a value; the message names its place. */
void apply_model(plant_t *plant, const model_description &model);

/* One parameter `name` or `name[3]`, with the plant's own reason if it refuses. */
void set_plant_parameter(plant_t *plant, const std::string &name, double value,
                         const source_place &place);
void set_plant_effect(plant_t *plant, const std::string &name, const source_place &place);
/* The parameter's table entry, or null. */
const plant_parameter_t *find_plant_parameter(std::string_view name);
std::vector<std::string> plant_effect_names();

} // namespace ninespring
#endif
