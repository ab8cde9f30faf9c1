/* What it is for: why a spring is believed to be where it is: its last sights, each a record of one
 * shape.
 * What it owns: the records of all springs; of the spring that has most of them the oldest gives
 * way.
 * What it never does: decide. Records are for whoever asks 'why', nothing is estimated by them. */
#ifndef SPRING_SIGHTS_H
#define SPRING_SIGHTS_H

#include <stdbool.h>
#include <stdint.h>

#include "thermal_model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SPRING_SIGHTS_KEPT        (2u * THERMAL_MODEL_MAX_SPRINGS + 4u)
#define SPRING_SIGHTS_TURNS_PER_S 4u
#define SPRING_SIGHTS_TURNS       57600u /* 4 h: what is older is forgotten */

typedef enum {
    SPRING_SIGHT_ONSET = 0,  /* it began to transform */
    SPRING_SIGHT_FINISH,     /* it had transformed */
    SPRING_SIGHT_UNSEEN,     /* its heating ended by the model or a limit: no finish was seen */
    SPRING_SIGHT_LOST,       /* held, it began to lose phase */
    SPRING_SIGHT_KEPT,       /* held, it lost none: it is no colder than that lets it be */
    SPRING_SIGHT_TRANSFORMS, /* heated, it still transforms: it is no hotter than that lets it be */
    SPRING_SIGHT_JUMPED,     /* a contact or the sensor jumped: no phase changes so fast */
    SPRING_SIGHT_LOOKED, /* nothing was known; by what was learnt its resistance tells a phase */
    SPRING_SIGHT_TOLD,   /* a hint, or what a reset has kept */
    SPRING_SIGHT_COOLED, /* nothing was known; it must have cooled by now */
    SPRING_SIGHT_ANEW,   /* what was believed had changed by itself: nothing is known */
    SPRING_SIGHT_KINDS
} spring_sight_kind_t;

/* What was done about it; bits. */
enum {
    SPRING_DID_HEAT = 1,  /* a heating began */
    SPRING_DID_HOLD = 2,  /* a hold began */
    SPRING_DID_BLIND = 4, /* from here on its resistance tells nothing */
    SPRING_DID_OPEN =
        8 /* the surroundings have stepped: its loss and another spring's were opened */
};

#define SPRING_SIGHT_SD_MOST UINT8_MAX /* a standard deviation of that or more */

/* Distances are to martensite start, in 0.1 K; resistances relative, in 0.01 %. */
typedef struct {
    uint32_t number; /* of all sights, comes round */
    uint16_t turn;   /* when, in quarters of a second: spring_sights_age_turns */
    uint8_t spring;
    uint8_t kind;        /* spring_sight_kind_t */
    uint8_t did;         /* SPRING_DID_ bits */
    int16_t read;        /* what was read, less what was predicted */
    uint8_t read_sd;     /* of that difference; 0: none was compared */
    uint8_t believed_sd; /* 0: it was not known where */
    int16_t believed;    /* where it was believed before */
    int16_t seen;        /* where what was read puts it */
    uint8_t seen_sd;     /* 0: nowhere */
    uint8_t now_sd;
    int16_t now;   /* where it is believed by it */
    int16_t shift; /* by how much it has moved its transformation, 0.1 K */
    int16_t loss;  /* and its loss, 0.01 % of the declared one */
} spring_sight_t;

typedef struct {
    uint32_t numbers;                         /* the next record's */
    uint16_t turn;                            /* now */
    uint8_t count;                            /* of records */
    spring_sight_t sight[SPRING_SIGHTS_KEPT]; /* in no order: their numbers tell it */
} spring_sights_t;

/* A quarter of a second later; forgets what is too old. O(records). */
void spring_sights_turn(spring_sights_t *sights);
/* Room for one more, numbered and timed; the rest is 0. Never NULL. O(records). */
spring_sight_t *spring_sights_add(spring_sights_t *sights, uint8_t spring);
/* One is forgotten, another may take its place. O(1). */
void spring_sights_drop(spring_sights_t *sights, const spring_sight_t *sight);
/* That one goes on: it is the last one again, with the next number. O(1). */
void spring_sights_renew(spring_sights_t *sights, spring_sight_t *sight);
/* The last one of a spring; NULL where there is none. O(records). */
spring_sight_t *spring_sights_newest(spring_sights_t *sights, uint8_t spring);
/* The oldest of a spring (SPRING_SIGHTS_ANY: of any) whose number is `from` or later; from
 * spring_sights_first on: the oldest of all. NULL where there is none. O(records). */
#define SPRING_SIGHTS_ANY UINT8_MAX
const spring_sight_t *spring_sights_from(const spring_sights_t *sights, uint8_t spring,
                                         uint32_t from);
uint32_t spring_sights_first(const spring_sights_t *sights);
/* How long ago, quarters of a second. */
uint16_t spring_sights_age_turns(const spring_sights_t *sights, const spring_sight_t *sight);

#ifdef __cplusplus
}
#endif
#endif
