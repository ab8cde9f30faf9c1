#include "simulated_board.h"

#include <filesystem>
#include <fmt/format.h>

#include "text_file.h"

namespace ninespring
{

std::string default_elf(const std::string &name)
{
    std::error_code problem;
    const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", problem);
    const std::filesystem::path beside = program.parent_path().parent_path() / "avr" / name;
    if (!problem && std::filesystem::exists(beside, problem)) {
        return beside.string();
    }
    return std::string(NINESPRING_AVR_DIR "/") + name;
}

simulated_board::simulated_board(const std::string &elf, plant_t *plant, std::uint64_t seed,
                                 double shunt_noise_v, double bus_noise_v)
{
    char message[512];
    board_options_t options{};
    options.elf = elf.c_str();
    options.plant = plant;
    options.seed = seed;
    options.shunt_noise_v = shunt_noise_v;
    options.bus_noise_v = bus_noise_v;
    options.context = this;
    options.on_uart = [](void *context, std::uint64_t, std::uint8_t byte) {
        static_cast<simulated_board *>(context)->output_.push_back(static_cast<char>(byte));
    };
    board_ = board_create(&options, message, sizeof message);
    if (board_ == nullptr) {
        throw input_error(message);
    }
}

simulated_board::~simulated_board()
{
    board_destroy(board_);
}

void simulated_board::check()
{
    if (board_state(board_) == BOARD_CRASHED) {
        throw work_error(fmt::format("the firmware crashed after {:.6f} s: {}",
                                     board_time_s(board_), board_complaint(board_)));
    }
    if (board_state(board_) == BOARD_ASLEEP) {
        throw work_error(fmt::format("the firmware sleeps with interrupts off after {:.6f} s",
                                     board_time_s(board_)));
    }
}

void simulated_board::run_ms(double ms)
{
    board_run_ms(board_, ms);
    check();
}

void simulated_board::run_until(std::uint64_t cycle)
{
    board_run_until(board_, cycle);
    check();
}

void simulated_board::send(const std::string &text)
{
    board_send(board_, text.data(), text.size());
}

std::string simulated_board::take_output()
{
    std::string text;
    text.swap(output_);
    return text;
}

namespace
{
/* Whether the last whole line is the end of an answer. */
bool answered(const std::string &text)
{
    if (text.empty() || text.back() != '\n') {
        return false;
    }
    const std::size_t before = text.find_last_of('\n', text.size() - 2);
    const std::size_t begin = before == std::string::npos ? 0 : before + 1;
    const std::string line = text.substr(begin, text.size() - begin);
    return line == "ok\r\n" || line == "ok\n" || line.rfind("error:", 0) == 0;
}
} // namespace

std::string simulated_board::command(const std::string &line, double limit_ms)
{
    send(line + "\n");
    std::string text;
    for (double waited_ms = 0.0; waited_ms < limit_ms && !answered(text); waited_ms += 1.0) {
        run_ms(1.0);
        text += take_output();
    }
    return text;
}

eeprom_file::eeprom_file(std::string path, board_t *board) : path_(std::move(path)), board_(board)
{
    if (path_.empty()) {
        return;
    }
    check_place(path_);
    if (!std::filesystem::exists(path_)) {
        return;
    }
    const std::string content = read_bytes(path_);
    if (content.size() != BOARD_EEPROM_BYTES) {
        throw input_error(path_, 0, 0,
                          fmt::format("has {} bytes, an EEPROM has {}; name another file",
                                      content.size(), BOARD_EEPROM_BYTES));
    }
    content.copy(reinterpret_cast<char *>(board_eeprom(board_)), content.size());
}

void eeprom_file::save_when_idle()
{
    const std::uint64_t writes = board_eeprom_writes(board_);
    idle_calls_ = writes == seen_writes_ && !board_eeprom_busy(board_) ? idle_calls_ + 1 : 0;
    seen_writes_ = writes;
    if (writes != saved_writes_ && idle_calls_ > 100) {
        save();
    }
}

void eeprom_file::save()
{
    saved_writes_ = board_eeprom_writes(board_);
    if (!path_.empty()) {
        write_file_whole(path_, std::string(reinterpret_cast<const char *>(board_eeprom(board_)),
                                            BOARD_EEPROM_BYTES));
    }
}

} // namespace ninespring
