// What it is for: the swarm: its runs, its table, a run replayed, two states of the code compared.
// What it owns:   the figures that are made of all runs, and their targets.
// What it never does: decide what is drawn (swarm.c) or what of a run counts (score.c, losses.c).
#ifndef WORLDS_SWARM_BENCH_HPP
#define WORLDS_SWARM_BENCH_HPP

#include <cstdint>
#include <string>

extern "C" {
#include "run.h"
}

namespace swarm_bench
{

struct options_t {
    int runs, first;
    std::uint64_t seed;
    double seconds;
    unsigned jobs;
    run_driver_t driver;
    std::string json, markdown, keep, against;
};

// All runs, and their table. Throws std::runtime_error where a file or a world refuses.
void measure(const options_t &options);
// One run, in words, with its trace where a file is named.
void replay(const options_t &options, int run, const std::string &trace);
// The list of what is drawn.
std::string list();

} // namespace swarm_bench

#endif
