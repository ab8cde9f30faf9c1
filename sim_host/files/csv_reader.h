/* What it is for: rows of a comma-separated file, each field with its place.
 * What it owns: comments, quotes, blank lines, and the refusal of uneven
 * rows.
 * What it never does: know what a column means. */
#ifndef CSV_READER_H
#define CSV_READER_H

#include <string>
#include <string_view>
#include <vector>

#include "text_file.h"

namespace ninespring
{

struct csv_field {
    std::string_view text; /* without quotes and surrounding blanks */
    std::size_t column;    /* 1-based position in the line */
};

class csv_reader
{
public:
    /* Reads comments and the header. `file` must outlive the reader. Fails (input_error) if there
     * is no header, it is separated by something else than commas, or names a column twice. */
    explicit csv_reader(const text_file &file);

    [[nodiscard]] const std::vector<csv_field> &header() const { return header_; }
    [[nodiscard]] std::size_t header_line() const { return header_line_; }
    /* The next row; false at the end. Fails (input_error) if it has another number of fields than
     * the header. */
    bool next(std::vector<csv_field> &fields);
    [[nodiscard]] std::size_t line() const { return line_; }
    [[nodiscard]] input_error error(std::size_t column, const std::string &message) const
    {
        return input_error(file_.name, line_, column, message);
    }

private:
    bool next_data_line(std::string_view &text);
    void split(std::string_view text, std::vector<csv_field> &fields) const;

    const text_file &file_;
    std::size_t position_ = 0;
    std::size_t line_ = 0;
    std::size_t header_line_ = 0;
    std::vector<csv_field> header_;
};

} // namespace ninespring
#endif
