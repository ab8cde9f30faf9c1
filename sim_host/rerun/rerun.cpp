#include "rerun.h"

#include <array>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "hil_frame.h"

namespace ninespring
{

namespace
{

constexpr std::size_t EEPROM_BYTES = SETTINGS_LEARNT_BASE + 2u * SETTINGS_LEARNT_SLOT_BYTES;

bool begins(const std::string &text, const char *with)
{
    return text.compare(0, std::strlen(with), with) == 0;
}

/* The text between the n-th '|' and the next one or the closing '>'. */
std::string field(const std::string &text, unsigned n)
{
    std::size_t at = 0;
    for (; n > 0; --n) {
        at = text.find('|', at);
        if (at == std::string::npos) {
            return "";
        }
        ++at;
    }
    return text.substr(at, text.find_first_of("|>", at) - at);
}

/* The whole number after the name and a colon. */
long number(const std::string &field, const char *name)
{
    if (!begins(field, name) || field.size() <= std::strlen(name) + 1) {
        throw std::invalid_argument(std::string("has no ") + name);
    }
    return std::strtol(field.c_str() + std::strlen(name) + 1, nullptr, 10);
}

std::vector<std::uint8_t> bytes_of(const std::string &digits)
{
    std::vector<std::uint8_t> out;
    for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
        out.push_back(
            static_cast<std::uint8_t>(std::strtoul(digits.substr(i, 2).c_str(), nullptr, 16)));
    }
    return out;
}

} // namespace

struct rerun::board {
    std::array<std::uint8_t, EEPROM_BYTES> eeprom{};
    std::string said;
    settings_t settings{};
    settings_store_t store{};
    learnt_store_t learnt_store{};
    telemetry_t telemetry{};
    console_status_t status{};
    console_t console{};
    controller_t controller{};
    controller_inputs_t inputs{};
    controller_outputs_t outputs{};
    std::array<spring_learnt_t, CONTROLLER_MAX_SPRINGS> learnt{};
    std::array<bool, CONTROLLER_MAX_SPRINGS> was_learnt{};
    bool started = false;
    bool ended = false;
    bool first = true;
    std::uint16_t tick = 0;
    hil_frame_decoder_t decoder{};
    tally tally_;

    static std::uint8_t read(void *context, std::uint16_t address)
    {
        return static_cast<board *>(context)->eeprom.at(address);
    }
    static bool ready(void *) { return true; }
    static void write(void *context, std::uint16_t address, std::uint8_t value)
    {
        static_cast<board *>(context)->eeprom.at(address) = value;
    }
    static std::uint16_t room(void *) { return 60000; }
    static void say(void *context, const char *bytes, std::uint8_t length)
    {
        static_cast<board *>(context)->said.append(bytes, length);
    }
    const record_storage_t storage{this, read, ready, write};
    const text_output_t output{this, room, say};

    board()
    {
        eeprom.fill(0xFF);
        status.reset_cause = "a tape";
        status.version = "rerun";
        status.sensors = "a tape's";
        status.loaded = settings_load(&store, &storage, &settings);
        hil_frame_decoder_init(&decoder);
    }

    void start(const std::string &text)
    {
        std::uint16_t bad = 0;
        const long ambient_c7 = number(field(text, 1), "ambient_c7");
        if (!controller_init(&controller, &settings.controller,
                             static_cast<std::int16_t>(ambient_c7), &bad)) {
            throw std::invalid_argument("the settings above do not fit together");
        }
        (void)learnt_store_open(&learnt_store, &storage, SETTINGS_LEARNT_BASE,
                                SETTINGS_LEARNT_SLOT_BYTES, &controller);
        for (std::uint8_t k = 0; k < controller_springs(&controller); ++k) {
            if (was_learnt.at(k)) {
                controller_restore_learnt(&controller, k, &learnt.at(k));
            }
        }
        (void)controller_set_fan(&controller,
                                 static_cast<std::uint8_t>(number(field(text, 2), "fan")));
        (void)controller_restart(&controller, &settings.controller);
        if (number(field(text, 3), "warm") != 0) {
            spring_estimator_doubt(&controller.estimator);
        }
        telemetry_init(&telemetry);
        console_init(&console, &output, &controller, &settings, &store, &learnt_store, &telemetry,
                     &status);
        status.ambient_c7 = controller.ambient_c7;
        started = true;
    }

    void take_learnt(const std::string &text)
    {
        const long k = number(field(text, 1), "spring") - 1;
        const std::vector<std::uint8_t> bytes = bytes_of(field(text, 2));
        if (k < 0 || k >= CONTROLLER_MAX_SPRINGS || bytes.size() != sizeof(spring_learnt_t)) {
            throw std::invalid_argument("is not what was learnt of a spring");
        }
        std::memcpy(&learnt.at(static_cast<std::size_t>(k)), bytes.data(), bytes.size());
        was_learnt.at(static_cast<std::size_t>(k)) = true;
    }

    [[nodiscard]] double seconds() const
    {
        return 1e-3 * CONTROLLER_TICK_MS * static_cast<double>(tally_.ticks);
    }

