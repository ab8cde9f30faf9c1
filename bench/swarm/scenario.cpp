#include "scenario.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <istream>
#include <iterator>
#include <ostream>
#include <sstream>
#include <stdexcept>

#include "random.h"

namespace swarm
{

namespace
{

constexpr std::array<const char *, static_cast<std::size_t>(kind::count)> names = {
    "say",        "bytes",         "open",         "shorted",      "closed",      "absent",
    "stale",      "frozen",        "scaled",       "swapped",      "unset",       "sda",
    "worn",       "torn",          "power",        "brown_out",    "button",      "hang",
    "crystal",    "enable_low",    "enable_high",  "fan_stops",    "interrupt",   "flip",
    "stress",     "supply",        "ambient",      "leaks",        "slow_switch", "welds_hot",
    "diode_open", "bridged",       "warm_contact", "chatters",     "ground",      "ripple",
    "clock",      "gates_swapped", "thermistor",   "creeps",       "volt_drifts", "volt_scaled",
    "stuck_bit",  "drifts",        "saturates",    "offset",       "lifted",      "bursts",
    "nacks",      "garbled",       "answers_too",  "slow_bus",     "repeats",     "hears",
    "voltage_of", "lags",          "noisy",        "gates_joined", "no_inductor", "weak_supply"};

class dice
{
public:
    explicit dice(std::uint64_t seed, std::uint64_t stream = 29)
        : state_(random_seeded(seed, stream))
    {
    }
    double uniform(double low, double high) { return random_uniform(&state_, low, high); }
    unsigned below(unsigned limit) { return static_cast<unsigned>(random_bits(&state_) % limit); }
    bool chance(double share) { return uniform(0.0, 1.0) < share; }
    unsigned spring() { return below(9); }

private:
    random_t state_;
};

/* A user: patterns most of all, now and then a setting, a look, something silly. */
std::string line(dice &d)
{
    static const char *const looks[] = {"model", "faults", "version", "learnt", "help", "?", "$$"};
    static const char *const settings[] = {"$boost_current_a=2.5",
                                           "$boost_current_a=3.0",
                                           "$temperature_limit_c=100",
                                           "$temperature_limit_c=110",
                                           "$temperature_trip_c=60",
                                           "$temperature_trip_c=130",
                                           "$supply_limit_a=8",
                                           "$supply_limit_a=15",
                                           "$maximum_on_s=5",
                                           "$maximum_on_s=0",
                                           "$host_timeout_s=5",
                                           "$host_timeout_s=0",
                                           "$loss_w_per_k=0.0060",
                                           "$loss_w_per_k=0.0058",
                                           "$loss_scale_3=1.05",
                                           "$fault_bad_samples=3",
                                           "$fault_bad_samples=5",
                                           "$nonsense=1",
                                           "$supply_v=99",
                                           "$cut_off=1",
                                           "$defaults",
                                           "$heat_capacity_scale_9=0.9"};
    static const char *const silly[] = {"on 10", "on 0 50", "pattern 12", "fan 101",  "on all 200",
                                        "",      "ambient", "selftest x", "clear now"};
    const double what = d.uniform(0.0, 1.0);
    if (what < 0.30) {
        std::string pattern = "pattern ";
        for (unsigned k = 0; k < 9; ++k) {
            pattern += d.chance(0.6) ? '1' : '0';
        }
        return pattern;
    }
    const std::string spring = std::to_string(d.spring() + 1);
    if (what < 0.42) {
        return "on " + spring + (d.chance(0.5) ? "" : " " + std::to_string(d.below(101)));
    }
    if (what < 0.50) {
        return d.chance(0.2) ? "off all" : "off " + spring;
    }
    if (what < 0.56) {
        return d.chance(0.5) ? "policy open" : "policy precompensate";
    }
    if (what < 0.66) {
        return settings[d.below(sizeof settings / sizeof settings[0])];
    }
    if (what < 0.71) {
        return "$save";
    }
    if (what < 0.84) {
        static const char *const again[] = {"clear", "unlock",     "supply on",
                                            "clear", "supply off", "learnt clear"};
        return again[d.below(6)];
    }
    if (what < 0.88) {
        return "telemetry " + std::string(d.chance(0.5) ? "csv " : "teleplot ") +
               std::to_string(1 + d.below(50));
    }
    if (what < 0.90) {
        return "telemetry off";
    }
    if (what < 0.92) {
        return "fan " + std::to_string(d.below(101));
    }
    if (what < 0.93) {
        return "selftest";
    }
    return what < 0.97 ? looks[d.below(7)] : silly[d.below(9)];
}

std::string hex(dice &d, unsigned count)
{
    static const char digits[] = "0123456789abcdef";
    std::string text;
    for (unsigned k = 0; k < 2 * count; ++k) {
        text += digits[d.below(16)];
    }
    return text;
}

double logarithmic(dice &d, double low, double high)
{
    return std::exp(d.uniform(std::log(low), std::log(high)));
}

double either_way(dice &d, double size)
{
    return d.chance(0.5) ? size : -size;
}

/* Of what a circuit or a sensor may have, how much; NAN where that is no number. */
double amount(dice &d, kind what, unsigned channel)
{
    const double other = (channel + 1 + d.below(8)) % 9;
    switch (what) {
    case kind::leaks:
        return logarithmic(d, 0.02, 1.5);
    case kind::slow_switch:
        return either_way(d, logarithmic(d, 0.005, 0.2));
    case kind::welds_hot:
        return d.uniform(40.0, 100.0);
    case kind::bridged:
    case kind::gates_swapped:
        return other;
    case kind::answers_too:
        return other + 1.0;
    case kind::warm_contact:
        return logarithmic(d, 0.01, 0.3);
    case kind::chatters:
        return logarithmic(d, 0.3, 20.0);
    case kind::ground:
        return logarithmic(d, 0.001, 0.03);
    case kind::ripple:
        return d.uniform(0.02, 0.2);
    case kind::clock:
        return d.uniform(0.98, 1.02);
    case kind::thermistor:
        return d.uniform(0.0, 5.0);
    case kind::volt_scaled:
        return d.uniform(0.3, 2.0);
    case kind::stuck_bit:
        return either_way(d, 1.0 + d.below(32));
    case kind::creeps:
    case kind::volt_drifts:
    case kind::drifts:
        return either_way(d, logarithmic(d, 0.01, 1.0));
    case kind::saturates:
        return d.uniform(0.3, 3.2);
    case kind::offset:
        return either_way(d, logarithmic(d, 0.005, 0.4));
    case kind::lifted:
        return either_way(d, logarithmic(d, 0.005, 0.3));
    case kind::bursts:
        return logarithmic(d, 0.02, 2.0);
    case kind::nacks:
    case kind::garbled:
        return logarithmic(d, 2.0, 300.0);
    case kind::slow_bus:
        return logarithmic(d, 1.5, 30.0);
    default:
        return NAN;
    }
}

/* Or it comes and goes. */
void pulse(dice &d, scenario &s, event one)
{
    const double period_s = logarithmic(d, 0.08, 3.0), lasts_s = period_s * d.uniform(0.05, 0.8);
    for (unsigned n = 5 + d.below(40); n > 0; --n) {
        one.on = true;
        s.events.push_back(one);
        one.on = false;
        one.at_s += lasts_s;
        s.events.push_back(one);
        one.at_s += period_s - lasts_s;
    }
}

/* What lasts ends again, sooner or later, in three of four cases. */
void last(dice &d, scenario &s, const event &one)
{
    if (d.chance(0.15)) {
        pulse(d, s, one);
        return;
    }
    s.events.push_back(one);
    if (d.chance(0.75)) {
        event end = one;
        end.at_s += std::exp(d.uniform(std::log(0.02), std::log(20.0)));
        end.on = false;
        s.events.push_back(end);
    }
}

void fault(dice &d, scenario &s)
{
    const auto what = static_cast<kind>(1 + d.below(static_cast<unsigned>(kind::slow_bus)));
    event one{d.uniform(2.0, s.duration_s), what, d.spring(), true, 0.0, ""};
    const double size = amount(d, what, one.channel);
    if (!std::isnan(size)) {
        one.value = size;
        if (what == kind::thermistor) {
            s.events.push_back({1.0, kind::say, 0, true, 0.0, "$ambient_source=1"});
        }
        if (what == kind::volt_scaled || what == kind::gates_swapped || what == kind::thermistor) {
            s.events.push_back(one); /* for good */
        } else {
            last(d, s, one);
        }
        return;
    }
    switch (what) {
    case kind::bytes:
        one.text = hex(d, 1 + d.below(300));
        s.events.push_back(one);
        break;
    case kind::frozen:
        one.value = d.below(3);
        last(d, s, one);
        break;
    case kind::scaled:
        one.value = d.uniform(0.3, 2.0);
        s.events.push_back(one);
        break;
    case kind::swapped:
        one.value = (one.channel + 1 + d.below(8)) % 9;
        s.events.push_back(one);
        break;
    case kind::torn:
        one.value = d.below(3072);
        s.events.push_back(one);
        break;
    case kind::power:
    case kind::crystal: {
        one.value = std::exp(d.uniform(std::log(20.0), std::log(5000.0)));
        s.events.push_back(one);
        if (what == kind::crystal) { /* only the power ends it */
            one.what = kind::power;
            one.at_s += d.uniform(0.5, 2.0);
            s.events.push_back(one);
        }
        break;
    }
    case kind::interrupt:
        one.value = 1 + d.below(56);
        s.events.push_back(one);
        break;
    case kind::flip:
        one.value = d.chance(0.5) ? 0x20 + d.below(0x1E0) : 0x200 + d.below(0x2000);
        one.channel = d.below(8);
        s.events.push_back(one);
        break;
    case kind::stress:
        one.value = d.uniform(0.0, 70.0);
        s.events.push_back(one);
        break;
    case kind::supply:
        one.value = d.uniform(3.0, 5.5);
        s.events.push_back(one);
        one.at_s += d.uniform(0.1, 10.0);
        one.value = 5.0;
        s.events.push_back(one);
        break;
    case kind::ambient:
        one.value = s.ambient_c + d.uniform(-3.0, 3.0);
        s.events.push_back(one);
        break;
    case kind::unset:
    case kind::brown_out:
    case kind::button:
    case kind::hang:
        s.events.push_back(one);
        break;
    case kind::open:
    case kind::shorted:
    case kind::closed:
    case kind::absent:
    case kind::stale:
    case kind::sda:
    case kind::worn:
    case kind::enable_low:
    case kind::enable_high:
    case kind::fan_stops:
    case kind::diode_open:
        last(d, s, one);
        break;
    default: /* of size 0 it would be none */
        throw std::logic_error(std::string(name_of(what)) + ": nobody draws how much of it");
    }
}

/* What came later, of dice of its own: a seed's other events stay what they were. */
void another(scenario &s)
{
    dice d(s.seed, 32);
    if (d.chance(0.7)) {
        return;
    }
    const auto first = static_cast<unsigned>(kind::slow_bus) + 1u;
    const auto what =
        static_cast<kind>(first + d.below(static_cast<unsigned>(kind::count) - first));
    const unsigned channel = d.spring(), other = (channel + 1 + d.below(8)) % 9;
    event one{d.uniform(2.0, s.duration_s), what, channel, true, 1.0, ""};
    switch (what) {
    case kind::repeats:
        one.value = 1.0 + d.below(4);
        break;
    case kind::hears:
        one.value = either_way(d, logarithmic(d, 0.01, 0.5));
        break;
    case kind::voltage_of:
        one.value = other + 1.0;
        break;
    case kind::lags:
        one.value = logarithmic(d, 0.02, 10.0);
        break;
    case kind::noisy:
        one.value = logarithmic(d, 0.002, 1.0);
        break;
    case kind::gates_joined:
        one.value = other;
        break;
    case kind::weak_supply:
        one.value = logarithmic(d, 0.3, 3.0);
        break;
    default:
        break;
    }
    last(d, s, one);
}

/* What nobody had drawn before, of dice of its own: words of every other kind, lines faster than
 * they are answered, a frame for a board that is in no loop. */
void odd_words(dice &d, scenario &s)
{
    static const char *const words[] = {"why 5",
                                        "why all",
                                        "learnt",
                                        "$supply_v",
                                        "$temperature_limit_c",
                                        "echo on",
                                        "echo off",
                                        "ON 4",
                                        "Off ALL",
                                        "on 5 40%",
                                        "telemetry inputs",
                                        "model cold",
                                        "fan 70%",
                                        "unlock",
                                        "$SAVE",
                                        "policy closed",
                                        "$sensor_averaging=16",
                                        "ambient warm",
                                        "off 3 50",
                                        "supply",
                                        "telemetry csv",
                                        "$nonsense",
                                        "$hold_margin_k=300",
                                        "selftest",
                                        "$ambient_source=1"};
    for (unsigned n = 1 + d.below(8); n > 0; --n) {
        const double at_s = d.uniform(1.0, s.duration_s), what = d.uniform(0.0, 1.0);
        if (what < 0.1) {
            std::string room = "ambient " + std::to_string(s.ambient_c + d.uniform(-3.0, 3.0));
            s.events.push_back({at_s, kind::say, 0, true, 0.0, room.substr(0, 13)});
        } else if (what < 0.2) { /* "model\n", again and again */
            std::string flood;
            for (unsigned times = 2 + d.below(40); times > 0; --times) {
                flood += "6d6f64656c0a";
            }
            s.events.push_back({at_s, kind::bytes, 0, true, 0.0, flood});
        } else if (what < 0.3) { /* '~', digits, a line's end */
            std::string frame = "7e";
            for (unsigned digits = d.below(120); digits > 0; --digits) {
                frame += std::to_string(30 + d.below(10));
            }
            s.events.push_back({at_s, kind::bytes, 0, true, 0.0, frame + "0a"});
        } else {
            s.events.push_back({at_s, kind::say, 0, true, 0.0, words[d.below(std::size(words))]});
        }
    }
}

/* Two to four faults more, that begin within one second. */
void worst_second(dice &d, scenario &s)
{
    const double second_s = d.uniform(2.0, s.duration_s - 1.0);
    for (unsigned n = 2 + d.below(3); n > 0; --n) {
        const std::size_t first = s.events.size();
        fault(d, s);
        const double at_s = second_s + d.uniform(0.0, 1.0);
        const auto began =
            std::find_if(s.events.begin() + static_cast<std::ptrdiff_t>(first), s.events.end(),
                         [](const event &e) { return e.what != kind::say; });
        const double moved_s = at_s - began->at_s;
        std::for_each(began, s.events.end(), [moved_s](event &e) { e.at_s += moved_s; });
    }
}

void hostile(scenario &s)
{
    dice d(s.seed, 33);
    if (d.chance(0.5)) {
        odd_words(d, s);
    }
    if (d.chance(0.3)) {
        worst_second(d, s);
    }
}

/* Of half of the boards; of these, half say what it drops, within 0.05 V. */
void diode(scenario &s)
{
    dice d(s.seed, 30);
    if (d.chance(0.5)) {
        return;
    }
    s.freewheel_v = d.uniform(0.30, 0.45);
    const double declared_v = s.freewheel_v + d.uniform(-0.05, 0.05);
    if (d.chance(0.5)) {
        s.events.push_back({0.65, kind::say, 0, true, 0.0,
                            "$freewheel_v=" + std::to_string(declared_v).substr(0, 5)});
    }
}

} // namespace

const char *name_of(kind what)
{
    return names[static_cast<std::size_t>(what)];
}

scenario draw(std::uint64_t seed)
{
    dice d(seed);
    scenario s;
    s.seed = seed;
    s.duration_s = std::round(d.uniform(15.0, 90.0));
    s.tolerance = d.uniform(0.0, 0.1);
    s.ambient_c = 20.0;
    s.events.push_back({0.6, kind::say, 0, true, 0.0, "model cold"});
    s.events.push_back({0.7, kind::say, 0, true, 0.0, "pattern 111101111"});
    double at_s = 1.0;
    while (at_s < s.duration_s) {
        at_s += d.chance(0.1) ? d.uniform(5.0, 20.0) /* he stalls */ : d.uniform(0.1, 4.0);
        if (d.chance(0.04)) {
            s.events.push_back({at_s, kind::bytes, 0, true, 0.0, d.chance(0.5) ? "21" : "2121"});
        } else {
            s.events.push_back({at_s, kind::say, 0, true, 0.0, line(d)});
        }
    }
    for (unsigned n = 1 + d.below(3); n > 0; --n) {
        fault(d, s);
    }
    another(s);
    hostile(s);
    diode(s);
    std::stable_sort(s.events.begin(), s.events.end(),
                     [](const event &a, const event &b) { return a.at_s < b.at_s; });
    return s;
}

void write(std::ostream &out, const scenario &one)
{
    out.precision(17);
    out << "# swarm: replay with bench_swarm --replay FILE\n";
    out << "seed " << one.seed << "\nduration_s " << one.duration_s << "\ntolerance "
        << one.tolerance << "\nambient_c " << one.ambient_c << "\nfreewheel_v " << one.freewheel_v
        << '\n';
    for (const event &e : one.events) {
        out << e.at_s << ' ' << name_of(e.what) << ' ' << e.channel << ' ' << (e.on ? 1 : 0) << ' '
            << e.value << (e.text.empty() ? "" : " ") << e.text << '\n';
    }
}

scenario read(std::istream &in)
{
    scenario s;
    std::string line_text;
    for (unsigned number = 1; std::getline(in, line_text); ++number) {
        if (line_text.empty() || line_text[0] == '#') {
            continue;
        }
        std::istringstream words(line_text);
        std::string first, second;
        words >> first;
        bool good = true;
        if (first == "seed") {
            good = static_cast<bool>(words >> s.seed);
        } else if (first == "duration_s") {
            good = static_cast<bool>(words >> s.duration_s);
        } else if (first == "tolerance") {
            good = static_cast<bool>(words >> s.tolerance);
        } else if (first == "ambient_c") {
            good = static_cast<bool>(words >> s.ambient_c);
        } else if (first == "freewheel_v") {
            good = static_cast<bool>(words >> s.freewheel_v);
        } else {
            event e{};
            std::istringstream again(line_text);
            unsigned on = 0;
            good = static_cast<bool>(again >> e.at_s >> second >> e.channel >> on >> e.value);
            e.on = on != 0;
            const auto found = std::find(names.begin(), names.end(), second);
            good = good && found != names.end() && e.channel < 9;
            e.what = static_cast<kind>(found - names.begin());
            again.get(); /* the blank */
            std::getline(again, e.text);
            s.events.push_back(e);
        }
        if (!good) {
            throw std::runtime_error("line " + std::to_string(number) + ": not an event: '" +
                                     line_text + "'; write TIME_S KIND CHANNEL ON VALUE [TEXT]");
        }
    }
    return s;
}

} // namespace swarm
