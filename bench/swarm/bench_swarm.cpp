/* The board's swarm: lives drawn from seeds, each judged; what fails is shrunk to few events and
 * left as a file that replays. */
#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>

#include "run.hpp"
#include "simulated_board.h"

using namespace swarm;

namespace
{

/* Delta debugging (Zeller): leaves out ever smaller parts of the events as long as the same thing
 * breaks. */
scenario shrunk(scenario one, const std::string &broken, const std::string &elf, unsigned most)
{
    for (std::size_t part = (one.events.size() + 1) / 2; part > 0;
         part = part == 1 ? 0 : (part + 1) / 2) {
        for (std::size_t at = 0; at < one.events.size() && most > 0;) {
            scenario less = one;
            const auto begin = less.events.begin() + static_cast<std::ptrdiff_t>(at);
            const auto count = std::min(part, less.events.size() - at);
            less.events.erase(begin, begin + static_cast<std::ptrdiff_t>(count));
            --most;
            const verdict v = live(less, elf);
            if (v.broken == broken) {
                less.duration_s = std::min(less.duration_s, v.at_s + 0.1);
                one = less;
            } else {
                at += count;
            }
        }
    }
    return one;
}

std::string said(const verdict &v)
{
    return v.broken.empty() ? "holds"
                            : fmt::format("BROKEN {} at {:.2f} s: {}", v.broken, v.at_s, v.detail);
}

/* Lives that were lived before, of --resume: a line each, below one that says with which ELF. */
class kept
{
public:
    kept(const std::string &path, const std::string &elf) : path_(path)
    {
        if (path.empty()) {
            return;
        }
        std::ifstream program(elf, std::ios::binary);
        const std::string bytes(std::istreambuf_iterator<char>(program), {});
        const std::string head = fmt::format("elf {:016x}", std::hash<std::string>{}(bytes));
        std::ifstream in(path);
        std::string line;
        if (!std::getline(in, line)) {
            std::ofstream(path) << head << '\n';
        } else if (line != head) {
            throw std::runtime_error(path + ": of another ELF: begin another file");
        }
        while (std::getline(in, line)) {
            std::istringstream words(line);
            std::uint64_t seed;
            verdict v;
            if (words >> seed >> v.simulated_s >> v.answers >> v.hottest_c >> v.broken) {
                v.broken = v.broken == "-" ? "" : v.broken;
                lives_[seed] = v;
            }
        }
    }
    const verdict *find(std::uint64_t seed) const
    {
        const auto found = lives_.find(seed);
        return found == lives_.end() ? nullptr : &found->second;
    }
    void add(std::uint64_t seed, const verdict &v) const
    {
        if (!path_.empty()) {
            std::ofstream(path_, std::ios::app)
                << fmt::format("{} {} {} {} {}\n", seed, v.simulated_s, v.answers, v.hottest_c,
                               v.broken.empty() ? "-" : v.broken);
        }
    }

private:
    std::string path_;
    std::map<std::uint64_t, verdict> lives_;
};

int replay(const std::vector<std::string> &files, const std::string &elf, bool trace)
{
    int broken = 0;
    for (const std::string &file : files) {
        std::ifstream in(file);
        if (!in) {
            fmt::print(stderr, "bench_swarm: {}: cannot be read\n", file);
            return 2;
        }
        try {
            const verdict v = live(read(in), elf, trace);
            fmt::print("{}: {}\n", file, said(v));
            broken += v.broken.empty() ? 0 : 1;
        } catch (const std::runtime_error &error) {
            fmt::print(stderr, "bench_swarm: {}: {}\n", file, error.what());
            return 2;
        }
    }
    return broken == 0 ? 0 : 1;
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App app{"The firmware with its invariants checked, in a simulated board, under everything "
                 "at once: one seed a life."};
    unsigned runs = 20;
    std::uint64_t seed = 1;
    std::string elf = ninespring::default_elf("firmware_checked.elf"), json, resume, folder = ".";
    std::vector<std::string> files;
    bool trace = false;
    unsigned tries = 60;
    app.add_option("--runs", runs, "lives, with seeds from --seed on")->capture_default_str();
    app.add_option("--seed", seed)->capture_default_str();
    app.add_option("--replay", files, "files that a failing seed left, instead of drawing");
    app.add_option("--shrink", tries, "lives spent to shrink one that fails; 0: as it is")
        ->capture_default_str();
    app.add_option("-o", folder, "where to leave swarm-SEED.txt of what fails")
        ->capture_default_str();
    app.add_option("--elf", elf)->capture_default_str();
    app.add_option("--resume", resume,
                   "file that keeps each life; those in it are not lived again");
    app.add_option("--json", json, "the figures, for programs");
    app.add_flag("--trace", trace, "what is typed, answered and done, on stderr");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError &error) {
        return app.exit(error) == 0 ? 0 : 2;
    }
    if (!files.empty()) {
        return replay(files, elf, trace);
    }
    std::map<std::string, unsigned> drawn, broken;
    double simulated_s = 0.0;
    double hottest_c = 0.0;
    unsigned answers = 0;
    std::unique_ptr<kept> before;
    try {
        before = std::make_unique<kept>(resume, elf);
    } catch (const std::runtime_error &error) {
        fmt::print(stderr, "bench_swarm: {}\n", error.what());
        return 2;
    }
    for (unsigned n = 0; n < runs; ++n) {
        const scenario one = draw(seed + n);
        for (const event &e : one.events) {
            if (e.what != kind::say) {
                ++drawn[name_of(e.what)];
            }
        }
        verdict v;
        const verdict *const was = before->find(one.seed);
        try {
            v = was != nullptr ? *was : live(one, elf, trace);
        } catch (const std::runtime_error &error) {
            fmt::print(stderr, "bench_swarm: {}\n", error.what());
            return 2;
        }
        simulated_s += v.simulated_s;
        answers += v.answers;
        hottest_c = std::max(hottest_c, v.hottest_c);
        if (!v.broken.empty()) {
            ++broken[v.broken];
        }
        if (was != nullptr) {
            continue;
        }
        if (v.broken.empty()) {
            before->add(one.seed, v);
            continue;
        }
        fmt::print("seed {}: {}\n", one.seed, said(v));
        const scenario less = tries > 0 ? shrunk(one, v.broken, elf, tries) : one;
        const std::string file = fmt::format("{}/swarm-{}.txt", folder, one.seed);
        std::ofstream out(file);
        out << "# " << said(v) << '\n';
        write(out, less);
        fmt::print("    {} of {} events left: {}\n", less.events.size(), one.events.size(), file);
        std::fflush(stdout);
        before->add(one.seed, v);
    }
    unsigned failed = 0;
    fmt::print("runs {}, simulated {:.2f} h, answers {}, hottest {:.1f} degC\n", runs,
               simulated_s / 3600.0, answers, hottest_c);
    for (const auto &[name, count] : drawn) {
        fmt::print("  drawn {:12} {}\n", name, count);
    }
    for (const auto &[name, count] : broken) {
        fmt::print("  BROKEN {:11} {}\n", name, count);
        failed += count;
    }
    if (!json.empty()) {
        const std::string command = fmt::format("bench_swarm --runs {} --seed {}", runs, seed);
        nlohmann::json figures = nlohmann::json::array();
        const auto figure = [&](const std::string &name, nlohmann::json value, const char *unit,
                                const char *target) {
            figures.push_back({{"figure", name},
                               {"value", value},
                               {"unit", unit},
                               {"target", target},
                               {"command", command}});
        };
        figure("lives", runs, "1", "");
        figure("simulated hours", simulated_s / 3600.0, "h", ">= 200");
        figure("lives in which something that must hold was broken", failed, "1", "0");
        figure("hottest that any spring came", hottest_c, "degC", "");
        figure("lines answered", answers, "1", "");
        for (const auto &[name, count] : drawn) {
            figure(fmt::format("faults drawn: {}", name), count, "1", "");
        }
        std::ofstream(json) << figures.dump(1) << '\n';
    }
    return failed == 0 ? 0 : 1;
}
