#include "command.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>

#include "boards.h"
#include "chip_mapping.h"
#include "electrics.h"
#include "log_writer.h"
#include "runner.h"
#include "scenario_plant.h"

namespace ninespring
{

namespace
{

struct run_options {
    std::string scenario_path;
    std::string board = "native";
    std::string elf;
    std::string policy;
    std::vector<std::string> sets;
    std::string seed;
    std::string output;
    std::string json_path;
};

/* The file of settings that [chip] model names, from the scenario's folder; empty if it names none.
 */
std::string settings_path(const scenario &plan)
{
    if (plan.model.empty() || plan.model == "plant" || plan.model == "defaults") {
        return {};
    }
    return (std::filesystem::path(plan.name).parent_path() / plan.model).string();
}

/* The lines `$name=value` of that file, each with its place. */
std::vector<scenario_entry> read_settings(const std::string &path)
{
    const text_file file = read_text_file(path);
    std::vector<scenario_entry> entries;
    std::size_t line = 0;
    for (std::size_t position = 0; position < file.text.size();) {
        const std::string_view text = next_line(file.text, position);
        ++line;
        if (text.empty() || text.front() == '#') {
            continue;
        }
        const std::size_t equals = text.find('=');
        if (text.front() != '$' || equals == std::string_view::npos) {
            throw input_error(path, line, 1,
                              fmt::format("{} is not $name=value; of a model.toml, `ninespring "
                                          "export --model model.toml -o FILE` writes these lines",
                                          in_quotes(text)));
        }
        entries.push_back({std::string(text.substr(1, equals - 1)),
                           std::string(text.substr(equals + 1)),
                           {path, line, equals + 2},
                           {path, line, 2}});
    }
    return entries;
}

void assign(settings_t &settings, const scenario_entry &entry)
{
    switch (settings_assign(&settings, entry.key.c_str(), entry.value.c_str())) {
    case SETTINGS_OK:
        break;
    case SETTINGS_UNKNOWN_NAME: {
        std::vector<std::string> names;
        for (std::uint16_t k = 0; k < PARAMETER_COUNT; ++k) {
            names.emplace_back(parameter_row(k).name);
        }
        throw entry.key_place.error(
            fmt::format("the chip has no setting {}{}; the console's $$ lists them",
                        in_quotes(entry.key), did_you_mean(entry.key, names)));
    }
    case SETTINGS_NOT_A_NUMBER:
        throw entry.place.error(fmt::format(
            "${}: {} is not a number with a point and as many decimals as the setting has",
            entry.key, in_quotes(entry.value)));
    case SETTINGS_OUT_OF_RANGE: {
        std::uint16_t row = 0;
        std::uint8_t element = 0;
        settings_find(entry.key.c_str(), &row, &element);
        const parameter_row_t known = parameter_row(row);
        const double scale = std::pow(10.0, known.decimals);
        throw entry.place.error(fmt::format("${} is {}; it must be {} to {} {}", entry.key,
                                            in_quotes(entry.value), known.minimum / scale,
                                            known.maximum / scale, known.unit));
    }
    }
}

/* What a board's chip is told: the plant's own numbers, its defaults, or a file of settings; and
 * what [chip] and its own section say besides. Gives what of the plant the chip leaves out, in
 * words; mostly nothing. */
std::string set_chip(const scenario &plan, const plant_t *plant, int number, settings_t &settings)
{
    const boards_part_t part =
        boards_part(plan.rows, plan.cols, plan.board_rows, plan.board_cols, number - 1);
    settings_default(&settings);
    thermal_model_parameters_t &model = settings.controller.model;
    char left_out[1024] = "";
    if (plan.model.empty() || plan.model == "plant") {
        if (chip_mapping_from_part(plant, part.row, part.column, part.rows, part.columns, &model,
                                   left_out, sizeof left_out) != CHIP_MAPPING_OK) {
            throw place_of(plan, left_out)
                .error(fmt::format("the chip cannot hold the plant's parameters: {}; write "
                                   "[chip] model = defaults, or a file of settings",
                                   left_out));
        }
    } else {
        model.rows = static_cast<std::uint8_t>(part.rows);
        model.columns = static_cast<std::uint8_t>(part.columns);
    }
    const std::string path = settings_path(plan);
    for (const scenario_entry &entry :
         path.empty() ? std::vector<scenario_entry>() : read_settings(path)) {
        assign(settings, entry);
    }
    if (model.rows != part.rows || model.columns != part.columns) {
        throw plan.model_place.error(
            fmt::format("{} is of {} x {} springs, the scenario of {} x {}", plan.model, model.rows,
                        model.columns, part.rows, part.columns));
    }
    for (const scenario_entry &entry : plan.settings) {
        assign(settings, entry);
    }
    for (const scenario_board &board : plan.boards) {
        for (const scenario_entry &entry :
             board.number == number ? board.settings : std::vector<scenario_entry>()) {
            assign(settings, entry);
        }
    }
    if (plan.policy == "precompensate") {
        settings.controller.policy.policy = DRIVE_POLICY_PRECOMPENSATE;
    } else if (plan.policy == "open") {
        settings.controller.policy.policy = DRIVE_POLICY_OPEN;
    }
    return left_out;
}

/* Mean readings over one log interval. Voltage is weighted with current, so that v x i is the mean
 * power. */
struct interval_mean {
    double current = 0.0;
    double voltage = 0.0;
    double power = 0.0;
    int count = 0;

