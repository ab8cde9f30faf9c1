/* What it is for: sensors that are there and answer, and whose bytes are not what they measure.
 * What it owns: what is wrong with each, and the dice of what happens now and then.
 * What it never does: change a circuit. */
#ifndef SWARM_UPSET_BUS_HPP
#define SWARM_UPSET_BUS_HPP

#include <array>
#include <cstdint>

#include "board.h"
#include "random.h"

namespace swarm
{

/* Of one sensor; 0 ends it. */
enum class lie {
    stuck_bit,   /* 1..32: 16 of the current's register, 16 of the voltage's; below 0: stuck at 0 */
    drifts,      /* its current, by this share a minute */
    creeps,      /* A beside its current, a minute */
    volt_drifts, /* its voltage, by this share a minute */
    saturates,   /* its current, at so many A */
    offset,      /* A beside its current */
    lifted,      /* V beside its voltage */
    bursts,      /* for 0.2 s in each 3 s, with noise of so many A, and V */
    nacks,       /* one in so many addresses */
    garbled,     /* one in so many registers: a bit of it is another one */
    answers_too, /* 1..9: the sensor of that number answers at this one's address, not at its own */
    repeats,     /* 1: both as they were when it began, 2: its current, 3: its voltage, each but for
                    its last bit; 4: the second before, again and again */
    hears,       /* its current and this share of the next one's */
    voltage_of,  /* 1..9: shows the voltage of that number */
    lags,        /* s: behind what it measures */
    noisy,       /* A, and V */
    count
};

class upset_bus
{
public:
    explicit upset_bus(std::uint64_t seed) : dice_(random_seeded(seed, 31)) {}
    /* The board is asked for the time and for other sensors; it must be set before bytes flow. */
    void attach(const board_t *board) { board_ = board; }
    board_bus_t hooks();
    void set(lie what, unsigned channel, double value);

private:
    double of(lie what, unsigned k) const { return value_[static_cast<std::size_t>(what)][k]; }
    bool one_in(double n);
    bool acknowledges(unsigned k);
    std::uint16_t reads(unsigned k, unsigned number, std::uint16_t value);
    double minutes(unsigned k) const;
    double lied_a(unsigned k, double current_a) const;
    std::uint16_t repeated(unsigned k, unsigned number, std::uint16_t value);
    double lagging(unsigned k, unsigned number, double value);

    const board_t *board_ = nullptr;
    random_t dice_;
    std::array<std::array<double, BOARD_CHANNELS>, static_cast<std::size_t>(lie::count)> value_{};
    std::array<double, BOARD_CHANNELS> since_s_{};
    static constexpr std::size_t SECOND = 50; /* readings */
    struct past {
        std::array<std::uint16_t, SECOND> values{};
        std::size_t at = 0;
        double lagging = 0.0, then_s = 0.0;
    };
    std::array<std::array<past, 2>, BOARD_CHANNELS> past_{}; /* of current and voltage */
};

} // namespace swarm
#endif
