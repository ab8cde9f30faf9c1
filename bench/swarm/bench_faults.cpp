/* One fault at a time in a board that heats, holds, or has switched off: how hot, how soon safe,
 * how soon said, and in which words. Beside the same board without it. */
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>

#include "board_view.h"
#include "faulty_board.hpp"
#include "simulated_board.h"

using namespace swarm;

namespace
{

constexpr unsigned SPRINGS = TRUTH_SPRINGS;
constexpr unsigned OFF_SPRING = 4; /* the middle one; the others are driven */
constexpr double SLICE_S = 0.02, HOTTER_K = 10.0;
constexpr double QUIET_S = 20.0; /* before the user clears, three times */
constexpr double AGAIN_S = 8.0;

/* Of all trials, beside the array's seed. */
struct session {
    std::string elf = ninespring::default_elf("firmware.elf");
    std::uint64_t seed = 7;
    double freewheel_v = 0.0, later_s = 0.0;
    std::string pattern = "111101111";
    std::vector<std::string> first; /* lines before it */
    bool trace = false;
};

using events = std::vector<event>; /* at_s from the fault on */

struct injected {
    std::string name;
    events what;
};

event at(double at_s, kind what, unsigned channel = 0, double value = 0.0, bool on = true)
{
    return {at_s, what, channel, on, value, ""};
}

event say(double at_s, const std::string &text)
{
    return {at_s, kind::say, 0, true, 0.0, text};
}

events every(double period_s, double until_s, event one)
{
    events all;
    for (; one.at_s < until_s; one.at_s += period_s) {
        all.push_back(one);
    }
    return all;
}

events flood()
{
    events all;
    for (double at_s = 0.0; at_s < 10.0; at_s += 0.1) {
        event one = at(at_s, kind::bytes);
        for (int k = 0; k < 1150; ++k) {
            one.text += "6162630a"[(2 * k) % 8];
            one.text += "6162630a"[(2 * k) % 8 + 1];
        }
        all.push_back(one);
    }
    return all;
}

event octets(double at_s, const std::string &text)
{
    event one = at(at_s, kind::bytes);
    for (const char c : text) {
        one.text += fmt::format("{:02x}", static_cast<unsigned char>(c));
    }
    return one;
}

events half_lines()
{
    events all = every(1.0, 10.0, octets(0.0, "off"));
    all.push_back(octets(12.0, "\n"));
    return all;
}

events upload()
{
    events all;
    const char *const lines[] = {
        "$loss_w_per_k=0.0070",  "$heat_capacity_j_per_k=0.330",    "$austenite_start_c=85",
        "$latent_heat_j=9",      "$resistance_austenite_ohm=0.225", "$loss_scale_1=1.1",
        "$martensite_start_c=76"};
    for (int n = 0; n < 70; ++n) {
        all.push_back(say(0.1 * n, lines[n % 7]));
    }
    return all;
}

/* It begins and ends again. */
events pulses(double period_s, double lasts_s, event one)
{
    events all;
    for (double at_s = 0.0; at_s < 40.0; at_s += period_s) {
        one.at_s = at_s;
        one.on = true;
        all.push_back(one);
        one.at_s += lasts_s;
        one.on = false;
        all.push_back(one);
    }
    return all;
}

/* Of its current, ever less. */
events falls(double part, double period_s)
{
    events all;
    double shows = 1.0;
    for (double at_s = 0.0; at_s < 40.0; at_s += period_s) {
        shows *= part;
        all.push_back(at(at_s, kind::scaled, 0, shows));
    }
    return all;
}

/* The fault stays, and who uses the board says this again and again. */
events insists(event fault, double period_s, std::initializer_list<const char *> lines)
{
    events all{fault};
    for (double at_s = 1.0; at_s < QUIET_S - 1.0; at_s += period_s) {
        double then_s = at_s;
        for (const char *const line : lines) {
            all.push_back(say(then_s, line));
            then_s += 0.05;
        }
    }
    return all;
}

events cuts_in_save(kind what)
{
    events all;
    double at_s = 0.0;
    for (const double run_s : {0.002, 0.02, 0.1, 0.4, 1.0, 2.0}) {
        all.push_back(say(at_s, "$loss_w_per_k=0.0060"));
        all.push_back(say(at_s + 0.1, "$save"));
        all.push_back(at(at_s + 0.12 + run_s, what));
        at_s += 3.0;
    }
    return all;
}

/* Back at once, and then its user waits, who takes the springs for cold. The quiet time begins as
 * it is said: what is cut is what heats or holds so much earlier, with --later that time. */
events cut_and_called_cold(double waits_s)
{
    return {at(-waits_s, kind::power), say(0.0, "model cold"), say(0.2, "pattern 111101111")};
}

/* Its start takes 0.3 s: a cut in each phase of it. */
events cuts_in_the_start(kind what)
{
    events all;
    double at_s = 0.0;
    for (double run_s = 0.005; run_s < 0.6; run_s *= 1.25) {
        all.push_back(at(at_s, what));
        at_s += run_s;
    }
    return all;
}

events flaps()
{
    events all;
    for (double at_s = 0.0; at_s < 20.0; at_s += 0.6) {
        all.push_back(at(at_s, kind::supply, 0, 0.5));
        all.push_back(at(at_s + 0.3, kind::supply, 0, 5.0));
    }
    return all;
}

events climbs()
{
    events all;
    for (double at_s = 0.0; at_s <= 20.0; at_s += 0.5) {
        all.push_back(at(at_s, kind::supply, 0, 5.0 + 0.125 * at_s));
    }
    return all;
}

std::vector<injected> catalogue()
{
    using k = kind;
    const unsigned off = OFF_SPRING;
    return {
        {"none", {}},
        /* switches and circuit */
        {"switch welded", {at(0, k::closed)}},
        {"switch welded, spring off", {at(0, k::closed, off)}},
        {"switch welds at 70 degC", {at(0, k::welds_hot, 0, 70)}},
        {"switch leaks 0.05 A", {at(0, k::leaks, 0, 0.05)}},
        {"switch leaks 0.3 A", {at(0, k::leaks, 0, 0.3)}},
        {"switch leaks 1 A", {at(0, k::leaks, 0, 1.0)}},
        {"switch leaks 2.7 A", {at(0, k::leaks, 0, 2.7)}},
        {"switch leaks 6.7 A", {at(0, k::leaks, 0, 6.7)}},
        {"switch leaks 2.7 A, spring off", {at(0, k::leaks, off, 2.7)}},
        {"gate joined with a driven one's", {at(0, k::gates_joined, 0, 1)}},
        {"gate joined with that of one that is off", {at(0, k::gates_joined, 0, off)}},
        {"no inductor", {at(0, k::no_inductor)}},
        {"switch leaks 0.08 A, spring off", {at(0, k::leaks, off, 0.08)}},
        {"switch leaks 0.3 A, spring off", {at(0, k::leaks, off, 0.3)}},
        {"on 3 us late", {at(0, k::slow_switch, 0, -0.06)}},
        {"off 3 us late", {at(0, k::slow_switch, 0, 0.06)}},
        {"off 10 us late", {at(0, k::slow_switch, 0, 0.2)}},
        {"diode open", {at(0, k::diode_open)}},
        {"gates swapped with a driven one", {at(0, k::gates_swapped, 0, 1)}},
        {"gates swapped with one that is off", {at(0, k::gates_swapped, 0, off)}},
        {"spring broken", {at(0, k::open)}},
        {"crimp chatters, 1 Hz", {at(0, k::chatters, 0, 1.0)}},
        {"crimp chatters, 7 Hz", {at(0, k::chatters, 0, 7.0)}},
        {"contact +0.05 ohm / 100 K", {at(0, k::warm_contact, 0, 0.05)}},
        {"contact +0.2 ohm / 100 K", {at(0, k::warm_contact, 0, 0.2)}},
        {"short across a spring", {at(0, k::shorted)}},
        {"touches a driven neighbour", {at(0, k::bridged, 0, 1)}},
        {"touches one that is off", {at(0, k::bridged, 0, off)}},
        {"ground lifts 5 mohm", {at(0, k::ground, 0, 0.005)}},
        {"ground lifts 20 mohm", {at(0, k::ground, 0, 0.02)}},
        {"supply 5 V -> 4.2 V", {at(0, k::supply, 0, 4.2)}},
        {"supply 5 V -> 6.5 V", {at(0, k::supply, 0, 6.5)}},
        {"supply 5 V -> 7.5 V", {at(0, k::supply, 0, 7.5)}},
        {"supply 5 V -> 1 V, back after 5 s", {at(0, k::supply, 0, 1.0), at(5, k::supply, 0, 5.0)}},
        {"supply 0.5 V each 0.6 s for 0.3 s", flaps()},
        {"supply 5 V -> 7.5 V in 20 s", climbs()},
        {"supply of 2 A", {at(0, k::weak_supply, 0, 2.0)}},
        {"supply of 0.7 A", {at(0, k::weak_supply, 0, 0.7)}},
        {"supply 5 V -> 8 V", {at(0, k::supply, 0, 8.0)}},
        {"supply +-10 %, 0.2 Hz", {at(0, k::ripple, 0, 0.1)}},
        {"supply +-15 %, 2 Hz", {at(0, k::ripple, 3, 0.15)}},
        {"supply +-15 %, 10 Hz", {at(0, k::ripple, 5, 0.15)}},
        {"supply +-20 %, 25 Hz", {at(0, k::ripple, 7, 0.2)}},
        {"fan stops", {at(0, k::fan_stops)}},
        /* sensors */
        {"sensor shows 0.3 of its current", {at(0, k::scaled, 0, 0.3)}},
        {"sensor shows 0.52", {at(0, k::scaled, 0, 0.52)}},
        {"sensor shows 0.6", {at(0, k::scaled, 0, 0.6)}},
        {"sensor shows 0.7", {at(0, k::scaled, 0, 0.7)}},
        {"sensor shows 0.8", {at(0, k::scaled, 0, 0.8)}},
        {"sensor shows 1.3", {at(0, k::scaled, 0, 1.3)}},
        {"sensor shows 2", {at(0, k::scaled, 0, 2.0)}},
        {"sensor shows 0.5 of its voltage", {at(0, k::volt_scaled, 0, 0.5)}},
        {"sensor shows 0.8 of its voltage", {at(0, k::volt_scaled, 0, 0.8)}},
        {"sensor shows 1.3 of its voltage", {at(0, k::volt_scaled, 0, 1.3)}},
        {"drifts -1 % a minute", {at(0, k::drifts, 0, -0.01)}},
        {"drifts -60 % a minute", {at(0, k::drifts, 0, -0.6)}},
        {"drifts -30 % a minute", {at(0, k::drifts, 0, -0.3)}},
        {"drifts -10 % a minute", {at(0, k::drifts, 0, -0.1)}},
        {"voltage drifts -60 % a minute", {at(0, k::volt_drifts, 0, -0.6)}},
        {"voltage drifts -20 % a minute", {at(0, k::volt_drifts, 0, -0.2)}},
        {"offset creeps -0.5 A a minute", {at(0, k::creeps, 0, -0.5)}},
        {"gain falls by 8 % each 3 s", falls(0.92, 3.0)},
        {"shows 0.8 for a second, each 2 s", pulses(2.0, 1.0, at(0, k::scaled, 0, 0.8))},
        {"shows nothing for 60 ms, each 0.3 s", pulses(0.3, 0.06, at(0, k::saturates, 0, 0.001))},
        {"drifts +60 % a minute", {at(0, k::drifts, 0, 0.6)}},
        {"saturates at 0.5 A", {at(0, k::saturates, 0, 0.5)}},
        {"saturates at 1.6 A", {at(0, k::saturates, 0, 1.6)}},
        {"offset -0.2 A", {at(0, k::offset, 0, -0.2)}},
        {"offset +0.09 A", {at(0, k::offset, 0, 0.09)}},
        {"offset +0.3 A", {at(0, k::offset, 0, 0.3)}},
        {"offset +0.3 A, spring off", {at(0, k::offset, off, 0.3)}},
        {"offset -0.1 V", {at(0, k::lifted, 0, -0.1)}},
        {"offset +0.1 V", {at(0, k::lifted, 0, 0.1)}},
        {"bursts of 0.3 A, V", {at(0, k::bursts, 0, 0.3)}},
        {"bursts of 2 A, V", {at(0, k::bursts, 0, 2.0)}},
        {"bursts of 2 A, V, spring off", {at(0, k::bursts, off, 2.0)}},
        {"NACKs one in 100", {at(0, k::nacks, 0, 100)}},
        {"NACKs one in 10", {at(0, k::nacks, 0, 10)}},
        {"NACKs one in 3", {at(0, k::nacks, 0, 3)}},
        {"one bit in 100 reads", {at(0, k::garbled, 0, 100)}},
        {"one bit in 10 reads", {at(0, k::garbled, 0, 10)}},
        {"one bit in 2 reads", {at(0, k::garbled, 0, 2)}},
        {"one bit in 10 reads, spring off", {at(0, k::garbled, off, 10)}},
        {"bit 11 of the current stuck at 1", {at(0, k::stuck_bit, 0, 12)}},
        {"bit 13 of the current stuck at 0", {at(0, k::stuck_bit, 0, -14)}},
        {"bit 14 of the current stuck at 0", {at(0, k::stuck_bit, 0, -15)}},
        {"bit 15 of the current stuck at 1", {at(0, k::stuck_bit, 0, 16)}},
        {"bit 8 of the voltage stuck at 0", {at(0, k::stuck_bit, 0, -25)}},
        {"bit 9 of the voltage stuck at 1", {at(0, k::stuck_bit, 0, 26)}},
        {"ready bit stuck at 0", {at(0, k::stuck_bit, 0, -18)}},
        {"ready bit stuck at 1", {at(0, k::stuck_bit, 0, 18)}},
        {"bit 11 of the current stuck at 1, spring off", {at(0, k::stuck_bit, off, 12)}},
        {"answers at a driven one's address", {at(0, k::answers_too, 1, 1)}},
        {"answers at the address of one that is off", {at(0, k::answers_too, off, 1)}},
        {"swapped with a driven one", {at(0, k::swapped, 0, 1)}},
        {"swapped with one that is off", {at(0, k::swapped, 0, off)}},
        {"frozen", {at(0, k::frozen)}},
        {"current frozen", {at(0, k::frozen, 0, 1)}},
        {"voltage frozen", {at(0, k::frozen, 0, 2)}},
        {"absent", {at(0, k::absent)}},
        {"stale", {at(0, k::stale)}},
        {"loses its configuration", {at(0, k::unset)}},
        {"... every 0.5 s", every(0.5, 40.0, at(0, k::unset))},
        {"... every 0.05 s", every(0.05, 40.0, at(0, k::unset))},
        {"bus hangs", {at(0, k::sda)}},
        {"bus hangs 60 ms, each 0.3 s", {}},
        {"bus 3 times as slow", {at(0, k::slow_bus, 0, 3)}},
        {"bus 8 times as slow", {at(0, k::slow_bus, 0, 8)}},
        {"bus 15 times as slow", {at(0, k::slow_bus, 0, 15)}},
        {"both repeated but for a bit", {at(0, k::repeats, 0, 1)}},
        {"current repeated but for a bit", {at(0, k::repeats, 0, 2)}},
        {"voltage repeated but for a bit", {at(0, k::repeats, 0, 3)}},
        {"repeats its last second", {at(0, k::repeats, 0, 4)}},
        {"repeats its last second, spring off", {at(0, k::repeats, off, 4)}},
        {"hears 0.1 of its neighbour", {at(0, k::hears, 0, 0.1)}},
        {"hears 0.3 of its neighbour", {at(0, k::hears, 0, 0.3)}},
        {"hears -0.3 of its neighbour", {at(0, k::hears, 0, -0.3)}},
        {"hears 0.3 of its neighbour, spring off", {at(0, k::hears, off, 0.3)}},
        {"shows its neighbour's voltage", {at(0, k::voltage_of, 0, 2)}},
        {"shows the voltage of one that is off", {at(0, k::voltage_of, 0, off + 1.0)}},
        {"lags by 0.3 s", {at(0, k::lags, 0, 0.3)}},
        {"lags by 2 s", {at(0, k::lags, 0, 2.0)}},
        {"lags by 10 s", {at(0, k::lags, 0, 10.0)}},
        {"noise of 0.03 A, V", {at(0, k::noisy, 0, 0.03)}},
        {"noise of 0.2 A, V", {at(0, k::noisy, 0, 0.2)}},
        {"noise of 1 A, V", {at(0, k::noisy, 0, 1.0)}},
        {"shunt the other way round", {at(0, k::scaled, 0, -1.0)}},
        {"voltage's wire broken", {at(0, k::volt_scaled, 0, 0.0)}},
        {"voltage's wire at the supply", {at(0, k::lifted, 0, 4.5)}},
        /* board and host */
        {"world 2 % faster", {at(0, k::clock, 0, 1.02)}},
        {"world 2 % slower", {at(0, k::clock, 0, 0.98)}},
        {"brown-outs in the start", cuts_in_the_start(k::brown_out)},
        {"power cuts in the start", cuts_in_the_start(k::power)},
        {"watchdog in a loop, 1 s", every(1.0, 20.0, at(0, k::hang))},
        {"thermistor open", {at(0, k::thermistor, 0, 5.0)}},
        {"thermistor shorted", {at(0, k::thermistor, 0, 0.0)}},
        {"thermistor says -5 degC", {at(0, k::thermistor, 0, 4.0)}},
        {"thermistor says 60 degC", {at(0, k::thermistor, 0, 1.0)}},
        /* what comes and goes, and who does not let be */
        {"switch closes for 20 ms, each 0.1 s", pulses(0.1, 0.02, at(0, k::closed))},
        {"switch closes for 40 ms, each 0.3 s", pulses(0.3, 0.04, at(0, k::closed))},
        {"switch closes for 40 ms, spring off", pulses(0.3, 0.04, at(0, k::closed, off))},
        {"absent for 60 ms, each 0.3 s", pulses(0.3, 0.06, at(0, k::absent))},
        {"stale for 0.2 s, each 0.5 s", pulses(0.5, 0.2, at(0, k::stale))},
        {"frozen for 0.5 s, each 0.7 s", pulses(0.7, 0.5, at(0, k::frozen))},
        {"open for 50 ms, each 0.3 s", pulses(0.3, 0.05, at(0, k::open))},
        {"thermistor loose", every(0.4, 19.0, at(0, k::thermistor, 0, 5.0))},
        {"shows 0.52, cleared each second",
         insists(at(0, k::scaled, 0, 0.52), 1.0, {"clear", "on 1"})},
        {"shows 0.52, cleared each 2.2 s",
         insists(at(0, k::scaled, 0, 0.52), 2.2, {"clear", "on 1"})},
        {"welded, the supply insisted on",
         insists(at(0, k::closed), 0.5, {"clear", "supply on", "on 1"})},
        {"broken, cleared each second", insists(at(0, k::open), 1.0, {"clear", "on 1"})},
        {"brown-outs in $save", cuts_in_save(k::brown_out)},
        {"power cuts in $save", cuts_in_save(k::power)},
        {"console flooded", flood()},
        {"half lines", half_lines()},
        {"settings uploaded", upload()},
        /* numbers that no spring has, of springs that are driven */
        {"martensite start 2 K lower declared", {say(0, "$martensite_start_c=76")}},
        {"losses x 3.4 declared", {say(0, "$loss_w_per_k=0.0197")}},
        {"heat capacity x 10 declared", {say(0, "$heat_capacity_j_per_k=3")}},
        {"heat capacity of one x 3 declared", {say(0, "$heat_capacity_scale_1=3")}},
        {"a plate that takes ten times the losses declared",
         {say(0, "$plate_heat_capacity_j_per_k=2000"), say(0.2, "$plate_loss_w_per_k=0.065"),
          say(0.4, "$plate_coupling_w_per_k=0.06")}},
        {"neighbours x 27 declared", {say(0, "$orthogonal_w_per_k=0.016")}},
        {"latent heat x 2.75 declared", {say(0, "$latent_heat_j=23.8")}},
        {"cold declared after the warmest air",
         {say(0, "off all"), say(0.1, "ambient 50"), say(1.5, "ambient 20"),
          say(1.7, "model cold")}},
        {"cold declared after another size",
         {say(0, "off all"), say(0.1, "$rows=1"), say(1.5, "$rows=3"), say(1.7, "model cold")}},
        {"air of -40 degC declared", {say(0, "ambient -40")}},
        {"power cut, cold declared after 1 s", cut_and_called_cold(1.0)},
        {"power cut, cold declared after 5 s", cut_and_called_cold(5.0)},
        {"power cut, cold declared after 60 s", cut_and_called_cold(60.0)},
        {"power cut, cold declared after 120 s", cut_and_called_cold(120.0)},
        {"losses by the fan x 3.4 declared, then the fan",
         {say(0, "$loss_fan_w_per_k=0.0384"), say(0.5, "fan 100")}},
        {"losses by the fan x 5.8 declared, then the fan",
         {say(0, "$loss_fan_w_per_k=0.065"), say(0.5, "fan 100")}},
        {"neighbours by the fan x 24 declared, then the fan",
         {say(0, "$orthogonal_fan_w_per_k=0.016"), say(0.5, "fan 100")}},
        {"half of the fan declared, then the fan",
         {say(0, "$fan_half_share=0.9"), say(0.5, "fan 50")}},
    };
}

struct result {
    double hottest_c = -300.0;                        /* in the quiet time, of any spring */
    double cleared_c = -300.0;                        /* while the user clears and tries again */
    std::array<double, SPRINGS> peak_c{}, unsaid_c{}; /* of each; before anything was said */
    std::optional<double> said_s, off_s;
    std::string words;
    unsigned resets = 0;
    bool crashed = false;
};

class trial
{
public:
    trial(const injected &one, const std::string &phase, const session &all)
        : scenario_(life(one, phase, all)), trace_(all.trace),
          board_(scenario_, all.elf, this, [](void *context, std::uint64_t, std::uint8_t octet) {
              static_cast<trial *>(context)->heard_ += static_cast<char>(octet);
          })
    {
        board_set_analog_v(board_.raw(), 0, 2.74); /* 20 degC, where a thermistor is set */
    }

