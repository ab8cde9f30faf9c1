/* ninespring-sim: the simulated array, the paper's conditions, and the on-chip model against
 * measured logs. */
#include <cstdio>
#include <exception>
#include <fmt/format.h>
#include <string>

#include "command.h"

namespace
{

/* A message is one line, whatever it quotes. */
int refuse(const std::string &message, int code)
{
    std::string line = message;
    for (char &c : line) {
        c = (c == '\n' || c == '\r') ? ' ' : c;
    }
    fmt::print(stderr, "ninespring-sim: {}\n", line);
    return code;
}

/* What CLI11 only calls a missing subcommand. */
std::string no_command(CLI::App &app, const std::string &word)
{
    std::vector<std::string> names;
    for (const CLI::App *sub : app.get_subcommands(nullptr)) {
        names.push_back(sub->get_name());
    }
    return fmt::format("there is no command {}{}; see ninespring-sim --help",
                       ninespring::in_quotes(word), ninespring::did_you_mean(word, names));
}

} // namespace

int main(int argc, char **argv)
{
    using namespace ninespring;
    CLI::App app{"Simulates an array of NiTi springs and the board that drives it.\n"
                 "Exit code: 0 done, 1 the work failed, 2 the input or the arguments are wrong."};
    app.name("ninespring-sim");
    app.set_version_flag("--version", "ninespring-sim " NINESPRING_VERSION);
    app.require_subcommand(1);
    try {
        add_command_run(app);
        add_command_paper(app);
        add_command_replay(app);
        add_command_rerun(app);
        add_command_parameters(app);
        add_command_hil(app);
#ifdef NINESPRING_BOARD
        add_command_board(app);
#endif
        app.parse(argc, argv);
        if (std::fflush(stdout) != 0) {
            return refuse("standard output cannot be written", 1);
        }
        return 0;
    } catch (const CLI::Success &success) { /* --help, --version */
        return app.exit(success);
    } catch (const CLI::ParseError &error) {
        std::string command;
        for (const CLI::App *sub : app.get_subcommands()) {
            command = " " + sub->get_name();
        }
        if (command.empty() && argc > 1 && argv[1][0] != '-') {
            return refuse(no_command(app, argv[1]), 2);
        }
        return refuse(fmt::format("{}; see ninespring-sim{} --help", error.what(), command), 2);
    } catch (const input_error &error) {
        return refuse(error.what(), 2);
    } catch (const std::bad_alloc &) {
        return refuse("memory is out", 1);
    } catch (const std::exception &error) {
        return refuse(error.what(), 1);
    }
}
