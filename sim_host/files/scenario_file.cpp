#include "scenario_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <ini.h>
#include <limits>
#include <set>
#include <sstream>

namespace ninespring
{

namespace
{

/* inih's line buffer holds 200 bytes with line end and zero. */
constexpr std::size_t MAX_LINE = 197;
constexpr std::size_t MAX_EVENTS = 100000;
constexpr double MOST_LOGGED = 2e7; /* rows times springs: about a gigabyte in memory */

struct raw_entry {
    std::string section;
    std::string key;
    std::string value;
    source_place key_place;
    source_place value_place;
};

/* Feeds inih line by line, so that the place of each entry is known. */
struct line_source {
    const text_file *file;
    std::size_t position = 0;
    std::size_t line = 0;
    std::string_view text;
    std::vector<raw_entry> entries;
    std::vector<std::pair<std::string, source_place>> sections;
};

char *give_line(char *buffer, int size, void *stream)
{
    auto &source = *static_cast<line_source *>(stream);
    if (source.position >= source.file->text.size()) {
        return nullptr;
    }
    source.text = next_line(source.file->text, source.position);
    ++source.line;
    /* inih takes any indented line for more of the value above; here only one without '=' is that.
     */
    std::string_view given = source.text;
    const std::size_t first = std::min(given.find_first_not_of(" \t"), given.size());
    if (given.find_first_of("=:[", first) != std::string_view::npos) {
        given.remove_prefix(first);
    }
    const std::size_t count = std::min(given.size(), static_cast<std::size_t>(size) - 2);
    std::memcpy(buffer, given.data(), count);
    buffer[count] = '\n';
    buffer[count + 1] = '\0';
    if (first < source.text.size() && source.text[first] == '[') {
        const std::size_t end = source.text.find(']', first);
        if (end != std::string_view::npos) {
            source.sections.emplace_back(
                std::string(source.text.substr(first + 1, end - first - 1)),
                source_place{source.file->name, source.line, first + 1});
        }
    }
    return buffer;
}

int take_entry(void *user, const char *section, const char *name, const char *value)
{
    auto &source = *static_cast<line_source *>(user);
    const std::string_view text = source.text;
    const std::size_t first = std::min(text.find_first_not_of(" \t"), text.size());
    std::size_t start = first;
    const bool continues = first != 0 && text.find_first_of("=:") == std::string_view::npos;
    if (!continues) {
        const std::size_t separator = text.find_first_of("=:", first);
        start = separator == std::string_view::npos
                    ? text.size()
                    : std::min(text.find_first_not_of(" \t", separator + 1), text.size());
    }
    if (continues && !source.entries.empty() && source.entries.back().key == name) {
        source.entries.back().value += std::string("\n") + value;
        return 1;
    }
    source.entries.push_back({section, name, value,
                              source_place{source.file->name, source.line, first + 1},
                              source_place{source.file->name, source.line, start + 1}});
    return 1;
}

double number(const raw_entry &entry, double low, double high)
{
    double value = 0.0;
    const std::string problem = parse_number(entry.value, value);
    if (!problem.empty()) {
        throw entry.value_place.error(fmt::format("{}: {}", entry.key, problem));
    }
    if (!(value >= low && value <= high)) {
        throw entry.value_place.error(
            fmt::format("{} is {}; it must be {} to {}", entry.key, value, low, high));
    }
    return value;
}

int whole(const raw_entry &entry, int low, int high)
{
    const double value = number(entry, low, high);
    if (value != std::floor(value)) {
        throw entry.value_place.error(fmt::format("{} must be a whole number", entry.key));
    }
    return static_cast<int>(value);
}

[[noreturn]] void refuse_key(const raw_entry &entry, const std::vector<std::string> &names)
{
    std::string list;
    for (const std::string &name : names) {
        list += (list.empty() ? "" : ", ") + name;
    }
    throw entry.key_place.error(fmt::format("[{}] has no key {} (it has {}){}", entry.section,
                                            in_quotes(entry.key), list,
                                            did_you_mean(entry.key, names)));
}

std::vector<std::string> words_of(std::string_view text)
{
    std::vector<std::string> words;
    std::istringstream stream{std::string(text)};
    std::string word;
    while (stream >> word) {
        words.push_back(word);
    }
    return words;
}

struct failure_word {
    const char *name;
    scenario_failure what;
    const char *after; /* what follows the word, as the user is told */
    std::size_t springs;
    bool lasts;
};

constexpr std::array<failure_word, 12> FAILURES = {
    {{"open", scenario_failure::open, " K", 1, true},
     {"short", scenario_failure::short_circuit, " K", 1, true},
     {"closed", scenario_failure::closed, " K", 1, true},
     {"nack", scenario_failure::nack, " K", 1, true},
     {"stale", scenario_failure::stale, " K", 1, true},
     {"freeze", scenario_failure::freeze, " K", 1, true},
     {"lie", scenario_failure::lie, " K CURRENT_SCALE VOLTAGE_SCALE", 1, true},
     {"swap", scenario_failure::swap, " K L", 2, true},
     {"ina_reset", scenario_failure::ina_reset, " K", 1, false},
     {"sda_low", scenario_failure::sda_low, "", 0, true},
     {"brown_out", scenario_failure::brown_out, "", 0, false},
     {"fan_stop", scenario_failure::fan_stop, "", 0, true}}};

/* One event's words, checked against the array. */
class event_reader
{
public:
    event_reader(const raw_entry &entry, const scenario &plan)
        : entry_(entry), springs_(plan.springs()), layers_(plan.layers)
    {
    }

