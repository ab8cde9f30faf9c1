/* What it is for: what a hand has done around a simulated board: resistors in the springs' places,
 * and the mistakes of wiring that a first power-up is there to find.
 * What it owns: their words, and the file that may hold them and change while the board runs.
 * What it never does: know what the firmware makes of them. */
#ifndef BENCH_H
#define BENCH_H

#include <string>
#include <utility>
#include <vector>

#include "board.h"
#include "command.h"

namespace ninespring
{

struct bench_arguments {
    bool without_springs = false;
    std::vector<std::string> wiring; /* words, or @FILE of words */
};
void add_bench_options(CLI::App &command, bench_arguments &arguments);

class bench
{
public:
    /* Wires the board. Fails (input_error) where a word is none or the file cannot be read. */
    bench(const bench_arguments &arguments, board_t *board);
    /* Wires it anew if the file has changed; what the file says wrongly is printed once, and the
     * board stays as it is. */
    void look_again();

private:
    [[nodiscard]] std::vector<std::string> words() const;
    void wire(const std::vector<std::string> &words);

    bench_arguments arguments_;
    board_t *board_;
    std::vector<std::string> words_;
    std::vector<std::pair<unsigned, unsigned>> sensors_, gates_; /* that are swapped */
};

} // namespace ninespring
#endif
