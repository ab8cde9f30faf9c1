/* What it is for: a board around the second truth, on which every event of a scenario can be done.
 * What it owns: truth, bus, board.
 * What it never does: type, judge; what an event means for a host is the host's. */
#ifndef SWARM_FAULTY_BOARD_HPP
#define SWARM_FAULTY_BOARD_HPP

#include <memory>
#include <string>

#include "scenario.hpp"
#include "truth.h"
#include "upset_bus.hpp"

namespace swarm
{

class faulty_board
{
public:
    /* Throws std::runtime_error if and only if the ELF is refused. */
    faulty_board(const scenario &one, const std::string &elf, void *context, board_byte_t on_uart);
    faulty_board(const faulty_board &) = delete;
    faulty_board &operator=(const faulty_board &) = delete;

    board_t *raw() const { return board_.get(); }
    const truth_t *truth() const { return truth_.get(); }
    /* What is typed (say, bytes) is not done here; nor what the truth knows of since it was made.
     */
    void inflict(const event &e);

private:
    void inflict_on_circuit(const event &e);
    void inflict_on_sensor(const event &e);
    void inflict_on_program(const event &e);
    void fault(board_fault_t which, const event &e);

    struct truth_deleter {
        void operator()(truth_t *t) const { truth_destroy(t); }
    };
    struct board_deleter {
        void operator()(board_t *b) const { board_destroy(b); }
    };
    std::unique_ptr<truth_t, truth_deleter> truth_;
    upset_bus bus_;
    std::unique_ptr<board_t, board_deleter> board_;
};

} // namespace swarm
#endif