    scenario_event read(double time_s)
    {
        scenario_event event;
        event.time_s = time_s;
        event.place = entry_.value_place;
        words_ = words_of(entry_.value);
        if (words_.empty()) {
            throw wrong("what happens is missing; write for example `at 10 = on 1`");
        }
        for (const std::string &word : words_) {
            event.text += (event.text.empty() ? "" : " ") + word;
        }
        const std::string &first = words_[0];
        if (first == "on") {
            event.word = scenario_word::on;
            count(2, 3, "on K [percent]");
            event.springs = springs(words_[1], true);
            event.amount = words_.size() == 3 ? percent(words_[2], "a level") : 100.0;
        } else if (first == "off") {
            event.word = scenario_word::off;
            count(2, 2, "off K|all");
            event.springs = springs(words_[1], true);
        } else if (first == "pattern") {
            event.word = scenario_word::pattern;
            count(2, 2, layers_ == 1 ? "pattern 111101111" : "pattern 111101111/000010000");
            event.pattern = pattern(words_[1]);
        } else if (first == "policy") {
            event.word = scenario_word::policy;
            count(2, 2, "policy open|precompensate");
            if (words_[1] != "open" && words_[1] != "precompensate") {
                throw wrong(fmt::format("there is no policy {}; write open or precompensate",
                                        in_quotes(words_[1])));
            }
        } else if (first == "fan") {
            event.word = scenario_word::fan;
            count(2, 2, "fan 0..100");
            event.amount = percent(words_[1], "the fan");
        } else if (first == "ambient") {
            event.word = scenario_word::ambient;
            count(2, 2, "ambient DEGC");
            event.amount = amount(words_[1], -40.0, 50.0); /* as ambient_c, which it tells */
        } else if (first == "room") {
            event.word = scenario_word::room;
            count(2, 2, "room DEGC");
            event.amount = amount(words_[1], -40.0, 85.0);
        } else if (first == "set") {
            event.word = scenario_word::set;
            count(3, 3, "set PARAMETER VALUE");
            event.parameter = words_[1];
            event.amount = amount(words_[2], -1e9, 1e9);
        } else if (first == "clear" || first == "unlock" || first == "!") {
            event.word = first == "clear"    ? scenario_word::clear
                         : first == "unlock" ? scenario_word::unlock
                                             : scenario_word::stop;
            count(1, 1, first.c_str());
        } else if (first == "fail" || first == "repair") {
            event.word = first == "fail" ? scenario_word::fail : scenario_word::repair;
            failure(event);
        } else if (first[0] == '$' || first[0] == '?' || first == "telemetry" || first == "model" ||
                   first == "supply" || first == "learnt" || first == "faults" ||
                   first == "selftest" || first == "help" || first == "version" || first == "why" ||
                   first == "echo") {
            event.word = scenario_word::console;
        } else {
            throw wrong(fmt::format(
                "there is no word {} (events have on, off, pattern, policy, fan, ambient, clear, "
                "unlock, !, room, set, fail, repair){}",
                in_quotes(first),
                did_you_mean(first, {"on", "off", "pattern", "policy", "fan", "ambient", "clear",
                                     "unlock", "room", "set", "fail", "repair", "telemetry"})));
        }
        return event;
    }

private:
    [[nodiscard]] input_error wrong(const std::string &message) const
    {
        return entry_.value_place.error(message);
    }

