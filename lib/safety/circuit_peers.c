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

#define KNOWN_PART 0.05f /* as others switch, so much does one end of a cable move */
#define OTHER_PART 0.18f /* 0.04 ohm of wiring in 0.36, gains of 3 % */
#define ALONE_PART 0.20f /* the supply */
#define LEARN_MOST 255u  /* windows: 2.5 minutes. What is soldered stays what it is */

/* The middle one of the others that are driven; NULL: too few. */
static const circuit_peer_t *middle(const circuit_peers_t *peers, uint8_t springs, uint8_t k)
{
    uint8_t sorted[CIRCUIT_PEERS_MAX];
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
    return count < CIRCUIT_PEERS_LEAST ? NULL : &peers->spring[sorted[count / 2u]];
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

/* By how much a share is off beyond so large a part. */
static float beyond(float share, float like, float part)
{
    return fabsf(share - like) - part * like;
}

/* Its share beside that of the others, which was told at so few volts. */
static bool is_odd(const circuit_peer_t *own, float share, float others, float told_mv,
                   float offsets_mv)
{
    if (beyond(share, others, OTHER_PART) * told_mv > offsets_mv) {
        return true;
    }
    if (own->learnt == 0) {
        return false;
    }
    /* An offset keeps its sign: of two shares, the one at fewer volts is off by more. */
    const float own_part = (float)own->own_q12 / OWN_Q12;
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
static bool is_like(const circuit_peer_t *own, float share, float others)
{
    const float own_part = (float)own->own_q12 / OWN_Q12;
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

/* In the window before, of the supply. */
static uint8_t shown_before_q7(const circuit_peer_t *before)
{
    const uint32_t share_q19 = fixed_point_mac_u16(0, before->share_q7, before->own_q12);
    const uint32_t share_q7 = before->own_q12 == 0 ? before->share_q7 : share_q19 >> 12;
    return share_q7 < 255u ? (uint8_t)(share_q7 | (share_q7 == 0)) : 255u;
}

/* What it showed, to be compared with: of the window before, at about the same volts, as in this
 * one another circuit may begin. */
static void keep(circuit_peer_t *own, const circuit_peer_t *before, float share)
{
    if (before->was_q7 == 0) {
        own->was_q7 = to_q7(share);
    } else if (before->share_q7 != 0 && before->odd == 0 &&
               are_alike(before->shown_16mv, own->shown_16mv)) {
        own->was_q7 = shown_before_q7(before);
    }
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
    const float share = window->share;
    const float own_part = own->own_q12 != 0 ? (float)own->own_q12 / OWN_Q12 : 1.0f;
    const circuit_peer_t *const other = middle(peers, springs, k);
    const float was_mv = volts_mv((float)own->shown_16mv);
    own->share_q7 = to_q7(share / own_part);
    own->shown_16mv = (uint8_t)fminf(expected_mv / VOLTS_MV, SHARE_MOST);
    const bool alike = other != NULL && are_alike(own->shown_16mv, other->shown_16mv);
    const float offsets_mv = OFFSETS_MV + (alike ? DROP_PART_ALIKE : DROP_PART) * source->drop_mv;
    bool good = true; /* nothing needs what is not known of the drop to explain it */
    bool odd = false;
    bool only_offsets = false; /* explain it, where it is not odd */
    const uint8_t others_q7 = other != NULL ? other->share_q7 : 0;
    if (others_q7 != 0) {
        const float others = (float)others_q7 / SHARE_Q7;
        const float other_mv = volts_mv((float)other->shown_16mv);
        const float told_mv = fminf(expected_mv, other_mv);
        good = !is_odd(own, share, others, told_mv, offsets_mv);
        odd = !good && is_odd(own, share, others, told_mv,
                              offsets_mv + drop_mv(source, share < others * own_part, expected_mv,
                                                   other_mv));
        /* Where offsets make more than what a share may be at the most, it teaches nothing; nor
         * where a drop may that is not known: of the little that is found behind one, what an
         * eighth more of duty brings is most. */
        const float most_mv = fminf(others, 1.0f) * (OTHER_PART * told_mv - offsets_mv);
        const float higher_mv = fmaxf(expected_mv, other_mv);
        const bool teaches = alike
                                 ? source->unsure_mv * (higher_mv - told_mv) <= most_mv * higher_mv
                                 : source->unsure_mv <= most_mv;
        good = good && (!was_found(own) || is_like(own, share, others));
        if (!odd && (good || !was_found(own)) && own->learnt < LEARN_MOST && teaches) {
            learn(own, share / others, told_mv / VOLTS_MV);
        }
    } else if (own->was_q7 != 0 && expected_mv < source->unsure_mv) {
        return own->odd >= CIRCUIT_PEERS_WINDOWS; /* the drop may take all of it */
    } else if (own->was_q7 != 0) {
        const float was = (float)own->was_q7 / SHARE_Q7;
        const float part = own->odd >= CIRCUIT_PEERS_WINDOWS - 1u ? KNOWN_PART : ALONE_PART;
        const float off = beyond(share, was, part);
        const float off_mv = off * expected_mv - offsets_mv;
        only_offsets = off > 0.0f;
        good = off_mv <= (was_found(own) ? -offsets_mv : 0.0f);
        odd = off_mv > drop_mv(source, share < was, expected_mv, was_mv);
    }
    if (odd) {
        own->odd = own->odd < CIRCUIT_PEERS_WINDOWS ? (own->odd + 1u) & 3u : own->odd;
    } else if (good || !was_found(own)) {
        /* what an open spring shows is no share of the supply, nor what may be offsets' */
        if (window->balances && !only_offsets && offsets_mv <= ALONE_PART * expected_mv) {
            keep(own, &before, share);
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
    const float was_mv = volts_mv((float)own->shown_16mv);
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
