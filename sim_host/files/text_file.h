/* What it is for: a whole text file in memory, and errors that say where in it and what to do.
 * What it owns: the form `file:line:column: what is wrong; what to do`, and writing by temporary
 * file and rename.
 * What it never does: understand what the text means. */
#ifndef TEXT_FILE_H
#define TEXT_FILE_H

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace ninespring
{

/* The input or the arguments are wrong: exit code 2. what() is one line. */
class input_error : public std::runtime_error
{
public:
    explicit input_error(const std::string &message) : std::runtime_error(message) {}
    /* Line and column count from 1; 0 leaves them out. */
    input_error(const std::string &file, std::size_t line, std::size_t column,
                const std::string &message);
};

/* The input is right and the work failed all the same: exit code 1. */
class work_error : public std::runtime_error
{
public:
    explicit work_error(const std::string &message) : std::runtime_error(message) {}
};

/* Where something was said. */
struct source_place {
    std::string file;
    std::size_t line = 0;
    std::size_t column = 0;
    [[nodiscard]] input_error error(const std::string &message) const
    {
        return input_error(file, line, column, message);
    }
};

constexpr std::size_t TEXT_FILE_MAX_LINE = 65536;

struct text_file {
    std::string name; /* as the user wrote it */
    std::string text; /* UTF-8, without byte order mark */
};

/* Fails (input_error) if and only if the file cannot be read. */
std::string read_bytes(const std::string &path);
/* Fails (input_error) if and only if the file cannot be read, is empty, is UTF-16, holds a zero
 * byte, or has a line longer than max_line bytes. */
text_file read_text_file(const std::string &path, std::size_t max_line = TEXT_FILE_MAX_LINE);
/* The same checks on text that is in memory already. */
text_file make_text_file(const std::string &name, std::string text,
                         std::size_t max_line = TEXT_FILE_MAX_LINE);

/* The next line of `text` from `position`, without its CR and LF; position moves behind it. */
std::string_view next_line(std::string_view text, std::size_t &position);

/* Text of unknown origin for a message: in quotes, one line, at most 40 characters, printable. */
std::string in_quotes(std::string_view text);

/* `text` as a number: plain decimal with a point, any locale. The message says what is wrong
 * otherwise (decimal comma, percent sign, not a number, infinite); the caller adds the place. Empty
 * message: it worked. */
std::string parse_number(std::string_view text, double &value);

/* The name in `names` nearest to `wrong`, as `; did you mean X?`, or an empty text. */
std::string did_you_mean(std::string_view wrong, const std::vector<std::string> &names);

/* Before the work: an output whose folder is not there, or that is one, is refused (input_error).
 */
void check_place(const std::string &path);

/* An output may replace what this tool wrote before, by its first line, or an empty file: anything
 * else that is there is refused (input_error). */
void check_replaceable(const std::string &path);

/* Writes a file whole or not at all: into a temporary file beside `path`, which is then renamed.
 * `-` is standard output. Fails (input_error) if `path` is a folder, (work_error) if the folder is
 * not there or the disk refuses; nothing is left behind then. */
void write_file_whole(const std::string &path, const std::string &content);

} // namespace ninespring
#endif
