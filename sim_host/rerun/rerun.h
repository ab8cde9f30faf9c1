/* What it is for: a board's day again, on this machine: what it was given, tick by tick, through
 * the same C, to the same belief (docs/files.md, "Tape"). What it owns: a controller, its console,
 * and how far both agree with the board. What it never does: read files, or guess what a tape has
 * not: it says that it is missing. */
#ifndef RERUN_H
#define RERUN_H

#include <cstdint>
#include <memory>
#include <string>

#include "console.h"

namespace ninespring
{

class rerun
{
public:
    rerun();
    ~rerun();
    rerun(const rerun &) = delete;
    rerun &operator=(const rerun &) = delete;

    /* One line of a tape. Fails (std::invalid_argument) if it is one that a tape cannot have there:
     * a setting that does not exist, readings before a start. Others than a tape's are passed over.
     */
    void line(const std::string &text);

    /* Of the console, as the board would have answered now. Fails (std::invalid_argument) where the
     * line might change something. */
    std::string ask(const std::string &text);

    [[nodiscard]] const controller_t *controller() const;
    [[nodiscard]] double time_s() const; /* since the start */
    [[nodiscard]] bool started() const;
    [[nodiscard]] bool ended() const; /* the board was told something else than inputs */

    /* How far it went. */
    struct tally {
        std::uint64_t ticks = 0;
        std::uint64_t typed = 0;
        std::uint64_t missing = 0; /* ticks that are not on the tape, or were broken on the way */
        double missing_s = 0.0;    /* the first of these */
        std::uint64_t marks = 0;   /* beliefs that were compared with the board's */
        std::uint64_t other = 0;   /* and were not the same, to the last bit */
        double other_s = 0.0;      /* the first of these */
        unsigned other_spring = 0; /* from 1 */
    };
    [[nodiscard]] const tally &so_far() const;

private:
    struct board;
    std::unique_ptr<board> board_;
};

} // namespace ninespring
#endif
