#include "command.h"

#include <unistd.h>

namespace ninespring
{

/* Logs and models are read by the Python tool alone, so a replay is its work: this hands the words
 * over as they are. */
void add_command_replay(CLI::App &app)
{
    CLI::App *command = app.add_subcommand(
        "replay",
        "The on-chip fixed-point model against a measured log: the same as `ninespring replay`");
    command->prefix_command();
    command->set_help_flag();
    command->callback([command] {
        std::vector<std::string> words = command->remaining();
        words.insert(words.begin(), {"ninespring", "replay"});
        std::vector<char *> arguments;
        for (std::string &word : words) {
            arguments.push_back(word.data());
        }
        arguments.push_back(nullptr);
        execv(NINESPRING_TOOL, arguments.data());
        execvp("ninespring", arguments.data());
        throw work_error(
            "replay is the work of `ninespring`, which is not there: run script/setup");
    });
}

} // namespace ninespring
