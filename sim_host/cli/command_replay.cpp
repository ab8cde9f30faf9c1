#include "command.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <limits>

#include "chip_mapping.h"
#include "log_file.h"
#include "model_file.h"

namespace ninespring
{

namespace
{

constexpr double LONGEST_LOG_S = 60.0 * 86400.0;
const std::vector<std::string> MEASUREMENT_EFFECTS = {"sensor_lag", "sensor_gain",
                                                      "optical_mixing"};

struct replay_options {
    std::string log_path;
    std::string model_path;
    std::string output;
    std::string json_path;
};

struct error_sum {
    double sum = 0.0;
    double square_sum = 0.0;
    double highest = std::numeric_limits<double>::quiet_NaN();
    long count = 0;

    void add(double error)
    {
        sum += error;
        square_sum += error * error;
        highest = std::fmax(highest, std::fabs(error)); /* takes the number beside a NaN */
        ++count;
    }
    [[nodiscard]] double rms() const
    {
        return count == 0 ? std::numeric_limits<double>::quiet_NaN()
                          : std::sqrt(square_sum / static_cast<double>(count));
    }
    [[nodiscard]] double mean() const
    {
        return count == 0 ? std::numeric_limits<double>::quiet_NaN()
                          : sum / static_cast<double>(count);
    }
};

std::int16_t c7(double temperature_c)
{
    return static_cast<std::int16_t>(std::lround(std::clamp(temperature_c, -40.0, 215.0) * 128.0));
}

/* The on-chip model with a log's inputs; temperatures between two steps are interpolated. */
class chip_replay
{
public:
    chip_replay(const log_data &log, const plant_t *plant, const thermal_model_parameters_t &chip)
        : log_(log), springs_(log.springs.size()), plant_(plant)
    {
        if (thermal_model_init(&model_, &chip, nullptr) != THERMAL_MODEL_OK) {
            throw work_error("the on-chip model refuses parameters that the mapping accepted");
        }
        step_s_ = chip.step_ms / 1000.0;
        const int command = plant_parameter_index("command_power_w");
        for (std::size_t k = 0; k < springs_; ++k) {
            double power = 0.0;
            if (command >= 0) {
                plant_get_index(plant, static_cast<std::size_t>(command), static_cast<int>(k),
                                &power);
            }
            command_power_w_.push_back(power);
        }
        start();
    }

    /* The model's temperatures and phases at the time of row `row`; rows must rise. */
    void advance_to_row(std::size_t row)
    {
        const double target_s = log_.time_s[row] - log_.time_s[0];
        while (time_s() <= target_s + 1e-9) {
            step();
        }
        /* The step that covers the row: from steps_ - 1 to steps_. */
        fraction_ = (target_s - (time_s() - step_s_)) / step_s_;
    }

    [[nodiscard]] double temperature_c(std::size_t k) const
    {
        return before_c_[k] + fraction_ * (after_c_[k] - before_c_[k]);
    }
    [[nodiscard]] double austenite(std::size_t k) const
    {
        return thermal_model_austenite(&model_, static_cast<std::uint8_t>(k)) /
               static_cast<double>(THERMAL_MODEL_AUSTENITE_FULL);
    }

private:
    [[nodiscard]] double time_s() const { return static_cast<double>(steps_) * step_s_; }

    [[nodiscard]] double ambient_of(std::size_t row) const
    {
        return log_.ambient_c.empty() ? plant_ambient_c(plant_) : log_.ambient_c[row];
    }

    void start()
    {
        const double ambient_c = ambient_of(0);
        thermal_model_set_ambient(&model_, c7(ambient_c));
        thermal_model_reset(&model_, c7(ambient_c));
        for (std::size_t k = 0; k < springs_; ++k) {
            for (const double value : log_.springs[k].temperature_c) {
                if (std::isfinite(value)) {
                    thermal_model_set_temperature(&model_, static_cast<std::uint8_t>(k), c7(value));
                    break;
                }
            }
        }
        before_c_.resize(springs_);
        after_c_.resize(springs_);
        power_uw_.resize(springs_);
        read(after_c_);
    }

