// How a procedure goes on: questions and answers, stopping and going on, its end, and what it
// shows.
#include "daemon/commission/procedure.hpp"
#include "proto/person_name.hpp"

#include <spdlog/fmt/fmt.h>

#include <utility>

namespace vibrig::commission {

using drivers::Time;
using drivers::to_seconds;

namespace {

constexpr Time kPoll = 50 * drivers::kMillisecond;

}  // namespace

void Procedure::begin(const std::string& by, bool by_hand, Time now) {
    open(by, by_hand, now);
    keeper_->keep(log_);
}

void Procedure::open(const std::string& by, bool by_hand, Time now) {
    Json script = std::move(script_);
    const Time attended = attended_;
    *this = Procedure(std::move(names_), stated_, *rig_, *keeper_);
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
    if (proto::same_person(by, by_)) attended_ = wall;
}

std::string Procedure::step_name() const {
    if (torquing_ || turning_) return "G";
    if (!gravity_.hypotheses.empty() && gravity_.verdict == Verdict::decided) return "F";
    if (extra_ > 0) return "E";
    if (at_ < plan_.size() && !careful_) return plan_[at_].slot >= 0 ? "C" : "D";
    return commanded_ || !small_.empty() ? "B" : "A";
}

void Procedure::note(const char* what, const Json& data) const {
    if (replaying_) return;
    const std::string step = step_name();
    const char* part = step == "F" ? "earth" : step == "G" ? "gyros" : "gimbals";
    keeper_->note({part, step, by_, what, data});
}

void Procedure::tell(const std::string& line) {
    lines_.push_back(line);
    if (!replaying_) keeper_->event(line);
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

std::string yes_or_no(std::string& answer) {
    if (answer == "y") answer = "yes";
    if (answer == "n") answer = "no";
    return answer == "yes" || answer == "no" ? "" : "yes or no";
}

std::string done_alone(std::string& answer) {
    return answer == "done" ? "" : "done, or an empty answer";
}

void Procedure::ask_yes(const std::string& id, const std::string& text, const std::string& no,
                        Then then, const std::string& usual) {
    ask({id, text, "yes or no", usual, yes_or_no},
        [this, no, then = std::move(then)](const std::string& value) {
            if (value == "yes") return then();
            conclude(Verdict::undecided, no);
            finding_.outcome = Finding::Outcome::unfinished;
        });
}

std::string Procedure::answer(const std::string& by, const std::string& id, std::string value) {
    if (doing_ != Doing::asking) return "nothing is asked";
    if (!proto::same_person(by, by_))
        return fmt::format("{} commissions it, and answers: found {}", by_, by);
    if (id != question_.id)
        return fmt::format("answer: found one to \"{}\", asked is \"{}\"", id, question_.id);
    if (value.empty()) value = question_.usual;
    const std::string given = value;
    if (const auto expected = question_.wrong ? question_.wrong(value) : std::string();
        !expected.empty())
        return fmt::format("found \"{}\", expected {}", given, expected);
    keeper_->event(fmt::format("{} {}, says {}", question_.text, value, by));
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

/// What "stop" is on this rig. Where a command's effect is not known yet nothing can be held by it.
void Procedure::stand() {
    if (by_hand_ || !commanded_) return;
    if (torquing_) {
        if (!replaying_) rig_->torque({});
        // Held, a platform turns no further whatever its torquers do.
        if (hold_ && released_ && rig_->sample().good) {
            travel_ = read_travel(travel_);
            return command_to({command_0_[0] + travel_[0], command_0_[1] + travel_[1],
                               command_0_[2] + travel_[2]});
        }
    }
    if (doing_ != Doing::moving) {
        if (!hold_ && !released_) release();
        return;
    }
    bool known = hold_ && holds_ && rig_->sample().good;
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
        if (const Look sample = rig_->sample();
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
    if (const Question* asked = asks())
        question = {{"id", asked->id},
                    {"text", asked->text},
                    {"expected", asked->expected},
                    {"usual", asked->usual}};
    Json lines = Json::array();
    for (std::size_t i = after; i < lines_.size(); ++i) lines.push_back(lines_[i]);
    return {{"active", active()},
            {"by", by_},
            {"moving", moves()},
            {"question", question},
            {"lines", lines},
            {"next", lines_.size()},
            {"result", by_.empty() || active() ? Json() : to_json(finding_)}};
}

}  // namespace vibrig::commission
