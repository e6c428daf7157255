// Commissioning at the local socket: a person's permissions and answers go to the procedure, what
// it finds goes into the record that arming demands.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <utility>

#include "daemon/app/control_loop.hpp"
#include "daemon/commission/acceptance.hpp"
#include "daemon/commission/bus_bits.hpp"
#include "daemon/commission/trial_log.hpp"
#include "daemon/record/digest.hpp"
#include "daemon/version.hpp"

namespace vibrig {

using commission::Json;
using commission::Part;
using drivers::Time;

namespace {

constexpr const char* kNoScript = "answers: persons answer on a real rig";
constexpr double kDegPerRad = 180 / std::numbers::pi;

commission::Vec3 in_degrees(const std::array<double, 3>& rad) {
    return {rad[0] * kDegPerRad, rad[1] * kDegPerRad, rad[2] * kDegPerRad};
}

constexpr int kFineBits = 12;

/// Of "Message.Signal"; 0: there is none.
int bits_of(const proto::Dbc& dbc, const std::string& name) {
    const auto dot = name.find('.');
    const auto* const message = dbc.find(std::string_view(name).substr(0, dot));
    const auto* const signal = message == nullptr || dot == std::string::npos
                                   ? nullptr
                                   : message->find(std::string_view(name).substr(dot + 1));
    return signal == nullptr ? 0 : static_cast<int>(signal->length);
}

/// Valid bits and the like, as vibrig commission bus --bits has proven them.
Json bits_of_the_bus(const configuration::Loaded& file) {
    const auto& c = file.configuration;
    const auto text = c.dbc.empty() ? record::sha256_of_text(std::string(proto::rig_dbc_text()))
                                    : record::sha256_of_file(c.dbc);
    return commission::BitBook(c.commission.folder, text).bits();
}

/// Valid bits, loop closed, gyros at speed, ready and fault, of which nobody knows whether they say
/// what they are called.
std::vector<std::string> unproven_bits(const configuration::Loaded& loaded, const proto::Dbc& dbc) {
    const Json proven = bits_of_the_bus(loaded);
    std::vector<std::string> names;
    for (const auto& value : loaded.effective) {
        constexpr std::array<const char*, 4> kStates{"can.signals.loop_closed",
                                                     "can.signals.gyros_at_speed",
                                                     "can.signals.ready", "can.signals.fault"};
        if (!value.key.starts_with("can.signals.") ||
            (!value.key.ends_with("_valid") &&
             std::ranges::find(kStates, value.key) == kStates.end()))
            continue;
        const Json text = Json::parse(value.value, nullptr, false);
        const std::string name = text.is_string() ? text.get<std::string>() : std::string();
        if (bits_of(dbc, name) == 1 && !proven.contains(name) &&
            std::ranges::find(names, name) == names.end())
            names.push_back(name);
    }
    return names;
}

/// What two persons confirm of bits that never changed, beside those that did.
Json with_confirmed(Json bits, const Json& names, const std::vector<std::string>& by,
                    std::int64_t utc_ns) {
    for (const Json& name : names)
        if (name.is_string() && !bits.contains(name.get<std::string>()))
            bits[name.get<std::string>()] = {
                {"proven", "confirmed"}, {"by", by}, {"utc", commission::instant_of(utc_ns)}};
    return bits;
}

/// A wire leaves this machine, whatever the configuration says of its rig: gimbals may be at its
/// end.
bool real_wire(const drivers::CanPortSettings& can) {
    std::error_code error;
    return can.kind == drivers::CanPortSettings::Kind::socketcan &&
           !std::filesystem::exists("/sys/devices/virtual/net/" + can.interface, error);
}

/// Files are read and written then, which may take its time.
bool at_rest(CampaignState state) {
    return state == CampaignState::idle || state == CampaignState::finished ||
           state == CampaignState::aborted;
}

}  // namespace

std::unique_ptr<commission::Procedure> ControlLoop::make_procedure() {
    commission::Names names;
    for (const auto& value : loaded_.effective) {
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
            if (const int bits = bits_of(parts_.dbc, name); bits > 0 && bits < kFineBits)
                names.coarse.push_back(fmt::format("{} has {} bits", name, bits));
    for (const auto& value : loaded_.effective) {
        if (value.key == "can.dbc") names.dbc = value.value;
        if (value.key == "can.sample_rate_hz") names.sample_rate = value.value;
    }
    names.command = configuration_.gimbal.message;
    names.torque = configuration_.campaign.level.torquer.message;
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
    ports.slew = [this](const commission::Vec3& deg, Time now) {
        // Where it stands and where it stops it is to stay, not to go by the middle of its travel.
        const auto sample = acquisition_.view().sample;
        if (sample.angles_good()) gimbal_.stands_at(in_degrees(sample.angle));
        gimbal_.slew_to(deg, now);
    };
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
        ports.slew_counting = [this](const commission::Vec3& deg, Time now) {
            const auto sample = acquisition_.view().sample;
            if (sample.angles_good()) gimbal_.stands_at(in_degrees(sample.angle));
            gimbal_.slew_to(deg, now, true);
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
    return std::make_unique<commission::Procedure>(
        std::move(names),
        commission::Stated{
            configuration_.estimator.latitude_deg, configuration_.commission.linear_sigma,
            configuration_.simulated() && !real_wire(configuration_.can),
            parts_.torquer ? std::min(parts_.torquer->limit(),
                                      configuration_.campaign.level.torquer_limit_deg_h)
                           : 0},
        std::move(ports));
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

/// Before a shaker that is not understood yet runs at all; empty: each of its registers was tried.
std::string ControlLoop::registers_not_tried() const {
    return commission::TriedRegisters(configuration_.commission.folder)
        .lacks(commission::TriedRegisters::keys_of(loaded_));
}

/// At the start: what was written to the controller meanwhile, without a daemon.
void ControlLoop::keep_trials() {
    try {
        const auto lines = commission::TrialLog::take(configuration_.commission.folder);
        for (const Json& line : lines) {
            const std::string by = line.value("by", ""), who = line.value("identity", "");
            keep_commissioned({name_of(Part::registers), "4",
                               who.empty() ? by : by + " (" + who + ")", "", line.value("what", ""),
                               line.dump()});
        }
        if (!lines.empty())
            log(Severity::info, "commissioning",
                fmt::format("registers were tried without vibrigd: {} lines taken into the journal",
                            lines.size()));
    } catch (const std::exception& error) {
        log(Severity::warning, "commissioning",
            std::string("registers were tried without vibrigd, and it is not in the journal: ") +
                error.what());
    }
}

/// At the start: parts that were proven, and by what they no longer are.
void ControlLoop::keep_voided() {
    for (const auto& part : book_.standing(utc_now()))
        if (part.record && !part.proven)
            keep_commissioned(
                {name_of(part.part), "", "", "", "void", Json{{"why", part.why}}.dump()});
}

/// By a campaign whose result has the certificate's coefficients with the other sign.
void ControlLoop::void_gyros(const std::string& why) {
    if (why.empty() || !book_.standing(utc_now())[static_cast<std::size_t>(Part::gyros)].record)
        return;
    try {
        book_.withdraw(Part::gyros);
        log(Severity::alarm, "commissioning", "gyros is to be proven anew: " + why);
        keep_commissioned({name_of(Part::gyros), "", "", "", "void", Json{{"why", why}}.dump()});
    } catch (const std::exception& error) {
        log(Severity::alarm, "commissioning",
            std::string("gyros is to be proven anew, and cannot be taken out: ") + error.what());
    }
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
    record["unproven_bits"] =
        what.contains("bits") ? Json(unproven_bits(loaded_, parts_.dbc)) : Json::array();
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

commission::ShakerParts ControlLoop::shaker_parts(
    const commission::AmplitudeWitness& witness) const {
    std::vector<Json> proofs;
    for (const auto& proof : campaign_.proof().with_these_keys())
        proofs.push_back(Json::parse(campaign::to_json(proof)));
    return commission::shaker_parts(proofs, campaign_.proof().buttons_left(), witness);
}

/// A proof was made: the record gets what it shows of the shaker.
void ControlLoop::take_proof() {
    const auto& proofs = campaign_.proof().history();
    if (std::exchange(proofs_taken_, proofs.size()) == proofs.size()) return;
    const auto& record = proofs.back();
    if (!record.passed || !configuration_.record_demanded()) return;
    try {
        static_cast<void>(enter_shaker_parts(record.by, {}));
    } catch (const std::exception& error) {
        log(Severity::warning, "commissioning",
            std::string("the proof is not in the record: ") + error.what());
    }
}

/// Returns what was recorded, for a person. Throws std::runtime_error: why nothing was.
std::string ControlLoop::enter_shaker_parts(const std::string& by,
                                            const commission::AmplitudeWitness& witness) {
    commission::PartRecord what;
    what.by = {by};
    what.utc_ns = utc_now();
    what.version = kVersion;
    if (const auto why = book_.not_proven_below_shaker(what.utc_ns); !why.empty())
        throw std::runtime_error("the platform's part is to be proven before the shaker's: " + why);
    std::string names;
    const auto parts = shaker_parts(witness);
    for (const auto& [part, evidence] : parts.proven) {
        what.evidence = evidence;
        book_.prove({part}, what, loaded_);
        keep_commissioned({name_of(part), "", by, "", "accept",
                           Json{{"record_sha256", book_.sha256()}, {"evidence", evidence}}.dump()});
        names += (names.empty() ? "" : ", ") + std::string(name_of(part));
    }
    auto text = fmt::format("{}{} recorded by {}", configuration_.simulated() ? "SIMULATED: " : "",
                            names.empty() ? "nothing" : names, by);
    for (const auto& [part, why] : parts.lacking)
        text += fmt::format("; {} not: {}", name_of(part), why);
    log(Severity::info, "commissioning", text);
    return text;
}

CommandReply ControlLoop::state_units(const CommandRequest& request, const Json& what) {
    commission::AmplitudeWitness witness;
    witness.display = what.value("display", "");
    if (what.contains("reference_g") && what["reference_g"].is_number())
        witness.reference_g = what["reference_g"];
    const auto units = commission::amplitude_units();
    if (std::ranges::find(units, witness.display) == units.end() || !(witness.reference_g > 0))
        return {false, fmt::format("units: found the display's unit \"{}\" and a reference of {} "
                                   "g, expected one of g peak, g rms, g peak-peak, m/s2 peak, m/s2 "
                                   "rms and a positive number",
                                   witness.display, witness.reference_g)};
    auto text = enter_shaker_parts(request.by, witness);
    const bool stands = shaker_parts(witness).proven.contains(Part::units);
    return {stands, std::move(text)};
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

CommandReply ControlLoop::enter_in_record(const CommandRequest& request, const Json& what,
                                          Time now) {
    StatusData status;
    campaign_.fill(status, now);
    if (!at_rest(status.state))
        return {false, fmt::format("the record: found the campaign {}, expected it idle, finished "
                                   "or aborted",
                                   name_of(status.state))};
    const auto text = [&what](const char* key) { return what.value(key, std::string()); };
    try {
        if (loaded_.path.empty()) return {false, "the daemon has no configuration file"};
        if (text("part") == name_of(Part::units)) return state_units(request, what);
        const std::string second = text("second");
        if (auto why = commission::not_two(request.by, second); !why.empty()) return {false, why};
        const auto file = configuration::load(loaded_.path, true);
        if (what["do"] == "accept")
            return accept_commissioning(request, second,
                                        what.value("confirmed_bits", Json::array()), file);
        if (text("part") != name_of(Part::gyros))
            return {false, "commission: part: found \"" + text("part") +
                               "\", expected gyros: what can be measured is not stated"};
        if (const auto why = commission::not_as_running({Part::gyros}, {}, book_, file);
            !why.empty())
            return {false, why + ": restart vibrigd first"};
        const Json torquers = book_.evidence(Part::gimbals).value("torquers", Json());
        if (const auto why = commission::not_as_torqued(torquers, file); !why.empty())
            return {false, why};
        const Json increments = book_.evidence(Part::gimbals).value("increments", Json());
        if (const auto why = commission::not_as_counted(increments, file); !why.empty())
            return {false, why};
        // Of a simulated rig a script may leave it out.
        const Json said = what.value("statements", Json::array());
        if (!said.empty() || !configuration_.simulated())
            if (const auto why = commission::doubt_of_drift_sign(commission::sign_statements(said),
                                                                 request.by, second, file);
                !why.empty())
                return {false, why};
        return record_parts(request, second, {Part::gyros},
                            {{"stated", "by two persons, from the drawing; nothing measures it"},
                             {"torquers", torquers},
                             {"increments", increments},
                             {"drift_sign", said}},
                            file);
    } catch (const std::exception& error) {
        return {false, std::string("nothing is recorded: ") + error.what()};
    }
}

CommandReply ControlLoop::sign_record(const CommandRequest& request, const Json& what) {
    std::vector<Part> parts;
    for (const Json& name : what.value("parts", Json::array()))
        if (const auto part =
                name.is_string() ? commission::part_named(name.get<std::string>()) : std::nullopt)
            parts.push_back(*part);
    const std::string by = commission::name_of_person(request.by);
    try {
        book_.sign(parts, by, what.value("cms", std::string()));
    } catch (const std::exception& error) {
        return {false, std::string("not signed: ") + error.what()};
    }
    std::string names;
    for (const Part part : parts) names += (names.empty() ? "" : ", ") + std::string(name_of(part));
    const auto text =
        fmt::format("{} signed with the certificate of {}, record {}", names, by, book_.sha256());
    log(Severity::info, "commissioning", text);
    for (const Part part : parts)
        keep_commissioned({name_of(part), "", request.by, "", "sign",
                           Json{{"record_sha256", book_.sha256()}, {"cms", what["cms"]}}.dump()});
    return {true, text};
}

CommandReply ControlLoop::accept_commissioning(const CommandRequest& request,
                                               const std::string& second,
                                               const Json& confirmed_bits,
                                               const configuration::Loaded& file) {
    using Outcome = commission::Finding::Outcome;
    const std::vector<Part> parts{Part::bus, Part::gimbals, Part::accelerometers, Part::earth};
    if (!procedure_ || procedure_->active() || procedure_->finding().outcome != Outcome::decided)
        return {false, "nothing is decided: vibrig commission --by NAME"};
    const auto& finding = procedure_->finding();
    if (!finding.corrections.empty())
        return {false, "the DBC first, then commission anew: " + finding.corrections.front()};
    if (const auto why = commission::not_as_found(finding, file); !why.empty()) return {false, why};
    if (const auto why = commission::not_as_running(parts, finding, book_, file); !why.empty())
        return {false, why + ": it was not measured with that: commission anew"};
    std::string left;
    for (const auto& name : unproven_bits(file, parts_.dbc))
        if (std::ranges::find(confirmed_bits, Json(name)) == confirmed_bits.end())
            left += (left.empty() ? "" : ", ") + name;
    if (!left.empty())
        return {false, "bus: " + left +
                           " never changed: vibrig commission bus --bits changes them "
                           "once, or two persons confirm them"};
    Json evidence = finding.evidence;
    evidence["bits"] =
        with_confirmed(bits_of_the_bus(file), confirmed_bits, {request.by, second}, utc_now());
    auto reply = record_parts(request, second, parts, evidence, file);
    if (reply.accepted) progress().remove();
    return reply;
}

CommandReply ControlLoop::record_parts(const CommandRequest& request, const std::string& second,
                                       const std::vector<Part>& parts, const Json& evidence,
                                       const configuration::Loaded& as) {
    commission::PartRecord what;
    what.evidence = evidence;
    what.by = {request.by, second};
    what.utc_ns = utc_now();
    what.version = kVersion;
    std::string names;
    for (const Part part : parts) names += (names.empty() ? "" : ", ") + std::string(name_of(part));
    book_.prove(parts, what, as);
    const auto text = fmt::format("{}{} recorded by {} and {}, record {}",
                                  configuration_.simulated() ? "SIMULATED: " : "", names,
                                  request.by, second, book_.sha256());
    log(Severity::info, "commissioning", text);
    for (const Part part : parts)
        keep_commissioned({name_of(part), "", request.by, "", "accept",
                           Json{{"second", second},
                                {"record_sha256", book_.sha256()},
                                {"signed_with", book_.signed_with()},
                                {"evidence", evidence}}
                               .dump()});
    const auto standing = book_.standing(what.utc_ns);
    const bool read = std::ranges::all_of(
        parts, [&standing](Part part) { return standing[static_cast<std::size_t>(part)].proven; });
    return {true, text + (read ? "" : "; restart vibrigd, which has not read the file yet")};
}

}  // namespace vibrig
