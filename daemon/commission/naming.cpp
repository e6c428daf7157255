// What follows from the positions: gravity's decision (E: one more position), F the Earth's rate,
// and what people say.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "daemon/commission/procedure.hpp"
#include "estimator/filter/angles.hpp"

namespace vibrig::commission {

namespace room = estimator::commissioning;

namespace {

using estimator::kDegPerRad;

constexpr int kMostExtra = 3;
constexpr double kSeparates_g = 10e-3;
constexpr double kWatched_deg = 40;
// ln odds of noise: near the equator the vertical rate tells no hemisphere.
constexpr double kSaysNothing = 1;

const char* yes_no_or_unknown(std::string& value) {
    if (value == "y") value = "yes";
    if (value == "n") value = "no";
    return value == "yes" || value == "no" || value == "-" ? "" : "yes, no or - (not known)";
}

/// Least squares, per hour.
double slope_of(const std::vector<Look>& seconds, std::size_t c) {
    double t = 0, y = 0, tt = 0, ty = 0;
    const double n = static_cast<double>(seconds.size());
    for (const Look& one : seconds) {
        const double hours = drivers::to_seconds(one.from - seconds.front().from) / 3600;
        const double angle = one.angle[c] - seconds.front().angle[c];
        t += hours;
        y += angle;
        tt += hours * hours;
        ty += hours * angle;
    }
    return (n * ty - t * y) / (n * tt - t * t);
}

/// The description began with either parity: 1 or -1, by which the witnesses' odds are those of
/// what they decide together.
double decided_parity(const room::EarthFinding& earth) {
    double sum = 0;
    for (const auto& witness : earth.witnesses) sum += witness.ln_odds;
    return std::copysign(1.0, sum);
}

/// Why the hemisphere that was stated is not the one measured; empty: nothing says so. Its key is
/// of the record, and would be wrong.
std::string outvoted_latitude(const room::EarthFinding& earth, double stated_deg) {
    const double parity = decided_parity(earth);
    double latitude = 0;
    for (const auto& witness : earth.witnesses)
        if (witness.name == "latitude") latitude = witness.ln_odds;
    if (latitude * parity >= 0 || std::abs(latitude) < kSaysNothing) return {};
    std::string heard;
    for (const auto& witness : earth.witnesses)
        heard += fmt::format("{}{} {:+.1f}", heard.empty() ? "" : ", ", witness.name,
                             parity * witness.ln_odds);
    return fmt::format(
        "site.latitude_deg: {:.2f} stated, the {} hemisphere measured, as the others say ({}): "
        "one side is wrong",
        stated_deg, earth.rate.neu[2] > 0 ? "northern" : "southern", heard);
}

/// Where too few agree: who was not heard, or said nothing, and how to ask.
std::string would_tell(const room::EarthFinding& earth) {
    if (!earth.why.starts_with("accelerometers inverted")) return {};
    std::string left, first;
    for (const std::string name : {"latitude", "compass", "drawing", "sense"}) {
        const auto heard = std::ranges::find(earth.witnesses, name, &room::Witness::name);
        if (heard != earth.witnesses.end() && std::abs(heard->ln_odds) >= kSaysNothing) continue;
        if (left.empty()) first = name;
        left += (left.empty() ? "" : ", ") + name;
    }
    if (left.empty()) return {};
    return fmt::format("; what would tell: {} (vibrig commission --ask {})", left, first);
}

/// Keys that the witnesses stand for: those that are outvoted, or where too few agree all that
/// parity stands on.
std::vector<std::string> earth_suspects(const room::EarthFinding& earth) {
    const auto key_of = [](const std::string& witness) {
        return witness == "latitude"  ? "site.latitude_deg"
               : witness == "compass" ? "site.azimuth_deg"
               : witness == "drawing" ? "accelerometer.matrix"
                                      : "platform.encoder_sign";
    };
    std::vector<std::string> keys;
    if (earth.why.starts_with("site.") || earth.why.starts_with("time")) {
        keys.push_back(earth.why.substr(0, earth.why.find_first_of(": ")));
        return keys;
    }
    const double parity = decided_parity(earth);
    for (const auto& witness : earth.witnesses)
        if (witness.ln_odds * parity < 0 && std::abs(witness.ln_odds) > kSaysNothing)
            keys.emplace_back(key_of(witness.name));
    if (keys.empty()) keys = {"accelerometer.matrix", "site.latitude_deg"};
    return keys;
}

}  // namespace

std::size_t Procedure::slot_of(std::size_t gimbal) const {
    const auto channel = static_cast<std::size_t>(named_.channel[gimbal]);
    return static_cast<std::size_t>(std::ranges::find(channel_of_, channel) - channel_of_.begin());
}

void Procedure::decide_gravity() {
    try {
        gravity_ = room::find_by_gravity(stops_);
    } catch (const std::invalid_argument& wrong) {
        return conclude(Verdict::refused, wrong.what());
    }
    finding_.hypotheses = hypotheses_of(gravity_);
    note("hypothesis", finding_.hypotheses);
    const auto channels = [this](std::string why) {
        for (std::size_t c = 0; c < 3; ++c) {
            const auto word = fmt::format("angle channel {}", c + 1);
            if (const auto at = why.find(word); at != std::string::npos)
                why.insert(at + word.size(), fmt::format(" ({})", names_.angle[c]));
        }
        return why;
    };
    if (gravity_.verdict == Verdict::refused)
        return conclude(Verdict::refused, channels(gravity_.why), gravity_suspects());
    if (gravity_.verdict == Verdict::undecided) {
        if (gravity_.hypotheses.size() > 1 && extra_ < kMostExtra && !by_hand_) return separate();
        return conclude(Verdict::undecided, channels(gravity_.why), gravity_suspects());
    }
    const auto& best = gravity_.hypotheses.front();
    named_ = room::preferred_of(best.best);
    const double ratio =
        gravity_.hypotheses.size() > 1 ? -gravity_.hypotheses[1].ln_ratio : best.cost;
    finding_.evidence = {
        {"ln_ratio", ratio}, {"rms_mg", 1e3 * best.rms_g}, {"positions", stops_.size()}};
    finding_.second_person = gravity_.second_person;
    tell(fmt::format("D  {} positions; rms {:.2f} mg; ln ratio to the next description {:.0f}",
                     stops_.size(), 1e3 * best.rms_g, ratio));
    for (std::size_t g = 0; g < 3; ++g) {
        const auto c = static_cast<std::size_t>(named_.channel[g]);
        tell(fmt::format("   {} is the {} gimbal, in {}", names_.angle[c], kGimbalNames[g],
                         room::angle_units()[static_cast<std::size_t>(named_.unit[g])].name));
    }
    if (const auto wrong = wrong_name(); !wrong.empty())
        return conclude(Verdict::refused, wrong, {key_of(0), key_of(1), key_of(2)});
    plan_drifts();
}

/// The keys in which the best two descriptions differ; of one that is no description at all what
/// its reason is about.
std::vector<std::string> Procedure::gravity_suspects() const {
    std::vector<std::string> keys;
    for (std::size_t c = 0; c < 3; ++c) {
        if (gravity_.why.find(fmt::format("angle channel {} ", c + 1)) != std::string::npos ||
            gravity_.why.find(fmt::format("angle channel {}:", c + 1)) != std::string::npos)
            keys.push_back(key_of(c));
        const std::string accelerometer(1, "xyz"[c]);
        if (gravity_.why.starts_with("accelerometer." + accelerometer))
            keys.push_back("can.signals.accel_" + accelerometer);
    }
    if (!keys.empty()) return keys;
    if (gravity_.verdict == Verdict::refused || gravity_.hypotheses.size() < 2)
        return {"accelerometer.matrix", "can.dbc"};
    const auto& a = gravity_.hypotheses[0];
    const auto& b = gravity_.hypotheses[1];
    for (std::size_t g = 0; g < 3; ++g)
        if (a.best.channel[g] != b.best.channel[g]) keys.push_back(key_of(g));
    if (a.sign_product() != b.sign_product()) keys.emplace_back("platform.encoder_sign");
    if (a.best.unit != b.best.unit) keys.emplace_back("can.dbc");
    return keys;
}

/// What a person says a gimbal is, against what gravity says.
std::string Procedure::wrong_name() const {
    for (std::size_t g = 0; g < 3; ++g) {
        const std::size_t slot = slot_of(g);
        if (slot == 3 || said_[slot] < 0 || said_[slot] == static_cast<int>(g)) continue;
        return fmt::format("{}: {} says it is the {} gimbal, gravity says the {} one",
                           names_.angle[static_cast<std::size_t>(named_.channel[g])], by_,
                           kGimbalNames[static_cast<std::size_t>(said_[slot])], kGimbalNames[g]);
    }
    return {};
}

std::array<double, 2> Procedure::readings_of(std::size_t slot) const {
    const std::size_t c = channel_of_[slot];
    const double a = start_[c] + ratio_[c] * limits_deg_[slot][0];
    const double b = start_[c] + ratio_[c] * limits_deg_[slot][1];
    return {std::min(a, b), std::max(a, b)};
}

void Procedure::separate() {
    std::array<std::array<double, 2>, 3> limits{};
    for (std::size_t k = 0; k < 3; ++k) {
        limits[channel_of_[k]] = readings_of(k);
    }
    const auto found =
        room::separating_position(gravity_.hypotheses[0].best, gravity_.hypotheses[1].best, limits);
    Vec3 travel{};
    for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t c = channel_of_[k];
        travel[k] = (found.reading[c] - start_[c]) / ratio_[c];
    }
    finding_.would_separate = {{"position_deg", found.reading}, {"by_mg", 1e3 * found.by_g}};
    if (found.by_g < kSeparates_g)
        return conclude(Verdict::undecided,
                        gravity_.why + fmt::format("; within the travel a position tells them "
                                                   "apart by {:.1f} mg, 10 asked",
                                                   1e3 * found.by_g),
                        gravity_suspects());
    ++extra_;
    tell("E  one more position, which separates best");
    move(travel, [this] {
        average(5, [this] {
            stops_.push_back({mean_.angle, mean_.force, -1});
            decide_gravity();
        });
    });
}

