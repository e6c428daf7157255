// What is written to a controller that is tried, with its chain open, and taken back.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <exception>

#include "daemon/commission/places.hpp"
#include "daemon/commission/register_trial.hpp"

namespace vibrig::commission {

using proto::Register;
using proto::RegisterTable;
using proto::RegisterType;
using Answer = TrialPort::Answer;

namespace {

constexpr double kAlone_s = 2;        // how long nobody else may write
constexpr double kStarts_s = 2;       // how long run = 1 is watched
constexpr double kSmallest_g = 1e-3;  // of an amplitude that does not count

}  // namespace

void RegisterTrial::begin_writing() {
    if (writing_) return;
    chain_is(true,
             "Open the emergency-stop chain by any button, and leave it open. The power stage "
             "stays off. Open? [Enter]");
    last_ = read_all();
    const double since = port_.now_s();
    do {
        port_.wait(kPoll_s);
        const Image now = read_all();
        for (const auto& [at, word] : now)
            if (word != last_[at]) alive_.insert(at);
        look_for_others(now);
    } while (port_.now_s() - since < kAlone_s);
    writing_ = true;
}

/// What the map says is written only by who has it.
void RegisterTrial::look_for_others(const Image& now) {
    for (const Role& role : written_) {
        const Words was = words_of(last_, *role.reg), is = words_of(now, *role.reg);
        if (was == is) continue;
        throw TrialEnded(fmt::format(
            "shaker.registers.{} ({}) was {:g}, is {:g}, and nobody here has written it: another "
            "master commands this controller, or it is no set-point",
            role.name, place_of(*role.reg), proto::decode(*role.reg, was),
            proto::decode(*role.reg, is)));
    }
    for (const auto& [at, word] : now) last_[at] = word;
}

void RegisterTrial::may_write() {
    const Image now = read_all();
    look_for_others(now);
    if (value_of(now, map_.emergency_stop) == 0)
        throw TrialEnded("the emergency-stop chain was closed: nothing is written");
    if (const auto moves = what_moves(now); !moves.empty())
        throw TrialEnded(moves + ": nothing is written while the table may move");
}

Answer RegisterTrial::write(const Role& role, const Words& words, const char* what) {
    may_write();
    const Words before = words_of(last_, *role.reg);
    const auto answer = port_.write(role.reg->address, words);
    hold_against(role, answer == Answer::done ? words : before, what);
    return answer;
}

/// The register reads as written, and everything beside it as it was.
void RegisterTrial::hold_against(const Role& role, const Words& words, const char* what) {
    const Image now = read_all();
    const Words is = words_of(now, *role.reg);
    if (is != words)
        throw TrialEnded(fmt::format("shaker.registers.{} ({}): {} written ({}), {} read back",
                                     role.name, place_of(*role.reg),
                                     proto::decode(*role.reg, words), what,
                                     proto::decode(*role.reg, is)));
    for (const auto& [at, word] : now) {
        const bool own = at.first == role.reg->table && at.second >= role.reg->address &&
                         at.second < role.reg->address + role.reg->words();
        const auto was = last_.at(at);
        last_[at] = word;
        if (own || word == was || alive_.contains(at) || at.first != RegisterTable::holding)
            continue;
        const auto other = role_at(at.second);
        // A place that shows the set-point once more.
        if (other.empty() && std::ranges::find(words, word) != words.end()) {
            person_.show(fmt::format("  holding {} follows it", at.second));
            continue;
        }
        throw TrialEnded(fmt::format(
            "writing shaker.registers.{} ({}) changes holding {}{} from {} to {}, which is no "
            "part of it",
            role.name, place_of(*role.reg), at.second,
            other.empty() ? "" : " (shaker.registers." + other + ")", was, word));
    }
}

void RegisterTrial::display_agrees(const Role& role, double value) {
    for (int n = 0; n < kAsked; ++n) {
        const auto text = person_.answer(
            fmt::format("{} is {:g} now. What does the display show? [number, as shown; -: "
                        "nothing of it]",
                        role.name, value));
        if (text == "-") return;
        const auto shown = shown_number(text);
        if (!shown) {
            person_.show("  found \"" + text + "\", expected a number such as 16.00, or -");
            continue;
        }
        // Beyond what a float keeps of it.
        if (std::abs(shown->value - value) <= shown->half_digit + 1e-6 * value) return;
        throw TrialEnded(
            fmt::format("shaker.registers.{} ({}): {:g} written and read back, {} on the display",
                        role.name, place_of(*role.reg), value, text));
    }
    throw TrialEnded("no word of the display");
}

/// Whatever ended it: the values that were there. Nothing is written where the table may move.
void RegisterTrial::take_back() noexcept {
    while (!to_take_back_.empty()) {
        const auto [role, words] = to_take_back_.back();
        to_take_back_.pop_back();
        try {
            Words is(words.size());
            // A set-point is only taken back while it moves nothing; run = 0 always.
            const bool run = std::string(role.name) == "run";
            const auto moves = run ? std::string() : what_moves(read_watched());
            if (!moves.empty()) throw TrialEnded(moves);
            const bool done = port_.write(role.reg->address, words) == Answer::done &&
                              port_.read(role.reg->table, role.reg->address, is) == Answer::done;
            if (!done || is != words) throw TrialEnded("it is not taken back");
        } catch (const std::exception& error) {
            try {
                person_.show(fmt::format(
                    "  shaker.registers.{} ({}) was {:g} before: set it by "
                    "hand ({})",
                    role.name, place_of(*role.reg), proto::decode(*role.reg, words), error.what()));
            } catch (const std::exception&) {  // nobody is there to read it
            }
        }
    }
}

bool RegisterTrial::named(const Role& role) {
    for (;;) {
        const auto text = person_.answer(
            fmt::format("May {} ({}) be written, first with what it holds, {:g}? [its name: {}; "
                        "Enter: leave it out]",
                        role.name, place_of(*role.reg), value_of(last_, *role.reg), role.name));
        if (text.empty()) return false;
        if (text == role.name) return true;
        person_.show("  found \"" + text + "\", expected " + role.name + " or nothing");
    }
}

void RegisterTrial::write_each() {
    begin_writing();
    for (const Role& role : written_) {
        if (!named(role)) {
            row(role.name, false, "left out");
            continue;
        }
        if (role.reg == &map_.amplitude) amplitude_named_ = true;
        try {
            write_one(role);
        } catch (...) {
            take_back();
            throw;
        }
    }
}

void RegisterTrial::write_one(const Role& role) {
    const Words own = words_of(last_, *role.reg);
    if (write(role, own, "its own value") == Answer::refused)
        throw TrialEnded(fmt::format("shaker.registers.{} ({}): its own value, {:g}, is refused",
                                     role.name, place_of(*role.reg),
                                     proto::decode(*role.reg, own)));
    const double value = proto::decode(*role.reg, own);
    const std::string name = role.name;
    if (name == "run") return try_run(role);
    // The amplitude is left at nothing, whatever it was: that is where a rig begins.
    if (name == "amplitude") {
        const bool counts = role.reg->type != RegisterType::f32;
        try_value(role, counts ? role.reg->scale : kSmallest_g);
        to_take_back_.back().second = Words(role.reg->words(), 0);
    } else {
        const double more = name == "watchdog" ? role.reg->scale : 1;
        Words up(role.reg->words());
        try_value(role, proto::encode(*role.reg, value + more, up) ? value + more : value - more);
    }
    const Words back = to_take_back_.back().second;
    if (write(role, back, "taken back") == Answer::refused)
        throw TrialEnded(fmt::format("shaker.registers.{}: what it held is refused", name));
    to_take_back_.clear();
    row(name, true, "written and read back, its neighbours as they were");
}

void RegisterTrial::try_value(const Role& role, double value) {
    Words words = words_of(last_, *role.reg);
    const Words own = words;
    if (!proto::encode(*role.reg, value, words))
        throw TrialEnded(fmt::format("shaker.registers.{} ({}) cannot hold {:g}", role.name,
                                     place_of(*role.reg), value));
    to_take_back_.emplace_back(role, own);
    if (write(role, words, "another value") == Answer::refused)
        throw TrialEnded(fmt::format("shaker.registers.{} ({}): {:g} is refused", role.name,
                                     place_of(*role.reg), value));
    if (std::string(role.name) != "watchdog") display_agrees(role, proto::decode(*role.reg, words));
}

/// With the chain open the order to run must come to nothing.
void RegisterTrial::try_run(const Role& role) {
    if (const double g = value_of(last_, map_.amplitude); g != 0)
        throw TrialEnded(fmt::format(
            "shaker.registers.amplitude holds {:g}, expected 0 before run = 1 is tried", g));
    Words words = words_of(last_, *role.reg);
    const Words stopped = words;
    if (!proto::encode(*role.reg, 1, words)) throw TrialEnded("shaker.registers.run cannot be 1");
    to_take_back_.emplace_back(role, stopped);
    may_write();
    const auto answer = port_.write(role.reg->address, words);
    const double since = port_.now_s();
    std::string runs;
    do {
        const Image now = read_watched();
        const double state = value_of(now, map_.state);
        const double measured_g = value_of(now, map_.measured_amplitude);
        if (state == kRamping || state == kRunning || !(std::abs(measured_g) < kStill_g))
            runs = fmt::format("state {:g}, measured {:g} g", state, measured_g);
        if (runs.empty()) port_.wait(kPoll_s);
    } while (runs.empty() && port_.now_s() - since < kStarts_s);
    if (port_.write(role.reg->address, stopped) == Answer::refused)
        throw TrialEnded("shaker.registers.run: 0 is refused");
    last_ = read_all();
    if (!runs.empty() || value_of(last_, *role.reg) != 0) {
        row(role.name, false, runs.empty() ? "1 is not taken back" : runs);
        throw TrialEnded("run = 1 starts although the emergency-stop chain is open: " + runs);
    }
    to_take_back_.clear();
    row(role.name, true,
        answer == Answer::refused ? "1 is refused while the chain is open"
                                  : "1 leads to nothing while the chain is open");
}

void RegisterTrial::beyond_limits(const std::vector<std::pair<std::string, double>>& limits_g) {
    if (!amplitude_named_) return;
    const Role role{"amplitude", &map_.amplitude};
    const Register& reg = map_.amplitude;
    for (const auto& [name, limit_g] : limits_g) {
        Words words = words_of(last_, reg);
        const double count = reg.type == RegisterType::f32 ? 1e-6 * limit_g : reg.scale;
        double asked_g = limit_g;
        bool fits = true;
        do {
            asked_g += count / 2;
            fits = proto::encode(reg, asked_g, words);
        } while (fits && proto::decode(reg, words) <= limit_g);
        if (!fits) {
            row("limit, " + name, true, "the register holds no more");
            continue;
        }
        asked_g = proto::decode(reg, words);
        may_write();
        const Words zero(reg.words(), 0);
        to_take_back_.emplace_back(role, zero);
        const auto answer = port_.write(reg.address, words);
        const double held_g = value_of(read_all(), reg);
        take_back();
        last_ = read_all();
        if (value_of(last_, reg) != 0)
            throw TrialEnded("shaker.registers.amplitude does not come back to 0");
        row("limit, " + name, true,
            answer == Answer::refused ? fmt::format("{:g} g is refused", asked_g)
            : held_g <= limit_g
                ? fmt::format("{:g} g is held to {:g}", asked_g, held_g)
                : fmt::format("{:g} g is taken: the controller does not limit, Vibrig alone does",
                              asked_g));
    }
}

}  // namespace vibrig::commission
