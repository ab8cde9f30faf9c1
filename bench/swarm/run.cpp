#include "run.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <vector>

#include "board.h"
#include "board_view.h"
#include "drive_policy.h"
#include "faulty_board.hpp"
#include "safety.h"
#include "truth.h"

namespace swarm
{

namespace
{

constexpr unsigned SPRINGS = TRUTH_SPRINGS;
constexpr double SLICE_S = 0.02;
/* Above it nothing may be that can be helped. What a welded switch gives until the supply is off is
 * not: 110 K/s for the 0.28 s of docs/safety.md, and as much again. */
constexpr double HOTTEST_C = 120.0;
constexpr double WELDED_K = 62.0;
constexpr double WELDED_OFF_S = 0.5;
constexpr double UNFED_S = 0.25; /* of what gives no pulses: 0.21 s (docs/safety.md) and a tick */
constexpr double STOPPED_S = 0.003; /* '!': a byte, and 1 ms */
constexpr double HEALED_S = 0.05; /* a register is written again in each tick; and a stop's byte */
constexpr double DONE_S = 0.05;   /* what a line has changed is done in the tick after its answer */
constexpr double ANSWER_S = 12.0; /* the longest: selftest, nine springs of 0.6 s; $save 3.4 s */
constexpr double SELFTEST_S = 6.0; /* nine springs of 0.6 s, and answers that are held up */
constexpr double QUIET_S = 0.5;    /* after garbage */
/* Then it is asked this, and every answer before this one's is to what was garbage: telemetry may
 * hold answers up for longer than any time that one would wait. */
constexpr const char *SYNC = "$rows";
constexpr const char *SYNC_ANSWER = "$rows=";
constexpr double UNSAID_S = 5.0;

using values = std::map<std::string, std::string>;

std::string lower(std::string text)
{
    for (char &c : text) {
        c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
    return text;
}

bool starts(const std::string &text, const char *with)
{
    return text.rfind(with, 0) == 0;
}

class life
{
public:
    life(const scenario &s, const std::string &elf, bool trace)
        : s_(s), trace_(trace),
          board_(s, elf, this, [](void *context, std::uint64_t, std::uint8_t octet) {
              static_cast<life *>(context)->heard(static_cast<char>(octet));
          })
    {
        wait_for_greeting();
    }

    verdict run()
    {
        std::size_t next = 0;
        for (double end_s = SLICE_S; now_s() < s_.duration_s && v_.broken.empty();
             end_s += SLICE_S) {
            while (next < s_.events.size() && s_.events[next].at_s < end_s) {
                run_until(s_.events[next].at_s);
                happen(s_.events[next++]);
            }
            run_until(end_s);
            type();
            judge();
        }
        if (v_.broken.empty()) {
            end();
        }
        v_.simulated_s = now_s();
        v_.resets = board_reset_count(board_.raw());
        return v_;
    }

private:
    double now_s() const { return board_time_s(board_.raw()); }

    void breaks(const char *what, const std::string &detail)
    {
        if (v_.broken.empty()) {
            v_.broken = what;
            v_.detail = detail;
            v_.at_s = now_s();
        }
    }

    void run_until(double at_s)
    {
        const auto cycle = static_cast<std::uint64_t>(at_s * BOARD_FREQUENCY_HZ);
        if (cycle <= board_cycle(board_.raw()) || !v_.broken.empty()) {
            return;
        }
        const unsigned resets = board_reset_count(board_.raw());
        const board_state_t state = board_run_until(board_.raw(), cycle);
        if (state != BOARD_RUNNING) {
            if (!flipped_) { /* a stack pointer or a sleep register is anything then */
                breaks("crashed", board_complaint(board_.raw()));
            } else {
                board_reset(board_.raw(), BOARD_RESET_POWER_ON);
                was_reset();
            }
        }
        if (board_reset_count(board_.raw()) != resets) {
            if (!reset_is_due_) {
                breaks("reset", "the watchdog bit, and nothing was wrong");
            }
            was_reset();
        }
    }

    /* ---- the host ---- */

    void heard(char c)
    {
        if (c == '\r') {
            return;
        }
        if (c != '\n') {
            line_ += c;
            return;
        }
        const std::string line = line_;
        line_.clear();
        if (trace_) {
            std::fprintf(stderr, "%9.3f  < %s\n", now_s(), line.c_str());
        }
        if (line.find("broken: ") != std::string::npos) {
            said_broken_ = line;
        }
        if (starts(line, "reset ")) {
            greeted_ = true;
        }
        if (!line.empty() && line[0] == '<' && !starts(line, "<limits")) {
            status_ = line;
            return;
        }
        if (!pending_) {
            return;
        }
        synced_ = synced_ || (*pending_ == SYNC && starts(line, SYNC_ANSWER));
        if (!synced_ && (line == "ok" || starts(line, "error:"))) {
            return; /* to what was garbage */
        }
        if (line == "ok" || starts(line, "error:")) {
            ++v_.answers;
            const std::string asked = *pending_;
            pending_.reset();
            answered(lower(asked), line);
            answer_.clear();
        } else {
            answer_.push_back(line);
        }
    }

    void send(const std::string &text) { board_send(board_.raw(), text.data(), text.size()); }

    void type()
    {
        if (pending_ && now_s() - asked_s_ > ANSWER_S) {
            breaks("silent", "'" + *pending_ + "' was not answered");
        }
        if (pending_ || waiting_.empty() || now_s() < quiet_until_s_) {
            return;
        }
        std::string next = waiting_.front();
        waiting_.pop_front();
        if (trace_) {
            std::fprintf(stderr, "%9.3f  > %s\n", now_s(), next.c_str());
        }
        send(next + "\n");
        if (next == "?" || next.empty()) {
            return;
        }
        pending_ = next;
        asked_s_ = now_s();
        /* a short of its pulses is none of the board's doing: by itself it is as fed as before */
        was_fed_ = board_is_fed(board_.raw()) || unfed_s_ >= 0.0 || now_s() - shorted_s_ < UNFED_S;
        answer_.clear();
        if (next == "selftest") {
            tested_s_ = now_s();
        }
        if (lower(next) == "$save") {
            saving_ = settings_;
        }
        if (starts(next, "$") && next.find('=') != std::string::npos) {
            unsure_.insert(lower(next.substr(1, next.find('=') - 1)));
        }
    }

    /* What the host believes after an answer. */
    void answered(const std::string &asked, const std::string &answer)
    {
        const bool ok = answer == "ok";
        if (asked == "selftest") {
            tested_s_ = now_s();
        }
        if (asked == "$$" && ok) {
            take_settings();
            return;
        }
        if (asked == "$save") {
            if (ok) {
                saved_.push_back(settings_);
                if (eeprom_worn_ && saved_.size() > 1 &&
                    saved_.back() != saved_[saved_.size() - 2]) {
                    breaks("saved", "a worn EEPROM kept a save");
                }
            }
            saving_.reset();
            return;
        }
        const std::size_t equals = asked.find('=');
        if (asked[0] == '$' && equals != std::string::npos) {
            const std::string name = lower(asked.substr(1, equals - 1));
            unsure_.erase(name);
            if (ok) {
                if (audit_) { /* a stop has dropped the answer that tells what the reset kept */
                    typed_since_.insert(name);
                }
                settings_.erase(name);
                waiting_.push_front("$" + name); /* as it prints it */
            }
            return;
        }
        if (asked[0] == '$' && ok && answer_.size() == 1 && starts(answer_[0], "$") &&
            answer_[0].find('=') != std::string::npos) {
            const std::size_t at = answer_[0].find('=');
            unsure_.erase(answer_[0].substr(1, at - 1));
            settings_[answer_[0].substr(1, at - 1)] = answer_[0].substr(at + 1);
            return;
        }
        if (asked == "$defaults" && ok) {
            settings_ = defaults_;
        }
        if (!ok) {
            return;
        }
        if (starts(asked, "pattern ")) {
            for (unsigned k = 0; k < SPRINGS; ++k) {
                wish_[k] = asked[8 + k] == '1';
            }
            may_.fill(false);
        } else if (starts(asked, "on ")) {
            const bool zero = asked.size() > 5 && asked.substr(asked.rfind(' ')) == " 0";
            set_wish(asked.substr(3, asked.find(' ', 3) - 3), !zero);
        } else if (starts(asked, "off ")) {
            set_wish(asked.substr(4), false);
        } else if (asked == "clear" || asked == "unlock" || asked == "supply off" ||
                   (asked == "supply on" && !was_fed_) || starts(asked, "selftest")) {
            wish_nothing();
            stopped_ = stopped_ && asked != "clear";
        }
        forgotten_s_ = now_s();
    }

    void set_wish(const std::string &which, bool on)
    {
        for (unsigned k = 0; k < SPRINGS; ++k) {
            if (is_meant(which, k)) {
                wish_[k] = on;
                may_[k] = false;
            }
        }
    }

    static bool is_meant(const std::string &which, unsigned k)
    {
        return which == "all" || std::atoi(which.c_str()) == static_cast<int>(k) + 1;
    }

    void wish_nothing()
    {
        wish_.fill(false);
        may_.fill(false);
    }

    /* Bytes come upon a line that has no answer yet: it is carried out, or not, and no answer
     * tells. */
    void overtaken(const std::string &asked)
    {
        const std::size_t equals = asked.find('=');
        if (asked == "selftest") {
            tested_s_ = now_s() + SELFTEST_S;
        } else if (starts(asked, "on ") || starts(asked, "pattern ")) {
            const bool one = starts(asked, "on ");
            for (unsigned k = 0; k < SPRINGS; ++k) {
                may_[k] = may_[k] || !one || is_meant(asked.substr(3, asked.find(' ', 3) - 3), k);
            }
        } else if (asked[0] == '$' && equals != std::string::npos) {
            waiting_.push_front(asked.substr(0, equals)); /* which it is */
        }
    }

    /* ---- settings: whole or not at all ---- */

    void take_settings()
    {
        values now;
        for (const std::string &line : answer_) {
            const std::size_t equals = line.find('=');
            if (!line.empty() && line[0] == '$' && equals != std::string::npos) {
                now[line.substr(1, equals - 1)] = line.substr(equals + 1);
            }
        }
        if (now.empty()) {
            breaks("settings", "`$$` prints none");
            return;
        }
        if (defaults_.empty()) {
            defaults_ = settings_ = now;
            saved_.push_back(now);
            return;
        }
        if (audit_ && !flipped_) {
            std::vector<values> may = saved_;
            if (!torn_) {
                may.assign(1, saved_.back());
            }
            if (at_reset_saving_) {
                may.push_back(*at_reset_saving_);
            }
            if (torn_) {
                may.push_back(defaults_);
            }
            if (std::none_of(may.begin(), may.end(),
                             [&](const values &m) { return alike(m, now); })) {
                breaks("settings", "after a reset they are neither what was saved nor what was "
                                   "before: " +
                                       difference(may.back(), now));
            }
        } else if (!flipped_ && !alike(settings_, now)) {
            breaks("settings", "changed without a word: " + difference(settings_, now));
        }
        if (audit_) {
            saved_.push_back(now);
        }
        audit_ = false;
        typed_since_.clear();
        at_reset_saving_.reset();
        unsure_.clear();
        settings_ = now;
    }

    /* What words set as well, or what was answered in a way that the host does not know, is left
     * out. */
    static bool loose(const std::string &name)
    {
        return name == "policy" || starts(name, "telemetry_") || starts(name, "ambient");
    }

    bool alike(const values &then, const values &now) const
    {
        return difference(then, now).empty();
    }

    std::string difference(const values &then, const values &now) const
    {
        for (const auto &[name, value] : now) {
            const auto found = then.find(name);
            if (!loose(name) && unsure_.count(name) + typed_since_.count(name) == 0 &&
                found != then.end() && found->second != value) {
                return name + " was " + found->second + ", is " + value;
            }
        }
        return "";
    }

    /* ---- what happens ---- */

    void wait_for_greeting()
    {
        for (int ms = 0; ms < 1500 && !greeted_; ++ms) {
            board_run_ms(board_.raw(), 1.0);
        }
        if (!greeted_) {
            breaks("silent", "it does not greet");
        }
        waiting_.push_front("$$");
    }

    void was_reset()
    {
        at_reset_saving_ = saving_;
        saving_.reset();
        pending_.reset();
        waiting_.clear();
        waiting_.push_back("");
        waiting_.push_back("$$");
        audit_ = true;
        typed_since_.clear();
        unsure_.clear();
        wish_nothing();
        stopped_ = false;
        hanging_ = false;
        reset_is_due_ = flipped_;
        quiet_until_s_ = now_s() + 0.8;
        synced_ = true;
    }

    /* But for what tells that garbage is answered: else no answer would count any more. */
    void drop_waiting()
    {
        waiting_.clear();
        if (!synced_) {
            waiting_.push_back("");
            waiting_.push_back(SYNC);
        }
    }

    void quiet()
    {
        quiet_until_s_ = now_s() + QUIET_S + (saving_ ? 4.0 : 0.0);
        if (pending_) {
            overtaken(lower(*pending_));
            pending_.reset();
        }
        waiting_.push_front(SYNC);
        waiting_.push_front("");
        synced_ = false;
    }

    void happen(const event &e)
    {
        if (trace_ && e.what != kind::say) {
            std::fprintf(stderr, "%9.3f  * %s %u %d %g %s\n", now_s(), name_of(e.what), e.channel,
                         e.on, e.value, e.text.c_str());
        }
        before(e);
        board_.inflict(e);
        after(e);
    }

    void before(const event &e)
    {
        switch (e.what) {
        case kind::say:
            waiting_.push_back(e.text);
            break;
        case kind::bytes:
            raw(e.text);
            break;
        case kind::flip:
            flip_s_ = now_s();
            flipped_ = reset_is_due_ = true;
            break;
        case kind::interrupt: /* a flag of a peripheral that is in use may come twice */
            flipped_ = reset_is_due_ = true;
            break;
        case kind::power:
            reset_is_due_ = true;
            break;
        default:
            break;
        }
    }

    /* What the host, or who judges, has to know of it. */
    void after(const event &e)
    {
        switch (e.what) {
        case kind::closed:
            closed_s_[e.channel] = e.on ? now_s() : -1.0;
            welded_ = true;
            break;
        case kind::welds_hot: /* when, nobody knows */
            welded_ = true;
            break;
        case kind::gates_swapped:
        case kind::answers_too:
        case kind::slow_bus:
        case kind::ground:
        case kind::ripple:
            blind_.fill(true);
            break;
        case kind::creeps:
        case kind::volt_drifts:
        case kind::volt_scaled:
        case kind::stuck_bit:
        case kind::drifts:
        case kind::saturates:
        case kind::offset:
        case kind::lifted:
        case kind::bursts:
        case kind::nacks:
        case kind::garbled:
            blind_[e.channel] = true;
            break;
        case kind::swapped:
            blind_[e.channel] = blind_[static_cast<unsigned>(e.value)] = true;
            break;
        case kind::absent:
        case kind::stale:
        case kind::frozen:
        case kind::scaled:
            blind_[e.channel] = true;
            break;
        case kind::sda:
            blind_.fill(true);
            break;
        case kind::worn:
            eeprom_worn_ = e.on;
            break;
        case kind::torn:
            torn_ = true;
            break;
        case kind::power:
        case kind::brown_out:
        case kind::button:
            was_reset();
            break;
        case kind::hang:
            reset_is_due_ = hanging_ = true;
            hang_s_ = now_s();
            break;
        case kind::crystal:
            pending_.reset();
            waiting_.clear();
            quiet_until_s_ = 1e9;
            hanging_ = true;
            hang_s_ = now_s();
            break;
        case kind::enable_low:
        case kind::enable_high:
            unfed_s_ = e.on ? now_s() : -1.0;
            shorted_s_ = now_s();
            break;
        default:
            break;
        }
    }

    void raw(const std::string &hex)
    {
        std::string bytes;
        for (std::size_t k = 0; k + 1 < hex.size(); k += 2) {
            bytes += static_cast<char>(std::strtoul(hex.substr(k, 2).c_str(), nullptr, 16));
        }
        if (bytes == "!" || bytes == "!!") {
            const double took_s = 1e-3 *
                                  (static_cast<double>(board_send_backlog(board_.raw())) +
                                   static_cast<double>(bytes.size())) /
                                  11.52;
            stopped_ = true;
            stop_s_ = now_s() + took_s;
        } else if (bytes.find('!') != std::string::npos) {
            stop_s_ = 1e9; /* somewhere in it */
        }
        send(bytes);
        quiet();
        if (bytes.find('!') != std::string::npos) {
            wish_nothing();
        }
    }

    /* ---- what must always hold ---- */

    void judge()
    {
        if (!said_broken_.empty() && !flipped_) {
            breaks("invariant", said_broken_);
        }
        double hottest_c = -300.0;
        for (unsigned k = 0; k < SPRINGS; ++k) {
            hottest_c = std::fmax(hottest_c, truth_hottest_c(board_.truth(), k));
        }
        v_.hottest_c = std::fmax(v_.hottest_c, hottest_c);
        const bool fed = board_is_fed(board_.raw());
        fed_s_ = fed ? fed_s_ : now_s(); /* since */
        char text[160];
        if (hottest_c > HOTTEST_C + (welded_ ? WELDED_K : 0.0)) {
            std::snprintf(text, sizeof text, "%.1f degC", hottest_c);
            breaks("hot", text);
        }
        for (unsigned k = 0; k < SPRINGS; ++k) {
            if (closed_s_[k] >= 0.0 && now_s() - closed_s_[k] > WELDED_OFF_S &&
                now_s() - fed_s_ > WELDED_OFF_S && !blind_[k]) {
                std::snprintf(text, sizeof text, "spring %u's switch is welded for %.2f s", k + 1,
                              now_s() - closed_s_[k]);
                breaks("fed", text);
            }
        }
        /* the pin's own edge, as it is shorted, is a pulse */
        if (fed && hanging_ && now_s() - std::fmax(hang_s_, shorted_s_) > UNFED_S) {
            breaks("fed", "no program runs");
        }
        if (fed && unfed_s_ >= 0.0 && now_s() - unfed_s_ > UNFED_S) {
            breaks("fed", "no pulse passes");
        }
        const bool heals = now_s() - flip_s_ < HEALED_S;
        if (stopped_ && now_s() > stop_s_ + STOPPED_S && !board_all_off(board_.raw()) && !heals &&
            !flipped_ && !hanging_) {
            breaks("on", "after a stop that was not cleared");
        }
        judge_status();
        judge_wishes();
        if (now_s() >= next_status_s_) {
            next_status_s_ = now_s() + 1.0;
            if (now_s() > quiet_until_s_) {
                send("?");
            }
        }
    }

    void judge_status()
    {
        if (status_.empty()) {
            return;
        }
        const bool off = starts(status_, "<off|") || starts(status_, "<locked|");
        const bool done = !pending_ && now_s() - asked_s_ > DONE_S;
        if (off && done && !board_all_off(board_.raw()) && now_s() - flip_s_ > HEALED_S &&
            !hanging_) {
            breaks("on", "and it says " + status_);
        }
        status_.clear();
    }

    /* Nothing is driven that nobody asked for, and nothing that was asked for is dropped without a
     * word. */
    void judge_wishes()
    {
        if (flipped_ || pending_ || now_s() < quiet_until_s_ || now_s() - tested_s_ < 1.0 ||
            hanging_) {
            silent_s_.fill(now_s());
            return;
        }
        board_view_t seen{};
        if (!board_view(board_.raw(), "controller", &seen)) {
            return;
        }
        for (unsigned k = 0; k < SPRINGS; ++k) {
            char text[120];
            const board_view_spring_t &spring = seen.spring[k];
            if (!wish_[k] && board_duty(board_.raw(), k) > 0.0) {
                if (!may_[k] && now_s() - forgotten_s_ > 0.1) {
                    std::snprintf(text, sizeof text, "spring %u is driven, and nobody asked",
                                  k + 1);
                    breaks("on", text);
                }
                continue;
            }
            const bool said = spring.fault != 0 || seen.board_fault != 0 || seen.locked ||
                              spring.limits != 0 || !board_is_fed(board_.raw());
            if (!wish_[k] || said || board_duty(board_.raw(), k) > 0.0) {
                silent_s_[k] = now_s();
            } else if (now_s() - silent_s_[k] > UNSAID_S) {
                std::snprintf(text, sizeof text, "spring %u gets nothing, and nothing is said%s",
                              k + 1, spring.level_permille == 0 ? ": its level is gone" : "");
                breaks("unsaid", text);
            }
        }
    }

    /* Whatever was, it answers; and its settings are whole. */
    void end()
    {
        board_t *board = board_.raw();
        for (unsigned k = 0; k < SPRINGS; ++k) {
            board_set_fault(board, BOARD_FAULT_CLOSED, k, false);
            closed_s_[k] = -1.0;
        }
        if (quiet_until_s_ > 1e8) { /* the crystal */
            board_reset(board, BOARD_RESET_POWER_ON);
            was_reset();
        }
        const double until_s = now_s() + 2.0 * ANSWER_S;
        drop_waiting();
        waiting_.push_back("telemetry off");
        waiting_.push_back("");
        waiting_.push_back("$$");
        waiting_.push_back("version");
        const unsigned before = v_.answers;
        while (v_.broken.empty() && now_s() < until_s &&
               (v_.answers < before + 3 || !waiting_.empty() || pending_)) {
            run_until(now_s() + SLICE_S);
            if (waiting_.empty() && !pending_) { /* a reset took them */
                waiting_.push_back("version");
            }
            type();
            judge();
        }
        if (v_.broken.empty() && v_.answers < before + 3) {
            breaks("silent", "at the end it does not answer");
        }
    }

    const scenario &s_;
    bool trace_;
    faulty_board board_;
    verdict v_;
    /* host */
    std::string line_, status_, said_broken_;
    std::vector<std::string> answer_;
    std::deque<std::string> waiting_;
    std::optional<std::string> pending_;
    bool synced_ = true; /* what comes answers what was asked */
    double asked_s_ = 0.0, quiet_until_s_ = 0.0, next_status_s_ = 1.0, tested_s_ = -10.0;
    bool greeted_ = false, was_fed_ = false;
    std::array<bool, SPRINGS> wish_{}, may_{}; /* asked for; perhaps: the answer was overtaken */
    /* settings */
    values defaults_, settings_;
    std::vector<values> saved_;
    std::optional<values> saving_, at_reset_saving_;
    std::set<std::string> unsure_, typed_since_; /* since a reset that is not audited yet */
    bool audit_ = false, torn_ = false, eeprom_worn_ = false;
    /* faults */
    std::array<double, SPRINGS> closed_s_ = {-1, -1, -1, -1, -1, -1, -1, -1, -1};
    std::array<double, SPRINGS> silent_s_{};
    std::array<bool, SPRINGS> blind_{};
    bool welded_ = false, flipped_ = false, reset_is_due_ = false, hanging_ = false;
    bool stopped_ = false;
    double stop_s_ = 0.0, hang_s_ = 0.0, flip_s_ = -1.0, unfed_s_ = -1.0, shorted_s_ = -1.0,
           forgotten_s_ = 0.0, fed_s_ = 0.0;
};

} // namespace

verdict live(const scenario &one, const std::string &elf, bool trace)
{
    life a(one, elf, trace);
    return a.run();
}

} // namespace swarm
