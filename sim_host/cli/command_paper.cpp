#include "command.h"

#include <cmath>
#include <fmt/format.h>
#include <map>

#include "log_writer.h"
#include "paper.h"

namespace ninespring
{

namespace
{

constexpr double COMSOL_HOT_C = 105.0;

struct paper_options {
    std::string output;
    std::string json_path;
};

struct square_sum {
    double sum = 0.0;
    int count = 0;
    double highest = 0.0;
    void add(double error)
    {
        sum += error * error;
        highest = std::max(highest, std::fabs(error));
        ++count;
    }
    [[nodiscard]] double rms() const { return count == 0 ? 0.0 : std::sqrt(sum / count); }
};

void paper(const paper_options &options)
{
    const bool wants_table = check_outputs({options.output, options.json_path}, {});
    plant_pointer plant(plant_create(3, 3));
    if (plant == nullptr) {
        throw work_error("memory is out");
    }
    std::string csv = "# tool: ninespring-sim " NINESPRING_VERSION " paper\n"
                      "pitch_mm,fan,source,t_hot_c,t_centre_c,model_centre_c\n";
    nlohmann::ordered_json cases = nlohmann::ordered_json::array();
    std::map<std::string, square_sum> sums;
    std::string table = fmt::format("{:>8} {:>4} {:>8} {:>7} {:>8} {:>8} {:>8}\n", "pitch mm",
                                    "fan", "source", "hot", "centre", "model", "model -");
    for (const paper_case_t &one : paper_cases) {
        double centre_c = 0.0;
        const plant_status_t status = paper_centre_c(plant.get(), &one, &centre_c);
        if (status != PLANT_OK) {
            throw work_error(
                fmt::format("the plant did not settle: {}", plant_status_text(status)));
        }
        const double error = centre_c - one.t_centre_c;
        sums[one.source].add(error);
        if (std::string_view(one.source) == "camera") {
            paper_case_t declared = one;
            declared.t_hot_c = COMSOL_HOT_C;
            double declared_c = 0.0;
            if (paper_centre_c(plant.get(), &declared, &declared_c) != PLANT_OK) {
                throw work_error("the plant did not settle");
            }
            sums["camera_declared"].add(declared_c - one.t_centre_c);
        }
        csv += fmt::format("{},{},{},{},{},{:.2f}\n", one.pitch_mm, one.fan, one.source,
                           one.t_hot_c, one.t_centre_c, centre_c);
        table += fmt::format("{:>8} {:>4} {:>8} {:>7.1f} {:>8.1f} {:>8.2f} {:>+8.2f}\n",
                             one.pitch_mm, one.fan != 0.0 ? "on" : "off", one.source, one.t_hot_c,
                             one.t_centre_c, centre_c, error);
        cases.push_back({{"pitch_mm", one.pitch_mm},
                         {"fan", one.fan},
                         {"source", one.source},
                         {"t_hot_c", one.t_hot_c},
                         {"t_centre_c", one.t_centre_c},
                         {"model_centre_c", centre_c}});
    }
    nlohmann::ordered_json rms = nlohmann::ordered_json::object();
    for (const auto &[source, sum] : sums) {
        rms[source] = {{"rmse_c", sum.rms()}, {"largest_error_c", sum.highest}};
    }
    write_file_whole(options.output, csv);
    if (!options.json_path.empty()) {
        write_file_whole(
            options.json_path,
            json_text({{"schema", "ninespring.paper/1"}, {"errors", rms}, {"cases", cases}}));
    }
    if (wants_table) {
        fmt::print(
            "{}"
            "COMSOL: {:.2f} degC rms, largest {:.2f}\n"
            "camera: {:.2f} degC rms with the hot springs at COMSOL's {} degC, {:.2f} at the "
            "camera's own\n"
            "The model was fitted to COMSOL alone; the camera saw what COMSOL leaves out.\n",
            table, sums["comsol"].rms(), sums["comsol"].highest, sums["camera_declared"].rms(),
            COMSOL_HOT_C, sums["camera"].rms());
    }
}

} // namespace

void add_command_paper(CLI::App &app)
{
    CLI::App *command = app.add_subcommand(
        "paper",
        "The paper's conditions: 3 pitches, fan off and on, against COMSOL and the camera");
    auto options = std::make_shared<paper_options>();
    add_output_option(*command, "-o,--output", options->output,
                      "The table to write (CSV), '-' for standard output")
        ->required();
    add_output_option(*command, "--json", options->json_path, "Write the table to this JSON file");
    command->callback([options] { paper(*options); });
}

} // namespace ninespring