    /* As far as a job goes in the turns between two ticks. */
    void service()
    {
        for (unsigned turn = 0; turn < 200 && console_busy(&console); ++turn) {
            console_service(&console);
        }
    }

    void type(const std::string &text)
    {
        ++tally_.typed;
        if (text == "!") {
            controller_emergency_stop(&controller);
            console_stop(&console);
            return;
        }
        if (begins(text, "telemetry")) {
            ended = true;
            return;
        }
        for (const char c : text) {
            console_receive(&console, static_cast<std::uint8_t>(c));
        }
        console_receive(&console, '\n');
        service();
    }

    void frame(const std::string &text)
    {
        hil_frame_event_t event = HIL_FRAME_PART;
        for (const char c : text) {
            event = hil_frame_decode(&decoder, static_cast<std::uint8_t>(c));
        }
        event = hil_frame_decode(&decoder, '\n');
        hil_frame_sensors_t got;
        if (event != HIL_FRAME_SENSORS) {
            return; /* broken on the way: the next one shows that it is missing */
        }
        hil_frame_get_sensors(&decoder, &got);
        if (got.springs != controller_springs(&controller)) {
            throw std::invalid_argument("is of another number of springs than the settings");
        }
        const auto missing = static_cast<std::uint16_t>(got.tick - tick - 1u);
        if (!first && missing != 0) {
            if (tally_.missing == 0) {
                tally_.missing_s = seconds();
            }
            tally_.missing += missing;
        }
        first = false;
        tick = got.tick;
        for (std::uint8_t k = 0; k < got.springs; ++k) {
            inputs.sensor[k] = {got.sensor[k].status, got.sensor[k].current_ma,
                                got.sensor[k].voltage_mv};
            status.sensor_status[k] = got.sensor[k].status;
        }
        inputs.ambient_c7 = got.ambient_c7;
        status.ambient_c7 = got.ambient_c7;
        inputs.fan_percent = outputs.fan_percent;
        controller_host_heard(&controller); /* whoever recorded it was there */
        ++status.ticks;
        text_time_add(&status.time, CONTROLLER_TICK_MS);
        controller_tick(&controller, &inputs, &outputs);
        service();
        ++tally_.ticks;
    }

    void compare(const std::string &text)
    {
        const long k = number(field(text, 1), "spring") - 1;
        if (number(field(text, 2), "tick") != tick || k < 0 ||
            k >= controller_springs(&controller)) {
            return; /* of a tick that is missing */
        }
        const std::vector<std::uint8_t> bytes = bytes_of(field(text, 3).substr(5));
        const std::uint16_t mark =
            controller_belief_mark(&controller, static_cast<std::uint8_t>(k));
        ++tally_.marks;
        if (bytes.size() != sizeof mark || std::memcmp(bytes.data(), &mark, sizeof mark) != 0) {
            if (tally_.other == 0) {
                tally_.other_s = seconds();
                tally_.other_spring = static_cast<unsigned>(k + 1);
            }
            ++tally_.other;
        }
    }
};

rerun::rerun() : board_(std::make_unique<board>()) {}
rerun::~rerun() = default;

void rerun::line(const std::string &raw)
{
    std::string text = raw;
    while (!text.empty() && (text.back() == '\r' || text.back() == '\n')) {
        text.pop_back();
    }
    const std::size_t equals = text.find('=');
    if (begins(text, "# $") && equals != std::string::npos && !board_->started) {
        if (settings_assign(&board_->settings, text.substr(3, equals - 3).c_str(),
                            text.c_str() + equals + 1) != SETTINGS_OK) {
            throw std::invalid_argument("is a setting that this version does not have");
        }
    } else if (begins(text, "<learnt|")) {
        board_->take_learnt(text);
    } else if (begins(text, "<start|")) {
        board_->start(text);
    } else if (begins(text, "<typed|") && board_->started) {
        board_->type(text.substr(7, text.size() - 8));
    } else if (begins(text, "<belief|") && board_->started) {
        board_->compare(text);
    } else if (begins(text, "~S")) {
        if (!board_->started) {
            throw std::invalid_argument("comes before <start|...>: the tape has no beginning");
        }
        board_->frame(text);
    }
}

std::string rerun::ask(const std::string &text)
{
    static const char *const words[] = {"model", "learnt", "faults", "$$"};
    bool only_reads = begins(text, "why ");
    for (const char *word : words) {
        only_reads = only_reads || text == word;
    }
    if (!only_reads || !board_->started) {
        throw std::invalid_argument("only model, why K, learnt, faults and $$ can be asked");
    }
    board_->said.clear();
    for (const char c : text) {
        console_receive(&board_->console, static_cast<std::uint8_t>(c));
    }
    console_receive(&board_->console, '\n');
    board_->service();
    return board_->said;
}

const controller_t *rerun::controller() const
{
    return &board_->controller;
}

double rerun::time_s() const
{
    return board_->seconds();
}

bool rerun::started() const
{
    return board_->started;
}

bool rerun::ended() const
{
    return board_->ended;
}

const rerun::tally &rerun::so_far() const
{
    return board_->tally_;
}

} // namespace ninespring
