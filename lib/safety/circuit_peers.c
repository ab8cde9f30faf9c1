#include "circuit_peers.h"

#include <math.h>
#include <stddef.h>

#include "fixed_point.h"

#define SHARE_Q7   128.0f
#define SHARE_MOST 255.0f /* of 8 bits: what is shown, too */
#define OWN_Q12    4096.0f
#define OWN_MOST   8191.0f
#define VOLTS_MV   16.0f
#define VOLTS_MOST 32767.0f
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
#define LEARN_MOST      127u /* windows: 76 s. What is soldered stays what it is */
/* Of what it shows beside the others now, so that a part of a window is no more. */
#define KEEP_PART 0.25f

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

/* Of so many times 16 mV, or of the least that is compared. */
static float volts_mv(uint8_t shown_16mv)
{
    const uint16_t mv = (uint16_t)(16u * shown_16mv);
    return mv > (uint16_t)CIRCUIT_WINDOW_LEAST_MV ? (float)mv : CIRCUIT_WINDOW_LEAST_MV;
}

/* Volts within an eighth: what is wrong with a drop makes an eighth of it. */
static bool are_alike(uint8_t a, uint8_t b)
{
    return 8u * a >= 7u * b && 8u * b >= 7u * a;
}

/* What is known of the supply by others. */
typedef struct {
    const circuit_peer_t *peer; /* whose share it is; NULL: no other tells */
    bool outvotes;              /* one that lies */
    bool alike;                 /* at about the same volts */
    float share, mv;
} others_t;

/* The middle one of the others that are driven; of too few to outvote one that lies, the one at
 * most volts. */
static others_t ask_others(const circuit_peers_t *peers, uint8_t springs, uint8_t k)
{
    uint8_t sorted[CIRCUIT_PEERS_MAX];
    const uint8_t count = sort_others(peers, springs, k, sorted);
    others_t others = {
        .outvotes = count >= CIRCUIT_PEERS_LEAST ||
                    (count == 2 && agree(&peers->spring[sorted[0]], &peers->spring[sorted[1]]))};
    if (count == 0) {
        return others;
    }
    if (others.outvotes) {
        others.peer = &peers->spring[sorted[count / 2u]];
    } else {
        const circuit_peer_t *const first = &peers->spring[sorted[0]];
        const circuit_peer_t *const last = &peers->spring[sorted[count - 1u]];
        others.peer = last->shown_16mv > first->shown_16mv ? last : first;
    }
    others.alike = are_alike(peers->spring[k].shown_16mv, others.peer->shown_16mv);
    others.share = (float)others.peer->share_q7 / SHARE_Q7;
    others.mv = volts_mv(others.peer->shown_16mv);
    return others;
}

static uint8_t to_byte(float value)
{
    return (uint8_t)fminf(value, SHARE_MOST);
}

static uint8_t to_q7(float share)
{
    const uint8_t share_q7 = to_byte(share * SHARE_Q7 + 0.5f);
    return share_q7 != 0 ? share_q7 : 1u;
}

/* A mean by volts: so it is the sum of what was found over that of what the others make of it. */
static void learn(circuit_peer_t *own, float beside, float told)
{
    const float known = (float)own->volts;
    const float all = known + told;
    const float next = ((float)own->own_q12 * known + beside * OWN_Q12 * told) / all + 0.5f;
    own->own_q12 = (uint16_t)fminf(next, OWN_MOST) & 0x1FFFu;
    own->volts = (uint16_t)fminf(all + 0.5f, VOLTS_MOST) & 0x7FFFu;
    own->learnt++;
}

/* What its share beside that of the others is off, of so many volts that told it. An offset keeps
 * its sign: of what it shows now and what it was learnt by, the one at fewer volts tells. */
static float odd_mv(const circuit_peer_t *own, float changed, float share, float others,
                    float told_mv)
{
    const float off_mv = beyond(share, others, OTHER_PART) * told_mv;
    if (own->learnt == 0) {
        return off_mv;
    }
    const float learnt_mv = VOLTS_MV * (float)own->volts / (float)own->learnt;
    const float known_mv = changed * (learnt_mv < told_mv ? learnt_mv : told_mv);
    return known_mv > off_mv ? known_mv : off_mv;
}

