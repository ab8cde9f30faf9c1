/* The firmware's ELF in a simulated Mega, as `run --board avr` runs it: words go over its UART, as
 * a user's would. */
#include "runner.h"

#include <cmath>
#include <fmt/format.h>

#include "board_view.h"
#include "controller.h"
#include "electrics.h"
#include "scenario_plant.h"
#include "simulated_board.h"
#include "text.h"

namespace ninespring
{

namespace
{

constexpr const char *CONTROLLER_SYMBOL = "controller";
constexpr double BOOT_LIMIT_MS = 2000.0;
constexpr double ANSWER_LIMIT_MS = 2000.0;

struct plant_copy_deleter {
    void operator()(plant_t *plant) const { plant_destroy(plant); }
};

/* A line worth the user's eye: neither the answer that all is well nor a line of telemetry. */
bool is_news(const std::string &line)
{
    return !line.empty() && line != "ok" && line[0] != '>' && (line[0] < '0' || line[0] > '9') &&
           line.rfind("<limits|", 0) != 0;
}

/* By the policy's own function, from the few numbers that it looks at. */
std::uint16_t cut_ma(const board_view_spring_t &seen)
{
    static drive_policy_t policy;
    policy.spring[0].limits = seen.limits;
    policy.spring[0].wanted_ma = seen.wanted_ma;
    policy.spring[0].target_ma = seen.target_ma;
    return drive_policy_cut_ma(&policy, 0);
}

class avr_runner : public runner
{
public:
    explicit avr_runner(const runner_request &request)
        : plant_(plant_copy(request.plant)), file_(request.plan->name)
    {
        if (plant_ == nullptr) {
            throw std::bad_alloc();
        }
        const std::string elf = request.elf.empty() ? default_elf("firmware.elf") : request.elf;
        board_ = std::make_unique<simulated_board>(elf, plant_.get(), request.plan->seed,
                                                   request.plan->noise_current_a *
                                                       ELECTRICS_INA219_SHUNT_OHM,
                                                   request.plan->noise_voltage_v);
        board_hold_plant(board_->get(), true);
        warm_thermistor();
        boot();
        look();
        configure(request.settings->front());
        board_->command("model cold", ANSWER_LIMIT_MS); /* the springs are at ambient, which a board
                                                           that was off cannot know */
        look();
        /* The experiment begins with the springs as the plant has them, whatever the board did
         * until now. */
        board_hold_plant(board_->get(), false);
        zero_cycle_ = board_cycle(board_->get());
    }

    void act(const scenario_event &event) override
    {
        switch (event.word) {
        case scenario_word::room:
            if (plant_set_ambient(plant_.get(), event.amount) != PLANT_OK) {
                throw event.place.error("the plant refuses this temperature");
            }
            warm_thermistor();
            return;
        case scenario_word::set:
            set_plant(plant_.get(), event);
            return;
        case scenario_word::fail:
        case scenario_word::repair:
            fail(event);
            return;
        case scenario_word::stop:
            board_->send("!");
            return;
        default:
            board_->send(event.text == "?" ? event.text : event.text + "\n");
            return;
        }
    }

    void tick() override
    {
        ++ticks_;
        const auto cycles = static_cast<std::uint64_t>(RUNNER_TICK_S * BOARD_FREQUENCY_HZ);
        board_->run_until(zero_cycle_ + ticks_ * cycles);
        tell();
        look();
    }

    [[nodiscard]] runner_spring spring(int k) const override
    {
        const board_view_spring_t &seen = view_.spring[k];
        return {seen.measured_ma / 1000.0,
                seen.measured_mv / 1000.0,
                seen.target_ma / 1000.0,
                seen.temperature_c7 / 128.0,
                austenite(k),
                seen.limits,
                cut_ma(seen) / 1000.0,
                safety_fault_name(static_cast<safety_fault_t>(seen.fault))};
    }

    [[nodiscard]] double fan() const override { return view_.fan_percent / 100.0; }
    [[nodiscard]] double ambient_c() const override { return view_.ambient_c7 / 128.0; }
    [[nodiscard]] std::string board_fault() const override
    {
        return safety_fault_name(static_cast<safety_fault_t>(view_.board_fault));
    }
    [[nodiscard]] const plant_t *plant() const override { return plant_.get(); }

private:
    /* The optional NTC at A0 (lib/ntc): 10 kohm at 25 degC, B 3950 K, to ground, below 10 kohm to 5
     * V. */
    void warm_thermistor()
    {
        const double kelvin = plant_ambient_c(plant_.get()) + 273.15;
        const double ratio = std::exp(3950.0 * (1.0 / kelvin - 1.0 / 298.15));
        board_set_analog_v(board_->get(), 0, 5.0 * ratio / (1.0 + ratio));
    }

    void boot()
    {
        std::string text;
        while (text.find('\n') == std::string::npos) {
            if (board_time_s(board_->get()) * 1000.0 > BOOT_LIMIT_MS) {
                throw work_error("the firmware says nothing after power-on; is it the right ELF?");
            }
            board_->run_ms(1.0);
            text += board_->take_output();
        }
        board_->run_ms(50.0);
        board_->take_output();
    }

    void look()
    {
        if (!board_view(board_->get(), CONTROLLER_SYMBOL, &view_)) {
            throw input_error(fmt::format(
                "this ELF has no `{}` of {} bytes; build firmware and simulator from the "
                "same sources",
                CONTROLLER_SYMBOL, board_view_size()));
        }
    }

