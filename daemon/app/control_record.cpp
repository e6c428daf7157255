// The commissioning record, which arming demands: what goes into it, and what takes a part out.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <utility>

#include "daemon/app/control_loop.hpp"
#include "daemon/commission/acceptance.hpp"
#include "daemon/commission/bus_bits.hpp"
#include "daemon/commission/procedure.hpp"
#include "daemon/commission/trial_log.hpp"
#include "daemon/version.hpp"

namespace vibrig {

using commission::Json;
using commission::Part;
using drivers::Time;

namespace {

/// Files are read and written then, which may take its time.
bool at_rest(CampaignState state) {
    return state == CampaignState::idle || state == CampaignState::finished ||
           state == CampaignState::aborted;
}

std::string listed(const std::vector<Part>& parts) {
    std::string names;
    for (const Part part : parts) names += (names.empty() ? "" : ", ") + std::string(name_of(part));
    return names;
}

}  // namespace

/// Before a shaker that is not understood yet runs at all; empty: each of its registers was tried.
std::string ControlLoop::registers_not_tried() const {
    return commission::TriedRegisters(configuration_.commission.folder)
        .lacks(commission::TriedRegisters::keys_of(loaded_));
}

void ControlLoop::hold_untried_registers() {
    const auto why = first_shaking() ? registers_not_tried() : std::string();
    if (why.empty()) return;
    campaign_.hold_writes();
    log(Severity::warning, "shaker",
        "nothing but a stop is written to the controller, its watchdog is not fed: " + why);
}

/// At the start: what was written to the controller meanwhile, without a daemon.
void ControlLoop::keep_trials() {
    try {
        const auto lines = commission::TrialLog::take(configuration_.commission.folder);
        for (const Json& line : lines) {
            const std::string by = line.value("by", ""), who = line.value("identity", "");
            commissioning_.enter({name_of(Part::registers), "4",
                                  who.empty() ? by : by + " (" + who + ")", "",
                                  line.value("what", ""), line.dump()});
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
            commissioning_.enter(
                {name_of(part.part), "", "", "", "void", Json{{"why", part.why}}.dump()});
}

/// What an earlier life's commissioning has left torqued is over, or each later start would end it
/// again.
void ControlLoop::keep_end_of_torque(Time now) {
    if (!torque_left_ || !campaign_.torque_ended(now)) return;
    torque_left_ = false;
    commissioning_.enter(
        {name_of(Part::gyros), "", "", "", "torque",
         Json{{"deg_per_h", {0, 0, 0}}, {"why", "an earlier daemon ended while it torqued"}}
             .dump()});
}

/// By a campaign whose result has the certificate's coefficients with the other sign.
void ControlLoop::void_gyros(const std::string& why) {
    if (why.empty() || !book_.standing(utc_now())[static_cast<std::size_t>(Part::gyros)].record)
        return;
    try {
        book_.withdraw(Part::gyros);
        log(Severity::alarm, "commissioning", "gyros is to be proven anew: " + why);
        commissioning_.enter({name_of(Part::gyros), "", "", "", "void", Json{{"why", why}}.dump()});
    } catch (const std::exception& error) {
        log(Severity::alarm, "commissioning",
            std::string("gyros is to be proven anew, and cannot be taken out: ") + error.what());
    }
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

/// What has happened since the last round that it, or the journal's part of it, is to know.
void ControlLoop::follow_record(Time now) {
    take_proof();
    keep_end_of_torque(now);
    void_gyros(dwells_.take_against_certificate());
}

commission::ShakerParts ControlLoop::shaker_parts(
    const commission::AmplitudeWitness& witness) const {
    std::vector<Json> proofs;
    for (const auto& proof : campaign_.proof().with_these_keys())
        proofs.push_back(Json::parse(campaign::to_json(proof)));
    return commission::shaker_parts(proofs, campaign_.proof().buttons_left(), witness);
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
        commissioning_.enter(
            {name_of(part), "", by, "", "accept",
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
    const std::string names = listed(parts);
    const auto text =
        fmt::format("{} signed with the certificate of {}, record {}", names, by, book_.sha256());
    log(Severity::info, "commissioning", text);
    for (const Part part : parts)
        commissioning_.enter(
            {name_of(part), "", request.by, "", "sign",
             Json{{"record_sha256", book_.sha256()}, {"cms", what["cms"]}}.dump()});
    return {true, text};
}

CommandReply ControlLoop::accept_commissioning(const CommandRequest& request,
                                               const std::string& second,
                                               const Json& confirmed_bits,
                                               const configuration::Loaded& file) {
    const std::vector<Part> parts{Part::bus, Part::gimbals, Part::accelerometers, Part::earth};
    const auto* const decided = commissioning_.decided();
    if (decided == nullptr) return {false, "nothing is decided: vibrig commission --by NAME"};
    const auto& finding = *decided;
    if (!finding.corrections.empty())
        return {false, "the DBC first, then commission anew: " + finding.corrections.front()};
    if (const auto why = commission::not_as_found(finding, file); !why.empty()) return {false, why};
    if (const auto why = commission::not_as_running(parts, finding, book_, file); !why.empty())
        return {false, why + ": it was not measured with that: commission anew"};
    std::string left;
    for (const auto& name : commission::unproven_bits(file, parts_.dbc))
        if (std::ranges::find(confirmed_bits, Json(name)) == confirmed_bits.end())
            left += (left.empty() ? "" : ", ") + name;
    if (!left.empty())
        return {false, "bus: " + left +
                           " never changed: vibrig commission bus --bits changes them "
                           "once, or two persons confirm them"};
    Json evidence = finding.evidence;
    evidence["bits"] = commission::with_confirmed(commission::BitBook(file.configuration).bits(),
                                                  confirmed_bits, {request.by, second}, utc_now());
    auto reply = record_parts(request, second, parts, evidence, file);
    if (reply.accepted) commissioning_.recorded();
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
    const std::string names = listed(parts);
    book_.prove(parts, what, as);
    const auto text = fmt::format("{}{} recorded by {} and {}, record {}",
                                  configuration_.simulated() ? "SIMULATED: " : "", names,
                                  request.by, second, book_.sha256());
    log(Severity::info, "commissioning", text);
    for (const Part part : parts)
        commissioning_.enter({name_of(part), "", request.by, "", "accept",
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
