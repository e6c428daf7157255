// What a step is made of: asking, moving, standing, averaging; and how each is stopped.
#include "daemon/commission/procedure.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "daemon/journal/latches.hpp"

namespace vibrig::commission {

using drivers::kSecond;
using drivers::Time;
using drivers::to_seconds;

namespace {

constexpr Time kPoll = 50 * drivers::kMillisecond;
constexpr Time kStale = kSecond / 2;
constexpr Time kStill = 20 * kSecond;  // what does not stand within it does not stand
constexpr double kOneWay_deg = 165;    // a longer move goes by the start: there is one shorter way
// Of the force's direction: a platform rocks when a slew ends.
constexpr double kRocks_deg = 2;
constexpr double kSlewShare = 0.02;  // ratios agree to it

/// Of a force of 1 g, at least: where an accelerometer is dead the rest turns less.
double turned_deg(const Vec3& a, const Vec3& b) {
    const double chord = std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    return 2 * 57.29577951 * std::asin(std::min(1.0, chord / 2));
}

/// First differences: what is wanted is the noise, not the drift of a free platform.
Vec3 noise_of(const std::vector<Look>& samples) {
    Vec3 noise{};
    for (std::size_t c = 0; c < 3; ++c) {
        double sum = 0;
        for (std::size_t i = 1; i < samples.size(); ++i)
            sum +=
                std::pow(std::remainder(samples[i].angle[c] - samples[i - 1].angle[c], 360.0), 2);
        noise[c] = std::sqrt(sum / 2 / std::max<double>(1, double(samples.size()) - 1));
        noise[c] = std::max(noise[c], 1e-9);
    }
    return noise;
}

}  // namespace

void Procedure::begin(const std::string& by, bool by_hand, Time now) {
    open(by, by_hand, now);
    ports_.keep(log_);
}

void Procedure::open(const std::string& by, bool by_hand, Time now) {
    Json script = std::move(script_);
    const Time attended = attended_;
    *this = Procedure(std::move(names_), stated_, std::move(ports_));
    script_ = std::move(script);
    attended_ = attended;
    by_ = by;
    by_hand_ = by_hand;
    now_ = now;
    note("begin", {{"by_hand", by_hand}});
    ask_yes("power", "Is the shaker's power stage off?", "the shaker's power stage is on",
            [this] { ask_degrees(); });
}

void Procedure::attend(const std::string& by, Time wall) {
    if (journal::same_person(by, by_)) attended_ = wall;
}

std::string Procedure::step_name() const {
    if (torquing_ || turning_) return "G";
    if (!gravity_.hypotheses.empty() && gravity_.verdict == Verdict::decided) return "F";
    if (extra_ > 0) return "E";
    if (at_ < plan_.size() && !careful_) return plan_[at_].slot >= 0 ? "C" : "D";
    return commanded_ || !small_.empty() ? "B" : "A";
}

void Procedure::note(const char* what, const Json& data) const {
    if (replaying_ || !ports_.note) return;
    const std::string step = step_name();
    const char* part = step == "F" ? "earth" : step == "G" ? "gyros" : "gimbals";
    ports_.note({part, step, by_, what, data});
}

void Procedure::tell(const std::string& line) {
    lines_.push_back(line);
    if (!replaying_) ports_.event(Severity::info, line);
}

void Procedure::ask(Question question, std::function<void(const std::string&)> then) {
    question_ = std::move(question);
    answered_ = std::move(then);
    doing_ = Doing::asking;
    note("question", {{"id", question_.id}, {"text", question_.text}});
    if (!left_.contains(question_.id)) return;
    const std::string value = left_[question_.id];
    left_.erase(question_.id);
    take_said(value);
}

void Procedure::ask_yes(const std::string& id, const std::string& text, const std::string& no,
                        Then then, const std::string& usual) {
    const auto yes_or_no = [](std::string& value) {
        if (value == "y") value = "yes";
        if (value == "n") value = "no";
        return value == "yes" || value == "no" ? "" : "yes or no";
    };
    ask({id, text, "yes or no", usual, yes_or_no},
        [this, no, then = std::move(then)](const std::string& value) {
            if (value == "yes") return then();
            conclude(Verdict::undecided, no);
            finding_.outcome = Finding::Outcome::unfinished;
        });
}

std::string Procedure::answer(const std::string& by, const std::string& id, std::string value) {
    if (doing_ != Doing::asking) return "nothing is asked";
    if (!journal::same_person(by, by_))
        return fmt::format("{} commissions it, and answers: found {}", by_, by);
    if (id != question_.id)
        return fmt::format("answer: found one to \"{}\", asked is \"{}\"", id, question_.id);
    if (value.empty()) value = question_.usual;
    const std::string given = value;
    if (const auto expected = question_.wrong ? question_.wrong(value) : std::string();
        !expected.empty())
        return fmt::format("found \"{}\", expected {}", given, expected);
    ports_.event(Severity::info, fmt::format("{} {}, says {}", question_.text, value, by));
    const bool permission = id == "power" || id == "go_on" || id.starts_with("permit.");
    note(permission ? "permission" : "answer", {{"id", id}, {"value", value}});
    take_answer(value);
    return {};
}

void Procedure::answer_by_script() {
    std::string value;
    if (!script_.is_object()) return;
    if (script_.contains(question_.id)) {
        Json& said = script_[question_.id];
        Json one = said;
        if (said.is_array() && !said.empty()) {
            one = said.front();
            if (said.size() > 1) said.erase(said.begin());
        }
        value = one.is_string() ? one.get<std::string>() : one.dump();
    } else if (question_.usual.empty()) {
        return;  // the tool says which one is missing
    }
    take_said(value);
}

/// What was said before it was asked.
void Procedure::take_said(const std::string& value) {
    tell("? " + question_.text);
    tell("> " + (value.empty() ? question_.usual : value));
    if (const auto why = answer(by_, question_.id, value); !why.empty())
        halt(question_.id + ": " + why, now_);
}

Vec3 Procedure::within_travel(Vec3 travel) const {
    for (std::size_t k = 0; k < 3; ++k)
        travel[k] = std::clamp(travel[k], limits_deg_[k][0], limits_deg_[k][1]);
    return travel;
}

/// Of a channel, in its unit. A ratio that was measured would be wrong by its noise at each turn's
/// end: 1e-4 of a turn are two arc minutes, as much as a torque turns in seconds. So it is that of
/// the unit, where it is one that is known.
double Procedure::whole_turn(std::size_t c) const {
    constexpr double kIsUnit = 0.02;  // they are 10 % apart at least
    const double ratio = std::abs(ratio_[c]);
    if (ratio == 0) return 360;
    for (const auto& unit : estimator::commissioning::angle_units())
        if (std::abs(ratio * unit.degrees - 1) < kIsUnit) return 360 / unit.degrees;
    return 360 * ratio;
}

Vec3 Procedure::unwrapped(const Vec3& angle, const Vec3& near) const {
    Vec3 out = angle;
    for (std::size_t c = 0; c < 3; ++c)
        out[c] = near[c] + std::remainder(angle[c] - near[c], whole_turn(c));
    return out;
}

void Procedure::move(const Vec3& travel, Then then) {
    asked_ = within_travel(travel);
    then_ = std::move(then);
    if (by_hand_) {
        std::string what;
        for (std::size_t k = 0; k < 3; ++k) {
            if (asked_[k] == travel_[k]) continue;
            what += fmt::format("{}{} to {:+.0f} deg", what.empty() ? "" : ", ", kLoudNames[k],
                                asked_[k]);
        }
        travel_ = asked_;
        const auto still = [this](const std::string&) {
            since_ = now_;
            doing_ = Doing::settling;
        };
        if (what.empty()) return still("");
        return ask(
            {"hand", "By hand, from the start, within 20 deg: " + what + "; hold still.", "done",
             "done", [](std::string& v) { return v == "done" ? "" : "done, or an empty answer"; }},
            still);
    }
    legs_.clear();
    if (released_ && !replaying_) travel_ = read_travel(travel_);
    Vec3 between = asked_;
    for (std::size_t k = 0; k < 3; ++k)
        if (std::abs(asked_[k] - travel_[k]) >= kOneWay_deg) between[k] = 0;
    if (between != asked_) legs_.push_back(between);
    legs_.push_back(asked_);
    next_leg();
}

void Procedure::next_leg() {
    const Vec3 to = legs_.front();
    before_ = ports_.sample();
    moving_slot_ = 3;
    int moved = 0;
    Vec3 command{};
    for (std::size_t k = 0; k < 3; ++k) {
        command[k] = command_0_[k] + to[k];
        if (to[k] == travel_[k]) continue;
        moving_slot_ = k;
        ++moved;
    }
    if (moved != 1) moving_slot_ = 3;
    since_ = now_;
    doing_ = Doing::moving;
    command_to(command);
}

void Procedure::command_to(const Vec3& command) {
    commanded_ = true;
    released_ = false;
    note("move", {{"command_deg", command}});
    if (!replaying_) (counting_ ? ports_.slew_counting : ports_.slew)(command, now_);
}

void Procedure::release() {
    released_ = true;
    if (!replaying_) ports_.release(now_);
}

void Procedure::average(double seconds, Then then) {
    wanted_s_ = seconds;
    seconds_.clear();
    then_ = std::move(then);
    since_ = now_;
    doing_ = Doing::averaging;
}

/// Why what is seen is not what was asked; empty: it may be.
std::string Procedure::contradiction(const Look& seen) const {
    double asked = 0;
    for (std::size_t k = 0; k < 3; ++k)
        asked = std::max(asked, std::abs(legs_.front()[k] - travel_[k]));
    const double most =
        (careful_ && asked <= 2 ? std::min(3 * asked, 5.0) : 3 * asked) + kRocks_deg;
    if (const double turned = turned_deg(seen.force, before_.force); turned > most)
        return fmt::format("gravity turned by {:.1f} deg, {:.2f} commanded", turned, asked);
    const Vec3 angle = unwrapped(seen.angle, before_.angle);
    for (std::size_t c = 0; c < 3; ++c) {
        const double change = std::abs(angle[c] - before_.angle[c]);
        if (!holds_ && change > kHolds_deg + 20 * noise_[c])
            return fmt::format("{} moved by {:.2f} when commanded where it is", names_.angle[c],
                               change);
        const bool own = moving_slot_ < 3 && channel_of_[moving_slot_] == c;
        if (ratio_[c] != 0 && change > std::abs(ratio_[c]) * (3 * asked + 0.5) + 10 * noise_[c])
            return fmt::format("{} moved by {:.4g}, {:.4g} expected", names_.angle[c], change,
                               std::abs(ratio_[c]) * asked);
        if (careful_ && moving_slot_ < 3 && channel_of_[moving_slot_] < 3 && !own &&
            change > 10 * noise_[c] + 1e-12)
            return fmt::format("{} moves with the {} gimbal", names_.angle[c],
                               kLoudNames[moving_slot_]);
    }
    return {};
}

void Procedure::watch_move(Time now) {
    const Look seen = ports_.sample();
    if (!seen.good || now - seen.to > kStale) return stop("a channel is silent or not good", now);
    if (const auto wrong = contradiction(seen); !wrong.empty())
        return conclude(
            Verdict::undecided,
            fmt::format("stopped: {}: look at the rig, then by hand (--by-hand)", wrong),
            keys_of_moving());
    switch (ports_.gimbal()) {
        case drivers::GimbalState::in_position:
            return arrive(now);
        case drivers::GimbalState::timed_out:
            return conclude(
                Verdict::undecided,
                fmt::format(
                    "the command of the {} is not obeyed: not in position within its time{}",
                    moving_slot_ < 3 ? std::string(kLoudNames[moving_slot_]) + " gimbal"
                                     : std::string("gimbals"),
                    stopped_short().empty() ? "" : "; " + stopped_short()),
                keys_of_moving());
        case drivers::GimbalState::no_status:
            return stop("no gimbal status", now);
        default:
            return;
    }
}

/// Why a gimbal that says it is in position is not; empty: it is, or nobody knows yet.
std::string Procedure::stopped_short() const {
    const Vec3 asked = legs_.front(), read = read_travel(asked);
    for (std::size_t k = 0; k < 3; ++k) {
        if (channel_of_[k] == 3 || ratio_[channel_of_[k]] == 0) continue;
        if (std::abs(read[k] - asked[k]) <= kHolds_deg + kSlewShare * std::abs(asked[k])) continue;
        return fmt::format(
            "the {} gimbal stands at a travel of {:+.1f} deg, {:+.1f} commanded: a "
            "soft stop?",
            kLoudNames[k], read[k], asked[k]);
    }
    return {};
}

/// What is in position short of where it was sent has a stop there, and is sent no further.
void Procedure::keep_within(const std::string& why) {
    const Vec3 asked = legs_.front();
    travel_ = read_travel(asked);
    for (std::size_t k = 0; k < 3; ++k) {
        auto& [least, most] = limits_deg_[k];
        if (asked[k] > 0 && travel_[k] < asked[k] - kHolds_deg) most = std::max(travel_[k], 0.0);
        if (asked[k] < 0 && travel_[k] > asked[k] + kHolds_deg) least = std::min(travel_[k], 0.0);
    }
    met_a_stop_ = true;
    for (Vec3& leg : legs_) leg = within_travel(leg);
    tell("   " + why);
    note("reading", {{"soft_stop", why}, {"travel_deg", limits_deg_}});
    keep({{"short", travel_}, {"limits", limits_deg_}});
}

void Procedure::arrive(Time now) {
    travel_ = legs_.front();
    if (const auto why = stopped_short(); !why.empty()) keep_within(why);
    legs_.erase(legs_.begin());
    if (!legs_.empty()) return next_leg();
    since_ = now;
    doing_ = Doing::settling;
}

void Procedure::take_second(Time now) {
    const Look second = ports_.second();
    const bool fresh = seconds_.empty() || second.from > seconds_.back().from;
    if (second.good && second.from >= since_ && fresh) {
        seconds_.push_back(second);
        if (seconds_.size() > 1) {
            Look& last = seconds_.back();
            last.angle = unwrapped(last.angle, seconds_.front().angle);
        }
    }
    if (static_cast<double>(seconds_.size()) + 1e-9 < wanted_s_) {
        if (now - since_ > drivers::from_seconds(wanted_s_) + kStill)
            conclude(Verdict::refused,
                     "the platform does not stand still, or force or angles are not good");
        return;
    }
    mean_ = seconds_.front();
    for (std::size_t i = 0; i < 3; ++i) {
        mean_.angle[i] = mean_.force[i] = 0;
        for (const Look& one : seconds_) {
            mean_.angle[i] += one.angle[i] / static_cast<double>(seconds_.size());
            mean_.force[i] += one.force[i] / static_cast<double>(seconds_.size());
        }
    }
    if (noise_ == Vec3{}) noise_ = noise_of(samples_);
    note("reading", {{"angle", mean_.angle}, {"force_g", mean_.force}, {"seconds", wanted_s_}});
    keep_mean();
    auto then = std::move(then_);
    then();
}

Vec3 Procedure::read_travel(const Vec3& near) const {
    const Look seen = ports_.sample();
    const Vec3 angle = unwrapped(seen.angle, start_);
    Vec3 travel = near;
    for (std::size_t k = 0; seen.good && k < 3; ++k) {
        const std::size_t c = channel_of_[k];
        if (c == 3 || ratio_[c] == 0) continue;
        // Of the whole turns between the nearest to where it came from.
        travel[k] = near[k] + std::remainder((angle[c] - start_[c]) / ratio_[c] - near[k], 360.0);
    }
    return travel;
}

/// What "stop" is on this rig. Where a command's effect is not known yet nothing can be held by it.
void Procedure::stand() {
    if (by_hand_ || !commanded_) return;
    if (torquing_) {
        if (!replaying_) static_cast<void>(ports_.torque({}));
        // Held, a platform turns no further whatever its torquers do.
        if (hold_ && released_ && ports_.sample().good) {
            travel_ = read_travel(travel_);
            return command_to({command_0_[0] + travel_[0], command_0_[1] + travel_[1],
                               command_0_[2] + travel_[2]});
        }
    }
    if (doing_ != Doing::moving) {
        if (!hold_ && !released_) release();
        return;
    }
    bool known = hold_ && holds_ && ports_.sample().good;
    for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t c = channel_of_[k];
        if (legs_.front()[k] != travel_[k]) known = known && c < 3 && ratio_[c] != 0;
    }
    if (!known) return release();
    const Vec3 read = read_travel(travel_);
    Vec3 command{};
    for (std::size_t k = 0; k < 3; ++k) {
        if (legs_.front()[k] != travel_[k]) travel_[k] = read[k];
        command[k] = command_0_[k] + travel_[k];
    }
    command_to(command);
}

