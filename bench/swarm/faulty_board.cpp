#include "faulty_board.hpp"

#include <stdexcept>
#include <vector>

namespace swarm
{

namespace
{

truth_t *truth_of(const scenario &one)
{
    std::vector<truth_event_t> happens;
    for (const event &e : one.events) {
        if (e.what == kind::stress || e.what == kind::supply || e.what == kind::ambient) {
            const truth_event_kind_t what = e.what == kind::stress   ? TRUTH_STRESS
                                            : e.what == kind::supply ? TRUTH_SUPPLY
                                                                     : TRUTH_AMBIENT;
            happens.push_back({what, e.at_s, static_cast<int>(e.channel), e.value});
        }
    }
    return truth_create(one.seed, one.tolerance, one.ambient_c, happens.data(),
                        static_cast<unsigned>(happens.size()));
}

} // namespace

faulty_board::faulty_board(const scenario &one, const std::string &elf, void *context,
                           board_byte_t on_uart)
    : truth_(truth_of(one)), bus_(one.seed)
{
    truth_upset(truth_.get(), TRUTH_FREEWHEEL_V, 0, one.freewheel_v);
    const board_array_t array = truth_array(truth_.get());
    const board_bus_t bus = bus_.hooks();
    char error[512] = "";
    board_options_t options{};
    options.elf = elf.c_str();
    options.array = &array;
    options.bus = &bus;
    options.seed = one.seed;
    options.shunt_noise_v = 30e-6;
    options.bus_noise_v = 1e-3;
    options.context = context;
    options.on_uart = on_uart;
    board_.reset(board_create(&options, error, sizeof error));
    if (board_ == nullptr) {
        throw std::runtime_error(error);
    }
    bus_.attach(raw());
}

void faulty_board::fault(board_fault_t which, const event &e)
{
    board_set_fault(raw(), which, e.channel, e.on);
}

void faulty_board::inflict(const event &e)
{
    inflict_on_circuit(e);
    inflict_on_sensor(e);
    inflict_on_program(e);
}

void faulty_board::inflict_on_circuit(const event &e)
{
    const double value = e.on ? e.value : 0.0;
    const auto upset = [&](truth_upset_t what, double to) {
        truth_upset(truth_.get(), what, e.channel, to);
    };
    switch (e.what) {
    case kind::open:
        return fault(BOARD_FAULT_OPEN, e);
    case kind::shorted:
        return fault(BOARD_FAULT_SHORT, e);
    case kind::closed:
        return fault(BOARD_FAULT_CLOSED, e);
    case kind::enable_low:
        return fault(BOARD_FAULT_ENABLE_LOW, e);
    case kind::enable_high:
        return fault(BOARD_FAULT_ENABLE_HIGH, e);
    case kind::fan_stops:
        return fault(BOARD_FAULT_FAN, e);
    case kind::leaks:
        return upset(TRUTH_LEAK_A, value);
    case kind::slow_switch:
        return upset(TRUTH_SLOW_SHARE, value);
    case kind::welds_hot:
        return upset(TRUTH_WELDS_AT_C, value);
    case kind::diode_open:
        return upset(TRUTH_DIODE_OPEN, e.on ? 1.0 : 0.0);
    case kind::bridged:
        return upset(TRUTH_BRIDGE, e.on ? e.value : -1.0);
    case kind::gates_joined:
        return upset(TRUTH_GATES_JOINED, e.on ? e.value : -1.0);
    case kind::no_inductor:
        return upset(TRUTH_NO_INDUCTOR, e.on ? 1.0 : 0.0);
    case kind::weak_supply:
        return upset(TRUTH_WEAK_A, value);
    case kind::warm_contact:
        return upset(TRUTH_CONTACT_OHM, value);
    case kind::chatters:
        return upset(TRUTH_CHATTER_HZ, value);
    case kind::ground:
        return upset(TRUTH_GROUND_OHM, value);
    case kind::ripple: { /* of 0.2 to 50 Hz, by the channel */
        static const double hz[] = {0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 25.0, 50.0};
        upset(TRUTH_RIPPLE_HZ, hz[e.channel % 9u]);
        return upset(TRUTH_RIPPLE_SHARE, value);
    }
    case kind::clock:
        return upset(TRUTH_CLOCK, value);
    case kind::gates_swapped:
        return board_swap_gates(raw(), e.channel, static_cast<unsigned>(e.value));
    case kind::thermistor:
        return board_set_analog_v(raw(), 0, e.value);
    default:
        return;
    }
}

void faulty_board::inflict_on_sensor(const event &e)
{
    const auto lies = [&](lie what) { bus_.set(what, e.channel, e.on ? e.value : 0.0); };
    switch (e.what) {
    case kind::absent:
        return fault(BOARD_FAULT_NACK, e);
    case kind::stale:
        return fault(BOARD_FAULT_STALE, e);
    case kind::frozen:
        return fault(e.value < 0.5   ? BOARD_FAULT_FREEZE
                     : e.value < 1.5 ? BOARD_FAULT_FREEZE_CURRENT
                                     : BOARD_FAULT_FREEZE_VOLTAGE,
                     e);
    case kind::scaled:
        return board_scale_sensor(raw(), e.channel, e.value, 1.0);
    case kind::volt_scaled:
        return board_scale_sensor(raw(), e.channel, 1.0, e.value);
    case kind::swapped:
        return board_swap_sensors(raw(), e.channel, static_cast<unsigned>(e.value));
    case kind::unset:
        return board_reset_sensor(raw(), e.channel);
    case kind::sda:
        return fault(BOARD_FAULT_SDA_LOW, e);
    case kind::slow_bus:
        return board_stretch_bus(raw(), e.on ? e.value : 1.0);
    case kind::stuck_bit:
        return lies(lie::stuck_bit);
    case kind::drifts:
        return lies(lie::drifts);
    case kind::creeps:
        return lies(lie::creeps);
    case kind::volt_drifts:
        return lies(lie::volt_drifts);
    case kind::saturates:
        return lies(lie::saturates);
    case kind::offset:
        return lies(lie::offset);
    case kind::lifted:
        return lies(lie::lifted);
    case kind::bursts:
        return lies(lie::bursts);
    case kind::nacks:
        return lies(lie::nacks);
    case kind::garbled:
        return lies(lie::garbled);
    case kind::answers_too:
        return lies(lie::answers_too);
    case kind::repeats:
        return lies(lie::repeats);
    case kind::hears:
        return lies(lie::hears);
    case kind::voltage_of:
        return lies(lie::voltage_of);
    case kind::lags:
        return lies(lie::lags);
    case kind::noisy:
        return lies(lie::noisy);
    default:
        return;
    }
}

void faulty_board::inflict_on_program(const event &e)
{
    switch (e.what) {
    case kind::worn:
        return fault(BOARD_FAULT_EEPROM, e);
    case kind::torn:
        board_eeprom(raw())[static_cast<unsigned>(e.value)] ^= 0x5Au;
        return;
    case kind::power:
        return board_reset(raw(), BOARD_RESET_POWER_ON);
    case kind::brown_out:
        return board_reset(raw(), BOARD_RESET_BROWN_OUT);
    case kind::button:
        return board_reset(raw(), BOARD_RESET_EXTERNAL);
    case kind::hang:
        return board_hang(raw());
    case kind::crystal:
        return board_stop_oscillator(raw());
    case kind::interrupt:
        (void)board_raise_interrupt(raw(), static_cast<unsigned>(e.value));
        return;
    case kind::flip:
        return board_flip(raw(), static_cast<unsigned>(e.value),
                          static_cast<std::uint8_t>(1u << e.channel));
    default:
        return;
    }
}

} // namespace swarm
