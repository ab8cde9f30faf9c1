/* What it is for: the tests of bits of RAM that turn over in what is believed.
 * What it owns: a belief as it was, to turn each bit of it over.
 * What it never does: say how often that happens (bench_flips does). */
#ifndef SEALS_H
#define SEALS_H

void run_seals(void);

#endif
