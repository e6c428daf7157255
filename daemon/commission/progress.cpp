// What survives the daemon: answers and means in their order. A procedure that is given them again
// does what it did, without moving, and stands where the other one ended.
#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <utility>

#include "daemon/commission/procedure.hpp"
#include "daemon/commission/progress.hpp"
#include "proto/durable_file.hpp"
#include "proto/person_name.hpp"

namespace vibrig::commission {

using drivers::Time;

namespace {

constexpr double kSameForce_g = 5e-3, kSameAngle_deg = 0.05;
constexpr double kAgain_s = 3;

bool of_this_daemon_alone(const std::string& id) { return id == "go_on" || id == "permit.resume"; }

constexpr double kGood_h = 24;

/// Whose members are what write() makes of them; a replay finds out about the log's entries.
bool as_written(const Json& all) {
    return all.is_object() && all.contains("log") && all["log"].is_array() &&
           all.contains("version") && all["version"] == 1 && all.contains("by") &&
           all["by"].is_string() && all.contains("by_hand") && all["by_hand"].is_boolean() &&
           all.contains("utc_ns") && all["utc_ns"].is_number_integer();
}

}  // namespace

Progress::Progress(const std::string& folder, Json rig)
    : path_((std::filesystem::path(folder) / "progress.json").string()), rig_(std::move(rig)) {}

void Progress::write(const std::string& by, bool by_hand, const Json& log,
                     std::int64_t utc_ns) const {
    const Json all{{"version", 1},     {"by", by},    {"by_hand", by_hand},
                   {"utc_ns", utc_ns}, {"rig", rig_}, {"log", log}};
    std::error_code error;  // whatever it is, the file then says it
    std::filesystem::create_directories(std::filesystem::path(path_).parent_path(), error);
    proto::write_durably(path_, all.dump() + "\n", 0640);
}

void Progress::write_found(const std::string& toml) const {
    proto::write_durably((std::filesystem::path(path_).parent_path() / "found.toml").string(), toml,
                         0644);
}

void Progress::remove() const {
    std::error_code error;
    std::filesystem::remove(path_, error);
}

Kept Progress::read(const std::string& by, bool by_hand, std::int64_t utc_ns) const {
    Kept kept;
    std::ifstream file(path_);
    const Json all = file ? Json::parse(file, nullptr, false) : Json();
    if (!file) {
        kept.why_not = path_ + ": nothing is kept";
    } else if (!as_written(all)) {
        kept.why_not = path_ + ": not what vibrigd wrote";
    } else if (const double hours =
                   1e-9 * double(utc_ns - all["utc_ns"].get<std::int64_t>()) / 3600;
               hours < 0 || hours > kGood_h) {
        kept.why_not = fmt::format("{}: {:.0f} h old, {:.0f} at most", path_, hours, kGood_h);
    } else if (all.value("rig", Json()) != rig_) {
        kept.why_not = path_ + ": of another can, DBC or gimbal.message";
    } else if (!proto::same_person(all["by"].get<std::string>(), by)) {
        kept.why_not = fmt::format("{}: begun by {}", path_, all["by"].get<std::string>());
    } else if (all["by_hand"] != by_hand) {
        kept.why_not = path_ + (by_hand ? ": moved by command" : ": moved by hand");
    } else {
        kept.log = all["log"];
    }
    return kept;
}

void Procedure::keep(Json entry) {
    log_.push_back(std::move(entry));
    if (!replaying_) keeper_->keep(log_);
}

void Procedure::take_answer(const std::string& value) {
    const std::string id = std::exchange(question_, {}).id;
    if (!of_this_daemon_alone(id)) keep({{"id", id}, {"value", value}});
    auto then = std::move(answered_);
    doing_ = Doing::averaging;  // whatever comes next says what it does
    then(value);
}

void Procedure::keep_mean() {
    if (std::exchange(unkept_, false)) return;
    if (commanded_ && !released_) held_ = {travel_, mean_};
    Json entry{{"from", mean_.from},
               {"to", mean_.to},
               {"angle", mean_.angle},
               {"force", mean_.force},
               {"noise", noise_}};
    for (const Look& one : seconds_)  // a drift is more than its mean
        if (released_ || by_hand_) entry["seconds"].push_back(Json{one.from, one.angle});
    if (counting_ && !replaying_) counted_deg_ = rig_->counted();
    if (counting_) entry["counted_deg"] = counted_deg_;
    keep(std::move(entry));
}

void Procedure::begin_again(const std::string& by, bool by_hand, const Kept& kept, Time now) {
    open(by, by_hand, now);
    again_ = kept.again;
    std::string why_not = kept.why_not;
    try {
        if (why_not.empty()) replay(kept.log);
        if (why_not.empty() && active() && careful_) why_not = "its gimbals were not known yet";
        // What the gyros had counted of this turn is gone.
        if (why_not.empty() && active() && counting_) next_turn();
    } catch (const Json::exception& wrong) {
        why_not = wrong.what();
    }
    replaying_ = false;
    if (why_not.empty()) {
        if (active()) permit_again();
        return;
    }
    begin(by, by_hand, now);
    tell(why_not + ": it begins anew");
}

void Procedure::replay(const Json& log) {
    replaying_ = true;
    for (std::size_t at = 0; active();) {
        if (moves()) {
            travel_ = asked_;
            for (; at < log.size() && log.at(at).contains("short"); ++at) replay_stop(log.at(at));
            legs_.clear();
            doing_ = Doing::averaging;
            auto then = std::move(then_);
            then();
            continue;
        }
        if (at == log.size()) return;
        const Json& entry = log.at(at);
        if (doing_ == Doing::averaging) {
            if (!replay_mean(entry)) return leave_answers(log, at);
            ++at;
            continue;
        }
        const std::string id = entry.value("id", "");
        // Asked again when all was measured: what was seen stands before what was said.
        if (question_.id == "latitude" && id != "latitude" && again_.empty()) {
            ask_sense_again();
            continue;
        }
        std::string value = entry.value("value", "");
        const bool fits =
            id == question_.id && (!question_.wrong || question_.wrong(value).empty());
        if (!fits || question_.id == again_) return leave_answers(log, at);
        ++at;
        take_answer(value);
    }
}

/// It stood short of where it was sent, and is sent no further.
void Procedure::replay_stop(const Json& entry) {
    met_a_stop_ = true;
    travel_ = entry.at("short").get<Vec3>();
    limits_deg_ = entry.at("limits").get<decltype(limits_deg_)>();
    keep(entry);
}

bool Procedure::replay_mean(const Json& entry) {
    if (!entry.contains("angle")) return false;
    mean_ = {entry.at("from").get<Time>(), entry.at("to").get<Time>(),
             entry.at("angle").get<Vec3>(), entry.at("force").get<Vec3>(), true};
    noise_ = entry.at("noise").get<Vec3>();
    if (counting_) counted_deg_ = entry.at("counted_deg").get<Vec3>();
    seconds_.clear();
    for (const Json& one : entry.value("seconds", Json::array())) {
        Look look;
        look.from = one.at(0).get<Time>();
        look.angle = one.at(1).get<Vec3>();
        seconds_.push_back(look);
    }
    keep_mean();
    auto then = std::move(then_);
    then();
    return true;
}

/// What was said behind the question that is asked again stands.
void Procedure::leave_answers(const Json& log, std::size_t from) {
    for (; from < log.size(); ++from)
        if (const std::string id = log.at(from).value("id", "");
            !id.empty() && id != again_ && id != "permit.torque" &&
            id != "permit.turns")  // what moves it is asked anew
            left_[id] = log.at(from).at("value");
}

void Procedure::permit_again() {
    const std::string done = fmt::format("Going on after {} positions and {} free drifts.",
                                         stops_.size(), drifts_.size());
    tell(done);
    if (by_hand_ && doing_ == Doing::asking) return;  // nothing is commanded
    if (doing_ == Doing::asking) waiting_ = Waiting{std::move(question_), std::move(answered_)};
    interrupted_ = Interrupted{doing_, std::move(then_), doing_ == Doing::averaging && released_,
                               unkept_, std::exchange(torque_, Vec3{})};
    if (by_hand_)
        return ask_yes("permit.resume", "Is the platform as it was left?",
                       "the platform is not as it was left", [this] { go_on_after_stop(); });
    ask_yes("permit.resume",
            "I will go back to the last position that was measured, and measure it again. May I?",
            "nothing may be commanded: by hand (--by-hand)", [this] { measure_again(); });
}

void Procedure::measure_again() {
    const Vec3 to = asked_;
    released_ = true;  // nobody knows where it stands
    auto go_on = [this, to, was = std::move(*interrupted_), wanted = wanted_s_]() mutable {
        if (const auto moved = moved_since(); !moved.empty()) {
            const auto by = by_;
            begin(by, by_hand_, now_);
            return tell(moved + ": it begins anew");
        }
        if (waiting_)
            return move(to, [this] {
                auto waiting = *std::exchange(waiting_, std::nullopt);
                ask(std::move(waiting.question), std::move(waiting.answered));
            });
        asked_ = to;
        wanted_s_ = wanted;
        released_ = true;  // it goes there first
        interrupted_ = std::move(was);
        go_on_after_stop();
    };
    interrupted_.reset();
    move(held_.travel, [this, go_on]() mutable {
        unkept_ = true;
        average(kAgain_s, go_on);
    });
}

/// Why the position that was measured is another one now; empty: it is the same.
std::string Procedure::moved_since() const {
    double force = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        force = std::hypot(force, mean_.force[i] - held_.mean.force[i]);
        const double off = std::remainder(mean_.angle[i] - held_.mean.angle[i], whole_turn(i)) /
                           std::abs(ratio_[i]);
        if (std::abs(off) > kSameAngle_deg)
            return fmt::format("{} is {:.3f} deg off the position that was measured",
                               names_.angle[i], off);
    }
    if (force <= kSameForce_g) return {};
    return fmt::format("the force is {:.1f} mg off the one measured in this position", 1e3 * force);
}

}  // namespace vibrig::commission
