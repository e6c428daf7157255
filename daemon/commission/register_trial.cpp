// A controller's registers, tried while nothing can move: how they are read, and the stop chain.
#include "daemon/commission/register_trial.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace vibrig::commission {

using proto::Register;
using proto::RegisterTable;
using Answer = TrialPort::Answer;

namespace {

constexpr std::uint16_t kNeighbours = 4, kAtOnce = 16;
constexpr double kClosed_s = 10;  // how long nothing may start

}  // namespace

std::string RegisterTrial::place_of(const Register& reg) {
    return fmt::format("{} {}", reg.table == RegisterTable::holding ? "holding" : "input",
                       reg.address);
}

RegisterTrial::RegisterTrial(const proto::ShakerRegisters& map, TrialPort& port,
                             TrialPerson& person)
    : map_(map), port_(port), person_(person) {
    // The run register is the last: until then it is known whether writing does what it should.
    for (const Role& role :
         {Role{"frequency", &map_.frequency}, Role{"amplitude", &map_.amplitude},
          Role{"ramp_time", &map_.ramp_time}, Role{"watchdog_timeout", &map_.watchdog_timeout},
          Role{"watchdog", map_.watchdog ? &*map_.watchdog : nullptr}, Role{"run", &map_.run}})
        if (role.reg != nullptr && role.reg->table == RegisterTable::holding)
            written_.push_back(role);
    seen_ = written_;
    for (const Role& role :
         {Role{"watchdog_timeout", &map_.watchdog_timeout}, Role{"state", &map_.state},
          Role{"fault", &map_.fault}, Role{"emergency_stop", &map_.emergency_stop},
          Role{"measured_amplitude", &map_.measured_amplitude}})
        if (std::ranges::none_of(seen_, [&](const Role& r) { return r.reg == role.reg; }))
            seen_.push_back(role);
    lay_out();
}

/// The stated registers and, where the controller lets them be read, their neighbours.
void RegisterTrial::lay_out() {
    const auto add = [this](const Register& reg, std::uint16_t more) {
        const auto first = static_cast<std::uint16_t>(std::max(0, reg.address - more));
        const auto last = std::min(65535, reg.address + static_cast<int>(reg.words()) - 1 + more);
        ranges_.push_back({reg.table, first, static_cast<std::uint16_t>(last - first + 1)});
    };
    for (const Role& role : seen_) {
        const auto had = ranges_.size();
        const bool holding = role.reg->table == RegisterTable::holding;
        add(*role.reg, holding ? kNeighbours : 0);
        std::array<std::uint16_t, kAtOnce> words{};
        const auto& wide = ranges_[had];
        if (port_.read(wide.table, wide.first, std::span(words).first(wide.count)) == Answer::done)
            continue;
        ranges_.resize(had);
        add(*role.reg, 0);
    }
    std::ranges::sort(ranges_, {}, [](const Range& r) { return std::pair(r.table, r.first); });
    std::vector<Range> joined;
    for (const Range& range : ranges_) {
        if (!joined.empty()) {
            Range& before = joined.back();
            const int end = std::max(before.first + before.count, range.first + range.count);
            if (before.table == range.table && range.first <= before.first + before.count &&
                end - before.first <= kAtOnce) {
                before.count = static_cast<std::uint16_t>(end - before.first);
                continue;
            }
        }
        joined.push_back(range);
    }
    ranges_ = std::move(joined);
    for (Range& range : ranges_)
        for (const Register* reg :
             {&map_.run, &map_.state, &map_.emergency_stop, &map_.measured_amplitude})
            range.watched =
                range.watched || (reg->table == range.table && reg->address >= range.first &&
                                  reg->address < range.first + range.count);
}

RegisterTrial::Image RegisterTrial::read(bool all) {
    Image image;
    for (const Range& range : ranges_) {
        if (!all && !range.watched) continue;
        std::array<std::uint16_t, kAtOnce> words{};
        if (port_.read(range.table, range.first, std::span(words).first(range.count)) !=
            Answer::done)
            throw TrialEnded(
                fmt::format("{} {} to {} cannot be read",
                            range.table == RegisterTable::holding ? "holding" : "input",
                            range.first, range.first + range.count - 1));
        for (std::uint16_t i = 0; i < range.count; ++i)
            image[{range.table, static_cast<std::uint16_t>(range.first + i)}] = words[i];
    }
    return image;
}