    void add(const runner_spring &reading)
    {
        current += reading.current_a;
        voltage += reading.voltage_v;
        power += reading.current_a * reading.voltage_v;
        ++count;
    }
    [[nodiscard]] double mean_current() const { return current / count; }
    [[nodiscard]] double mean_voltage() const
    {
        return std::fabs(current) > 1e-9 && power > 0.0 ? power / current : voltage / count;
    }
};

struct spring_summary {
    double highest_c = -1000.0;
    double error_square_sum = 0.0;
    double energy_j = 0.0;
    std::string fault = "none";
};

/* Columns of a spring that are known when a row begins. */
constexpr std::size_t BEGIN_VALUES = 8;

/* The one fault that takes another's place. */
std::string overriding()
{
    return safety_fault_name(SAFETY_FAULT_STUCK_ON);
}

class recorder
{
public:
    recorder(const scenario &plan, const std::string &board, const run_options &options)
        : plan_(plan), springs_(plan.springs()), summary_(static_cast<std::size_t>(springs_))
    {
        electrics_noise_seed(&noise_, plan.seed ^ 0x6e696e65737072ULL);
        log_.comment("tool", "ninespring-sim " NINESPRING_VERSION);
        log_.comment("scenario", std::filesystem::path(plan.name).filename().string());
        log_.comment("array", fmt::format("{} x {}", plan.rows, plan.cols));
        if (plan.layers == 2) {
            log_.comment("layers", "2");
        }
        if (plan.pitch_mm) {
            log_.comment("pitch_mm", fmt::format("{}", *plan.pitch_mm));
        }
        log_.comment("board", board);
        log_.comment("seed", fmt::format("{}", plan.seed));
        if (!plan.policy.empty()) {
            log_.comment("policy", plan.policy);
        }
        for (const std::string &set : options.sets) {
            log_.comment("set", set);
        }
        log_.column("time_s", 2);
        each("i{}_a", 4);
        each("v{}_v", 4);
        each("t{}_c", 3);
        log_.column("fan", 2);
        log_.column("ambient_c", 3);
        each("m{}_c", 3);
        each("x{}", 3);
        each("p{}_c", 3);
        each("px{}", 4);
        each("s{}_a", 3);
        each("limits{}", 0);
        each("cut{}_a", 3);
        begin_row_values_.resize(static_cast<std::size_t>(springs_) * BEGIN_VALUES);
    }

    /* What is known at the row's own time; its currents are those of the interval that begins. */
    void begin_row(double time_s, const runner &board)
    {
        time_s_ = time_s;
        means_.assign(static_cast<std::size_t>(springs_), interval_mean());
        fan_ = board.fan();
        ambient_c_ = board.ambient_c();
        for (int k = 0; k < springs_; ++k) {
            const runner_spring reading = board.spring(k);
            double *values = &begin_row_values_[static_cast<std::size_t>(k) * BEGIN_VALUES];
            values[0] = plant_measured_c(board.plant(), k) +
                        plan_.noise_temperature_c * electrics_noise_normal(&noise_);
            values[1] = reading.model_c;
            values[2] = reading.model_austenite;
            values[3] = plant_temperature_c(board.plant(), k);
            values[4] = plant_austenite(board.plant(), k);
            values[5] = reading.target_a;
            values[6] = reading.limits;
            values[7] = reading.cut_a;
        }
    }

