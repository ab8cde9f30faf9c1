/* What it is for: lib/invariant as a claim that is to be proved: whatever breaks it is an alarm.
 * What it owns: nothing.
 * What it never does: run. */
#ifndef INVARIANT_H
#define INVARIANT_H

/*@ requires never: \false;
    assigns \nothing; */
void invariant_broken(void);

#define INVARIANT(condition) ((condition) ? (void)0 : invariant_broken())

#endif
