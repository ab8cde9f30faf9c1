/* One bit turned over in a board that holds its springs hot, once a run: which leave it hotter
 * without a word? Each run goes on from the same board at the moment of the flip (fork), beside one
 * without a flip. */
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

#include "board_view.h"
#include "random.h"
#include "simulated_board.h"
#include "truth.h"

namespace
{

constexpr unsigned REGISTERS_BEGIN = 0x20, RAM_BEGIN = 0x200, RAM_END = 0x2200;
constexpr unsigned STACK_BYTES = 512; /* the deepest part of it that is ever in use, and more */
constexpr double HOTTER_K = 10.0;
constexpr unsigned SOUND_EVERY = 25; /* runs: 0.2 s */

struct result {
    std::array<double, TRUTH_SPRINGS> hottest_c;
    bool said; /* a fault, a lock, a reset: whoever looks at `?` or at the greeting sees it */
    bool off;  /* nothing is driven at the end */
    bool dead; /* `?` is not answered */
    bool crashed;
};

struct bench {
    std::unique_ptr<truth_t, void (*)(truth_t *)> truth;
    std::unique_ptr<board_t, void (*)(board_t *)> board;
    unsigned octets = 0;

    bench(std::uint64_t seed, const std::string &elf)
        : truth(truth_create(seed, 0.05, 20.0, nullptr, 0), truth_destroy),
          board(nullptr, board_destroy)
    {
        const board_array_t array = truth_array(truth.get());
        char error[512] = "";
        board_options_t options{};
        options.elf = elf.c_str();
        options.array = &array;
        options.seed = seed;
        options.shunt_noise_v = 30e-6;
        options.bus_noise_v = 1e-3;
        options.context = this;
        options.on_uart = [](void *context, std::uint64_t, std::uint8_t) {
            ++static_cast<bench *>(context)->octets;
        };
        board.reset(board_create(&options, error, sizeof error));
        if (!board) {
            throw std::runtime_error(error);
        }
    }

    void type(const std::string &line)
    {
        board_send(board.get(), line.data(), line.size());
        board_run_ms(board.get(), 200.0);
    }

    result watch(double seconds)
    {
        result r{};
        r.hottest_c.fill(-300.0);
        const unsigned resets = board_reset_count(board.get());
        for (double at_s = 0.0; at_s < seconds && !r.crashed; at_s += 0.02) {
            r.crashed = board_run_ms(board.get(), 20.0) != BOARD_RUNNING;
            for (unsigned k = 0; k < TRUTH_SPRINGS; ++k) {
                r.hottest_c[k] = std::fmax(r.hottest_c[k], truth_hottest_c(truth.get(), k));
            }
            r.said = r.said || faulted();
        }
        r.said = r.said || board_reset_count(board.get()) != resets;
        r.off = board_all_off(board.get());
        const unsigned before = octets;
        type("\n?");
        r.dead = octets == before;
        return r;
    }

