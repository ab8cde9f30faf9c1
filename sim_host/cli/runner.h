/* What it is for: a board, or several, around one plant, advanced tick by tick: the thing that
 * `run` runs. What it owns: the interface, and the choice between the native loop and a simulated
 * board. What it never does: read files, print, or know a log. */
#ifndef RUNNER_H
#define RUNNER_H

#include <memory>
#include <string>
#include <vector>

#include "plant.h"
#include "scenario_file.h"
#include "settings.h"

namespace ninespring
{

constexpr double RUNNER_TICK_S = 0.02;

struct runner_request {
    const scenario *plan;                    /* array, seed, noise; not its events */
    const plant_t *plant;                    /* as it starts; copied */
    const std::vector<settings_t> *settings; /* of each board */
    std::string elf;                         /* of a simulated board */
};

/* What the board knows of one spring. */
struct runner_spring {
    double current_a; /* last valid reading */
    double voltage_v;
    double target_a;
    double model_c;
    double model_austenite; /* 0..1 */
    std::uint16_t limits;   /* bits of drive_policy_limit_t */
    double cut_a;           /* by which they cut what the policy would give */
    std::string fault;      /* "none", or a name of docs/codes.csv */
};

class runner
{
public:
    runner() = default;
    virtual ~runner() = default;
    runner(const runner &) = delete;
    runner &operator=(const runner &) = delete;

    /* Fails (input_error at the event's place) if the board cannot do that. */
    virtual void act(const scenario_event &event) = 0;
    /* One control tick of 20 ms. */
    virtual void tick() = 0;
    [[nodiscard]] virtual runner_spring spring(int k) const = 0;
    [[nodiscard]] virtual double fan() const = 0;       /* wanted, 0..1 */
    [[nodiscard]] virtual double ambient_c() const = 0; /* as the board believes */
    [[nodiscard]] virtual std::string board_fault() const = 0;
    [[nodiscard]] virtual const plant_t *plant() const = 0;
};

/* board: "native" or "avr". Fails (input_error) if the settings are refused or there is no such
 * board. */
std::unique_ptr<runner> make_runner(const std::string &board, const runner_request &request);
std::unique_ptr<runner> make_native_runner(const runner_request &request);
/* Only where libsimavr is. Fails (input_error) also if the ELF is refused or the board refuses a
 * setting. */
std::unique_ptr<runner> make_avr_runner(const runner_request &request);

/* The setting of a row of parameters.def, as the user writes it. */
std::string setting_name(std::uint16_t row);

} // namespace ninespring
#endif
