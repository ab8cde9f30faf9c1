/* What it is for: the same nine-spring network in float, for scale in the cycle counts.
 * What it owns: its nine temperatures, air and plate.
 * What it never does: model phase, radiation or a fan; it is what one would write first. */
#ifndef FLOAT_NETWORK_H
#define FLOAT_NETWORK_H

void float_network_reset(void);
void float_network_step(void);

#endif
