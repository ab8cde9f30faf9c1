/* What it is for: one subcommand of ninespring-sim a file; this is how they are added and what
 * they share.
 * What it owns: the checks of output files, the progress line, the JSON form.
 * What it never does: decide an exit code: it throws input_error (2) or work_error (1). */
#ifndef COMMAND_H
#define COMMAND_H

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "plant.h"
#include "text_file.h"

namespace ninespring
{

/* Each adds its subcommand; it runs in the subcommand's callback. */
void add_command_run(CLI::App &app);
void add_command_paper(CLI::App &app);
void add_command_replay(CLI::App &app);
void add_command_rerun(CLI::App &app);
void add_command_parameters(CLI::App &app);
void add_command_hil(CLI::App &app);
void add_command_board(CLI::App &app); /* only where libsimavr is */

struct plant_deleter {
    void operator()(plant_t *plant) const { plant_destroy(plant); }
};
using plant_pointer = std::unique_ptr<plant_t, plant_deleter>;

/* An option that names a file to write (an empty name is refused), or `-` for standard output. */
CLI::Option *add_output_option(CLI::App &command, const std::string &names, std::string &path,
                               const std::string &text);
/* What must be a finite number from least to most; anything else is refused in one line. */
CLI::Validator number_from_to(double least, double most);
/* An option of seconds, 0 to a year. */
void add_seconds_option(CLI::App &command, const std::string &name, double &seconds,
                        const std::string &text);

/* Before the work: an output in a missing folder, over an input, over a file that this tool did not
 * write, or named for two, is refused (input_error). Empty paths are skipped. True if standard
 * output is free for a table: no output is `-`. */
bool check_outputs(const std::vector<std::string> &outputs, const std::vector<std::string> &inputs);

/* The JSON as it is written everywhere: two blanks of indent, NaN as null, a line end. */
std::string json_text(const nlohmann::ordered_json &value);

/* A line on stderr that says how far the work is; silent where stderr is not a terminal. */
class progress_line
{
public:
    explicit progress_line(std::string what);
    ~progress_line();
    progress_line(const progress_line &) = delete;
    progress_line &operator=(const progress_line &) = delete;
    void show(double fraction);

private:
    std::string what_;
    bool terminal_;
    int shown_percent_ = -1;
};

} // namespace ninespring
#endif