double Procedure::travel_to(std::size_t gimbal, double angle_deg) const {
    const auto c = static_cast<std::size_t>(named_.channel[gimbal]);
    const double at = kDegPerRad * named_.angles(start_)[static_cast<int>(gimbal)];
    const double degrees =
        room::angle_units()[static_cast<std::size_t>(named_.unit[gimbal])].degrees;
    return named_.sign[gimbal] * std::remainder(angle_deg - at, 360.0) / (degrees * ratio_[c]);
}

void Procedure::plan_drifts() {
    for (std::size_t g = 0; by_hand_ && g < 3; ++g) {
        // By hand the travel counts as the reading does.
        const auto c = static_cast<std::size_t>(named_.channel[g]);
        ratio_[c] = 1 / room::angle_units()[static_cast<std::size_t>(named_.unit[g])].degrees;
    }
    const auto nearer = [this](double one, double other) {
        // First that the travel allows it.
        const auto limits = limits_deg_[slot_of(0)];
        const auto cost = [&limits](double travel) {
            return std::abs(travel) +
                   1e3 * std::abs(travel - std::clamp(travel, limits[0], limits[1]));
        };
        const double a = travel_to(0, one), b = travel_to(0, other);
        return cost(a) <= cost(b) ? a : b;
    };
    const double upright = nearer(90, -90), level = nearer(0, 180), inner = travel_to(1, 0);
    plan_.clear();
    const auto add = [&](double outer, double azimuth) {
        Vec3 to{};
        to[slot_of(0)] = outer;
        to[slot_of(1)] = inner;
        to[slot_of(2)] = azimuth;
        plan_.push_back({to, -1});
    };
    for (const double azimuth : {-85.0, 85.0}) add(upright, azimuth);
    for (const double azimuth : {85.0, -85.0, 0.0}) add(level, azimuth);
    at_ = 0;
    drifts_.clear();
    tell(fmt::format("F  free drift at {} positions, {:.0f} s each", plan_.size(), kDrift_s));
    next_drift();
}

