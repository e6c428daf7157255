// Commissioning at the local socket: a person's permissions and answers go to the procedure.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "daemon/app/control_loop.hpp"
#include "daemon/commission/acceptance.hpp"
#include "daemon/commission/bus_bits.hpp"
#include "daemon/commission/procedure.hpp"
#include "daemon/commission/progress.hpp"
#include "estimator/filter/angles.hpp"

namespace vibrig {

using commission::Json;
using commission::Part;
using drivers::Time;

namespace {

constexpr int kFineBits = 12;
constexpr const char* kNoScript = "answers: persons answer on a real rig";
using estimator::kDegPerRad;

commission::Vec3 in_degrees(const std::array<double, 3>& rad) {
    return {rad[0] * kDegPerRad, rad[1] * kDegPerRad, rad[2] * kDegPerRad};
}

/// A wire leaves this machine, whatever the configuration says of its rig: gimbals may be at its
/// end.
bool real_wire(const drivers::CanPortSettings& can) {
    std::error_code error;
    return can.kind == drivers::CanPortSettings::Kind::socketcan &&
           !std::filesystem::exists("/sys/devices/virtual/net/" + can.interface, error);
}

/// Signals as the configuration has them.
commission::Names names_of(const configuration::Loaded& loaded, const proto::Dbc& dbc) {
    commission::Names names;
    for (const auto& value : loaded.effective) {
        constexpr std::array<const char*, 6> kKeys{"can.signals.outer",   "can.signals.inner",
                                                   "can.signals.azimuth", "can.signals.accel_x",
                                                   "can.signals.accel_y", "can.signals.accel_z"};
        const auto* const at = std::ranges::find(kKeys, value.key);
        if (at == kKeys.end()) continue;
        const auto index = static_cast<std::size_t>(at - kKeys.begin());
        const Json text = Json::parse(value.value, nullptr, false);
        (index < 3 ? names.angle[index] : names.force[index - 3]) =
            text.is_string() ? text.get<std::string>() : value.value;
    }
    for (const auto* const all : {&names.angle, &names.force})
        for (const auto& name : *all)
            if (const int bits = commission::length_of(dbc, name); bits > 0 && bits < kFineBits)
                names.coarse.push_back(fmt::format("{} has {} bits", name, bits));
    for (const auto& value : loaded.effective) {
        if (value.key == "can.dbc") names.dbc = value.value;
        if (value.key == "can.sample_rate_hz") names.sample_rate = value.value;
    }
    names.command = loaded.configuration.gimbal.message;
    names.torque = loaded.configuration.campaign.level.torquer.message;
    return names;
}

}  // namespace

/// The rig, as the procedure may have it.
commission::Ports ControlLoop::procedure_ports() {
    commission::Ports ports;
    ports.sample = [this] {
        const auto sample = acquisition_.view().sample;
        return commission::Look{sample.time, sample.time, in_degrees(sample.angle), sample.force,
                                sample.angles_good() && sample.force_good()};
    };
    ports.second = [this] {
        const auto second = interlock_.second();
        return commission::Look{second.from, second.to, in_degrees(second.angle), second.force,
                                second.good};
    };
    const auto slew = [this](const commission::Vec3& deg, Time now, bool counting) {
        // Where it stands and where it stops it is to stay, not to go by the middle of its travel.
        const auto sample = acquisition_.view().sample;
        if (sample.angles_good()) gimbal_.stands_at(in_degrees(sample.angle));
        gimbal_.slew_to(deg, now, counting);
    };
    ports.slew = [slew](const commission::Vec3& deg, Time now) { slew(deg, now, false); };
    ports.release = [this](Time now) { gimbal_.release(now); };
    ports.gimbal = [this] { return gimbal_.state(); };
    if (parts_.torquer)
        ports.torque = [this](const commission::Vec3& deg_per_h) {
            // As the commands are sent: the sign of the rate over them is what is looked for.
            commission::Vec3 rate{};
            for (std::size_t i = 0; i < 3; ++i)
                rate[i] = configuration_.campaign.level.torquer.sign[i] * deg_per_h[i];
            return parts_.torquer->command(rate);
        };
    ports.event = [this](Severity severity, const std::string& text) {
        log(severity, "commissioning", text);
    };
    ports.keep = [this](const Json& log) {
        try {
            progress().write(procedure_->by(), procedure_->by_hand(), log, utc_now());
        } catch (const std::exception& error) {
            this->log(Severity::warning, "commissioning",
                      std::string("what is done is not kept: ") + error.what());
        }
    };
    ports.rate = [this] {
        const auto hz = acquisition_.view().rate.hz();
        return commission::SampleRate{
            hz, 1 / drivers::to_seconds(configuration_.assembler.sample_period),
            parts_.fitness.rate_misfit()};
    };
    if (configuration_.campaign.zeroing) {  // whose input they are
        ports.slew_counting = [slew](const commission::Vec3& deg, Time now) {
            slew(deg, now, true);
        };
        ports.count = [this] {
            counted_rad_ = {};
            parts_.stage_feed.order(rt::StageFeed::Mode::increments);
        };
        ports.counted_deg = [this] {
            take_increments();
            parts_.stage_feed.order(rt::StageFeed::Mode::off);
            return in_degrees(counted_rad_);
        };
    }
    ports.note = [this](const commission::Note& note) {
        keep_commissioned({note.part, note.step, note.by, {}, note.what, note.data.dump()});
    };
    return ports;
}

std::unique_ptr<commission::Procedure> ControlLoop::make_procedure() {
    return std::make_unique<commission::Procedure>(
        names_of(loaded_, parts_.dbc),
        commission::Stated{
            configuration_.estimator.latitude_deg, configuration_.commission.linear_sigma,
            configuration_.simulated() && !real_wire(configuration_.can),
            parts_.torquer ? std::min(parts_.torquer->limit(),
                                      configuration_.campaign.level.torquer_limit_deg_h)
                           : 0},
        procedure_ports());
}

/// `by` as the audit has it: the name, and who the socket says it was.
void ControlLoop::keep_commissioned(journal::Commissioned row) {
    if (!journal_) return;
    const std::string name = commission::name_of_person(row.by);
    if (name.size() + 3 <= row.by.size())
        row.identity = row.by.substr(name.size() + 2, row.by.size() - name.size() - 3);
    row.by = name;
    row.utc_ns = utc_now();
    journal_->commissioned(row);
}

/// What was found stands on disk, whoever reads it.
void ControlLoop::end_procedure(Time now) {
    campaign_.end_commissioning(now);
    const auto& finding = procedure_->finding();
    if (finding.outcome != commission::Finding::Outcome::decided) return;
    try {
        progress().write_found(commission::to_toml(finding, configuration_.simulated()));
    } catch (const std::exception& error) {
        log(Severity::warning, "commissioning",
            std::string("what was found is not kept: ") + error.what());
    }
}

commission::Progress ControlLoop::progress() const {
    return {configuration_.commission.folder, Json(book_.keys(Part::bus))};
}

/// What the gyros count while the procedure has them counted.
void ControlLoop::take_increments() {
    rt::Motion motion;
    while (parts_.stage_feed.pop(motion))
        for (std::size_t i = 0; motion.increment && i < 3; ++i) counted_rad_[i] += motion.turn[i];
}

Time ControlLoop::step_commissioning(Time now) {
    if (!procedure_ || !procedure_->active()) return drivers::kNever;
    if (!campaign_.commissioning()) {
        StatusData status;
        campaign_.fill(status, now);
        procedure_->halt(status.reason, now);
        return drivers::kNever;
    }
    if (configuration_.campaign.zeroing) take_increments();
    const Time next = procedure_->step(now, rt::wall_clock());
    if (!procedure_->active()) end_procedure(now);
    return next;
}

void ControlLoop::commission(WaitingCommand waiting, Time now) {
    const CommandRequest& request = waiting.request;
    const Json what = Json::parse(request.argument, nullptr, false);
    if (!what.is_object() || !what.contains("do") || !what["do"].is_string())
        return answer(waiting, {false, "commission: found no JSON object with \"do\""});
    if (what["do"] == "attend") {
        if (attendance_ && journal::same_person(request.by, attendance_->by))
            attendance_->wall = rt::wall_clock();
        return waiting.reply.set_value({true, "there"});
    }
    if (what["do"] != "read") return answer(waiting, do_commission(request, what, now));
    // Several times a second: no row of the audit.
    if (procedure_) procedure_->attend(request.by, rt::wall_clock());
    const auto after = what.contains("after") && what["after"].is_number_unsigned()
                           ? what["after"].get<std::size_t>()
                           : 0;
    Json record = book_.status(utc_now());
    record["buttons_left"] = campaign_.proof().buttons_left();
    record["ran_at_zero"] = campaign_.proof().ran_at_zero();
    record["unproven_bits"] = what.contains("bits")
                                  ? Json(commission::unproven_bits(loaded_, parts_.dbc))
                                  : Json::array();
    record["lacking"] = Json::object();
    if (what.contains("shaker"))  // why parts are not given: no business of a poll
        for (const auto& [part, why] : shaker_parts({}).lacking)
            record["lacking"][name_of(part)] = why;
    const Json reply{{"record", record},
                     {"simulated", configuration_.simulated()},
                     {"configuration", loaded_.path},
                     {"progress", procedure_ && procedure_->active() ? procedure_->progress() : ""},
                     {"procedure", procedure_ ? procedure_->state(after) : Json()}};
    waiting.reply.set_value({true, reply.dump(-1, ' ', false, Json::error_handler_t::replace)});
}

CommandReply ControlLoop::do_commission(const CommandRequest& request, const Json& what, Time now) {
    const auto text = [&what](const char* key) {
        return what.contains(key) && what[key].is_string() ? what[key].get<std::string>()
                                                           : std::string();
    };
    const std::string word = text("do");
    const bool active = procedure_ && procedure_->active();
    if (word == "accept" || word == "state") return enter_in_record(request, what, now);
    if (word == "sign") return sign_record(request, what);
    if (word == "begin") {
        if (active) return {false, "the rig is being commissioned by " + procedure_->by()};
        return begin_commissioning(request, what, now);
    }
    if (word != "answer" && word != "answers" && word != "stop" && word != "end")
        return {
            false,
            "commission: do: found \"" + word +
                "\", expected begin, read, attend, answer, answers, stop, end, accept, state or "
                "sign"};
    if (!active) return {false, "the rig is not being commissioned"};
    procedure_->attend(request.by, rt::wall_clock());
    if (word == "answer") {
        const auto why = procedure_->answer(request.by, text("id"), text("value"));
        if (!procedure_->active()) end_procedure(now);
        return {why.empty(), why.empty() ? "answered" : why};
    }
    if (word == "answers") {
        if (!configuration_.simulated()) return {false, kNoScript};
        procedure_->answer_all(what.value("answers", Json::object()));
        return {true, "answered as they are asked"};
    }
    if (word == "stop") {
        procedure_->stop("by " + commission::name_of_person(request.by), now);
    } else {
        procedure_->halt("ended by " + commission::name_of_person(request.by), now);
        campaign_.end_commissioning(now);
    }
    return {true, word == "stop" ? "stopped" : "ended"};
}

CommandReply ControlLoop::begin_commissioning(const CommandRequest& request, const Json& what,
                                              Time now) {
    if (auto why = outside_.refuses(request); !why.empty()) return {false, why};
    const auto flag = [&what](const char* key) { return what.contains(key) && what[key] == true; };
    const bool by_hand = flag("by_hand");
    commission::Kept kept;
    if (flag("resume")) kept = progress().read(request.by, by_hand, utc_now());
    if (what.contains("ask") && what["ask"].is_string()) kept.again = what["ask"];
    if (!kept.again.empty() && !kept.why_not.empty())
        return {false, kept.why_not + ": there is nothing to ask again"};
    if (what.contains("answers") && !configuration_.simulated()) return {false, kNoScript};
    if (auto why = campaign_.begin_commissioning(request.by, now); !why.empty()) {
        // Samples at another rate than the configured one never show rest.
        const auto off = acquisition_.view().rate.hz() > 0 ? parts_.fitness.rate_misfit() : "";
        return {false, off.empty() ? why : off};
    }
    procedure_ = make_procedure();
    if (what.contains("answers")) procedure_->answer_all(what["answers"]);
    procedure_->attend(request.by, rt::wall_clock());
    if (flag("resume"))
        procedure_->begin_again(request.by, by_hand, kept, now);
    else
        procedure_->begin(request.by, by_hand, now);
    if (!procedure_->active()) end_procedure(now);
    log(Severity::info, "commissioning",
        fmt::format("{} by {}", flag("resume") ? "taken up" : "begun", request.by));
    return {true, "begun"};
}

}  // namespace vibrig