    void count(std::size_t least, std::size_t most, const char *form) const
    {
        if (words_.size() < least || words_.size() > most) {
            throw wrong(fmt::format("{} has {} words; write `{}`", in_quotes(words_[0]),
                                    words_.size(), form));
        }
    }

    [[nodiscard]] double amount(const std::string &word, double low, double high) const
    {
        double value = 0.0;
        const std::string problem = parse_number(word, value);
        if (!problem.empty()) {
            throw wrong(problem);
        }
        if (!(value >= low && value <= high)) {
            throw wrong(fmt::format("{} is {}; it must be {} to {}", words_[0], value, low, high));
        }
        return value;
    }

    [[nodiscard]] double percent(const std::string &word, const char *what) const
    {
        const double value = amount(word, 0.0, 100.0);
        if (value != std::floor(value)) {
            throw wrong(fmt::format("{} takes whole percent", what));
        }
        return value;
    }

    [[nodiscard]] std::vector<int> springs(const std::string &word, bool all) const
    {
        std::vector<int> list;
        if (all && word == "all") {
            for (int k = 0; k < springs_; ++k) {
                list.push_back(k);
            }
            return list;
        }
        int spring = 0;
        const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), spring);
        if (status != std::errc() || end != word.data() + word.size() || spring < 1 ||
            spring > springs_) {
            throw wrong(fmt::format("{} is not a spring; write 1 to {}{}", in_quotes(word),
                                    springs_, all ? " or all" : ""));
        }
        list.push_back(spring - 1);
        return list;
    }

    [[nodiscard]] std::vector<bool> pattern(const std::string &word) const
    {
        const std::size_t slash = word.find('/');
        if (layers_ == 1) {
            if (slash != std::string::npos) {
                throw wrong(fmt::format("pattern {} is of two layers, the array has one; write "
                                        "[array] layers = 2",
                                        in_quotes(word)));
            }
            return digits(word, "", springs_);
        }
        if (slash == std::string::npos) {
            throw wrong(fmt::format("pattern {} is of one layer, the array has two; write "
                                    "elongation/stiffness, with {} digits each",
                                    in_quotes(word), springs_ / 2));
        }
        std::vector<bool> bits = digits(word.substr(0, slash), "elongation ", springs_ / 2);
        const std::vector<bool> below = digits(word.substr(slash + 1), "stiffness ", springs_ / 2);
        bits.insert(bits.end(), below.begin(), below.end());
        return bits;
    }

    [[nodiscard]] std::vector<bool> digits(const std::string &word, const char *layer,
                                           int springs) const
    {
        std::vector<bool> bits;
        for (const char c : word) {
            if (c != '0' && c != '1') {
                throw wrong(fmt::format("{}pattern {} holds something else than 0 and 1", layer,
                                        in_quotes(word)));
            }
            bits.push_back(c == '1');
        }
        if (bits.size() != static_cast<std::size_t>(springs)) {
            throw wrong(
                fmt::format("{}pattern has {} digits for {} springs", layer, bits.size(), springs));
        }
        return bits;
    }

    void failure(scenario_event &event) const
    {
        std::string known;
        const failure_word *found = nullptr;
        for (const failure_word &one : FAILURES) {
            known += (known.empty() ? "" : ", ") + std::string(one.name) + one.after;
            if (words_.size() >= 2 && words_[1] == one.name) {
                found = &one;
            }
        }
        if (found == nullptr) {
            throw wrong(fmt::format("{} what? {}", words_[0], known));
        }
        if (event.word == scenario_word::repair && !found->lasts) {
            throw wrong(fmt::format("{} is over at once; there is nothing to repair", found->name));
        }
        event.what = found->what;
        const bool scales =
            event.word == scenario_word::fail && found->what == scenario_failure::lie;
        const std::size_t words = 2 + found->springs + (scales ? 2 : 0);
        const char *const after =
            found->what == scenario_failure::lie && !scales ? " K" : found->after;
        count(words, words, fmt::format("{} {}{}", words_[0], found->name, after).c_str());
        for (std::size_t k = 0; k < found->springs; ++k) {
            event.springs.push_back(springs(words_[2 + k], false)[0]);
        }
        if (event.springs.size() == 2 && event.springs[0] == event.springs[1]) {
            throw wrong(fmt::format("{} takes two springs", found->name));
        }
        if (scales) {
            event.amount = amount(words_[3], 0.0, 100.0);
            event.voltage_amount = amount(words_[4], 0.0, 100.0);
        }
    }