RegisterTrial::Words RegisterTrial::words_of(const Image& image, const Register& reg) {
    Words words;
    for (std::size_t i = 0; i < reg.words(); ++i)
        words.push_back(image.at({reg.table, static_cast<std::uint16_t>(reg.address + i)}));
    return words;
}

double RegisterTrial::value_of(const Image& image, const Register& reg) {
    return proto::decode(reg, words_of(image, reg));
}

/// Empty: by the controller's word nothing does.
std::string RegisterTrial::what_moves(const Image& image) const {
    const double run = value_of(image, map_.run), state = value_of(image, map_.state);
    const double measured_g = value_of(image, map_.measured_amplitude);
    if (run != 0) return fmt::format("shaker.registers.run reads {:g}, expected 0", run);
    if (state == kRamping || state == kRunning || state == kStopping)
        return fmt::format("shaker.registers.state reads {:g}, expected 0 or 4 (idle, fault)",
                           state);
    if (!(std::abs(measured_g) < kStill_g))
        return fmt::format("shaker.registers.measured_amplitude reads {:g} g, expected below {:g}",
                           measured_g, kStill_g);
    return {};
}

/// The stated register that this word is of; empty: none.
std::string RegisterTrial::role_at(std::uint16_t address) const {
    for (const Role& role : seen_)
        if (role.reg->table == RegisterTable::holding && address >= role.reg->address &&
            address < role.reg->address + role.reg->words())
            return role.name;
    return {};
}

void RegisterTrial::row(std::string name, bool passed, std::string found) {
    person_.show("  " + name + ": " + found);
    rows_.push_back({std::move(name), std::move(found), passed});
}

bool RegisterTrial::passed() const {
    return !rows_.empty() && std::ranges::all_of(rows_, &TrialRow::passed);
}

// ---- the stop chain, by hand

/// Asked again while it is the other way.
void RegisterTrial::chain_is(bool open, const std::string& asked) {
    for (int n = 0; n < kAsked; ++n) {
        static_cast<void>(person_.answer(asked));
        if ((value_of(read_watched(), map_.emergency_stop) != 0) == open) return;
        person_.show(fmt::format("  shaker.registers.emergency_stop ({}) reads {}, expected {}",
                                 place_of(map_.emergency_stop), open ? "closed" : "open",
                                 open ? "open" : "closed"));
    }
    throw TrialEnded(fmt::format("emergency-stop chain: {} by your word, {} by its register ({})",
                                 open ? "open" : "closed", open ? "closed" : "open",
                                 place_of(map_.emergency_stop)));
}

void RegisterTrial::stop_chain(const std::vector<std::string>& buttons, double seen_s) {
    chain_is(false, "Close the emergency-stop chain, the power stage stays off. Closed? [Enter]");
    for (const auto& button : buttons) {
        static_cast<void>(
            person_.answer(fmt::format("Press the button \"{}\". Pressed? [Enter]", button)));
        const double since = port_.now_s();
        bool open = false;
        do {
            open = value_of(read_watched(), map_.emergency_stop) != 0;
            if (!open) port_.wait(kPoll_s);
        } while (!open && port_.now_s() - since <= seen_s);
        row("stop chain, " + button, open,
            open ? "seen open" : fmt::format("not seen open within {:g} s", seen_s));
        if (!open)
            throw TrialEnded(fmt::format(
                "the button \"{}\" is pressed by your word, the chain closed by its register ({})",
                button, place_of(map_.emergency_stop)));
        chain_is(false,
                 fmt::format("Release \"{}\", close the chain again. Closed? [Enter]", button));
        nothing_starts(button);
    }
}

void RegisterTrial::nothing_starts(const std::string& button) {
    const double since = port_.now_s();
    while (port_.now_s() - since < kClosed_s) {
        if (const auto moves = what_moves(read_watched()); !moves.empty()) {
            row("closing after " + button, false, moves);
            throw TrialEnded("closing the chain starts something: " + moves);
        }
        port_.wait(kPoll_s);
    }
    row("closing after " + button, true, fmt::format("nothing starts for {:g} s", kClosed_s));
}

}  // namespace vibrig::commission