    result run()
    {
        std::size_t next = 0;
        r_.peak_c.fill(-300.0);
        r_.unsaid_c.fill(-300.0);
        for (double end_s = SLICE_S; end_s < scenario_.duration_s && !r_.crashed;
             end_s += SLICE_S) {
            while (next < scenario_.events.size() && scenario_.events[next].at_s < end_s) {
                const event &e = scenario_.events[next++];
                run_until(e.at_s);
                happen(e);
            }
            run_until(end_s);
            look();
        }
        r_.resets = board_reset_count(board_.raw());
        return r_;
    }

private:
    static constexpr double START_S = 1.2;

    scenario life(const injected &one, const std::string &phase, const session &all)
    {
        const std::string pattern = "pattern " + all.pattern;
        scenario s;
        s.freewheel_v = all.freewheel_v;
        s.seed = all.seed;
        s.tolerance = 0.05;
        s.events = {say(0.6, "model cold"), say(0.8, pattern)};
        for (const std::string &line : all.first) {
            s.events.push_back(say(0.7, line));
        }
        from_s_ = phase == "heats" ? START_S + 0.5 : phase == "off" ? 62.0 : 60.0;
        from_s_ += all.later_s;
        if (phase == "off") {
            s.events.push_back(say(60.0, "off all"));
            s.events.push_back(say(70.0, pattern));
        }
        if (one.name.rfind("thermistor", 0) == 0) {
            s.events.push_back(say(0.5, "$ambient_source=1"));
        }
        for (event e : one.what) {
            e.at_s += from_s_;
            s.events.push_back(e);
        }
        for (double t = 0.1; t < QUIET_S - 1.0; t += 0.5) { /* what it says of itself */
            event asks = at(from_s_ + t, kind::bytes);
            asks.text = "3f";
            s.events.push_back(asks);
        }
        if (one.name.rfind("bus hangs 60", 0) == 0) {
            for (double t = 0.0; t < 40.0; t += 0.3) {
                s.events.push_back(at(from_s_ + t, kind::sda));
                s.events.push_back(at(from_s_ + t + 0.06, kind::sda, 0, 0.0, false));
            }
        }
        again_s_ = from_s_ + QUIET_S;
        s.events.push_back(say(again_s_ - 0.5, "faults"));
        for (int n = 0; n < 3; ++n) {
            const double t = again_s_ + n * AGAIN_S;
            s.events.push_back(say(t, "unlock"));
            s.events.push_back(say(t + 0.1, "clear"));
            s.events.push_back(say(t + 0.2, "supply on"));
            s.events.push_back(say(t + 0.4, pattern));
        }
        s.duration_s = again_s_ + 3 * AGAIN_S;
        std::stable_sort(s.events.begin(), s.events.end(),
                         [](const event &a, const event &b) { return a.at_s < b.at_s; });
        return s;
    }