    void read(std::vector<double> &to) const
    {
        for (std::size_t k = 0; k < springs_; ++k) {
            to[k] = thermal_model_temperature_c7(&model_, static_cast<std::uint8_t>(k)) / 128.0;
        }
    }

    /* Power as the board would know it: v x i; i^2 R of the model's own phase where no voltage was
     * logged; a share of command_power_w where only the command was. */
    [[nodiscard]] double power_w(std::size_t k, std::size_t row) const
    {
        const log_spring &spring = log_.springs[k];
        if (!spring.current_a.empty()) {
            const double current = spring.current_a[row];
            if (!spring.voltage_v.empty()) {
                return current * spring.voltage_v[row];
            }
            return current * current *
                   thermal_model_resistance_uohm(&model_, static_cast<std::uint8_t>(k)) * 1e-6;
        }
        return spring.command[row] * command_power_w_[k];
    }

    void step()
    {
        const double begin = time_s();
        const double end = begin + step_s_;
        const std::size_t rows = log_.time_s.size();
        std::vector<double> energy(springs_, 0.0);
        double from = begin;
        while (from < end - 1e-12) {
            while (row_ + 1 < rows && log_.time_s[row_ + 1] - log_.time_s[0] <= from + 1e-12) {
                ++row_;
            }
            double to = end;
            if (row_ + 1 < rows) {
                to = std::min(end, log_.time_s[row_ + 1] - log_.time_s[0]);
            }
            for (std::size_t k = 0; k < springs_; ++k) {
                energy[k] += power_w(k, row_) * (to - from);
            }
            from = to;
        }
        thermal_model_set_ambient(&model_, c7(ambient_of(row_)));
        thermal_model_set_fan(&model_,
                              static_cast<std::uint8_t>(std::lround(log_.fan[row_] * 100.0)));
        for (std::size_t k = 0; k < springs_; ++k) {
            const double power_uw = std::clamp(energy[k] / step_s_ * 1e6, 0.0, 4e9);
            power_uw_[k] = static_cast<std::uint32_t>(std::llround(power_uw));
        }
        before_c_ = after_c_;
        thermal_model_step(&model_, power_uw_.data());
        read(after_c_);
        ++steps_;
    }