void Procedure::next_drift() {
    if (at_ == plan_.size()) return ask_people();
    move(plan_[at_].travel, [this] {
        if (!by_hand_) release();
        average(kLetGo_s, [this] { average(kDrift_s, [this] { drifted(); }); });
    });
}

Vec3 Procedure::drift_slope() const {
    return {slope_of(seconds_, 0), slope_of(seconds_, 1), slope_of(seconds_, 2)};
}

void Procedure::drifted() {
    const room::FreeDrift drift{mean_.angle, drift_slope()};
    drifts_.push_back(drift);
    if (at_++ == 0) return watch_azimuth();
    next_drift();
}

void Procedure::watch_azimuth() {
    sense_before_ = mean_;
    const std::string seen = "seen from the upper end of its axis";
    if (by_hand_)
        return ask({"turn",
                    "Turn the AZIMUTH gimbal by about 20 deg anticlockwise, " + seen +
                        ", and hold still; or -.",
                    "done or -", "done",
                    [](std::string& v) { return v == "done" || v == "-" ? "" : "done or -"; }},
                   [this](const std::string& value) {
                       if (value == "-") return after_sense();
                       average(3, [this] { azimuth_turned(); });
                   });
    ask({"watch", "Next the AZIMUTH gimbal turns by 40 deg. Watch it, " + seen + ". Ready?", "yes",
         "yes", [](std::string& v) { return v == "yes" || v == "y" ? "" : "yes"; }},
        [this](const std::string&) {
            Vec3 to = travel_;
            const std::size_t slot = slot_of(2);
            const double room_above = limits_deg_[slot][1] - to[slot];
            to[slot] += room_above >= kWatched_deg ? kWatched_deg : -kWatched_deg;
            move(to, [this] { average(1, [this] { azimuth_turned(); }); });
        });
}

