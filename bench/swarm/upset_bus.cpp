#include "upset_bus.hpp"

#include <algorithm>
#include <cmath>

namespace swarm
{

namespace
{

constexpr unsigned CURRENT = 1, VOLTAGE = 2;
constexpr double A_OF_BIT = 1e-4, V_OF_BIT = 4e-3;
constexpr double BURST_EVERY_S = 3.0, BURST_S = 0.2;
constexpr double SHUNT_END = 32000.0, BUS_END = 4000.0;

std::uint16_t current_register(double current_a)
{
    const double bits = std::clamp(current_a / A_OF_BIT, -SHUNT_END, SHUNT_END);
    return static_cast<std::uint16_t>(static_cast<std::int16_t>(std::lround(bits)));
}

/* Its lowest bits say whether it is ready. */
std::uint16_t voltage_register(double voltage_v, std::uint16_t was)
{
    const double bits = std::clamp(voltage_v / V_OF_BIT, 0.0, BUS_END);
    return static_cast<std::uint16_t>(static_cast<unsigned>(std::lround(bits)) << 3 | (was & 7u));
}

} // namespace

board_bus_t upset_bus::hooks()
{
    return {this,
            [](void *context, unsigned channel) {
                return static_cast<upset_bus *>(context)->acknowledges(channel);
            },
            [](void *context, unsigned channel, unsigned number, std::uint16_t value) {
                return static_cast<upset_bus *>(context)->reads(channel, number, value);
            }};
}

void upset_bus::set(lie what, unsigned channel, double value)
{
    value_[static_cast<std::size_t>(what)][channel] = value;
    since_s_[channel] = board_time_s(board_);
}

bool upset_bus::one_in(double n)
{
    return n > 0.0 && random_uniform(&dice_, 0.0, n) < 1.0;
}

bool upset_bus::acknowledges(unsigned k)
{
    for (unsigned j = 0; j < BOARD_CHANNELS; ++j) {
        if (of(lie::answers_too, j) == k + 1.0) {
            return false; /* it answers there */
        }
    }
    return !one_in(of(lie::nacks, k));
}

double upset_bus::minutes(unsigned k) const
{
    return (board_time_s(board_) - since_s_[k]) / 60.0;
}

double upset_bus::lied_a(unsigned k, double current_a) const
{
    const double lied_a = current_a * (1.0 + of(lie::drifts, k) * minutes(k)) +
                          of(lie::creeps, k) * minutes(k) + of(lie::offset, k);
    const double end_a = of(lie::saturates, k);
    return end_a > 0.0 ? std::clamp(lied_a, -end_a, end_a) : lied_a;
}

/* Of a current the last bit that the program keeps: 1 mA. */
std::uint16_t upset_bus::repeated(unsigned k, unsigned number, std::uint16_t value)
{
    past &was = past_[k][number - 1u];
    const double how = of(lie::repeats, k);
    if (how == 4.0) {
        was.at = (was.at + 1) % SECOND;
        return was.values[was.at];
    }
    if (how == 0.0 || how == (number == CURRENT ? 3.0 : 2.0)) {
        was.at = (was.at + 1) % SECOND;
        was.values[was.at] = value;
        return value;
    }
    const int bit = static_cast<int>(random_bits(&dice_) % 3u) - 1;
    return static_cast<std::uint16_t>(was.values[was.at] + bit * (number == CURRENT ? 10 : 8));
}

double upset_bus::lagging(unsigned k, unsigned number, double value)
{
    past &was = past_[k][number - 1u];
    const double now_s = board_time_s(board_), tau_s = of(lie::lags, k);
    const double kept = tau_s > 0.0 ? std::exp((was.then_s - now_s) / tau_s) : 0.0;
    was.lagging = kept > 0.0 ? value + kept * (was.lagging - value) : value;
    was.then_s = now_s;
    return was.lagging;
}

std::uint16_t upset_bus::reads(unsigned k, unsigned number, std::uint16_t value)
{
    double noise = of(lie::noisy, k);
    if (of(lie::bursts, k) > 0.0 && std::fmod(board_time_s(board_), BURST_EVERY_S) < BURST_S) {
        noise = of(lie::bursts, k);
    }
    const auto shows = [&](unsigned other, unsigned what) {
        return board_sensor_register(board_, other, what);
    };
    if (number == CURRENT) {
        const double read_a = A_OF_BIT * static_cast<std::int16_t>(value);
        double heard_a = read_a;
        if (of(lie::hears, k) != 0.0) {
            heard_a += of(lie::hears, k) * A_OF_BIT *
                       static_cast<std::int16_t>(shows((k + 1u) % BOARD_CHANNELS, CURRENT));
        }
        const double lied = lied_a(k, lagging(k, CURRENT, heard_a)) + noise * random_noise(&dice_);
        value = lied == read_a ? value : current_register(lied);
    } else if (number == VOLTAGE) {
        if (of(lie::voltage_of, k) > 0.0) {
            value = static_cast<std::uint16_t>(
                (shows(static_cast<unsigned>(of(lie::voltage_of, k)) - 1u, VOLTAGE) & ~7u) |
                (value & 7u));
        }
        const double late_v = lagging(k, VOLTAGE, V_OF_BIT * (value >> 3));
        value = of(lie::lags, k) > 0.0 ? voltage_register(late_v, value) : value;
        const double drifted_v = of(lie::volt_drifts, k) * minutes(k) * V_OF_BIT * (value >> 3);
        const double lift_v = drifted_v + of(lie::lifted, k) + noise * random_noise(&dice_);
        value = lift_v == 0.0 ? value : voltage_register(V_OF_BIT * (value >> 3) + lift_v, value);
    }
    if (number == CURRENT || number == VOLTAGE) {
        value = repeated(k, number, value);
    }
    const double bit = std::fabs(of(lie::stuck_bit, k));
    if (bit > 0.0 && number == (bit <= 16.0 ? CURRENT : VOLTAGE)) {
        const auto mask =
            static_cast<std::uint16_t>(1u << (static_cast<unsigned>(bit - 1.0) % 16u));
        value =
            static_cast<std::uint16_t>(of(lie::stuck_bit, k) > 0.0 ? value | mask : value & ~mask);
    }
    if (of(lie::answers_too, k) > 0.0) { /* a low bit of either pulls the line down */
        value &= board_sensor_register(board_, static_cast<unsigned>(of(lie::answers_too, k)) - 1u,
                                       number);
    }
    if (one_in(of(lie::garbled, k))) {
        value ^= static_cast<std::uint16_t>(1u << (random_bits(&dice_) % 16u));
    }
    return value;
}

} // namespace swarm
