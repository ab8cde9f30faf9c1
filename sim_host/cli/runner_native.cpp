#include "runner.h"

#include <cmath>
#include <fmt/format.h>

#include "boards.h"
#include "electrics.h"
#include "scenario_plant.h"

namespace ninespring
{

namespace
{

struct boards_deleter {
    void operator()(boards_t *boards) const { boards_destroy(boards); }
};

/* A spring of the array, where it is connected. */
struct place {
    loop_t *loop;
    std::uint8_t spring;
};

class native_runner : public runner
{
public:
    explicit native_runner(const runner_request &request)
    {
        loop_options_t options{};
        loop_options_default(&options);
        options.shunt_noise_v = request.plan->noise_current_a * ELECTRICS_INA219_SHUNT_OHM;
        options.bus_noise_v = request.plan->noise_voltage_v;
        std::vector<controller_settings_t> settings;
        for (const settings_t &one : *request.settings) {
            settings.push_back(one.controller);
        }
        const scenario &plan = *request.plan;
        std::uint16_t bad = UINT16_MAX;
        int refused = 0;
        boards_.reset(boards_create(settings.data(), request.plant, plan.board_rows,
                                    plan.board_cols, &options, plan.seed, &refused, &bad));
        if (boards_ == nullptr) {
            throw input_error(
                plan.name, 0, 0,
                bad == UINT16_MAX
                    ? "the loop cannot be made from this plant and these settings"
                    : fmt::format("the chip refuses {}; set it in [chip]", setting_name(bad)));
        }
        place_.resize(static_cast<std::size_t>(plan.springs()));
        for (int k = 0; k < boards_of(boards_.get()); ++k) {
            loop_t *loop = boards_loop(boards_.get(), k);
            const boards_part_t part =
                boards_part(plan.rows, plan.cols, plan.board_rows, plan.board_cols, k);
            for (int i = 0; i < part.rows * part.columns; ++i) {
                const int spring =
                    (part.row + i / part.columns) * plan.cols + part.column + i % part.columns;
                place_[static_cast<std::size_t>(spring)] = {loop, static_cast<std::uint8_t>(i)};
            }
            loops_.push_back(loop);
            controller_set_temperature(
                loop_controller(loop),
                static_cast<std::int16_t>(std::lround(plant_ambient_c(request.plant) * 128.0)));
        }
    }

    void act(const scenario_event &event) override
    {
        switch (event.word) {
        case scenario_word::on:
        case scenario_word::off:
            for (const int k : event.springs) {
                set_level(k, event.word == scenario_word::on ? event.amount * 10.0 : 0.0);
            }
            return;
        case scenario_word::pattern:
            for (std::size_t k = 0; k < event.pattern.size(); ++k) {
                set_level(static_cast<int>(k), event.pattern[k] ? 1000.0 : 0.0);
            }
            return;
        case scenario_word::set:
            set_plant(boards_plant(boards_.get()), event);
            return;
        case scenario_word::fail:
        case scenario_word::repair:
            fail(event);
            return;
        default: /* what is said to a board is said to all */
            for (loop_t *loop : loops_) {
                tell(loop, event);
            }
            return;
        }
    }

    void tick() override { boards_tick(boards_.get()); }

    [[nodiscard]] runner_spring spring(int k) const override
    {
        const place &at = place_[static_cast<std::size_t>(k)];
        const controller_t *controller = loop_controller(at.loop);
        return {controller_measured_ma(controller, at.spring) / 1000.0,
                controller_measured_mv(controller, at.spring) / 1000.0,
                controller_target_ma(controller, at.spring) / 1000.0,
                controller_temperature_c7(controller, at.spring) / 128.0,
                controller_austenite_permille(controller, at.spring) / 1000.0,
                controller_limits(controller, at.spring),
                controller_cut_ma(controller, at.spring) / 1000.0,
                safety_fault_name(controller_fault(controller, at.spring))};
    }

    [[nodiscard]] double fan() const override
    {
        return controller_fan_percent(loop_controller(loops_[0])) / 100.0;
    }

    [[nodiscard]] double ambient_c() const override
    {
        return loop_inputs(loops_[0])->ambient_c7 / 128.0;
    }

    /* Of the first board that has one. */
    [[nodiscard]] std::string board_fault() const override
    {
        for (loop_t *loop : loops_) {
            const safety_fault_t fault = controller_board_fault(loop_controller(loop));
            if (fault != SAFETY_FAULT_NONE) {
                return safety_fault_name(fault);
            }
        }
        return safety_fault_name(SAFETY_FAULT_NONE);
    }

    [[nodiscard]] const plant_t *plant() const override { return boards_plant(boards_.get()); }

private:
    void set_level(int spring, double permille)
    {
        const place &at = place_[static_cast<std::size_t>(spring)];
        controller_set_target(loop_controller(at.loop), at.spring,
                              static_cast<std::uint16_t>(std::lround(permille)));
    }

