/* A tape of a board with its console, around a plant, and the same again: to the last bit. That of
 * the flashed ELF: test/board_rerun. */
#include <cmath>
#include <cstring>
#include <memory>
#include <sstream>
#include <string>

#include "../fakes/eeprom.h"
#include "loop.h"
#include "rerun.h"

using ninespring::rerun;

namespace
{

struct loop_deleter {
    void operator()(loop_t *loop) const { loop_destroy(loop); }
};
struct plant_deleter {
    void operator()(plant_t *plant) const { plant_destroy(plant); }
};

std::uint16_t room(void *)
{
    return 60000;
}
void say(void *context, const char *bytes, std::uint8_t length)
{
    static_cast<std::string *>(context)->append(bytes, length);
}

/* The native loop with a console and what the firmware's own loop does around them. */
class recorder
{
public:
    explicit recorder(std::uint64_t seed)
    {
        std::memset(memory, 0xFF, sizeof memory);
        loop_options_t options;
        loop_options_default(&options);
        options.bus_noise_v = 0.004;
        options.shunt_noise_v = 1e-5;
        status_.version = status_.sensors = status_.reset_cause = "test";
        status_.loaded = settings_load(&store_, &storage, &settings_);
        plant_.reset(plant_create(3, 3));
        TEST_ASSERT_EQUAL(PLANT_OK, plant_set_effect(plant_.get(), "latent_heat", true));
        TEST_ASSERT_EQUAL(PLANT_OK, plant_set_effect(plant_.get(), "resistance_phase", true));
        loop_.reset(loop_create(&settings_.controller, plant_.get(), &options, seed, nullptr));
        TEST_ASSERT_NOT_NULL(loop_.get());
        (void)learnt_store_open(&learnt_, &storage, SETTINGS_LEARNT_BASE,
                                SETTINGS_LEARNT_SLOT_BYTES, loop_controller(loop_.get()));
        telemetry_init(&telemetry_);
        console_init(&console_, &output_, loop_controller(loop_.get()), &settings_, &store_,
                     &learnt_, &telemetry_, &status_);
        status_.ambient_c7 = 20 * 128;
    }

    void tick()
    {
        loop_tick(loop_.get());
        status_.ticks++;
        const controller_inputs_t *const inputs = loop_inputs(loop_.get());
        status_.ambient_c7 = inputs->ambient_c7;
        for (unsigned k = 0; k < 9; ++k) {
            status_.sensor_status[k] = inputs->sensor[k].status;
        }
        telemetry_inputs(&telemetry_, loop_controller(loop_.get()), inputs,
                         static_cast<std::uint16_t>(status_.ticks), &output_);
        console_service(&console_);
    }

    void run(double seconds)
    {
        for (long n = std::lround(seconds / LOOP_TICK_S); n > 0; --n) {
            tick();
        }
    }

    void type(const std::string &line)
    {
        for (const char c : line) {
            console_receive(&console_, static_cast<std::uint8_t>(c));
        }
        console_receive(&console_, '\n');
        for (unsigned turn = 0; turn < 20000 && console_busy(&console_); ++turn) {
            tick();
        }
        TEST_ASSERT_FALSE(console_busy(&console_));
    }

    /* All settings as `record` writes them, and then the inputs. */
    void begin()
    {
        tape.clear();
        type("$$");
        std::string head;
        std::istringstream lines(tape);
        for (std::string line; std::getline(lines, line);) {
            head += line[0] == '$' ? "# " + line + "\n" : "";
        }
        tape = head;
        type("telemetry inputs");
        TEST_ASSERT_NOT_NULL_MESSAGE(std::strstr(tape.c_str(), "<start|"), tape.c_str());
    }

    controller_t *controller() { return loop_controller(loop_.get()); }
    loop_t *loop() { return loop_.get(); }

