/* What it is for: a powered board around a plant, for the tests: send lines, read answers, look at
 * the chip.
 * What it owns: a plant and a simulated board, fresh for each test.
 * What it never does: look at the wall clock. */
#ifndef BOARD_TEST_H
#define BOARD_TEST_H

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <memory>
#include <string>
#include <sys/wait.h>
#include <unistd.h>

#include "../run_tests.h"

#include "board_view.h"
#include "controller.h"
#include "simulated_board.h"

namespace board_test
{

constexpr double CYCLES_PER_MS = BOARD_CYCLES_PER_MS;
constexpr int EXIT_SKIPPED = 77;

inline std::string elf(const char *name = "firmware.elf")
{
    return std::string(NINESPRING_AVR_DIR "/") + name;
}

/* Tests of an ELF that was not built are skipped, loudly. */
inline const std::string &need_elf(const std::string &path)
{
    if (access(path.c_str(), R_OK) != 0) {
        std::printf("SKIPPED: %s is not there: build the avr target first\n", path.c_str());
        std::exit(EXIT_SKIPPED);
    }
    return path;
}

inline bool contains(const std::string &text, const std::string &part)
{
    return text.find(part) != std::string::npos;
}

inline void expect_in(const std::string &text, const std::string &part)
{
    TEST_ASSERT_TRUE_MESSAGE(contains(text, part), text.c_str());
}

/* Tries it in a copy of this process, with boards as they stand here: what leads here is run once
 * for all that is tried from here, and nothing of it is left behind. */
template <typename Tried> void try_from_here(const Tried &tried)
{
    (void)std::fflush(nullptr);
    const pid_t copy = fork();
    TEST_ASSERT_TRUE(copy >= 0);
    if (copy == 0) {
        if (TEST_PROTECT()) {
            tried();
        }
        if (Unity.CurrentTestFailed != 0) {
            std::printf("\n");
            say_where();
        }
        (void)std::fflush(nullptr);
        _exit(Unity.CurrentTestFailed != 0 ? 1 : 0);
    }
    int status = -1;
    TEST_ASSERT_EQUAL_INT(copy, waitpid(copy, &status, 0));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, status, "it failed in the copy");
}

inline void switch_on(plant_t *plant, const char *effect)
{
    TEST_ASSERT_EQUAL_MESSAGE(PLANT_OK, plant_set_effect(plant, effect, true), effect);
}

/* The springs are of NiTi: they take up latent heat, and their resistance shows their phase. */
inline void make_niti(plant_t *plant)
{
    switch_on(plant, "latent_heat");
    switch_on(plant, "resistance_phase");
}

struct plant_deleter {
    void operator()(plant_t *plant) const { plant_destroy(plant); }
};

class rig
{
public:
    explicit rig(const std::string &firmware = elf(), std::uint64_t seed = 1,
                 double shunt_noise_v = 0.0, double bus_noise_v = 0.0)
        : plant(plant_create(3, 3)),
          board(need_elf(firmware), plant.get(), seed, shunt_noise_v, bus_noise_v)
    {
    }

    board_t *raw() { return board.get(); }

    /* Waits for the greeting. A board that was off takes its springs to be hot; a new one is told
     * that they are cold, and drives open loop unless the test says otherwise. */
    std::string boot(bool cold = true)
    {
        std::string text;
        for (int ms = 0; ms < 1000 && text.find('\n') == std::string::npos; ++ms) {
            board.run_ms(1.0);
            text += board.take_output();
        }
        board.run_ms(30.0);
        text += board.take_output();
        if (cold) {
            expect_ok("model cold");
            expect_ok("policy open"); /* what a level gives is then a set current... */
            board.run_ms(600.0);      /* ...at once, when no target walks any more */
        }
        return text;
    }

    /* Around the paper's springs, all cold, and then told that. */
    void boot_niti(std::initializer_list<const char *> lines = {})
    {
        make_niti(plant.get());
        boot();
        for (const char *line : lines) {
            expect_ok(line);
        }
    }

    std::string say(const std::string &line, double limit_ms = 3000.0)
    {
        return board.command(line, limit_ms);
    }

    /* The last line of an answer, without its end. */
    std::string answer(const std::string &line, double limit_ms = 3000.0)
    {
        std::string text = say(line, limit_ms);
        while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) {
            text.pop_back();
        }
        const std::size_t begin = text.find_last_of('\n');
        return begin == std::string::npos ? text : text.substr(begin + 1);
    }

    void expect_ok(const std::string &line)
    {
        const std::string end = answer(line);
        TEST_ASSERT_EQUAL_STRING_MESSAGE("ok", end.c_str(), line.c_str());
    }

    /* Its answer has that in it. */
    void expect_says(const std::string &line, const std::string &part)
    {
        expect_in(say(line), part);
    }

    void expect_error(const std::string &line, int number)
    {
        const std::string end = answer(line, 20000.0);
        const std::string wanted = "error:" + std::to_string(number) + " ";
        TEST_ASSERT_EQUAL_STRING_MESSAGE(wanted.c_str(), end.substr(0, wanted.size()).c_str(),
                                         line.c_str());
    }

    void run_ms(double ms)
    {
        const double left_ms = ms - ahead_ms_;
        ahead_ms_ = left_ms < 0.0 ? -left_ms : 0.0;
        if (left_ms > 0.0) {
            board.run_ms(left_ms);
        }
    }

    /* Between two of the chip's ticks: in one, half of its numbers are new. */
    board_view_t view()
    {
        constexpr double look_ms = 0.1;
        const auto asleep = static_cast<std::uint64_t>(0.9 * look_ms * CYCLES_PER_MS);
        std::uint64_t before = board_idle_cycles(raw());
        for (int look = 0; look < 200; ++look) {
            board.run_ms(look_ms);
            ahead_ms_ += look_ms;
            const std::uint64_t now = board_idle_cycles(raw());
            if (now - before > asleep) {
                break;
            }
            before = now;
        }
        board_view_t seen{};
        TEST_ASSERT_TRUE_MESSAGE(board_view(raw(), "controller", &seen),
                                 "the ELF's `controller` has not the layout of this build");
        return seen;
    }

    std::unique_ptr<plant_t, plant_deleter> plant;
    ninespring::simulated_board board;

private:
    double ahead_ms_ = 0.0; /* that looks have taken: the next run is shorter by it */
};

inline double hottest_c(const rig &mega)
{
    double highest = -300.0;
    for (unsigned k = 0; k < BOARD_CHANNELS; ++k) {
        highest = std::fmax(highest, plant_temperature_c(mega.plant.get(), static_cast<int>(k)));
    }
    return highest;
}

/* Austenite, 0..1, as it is. */
inline double phase(const rig &mega, unsigned spring)
{
    return plant_austenite(mega.plant.get(), static_cast<int>(spring));
}

} // namespace board_test
#endif