void Procedure::azimuth_turned() {
    const auto c = static_cast<std::size_t>(named_.channel[2]);
    const bool grew = unwrapped(mean_.angle, sense_before_.angle)[c] > sense_before_.angle[c];
    const auto take = [this](bool with_anticlockwise) {
        said_of_rig_.sense = room::Statements::Sense{sense_before_.angle, with_anticlockwise};
        after_sense();
    };
    if (by_hand_) return take(grew);
    ask({"anticlockwise", "Seen from the upper end of its axis: did it turn anticlockwise?",
         "yes, no or - (not known)", "-", yes_no_or_unknown},
        [this, take, grew](const std::string& value) {
            if (value == "-") return after_sense();
            take((value == "yes") == grew);
        });
}

void Procedure::ask_people() {
    if (again_ == "sense") return ask_sense_again();
    ask_latitude();
}

void Procedure::ask_sense_again() {
    again_.clear();
    sense_again_ = true;
    // Where the azimuth axis stands upright.
    move(plan_.front().travel, [this] { average(1, [this] { watch_azimuth(); }); });
}

void Procedure::after_sense() {
    if (std::exchange(sense_again_, false)) return ask_latitude();
    next_drift();
}

void Procedure::ask_latitude() {
    const auto latitude = [](std::string& value) {
        double number = 0;
        return number_in(value, -90, 90, number) ? "" : "-90 to 90";
    };
    const auto compass = [](std::string& value) {
        double number = 0;
        return value == "-" || number_in(value, -360, 360, number)
                   ? ""
                   : "-360 to 360, or - (not known)";
    };
    ask({"latitude", "Latitude of this place, deg, north of the equator positive?", "deg",
         fmt::format("{:.6g}", stated_.latitude_deg), latitude},
        [this, compass](const std::string& value) {
            said_of_rig_.latitude_deg = std::stod(value);
            ask({"compass",
                 "Line of the outer axis by compass, deg from true north towards east, either end?",
                 "deg, or - (not known)", "-", compass},
                [this](const std::string& line) {
                    if (line != "-") said_of_rig_.compass_deg = std::stod(line);
                    ask_drawing();
                });
        });
}

