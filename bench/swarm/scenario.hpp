/* What it is for: one life of a board: an array, a user, and what goes wrong, as events in time.
 * What it owns: how they are drawn from a seed, and their text: what a failing seed leaves behind.
 * What it never does: run anything, or judge. */
#ifndef SWARM_SCENARIO_HPP
#define SWARM_SCENARIO_HPP

#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

namespace swarm
{

/* Names are those of the text. on: begins or ends what lasts. */
enum class kind {
    say,         /* text: a line; sent when the one before has been answered */
    bytes,       /* text: octets in hex, sent at once, whatever they are */
    open,        /* channel, on: a spring is broken */
    shorted,     /* channel, on: its ends are connected */
    closed,      /* channel, on: its switch has failed closed */
    absent,      /* channel, on: a sensor does not acknowledge */
    stale,       /* channel, on: it converts no more and says so */
    frozen,      /* channel, on: it shows the same for ever; value 1, 2: one register alone */
    scaled,      /* channel, value: it shows so many times the current; 1 ends it */
    swapped,     /* channel, value: it and another change their places */
    unset,       /* channel: it loses its configuration */
    sda,         /* on: the bus hangs */
    worn,        /* on: the EEPROM keeps nothing */
    torn,        /* value: a byte of the EEPROM is another one */
    power,       /* value ms without power, to the cycle */
    brown_out,   /* a reset */
    button,      /* a reset, as by a serial port that is opened */
    hang,        /* the program stays where it is until the watchdog bites */
    crystal,     /* stands still; a power cut ends it */
    enable_low,  /* on: the cut-off's pin is shorted to ground */
    enable_high, /* on: to 5 V */
    fan_stops,   /* on */
    interrupt,   /* value: a vector that nobody asked for */
    flip,        /* value: a register or a byte of RAM; channel: which bit */
    stress,      /* channel, value MPa: a finger */
    supply,      /* value V: sags and comes back */
    ambient,     /* value degC: the room */
    /* the circuit (truth_upset_t) */
    leaks,         /* channel, value A: through a switch that is off */
    slow_switch,   /* channel, value share of the period: on later (below 0), or off later */
    welds_hot,     /* channel, value degC: its switch, as its spring gets there */
    diode_open,    /* channel */
    bridged,       /* channel, value: another spring that it touches */
    warm_contact,  /* channel, value ohm for each 100 K */
    chatters,      /* channel, value Hz: its crimp */
    ground,        /* value ohm that all currents lift */
    ripple,        /* value share of the supply; channel: how fast */
    clock,         /* value: the world's seconds in one of the board's */
    gates_swapped, /* channel, value: another one */
    thermistor,    /* value V */
    /* sensors that answer (lie) */
    creeps,      /* channel, value A a minute */
    volt_drifts, /* channel, value share a minute */
    volt_scaled, /* channel, value: it shows so many times the voltage */
    stuck_bit,   /* channel, value */
    drifts,      /* channel, value share a minute */
    saturates,   /* channel, value A */
    offset,      /* channel, value A */
    lifted,      /* channel, value V */
    bursts,      /* channel, value A and V of noise, now and then */
    nacks,       /* channel, value: one in so many */
    garbled,     /* channel, value: one in so many */
    answers_too, /* channel, value 1..9: whose sensor has its address */
    slow_bus,    /* value: times as slow */
    repeats,     /* channel, value: what it showed before, but for the last bit (lie::repeats) */
    hears,       /* channel, value: share of the next one's current that it shows beside its own */
    voltage_of,  /* channel, value 1..9: whose voltage it shows */
    lags,        /* channel, value s */
    noisy,       /* channel, value A and V, at any time */
    /* the circuit once more */
    gates_joined, /* channel, value: another one; either is on where one of them would be */
    no_inductor,  /* channel */
    weak_supply,  /* value A that it gives at most */
    count
};

const char *name_of(kind what);

struct event {
    double at_s;
    kind what;
    unsigned channel = 0;
    bool on = true;
    double value = 0.0;
    std::string text;
};

struct scenario {
    std::uint64_t seed = 0;
    double duration_s = 0.0;
    double tolerance = 0.0; /* of the array */
    double ambient_c = 20.0;
    double freewheel_v = 0.0;  /* what the diodes drop; 0: synchronous */
    std::vector<event> events; /* by time */
};

/* Everything at once from one seed: an array, a user, one to three faults. */
scenario draw(std::uint64_t seed);
/* A line an event; read(write(s)) is s. read fails (std::runtime_error, which names the line) where
 * a line is none. */
void write(std::ostream &out, const scenario &one);
scenario read(std::istream &in);

} // namespace swarm
#endif
