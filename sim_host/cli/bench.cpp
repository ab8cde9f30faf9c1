#include "bench.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <sstream>

namespace ninespring
{

namespace
{

constexpr char WORDS[] =
    "resistor=K open=K absent=K r050=K reversed=K gate=K welded=K (K: a spring, several as 2,3,4, "
    "or all), addresses=K,L gates=K,L no-pull-up no-enable thermistor";

constexpr double THERMISTOR_V = 2.5; /* of 5: 10 k at 25 degC below 10 k */

/* What is after the `=`, from 0. */
std::vector<unsigned> channels_of(const std::string &word)
{
    const std::string text = word.substr(std::min(word.find('=') + 1, word.size()));
    std::vector<unsigned> channels;
    if (text == "all") {
        for (unsigned k = 0; k < BOARD_CHANNELS; k++) {
            channels.push_back(k);
        }
        return channels;
    }
    std::istringstream numbers(text);
    for (std::string one; std::getline(numbers, one, ',');) {
        double number = 0.0;
        if (!parse_number(one, number).empty() || number != std::floor(number) || number < 1.0 ||
            number > BOARD_CHANNELS) {
            throw input_error(fmt::format("--wiring {}: springs are 1 to {}, or all",
                                          in_quotes(word), BOARD_CHANNELS));
        }
        channels.push_back(static_cast<unsigned>(number) - 1u);
    }
    return channels;
}

std::pair<unsigned, unsigned> pair_of(const std::string &word)
{
    const std::vector<unsigned> two = channels_of(word);
    if (two.size() != 2 || two[0] == two[1]) {
        throw input_error(fmt::format("--wiring {}: two springs, as in 3,4", in_quotes(word)));
    }
    return {two[0], two[1]};
}

struct each_word {
    const char *name;
    void (*act)(board_t *board, unsigned channel);
};
constexpr each_word EACH[] = {
    {"resistor", [](board_t *b, unsigned k) { board_set_fault(b, BOARD_FAULT_RESISTOR, k, true); }},
    {"open", [](board_t *b, unsigned k) { board_set_fault(b, BOARD_FAULT_OPEN, k, true); }},
    {"absent", [](board_t *b, unsigned k) { board_set_fault(b, BOARD_FAULT_NACK, k, true); }},
    {"gate", [](board_t *b, unsigned k) { board_set_fault(b, BOARD_FAULT_GATE, k, true); }},
    {"welded", [](board_t *b, unsigned k) { board_set_fault(b, BOARD_FAULT_CLOSED, k, true); }},
    {"r050", [](board_t *b, unsigned k) { board_scale_sensor(b, k, 0.5, 1.0); }},
    {"reversed", [](board_t *b, unsigned k) { board_scale_sensor(b, k, -1.0, 1.0); }},
};

const each_word *find_each(const std::string &name)
{
    const auto *found = std::find_if(std::begin(EACH), std::end(EACH),
                                     [&](const each_word &one) { return name == one.name; });
    return found == std::end(EACH) ? nullptr : found;
}

void add_words(std::istream &text, std::vector<std::string> &words)
{
    for (std::string line; std::getline(text, line);) {
        std::istringstream rest(line.substr(0, line.find('#')));
        for (std::string word; rest >> word;) {
            words.push_back(word);
        }
    }
}

void check(const std::string &word)
{
    const std::string name = word.substr(0, word.find('='));
    if (name == "addresses" || name == "gates") {
        (void)pair_of(word);
    } else if (find_each(name) != nullptr && name != word) {
        (void)channels_of(word);
    } else if (word != "no-pull-up" && word != "no-enable" && word != "thermistor") {
        throw input_error(fmt::format("--wiring {}: one of {}", in_quotes(word), WORDS));
    }
}

} // namespace

bench::bench(const bench_arguments &arguments, board_t *board)
    : arguments_(arguments), board_(board)
{
    wire(words());
}

std::vector<std::string> bench::words() const
{
    std::vector<std::string> all;
    if (arguments_.without_springs) {
        all.emplace_back("resistor=all");
    }
    for (const std::string &one : arguments_.wiring) {
        if (one.rfind('@', 0) != 0) {
            all.push_back(one);
            continue;
        }
        std::istringstream file(read_bytes(one.substr(1)));
        add_words(file, all);
    }
    std::for_each(all.begin(), all.end(), check);
    return all;
}

void bench::look_again()
{
    std::vector<std::string> now;
    try {
        now = words();
    } catch (const input_error &error) {
        now = {error.what()};
        if (now != words_) {
            fmt::print(stderr, "{}\n", error.what());
        }
        words_ = now;
        return;
    }
    if (now != words_) {
        wire(now);
    }
}

void bench::wire(const std::vector<std::string> &words)
{
    for (const auto &[a, b] : sensors_) {
        board_swap_sensors(board_, a, b);
    }
    for (const auto &[a, b] : gates_) {
        board_swap_gates(board_, a, b);
    }
    sensors_.clear();
    gates_.clear();
    for (unsigned k = 0; k < BOARD_CHANNELS; k++) {
        for (const board_fault_t fault :
             {BOARD_FAULT_OPEN, BOARD_FAULT_NACK, BOARD_FAULT_GATE, BOARD_FAULT_CLOSED}) {
            board_set_fault(board_, fault, k, false); /* no fault of a spring: as it is */
        }
        board_scale_sensor(board_, k, 1.0, 1.0);
    }
    const auto has = [&](const char *word) {
        return std::find(words.begin(), words.end(), word) != words.end();
    };
    board_set_fault(board_, BOARD_FAULT_SDA_LOW, 0, has("no-pull-up"));
    board_set_fault(board_, BOARD_FAULT_ENABLE_LOW, 0, has("no-enable"));
    board_set_analog_v(board_, 0, has("thermistor") ? THERMISTOR_V : 0.0);
    for (const std::string &word : words) {
        const std::string name = word.substr(0, word.find('='));
        if (name == "addresses") {
            sensors_.push_back(pair_of(word));
            board_swap_sensors(board_, sensors_.back().first, sensors_.back().second);
        } else if (name == "gates") {
            gates_.push_back(pair_of(word));
            board_swap_gates(board_, gates_.back().first, gates_.back().second);
        } else if (const each_word *each = find_each(name)) {
            for (const unsigned k : channels_of(word)) {
                each->act(board_, k);
            }
        }
    }
    words_ = words;
}

void add_bench_options(CLI::App &command, bench_arguments &arguments)
{
    command.add_flag("--without-springs", arguments.without_springs,
                     "Resistors of 0.22 ohm in the springs' places, as for a first power-up");
    command
        .add_option("--wiring", arguments.wiring,
                    std::string("What is wired wrongly, or not yet: ") + WORDS +
                        "; --wiring again for another; @FILE: the words that this file has, looked "
                        "at again as it changes")
        ->take_all()
        ->allow_extra_args(false);
}

} // namespace ninespring
