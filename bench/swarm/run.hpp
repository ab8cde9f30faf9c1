/* What it is for: one life of the checked firmware under a scenario, and what must always hold.
 * What it owns: a board, a truth, a host that types, the judgement.
 * What it never does: draw. The same scenario gives the same verdict, to the byte. */
#ifndef SWARM_RUN_HPP
#define SWARM_RUN_HPP

#include <string>

#include "scenario.hpp"

namespace swarm
{

struct verdict {
    std::string broken; /* a word for what did not hold: "hot", "fed", ...; "" if all did */
    std::string detail;
    double at_s = 0.0;
    double hottest_c = 0.0;
    double simulated_s = 0.0;
    unsigned answers = 0, resets = 0;
};

/* trace: what is typed and answered goes to stderr. Throws (input_error) if and only if the ELF is
 * refused. */
verdict live(const scenario &one, const std::string &elf, bool trace = false);

} // namespace swarm
#endif
