#include "swarm_bench.hpp"

#include "parallel.hpp"
#include "written.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fmt/format.h>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vector>

extern "C" {
#include "shares.h"
#include "swarm.h"
}

namespace swarm_bench
{

namespace
{

using json_t = nlohmann::ordered_json;
using clusters_t = std::vector<shares_run_t>;

const double hot_c = 120.0;
const double inside_least = 0.95; // of a run's time

struct spring_t {
    bool driven; // from the beginning
    bool broken; // its sensor is, or the board is off for one that is
    score_spring_t score;
    losses_spring_t losses;
    [[nodiscard]] bool counts() const { return !broken && losses.judged_s > LOSSES_LOST_S; }
    [[nodiscard]] bool lost() const { return !std::isnan(losses.lost_at_s); }
    [[nodiscard]] bool silent() const { return !std::isnan(losses.silent_at_s); }
};

struct run_t {
    int index = 0;
    swarm_group_t group = SWARM_NOTHING;
    swarm_diode_t diode = SWARM_SYNCHRONOUS;
    std::uint64_t drawn = 0;
    bool steps = false, second = false, levels = false, tells = false, told = false, done = false;
    kinetics_law_t law = KINETICS_COSINE;
    double hottest_c = 0.0, wall_s = 0.0;
    std::string says;
    std::vector<spring_t> springs;