/* Its row was full, and no window has acquitted it since. */
static bool was_found(const circuit_peer_t *own)
{
    return own->odd + (own->agreed == 0 ? 1u : 0u) >= CIRCUIT_PEERS_WINDOWS;
}

/* Of two voltages, what one is more, of the larger one. */
static float apart(float a, float b)
{
    return a < b ? 1.0f - a / b : 1.0f - b / a;
}

/* What is not known of a drop makes so much of a lower or higher share: it takes as much of both
 * voltages, and one more than is believed makes the share at fewer volts the lower one. */
static float unsure_mv(const circuit_source_t *source, bool is_lower, bool is_less)
{
    return is_lower == is_less ? source->more_mv : source->less_mv;
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

/* The same beside those that outvote it: what supply, drop and offsets make is theirs as well. */
static void keep_beside(circuit_peer_t *own, float beside)
{
    const float was = (float)own->was_q7 / SHARE_Q7;
    const bool goes_on =
        own->beside && own->was_q7 != 0 && are_alike(own->was_16mv, own->shown_16mv);
    own->was_q7 = to_q7(goes_on ? was + KEEP_PART * (beside - was) : beside);
    own->was_16mv = own->shown_16mv;
    own->beside = 1;
}

/* What a window is taken for. */
typedef struct {
    bool good; /* nothing needs what is not known of the drop to explain it */
    bool odd;
    bool only_offsets; /* explain it, where it is not odd */
    bool acquits;      /* the other one does, whose share is as it ever was beside this one's */
    bool teaches;      /* what its share of the others' is */
} verdict_t;

/* Beside another one, which alone outvotes nobody. */
static verdict_t beside(circuit_peer_t *own, float own_part, const others_t *others,
                        const circuit_window_t *window, const circuit_source_t *source,
                        float offsets_mv)
{
    const float expected_mv = window->expected_mv;
    const float share = window->share;
    const bool is_less = expected_mv < others->mv;
    const float told_mv = is_less ? expected_mv : others->mv;
    const float higher_mv = is_less ? others->mv : expected_mv;
    const float like = others->share * own_part;           /* as ever, */
    const float changed = beyond(share, like, KNOWN_PART); /* beyond what a cable makes of it */
    const float off_mv = odd_mv(own, changed, share, others->share, told_mv) - offsets_mv;
    verdict_t is = {.good = off_mv <= 0.0f,
                    .acquits =
                        own->learnt != 0 && changed <= (ALONE_LESS_PART - KNOWN_PART) * like};
    is.odd = !is.good &&
             off_mv > unsure_mv(source, share < like, is_less) * apart(expected_mv, others->mv);
    /* Where offsets make more than what a share may be at the most, it teaches nothing; nor where a
     * drop may that is not known: of the little that is found behind one, what an eighth more of
     * duty brings is most. */
    const float most_mv = fminf(others->share, 1.0f) * (OTHER_PART * told_mv - offsets_mv);
    is.teaches = others->alike ? source->unsure_mv * (higher_mv - told_mv) <= most_mv * higher_mv
                               : source->unsure_mv <= most_mv;
    /* whatever offsets make: else a window of few volts, which tells little, would acquit one who
     * was found */
    is.good = is.good && (!was_found(own) || own->learnt == 0 || changed <= 0.0f);
    if (is.odd || (!is.good && was_found(own)) || own->learnt >= LEARN_MOST || !is.teaches) {
        return is;
    }
    if (others->outvotes ||
        own->was_q7 != 0) { /* by the second, all that begin at once are there */
        const bool begin = !others->outvotes && own->learnt == 0 && others->peer->learnt == 0;
        /* of two that begin each is off by half */
        const float as_one = begin ? 0.5f * (others->share + share) : others->share;
        learn(own, begin ? share / as_one : window->beside, told_mv / VOLTS_MV);
        if (own->learnt == 1) {
            own->share_q7 = to_q7(as_one);
        }
    }
    return is;
}

/* Beside what it showed itself, of the supply, or of what others show (else NULL). Offsets and what
 * is not known of the drop make of that what they make of other volts, of either. */
static verdict_t beside_itself(const circuit_peer_t *own, bool sure, const others_t *others,
                               const circuit_window_t *window, const circuit_source_t *source,
                               float offsets_mv)
{
    const float expected_mv = window->expected_mv;
    const float was_mv = volts_mv(own->was_16mv);
    float was = (float)own->was_q7 / SHARE_Q7;
    if (others != NULL) {
        was *= others->share;
    }
    const bool is_less = window->share < was;
    const float alone_part = is_less ? ALONE_LESS_PART : ALONE_MORE_PART;
    const float off = beyond(window->share, was, sure ? KNOWN_PART : alone_part);
    if (off <= 0.0f) {
        return (verdict_t){.good = true};
    }
    const float apart_part = apart(expected_mv, was_mv);
    float moved_mv = NOISE_MV + offsets_mv * apart_part;
    if (others != NULL) {
        moved_mv += (offsets_mv + source->unsure_mv) * fabsf(others->mv - was_mv) * expected_mv /
                    (others->mv * was_mv);
    }
    const float off_mv = off * expected_mv - moved_mv;
    return (verdict_t){.good = off_mv <= 0.0f && !was_found(own),
                       .odd =
                           off_mv > unsure_mv(source, is_less, expected_mv < was_mv) * apart_part,
                       .only_offsets = true};
}

bool circuit_peers_judge(circuit_peers_t *peers, uint8_t springs, uint8_t k,
                         circuit_window_t *window, const circuit_source_t *source)
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
    own->shown_16mv = to_byte(expected_mv / VOLTS_MV);
    const others_t others = ask_others(peers, springs, k);
    const float offsets_mv =
        OFFSETS_MV + (others.alike ? DROP_PART_ALIKE : DROP_PART) * source->drop_mv;
    if (own->beside && !others.outvotes &&
        before.share_q7 != 0) { /* else the others may be to come yet */
        own->was_q7 = 0;
        own->beside = 0;
    }
    verdict_t is = {.good = true};
    if (others.peer != NULL) {
        window->beside = window->share / others.share;
        is = beside(own, own_part, &others, window, source, offsets_mv);
    }
    window->outvoted = others.outvotes && others.alike;
    window->acquitted = others.outvotes && is.acquits && !is.odd;
    if (!others.outvotes && own->was_q7 != 0 && !own->beside && (is.odd || !is.acquits)) {
        if (expected_mv < source->unsure_mv) {
            return own->odd >= CIRCUIT_PEERS_WINDOWS; /* the drop may take all of it */
        }
        const bool sure = is.odd || own->odd >= CIRCUIT_PEERS_WINDOWS - 1u;
        is = beside_itself(own, sure, NULL, window, source, offsets_mv);
    } else if (!others.outvotes) {
        is.odd = false; /* nobody knows which of the two */
    } else if (own->beside && own->was_q7 != 0 && !is.odd) {
        const verdict_t itself = beside_itself(own, true, &others, window, source, offsets_mv);
        is.odd = itself.odd;
        is.only_offsets = itself.only_offsets;
    }
    if (is.odd) {
        own->odd = own->odd < CIRCUIT_PEERS_WINDOWS ? (own->odd + 1u) & 3u : own->odd;
        if (own->beside &&
            own->odd == CIRCUIT_PEERS_WINDOWS) { /* of the supply, for when it is alone */
            own->was_q7 = to_q7((float)own->was_q7 / SHARE_Q7 * others.share);
            own->beside = 0;
        }
    } else if (is.good || !was_found(own)) {
        /* what an open spring shows is no share of the supply, nor what may be offsets' */
        if (window->balances && !is.only_offsets && offsets_mv <= ALONE_MORE_PART * expected_mv) {
            if (window->outvoted && is.teaches) {
                keep_beside(own, window->beside);
            } else if (!own->beside) {
                keep(own, &before, window->share);
            }
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
        own->beside = 0;
    }
}

/* The same voltage is another share of what its duty should bring by another belief. */
static uint8_t believed_anew(const circuit_peer_t *own, const circuit_source_t *before,
                             const circuit_source_t *now)
{
    const float was_mv = volts_mv(own->was_16mv);
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
        if (!own->beside) { /* else of both, and one is as much of the other as before */
            own->was_q7 = kept ? believed_anew(own, before, now) : 0;
        }
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