    const raw_entry &entry_;
    int springs_;
    int layers_;
    std::vector<std::string> words_;
};

void read_scenario_key(scenario &result, const raw_entry &entry)
{
    if (entry.key == "duration_s") {
        result.duration_s = number(entry, 0.02, 1e6);
    } else if (entry.key == "log_interval_s") {
        result.log_interval_s = number(entry, 0.02, 1e5);
        const double ticks = result.log_interval_s / 0.02;
        if (std::fabs(ticks - std::round(ticks)) > 1e-6) {
            throw entry.value_place.error(
                "log_interval_s must be a multiple of 0.02 (one control tick)");
        }
    } else if (entry.key == "seed") {
        result.seed = parse_seed(entry.value, entry.value_place);
    } else if (entry.key == "policy") {
        if (entry.value != "open" && entry.value != "precompensate") {
            throw entry.value_place.error(fmt::format(
                "there is no policy {}; write open or precompensate", in_quotes(entry.value)));
        }
        result.policy = entry.value;
    } else {
        refuse_key(entry, {"duration_s", "log_interval_s", "seed", "policy"});
    }
}

void read_effects(scenario &result, const raw_entry &entry)
{
    std::string list = entry.value;
    std::replace(list.begin(), list.end(), ',', ' ');
    result.effects.clear();
    std::set<std::string> seen;
    for (const std::string &name : words_of(list)) {
        if (!seen.insert(name).second) {
            throw entry.value_place.error(
                fmt::format("effect {} appears twice; remove one", in_quotes(name)));
        }
        result.effects.push_back({name, "on", entry.value_place, entry.value_place});
    }
}

void put(std::vector<scenario_entry> &list, scenario_entry entry)
{
    for (scenario_entry &old : list) {
        if (old.key == entry.key) {
            old = std::move(entry);
            return;
        }
    }
    list.push_back(std::move(entry));
}

const std::vector<std::string> SECTIONS = {"scenario", "array", "plant", "chip", "noise", "events"};

/* N of the section [board.N]; 0: it is no such section. */
int board_number(const std::string &section)
{
    const std::string digits = section.rfind("board.", 0) == 0 ? section.substr(6) : "";
    if (digits.empty() || digits.size() > 4 || digits[0] == '0' ||
        digits.find_first_not_of("0123456789") != std::string::npos) {
        return 0;
    }
    return std::stoi(digits);
}

void put_setting(std::vector<scenario_entry> &settings, const raw_entry &entry)
{
    const std::string name = entry.key[0] == '$' ? entry.key.substr(1) : entry.key;
    put(settings, {name, entry.value, entry.value_place, entry.key_place});
}

void read_board(scenario &result, int number, const raw_entry &entry)
{
    for (scenario_board &board : result.boards) {
        if (board.number == number) {
            put_setting(board.settings, entry);
            return;
        }
    }
    result.boards.push_back({number, {}, entry.key_place});
    put_setting(result.boards.back().settings, entry);
}