    void after_tick(const runner &board)
    {
        ++ticks_;
        for (int k = 0; k < springs_; ++k) {
            const auto at = static_cast<std::size_t>(k);
            const runner_spring reading = board.spring(k);
            means_[at].add(reading);
            spring_summary &summary = summary_[at];
            const double true_c = plant_temperature_c(board.plant(), k);
            const double error = reading.model_c - true_c;
            summary.highest_c = std::max(summary.highest_c, true_c);
            summary.error_square_sum += error * error;
            summary.energy_j += plant_power_w(board.plant(), k) * RUNNER_TICK_S;
            if (summary.fault == "none" || reading.fault == overriding()) {
                summary.fault = reading.fault;
            }
        }
        if (board_fault_ == "none" || board.board_fault() == overriding()) {
            board_fault_ = board.board_fault();
        }
    }

    /* The last row has no interval of its own: its inputs are the last readings. */
    void end_row(const runner &board)
    {
        if (means_[0].count == 0) {
            for (int k = 0; k < springs_; ++k) {
                means_[static_cast<std::size_t>(k)].add(board.spring(k));
            }
        }
        std::vector<double> row{time_s_};
        for (const interval_mean &mean : means_) {
            row.push_back(mean.mean_current());
        }
        for (const interval_mean &mean : means_) {
            row.push_back(mean.mean_voltage());
        }
        column_of(row, 0);
        row.push_back(fan_);
        row.push_back(ambient_c_);
        for (std::size_t which = 1; which < BEGIN_VALUES; ++which) {
            column_of(row, which);
        }
        log_.row(row);
    }

    [[nodiscard]] const std::string &text() const { return log_.text(); }

    [[nodiscard]] nlohmann::ordered_json result(const runner &board,
                                                const std::string &board_name) const
    {
        nlohmann::ordered_json springs = nlohmann::ordered_json::array();
        for (int k = 0; k < springs_; ++k) {
            const spring_summary &summary = summary_[static_cast<std::size_t>(k)];
            springs.push_back(
                {{"spring", k + 1},
                 {"final_c", plant_temperature_c(board.plant(), k)},
                 {"highest_c", summary.highest_c},
                 {"austenite", plant_austenite(board.plant(), k)},
                 {"energy_j", summary.energy_j},
                 {"model_c", board.spring(k).model_c},
                 {"model_rmse_c", std::sqrt(summary.error_square_sum / std::max(ticks_, 1))},
                 {"fault", summary.fault}});
        }
        return {{"schema", "ninespring.run/1"},
                {"scenario", std::filesystem::path(plan_.name).filename().string()},
                {"board", board_name},
                {"seed", plan_.seed},
                {"duration_s", plan_.duration_s},
                {"board_fault", board_fault_},
                {"springs", springs}};
    }

private:
    void each(const char *form, int decimals)
    {
        for (int k = 1; k <= springs_; ++k) {
            log_.column(fmt::format(fmt::runtime(form), k), decimals);
        }
    }

    void column_of(std::vector<double> &row, std::size_t which) const
    {
        for (std::size_t k = 0; k < static_cast<std::size_t>(springs_); ++k) {
            row.push_back(begin_row_values_[k * BEGIN_VALUES + which]);
        }
    }