    std::string tape;

private:
    const text_output_t output_{&tape, room, say};
    settings_t settings_{};
    settings_store_t store_{};
    learnt_store_t learnt_{};
    telemetry_t telemetry_{};
    console_status_t status_{};
    console_t console_{};
    std::unique_ptr<plant_t, plant_deleter> plant_;
    std::unique_ptr<loop_t, loop_deleter> loop_;
};

void play(rerun &again, const std::string &tape)
{
    std::istringstream lines(tape);
    for (std::string line; std::getline(lines, line);) {
        again.line(line);
    }
}

/* A day: heated, held, in a draught, a contact that moves, a sensor that is silent, a stop. */
void live(recorder &board)
{
    board.type("policy precompensate");
    board.type("pattern 111101111");
    board.run(200.0);
    plant_t *const plant = loop_plant(board.loop());
    double loss = 0.0;
    TEST_ASSERT_EQUAL(PLANT_OK, plant_get(plant, "loss_w_per_k", &loss));
    TEST_ASSERT_EQUAL(PLANT_OK, plant_set(plant, "loss_w_per_k", 1.2 * loss));
    board.run(90.0);
    (void)loop_act(board.loop(), LOOP_ACTION_SENSOR_STALE, 2);
    board.run(0.5);
    (void)loop_act(board.loop(), LOOP_ACTION_SENSOR_GOOD, 2);
    board.type("$hold_margin_k=3.00");
    board.type("fan 40");
    board.run(60.0);
    board.type("off 7");
    board.type("on 1 50");
    board.run(60.0);
}

/* It begins in mid-life: what was learnt is on it, and that springs may be warm. */
TEST(a_tape_begins_with_what_was_learnt)
{
    recorder board(4);
    board.type("model cold");
    live(board);
    board.type("clear"); /* the silent sensor's fault */
    board.type("on 4");
    board.run(16.0);
    board.type("off all");
    const spring_learnt_t learnt = controller_learnt(board.controller(), 3);
    TEST_ASSERT_TRUE(learnt.austenite_ohm > 0.1f);
    board.begin();
    const spring_learnt_t after = controller_learnt(board.controller(), 3);
    spring_learnt_t expected = learnt;
    expected.loss_sd_w_per_k = after.loss_sd_w_per_k; /* its drift goes on */
    TEST_ASSERT_EQUAL_MEMORY(&expected, &after, sizeof expected);
    TEST_ASSERT_FLOAT_WITHIN(0.02f * learnt.loss_sd_w_per_k, learnt.loss_sd_w_per_k,
                             after.loss_sd_w_per_k);
    board.type("on 4");
    board.run(120.0);
    rerun again;
    play(again, board.tape);
    TEST_ASSERT_EQUAL_UINT64(0, again.so_far().missing);
    TEST_ASSERT_EQUAL_UINT64(0, again.so_far().other);
    TEST_ASSERT_TRUE(again.so_far().marks > 1000u);
    TEST_ASSERT_NOT_NULL(std::strstr(again.ask("why 4").c_str(), "its phase is read"));
    TEST_ASSERT_EQUAL_UINT8(DRIVE_POLICY_STAGE_HOLD, controller_stage(again.controller(), 3));
    TEST_ASSERT_EQUAL_STRING("ok\r\n", again.ask("faults").c_str());
}

TEST(what_a_tape_lacks_or_another_reading_is_said)
{
    recorder board(5);
    board.begin();
    board.type("model cold");
    board.type("on 5");
    board.run(20.0);
    std::istringstream lines(board.tape);
    std::string without, other;
    unsigned number = 0;
    for (std::string line; std::getline(lines, line);) {
        number += line[0] == '~';
        if (line[0] != '~' || number != 500) {
            without += line + "\n";
        }
        other += line[0] == '<' && line.compare(0, 7, "<typed|") == 0 &&
                         line.find("on 5") != std::string::npos
                     ? "<typed|on 6>\r\n"
                     : line + "\n";
    }
    rerun less;
    play(less, without);
    TEST_ASSERT_EQUAL_UINT64(1, less.so_far().missing);
    rerun wrong;
    play(wrong, other);
    TEST_ASSERT_EQUAL_UINT64(0, wrong.so_far().missing);
    TEST_ASSERT_TRUE(wrong.so_far().other > 10);
    TEST_ASSERT_TRUE(wrong.so_far().other_spring == 5 || wrong.so_far().other_spring == 6);
}

TEST(a_tape_without_a_beginning_is_refused)
{
    for (const char *line : {"~S0001", "# $nothing_of_the_kind=1"}) {
        rerun again;
        bool refused = false;
        try {
            again.line(line);
        } catch (const std::invalid_argument &) {
            refused = true;
        }
        TEST_ASSERT_TRUE_MESSAGE(refused, line);
    }
}

} // namespace
