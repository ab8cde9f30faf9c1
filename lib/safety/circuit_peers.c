#include "circuit_peers.h"

#include <math.h>
#include <stddef.h>

#include "fixed_point.h"

#define SHARE_Q7   128.0f
#define SHARE_MOST 255.0f /* of 8 bits: what is shown, too */
#define OWN_Q12    4096.0f
#define OWN_MOST   8191.0f
#define VOLTS_MV   16.0f
#define VOLTS_MOST 65535.0f
/* Offsets of both readings; a diode's drop moves with current and heat, and at the same volts those
 * of the others do so, too: there one is off by what it is of its own. */
#define OFFSETS_MV      25.0f
#define DROP_PART       0.15f
#define DROP_PART_ALIKE 0.05f
#define NOISE_MV        8.0f /* of a window's mean: two steps of the register */

#define KNOWN_PART 0.05f /* as others switch, so much does one end of a cable move */
#define OTHER_PART 0.18f /* 0.04 ohm of wiring in 0.36, gains of 3 % */
/* The supply, where none shows it as well. A sensor that shows more makes its spring colder. */
#define ALONE_LESS_PART 0.10f
#define ALONE_MORE_PART 0.20f
#define LEARN_MOST      255u /* windows: 2.5 minutes. What is soldered stays what it is */

/* Shares of the others that are driven, sorted; how many. */
static uint8_t sort_others(const circuit_peers_t *peers, uint8_t springs, uint8_t k,
                           uint8_t sorted[])
{
    uint8_t count = 0;
    for (uint8_t j = 0; j < springs; j++) {
        const uint8_t share = peers->spring[j].share_q7;
        if (j == k || share == 0) {
            continue;
        }
        uint8_t at = count++;
        for (; at > 0 && peers->spring[sorted[at - 1u]].share_q7 > share; at--) {
            sorted[at] = sorted[at - 1u];
        }
        sorted[at] = j;
    }
    return count;
}

/* By how much a share is off beyond so large a part. */
static float beyond(float share, float like, float part)
{
    return fabsf(share - like) - part * like;
}

/* Two that show the same. */
static bool agree(const circuit_peer_t *one, const circuit_peer_t *other)
{
    return beyond((float)one->share_q7, (float)other->share_q7, KNOWN_PART) <= 0.0f;
}

/* The middle one of the others that are driven; of too few to outvote one that lies, the one at
 * most volts. NULL: none is. */
static const circuit_peer_t *witness(const circuit_peers_t *peers, uint8_t springs, uint8_t k,
                                     bool *outvotes)
{
    uint8_t sorted[CIRCUIT_PEERS_MAX];
    const uint8_t count = sort_others(peers, springs, k, sorted);
    *outvotes = count >= CIRCUIT_PEERS_LEAST ||
                (count == 2 && agree(&peers->spring[sorted[0]], &peers->spring[sorted[1]]));
    if (*outvotes) {
        return &peers->spring[sorted[count / 2u]];
    }
    const circuit_peer_t *most = NULL;
    for (uint8_t n = 0; n < count; n++) {
        const circuit_peer_t *const other = &peers->spring[sorted[n]];
        most = most == NULL || other->shown_16mv > most->shown_16mv ? other : most;
    }
    return most;
}

static uint8_t to_q7(float share)
{
    return (uint8_t)fminf(fmaxf(share * SHARE_Q7 + 0.5f, 1.0f), SHARE_MOST);
}

/* A mean by volts: so it is the sum of what was found over that of what the others make of it. */
static void learn(circuit_peer_t *own, float beside, float told)
{
    const float known = (float)own->volts;
    const float all = known + told;
    const float next = ((float)own->own_q12 * known + beside * OWN_Q12 * told) / all + 0.5f;
    own->own_q12 = (uint16_t)fminf(next, OWN_MOST) & 0x1FFFu;
    own->volts = (uint16_t)fminf(all + 0.5f, VOLTS_MOST);
    own->learnt++;
}

/* Of so many times 16 mV, or of the least that is compared. */
static float volts_mv(float shown)
{
    return fmaxf(VOLTS_MV * shown, CIRCUIT_WINDOW_LEAST_MV);
}

/* Its share beside that of the others, which was told at so few volts. */
static bool is_odd(const circuit_peer_t *own, float own_part, float share, float others,
                   float told_mv, float offsets_mv)
{
    if (beyond(share, others, OTHER_PART) * told_mv > offsets_mv) {
        return true;
    }
    if (own->learnt == 0) {
        return false;
    }
    /* An offset keeps its sign: of two shares, the one at fewer volts is off by more. */
    const float off = beyond(share, others * own_part, KNOWN_PART);
    return off * told_mv > offsets_mv &&
           off * (VOLTS_MV * (float)own->volts) > offsets_mv * (float)own->learnt;
}

/* Its row was full, and no window has acquitted it since. */
static bool was_found(const circuit_peer_t *own)
{
    return own->odd + (own->agreed == 0 ? 1u : 0u) >= CIRCUIT_PEERS_WINDOWS;
}

