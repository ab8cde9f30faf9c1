#include "command.h"

#include <algorithm>
#include <fmt/format.h>

#include "rerun.h"

namespace ninespring
{

namespace
{

struct rerun_options {
    std::string tape;
    std::vector<std::string> asks;
    double at_s = -1.0;
};

void ask_all(rerun &again, const rerun_options &options)
{
    for (const std::string &ask : options.asks) {
        fmt::print("{:.2f} s: {}\n", again.time_s(), ask);
        try {
            std::string said = again.ask(ask);
            said.erase(std::remove(said.begin(), said.end(), '\r'), said.end());
            fmt::print("{}", said);
        } catch (const std::invalid_argument &error) {
            throw input_error(fmt::format("--ask {}: {}", in_quotes(ask), error.what()));
        }
    }
}

void run_again(const rerun_options &options)
{
    const text_file file = read_text_file(options.tape);
    rerun again;
    std::size_t position = 0;
    bool asked = options.at_s < 0.0;
    for (std::size_t number = 1; position < file.text.size() && !again.ended(); ++number) {
        const std::string line(next_line(file.text, position));
        try {
            again.line(line);
        } catch (const std::invalid_argument &error) {
            throw input_error(file.name, number, 1,
                              fmt::format("{} {}", in_quotes(line), error.what()));
        }
        if (!asked && again.started() && again.time_s() >= options.at_s) {
            asked = true;
            ask_all(again, options);
        }
    }
    const rerun::tally &tally = again.so_far();
    if (tally.ticks == 0) {
        throw input_error(file.name, 0, 0,
                          "no readings; a tape is what `ninespring record --tape` writes");
    }
    if (!asked) {
        throw input_error(
            fmt::format("--at {:g}: the tape ends at {:.2f} s", options.at_s, again.time_s()));
    }
    if (options.at_s < 0.0) {
        ask_all(again, options);
    }
    fmt::print("{} ticks ({:.2f} s), {} lines typed, {} beliefs compared: ", tally.ticks,
               again.time_s(), tally.typed, tally.marks);
    if (tally.missing != 0) {
        fmt::print("{} ticks are missing, the first at {:.2f} s\n", tally.missing, tally.missing_s);
        throw work_error(fmt::format("the tape is whole until {:.2f} s: what is believed later is "
                                     "not the board's; ask with --at before that",
                                     tally.missing_s));
    }
    if (tally.other != 0) {
        fmt::print("{} differ, first spring {} at {:.2f} s\n", tally.other, tally.other_spring,
                   tally.other_s);
        throw work_error("the belief is not the board's: is the tape of this version?");
    }
    fmt::print("the same to the last bit\n");
}

} // namespace

void add_command_rerun(CLI::App &app)
{
    CLI::App *command = app.add_subcommand(
        "rerun", "A board's day again: what `ninespring record --tape` recorded, through the "
                 "board's own code, to the same belief");
    auto options = std::make_shared<rerun_options>();
    command->add_option("tape", options->tape, "The tape")->required();
    command->add_option("--ask", options->asks,
                        "Console line to be answered as the board would have: model, \"why 3\", "
                        "learnt, faults, $$");
    command
        ->add_option("--at", options->at_s,
                     "When it is asked, seconds since the tape's start; default: at its end")
        ->check(number_from_to(0.0, 1e9));
    command->callback([options] { run_again(*options); });
}

} // namespace ninespring
