#include "spring_away.h"

#include "spring_sights.h"

/* What is promised is 90 and 20 s. */
#define FIRST_TURNS (85u * SPRING_SIGHTS_TURNS_PER_S)
#define LEFT_TURNS  (15u * SPRING_SIGHTS_TURNS_PER_S)

#define TRIES     4u
#define TRY_TURNS (600u * SPRING_SIGHTS_TURNS_PER_S) /* that one counts, while it is away */
#define FORGIVES  (TRY_TURNS / LEFT_TURNS)           /* a turn in which it is there */

void spring_away_turn(spring_away_t *away, bool there)
{
    const uint16_t forgiven = there ? FORGIVES : 1u;
    away->tried = away->tried > forgiven ? (uint16_t)(away->tried - forgiven) : 0u;
    if (there) {
        away->turns = FIRST_TURNS - LEFT_TURNS;
    } else if (away->turns < FIRST_TURNS) {
        away->turns++;
    }
}

bool spring_away_says(const spring_away_t *away)
{
    return away->turns >= FIRST_TURNS;
}

bool spring_away_try(spring_away_t *away)
{
    if (away->tried > (TRIES - 1u) * TRY_TURNS) {
        return false;
    }
    away->tried = (uint16_t)(away->tried + TRY_TURNS);
    return true;
}