    void set(const std::string &name, const std::string &value)
    {
        const std::string answer =
            board_->command(fmt::format("${}={}", name, value), ANSWER_LIMIT_MS);
        conflict_ = answer.find("not active") != std::string::npos ? answer : std::string();
        if (answer.find("ok") == std::string::npos) {
            throw input_error(
                file_, 0, 0,
                fmt::format("the board refuses ${}={}: {}", name, value, in_quotes(answer)));
        }
    }

    void send_settings(const settings_t &wanted, const settings_t &fresh)
    {
        for (std::uint16_t k = 0; k < PARAMETER_COUNT; ++k) {
            const parameter_row_t row = parameter_row(k);
            for (std::uint8_t element = 0; element < std::min<int>(row.count, BOARD_CHANNELS);
                 ++element) {
                const std::int32_t value = settings_get(&wanted, k, element);
                if (value == settings_get(&fresh, k, element)) {
                    continue;
                }
                char text[TEXT_DECIMAL_SIZE];
                text_format_decimal(value, row.decimals, text);
                char name[SETTINGS_NAME_SIZE];
                settings_name(k, element, name);
                set(name, text);
            }
        }
    }

    /* Everything that is not as a new board has it, and the air as warm as the plant's. */
    void configure(const settings_t &wanted)
    {
        settings_t told = wanted;
        settings_t fresh{};
        settings_default(&fresh);
        if (told.board.ambient_cc == fresh.board.ambient_cc) {
            told.board.ambient_cc =
                static_cast<std::int16_t>(std::lround(100.0 * plant_ambient_c(plant_.get())));
        }
        send_settings(told, fresh);
        if (!conflict_.empty()) {
            throw input_error(
                file_, 0, 0,
                fmt::format("the board's settings do not fit together: {}", in_quotes(conflict_)));
        }
    }

    /* What the board says goes to the user, with its time. */
    void tell()
    {
        output_ += board_->take_output();
        std::size_t end = 0;
        while ((end = output_.find('\n')) != std::string::npos) {
            std::string line = output_.substr(0, end);
            output_.erase(0, end + 1);
            if (!line.empty() && line.back() == '\r') {
                line.pop_back();
            }
            if (is_news(line)) {
                fmt::print(stderr, "{:.2f} s: {}\n", static_cast<double>(ticks_) * RUNNER_TICK_S,
                           line);
            }
        }
    }

    void fail(const scenario_event &event)
    {
        const bool on = event.word == scenario_word::fail;
        const auto channel = static_cast<unsigned>(event.springs.empty() ? 0 : event.springs[0]);
        switch (event.what) {
        case scenario_failure::open:
            board_set_fault(board_->get(), BOARD_FAULT_OPEN, channel, on);
            break;
        case scenario_failure::short_circuit:
            board_set_fault(board_->get(), BOARD_FAULT_SHORT, channel, on);
            break;
        case scenario_failure::closed:
            board_set_fault(board_->get(), BOARD_FAULT_CLOSED, channel, on);
            break;
        case scenario_failure::nack:
            board_set_fault(board_->get(), BOARD_FAULT_NACK, channel, on);
            break;
        case scenario_failure::stale:
            board_set_fault(board_->get(), BOARD_FAULT_STALE, channel, on);
            break;
        case scenario_failure::freeze:
            board_set_fault(board_->get(), BOARD_FAULT_FREEZE, channel, on);
            break;
        case scenario_failure::lie:
            board_scale_sensor(board_->get(), channel, on ? event.amount : 1.0,
                               on ? event.voltage_amount : 1.0);
            break;
        case scenario_failure::swap:
            board_swap_sensors(board_->get(), channel, static_cast<unsigned>(event.springs[1]));
            break;
        case scenario_failure::sda_low:
            board_set_fault(board_->get(), BOARD_FAULT_SDA_LOW, channel, on);
            break;
        case scenario_failure::fan_stop:
            board_set_fault(board_->get(), BOARD_FAULT_FAN, channel, on);
            break;
        case scenario_failure::ina_reset:
            board_reset_sensor(board_->get(), channel);
            break;
        case scenario_failure::brown_out:
            board_reset(board_->get(), BOARD_RESET_BROWN_OUT);
            break;
        case scenario_failure::none:
            break;
        }
    }

    /* By the model's own function, from the few numbers that it looks at. */
    [[nodiscard]] double austenite(int k) const
    {
        static thermal_model_t model;
        const board_view_spring_t &seen = view_.spring[k];
        model.springs = 1;
        model.transformation = {view_.martensite_finish_c7, view_.martensite_start_c7,
                                view_.austenite_start_c7, view_.austenite_finish_c7};
        model.spring[0].transformation_shift_c7 = seen.transformation_shift_c7;
        model.heating_position = view_.heating_position;
        model.cooling_position = view_.cooling_position;
        model.state.spring[0].heating_c7 = seen.heating_c7;
        model.state.spring[0].cooling_c7 = seen.cooling_c7;
        model.state.spring[0].amplitude = seen.amplitude;
        model.state.spring[0].branch = seen.branch;
        return thermal_model_austenite(&model, 0) / 32768.0;
    }

    std::unique_ptr<plant_t, plant_copy_deleter> plant_;
    std::string file_;
    std::unique_ptr<simulated_board> board_;
    board_view_t view_{};
    std::string
        conflict_; /* what the board said to the last setting, if it does not fit the others */
    std::uint64_t zero_cycle_ = 0;
    std::uint64_t ticks_ = 0;
    std::string output_;
};

} // namespace

std::unique_ptr<runner> make_avr_runner(const runner_request &request)
{
    return std::make_unique<avr_runner>(request);
}

} // namespace ninespring