void Procedure::stop(const std::string& why, Time now) {
    now_ = now;
    if (!active() || doing_ == Doing::asking) return;
    const bool drifted = doing_ == Doing::averaging && released_;
    stand();
    interrupted_ = Interrupted{doing_, std::move(then_), drifted, unkept_, torque_};
    torque_ = {};
    tell("stopped: " + why);
    ask_yes("go_on", "Stopped: " + why + ". Go on?", "stopped: " + why,
            [this] { go_on_after_stop(); });
}

void Procedure::go_on_after_stop() {
    Interrupted was = std::move(*interrupted_);
    interrupted_.reset();
    if (was.doing != Doing::averaging) return move(asked_, std::move(was.then));
    auto measure = [this, wanted = wanted_s_, unkept = was.unkept, then = std::move(was.then)] {
        unkept_ = unkept;
        average(wanted, then);
    };
    if (by_hand_ || (!released_ && !was.drifted)) return measure();
    if (!was.drifted) return move(asked_, std::move(measure));
    move(asked_, [this, again = was.torque, measure = std::move(measure)] {
        release();
        if (torquing_) torque(again);
        unkept_ = true;  // it is, once already
        average(kLetGo_s, measure);
    });
}

void Procedure::halt(const std::string& why, Time now) {
    now_ = now;
    if (!active()) return;
    conclude(Verdict::undecided, why);
    finding_.outcome = Finding::Outcome::unfinished;
}