    [[nodiscard]] int count(const std::function<bool(const spring_t &)> &hit) const
    {
        return static_cast<int>(std::count_if(springs.begin(), springs.end(), hit));
    }
    [[nodiscard]] bool hot() const { return hottest_c > hot_c; }
    [[nodiscard]] int lost() const
    {
        return count([](const spring_t &s) { return s.counts() && s.lost(); });
    }
    [[nodiscard]] int silent() const
    {
        return count([](const spring_t &s) { return s.counts() && s.silent(); });
    }
};

const char *const group_names[SWARM_GROUPS] = {"none", "load", "surroundings"};

// A broken sensor may rightly switch off the whole board.
bool is_off_for_another(const swarm_case_t &drawn, const losses_spring_t &spring)
{
    const bool board =
        spring.fault == SAFETY_FAULT_STUCK_ON || spring.fault == SAFETY_FAULT_SUPPLY_CURRENT;
    return board && std::any_of(std::begin(drawn.broken), std::end(drawn.broken),
                                [](bool broken) { return broken; });
}

void drive(const options_t &options, run_t &run, FILE *trace)
{
    const auto drawn = std::make_unique<swarm_case_t>();
    const auto result = std::make_unique<run_result_t>();
    swarm_draw(options.seed, run.index, options.seconds, drawn.get());
    drawn->run.driver = options.driver;
    run.group = drawn->group;
    run.diode = drawn->diode;
    run.drawn = drawn->drawn;
    run.steps = drawn->steps;
    run.second = drawn->second;
    run.levels = drawn->levels;
    run.tells = drawn->tells;
    run.told = drawn->told;
    run.law = drawn->run.world.spring[0].alloy.law;
    run.says = drawn->says;
    run.done = run_case(&drawn->run, result.get(), trace);
    run.wall_s = result->wall_s;
    run.hottest_c = -std::numeric_limits<double>::infinity();
    for (int k = 0; run.done && k < result->score.springs; k++) {
        const score_spring_t &score = result->score.spring[k];
        run.springs.push_back(
            {drawn->run.on[k],
             drawn->broken[k] || is_off_for_another(*drawn, result->losses.spring[k]), score,
             result->losses.spring[k]});
        run.hottest_c = std::max(run.hottest_c, score.hottest_c);
    }
}

std::vector<run_t> drive_all(const options_t &options)
{
    std::vector<run_t> runs(static_cast<std::size_t>(options.runs));
    for (std::size_t i = 0; i < runs.size(); i++)
        runs[i].index = options.first + static_cast<int>(i);
    in_parallel(runs, options.jobs, [&](run_t &run) { drive(options, run, nullptr); });
    for (const run_t &run : runs)
        if (!run.done)
            throw std::runtime_error(fmt::format(
                "run {}: the world or the controller refuses its parameters", run.index));
    return runs;
}

// A column: which runs.
struct part_t {
    const char *name;
    bool (*has)(const run_t &);
};

const part_t parts[] = {
    {"all", [](const run_t &) { return true; }},
    {"lasting surroundings", [](const run_t &r) { return r.group == SWARM_SURROUNDINGS; }},
    {"lasting load", [](const run_t &r) { return r.group == SWARM_LOAD; }},
    {"neither", [](const run_t &r) { return r.group == SWARM_NOTHING; }},
    {"nothing steps", [](const run_t &r) { return !r.steps; }},
    {"second truth", [](const run_t &r) { return r.second; }},
    {"levels", [](const run_t &r) { return r.levels; }},
};

// A row: of each run, how many of how many.
struct figure_t {
    const char *name;
    const char *unit;
    const char *target;        // in all runs; "" where it is only for scale
    const char *target_steady; // where nothing steps; nullptr: none of its own
    const char *target_high;   // in all runs, of the interval's upper end; nullptr: none
    int digits;
    shares_run_t (*of)(const run_t &);
    bool of_thoughts = true; // what a controller believes or says counts, not only what is true
    [[nodiscard]] bool is_share() const { return std::string(unit) == "%"; }
};

template <typename hits_t, typename of_t>
shares_run_t sums(const run_t &run, const hits_t &hits, const of_t &of)
{
    shares_run_t sum{0.0, 0.0};
    for (const spring_t &s : run.springs)
        if (!s.broken) {
            sum.hits += static_cast<double>(hits(s));
            sum.of += static_cast<double>(of(s));
        }
    return sum;
}

shares_run_t hold(const run_t &run)
{
    return sums(
        run, [](const spring_t &s) { return s.score.hold_c; },
        [](const spring_t &s) { return s.score.hold_s; });
}

shares_run_t inside(const run_t &run)
{
    return sums(
        run, [](const spring_t &s) { return s.score.inside_s; },
        [](const spring_t &s) { return s.score.known_s; });
}

template <typename hit_t> shares_run_t springs(const run_t &run, const hit_t &hit)
{
    return sums(
        run, [&](const spring_t &s) { return s.counts() && hit(s); },
        [](const spring_t &s) { return s.counts(); });
}

const figure_t figures[] = {
    {"runs that hold: no spring lost, none above 120 degC", "%", "", nullptr, nullptr, 1,
     [](const run_t &r) {
         return shares_run_t{r.lost() == 0 && !r.hot() ? 1.0 : 0.0, 1.0};
     },
     false},
    {"runs with any spring above 120 degC", "%", "<= 0.3", nullptr, "<= 0.6", 2,
     [](const run_t &r) {
         return shares_run_t{r.hot() ? 1.0 : 0.0, 1.0};
     },
     false},
    {"driven springs below 90 % for more than 60 s on end, after 210 s", "%", "<= 0.5", nullptr,
     nullptr, 2,
     [](const run_t &r) { return springs(r, [](const spring_t &s) { return s.lost(); }); }, false},
    {"the same, and nothing said for so long", "%", "<= 0.05", nullptr, nullptr, 2,
     [](const run_t &r) { return springs(r, [](const spring_t &s) { return s.silent(); }); }},
    {"the same, and nothing said but `blind`", "%", "", nullptr, nullptr, 2,
     [](const run_t &r) {
         return springs(r, [](const spring_t &s) { return s.losses.blind_only && !s.silent(); });
     }},
    {"below 90 % for more than 20 s on end, and nothing said but `blind`", "%", "", nullptr,
     nullptr, 2,
     [](const run_t &r) {
         return springs(r, [](const spring_t &s) { return s.score.silent_s > 0.0; });
     }},
    {"time at 95 % or above, driven springs, after 210 s", "%", ">= 97", ">= 99.5", nullptr, 2,
     [](const run_t &r) {
         return sums(
             r, [](const spring_t &s) { return s.losses.there_s; },
             [](const spring_t &s) { return s.losses.judged_s; });
     },
     false},
    {"of that, said to be away for nothing: not `blind` either", "%", "", nullptr, nullptr, 2,
     [](const run_t &r) {
         return sums(
             r, [](const spring_t &s) { return s.losses.away_there_s; },
             [](const spring_t &s) { return s.losses.there_s; });
     }},
    {"after a lasting step of the surroundings: back at 95 % and settled within 120 s", "%",
     ">= 99", nullptr, nullptr, 2,
     [](const run_t &r) {
         return sums(
             r, [](const spring_t &s) { return s.losses.back == LOSSES_BACK; },
             [](const spring_t &s) { return s.losses.back != LOSSES_NOT_JUDGED; });
     },
     false},
    {"mean hold where the resistance tells the phase, alloy as declared", "degC", "<= 84", nullptr,
     nullptr, 1,
     [](const run_t &r) {
         return r.tells && !r.told ? hold(r) : shares_run_t{0.0, 0.0};
     }},
    {"mean hold where it does not tell it", "degC", "<= 93", nullptr, nullptr, 1,
     [](const run_t &r) {
         return !r.tells && !r.told ? hold(r) : shares_run_t{0.0, 0.0};
     }},
    {"time in which true temperature and phase are within bounds", "%", ">= 99", nullptr, nullptr,
     2, inside},
    {"runs in which they are for less than 95 % of the time", "%", "<= 10", nullptr, nullptr, 1,
     [](const run_t &r) {
         const auto [inside_s, known_s] = inside(r);
         return shares_run_t{inside_s < inside_least * known_s ? 1.0 : 0.0,
                             known_s > 0.0 ? 1.0 : 0.0};
     }},
    {"sights of lost phase that are none: whole, 5 K or more above martensite start", "%", "",
     nullptr, nullptr, 1,
     [](const run_t &r) {
         return sums(
             r, [](const spring_t &s) { return s.score.false_losses; },
             [](const spring_t &s) { return s.score.losses_seen; });
     }},
    {"driven springs with a fault, their sensors sound", "%", "", nullptr, nullptr, 2,
     [](const run_t &r) {
         return springs(r, [](const spring_t &s) { return s.losses.fault != 0; });
     }},
};

shares_t measured(const figure_t &figure, const part_t &part, const std::vector<run_t> &runs)
{
    clusters_t clusters;
    for (const run_t &run : runs)
        if (part.has(run))
            clusters.push_back(figure.of(run));
    shares_t x = figure.is_share()
                     ? shares_share(clusters.data(), static_cast<int>(clusters.size()))
                     : shares_mean(clusters.data(), static_cast<int>(clusters.size()));
    if (figure.is_share())
        for (double *value : {&x.value, &x.low, &x.high})
            *value *= 100.0;
    return x;
}

// Of all runs, and where a row has one of its own of those in which nothing steps.
const char *target(const figure_t &figure, const part_t &part)
{
    if (std::string(part.name) == "all")
        return figure.target;
    const bool steady = std::string(part.name) == "nothing steps";
    return steady && figure.target_steady != nullptr ? figure.target_steady : "";
}

std::string cell(const figure_t &figure, const shares_t &x)
{
    if (std::isnan(x.value))
        return "-";
    if (std::isnan(x.low))
        return fmt::format("{:.{}f}", x.value, figure.digits);
    return fmt::format("{:.{}f} ({:.{}f} to {:.{}f})", x.value, figure.digits, x.low, figure.digits,
                       x.high, figure.digits);
}

int runs_of(const part_t &part, const std::vector<run_t> &runs)
{
    return static_cast<int>(std::count_if(runs.begin(), runs.end(), part.has));
}

int springs_of(const part_t &part, const std::vector<run_t> &runs)
{
    int sum = 0;
    for (const run_t &run : runs)
        if (part.has(run))
            sum += run.count([](const spring_t &s) { return s.counts(); });
    return sum;
}

// Of driven springs whose sensors are sound, how many had which; and of the others.
std::string faults(const std::vector<run_t> &runs)
{
    std::map<int, std::pair<int, int>> codes;
    for (const run_t &run : runs)
        for (const spring_t &s : run.springs)
            if (s.losses.fault != 0)
                (s.broken ? codes[s.losses.fault].second : codes[s.losses.fault].first)++;
    std::string line;
    for (const auto &[code, springs] : codes)
        line += fmt::format("{}{}: {} ({})", line.empty() ? "" : ", ", code, springs.first,
                            springs.second);
    return "Faults by code, driven springs with sound sensors (with broken ones): " +
           (line.empty() ? "none" : line) + ".";
}

// Of driven springs with sound sensors: the board says that one lies, by what freewheels.
std::string falsely_lying(const std::vector<run_t> &runs)
{
    static const char *const names[SWARM_DIODES] = {"synchronous", "diodes, declared",
                                                    "diodes, not declared"};
    std::string line;
    for (int diode = 0; diode < SWARM_DIODES; diode++) {
        clusters_t clusters;
        int wrong = 0, all = 0;
        for (const run_t &run : runs)
            if (run.diode == diode) {
                const shares_run_t one = springs(run, [](const spring_t &s) {
                    return s.losses.fault == SAFETY_FAULT_SENSOR_MISMATCH;
                });
                clusters.push_back(one);
                wrong += static_cast<int>(one.hits);
                all += static_cast<int>(one.of);
            }
        const shares_t x = shares_share(clusters.data(), static_cast<int>(clusters.size()));
        line +=
            fmt::format("{} {} {} of {}, {:.2f} % ({:.2f} to {:.2f})", diode == 0 ? "" : ";",
                        names[diode], wrong, all, 100.0 * x.value, 100.0 * x.low, 100.0 * x.high);
    }
    return "Driven springs with sound sensors that are given up for them (fault 15):" + line + ".";
}

// The tenth of the runs in which bounds hold least.
std::string worst_tenth(const std::vector<run_t> &runs)
{
    std::vector<double> each;
    for (const run_t &run : runs)
        if (const auto [inside_s, known_s] = inside(run); known_s > 0.0)
            each.push_back(100.0 * inside_s / known_s);
    std::sort(each.begin(), each.end());
    const std::size_t tenth = std::max<std::size_t>(each.size() / 10, 1);
    double sum = 0.0;
    for (std::size_t i = 0; i < tenth && i < each.size(); i++)
        sum += each[i];
    return each.empty()
               ? std::string()
               : fmt::format("Within bounds in the worst tenth of the runs: {:.1f} % of the "
                             "time; nine tenths are above {:.1f} %.",
                             sum / static_cast<double>(tenth), each[tenth - 1]);
}

bool meets(const char *wanted, double value)
{
    const double limit = std::strtod(wanted + 3, nullptr); // "<= 5" or ">= 5"
    return wanted[0] == '<' ? value <= limit : value >= limit;
}

// Whether the estimates meet their targets; the intervals are for the reader.
const char *verdict(const figure_t &figure, const std::vector<run_t> &runs)
{
    bool judged = false, met = true;
    for (const part_t &part : parts) {
        const char *wanted = target(figure, part);
        const shares_t x = measured(figure, part, runs);
        if (*wanted == '\0' || std::isnan(x.value))
            continue;
        judged = true;
        const bool all = figure.target_high != nullptr && part.has == parts[0].has;
        met = met && meets(wanted, x.value) && (!all || meets(figure.target_high, x.high));
    }
    return !judged ? "" : met ? "met" : "**missed**";
}

std::string table(const options_t &options, const std::vector<run_t> &runs)
{
    std::string page = "| figure | target | |", rule = "|---|---|---|";
    for (const part_t &part : parts) {
        page += fmt::format(" {} |", part.name);
        rule += "---|";
    }
    page += "\n" + rule + "\n| runs | | |";
    for (const part_t &part : parts)
        page += fmt::format(" {} |", runs_of(part, runs));
    page += "\n| driven springs that are judged | | |";
    for (const part_t &part : parts)
        page += fmt::format(" {} |", springs_of(part, runs));
    for (const figure_t &figure : figures) {
        if (options.driver == RUN_KNOWS && figure.of_thoughts)
            continue;
        page += fmt::format("\n| {}, {} | {}{} | {} |", figure.name, figure.unit, figure.target,
                            figure.target_steady != nullptr
                                ? fmt::format("; nothing steps {}", figure.target_steady)
                            : figure.target_high != nullptr
                                ? fmt::format("; upper end {}", figure.target_high)
                                : "",
                            verdict(figure, runs));
        for (const part_t &part : parts)
            page += fmt::format(" {} |", cell(figure, measured(figure, part, runs)));
    }
    if (options.driver == RUN_KNOWS)
        return page + "\n";
    return page + "\n\n" + faults(runs) + "\n" + falsely_lying(runs) + "\n" + worst_tenth(runs) +
           "\n";
}

// Springs lost and runs above 120 degC among those runs and among the others.
void print_cause(const std::vector<run_t> &runs, const std::function<bool(const run_t &)> &has,
                 const std::string &says)
{
    shares_run_t lost[2] = {}, hot[2] = {};
    for (const run_t &run : runs) {
        const auto with = static_cast<std::size_t>(has(run));
        const shares_run_t one = springs(run, [](const spring_t &s) { return s.lost(); });
        lost[with].hits += one.hits;
        lost[with].of += one.of;
        hot[with].hits += run.hot();
        hot[with].of += 1.0;
    }
    const auto percent = [](const shares_run_t &x) {
        return x.of > 0.0 ? fmt::format("{:.1f}", 100.0 * x.hits / x.of) : std::string("-");
    };
    fmt::print("{:>5} {:>7} {:>8} {:>8} {:>8}  {}\n", hot[1].of, percent(lost[1]),
               "(" + percent(lost[0]) + ")", percent(hot[1]), "(" + percent(hot[0]) + ")", says);
}

// Where to look first. It is no proof: everything else is drawn, too.
void print_causes(const std::vector<run_t> &runs)
{
    static const char *const laws[KINETICS_COUNT] = {"cosine",   "linear",  "exponential",
                                                     "Preisach", "R-phase", "play"};
    fmt::print("\n{:>5} {:>16} {:>17}  with (without) this\n", "runs", "springs lost, %",
               "> 120 degC, %");
    double probability = 0.0;
    for (int i = 0; const char *says = swarm_says(i, &probability); i++)
        print_cause(
            runs, [i](const run_t &run) { return (run.drawn >> i & 1u) != 0; }, says);
    for (int law = 0; law < KINETICS_COUNT; law++)
        print_cause(
            runs, [law](const run_t &run) { return run.law == law; },
            std::string("law: ") + laws[law]);
}

json_t finite(double value)
{
    return std::isfinite(value) ? json_t(value) : json_t(nullptr);
}

json_t rows(const options_t &options, const std::vector<run_t> &runs)
{
    json_t list = json_t::array();
    for (const figure_t &figure : figures)
        for (const part_t &part : parts) {
            if (options.driver == RUN_KNOWS && figure.of_thoughts)
                continue;
            const shares_t x = measured(figure, part, runs);
            if (std::isnan(x.value))
                continue;
            json_t row;
            row["figure"] = fmt::format("{}: {}", part.name, figure.name);
            row["value"] = x.value;
            row["low"] = finite(x.low);
            row["high"] = finite(x.high);
            row["unit"] = figure.unit;
            row["target"] = target(figure, part);
            row["command"] =
                fmt::format("build/host/bench/worlds/bench_worlds --swarm {} --seed {} --first {} "
                            "--seconds {:g}{}",
                            options.runs, options.seed, options.first, options.seconds,
                            options.driver == RUN_KNOWS ? " --knows" : "");
            list.push_back(row);
            if (figure.target_high != nullptr && part.has == parts[0].has) {
                row["figure"] = fmt::format("{}: {}, upper end", part.name, figure.name);
                row["value"] = x.high;
                row["target"] = figure.target_high;
                row.erase("low");
                row.erase("high");
                list.push_back(row);
            }
        }
    return list;
}

// What --against reads: every run by itself.
json_t kept(const options_t &options, const std::vector<run_t> &runs)
{
    json_t file;
    file["seed"] = options.seed;
    file["seconds"] = options.seconds;
    json_t &list = file["runs"] = json_t::array();
    for (const run_t &run : runs) {
        json_t one;
        one["run"] = run.index;
        one["group"] = group_names[run.group];
        one["steps"] = run.steps;
        one["second"] = run.second;
        one["levels"] = run.levels;
        one["tells"] = run.tells;
        one["hottest_c"] = run.hottest_c;
        const auto [inside_s, known_s] = inside(run);
        one["inside"] = finite(inside_s / known_s);
        double judged_s = 0.0, there_s = 0.0;
        for (const char *name : {"lost", "silent", "not_back", "faults"})
            one[name] = json_t::array();
        for (std::size_t k = 0; k < run.springs.size(); k++) {
            const spring_t &s = run.springs[k];
            if (s.broken)
                continue;
            judged_s += s.losses.judged_s;
            there_s += s.losses.there_s;
            if (s.counts() && s.lost())
                one["lost"].push_back(k + 1);
            if (s.counts() && s.silent())
                one["silent"].push_back(k + 1);
            if (s.losses.back == LOSSES_NOT_BACK)
                one["not_back"].push_back(k + 1);
            if (s.losses.fault != 0)
                one["faults"].push_back(s.losses.fault);
        }
        one["there"] = finite(there_s / judged_s);
        one["says"] = run.says;
        list.push_back(one);
    }
    return file;
}

json_t read(const std::string &path)
{
    std::ifstream file(path);
    json_t content = json_t::parse(file, nullptr, false);
    if (!content.is_object() || !content.contains("runs"))
        throw std::runtime_error(path + ": not a file of --keep");
    return content;
}

std::string numbers(const std::vector<int> &list)
{
    std::string line;
    for (int number : list)
        line += fmt::format("{}{}", line.empty() ? "" : " ", number);
    return line;
}

// Each run against the same run of another state of the code.
struct pairs_t {
    std::string what;
    std::vector<int> better, worse;
    int same = 0;
    void add(int run, double before, double now) // less is better
    {
        if (now < before)
            better.push_back(run);
        else if (now > before)
            worse.push_back(run);
        else
            same++;
    }
    void print() const
    {
        const auto b = static_cast<int>(better.size()), w = static_cast<int>(worse.size());
        fmt::print("{}: better {}, worse {}, same {}; by chance p = {:.3g}\n", what, b, w, same,
                   shares_sign_test(b, w));
        if (b > 0)
            fmt::print("  better: {}\n", numbers(better));
        if (w > 0)
            fmt::print("  worse:  {}\n", numbers(worse));
    }
};

void compare(const json_t &before, const json_t &now)
{
    if (before.at("seed") != now.at("seed") || before.at("seconds") != now.at("seconds"))
        throw std::runtime_error("the file is of another seed or length of runs");
    std::map<int, json_t> by_run;
    for (const json_t &run : before.at("runs"))
        by_run[run.at("run").get<int>()] = run;
    pairs_t hot{"above 120 degC", {}, {}}, lost{"springs lost", {}, {}},
        silent{"springs lost in silence", {}, {}}, not_back{"springs not back", {}, {}},
        inside_less{"mostly outside of the bounds", {}, {}};
    clusters_t there, within;
    int pairs = 0, other = 0;
    for (const json_t &run : now.at("runs")) {
        const int index = run.at("run").get<int>();
        const auto found = by_run.find(index);
        if (found == by_run.end())
            continue;
        const json_t &was = found->second;
        if (was.at("says") != run.at("says")) { // the distributions have changed
            other++;
            continue;
        }
        pairs++;
        const auto size = [](const json_t &r, const char *name) {
            return static_cast<double>(r.at(name).size());
        };
        const auto over = [](const json_t &r) {
            return r.at("hottest_c").get<double>() > hot_c ? 1.0 : 0.0;
        };
        hot.add(index, over(was), over(run));
        lost.add(index, size(was, "lost"), size(run, "lost"));
        silent.add(index, size(was, "silent"), size(run, "silent"));
        not_back.add(index, size(was, "not_back"), size(run, "not_back"));
        for (const auto &[name, list] : {std::pair("there", &there), std::pair("inside", &within)})
            if (!was.at(name).is_null() && !run.at(name).is_null())
                list->push_back({run.at(name).get<double>() - was.at(name).get<double>(), 1.0});
    }
    fmt::print("\nAgainst what was kept: {} same runs{}\n", pairs,
               other > 0 ? fmt::format(", {} that are drawn otherwise left out", other) : "");
    for (const pairs_t *each : {&hot, &lost, &silent, &not_back})
        each->print();
    for (const auto &[name, list] :
         {std::pair("time at 95 %", &there), std::pair("time within bounds", &within)}) {
        const shares_t x = shares_mean(list->data(), static_cast<int>(list->size()));
        fmt::print("{}: {:+.2f} % of the run ({:+.2f} to {:+.2f})\n", name, 100.0 * x.value,
                   100.0 * x.low, 100.0 * x.high);
    }
}

} // namespace

void measure(const options_t &options)
{
    const json_t before = options.against.empty() ? json_t() : read(options.against);
    const std::vector<run_t> runs = drive_all(options);
    const std::string page = table(options, runs);
    double spent_s = 0.0;
    for (const run_t &run : runs)
        spent_s += run.wall_s;
    fmt::print("{}", page);
    print_causes(runs);
    fmt::print("\nRuns with a spring lost (silent, above 120 degC), by group:\n");
    for (const run_t &run : runs)
        if (run.lost() > 0 || run.hot())
            fmt::print("{:>6} {:<13}{} lost {} of {}, silent {}, hottest {:.1f} degC: {}\n",
                       run.index, group_names[run.group], run.second ? "2nd" : "   ", run.lost(),
                       run.count([](const spring_t &s) { return s.counts(); }), run.silent(),
                       run.hottest_c, run.says);
    fmt::print("{:.0f} runs a minute on one core, {:.0f} x real time\n",
               60.0 * options.runs / spent_s, options.runs * options.seconds / spent_s);
    const json_t now = kept(options, runs);
    if (!before.is_null())
        compare(before, now);
    write(options.json, rows(options, runs).dump(1) + "\n");
    write(options.markdown, page);
    write(options.keep, now.dump() + "\n");
}

void replay(const options_t &options, int index, const std::string &trace)
{
    std::unique_ptr<FILE, int (*)(FILE *)> file(nullptr, std::fclose);
    if (!trace.empty()) {
        file.reset(std::fopen(trace.c_str(), "w"));
        if (!file)
            throw std::runtime_error(trace + ": cannot be written");
    }
    run_t run;
    run.index = index;
    drive(options, run, file.get());
    if (!run.done)
        throw std::runtime_error("the world or the controller refuses its parameters");
    fmt::print("run {} of seed {}, {}{}: {}\n", index, options.seed, group_names[run.group],
               run.second ? ", second truth" : "", run.says);
    for (std::size_t k = 0; k < run.springs.size(); k++) {
        const spring_t &s = run.springs[k];
        std::string line =
            fmt::format("spring {}: {}{}hottest {:.1f} degC", k + 1, s.driven ? "driven, " : "",
                        s.broken ? "broken, " : "", s.score.hottest_c);
        if (s.losses.judged_s > 0.0)
            line += fmt::format(", at 95 % for {:.1f} % of {:.0f} s",
                                100.0 * s.losses.there_s / s.losses.judged_s, s.losses.judged_s);
        if (s.lost())
            line +=
                fmt::format(", LOST at {:.0f} s for {:.0f} s", s.losses.lost_at_s, s.losses.lost_s);
        if (s.silent())
            line += fmt::format(", SILENT at {:.0f} s", s.losses.silent_at_s);
        if (s.losses.back != LOSSES_NOT_JUDGED)
            line += s.losses.back == LOSSES_BACK ? ", back" : ", NOT BACK";
        if (s.score.losses_seen != 0)
            line += fmt::format(", lost phase seen {} times, {} of them none", s.score.losses_seen,
                                s.score.false_losses);
        if (s.losses.fault != 0)
            line += fmt::format(", fault {}", s.losses.fault);
        if (s.score.known_s > 0.0)
            line +=
                fmt::format(", within bounds {:.1f} %", 100.0 * s.score.inside_s / s.score.known_s);
        fmt::print("{}\n", line);
    }
}

std::string list()
{
    std::string page = "The swarm draws for each run, each with its probability:\n";
    double probability = 0.0;
    for (int i = 0; const char *says = swarm_says(i, &probability); i++)
        page += fmt::format("  {:>3.0f} %  {}\n", 100.0 * probability, says);
    return page;
}

} // namespace swarm_bench
