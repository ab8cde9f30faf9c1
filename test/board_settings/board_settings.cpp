/* Settings on the board: what is saved is there after power-on, and `$$` of one board makes another
 * the same. */
#include <map>
#include <sstream>
#include <vector>

#include "board_test.h"

using namespace board_test;

namespace
{

std::vector<std::string> lines_of(const std::string &text)
{
    std::vector<std::string> lines;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) {
        if (!line.empty() && line.back() == '\r') {
            line.pop_back();
        }
        lines.push_back(line);
    }
    return lines;
}

/* The `$name=value` lines of `$$`, without comments. */
std::vector<std::string> settings_of(rig &mega)
{
    std::vector<std::string> settings;
    for (const std::string &line : lines_of(mega.say("$$", 10000.0))) {
        if (line.rfind('$', 0) == 0) {
            settings.push_back(line);
        }
    }
    TEST_ASSERT_TRUE_MESSAGE(settings.size() > 20, "$$ prints too little");
    return settings;
}

void save(rig &mega)
{
    mega.expect_ok("$save");
    for (int ms = 0; ms < 10000; ms += 20) {
        mega.run_ms(20.0);
        const std::uint64_t writes = board_eeprom_writes(mega.raw());
        mega.run_ms(100.0);
        if (writes == board_eeprom_writes(mega.raw()) && !board_eeprom_busy(mega.raw())) {
            return;
        }
    }
    TEST_FAIL_MESSAGE("the save does not end");
}

/* The power fails at a sample of the bytes of a save (every byte: test_settings), before the first
 * of them, too: afterwards the board has the old settings or the new ones, whole. */
TEST(power_cut_in_a_save_leaves_old_or_new)
{
    rig mega;
    mega.boot();
    mega.expect_ok("$heat_capacity_j_per_k=0.311");
    save(mega);
    std::uint64_t begin = board_eeprom_writes(mega.raw());
    save(mega);
    const std::uint64_t bytes = board_eeprom_writes(mega.raw()) - begin;
    TEST_ASSERT_TRUE(bytes > 20);
    const std::vector<std::string> old_settings = settings_of(mega);
    mega.expect_ok("$heat_capacity_j_per_k=0.322");
    mega.expect_ok("$loss_w_per_k=0.006543");
    const std::vector<std::string> new_settings = settings_of(mega);
    begin = board_eeprom_writes(mega.raw());
    const auto cut_at = [&](std::uint64_t cut) {
        here("a cut in byte %u", static_cast<unsigned>(cut));
        mega.board.send("$save\n");
        for (int step = 0; step < 20000 && board_eeprom_writes(mega.raw()) < begin + cut; ++step) {
            mega.run_ms(0.5);
        }
        mega.run_ms(
            1.0 + static_cast<double>(cut % 3)); /* in the erase, in the write, or between bytes */
        board_reset(mega.raw(), BOARD_RESET_BROWN_OUT);
        board_reset(mega.raw(), BOARD_RESET_POWER_ON);
        mega.boot(false);
        const std::vector<std::string> got = settings_of(mega);
        TEST_ASSERT_TRUE(got == old_settings || got == new_settings);
        TEST_ASSERT_TRUE(cut > 0 || got == old_settings); /* nothing was saved */
        TEST_ASSERT_TRUE(cut < bytes || got == new_settings);
    };
    std::vector<std::uint64_t> cuts = {0, 1, 2, bytes - 2, bytes - 1, bytes};
    for (std::uint64_t cut = bytes / 5; cut < bytes - 2; cut += bytes / 5) {
        cuts.push_back(cut);
    }
    for (const std::uint64_t cut : cuts) {
        try_from_here([&] { cut_at(cut); });
    }
}

/* At once and while springs are driven, without a fault. */
TEST(averaging_is_set_while_it_runs)
{
    rig mega;
    mega.boot();
    mega.expect_ok("on all");
    mega.run_ms(500.0);
    for (const char *samples : {"16", "8"}) {
        mega.expect_ok(std::string("$sensor_averaging=") + samples);
        mega.run_ms(300.0);
        const board_view_t seen = mega.view();
        for (unsigned k = 0; k < BOARD_CHANNELS; ++k) {
            TEST_ASSERT_EQUAL_HEX16(samples[0] == '8' ? 0x1DDF : 0x1E67,
                                    board_sensor_register(mega.raw(), k, 0));
            TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, seen.spring[k].fault);
            TEST_ASSERT_INT_WITHIN(60, 1500, seen.spring[k].measured_ma);
        }
    }
}

} // namespace