/// Of a command, and the channel that follows it.
std::vector<std::string> Procedure::keys_of_moving() const {
    std::vector<std::string> keys{"gimbal.message"};
    if (moving_slot_ < 3 && channel_of_[moving_slot_] < 3)
        keys.push_back(key_of(channel_of_[moving_slot_]));
    return keys;
}

void Procedure::conclude(Verdict verdict, const std::string& why,
                         std::vector<std::string> suspects) {
    stand();
    torquing_ = turning_ = counting_ = false;
    doing_ = Doing::nothing;
    question_ = {};
    interrupted_.reset();
    finding_.outcome = verdict == Verdict::decided   ? Finding::Outcome::decided
                       : verdict == Verdict::refused ? Finding::Outcome::refused
                                                     : Finding::Outcome::undecided;
    finding_.why = why;
    finding_.suspects = std::move(suspects);
    note("verdict",
         {{"outcome", name_of(finding_.outcome)}, {"why", why}, {"suspects", finding_.suspects}});
    if (!why.empty()) tell(why);
}

Time Procedure::step(Time now, Time wall) {
    now_ = now;
    if (!active()) return drivers::kNever;
    if (doing_ == Doing::asking && wall - attended_ <= kAbsent) answer_by_script();
    if (doing_ != Doing::asking && !by_hand_ && wall - attended_ > kAbsent)
        stop(fmt::format("nobody has been at the tool for {:.0f} s", to_seconds(kAbsent)), now);
    if (doing_ == Doing::moving) watch_move(now);
    watch_torque(now);
    if (doing_ == Doing::settling && now - since_ >= drivers::from_seconds(careful_ ? 1.5 : 3)) {
        auto then = std::move(then_);
        then();
    }
    if (doing_ == Doing::averaging) {
        if (const Look sample = ports_.sample();
            slot_ == 0 && careful_ && sample.good &&
            (samples_.empty() || sample.to > samples_.back().to))
            samples_.push_back(sample);
        take_second(now);
    }
    return now + kPoll;
}

std::string Procedure::progress() const {
    const std::string what = doing_ == Doing::asking ? "asked: " + question_.text
                             : lines_.empty()        ? "first look"
                                                     : lines_.back();
    return fmt::format("{}, step {}, {} positions, {} free drifts; {}", by_, step_name(),
                       stops_.size(), drifts_.size(), what);
}

Json Procedure::state(std::size_t after) const {
    Json question;
    if (doing_ == Doing::asking)
        question = {{"id", question_.id},
                    {"text", question_.text},
                    {"expected", question_.expected},
                    {"usual", question_.usual}};
    Json lines = Json::array();
    for (std::size_t i = after; i < lines_.size(); ++i) lines.push_back(lines_[i]);
    return {{"active", active()},
            {"by", by_},
            {"moving", doing_ == Doing::moving || doing_ == Doing::settling},
            {"question", question},
            {"lines", lines},
            {"next", lines_.size()},
            {"result", by_.empty() || active() ? Json() : to_json(finding_)}};
}

}  // namespace vibrig::commission
