/* The simulated Mega itself, through a program that drives its registers directly
 * (test/avr/board_probe): times and what the firmware does not do. Resets and their flags, and a
 * bus that does not answer: board_reset, board_faults. */
#include <string>
#include <vector>

#include "board_test.h"

using namespace board_test;

namespace
{

constexpr double BYTE_MS = 10.0 / 115.2;

struct mark {
    std::uint64_t cycle;
    std::uint8_t value;
};

/* A board with the probe, and what it says and marks. */
class probe
{
public:
    probe() : plant_(plant_create(3, 3))
    {
        char message[200];
        const std::string path = elf("test/avr/board_probe/board_probe.elf");
        board_options_t options{};
        options.elf = path.c_str();
        options.plant = plant_.get();
        options.seed = 7;
        options.context = this;
        options.on_uart = [](void *context, std::uint64_t, std::uint8_t byte) {
            static_cast<probe *>(context)->text_ += static_cast<char>(byte);
        };
        options.on_mark = [](void *context, std::uint64_t cycle, unsigned, std::uint8_t value) {
            static_cast<probe *>(context)->marks.push_back({cycle, value});
        };
        options.without_cut_off = true; /* the probe gives no pulses */
        board = board_create(&options, message, sizeof message);
        TEST_ASSERT_NOT_NULL_MESSAGE(board, message);
        board_run_ms(board, 2.0);
    }
    ~probe() { board_destroy(board); }
    probe(const probe &) = delete;
    probe &operator=(const probe &) = delete;

    void send(const std::string &bytes) { board_send(board, bytes.data(), bytes.size()); }

    /* The answer to a command, up to its line end. */
    std::string ask(const std::string &bytes, double limit_ms = 200.0)
    {
        text_.clear();
        send(bytes);
        for (double ms = 0.0; ms < limit_ms && text_.find('\n') == std::string::npos; ms += 0.1) {
            board_run_ms(board, 0.1);
        }
        return text_.substr(0, text_.find('\n'));
    }

    std::string ask_sensor(char address, char number)
    {
        return ask(std::string("i") + address + number);
    }

    std::uint64_t cycle_of(std::uint8_t value) const
    {
        for (auto it = marks.rbegin(); it != marks.rend(); ++it) {
            if (it->value == value) {
                return it->cycle;
            }
        }
        TEST_FAIL_MESSAGE("the program did not get there");
        return 0;
    }

    void pwm(unsigned compare, bool on)
    {
        ask({'p', static_cast<char>(compare >> 8), static_cast<char>(compare),
             static_cast<char>(on)});
    }