void read_entry(scenario &result, const raw_entry &entry)
{
    if (entry.section == "scenario") {
        read_scenario_key(result, entry);
    } else if (entry.section == "array") {
        if (entry.key == "rows") {
            result.rows = whole(entry, 1, 64);
        } else if (entry.key == "cols") {
            result.cols = whole(entry, 1, 64);
        } else if (entry.key == "layers") {
            result.layers = whole(entry, 1, 2);
        } else if (entry.key == "pitch_mm") {
            result.pitch_mm = number(entry, 0.1, 1000.0);
            result.pitch_place = entry.value_place;
        } else if (entry.key == "board_rows") {
            result.board_rows = whole(entry, 1, 64);
        } else if (entry.key == "board_cols") {
            result.board_cols = whole(entry, 1, 64);
        } else {
            refuse_key(entry, {"rows", "cols", "layers", "pitch_mm", "board_rows", "board_cols"});
        }
    } else if (entry.section == "plant") {
        if (entry.key == "effects") {
            read_effects(result, entry);
        } else {
            put(result.plant, {entry.key, entry.value, entry.value_place, entry.key_place});
        }
    } else if (entry.section == "chip") {
        if (entry.key == "model") {
            result.model = entry.value;
            result.model_place = entry.value_place;
        } else {
            put_setting(result.settings, entry);
        }
    } else if (board_number(entry.section) != 0) {
        read_board(result, board_number(entry.section), entry);
    } else if (entry.section == "noise") {
        if (entry.key == "temperature_c") {
            result.noise_temperature_c = number(entry, 0.0, 50.0);
        } else if (entry.key == "current_a") {
            result.noise_current_a = number(entry, 0.0, 1.0);
        } else if (entry.key == "voltage_v") {
            result.noise_voltage_v = number(entry, 0.0, 1.0);
        } else {
            refuse_key(entry, {"temperature_c", "current_a", "voltage_v"});
        }
    } else if (entry.section.empty()) {
        throw entry.key_place.error(fmt::format(
            "{} stands before any [section]; begin with [scenario]", in_quotes(entry.key)));
    }
}

/* Springs of a board, and numbers of boards. */
void check_boards(scenario &result)
{
    if ((result.board_rows == 0) != (result.board_cols == 0)) {
        throw input_error(result.name, 1, 1, "[array] board_rows and board_cols go together");
    }
    if (result.board_rows == 0) {
        result.board_rows = result.rows;
        result.board_cols = result.cols;
    }
    const int rows = std::min(result.rows, result.board_rows);
    const int cols = std::min(result.cols, result.board_cols);
    if (rows * cols > 64) {
        throw input_error(result.name, 1, 1,
                          fmt::format("[array] {} x {} are more than 64 springs on a board; make "
                                      "board_rows and board_cols smaller",
                                      rows, cols));
    }
    if (result.springs() > 1024) {
        throw input_error(result.name, 1, 1,
                          fmt::format("[array] {} x {}{} are more than 1024 springs", result.rows,
                                      result.cols, result.layers == 2 ? " in two layers" : ""));
    }
    const int boards =
        result.layers * ((result.rows + rows - 1) / rows) * ((result.cols + cols - 1) / cols);
    for (const scenario_board &board : result.boards) {
        if (board.number > boards) {
            throw board.place.error(
                fmt::format("[board.{}], but the array has {}", board.number, boards));
        }
    }
}

double event_time(const raw_entry &entry)
{
    const std::vector<std::string> words = words_of(entry.key);
    double time_s = 0.0;
    if (words.size() != 2 || words[0] != "at") {
        throw entry.key_place.error(fmt::format(
            "{} is not a time; write `at SECONDS = what happens`", in_quotes(entry.key)));
    }
    const std::string problem = parse_number(words[1], time_s);
    if (!problem.empty()) {
        throw entry.key_place.error("at: " + problem);
    }
    if (!(time_s >= 0.0)) {
        throw entry.key_place.error(fmt::format("at {}: a time is 0 or more", time_s));
    }
    return time_s;
}

void check_sections(const line_source &source)
{
    for (const auto &[name, place] : source.sections) {
        if (std::find(SECTIONS.begin(), SECTIONS.end(), name) == SECTIONS.end() &&
            board_number(name) == 0) {
            throw place.error(fmt::format("there is no section {}{}; there are [scenario], "
                                          "[array], [plant], [chip], [board.N], [noise], [events]",
                                          in_quotes(name), did_you_mean(name, SECTIONS)));
        }
    }
}

void check_duplicates(const std::vector<raw_entry> &entries)
{
    std::set<std::pair<std::string, std::string>> seen;
    for (const raw_entry &entry : entries) {
        if (entry.section != "events" && !seen.insert({entry.section, entry.key}).second) {
            throw entry.key_place.error(fmt::format("{} appears twice in [{}]; remove one",
                                                    in_quotes(entry.key), entry.section));
        }
    }
}