    bool faulted() const
    {
        board_view_t seen{};
        bool any =
            !board_view(board.get(), "controller", &seen) || seen.locked || seen.board_fault != 0;
        for (const board_view_spring_t &spring : seen.spring) {
            any = any || spring.fault != 0;
        }
        return any;
    }
};

/* The board and all about it, as they are now, go on in a process of their own. */
template <typename Does> result apart(Does does)
{
    int ends[2];
    if (pipe(ends) != 0) {
        throw std::runtime_error("no pipe");
    }
    const pid_t child = fork();
    if (child == 0) {
        const result r = does();
        const bool written = write(ends[1], &r, sizeof r) == static_cast<ssize_t>(sizeof r);
        _exit(written ? 0 : 1);
    }
    close(ends[1]);
    result r{};
    const bool whole = child > 0 && read(ends[0], &r, sizeof r) == static_cast<ssize_t>(sizeof r);
    close(ends[0]);
    waitpid(child, nullptr, 0);
    r.crashed = r.crashed || !whole;
    return r;
}

const char *kind_of(const result &r, const result &sound)
{
    double hotter_k = -300.0;
    for (unsigned k = 0; k < TRUTH_SPRINGS; ++k) {
        hotter_k = std::fmax(hotter_k, r.hottest_c[k] - sound.hottest_c[k]);
    }
    if (hotter_k > HOTTER_K) {
        return r.said ? "hotter, said" : "HOTTER, UNSAID";
    }
    if (r.said) {
        return "said";
    }
    if (r.crashed || r.dead) {
        return "console dead";
    }
    return r.off ? "off, unsaid" : "no effect";
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App app{"Bits of RAM and registers turned over in a board that holds springs hot."};
    unsigned runs = 50, boards = 2;
    std::uint64_t seed = 1;
    double watch_s = 40.0, registers = 0.25;
    std::string elf = ninespring::default_elf("firmware.elf"), json;
    unsigned from = 0, bytes = 0;
    int one_bit = -1;
    app.add_option("--runs", runs, "flips in each board")->capture_default_str();
    app.add_option("--boards", boards, "arrays, with seeds from --seed on")->capture_default_str();
    app.add_option("--seed", seed)->capture_default_str();
    app.add_option("--watch", watch_s, "seconds after each")->capture_default_str();
    app.add_option("--registers", registers, "share of them in registers, not in RAM that is used")
        ->capture_default_str();
    app.add_option("--from", from, "address: all of them in --bytes of RAM from here");
    app.add_option("--bytes", bytes)->capture_default_str();
    app.add_option("--bit", one_bit, "always this one, 0..7");
    app.add_option("--elf", elf)->capture_default_str();
    app.add_option("--json", json, "the figures, for programs");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError &error) {
        return app.exit(error) == 0 ? 0 : 2;
    }
    std::map<std::string, unsigned> found;
    try {
        for (unsigned m = 0; m < boards; ++m) {
            random_t dice = random_seeded(seed + m, 31);
            bench b(seed + m, elf);
            board_run_ms(b.board.get(), 600.0);
            b.type("model cold\n");
            b.type("pattern 111101111\n");
            board_run_ms(b.board.get(), 45000.0);
            const unsigned used = board_static_ram_bytes(b.board.get());
            result sound{};
            for (unsigned n = 0; n < runs; ++n) {
                board_run_ms(b.board.get(), 7.0); /* another moment of the tick each time */
                unsigned address;
                if (bytes > 0) {
                    address = from + static_cast<unsigned>(random_bits(&dice) % bytes);
                } else if (random_uniform(&dice, 0.0, 1.0) < registers) {
                    address =
                        REGISTERS_BEGIN +
                        static_cast<unsigned>(random_bits(&dice) % (RAM_BEGIN - REGISTERS_BEGIN));
                } else {
                    const auto at =
                        static_cast<unsigned>(random_bits(&dice) % (used + STACK_BYTES));
                    address = at < used ? RAM_BEGIN + at : RAM_END - 1u - (at - used);
                }
                const auto any_bit = static_cast<unsigned>(random_bits(&dice) % 8u);
                const unsigned bit = one_bit < 0 ? any_bit : static_cast<unsigned>(one_bit) % 8u;
                if (n % SOUND_EVERY == 0) {
                    sound = apart([&] { return b.watch(watch_s); });
                }
                const result r = apart([&] {
                    board_flip(b.board.get(), address, static_cast<std::uint8_t>(1u << bit));
                    return b.watch(watch_s);
                });
                const char *const kind = kind_of(r, sound);
                ++found[kind];
                if (std::string(kind) != "no effect" && std::string(kind) != "said") {
                    fmt::print("seed {} run {}: 0x{:04X} bit {}: {}, {:.1f} degC\n", seed + m, n,
                               address, bit, kind,
                               *std::max_element(r.hottest_c.begin(), r.hottest_c.end()));
                    std::fflush(stdout);
                }
            }
        }
    } catch (const std::exception &error) {
        fmt::print(stderr, "bench_flips: {}\n", error.what());
        return 2;
    }
    for (const auto &[kind, count] : found) {
        fmt::print("{:15} {}\n", kind, count);
    }
    if (!json.empty()) {
        const std::string command =
            fmt::format("bench_flips --runs {} --boards {} --seed {}", runs, boards, seed);
        nlohmann::json figures = nlohmann::json::array();
        const auto figure = [&](const std::string &name, unsigned count, const char *target) {
            figures.push_back({{"figure", name},
                               {"value", count},
                               {"unit", "1"},
                               {"target", target},
                               {"command", command}});
        };
        figure("flips", runs * boards, "");
        figure("... that leave a spring hotter by 10 K unsaid", found["HOTTER, UNSAID"], "0");
        for (const char *kind :
             {"hotter, said", "said", "console dead", "off, unsaid", "no effect"}) {
            figure(fmt::format("... {}", kind), found[kind], "");
        }
        std::ofstream(json) << figures.dump(1) << '\n';
    }
    return found["HOTTER, UNSAID"] == 0 ? 0 : 1;
}