    board_t *board;
    std::vector<mark> marks;

private:
    std::unique_ptr<plant_t, plant_deleter> plant_;
    std::string text_;
};

void expect(const char *wanted, const std::string &got)
{
    TEST_ASSERT_EQUAL_STRING(wanted, got.c_str());
}

/* --- I2C --- */

TEST(a_sensor_read_gives_the_statuses_of_the_data_sheet_at_the_true_speed)
{
    probe mega;
    /* START, SLA+W ack, data ack, repeated START, SLA+R ack, data ack, data nack, 0x399F */
    expect("08182810405058399F", mega.ask_sensor(0x40, 0));
    /* START, 2 bytes out, START, 1 byte out, 2 bytes in, STOP: in bits of 40 cycles (400 kHz), and
     * 190 cycles of the program. simavr's own model would take 9 us a byte. */
    const double bits = 1 + 2 * 9 + 1 + 9 + 2 * 9 + 2;
    const auto cycles = static_cast<double>(mega.cycle_of(2) - mega.cycle_of(1));
    TEST_ASSERT_DOUBLE_WITHIN(80.0, bits * 40.0 + 190.0, cycles);
}

TEST(an_absent_address_is_not_acknowledged_and_nothing_starts_while_sda_is_held_low)
{
    probe mega;
    TEST_ASSERT_EQUAL_STRING_LEN("0820", mega.ask_sensor(0x49, 0).c_str(), 4);
    board_set_fault(mega.board, BOARD_FAULT_NACK, 2, true);
    TEST_ASSERT_EQUAL_STRING_LEN("0820", mega.ask_sensor(0x42, 0).c_str(), 4);
    board_set_fault(mega.board, BOARD_FAULT_SDA_LOW, 0, true);
    expect("01", mega.ask("d"));
    TEST_ASSERT_EQUAL_STRING_LEN("FF", mega.ask_sensor(0x40, 0).c_str(), 2);
}

/* --- UART --- */

TEST(a_byte_takes_its_ten_bits)
{
    probe mega;
    const std::uint64_t begin = board_cycle(mega.board);
    mega.send("p"); /* the first of four: no answer before the last */
    mega.send(std::string("\0\0\0", 3));
    board_run_ms(mega.board, 4 * BYTE_MS - 0.05);
    TEST_ASSERT_EQUAL_UINT(4, board_send_backlog(mega.board) + 3);
    board_run_ms(mega.board, 0.1);
    TEST_ASSERT_EQUAL_UINT(0, board_send_backlog(mega.board));
    TEST_ASSERT_TRUE(board_cycle(mega.board) > begin);
}

TEST(bytes_that_come_while_three_wait_are_lost_and_said_to_be)
{
    probe mega;
    expect("0308", mega.ask("b12345"));
    TEST_ASSERT_EQUAL_UINT(2, board_uart_overruns(mega.board));
    expect("0300", mega.ask("b123"));
    TEST_ASSERT_EQUAL_UINT(2, board_uart_overruns(mega.board));
}

/* --- outputs --- */

/* A plain pin that is high is an output that is on; what flows is what the sensor shows. */
TEST(duty_is_compare_plus_one_over_the_period_and_gives_its_current)
{
    probe mega;
    for (const unsigned compare : {0u, 399u, 799u, 159u}) {
        mega.pwm(static_cast<std::uint16_t>(compare), true);
        TEST_ASSERT_EQUAL_DOUBLE((compare + 1.0) / 800.0, board_duty(mega.board, 0));
        TEST_ASSERT_FALSE(board_all_off(mega.board));
    }
    board_run_ms(mega.board, 20.0);
    const double current_a = board_current_a(mega.board, 0);
    TEST_ASSERT_TRUE(current_a > 1.0);
    TEST_ASSERT_DOUBLE_WITHIN(
        0.001, current_a,
        1e-4 * static_cast<std::int16_t>(board_sensor_register(mega.board, 0, 1)));
    mega.pwm(0, false);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, board_duty(mega.board, 0));
    TEST_ASSERT_TRUE(board_all_off(mega.board));
    mega.ask("h");
    TEST_ASSERT_EQUAL_DOUBLE(1.0, board_duty(mega.board, 1));
    mega.ask("l");
    TEST_ASSERT_EQUAL_DOUBLE(0.0, board_duty(mega.board, 1));
}

/* --- EEPROM --- */

TEST(a_write_takes_3_4_ms_and_shows_as_under_way)
{
    probe mega;
    expect("02", mega.ask({'E', 5, 'x'}));
    mega.ask("W");
    const double ms = static_cast<double>(mega.cycle_of(5) - mega.cycle_of(3)) / CYCLES_PER_MS;
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 3.4, ms);
    TEST_ASSERT_EQUAL_HEX8('x', board_eeprom(mega.board)[5]);
    expect("78", mega.ask({'R', 5}));
}

TEST(power_that_fails_in_a_write_leaves_a_byte_that_is_neither)
{
    probe mega;
    board_eeprom(mega.board)[5] = 0x55;
    mega.ask({'E', 5, 0x0F});
    board_reset(mega.board, BOARD_RESET_BROWN_OUT); /* within the erase */
    TEST_ASSERT_EQUAL_HEX8(0xFF, board_eeprom(mega.board)[5]);
    board_run_ms(mega.board, 2.0);
    mega.ask({'E', 5, 0x00});
    board_run_ms(mega.board, 2.5); /* within the write: some bits are programmed */
    board_reset(mega.board, BOARD_RESET_BROWN_OUT);
    TEST_ASSERT_TRUE(board_eeprom(mega.board)[5] != 0x00);
    TEST_ASSERT_TRUE(board_eeprom(mega.board)[5] != 0xFF);
}

/* --- the rest --- */

TEST(how_it_is_cut_into_runs_changes_nothing)
{
    probe one;
    probe other;
    for (probe *mega : {&one, &other}) {
        mega->pwm(300, true);
        mega->send({'E', 5, 'x', 'W'});
    }
    board_run_ms(one.board, 20.0);
    for (int k = 0; k < 2000; ++k) {
        board_run_ms(other.board, 0.01);
    }
    TEST_ASSERT_EQUAL_UINT64(one.cycle_of(5), other.cycle_of(5));
}

} // namespace
