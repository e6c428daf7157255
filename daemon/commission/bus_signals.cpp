#include "daemon/commission/bus_signals.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace vibrig::commission {

namespace {

constexpr std::size_t kFewFrames = 8;  // may count by chance
constexpr std::size_t kMostRows = 20'000;
constexpr double kSameNorm = 0.1;         // of the widest range of the three
constexpr std::size_t kShakenShare = 10;  // of the rows, %, at either end

bool wraps_around(const proto::Signal& signal) {
    return signal.type == proto::ValueType::integer && !signal.is_signed && signal.length > 1 &&
           signal.length < 53;
}

}  // namespace

const char* name_of(BusSignals::Kind kind) noexcept {
    constexpr std::array kNames{"value", "accelerometer", "counter", "bit"};
    return kNames[static_cast<std::size_t>(kind)];
}

BusSignals::BusSignals(proto::Dbc dbc) : dbc_(std::move(dbc)) {
    for (const auto& message : dbc_.messages) {
        auto& at = of_id_[{message.extended, message.id}];
        for (const auto& signal : message.signals) {
            at.push_back(seen_.size());
            Seen& seen = seen_.emplace_back();
            seen.message = &message;
            seen.signal = &signal;
        }
    }
}

void BusSignals::follow(Seen& seen, std::span<const std::uint8_t> data) {
    const proto::Signal& signal = *seen.signal;
    if (!proto::present(*seen.message, signal, data)) return;
    const auto raw = proto::decode_raw(signal, data);
    const auto value = proto::decode(signal, data);
    if (!raw || !value) return;
    const double whole = wraps_around(signal) ? signal.scale * std::exp2(signal.length) : 0;
    if (!seen.heard) {
        seen.heard = true;
        seen.value = seen.low = seen.high = *value;
    } else {
        const double off = *value - (seen.value - seen.wraps);
        const double step = whole > 0 ? std::remainder(off, whole) : off;
        seen.wraps += step - off;
        seen.value = *value + seen.wraps;
        seen.changed = seen.changed || *raw != seen.before;
        const std::int64_t counts = std::llround(step / signal.scale);
        if (!turned_) {
            seen.squares += step * step;
            if (!seen.step) seen.step = counts;
            seen.steps = seen.steps && counts == *seen.step && counts != 0;
        }
    }
    seen.before = *raw;
    if (turned_) {
        seen.turn_low = seen.turn == 0 ? seen.value : std::min(seen.turn_low, seen.value);
        seen.turn_high = seen.turn == 0 ? seen.value : std::max(seen.turn_high, seen.value);
        ++seen.turn;
    } else {
        seen.low = std::min(seen.low, seen.value);
        seen.high = std::max(seen.high, seen.value);
        ++seen.rest;
    }
}

void BusSignals::add(std::uint32_t id, bool extended, std::span<const std::uint8_t> data) {
    const auto at = of_id_.find({extended, id});
    if (at == of_id_.end()) {
        strangers_[{extended, id}] = true;
        return;
    }
    for (const std::size_t i : at->second) follow(seen_[i], data);
    if (!turned_ || rows_.size() >= kMostRows) return;
    auto& row = rows_.emplace_back();
    for (const Seen& seen : seen_) row.push_back(seen.value);
}

BusSignals::Signal BusSignals::describe(const Seen& seen) const {
    const proto::Signal& signal = *seen.signal;
    Signal s;
    s.name = seen.message->name + "." + signal.name;
    s.unit = signal.unit;
    s.low = seen.low;
    s.high = seen.high;
    s.changed = seen.changed;
    const double steps = std::max<double>(1, static_cast<double>(seen.rest) - 1);
    s.noise = std::max({std::sqrt(seen.squares / 2 / steps), std::abs(signal.scale) / 2, 1e-300});
    s.turned_range = seen.turn > 0 ? seen.turn_high - seen.turn_low : 0;
    if (signal.length == 1)
        s.kind = Kind::bit;
    else if (seen.steps && seen.step && seen.rest > kFewFrames)
        s.kind = Kind::counter;
    return s;
}

/// Three of one unit, of which two at least answer, and whose norm does not.
std::vector<std::array<std::size_t, 3>> BusSignals::of_constant_norm() const {
    std::vector<std::size_t> values;
    std::vector<Signal> of;
    for (const Seen& seen : seen_) of.push_back(describe(seen));
    for (std::size_t i = 0; i < seen_.size(); ++i)
        if (seen_[i].turn > 0 && of[i].kind == Kind::value) values.push_back(i);
    std::vector<std::array<std::size_t, 3>> found;
    const auto constant = [&](std::size_t a, std::size_t b, std::size_t c) {
        if (of[a].unit != of[b].unit || of[a].unit != of[c].unit) return false;
        int answers = 0;
        double widest = 0;
        for (const std::size_t i : {a, b, c}) {
            answers += of[i].score() >= kAnswers ? 1 : 0;
            widest = std::max(widest, of[i].turned_range);
        }
        if (answers < 2) return false;
        std::vector<double> norms;
        for (const auto& row : rows_) norms.push_back(std::hypot(row[a], row[b], row[c]));
        // A gimbal that starts and stops shakes the platform on its pads for a while.
        std::ranges::sort(norms);
        const std::size_t shaken = norms.size() * kShakenShare / 100;
        return norms[norms.size() - 1 - shaken] - norms[shaken] < kSameNorm * widest;
    };
    for (std::size_t i = 0; i < values.size(); ++i)
        for (std::size_t j = i + 1; j < values.size(); ++j)
            for (std::size_t k = j + 1; k < values.size(); ++k)
                if (constant(values[i], values[j], values[k]))
                    found.push_back({values[i], values[j], values[k]});
    return found;
}