/* Within what a cable makes of it, whatever offsets make: else a window of few volts, which tells
 * little, would acquit one who was found. */
static bool is_like(const circuit_peer_t *own, float own_part, float share, float others)
{
    return own->learnt == 0 || beyond(share, others * own_part, KNOWN_PART) <= 0.0f;
}

/* Of two voltages, what one is more, of the larger one. */
static float apart(float a, float b)
{
    return 1.0f - fminf(a, b) / fmaxf(a, b);
}

/* What a drop makes of a lower or higher share, as far as it is not known: it takes as much of both
 * voltages, and one more than is believed makes the share at fewer volts the lower one. */
static float drop_mv(const circuit_source_t *source, bool is_lower, float expected_mv,
                     float other_mv)
{
    const bool is_less = expected_mv < other_mv;
    return (is_lower == is_less ? source->more_mv : source->less_mv) * apart(expected_mv, other_mv);
}

/* Volts within an eighth: what is wrong with a drop makes an eighth of it. */
static bool are_alike(uint8_t a, uint8_t b)
{
    return 8u * a >= 7u * b && 8u * b >= 7u * a;
}

/* In its last window, of the supply. */
static uint8_t shown_q7(const circuit_peer_t *own)
{
    const uint32_t share_q19 = fixed_point_mac_u16(0, own->share_q7, own->own_q12);
    const uint32_t share_q7 = own->own_q12 == 0 ? own->share_q7 : share_q19 >> 12;
    return share_q7 < 255u ? (uint8_t)(share_q7 | (share_q7 == 0)) : 255u;
}

/* What it showed, to be compared with: of the window before, at about the same volts, as in this
 * one another circuit may begin. */
static void keep(circuit_peer_t *own, const circuit_peer_t *before, float share)
{
    if (before->was_q7 == 0) {
        own->was_q7 = to_q7(share);
        own->was_16mv = own->shown_16mv;
    } else if (before->share_q7 != 0 && before->odd == 0 &&
               are_alike(before->shown_16mv, own->shown_16mv)) {
        own->was_q7 = shown_q7(before);
        own->was_16mv = before->shown_16mv;
    }
}

/* What a window is taken for. */
typedef struct {
    bool good; /* nothing needs what is not known of the drop to explain it */
    bool odd;
    bool only_offsets; /* explain it, where it is not odd */
    bool acquits;      /* the other one does, whose share is as it ever was beside this one's */
} verdict_t;

/* Beside another one, which alone outvotes nobody. */
static verdict_t beside(circuit_peer_t *own, float own_part, const circuit_peer_t *other,
                        bool outvotes, const circuit_window_t *window,
                        const circuit_source_t *source, float offsets_mv)
{
    const float expected_mv = window->expected_mv;
    const float share = window->share;
    const float others = (float)other->share_q7 / SHARE_Q7;
    const float other_mv = volts_mv((float)other->shown_16mv);
    const float told_mv = fminf(expected_mv, other_mv);
    verdict_t is = {.good = !is_odd(own, own_part, share, others, told_mv, offsets_mv),
                    .acquits = own->learnt != 0 && offsets_mv <= ALONE_LESS_PART * told_mv};
    is.odd = !is.good &&
             is_odd(own, own_part, share, others, told_mv,
                    offsets_mv + drop_mv(source, share < others * own_part, expected_mv, other_mv));
    /* Where offsets make more than what a share may be at the most, it teaches nothing; nor where a
     * drop may that is not known: of the little that is found behind one, what an eighth more of
     * duty brings is most. */
    const float most_mv = fminf(others, 1.0f) * (OTHER_PART * told_mv - offsets_mv);
    const float higher_mv = fmaxf(expected_mv, other_mv);
    const bool alike = are_alike(own->shown_16mv, other->shown_16mv);
    const bool teaches = alike ? source->unsure_mv * (higher_mv - told_mv) <= most_mv * higher_mv
                               : source->unsure_mv <= most_mv;
    is.good = is.good && (!was_found(own) || is_like(own, own_part, share, others));
    if (is.odd || (!is.good && was_found(own)) || own->learnt >= LEARN_MOST || !teaches) {
        return is;
    }
    if (outvotes || own->was_q7 != 0) { /* by the second, all that begin at once are there */
        const bool begin = !outvotes && own->learnt == 0 && other->learnt == 0;
        const float as_one = begin ? 0.5f * (others + share) : others; /* each is off by half */
        learn(own, share / as_one, told_mv / VOLTS_MV);
        if (own->learnt == 1) {
            own->share_q7 = to_q7(as_one);
        }
    }
    return is;
}

