/* What it is for: scenarios (docs/files.md): what array, which plant, what happens when.
 * What it owns: the sections and keys of the file, the words of its events, and `--set`.
 * What it never does: run anything, or know a plant parameter's or a setting's limits. */
#ifndef SCENARIO_FILE_H
#define SCENARIO_FILE_H

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "text_file.h"

namespace ninespring
{

/* Something the file says that is passed on by name. */
struct scenario_entry {
    std::string key;
    std::string value;
    source_place place; /* of the value */
    source_place key_place;
};

enum class scenario_word {
    on,      /* springs, amount: level in percent */
    off,     /* springs */
    pattern, /* pattern */
    policy,  /* text */
    fan,     /* amount: percent */
    ambient, /* amount: degC, what the board is told */
    clear,   /* forget faults */
    unlock,
    stop,    /* the console's `!` */
    console, /* text: another console line, for a board only */
    room,    /* amount: degC, the plant's own ambient */
    set,     /* parameter of the plant (a load, a contact), amount */
    fail,    /* what, springs */
    repair   /* what, springs */
};

enum class scenario_failure {
    none,
    open,
    short_circuit,
    closed, /* the switch, whatever the duty */
    nack,
    sda_low,
    stale,
    freeze,
    lie,  /* amount: shown of the current, voltage_amount: of the voltage */
    swap, /* two springs' sensors */
    ina_reset,
    brown_out,
    fan_stop
};

struct scenario_event {
    double time_s = 0.0;
    scenario_word word = scenario_word::off;
    std::vector<int> springs; /* 0-based, rising */
    double amount = 0.0;
    double voltage_amount = 0.0;
    std::string parameter;
    std::vector<bool> pattern;
    scenario_failure what = scenario_failure::none;
    std::string
        text; /* as written, single blanks: a console line where the word is the console's */
    source_place place;
};

/* A board's own settings. */
struct scenario_board {
    int number; /* from 1 */
    std::vector<scenario_entry> settings;
    source_place place;
};

struct scenario {
    std::string name;
    double duration_s = 0.0;
    double log_interval_s = 1.0;
    std::uint64_t seed = 1;
    std::string policy; /* empty: as the settings say */
    int rows = 3;
    int cols = 3;
    int layers = 1;     /* 2: springs rows x cols + 1 .. are the stiffness layer's */
    int board_rows = 0; /* springs of one board; 0: all of a layer, one board */
    int board_cols = 0;
    std::vector<scenario_board> boards; /* those that differ from [chip] */
    std::optional<double> pitch_mm;
    source_place pitch_place;
    std::string model; /* [chip] model: "plant", "defaults" or a file of `$name=value` lines, from
                          the scenario's folder */
    source_place model_place;
    std::vector<scenario_entry> effects;  /* key: the effect */
    std::vector<scenario_entry> plant;    /* parameters */
    std::vector<scenario_entry> settings; /* the chip's, without `$` */
    double noise_temperature_c = 0.0;
    double noise_current_a = 0.0;
    double noise_voltage_v = 0.0;
    std::vector<scenario_event> events; /* in time; equal times as written */

    [[nodiscard]] int springs() const { return layers * rows * cols; }
};

/* `arguments`: --set texts, `section.key=value` or, for a plant parameter, `name=value`; they act
 * as if they stood at the file's end. Fails (input_error) if and only if the file or an argument
 * breaks docs/files.md. */
scenario read_scenario(const std::string &path, const std::vector<std::string> &arguments = {});
scenario parse_scenario(const text_file &file, const std::vector<std::string> &arguments = {});

/* A whole number, 0 or more; anything else fails (input_error) at `place`. */
std::uint64_t parse_seed(const std::string &text, const source_place &place);

} // namespace ninespring
#endif