    const log_data &log_;
    std::size_t springs_;
    const plant_t *plant_;
    thermal_model_t model_{};
    double step_s_ = 0.1;
    long long steps_ = 0;
    std::size_t row_ = 0;
    double fraction_ = 0.0;
    std::vector<double> command_power_w_;
    std::vector<double> before_c_;
    std::vector<double> after_c_;
    std::vector<std::uint32_t> power_uw_;
};

bool has_measurement_effect(const model_description &model)
{
    for (const auto &[effect, place] : model.effects) {
        for (const std::string &one : MEASUREMENT_EFFECTS) {
            if (effect == one) {
                return true;
            }
        }
    }
    return false;
}

void check_command_power(const log_data &log, const plant_t *plant, const std::string &model)
{
    for (std::size_t k = 0; k < log.springs.size(); ++k) {
        double power = 0.0;
        plant_get(plant, fmt::format("command_power_w[{}]", k + 1).c_str(), &power);
        if (log.springs[k].current_a.empty() && !(power > 0.0)) {
            throw input_error(
                model, 0, 0,
                fmt::format("the log has only the command of spring {}, and the model "
                            "has no command_power_w for it; add the parameter",
                            k + 1));
        }
    }
}

/* Where the model sets a parameter that `message` names: the last one, or the file. */
source_place place_of(const model_description &model, std::string_view message)
{
    source_place found{model.name, 0, 0};
    for (const model_parameter &one : model.parameters) {
        if (mentions(message, one.name)) {
            found = one.place;
        }
    }
    return found;
}

void write_columns(log_writer &writer, const log_data &log, bool shown)
{
    const std::size_t springs = log.springs.size();
    writer.column("time_s", 3);
    for (std::size_t k = 0; k < springs; ++k) {
        const log_spring &spring = log.springs[k];
        if (!spring.current_a.empty()) {
            writer.column(fmt::format("i{}_a", k + 1), 4);
        }
        if (!spring.voltage_v.empty()) {
            writer.column(fmt::format("v{}_v", k + 1), 4);
        }
        if (!spring.command.empty()) {
            writer.column(fmt::format("u{}", k + 1), 5);
        }
        if (!spring.temperature_c.empty()) {
            writer.column(fmt::format("t{}_c", k + 1), 3);
        }
        writer.column(fmt::format("m{}_c", k + 1), 3);
        writer.column(fmt::format("x{}", k + 1), 4);
        if (shown) {
            writer.column(fmt::format("y{}_c", k + 1), 3);
        }
    }
    writer.column("fan", 2);
    if (!log.ambient_c.empty()) {
        writer.column("ambient_c", 3);
    }
}

void print_errors(const replay_options &options, const std::vector<error_sum> &errors,
                  const std::vector<error_sum> &shown_errors, bool shown, double rms)
{
    fmt::print("on-chip model against {}\n",
               std::filesystem::path(options.log_path).filename().string());
    fmt::print("{:>6} {:>8} {:>9} {:>9} {:>9}{}\n", "spring", "samples", "rms", "mean", "largest",
               shown ? "  through the sensor's own errors, rms" : "");
    for (std::size_t k = 0; k < errors.size(); ++k) {
        if (errors[k].count == 0) {
            fmt::print("{:>6} {:>8}\n", k + 1, 0);
            continue;
        }
        fmt::print("{:>6} {:>8} {:>9.3f} {:>9.3f} {:>9.3f}{}\n", k + 1, errors[k].count,
                   errors[k].rms(), errors[k].mean(), errors[k].highest,
                   shown ? fmt::format("  {:.3f}", shown_errors[k].rms()) : "");
    }
    fmt::print("{}\n", std::isfinite(rms) ? fmt::format("all: {:.3f} degC rms", rms)
                                          : "the log holds no temperature to compare with");
}

void replay(const replay_options &options)
{
    const bool wants_table =
        check_outputs({options.output, options.json_path}, {options.log_path, options.model_path});
    const model_description model = read_model(options.model_path);
    const auto springs = static_cast<std::size_t>(model.array.rows * model.array.cols);
    const log_data log = read_log(options.log_path, springs);
    if (log.time_s.back() - log.time_s.front() > LONGEST_LOG_S) {
        throw input_error(log.name, 0, 0,
                          fmt::format("the log spans {:.3g} days; if its time is in ms, divide by "
                                      "1000",
                                      (log.time_s.back() - log.time_s.front()) / 86400.0));
    }
    plant_pointer plant(plant_create(model.array.rows, model.array.cols));
    if (plant == nullptr) {
        throw work_error("memory is out");
    }
    apply_model(plant.get(), model);
    const char *why = nullptr;
    if (plant_check(plant.get(), &why) != PLANT_OK) {
        throw place_of(model, why == nullptr ? "" : why).error(why == nullptr ? "is refused" : why);
    }
    plant_reset(plant.get());
    check_command_power(log, plant.get(), options.model_path);
    thermal_model_parameters_t chip{};
    char message[1024] = "";
    if (chip_mapping_from_plant(plant.get(), &chip, message, sizeof message) != CHIP_MAPPING_OK) {
        throw place_of(model, message).error(message);
    }

    /* The plant is only the sensor here: its springs are held at the chip's temperatures. */
    const bool shown = has_measurement_effect(model);
    chip_replay run(log, plant.get(), chip);
    log_writer writer;
    writer.comment("tool", "ninespring-sim " NINESPRING_VERSION " replay");
    writer.comment("model", std::filesystem::path(options.model_path).filename().string());
    write_columns(writer, log, shown);
    std::vector<error_sum> errors(springs);
    std::vector<error_sum> shown_errors(springs);
    progress_line progress("replay");
    std::vector<double> row;
    for (std::size_t r = 0; r < log.time_s.size(); ++r) {
        run.advance_to_row(r);
        row.assign(1, log.time_s[r]);
        if (r > 0) {
            if (plant_step(plant.get(), log.time_s[r] - log.time_s[r - 1]) != PLANT_OK) {
                throw work_error("the plant cannot follow the log's times");
            }
        }
        for (std::size_t k = 0; k < springs; ++k) {
            const int spring = static_cast<int>(k);
            const double model_c = run.temperature_c(k);
            if (r == 0) {
                plant_set_temperature(plant.get(), spring, model_c);
            }
            plant_drive(plant.get(), spring, PLANT_DRIVE_TEMPERATURE,
                        std::clamp(model_c, -40.0, 300.0));
            const double shown_c = plant_measured_c(plant.get(), spring);
            const log_spring &one = log.springs[k];
            for (const auto *column :
                 {&one.current_a, &one.voltage_v, &one.command, &one.temperature_c}) {
                if (!column->empty()) {
                    row.push_back((*column)[r]);
                }
            }
            if (!one.temperature_c.empty() && std::isfinite(one.temperature_c[r])) {
                errors[k].add(model_c - one.temperature_c[r]);
                shown_errors[k].add(shown_c - one.temperature_c[r]);
            }
            row.push_back(model_c);
            row.push_back(run.austenite(k));
            if (shown) {
                row.push_back(shown_c);
            }
        }
        row.push_back(log.fan[r]);
        if (!log.ambient_c.empty()) {
            row.push_back(log.ambient_c[r]);
        }
        writer.row(row);
        progress.show(static_cast<double>(r) / static_cast<double>(log.time_s.size()));
    }

    error_sum all;
    error_sum shown_all;
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (std::size_t k = 0; k < springs; ++k) {
        all.square_sum += errors[k].square_sum;
        all.count += errors[k].count;
        shown_all.square_sum += shown_errors[k].square_sum;
        shown_all.count += shown_errors[k].count;
        list.push_back({{"spring", k + 1},
                        {"samples", errors[k].count},
                        {"rmse_c", errors[k].rms()},
                        {"mean_error_c", errors[k].mean()},
                        {"largest_error_c", errors[k].highest},
                        {"shown_rmse_c", shown_errors[k].rms()}});
    }
    write_file_whole(options.output, writer.text());
    if (!options.json_path.empty()) {
        write_file_whole(
            options.json_path,
            json_text({{"schema", "ninespring.replay/1"},
                       {"log", std::filesystem::path(options.log_path).filename().string()},
                       {"model", std::filesystem::path(options.model_path).filename().string()},
                       {"rows", log.time_s.size()},
                       {"duration_s", log.time_s.back() - log.time_s.front()},
                       {"rmse_c", all.rms()},
                       {"shown_rmse_c", shown_all.rms()},
                       {"left_out", message},
                       {"springs", list}}));
    }
    if (wants_table) {
        print_errors(options, errors, shown_errors, shown, all.rms());
        if (message[0] != '\0') {
            fmt::print("{}\n", message);
        }
    }
}

} // namespace

void add_command_replay(CLI::App &app)
{
    CLI::App *command = app.add_subcommand(
        "replay", "Drives the on-chip fixed-point model with a measured log and tells its error");
    auto options = std::make_shared<replay_options>();
    command->add_option("log", options->log_path, "The log (docs/files.md)")->required();
    command->add_option("--model", options->model_path, "The model.toml that describes the array")
        ->required();
    add_output_option(*command, "-o,--output", options->output,
                      "The log to write, with the model's m1_c, x1, ...; '-' for standard output")
        ->required();
    add_output_option(*command, "--json", options->json_path, "Write the errors to this JSON file");
    command->callback([options] { replay(*options); });
}

} // namespace ninespring
