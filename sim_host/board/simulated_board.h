/* What it is for: the simulated Mega as an object: its console as text, its errors as exceptions.
 * What it owns: the board and what it has sent; the file that keeps its EEPROM.
 * What it never does: know what the firmware's words mean. */
#ifndef SIMULATED_BOARD_H
#define SIMULATED_BOARD_H

#include <cstdint>
#include <string>

#include "board.h"

namespace ninespring
{

/* Where the avr build beside this program puts an ELF. */
std::string default_elf(const std::string &name);

class simulated_board
{
public:
    /* Fails (input_error) if and only if the ELF is refused or the plant has more than nine
     * springs. */
    simulated_board(const std::string &elf, plant_t *plant, std::uint64_t seed,
                    double shunt_noise_v = 0.0, double bus_noise_v = 0.0);
    ~simulated_board();
    simulated_board(const simulated_board &) = delete;
    simulated_board &operator=(const simulated_board &) = delete;

    board_t *get() { return board_; }
    /* Both fail (work_error) if and only if the program crashes. */
    void run_ms(double ms);
    void run_until(std::uint64_t cycle);
    void send(const std::string &text);
    /* What the board has sent since the last call. */
    std::string take_output();
    /* Sends a line and runs until `ok` or `error:N ...` has come or limit_ms have passed; gives all
     * that came. */
    std::string command(const std::string &line, double limit_ms = 1000.0);

private:
    void check();
    board_t *board_;
    std::string output_;
};

/* An EEPROM that outlives the program. Without a path it does nothing. */
class eeprom_file
{
public:
    /* Fails (input_error) if and only if the file is there and has another size than the EEPROM. */
    eeprom_file(std::string path, board_t *board);
    /* Call it in each round of a loop: it writes the file when the firmware has written and has
     * then left the EEPROM alone for a hundred rounds. */
    void save_when_idle();
    void save();

private:
    std::string path_;
    board_t *board_;
    std::uint64_t saved_writes_ = 0;
    std::uint64_t seen_writes_ = 0;
    unsigned idle_calls_ = 0;
};

} // namespace ninespring
#endif
