/* sources: lib/safety/circuit_peers.c
 * defines: -DCIRCUIT_PEERS_MAX=9 -DCURRENT_CONTROL_MAX_CHANNELS=9 */
#include "circuit_peers.h"

#include "prove.h"

#define MOST_MV 20000.0f /* 4.1 A and wiring beside 4.1 V; the highest declared supply */

/* Frama-C knows their declarations only. */
float fminf(float a, float b)
{
    return a < b ? a : b;
}

float fmaxf(float a, float b)
{
    return a > b ? a : b;
}

void main(void)
{
    circuit_peers_t peers = {0};
    const circuit_source_t source = any_source();
    while (any_bool()) {
        circuit_window_t window = {
            .found_mv = Frama_C_float_interval(0.0f, MOST_MV),
            .expected_mv = Frama_C_float_interval(0.0f, MOST_MV),
            .tells = any_bool(),
            .balances = any_bool(),
        };
        window.share = circuit_window_share(window.found_mv, window.expected_mv);
        const uint8_t springs = (uint8_t)any_between(1, CIRCUIT_PEERS_MAX);
        const uint8_t spring = (uint8_t)any_between(0, springs - 1);
        (void)circuit_peers_judge(&peers, springs, spring, &window, &source);
        if (any_bool()) {
            circuit_peers_clear(&peers, spring, any_bool());
        }
        if (any_bool()) {
            const circuit_source_t now = any_source();
            circuit_peers_renew(&peers, springs, &source, &now);
        }
        if (any_bool()) {
            circuit_peers_suspect(&peers, spring, (uint16_t)any_between(1, UINT16_MAX));
        }
    }
}