    double now_s() const { return board_time_s(board_.raw()); }

    void run_until(double at_s)
    {
        const auto cycle = static_cast<std::uint64_t>(at_s * BOARD_FREQUENCY_HZ);
        if (cycle > board_cycle(board_.raw())) {
            r_.crashed = board_run_until(board_.raw(), cycle) != BOARD_RUNNING;
            if (r_.crashed) {
                r_.words += fmt::format("CRASHED: {}", board_complaint(board_.raw()));
            }
        }
    }

    void happen(const event &e)
    {
        if (e.what == kind::say) {
            if (e.text == "faults") {
                heard_.clear();
                asked_ = true;
            }
            const std::string line = e.text + "\n";
            board_send(board_.raw(), line.data(), line.size());
        } else if (e.what == kind::bytes) {
            std::string octets;
            for (std::size_t k = 0; k + 1 < e.text.size(); k += 2) {
                octets += static_cast<char>(std::strtoul(e.text.substr(k, 2).c_str(), nullptr, 16));
            }
            board_send(board_.raw(), octets.data(), octets.size());
        } else {
            board_.inflict(e);
        }
    }

    void look()
    {
        if (now_s() < from_s_) {
            resets_ = board_reset_count(board_.raw());
            return;
        }
        board_view_t seen{};
        bool said = !board_view(board_.raw(), "controller", &seen) || seen.locked ||
                    seen.board_fault != 0 || board_reset_count(board_.raw()) != resets_;
        for (const board_view_spring_t &spring : seen.spring) {
            said = said || spring.fault != 0;
        }
        said = said || heard_.find("|ambient:held>") != std::string::npos;
        if (said && !r_.said_s) {
            r_.said_s = now_s() - from_s_;
        }
        const bool off = !board_is_fed(board_.raw()) || board_duty(board_.raw(), 0) == 0.0;
        if (!off || (!r_.said_s && seen.spring[0].level_permille == 0)) {
            r_.off_s.reset();
        } else if (!r_.off_s && now_s() < again_s_) {
            r_.off_s = now_s() - from_s_;
        }
        if (trace_ && now_s() - from_s_ >= traced_s_) {
            traced_s_++;
            trace(seen);
        }
        double &hottest_c = now_s() < again_s_ ? r_.hottest_c : r_.cleared_c;
        for (unsigned k = 0; k < SPRINGS; ++k) {
            const double c = truth_hottest_c(board_.truth(), k);
            hottest_c = std::fmax(hottest_c, c);
            r_.peak_c[k] = std::fmax(r_.peak_c[k], c);
            if (!r_.said_s) {
                r_.unsaid_c[k] = std::fmax(r_.unsaid_c[k], c);
            }
        }
        if (asked_ && now_s() > again_s_ - 0.1) {
            asked_ = false;
            r_.words = words();
        }
        if (now_s() < again_s_) {
            off_at_clear_ = r_.off_s;
        } else {
            r_.off_s = off_at_clear_;
        }
    }

