// A look, B small moves, C sweeps, D all gimbals together.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "daemon/commission/procedure.hpp"
#include "estimator/filter/angles.hpp"

namespace vibrig::commission {

namespace {

constexpr double kFirst_deg = 0.01, kLast_deg = 9;  // of the doubling
constexpr double kMoved_sigma = 20;
constexpr double kSameRatio = 0.02;
constexpr double kHolds_g = 0.01;
constexpr std::array<double, 3> kSmall_deg{2, 5.5, 9};
constexpr double kHardlyResponds = 0.3;
constexpr double kMean_s = 5;

double norm(const Vec3& v) { return std::hypot(v[0], v[1], v[2]); }

Vec3 difference(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

/// Of what is not g; empty: it is, or it is nothing known.
std::string unit_of_force(double size) {
    const auto near = [size](double one) { return std::abs(size / one - 1) < 0.05; };
    if (near(9.80665)) return "m/s^2";
    if (near(1000)) return "mg";
    for (double counts = 256; counts < 2e7; counts *= 2)
        if (near(counts)) return fmt::format("counts of 1/{:.0f} g", counts);
    return {};
}

}  // namespace

/// Nothing bounds the first moves of a gimbal that does not turn gravity and whose reading and
/// command both count in turns.
void Procedure::ask_degrees() {
    if (by_hand_) return look();
    if (stated_.simulated) return ask_travel();
    ask_yes("degrees",
            "By the maker's paper: do the three angle channels and the gimbals' commands count in "
            "degrees?",
            "angles do not count in degrees: by hand (--by-hand)", [this] { ask_travel(); });
}

void Procedure::ask_travel() {
    const auto wrong = [this](std::string& value) -> std::string {
        std::istringstream in(value);
        auto limits = limits_deg_;
        std::array<bool, 3> free{};
        for (std::size_t k = 0; k < 3; ++k) {
            std::string low, high;
            in >> low;
            free[k] = low == "free";
            if (free[k]) continue;
            in >> high;
            auto& [least, most] = limits[k];
            if (!number_in(low, -175, 0, least) || !number_in(high, 0, 175, most) ||
                most - least < 20)
                return "for each gimbal free, or two numbers from -175..0 to 0..175, 20 apart at "
                       "least";
        }
        if (std::string rest; in >> rest) return "nothing after the azimuth gimbal's";
        limits_deg_ = limits;
        free_ = free;
        return {};
    };
    ask({"travel",
         "Travel that cables allow from here, deg: outer, inner, azimuth, lowest and highest of "
         "each; or free.",
         "e.g. -130 130 -30 30 free", "-130 130 -30 30 -175 175", wrong},
        [this](const std::string&) { ask_stop_means(); });
}

void Procedure::ask_stop_means() {
    const auto wrong = [](std::string& value) {
        if (value == "h") value = "hold";
        if (value == "r") value = "release";
        return value == "hold" || value == "release" ? "" : "hold or release";
    };
    ask({"stop", "If something moves wrong: hold where it is, or release?", "hold or release",
         "hold", wrong},
        [this](const std::string& value) {
            hold_ = value == "hold";
            look();
        });
}

void Procedure::look() {
    samples_.clear();
    average(kMean_s, [this] { looked(); });
}

void Procedure::looked() {
    start_ = mean_.angle;
    const double size = norm(mean_.force);
    if (const auto unit = unit_of_force(size); !unit.empty())
        return conclude(Verdict::refused,
                        fmt::format("the accelerometers show {:.4g} at rest: {}, not g: mend their "
                                    "factors in the DBC",
                                    size, unit),
                        {"can.dbc"});
    const std::string rate = rate_text();
    if (!active()) return;
    tell(fmt::format("A  {}|f| = {:.3f} g{}", rate, size,
                     std::abs(size - 1) < 0.05 ? "" : ": not 1, an accelerometer may be dead"));
    for (const auto& name : stuck_channels())
        tell(fmt::format("   {} has not changed while its neighbours did: not connected?", name));
    for (const auto& name : names_.coarse) tell(fmt::format("   {}, 12 at least expected", name));
    slot_ = 0;
    if (by_hand_) return try_gimbal();
    ask_yes("permit.hold", "I will command the present readings: nothing should move. May I?",
            "nothing may be commanded: by hand (--by-hand)", [this] { hold_still(); });
}

/// "40.0 samples/s, 6 channels, "; it ends where that is not what is configured.
std::string Procedure::rate_text() {
    // What was kept was looked at by the daemon that kept it.
    if (replaying_) return {};
    const auto rate = rig_->rate();
    if (!rate) return {};
    if (!rate->why.empty()) {
        conclude(Verdict::refused, rate->why, {"can.sample_rate_hz", "can.signals.sync_count"});
        return {};
    }
    return fmt::format("{:.1f} samples/s, 6 channels, ", rate->measured_hz);
}

/// Through 50 samples at rest, where others of its kind show their noise.
std::vector<std::string> Procedure::stuck_channels() const {
    constexpr std::size_t kSamples = 50;
    std::vector<std::string> names;
    if (samples_.size() < kSamples) return names;
    const auto sticks = [this](Vec3 Look::*of) {
        std::array<bool, 3> stuck{true, true, true};
        for (const Look& one : samples_)
            for (std::size_t i = 0; i < 3; ++i)
                stuck[i] = stuck[i] && (one.*of)[i] == (samples_.front().*of)[i];
        return stuck;
    };
    for (const auto& [of, called] :
         {std::pair{&Look::angle, &names_.angle}, std::pair{&Look::force, &names_.force}}) {
        const auto stuck = sticks(of);
        for (std::size_t i = 0; i < 3; ++i)
            if (stuck[i] && std::ranges::count(stuck, true) < 3) names.push_back((*called)[i]);
    }
    return names;
}

void Procedure::hold_still() {
    command_0_ = start_;
    before_ = mean_;
    asked_ = travel_ = {};
    legs_ = {Vec3{}};
    moving_slot_ = 3;
    then_ = [this] { average(1, [this] { held_still(); }); };
    since_ = now_;
    doing_ = Doing::moving;
    command_to(command_0_);
}

void Procedure::held_still() {
    const Vec3 moved = difference(unwrapped(mean_.angle, start_), start_);
    bool holds = true;
    for (std::size_t c = 0; c < 3; ++c)
        holds = holds && std::abs(moved[c]) <= kHolds_deg + kMoved_sigma * noise_[c];
    if (!holds || norm(difference(mean_.force, before_.force)) > kHolds_g)
        return conclude(Verdict::undecided,
                        fmt::format("commanded where they are, the gimbals moved by {:.2f} {:.2f} "
                                    "{:.2f}: command and encoder differ: by hand (--by-hand)",
                                    moved[0], moved[1], moved[2]),
                        {"gimbal.message"});
    holds_ = true;
    try_gimbal();
}

void Procedure::try_gimbal() {
    const std::string name = kLoudNames[slot_];
    if (by_hand_) {
        before_ = mean_;
        return ask({std::string("hand.") + kGimbalNames[slot_],
                    "Turn the " + name + " gimbal by about 9 deg by hand, and hold still.", "done",
                    "done", done_alone},
                   [this](const std::string&) { average(3, [this] { hand_moved(); }); });
    }
    ask_yes(std::string("permit.") + kGimbalNames[slot_],
            "I will move the " + name + " gimbal by a little; the direction is not known. May I?",
            "the " + name + " gimbal may not move: by hand (--by-hand)", [this] {
                amount_deg_ = kFirst_deg;
                average(1, [this] {
                    small_ = {mean_};
                    nudge();
                });
            });
}

void Procedure::hand_moved() {
    // By how many times its noise: nobody knows the units yet.
    const Vec3 change = difference(unwrapped(mean_.angle, before_.angle), before_.angle);
    std::size_t most = 0;
    for (std::size_t c = 1; c < 3; ++c)
        if (std::abs(change[c]) / noise_[c] > std::abs(change[most]) / noise_[most]) most = c;
    if (std::abs(change[most]) < kMoved_sigma * noise_[most])
        return conclude(Verdict::undecided,
                        fmt::format("no angle channel follows the {} gimbal: it is stuck, or its "
                                    "channel is",
                                    kLoudNames[slot_]),
                        {key_of(slot_)});
    channel_of_[slot_] = most;
    travel_[slot_] = kLast_deg;
    said_[slot_] = static_cast<int>(slot_);
    respond_[slot_] =
        norm(difference(mean_.force, before_.force)) / (kLast_deg * estimator::kRadPerDeg);
    tell(fmt::format("B  {} follows the {} gimbal", names_.angle[most], kLoudNames[slot_]));
    next_gimbal();
}

void Procedure::nudge() {
    Vec3 to = travel_;
    to[slot_] = amount_deg_;
    move(to, [this] { average(1, [this] { nudged(); }); });
}

void Procedure::nudged() {
    const Vec3& first = small_.front().angle;  // near 0 the next reading may be 360
    const Vec3 change = difference(unwrapped(mean_.angle, first), first);
    std::vector<std::size_t> moved;
    for (std::size_t c = 0; c < 3; ++c)
        if (std::abs(change[c]) > kMoved_sigma * noise_[c]) moved.push_back(c);
    if (moved.size() > 1)
        return conclude(
            Verdict::undecided,
            fmt::format("{} and {} both follow the command of the {} gimbal",
                        names_.angle[moved[0]], names_.angle[moved[1]], kLoudNames[slot_]),
            {key_of(moved[0]), key_of(moved[1])});
    if (moved.size() == 1) {
        channel_of_[slot_] = moved[0];
        return small_move(0);
    }
    if (amount_deg_ >= kLast_deg)
        return conclude(Verdict::undecided,
                        fmt::format("no angle channel follows the command of the {} gimbal up to "
                                    "{:g} deg: it is stuck, or obeys nobody",
                                    kLoudNames[slot_], kLast_deg),
                        {"gimbal.message", key_of(slot_)});
    amount_deg_ = std::min(2 * amount_deg_, kLast_deg);
    nudge();
}

void Procedure::small_move(std::size_t index) {
    if (index == kSmall_deg.size()) return small_moved();
    Vec3 to = travel_;
    to[slot_] = kSmall_deg[index];
    move(to, [this, index] {
        average(1, [this, index] {
            small_.push_back(mean_);
            small_move(index + 1);
        });
    });
}

/// Two of three steps agree: the third may have crossed the end of the reading's turn.
void Procedure::small_moved() {
    const std::size_t c = channel_of_[slot_];
    std::array<double, 3> step{}, span{2, 3.5, 3.5};
    for (std::size_t i = 0; i < 3; ++i)
        step[i] = (small_[i + 1].angle[c] - small_[i].angle[c]) / span[i];
    double ratio = 0;
    constexpr std::array<std::array<std::size_t, 2>, 3> kPairs{{{1, 2}, {0, 1}, {0, 2}}};
    for (const auto& [i, j] : kPairs) {
        // The mean of a second has a sigma of noise / sqrt(samples); 3 of a single one is ample.
        const double allowed = kSameRatio * std::abs(step[i]) + 3 * noise_[c] / span[j];
        if (ratio == 0 && std::abs(step[i] - step[j]) <= allowed) ratio = (step[i] + step[j]) / 2;
    }
    bool fits = ratio != 0;
    for (std::size_t i = 0; fits && i < 3; ++i)
        fits = std::abs(std::remainder((step[i] - ratio) * span[i], 360 * ratio)) <=
               2 * kSameRatio * std::abs(ratio) * span[i] + 6 * noise_[c];
    if (!fits)
        return conclude(Verdict::undecided,
                        fmt::format("{} follows the {} gimbal unevenly: {:.4g} {:.4g} {:.4g} for 1 "
                                    "deg",
                                    names_.angle[c], kLoudNames[slot_], step[0], step[1], step[2]),
                        {key_of(c), "can.dbc"});
    ratio_[c] = ratio;
    respond_[slot_] = norm(difference(small_.back().force, small_.front().force)) /
                      (kLast_deg * estimator::kRadPerDeg);
    confirm_name();
}

void Procedure::confirm_name() {
    const std::size_t c = channel_of_[slot_];
    const auto line = fmt::format("{} follows: {:+.4g} for {:+g} deg, nothing else moves",
                                  names_.angle[c], ratio_[c] * kLast_deg, kLast_deg);
    tell("B  " + line);
    const auto wrong = [](std::string& value) {
        return std::ranges::find(kGimbalNames, value) != kGimbalNames.end()
                   ? ""
                   : "outer, inner or azimuth";
    };
    ask({std::string("which.") + kGimbalNames[slot_], "Which gimbal turned?",
         "outer, inner or azimuth", kGimbalNames[slot_], wrong},
        [this](const std::string& value) {
            const auto* const at = std::ranges::find(kGimbalNames, value);
            const auto gimbal = static_cast<std::size_t>(at - kGimbalNames.begin());
            if (gimbal == slot_) return name_gimbal(gimbal);
            const auto& [least, most] = limits_deg_[gimbal];
            ask_yes(
                std::string("sure.") + kGimbalNames[slot_],
                fmt::format("The command named {} moves the {} gimbal, then, which may travel "
                            "{:+g} to {:+g} deg. Sure?",
                            kLoudNames[slot_], kLoudNames[gimbal], least, most),
                "nobody is sure which gimbal turned", [this, gimbal] { name_gimbal(gimbal); },
                "yes");
        });
}

void Procedure::name_gimbal(std::size_t gimbal) {
    said_[slot_] = static_cast<int>(gimbal);
    move({}, [this] { next_gimbal(); });
}

std::size_t Procedure::slot_said(std::size_t gimbal) const {
    return static_cast<std::size_t>(std::ranges::find(said_, static_cast<int>(gimbal)) -
                                    said_.begin());
}

Vec3 Procedure::by_slot(const Vec3& by_gimbal) const {
    Vec3 out{};
    for (std::size_t g = 0; g < 3; ++g) out[slot_said(g)] = by_gimbal[g];
    return out;
}

void Procedure::next_gimbal() {
    if (++slot_ < 3) return try_gimbal();
    auto sorted = channel_of_;
    std::ranges::sort(sorted);
    if (sorted != std::array<std::size_t, 3>{0, 1, 2})
        return conclude(Verdict::undecided, "two gimbals move the same angle channel",
                        {key_of(0), key_of(1), key_of(2)});
    auto names = said_;
    std::ranges::sort(names);
    if (names != std::array<int, 3>{0, 1, 2})
        return conclude(Verdict::undecided,
                        fmt::format("the commands OUTER INNER AZIMUTH move the {} {} {} gimbal, "
                                    "says {}: one is wrong",
                                    kGimbalNames[static_cast<std::size_t>(said_[0])],
                                    kGimbalNames[static_cast<std::size_t>(said_[1])],
                                    kGimbalNames[static_cast<std::size_t>(said_[2])], by_),
                        {"gimbal.message"});
    // Cables are the gimbals', whatever their commands are called.
    const auto limits = limits_deg_;
    const auto free = free_;
    for (std::size_t g = 0; g < 3; ++g) {
        limits_deg_[slot_said(g)] = limits[g];
        free_[slot_said(g)] = free[g];
    }
    careful_ = false;
    if (respond_[slot_said(1)] < kHardlyResponds || respond_[slot_said(2)] < kHardlyResponds) {
        const auto& [least, most] = limits_deg_[slot_said(0)];
        outer_deg_ = std::clamp(40.0, least, most);
    }
    plan_sweeps();
}

void Procedure::plan_sweeps() {
    const std::array<std::vector<double>, 3> sweeps{
        {{0, 31, 73, 118}, {-25, -9, 11, 25}, {0, 31, 73, 118}}};
    constexpr std::array<Vec3, 4> kTogether{
        {{-60, 25, 100}, {-100, -25, 160}, {80, 25, -130}, {100, -20, -60}}};
    const auto scaled = [this](std::size_t g, double travel, double farthest) {
        const auto& [least, most] = limits_deg_[slot_said(g)];
        return travel * std::min(1.0, (travel >= 0 ? most : -least) / farthest);
    };
    plan_.clear();
    for (std::size_t g = 0; g < 3; ++g) {
        for (const double travel : sweeps[g]) {
            Vec3 to{g == 0 ? 0 : outer_deg_, 0, 0};
            to[g] = scaled(g, travel, g == 1 ? 25 : 118);
            plan_.push_back({by_slot(to), static_cast<int>(slot_said(g))});
        }
    }
    for (const Vec3& to : kTogether)
        plan_.push_back(
            {by_slot({scaled(0, to[0], 100), scaled(1, to[1], 25), scaled(2, to[2], 160)}), -1});
    at_ = 0;
    tell(fmt::format("C  {} positions: each gimbal alone, then all together", plan_.size()));
    next_stop();
}

void Procedure::next_stop() {
    if (at_ == plan_.size()) return decide_gravity();
    move(plan_[at_].travel, [this] {
        average(kMean_s, [this] {
            const int slot = plan_[at_].slot;
            const int swept =
                slot < 0 ? -1 : static_cast<int>(channel_of_[static_cast<std::size_t>(slot)]);
            stops_.push_back({mean_.angle, mean_.force, swept});
            ++at_;
            next_stop();
        });
    });
}

}  // namespace vibrig::commission