void Procedure::ask_drawing() {
    ask({"drawing",
         fmt::format("By the drawing, do the accelerometers {}, {}, {}, in this order, form a "
                     "right-handed triad?",
                     names_.force[0], names_.force[1], names_.force[2]),
         "yes, no or - (not known)", "-", yes_no_or_unknown},
        [this](const std::string& value) {
            if (value != "-") said_of_rig_.right_handed = value == "yes";
            decide();
        });
}

void Procedure::decide() {
    room::EarthSettings settings;
    settings.linear_sigma = stated_.linear_sigma;
    room::EarthFinding earth;
    try {
        earth = room::find_by_earth(named_, drifts_, said_of_rig_, settings);
    } catch (const std::invalid_argument& wrong) {
        return conclude(Verdict::refused, wrong.what());
    }
    for (const auto& witness : earth.witnesses)
        finding_.witnesses.push_back(
            {{"name", witness.name}, {"ln_odds", decided_parity(earth) * witness.ln_odds}});
    tell(fmt::format("F  Earth rate north {:.2f} east {:.2f} up {:.1f} +- {:.1f} deg/h",
                     earth.rate.neu[0], earth.rate.neu[1], earth.rate.neu[2], earth.rate.sigma[2]));
    tell(fmt::format("   latitude {:.2f} or its negative ({:.2f} stated), azimuth {:.2f} deg",
                     earth.rate.latitude_deg(), *said_of_rig_.latitude_deg,
                     earth.rate.azimuth_deg()));
    for (const auto& wrong : earth.outvoted) tell("   " + wrong);
    for (const auto& witness : earth.witnesses)
        if (witness.name == "latitude" && std::abs(witness.ln_odds) < kSaysNothing)
            tell("   too near the equator: the hemisphere is " + by_ + "'s word alone");
    if (earth.verdict != Verdict::decided)
        return conclude(Verdict::undecided, earth.why + would_tell(earth), earth_suspects(earth));
    if (const auto wrong = outvoted_latitude(earth, *said_of_rig_.latitude_deg); !wrong.empty())
        return conclude(Verdict::undecided, wrong, earth_suspects(earth));
    earth_ = std::move(earth);
    ask_torques();
}

/// For the record.
std::string Procedure::why_not_torqued() const {
    if (!rig_->has_torquers()) return "the DBC has no torques";
    if (!by_hand_) return "no torque was permitted";
    // A torque is ended by commanding the gimbals to stand; here nothing stops what it turns.
    return "moved by hand: motors off, nothing holds a platform that a torque turns the wrong way";
}

void Procedure::name_rig() {
    Commanded commanded;
    commanded.known = !by_hand_;
    commanded.met_a_stop = met_a_stop_;
    commanded.ratio = ratio_;
    for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t c = channel_of_[k];
        commanded.travel[c] = readings_of(k);
        commanded.slot[c] = k;
        commanded.free[c] = free_[k];
    }
    if (!finding_.evidence.contains("torquers")) {
        finding_.evidence["torquers"] = {{"not_measured", why_not_torqued()}};
        if (by_hand_ && rig_->has_torquers())
            tell("G  not torqued, " + why_not_torqued() +
                 ": levelling.torque_sign stays as stated, unproven");
    }
    fill_keys(finding_, earth_.description, earth_.rate, names_, said_of_rig_, commanded);
    const auto rate = rig_->rate().value_or(SampleRate{});
    if (!rate.why.empty()) return conclude(Verdict::refused, rate.why, {"can.sample_rate_hz"});
    fill_bus_keys(finding_, names_, rate.measured_hz);
    conclude(Verdict::decided, {});
}

}  // namespace vibrig::commission