    const scenario &plan_;
    int springs_;
    log_writer log_;
    electrics_noise_t noise_{};
    double time_s_ = 0.0;
    double fan_ = 0.0;
    double ambient_c_ = 0.0;
    int ticks_ = 0;
    std::vector<double> begin_row_values_;
    std::vector<interval_mean> means_;
    std::vector<spring_summary> summary_;
    std::string board_fault_ = "none";
};

void print_summary(const nlohmann::ordered_json &result)
{
    fmt::print("{:>6} {:>9} {:>10} {:>10} {:>9} {:>9} {:>12}  {}\n", "spring", "final", "highest",
               "austenite", "energy", "chip", "chip's error", "fault");
    fmt::print("{:>6} {:>9} {:>10} {:>10} {:>9} {:>9} {:>12}\n", "", "degC", "degC", "0..1", "J",
               "degC", "degC rms");
    for (const auto &one : result["springs"]) {
        fmt::print("{:>6} {:>9.2f} {:>10.2f} {:>10.3f} {:>9.1f} {:>9.2f} {:>12.3f}  {}\n",
                   one["spring"].get<int>(), one["final_c"].get<double>(),
                   one["highest_c"].get<double>(), one["austenite"].get<double>(),
                   one["energy_j"].get<double>(), one["model_c"].get<double>(),
                   one["model_rmse_c"].get<double>(), one["fault"].get<std::string>());
    }
    if (result["board_fault"] != "none") {
        fmt::print("board fault: {}\n", result["board_fault"].get<std::string>());
    }
    if (result["left_out"] != "") {
        fmt::print("{}\n", result["left_out"].get<std::string>());
    }
}

void run(const run_options &options)
{
    if (!options.elf.empty() && options.board != "avr") {
        throw input_error("--elf: the native board runs no ELF; add --board avr");
    }
    scenario plan = read_scenario(options.scenario_path, options.sets);
    const bool table = check_outputs({options.output, options.json_path},
                                     {options.scenario_path, options.elf, settings_path(plan)});
    if (!options.seed.empty()) {
        plan.seed = parse_seed(options.seed, {"--seed", 0, 0});
    }
    if (!options.policy.empty()) {
        plan.policy = options.policy;
    }
    const plant_pointer plant = scenario_plant(plan);
    std::vector<settings_t> settings(static_cast<std::size_t>(
        plan.layers * boards_count(plan.rows, plan.cols, plan.board_rows, plan.board_cols)));
    std::string left_out;
    for (std::size_t k = 0; k < settings.size(); ++k) {
        left_out = set_chip(plan, plant.get(), static_cast<int>(k) + 1, settings[k]);
    }
    const std::unique_ptr<runner> board =
        make_runner(options.board, {&plan, plant.get(), &settings, options.elf});

    recorder record(plan, options.board, options);
    progress_line progress("run");
    const long long ticks = std::llround(plan.duration_s / RUNNER_TICK_S);
    const long long row_ticks = std::llround(plan.log_interval_s / RUNNER_TICK_S);
    std::size_t next_event = 0;
    for (long long tick = 0; tick <= ticks; ++tick) {
        const double time_s = static_cast<double>(tick) * RUNNER_TICK_S;
        const bool row = tick % row_ticks == 0 || tick == ticks;
        if (row && tick > 0) {
            record.end_row(*board);
        }
        while (next_event < plan.events.size() &&
               plan.events[next_event].time_s <= time_s + 0.5 * RUNNER_TICK_S) {
            board->act(plan.events[next_event]);
            ++next_event;
        }
        if (row) {
            record.begin_row(time_s, *board);
        }
        if (tick < ticks) {
            board->tick();
            record.after_tick(*board);
        }
        if (tick % 1024 == 0) {
            progress.show(static_cast<double>(tick) / static_cast<double>(ticks));
        }
    }
    record.end_row(*board);

    nlohmann::ordered_json result = record.result(*board, options.board);
    result["left_out"] = left_out;
    write_file_whole(options.output, record.text());
    if (!options.json_path.empty()) {
        write_file_whole(options.json_path, json_text(result));
    }
    if (table) {
        print_summary(result);
    }
}

} // namespace

void add_command_run(CLI::App &app)
{
    CLI::App *command =
        app.add_subcommand("run", "Runs a scenario: the controller around the simulated array");
    auto options = std::make_shared<run_options>();
    command->add_option("scenario", options->scenario_path, "The scenario (docs/files.md)")
        ->required();
    add_output_option(*command, "-o,--output", options->output,
                      "The log to write, '-' for standard output")
        ->required();
    command
        ->add_option("--board", options->board,
                     "native: controller and plant in one process; "
                     "avr: the firmware's ELF in a simulated Mega")
        ->check(CLI::IsMember({"native", "avr"}))
        ->capture_default_str();
    command->add_option("--elf", options->elf, "The firmware for --board avr");
    command->add_option("--policy", options->policy, "Overrides the scenario's policy")
        ->check(CLI::IsMember({"open", "precompensate"}));
    command
        ->add_option("--set", options->sets,
                     "key=value as if the scenario said so: a plant parameter, or section.key; "
                     "again for another")
        ->take_all()
        ->allow_extra_args(false);
    command->add_option("--seed", options->seed, "Overrides the scenario's seed");
    add_output_option(*command, "--json", options->json_path,
                      "Write the summary to this JSON file");
    command->callback([options] { run(*options); });
}

} // namespace ninespring