    void trace(const board_view_t &seen) const
    {
        fmt::print(stderr, "{:5.1f} s:", now_s() - from_s_);
        for (unsigned k = 0; k < SPRINGS; ++k) {
            const board_view_spring_t &s = seen.spring[k];
            fmt::print(stderr, " {:.0f}/{} degC {} mA f{}", truth_hottest_c(board_.truth(), k),
                       s.temperature_c7 / 128, s.measured_ma, s.fault);
        }
        fmt::print(stderr, "\n");
    }

    std::string words() const
    {
        std::string text;
        for (const char c : heard_) {
            text += c == '\n' ? '/' : c;
        }
        text.erase(std::remove(text.begin(), text.end(), '\r'), text.end());
        text = std::regex_replace(text, std::regex("<[^/]*/"), "");
        return text;
    }

    double from_s_ = 0.0, again_s_ = 0.0;
    scenario scenario_;
    bool trace_;
    unsigned traced_s_ = 0;
    std::string heard_;
    faulty_board board_;
    result r_;
    unsigned resets_ = 0;
    bool asked_ = false;
    std::optional<double> off_at_clear_;
};

std::string seconds(const std::optional<double> &s)
{
    return s ? fmt::format("{:.2f}", *s) : "-";
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App app{"One fault at a time: how hot, how soon safe, how soon said."};
    session all;
    std::string json, only;
    std::vector<std::string> phases{"heats", "holds", "off"};
    app.add_option("--elf", all.elf)->capture_default_str();
    app.add_option("--seed", all.seed, "of the array")->capture_default_str();
    app.add_option("--freewheel", all.freewheel_v, "V that the diodes drop, and nobody declares")
        ->capture_default_str();
    app.add_option("--later", all.later_s, "s after the usual moment of a phase")
        ->capture_default_str();
    app.add_option("--pattern", all.pattern, "what is driven")->capture_default_str();
    app.add_option("--first", all.first, "lines that are typed before it");
    app.add_option("--only", only, "faults in whose names this is (a regular expression)");
    app.add_option("--phase", phases, "heats, holds, off: what the board does as it happens");
    app.add_flag("--trace", all.trace, "each second of each spring, on stderr: true and believed");
    app.add_option("--json", json, "the figures, for programs");
    CLI11_PARSE(app, argc, argv);
    nlohmann::json figures = nlohmann::json::array();
    fmt::print("phase | fault | hottest | cleared 3 times | hotter unsaid by K | safe s | said s | "
               "said\n");
    for (const std::string &phase : phases) {
        const result without = trial(catalogue()[0], phase, all).run();
        for (const injected &one : catalogue()) {
            if (!std::regex_search(one.name, std::regex(only))) {
                continue;
            }
            const result r = trial(one, phase, all).run();
            double unsaid_k = 0.0;
            for (unsigned k = 0; k < SPRINGS; ++k) {
                unsaid_k = std::fmax(unsaid_k, r.unsaid_c[k] - without.peak_c[k]);
            }
            fmt::print("{} | {} | {:.1f}{} | {:.1f}{} | {:.1f}{} | {} | {} | {}\n", phase, one.name,
                       r.hottest_c, r.hottest_c > 120.0 ? " !" : "", r.cleared_c,
                       r.cleared_c > 120.0 ? " !" : "", unsaid_k, unsaid_k > HOTTER_K ? " !" : "",
                       seconds(r.off_s), seconds(r.said_s), r.words);
            std::fflush(stdout);
            figures.push_back({{"figure", phase + ": " + one.name + ": hottest"},
                               {"value", std::max(r.hottest_c, r.cleared_c)},
                               {"unit", "degC"},
                               {"target", "<= 120"},
                               {"command", fmt::format("bench_faults --seed {}", all.seed)}});
        }
    }
    if (!json.empty()) {
        std::ofstream(json) << figures.dump(1) << '\n';
    }
    return 0;
}