    /* As the console's word does. */
    static void tell_cold(controller_t *controller, std::int16_t ambient_c7)
    {
        for (std::uint8_t k = 0; k < controller_springs(controller); ++k) {
            if (controller_level_permille(controller, k) != 0) {
                return; /* it answers error:16 */
            }
        }
        controller_set_temperature(controller, ambient_c7);
    }

    static void tell(loop_t *loop, const scenario_event &event)
    {
        controller_t *controller = loop_controller(loop);
        switch (event.word) {
        case scenario_word::policy:
            if (!controller_set_policy(controller, event.text == "policy open"
                                                       ? DRIVE_POLICY_OPEN
                                                       : DRIVE_POLICY_PRECOMPENSATE)) {
                throw event.place.error("this version has no policy precompensate; use open");
            }
            return;
        case scenario_word::fan:
            controller_set_fan(controller, static_cast<std::uint8_t>(std::lround(event.amount)));
            return;
        case scenario_word::room:
            if (!loop_set_ambient(loop, event.amount)) {
                throw event.place.error("the plant refuses this temperature");
            }
            return;
        case scenario_word::ambient:
            loop_tell_ambient(loop, event.amount);
            return;
        case scenario_word::clear:
            controller_clear_faults(controller);
            return;
        case scenario_word::unlock:
            controller_unlock(controller);
            return;
        case scenario_word::stop:
            controller_emergency_stop(controller);
            return;
        case scenario_word::console:
            if (event.text == "model cold") {
                tell_cold(controller, loop_inputs(loop)->ambient_c7);
                return;
            }
            if (event.text == "supply on" || event.text == "supply off") {
                (void)controller_set_supply(controller, event.text == "supply on");
                return;
            }
            throw event.place.error(
                fmt::format("{} needs a console; run with --board avr", in_quotes(event.text)));
        default:
            return;
        }
    }

    void fail(const scenario_event &event)
    {
        const bool good = event.word == scenario_word::repair;
        const place at = event.springs.empty() ? place{nullptr, 0}
                                               : place_[static_cast<std::size_t>(event.springs[0])];
        loop_action_t action = LOOP_ACTION_SENSOR_GOOD;
        switch (event.what) {
        case scenario_failure::open:
            action = good ? LOOP_ACTION_SPRING_GOOD : LOOP_ACTION_OPEN_SPRING;
            break;
        case scenario_failure::short_circuit:
            action = good ? LOOP_ACTION_SPRING_GOOD : LOOP_ACTION_SHORT_SPRING;
            break;
        case scenario_failure::closed:
            action = good ? LOOP_ACTION_SWITCH_GOOD : LOOP_ACTION_SWITCH_CLOSED;
            break;
        case scenario_failure::nack:
            action = good ? LOOP_ACTION_SENSOR_GOOD : LOOP_ACTION_SENSOR_NACK;
            break;
        case scenario_failure::stale:
            action = good ? LOOP_ACTION_SENSOR_GOOD : LOOP_ACTION_SENSOR_STALE;
            break;
        case scenario_failure::freeze:
            action = good ? LOOP_ACTION_SENSOR_GOOD : LOOP_ACTION_SENSOR_FREEZE;
            break;
        case scenario_failure::lie:
            loop_scale_sensor(at.loop, at.spring, good ? 1.0 : event.amount,
                              good ? 1.0 : event.voltage_amount);
            return;
        case scenario_failure::swap: {
            const place &other = place_[static_cast<std::size_t>(event.springs[1])];
            if (other.loop != at.loop) {
                throw event.place.error("these springs are on two boards");
            }
            loop_swap_sensors(at.loop, at.spring, other.spring);
            return;
        }
        case scenario_failure::sda_low:
            action = good ? LOOP_ACTION_BUS_GOOD : LOOP_ACTION_SENSOR_BUS;
            break;
        case scenario_failure::ina_reset:
            action = LOOP_ACTION_SENSOR_RESET;
            break;
        case scenario_failure::brown_out:
            action = LOOP_ACTION_BROWN_OUT;
            break;
        case scenario_failure::fan_stop:
            action = good ? LOOP_ACTION_FAN_GOOD : LOOP_ACTION_FAN_STOP;
            break;
        case scenario_failure::none:
            break;
        }
        for (loop_t *loop : loops_) {
            if ((at.loop == nullptr || at.loop == loop) && !loop_act(loop, action, at.spring)) {
                throw event.place.error("the native board cannot do that");
            }
        }
    }

    std::unique_ptr<boards_t, boards_deleter> boards_;
    std::vector<loop_t *> loops_;
    std::vector<place> place_; /* of each spring */
};

} // namespace

std::unique_ptr<runner> make_native_runner(const runner_request &request)
{
    return std::make_unique<native_runner>(request);
}

} // namespace ninespring