/* Beside what it showed itself. Offsets make of that what they make of other volts. */
static verdict_t beside_itself(const circuit_peer_t *own, bool sure, const circuit_window_t *window,
                               const circuit_source_t *source, float offsets_mv)
{
    const float expected_mv = window->expected_mv;
    const float was = (float)own->was_q7 / SHARE_Q7;
    const float was_mv = volts_mv((float)own->was_16mv);
    const bool is_less = window->share < was;
    const float alone_part = is_less ? ALONE_LESS_PART : ALONE_MORE_PART;
    const float off = beyond(window->share, was, sure ? KNOWN_PART : alone_part);
    const float moved_mv = NOISE_MV + offsets_mv * apart(expected_mv, was_mv);
    const float off_mv = off * expected_mv - moved_mv;
    return (verdict_t){.good = off_mv <= (was_found(own) ? -moved_mv : 0.0f),
                       .odd = off_mv > drop_mv(source, is_less, expected_mv, was_mv),
                       .only_offsets = off > 0.0f};
}

bool circuit_peers_judge(circuit_peers_t *peers, uint8_t springs, uint8_t k,
                         const circuit_window_t *window, const circuit_source_t *source)
{
    circuit_peer_t *own = &peers->spring[k];
    const circuit_peer_t before = *own;
    if (!circuit_window_compares(window)) {
        own->share_q7 = 0;
        return own->odd >= CIRCUIT_PEERS_WINDOWS;
    }
    const float expected_mv = window->expected_mv;
    const float own_part = own->own_q12 != 0 ? (float)own->own_q12 / OWN_Q12 : 1.0f;
    own->share_q7 = to_q7(window->share / own_part);
    own->shown_16mv = (uint8_t)fminf(expected_mv / VOLTS_MV, SHARE_MOST);
    bool outvotes = false;
    const circuit_peer_t *const other = witness(peers, springs, k, &outvotes);
    const bool alike = other != NULL && are_alike(own->shown_16mv, other->shown_16mv);
    const float offsets_mv = OFFSETS_MV + (alike ? DROP_PART_ALIKE : DROP_PART) * source->drop_mv;
    verdict_t is = {.good = true};
    if (other != NULL) {
        is = beside(own, own_part, other, outvotes, window, source, offsets_mv);
    }
    if (!outvotes && own->was_q7 != 0 && (is.odd || !is.acquits)) {
        if (expected_mv < source->unsure_mv) {
            return own->odd >= CIRCUIT_PEERS_WINDOWS; /* the drop may take all of it */
        }
        const bool sure = is.odd || own->odd >= CIRCUIT_PEERS_WINDOWS - 1u;
        is = beside_itself(own, sure, window, source, offsets_mv);
    } else if (!outvotes) {
        is.odd = false; /* nobody knows which of the two */
    }
    if (is.odd) {
        own->odd = own->odd < CIRCUIT_PEERS_WINDOWS ? (own->odd + 1u) & 3u : own->odd;
    } else if (is.good || !was_found(own)) {
        /* what an open spring shows is no share of the supply, nor what may be offsets' */
        if (window->balances && !is.only_offsets && offsets_mv <= ALONE_MORE_PART * expected_mv) {
            keep(own, &before, window->share);
        }
        own->odd = 0;
        own->agreed = 1;
    }
    return own->odd >= CIRCUIT_PEERS_WINDOWS;
}

void circuit_peers_suspect(circuit_peers_t *peers, uint8_t spring, uint16_t before_q12)
{
    circuit_peer_t *own = &peers->spring[spring];
    if (own->odd < CIRCUIT_PEERS_WINDOWS) {
        own->odd = CIRCUIT_PEERS_WINDOWS;
        own->was_q7 = to_q7((float)before_q12 / OWN_Q12);
    }
}

/* The same voltage is another share of what its duty should bring by another belief. */
static uint8_t believed_anew(const circuit_peer_t *own, const circuit_source_t *before,
                             const circuit_source_t *now)
{
    const float was_mv = volts_mv((float)own->was_16mv);
    const float duty = (was_mv + before->drop_mv) / before->step_mv;
    const float mv = fmaxf(duty * now->step_mv - now->drop_mv, CIRCUIT_WINDOW_LEAST_MV);
    return to_q7((float)own->was_q7 / SHARE_Q7 * was_mv / mv);
}

void circuit_peers_renew(circuit_peers_t *peers, uint8_t springs, const circuit_source_t *before,
                         const circuit_source_t *now)
{
    for (uint8_t k = 0; k < springs; k++) {
        circuit_peer_t *own = &peers->spring[k];
        const bool kept = was_found(own) && own->was_q7 != 0;
        own->was_q7 = kept ? believed_anew(own, before, now) : 0;
        own->share_q7 = 0;
    }
}

void circuit_peers_clear(circuit_peers_t *peers, uint8_t spring, bool doubted)
{
    circuit_peer_t *own = &peers->spring[spring];
    if (doubted && own->agreed && own->odd < CIRCUIT_PEERS_WINDOWS) {
        *own = (circuit_peer_t){0};
    }
    own->share_q7 = 0;
    own->odd = own->odd < CIRCUIT_PEERS_WINDOWS ? 0 : CIRCUIT_PEERS_WINDOWS - 1u;
    own->agreed = 0;
}
