#include "daemon/commission/bus_find.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace vibrig::commission {

namespace {

constexpr double kRateTolerance = 0.01;

std::string quoted(const std::string& text) { return "\"" + text + "\""; }

std::string one_of(const std::vector<std::string>& names) {
    return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

BusFinder::BusFinder(std::string dbc, double configured_hz)
    : dbc_(std::move(dbc)), configured_hz_(configured_hz) {}

std::string BusFinder::turned(std::size_t gimbal, const BusSignals& bus) {
    // One that stands still, the table's, leaves the norm of two that answer as it is. In the DBC's
    // order.
    std::vector<std::string> accelerometers;
    for (const auto& signal : bus.signals())
        if (std::ranges::find(accelerometers_, signal.name) != accelerometers_.end() ||
            (signal.kind == BusSignals::Kind::accelerometer &&
             signal.score() >= BusSignals::kAnswers))
            accelerometers.push_back(signal.name);
    accelerometers_ = std::move(accelerometers);
    const auto winner = bus.winner();
    if (!winner) {
        std::vector<std::string> names;
        for (const auto& one : bus.answers())
            names.push_back(fmt::format("{} ({:.0f})", one.name, one.score()));
        return fmt::format("{}: no signal follows the gimbal alone: {}", kLoudNames[gimbal],
                           one_of(names));
    }
    for (std::size_t other = 0; other < 3; ++other)
        if (other != gimbal && angle_[other] == *winner)
            return fmt::format("{}: {} follows it, which follows the {} gimbal, too",
                               kLoudNames[gimbal], *winner, kLoudNames[other]);
    angle_[gimbal] = *winner;
    score_[gimbal] = fmt::format("{:.0f} times its noise when the gimbal was turned by hand",
                                 bus.answers()[0].score());
    return {};
}

void BusFinder::listen(const proto::Dbc& dbc, const BusSignals& bus, const BusList& list) {
    counters_.clear();
    for (const auto& signal : bus.signals())
        if (signal.kind == BusSignals::Kind::counter) counters_.push_back(signal.name);
    rate_of_ = counters_.size() == 1 ? counters_[0] : angle_[0];
    measured_hz_ = 0;
    const auto* const message = dbc.find(std::string_view(rate_of_).substr(0, rate_of_.find('.')));
    for (const auto& heard : list.messages())
        if (message != nullptr && heard.id == message->id && heard.extended == message->extended &&
            heard.period_ms > 0)
            measured_hz_ = 1e3 / heard.period_ms;
}

Finding BusFinder::finding() const {
    Finding f;
    f.outcome = Finding::Outcome::undecided;
    for (std::size_t g = 0; g < 3; ++g)
        if (angle_[g].empty()) {
            f.why = fmt::format("the {} gimbal's angle is not known", kGimbalNames[g]);
            f.suspects = {std::string("can.signals.") + kGimbalNames[g]};
            return f;
        }
    if (accelerometers_.size() != 3) {
        f.why = "three accelerometers of constant norm: found " + one_of(accelerometers_);
        f.suspects = {"can.signals.accel_x", "can.signals.accel_y", "can.signals.accel_z"};
        return f;
    }
    if (!(measured_hz_ > 0)) {
        f.why = "samples a second are not measured: no counter, or its message came once";
        f.suspects = {"can.sample_rate_hz"};
        return f;
    }
    if (configured_hz_ > 0 && std::abs(measured_hz_ / configured_hz_ - 1) > kRateTolerance) {
        f.outcome = Finding::Outcome::refused;
        f.why = fmt::format(
            "{:.4g} samples/s measured by the kernel's stamps, can.sample_rate_hz = {:g}: expected "
            "within {:g} %",
            measured_hz_, configured_hz_, 100 * kRateTolerance);
        f.suspects = {"can.sample_rate_hz"};
        return f;
    }
    f.outcome = Finding::Outcome::decided;
    f.keys.push_back({"can.dbc", quoted(dbc_), "as the signals were found with"});
    for (std::size_t g = 0; g < 3; ++g)
        f.keys.push_back(
            {std::string("can.signals.") + kGimbalNames[g], quoted(angle_[g]), score_[g]});
    for (std::size_t i = 0; i < 3; ++i)
        f.keys.push_back({std::string("can.signals.accel_") + "xyz"[i], quoted(accelerometers_[i]),
                          "constant norm of three; gravity says along which axis"});
    if (counters_.size() == 1)
        f.keys.push_back(
            {"can.signals.sync_count", quoted(counters_[0]), "grows by one with each frame"});
    const double hz =
        configured_hz_ > 0 ? configured_hz_ : std::stod(fmt::format("{:.3g}", measured_hz_));
    f.keys.push_back(
        {"can.sample_rate_hz", fmt::format("{:g}", hz),
         fmt::format("{:.4g} frames/s with {} by the kernel's stamps", measured_hz_, rate_of_)});
    return f;
}

}  // namespace vibrig::commission