std::vector<BusSignals::Signal> BusSignals::signals() const {
    std::vector<bool> accelerometer(seen_.size(), false);
    for (const auto& three : of_constant_norm())
        for (const std::size_t i : three) accelerometer[i] = true;
    std::vector<Signal> all;
    for (std::size_t i = 0; i < seen_.size(); ++i) {
        if (!seen_[i].heard) continue;
        all.push_back(describe(seen_[i]));
        if (accelerometer[i]) all.back().kind = Kind::accelerometer;
    }
    return all;
}

std::vector<std::string> BusSignals::missing() const {
    std::vector<std::string> names;
    for (const auto& message : dbc_.messages) {
        const auto& at = of_id_.at({message.extended, message.id});
        const auto heard = [this](std::size_t i) { return seen_[i].heard; };
        if (std::ranges::none_of(at, heard)) names.push_back(message.name);
    }
    return names;
}

std::vector<std::string> BusSignals::unknown() const {
    std::vector<std::string> names;
    for (const auto& [key, yes] : strangers_)
        names.push_back(fmt::format("{:0{}x}", key.second, key.first ? 8 : 3));
    return names;
}

std::vector<BusSignals::Signal> BusSignals::answers() const {
    std::vector<Signal> all;
    for (auto& signal : signals())
        if (signal.kind == Kind::value && signal.score() >= kAnswers)
            all.push_back(std::move(signal));
    std::ranges::stable_sort(all, std::ranges::greater{}, &Signal::score);
    return all;
}

std::optional<std::string> BusSignals::winner() const {
    const auto all = answers();
    if (all.empty() || (all.size() > 1 && all[0].score() < kBeats * all[1].score()))
        return std::nullopt;
    return all[0].name;
}

std::string table_of(const BusSignals& bus, bool turned) {
    std::string text = fmt::format("{:<36}{:<14}{:>12}{:>12}{:>11}\n", "signal", "kind", "low",
                                   "high", turned ? "score" : "noise");
    std::vector<std::string> unproven, counters;
    for (const auto& s : bus.signals()) {
        const std::string name = s.unit.empty() ? s.name : s.name + " (" + s.unit + ")";
        text += fmt::format("{:<36}{:<14}{:>12.5g}{:>12.5g}{:>11.3g}\n", name, name_of(s.kind),
                            s.low, s.high, turned ? s.score() : s.noise);
        if (s.kind == BusSignals::Kind::bit && !s.changed) unproven.push_back(s.name);
        if (s.kind == BusSignals::Kind::counter) counters.push_back(s.name);
    }
    const auto line = [&text](const char* what, const std::vector<std::string>& names) {
        if (!names.empty()) text += fmt::format("{}{}\n", what, fmt::join(names, " "));
    };
    line("not heard: ", bus.missing());
    line("not in the DBC: ", bus.unknown());
    line("grows by the same with each frame, perhaps sync_count: ", counters);
    line("never changed, unproven: ", unproven);
    if (!turned) return text;
    const auto answers = bus.answers();
    if (answers.empty()) return text + "UNDECIDED: no value answers the turn\n";
    if (const auto winner = bus.winner())
        return text + fmt::format("{} follows the gimbal: {:.0f} times its noise\n", *winner,
                                  answers[0].score());
    return text + fmt::format(
                      "UNDECIDED: {} ({:.0f}) or {} ({:.0f}), one beats the other by {:.1f}, "
                      "{:g} asked\n",
                      answers[0].name, answers[0].score(), answers[1].name, answers[1].score(),
                      answers[0].score() / answers[1].score(), BusSignals::kBeats);
}

nlohmann::ordered_json json_of(const BusSignals& bus, bool turned) {
    using J = nlohmann::ordered_json;
    J signals = J::array(), unproven = J::array(), counters = J::array(), answers = J::array();
    for (const auto& s : bus.signals()) {
        signals.push_back({{"name", s.name},
                           {"unit", s.unit},
                           {"kind", name_of(s.kind)},
                           {"low", s.low},
                           {"high", s.high},
                           {"noise", s.noise}});
        if (turned) {
            signals.back()["turned_range"] = s.turned_range;
            signals.back()["score"] = s.score();
        }
        if (s.kind == BusSignals::Kind::bit && !s.changed) unproven.push_back(s.name);
        if (s.kind == BusSignals::Kind::counter) counters.push_back(s.name);
    }
    J all{{"signals", signals},
          {"missing", bus.missing()},
          {"unknown", bus.unknown()},
          {"counters", counters},
          {"unproven", unproven}};
    if (!turned) return all;
    for (const auto& s : bus.answers()) answers.push_back({{"name", s.name}, {"score", s.score()}});
    const auto winner = bus.winner();
    all["outcome"] = winner ? "decided" : "undecided";
    all["follows"] = winner ? J(*winner) : J();
    all["answers"] = answers;
    return all;
}

}  // namespace vibrig::commission