raw_entry argument_entry(const std::string &argument)
{
    const source_place place{fmt::format("--set {}", in_quotes(argument)), 0, 0};
    const std::size_t equals = argument.find('=');
    if (equals == std::string::npos || equals == 0) {
        throw place.error("write --set key=value");
    }
    std::string key = argument.substr(0, equals);
    std::string section = "plant";
    const std::size_t dot = key.find('.');
    if (dot != std::string::npos) {
        section = key.substr(0, dot);
        key = key.substr(dot + 1);
        if (section == "events" ||
            std::find(SECTIONS.begin(), SECTIONS.end(), section) == SECTIONS.end()) {
            throw place.error(fmt::format("there is no section {}; there are scenario, array, "
                                          "plant, chip, noise",
                                          in_quotes(section)));
        }
    }
    if (key.empty()) {
        throw place.error("write --set section.key=value");
    }
    return {section, key, argument.substr(equals + 1), place, place};
}

} // namespace

std::uint64_t parse_seed(const std::string &text, const source_place &place)
{
    std::uint64_t seed = 0;
    const char *end = text.data() + text.size();
    const auto [stop, status] = std::from_chars(text.data(), end, seed);
    if (status != std::errc() || stop != end) {
        throw place.error(fmt::format("seed {} must be a whole number, 0 to {}", in_quotes(text),
                                      std::numeric_limits<std::uint64_t>::max()));
    }
    return seed;
}

scenario parse_scenario(const text_file &file, const std::vector<std::string> &arguments)
{
    line_source source;
    source.file = &file;
    const int status = ini_parse_stream(give_line, &source, take_entry, &source);
    if (status > 0) {
        const auto line = static_cast<std::size_t>(status);
        throw input_error(file.name, line, 1,
                          "this line is neither [section] nor key = value; correct it");
    }
    if (status < 0) {
        throw work_error(fmt::format("{}: memory is out", file.name));
    }
    check_sections(source);
    check_duplicates(source.entries);

    scenario result;
    result.name = file.name;
    std::vector<raw_entry> entries = source.entries;
    for (const std::string &argument : arguments) {
        entries.push_back(argument_entry(argument));
    }
    for (const raw_entry &entry : entries) {
        if (entry.value.find('\n') != std::string::npos && entry.key != "effects") {
            throw entry.value_place.error(
                fmt::format("{} continues on the next line; an indented line without '=' belongs "
                            "to the key above",
                            in_quotes(entry.key)));
        }
        if (entry.section != "events" && entry.value.empty() && entry.key != "effects") {
            throw entry.value_place.error(
                fmt::format("{} is without a value", in_quotes(entry.key)));
        }
        read_entry(result, entry);
    }
    if (result.duration_s <= 0.0) {
        throw input_error(file.name, 1, 1,
                          "[scenario] is without duration_s; add how long to run, in seconds");
    }
    const double values = result.duration_s / result.log_interval_s * result.springs();
    if (values > MOST_LOGGED) {
        throw input_error(file.name, 1, 1,
                          fmt::format("[scenario] the log would hold {:.3g} rows of springs, at "
                                      "most {:.3g}; make log_interval_s longer",
                                      values, MOST_LOGGED));
    }
    check_boards(result);
    for (const raw_entry &entry : source.entries) {
        if (entry.section == "events") {
            const double time_s = event_time(entry);
            if (time_s > result.duration_s) {
                throw entry.key_place.error(
                    fmt::format("at {} is after the end ({} s); make duration_s longer", time_s,
                                result.duration_s));
            }
            result.events.push_back(event_reader(entry, result).read(time_s));
        }
    }
    if (result.events.size() > MAX_EVENTS) {
        throw input_error(
            file.name, 1, 1,
            fmt::format("{} events are more than {}", result.events.size(), MAX_EVENTS));
    }
    std::stable_sort(
        result.events.begin(), result.events.end(),
        [](const scenario_event &a, const scenario_event &b) { return a.time_s < b.time_s; });
    return result;
}

scenario read_scenario(const std::string &path, const std::vector<std::string> &arguments)
{
    return parse_scenario(read_text_file(path, MAX_LINE), arguments);
}

} // namespace ninespring
