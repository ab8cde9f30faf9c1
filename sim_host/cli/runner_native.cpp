#include "runner.h"

#include <cmath>
#include <fmt/format.h>

#include "electrics.h"
#include "loop.h"
#include "scenario_plant.h"

namespace ninespring
{

namespace
{

struct loop_deleter {
    void operator()(loop_t *loop) const { loop_destroy(loop); }
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
        std::uint16_t bad = UINT16_MAX;
        loop_.reset(loop_create(&request.settings->controller, request.plant, &options,
                                request.plan->seed, &bad));
        if (loop_ == nullptr) {
            throw input_error(
                request.plan->name, 0, 0,
                bad == UINT16_MAX
                    ? "the loop cannot be made from this plant and these settings"
                    : fmt::format("the chip refuses {}; set it in [chip]", setting_name(bad)));
        }
        controller_set_temperature(
            loop_controller(loop_.get()),
            static_cast<std::int16_t>(std::lround(plant_ambient_c(request.plant) * 128.0)));
    }

    void act(const scenario_event &event) override
    {
        controller_t *controller = loop_controller(loop_.get());
        switch (event.word) {
        case scenario_word::on:
        case scenario_word::off:
            for (const int k : event.springs) {
                const double level = event.word == scenario_word::on ? event.amount * 10.0 : 0.0;
                controller_set_target(controller, static_cast<std::uint8_t>(k),
                                      static_cast<std::uint16_t>(std::lround(level)));
            }
            return;
        case scenario_word::pattern: {
            bool on[CONTROLLER_MAX_SPRINGS] = {};
            for (std::size_t k = 0; k < event.pattern.size(); ++k) {
                on[k] = event.pattern[k];
            }
            controller_set_pattern(controller, on);
            return;
        }
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
            if (!loop_set_ambient(loop_.get(), event.amount)) {
                throw event.place.error("the plant refuses this temperature");
            }
            return;
        case scenario_word::ambient:
            loop_tell_ambient(loop_.get(), event.amount);
            return;
        case scenario_word::set:
            set_plant(loop_plant(loop_.get()), event);
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
            throw event.place.error(
                fmt::format("{} needs a console; run with --board avr", in_quotes(event.text)));
        case scenario_word::fail:
        case scenario_word::repair:
            fail(event);
            return;
        }
    }

    void tick() override { loop_tick(loop_.get()); }

    [[nodiscard]] runner_spring spring(int k) const override
    {
        const controller_t *controller = loop_controller(loop_.get());
        const auto index = static_cast<std::uint8_t>(k);
        return {controller_measured_ma(controller, index) / 1000.0,
                controller_measured_mv(controller, index) / 1000.0,
                controller_target_ma(controller, index) / 1000.0,
                controller_temperature_c7(controller, index) / 128.0,
                controller_austenite_permille(controller, index) / 1000.0,
                controller_limits(controller, index),
                controller_cut_ma(controller, index) / 1000.0,
                safety_fault_name(controller_fault(controller, index))};
    }

    [[nodiscard]] double fan() const override
    {
        return controller_fan_percent(loop_controller(loop_.get())) / 100.0;
    }

    [[nodiscard]] double ambient_c() const override
    {
        return loop_inputs(loop_.get())->ambient_c7 / 128.0;
    }

    [[nodiscard]] std::string board_fault() const override
    {
        return safety_fault_name(controller_board_fault(loop_controller(loop_.get())));
    }

    [[nodiscard]] const plant_t *plant() const override { return loop_plant(loop_.get()); }

private:
    void fail(const scenario_event &event)
    {
        const bool good = event.word == scenario_word::repair;
        loop_action_t action = LOOP_ACTION_SENSOR_GOOD;
        switch (event.what) {
        case scenario_failure::open:
            action = good ? LOOP_ACTION_SPRING_GOOD : LOOP_ACTION_OPEN_SPRING;
            break;
        case scenario_failure::short_circuit:
            action = good ? LOOP_ACTION_SPRING_GOOD : LOOP_ACTION_SHORT_SPRING;
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
            loop_scale_sensor(loop_.get(), event.springs[0], good ? 1.0 : event.amount,
                              good ? 1.0 : event.voltage_amount);
            return;
        case scenario_failure::swap:
            loop_swap_sensors(loop_.get(), event.springs[0], event.springs[1]);
            return;
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
        if (!loop_act(loop_.get(), action, event.springs.empty() ? 0 : event.springs[0])) {
            throw event.place.error("the native board cannot do that");
        }
    }

    std::unique_ptr<loop_t, loop_deleter> loop_;
};

} // namespace

std::unique_ptr<runner> make_native_runner(const runner_request &request)
{
    return std::make_unique<native_runner>(request);
}

} // namespace ninespring
