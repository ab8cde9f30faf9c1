/* Ten minutes of random bytes on the console: nothing is on that should not be, nothing restarts,
 * no tick is missed. */
#include "board_test.h"

using namespace board_test;

namespace
{

constexpr double MINUTES = 10.0;
constexpr double SLICE_MS = 100.0;
constexpr double LINE_RATE = 11.52; /* bytes per ms at 115200 baud */

/* xorshift64*: the same bytes on every machine. */
std::uint64_t next_random(std::uint64_t &state)
{
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return state * 0x2545F4914F6CDD1DULL;
}

/* Bytes of three kinds: any value, printable ones, and pieces of true words, so that the deeper
 * code is reached. */
std::string random_bytes(std::uint64_t &state, std::size_t count)
{
    static const char *const words[] = {"on ",     "off ",  "all",    "pattern ", "111101111",
                                        "policy ", "open",  "fan ",   "ambient ", "model",
                                        "faults",  "clear", "unlock", "selftest", "telemetry ",
                                        "csv ",    "50",    "$$",     "$save",    "$loss_w_per_k=",
                                        "0.3",     "\n",    "\r\n",   "?",        "!",
                                        "-",       "1e9",   "help",   "version"};
    std::string bytes;
    while (bytes.size() < count) {
        const std::uint64_t kind = next_random(state) >> 32;
        if (kind % 4 == 0) {
            bytes += static_cast<char>(kind >> 8);
        } else if (kind % 4 == 1) {
            bytes += static_cast<char>(' ' + (kind >> 8) % 95);
        } else {
            bytes += words[(kind >> 8) % ROWS(words)];
        }
    }
    return bytes;
}

TEST(keeps_its_schedule_for_ten_minutes)
{
    rig mega;
    mega.boot();
    std::uint64_t state = 0x9E3779B97F4A7C15ULL;
    for (double ms = 0.0; ms < MINUTES * 60000.0; ms += SLICE_MS) {
        /* full speed for a second, then a tenth of it */
        const double rate = static_cast<long>(ms / 1000.0) % 2 == 0 ? LINE_RATE : LINE_RATE / 10.0;
        const auto wanted = static_cast<std::size_t>(rate * SLICE_MS);
        if (board_send_backlog(mega.raw()) < wanted) {
            mega.board.send(random_bytes(state, wanted));
        }
        mega.run_ms(SLICE_MS);
        mega.board.take_output();
    }
    TEST_ASSERT_EQUAL_UINT(0, board_reset_count(mega.raw()));
    TEST_ASSERT_EQUAL_UINT64(0, board_uart_overruns(mega.raw()));

    /* What is left of it is cut off, and the board works. */
    mega.board.send("\n!\n");
    mega.run_ms(3000.0);
    mega.board.take_output();
    mega.expect_ok("telemetry off");
    mega.run_ms(200.0);
    mega.board.take_output();
    mega.expect_says("version", "ticks late 0,");
}

} // namespace
