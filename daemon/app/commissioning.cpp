#include "daemon/app/commissioning.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>

#include "daemon/commission/acceptance.hpp"
#include "daemon/commission/bus_bits.hpp"
#include "proto/json_text.hpp"

namespace vibrig {

using commission::Json;
using drivers::Time;

namespace {

constexpr int kFineBits = 12;
constexpr const char* kSource = "commissioning";
constexpr const char* kNoScript = "answers: persons answer on a real rig";

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

commission::Stated stated(const Parts& parts) {
    const auto& configuration = parts.configuration;
    return {configuration.estimator.latitude_deg, configuration.commission.linear_sigma,
            configuration.simulated() && !real_wire(configuration.can),
            parts.torquer
                ? std::min(parts.torquer->limit(), configuration.campaign.level.torquer_limit_deg_h)
                : 0};
}

}  // namespace

CommandReply Commissioning::command(const CommandRequest& request, const std::string& word,
                                    const Json& what, Time now) {
    const auto text = [&what](const char* key) { return proto::text_at(what, key); };
    if (word == "begin") {
        if (active()) return {false, "the rig is being commissioned by " + procedure_->by()};
        return begin(request, what, now);
    }
    if (word != "answer" && word != "answers" && word != "stop" && word != "end")
        return {
            false,
            "commission: do: found \"" + word +
                "\", expected begin, read, attend, answer, answers, stop, end, accept, state or "
                "sign"};
    if (!active()) return {false, "the rig is not being commissioned"};
    attend(request.by);
    if (word == "answer") {
        const auto why = procedure_->answer(request.by, text("id"), text("value"));
        if (!procedure_->active()) end(now);
        return {why.empty(), why.empty() ? "answered" : why};
    }
    if (word == "answers") {
        if (!configuration_.simulated()) return {false, kNoScript};
        procedure_->answer_all(what.value("answers", Json::object()));
        return {true, "answered as they are asked"};
    }
    if (word == "stop") {
        procedure_->stop("by " + commission::name_of_person(request.by), now);
        return {true, "stopped"};
    }
    procedure_->halt("ended by " + commission::name_of_person(request.by), now);
    parts_.campaign.end_commissioning(now);
    return {true, "ended"};
}

CommandReply Commissioning::begin(const CommandRequest& request, const Json& what, Time now) {
    if (auto why = outside_.refuses(request); !why.empty()) return {false, why};
    const auto flag = [&what](const char* key) { return what.contains(key) && what[key] == true; };
    const bool by_hand = flag("by_hand");
    commission::Kept kept;
    if (flag("resume")) kept = this->kept().read(request.by, by_hand, utc_now());
    if (what.contains("ask") && what["ask"].is_string()) kept.again = what["ask"];
    if (!kept.again.empty() && !kept.why_not.empty())
        return {false, kept.why_not + ": there is nothing to ask again"};
    if (what.contains("answers") && !configuration_.simulated()) return {false, kNoScript};
    if (auto why = parts_.campaign.begin_commissioning(request.by, now); !why.empty()) {
        // Samples at another rate than the configured one never show rest.
        const auto off =
            parts_.acquisition.view().rate.hz() > 0 ? parts_.fitness.rate_misfit() : "";
        return {false, off.empty() ? why : off};
    }
    procedure_ =
        std::make_unique<commission::Procedure>(names_of(parts_.loaded, parts_.dbc), stated(parts_),
                                                rig_, static_cast<commission::Keeper&>(*this));
    if (what.contains("answers")) procedure_->answer_all(what["answers"]);
    attend(request.by);
    if (flag("resume"))
        procedure_->begin_again(request.by, by_hand, kept, now);
    else
        procedure_->begin(request.by, by_hand, now);
    if (!procedure_->active()) end(now);
    event(fmt::format("{} by {}", flag("resume") ? "taken up" : "begun", request.by));
    return {true, "begun"};
}

void Commissioning::attend(const std::string& by) {
    if (procedure_) procedure_->attend(by, drivers::steady_now());
}

Time Commissioning::step(Time now) {
    if (!active()) return drivers::kNever;
    if (!parts_.campaign.commissioning()) {
        StatusData status;
        parts_.campaign.fill(status, now);
        procedure_->halt(status.reason, now);
        return drivers::kNever;
    }
    rig_.take_increments();
    const Time next = procedure_->step(now, drivers::steady_now());
    if (!procedure_->active()) end(now);
    return next;
}

/// What was found stands on disk, whoever reads it.
void Commissioning::end(Time now) {
    parts_.campaign.end_commissioning(now);
    const auto* const found = decided();
    if (found == nullptr) return;
    try {
        kept().write_found(commission::to_toml(*found, configuration_.simulated()));
    } catch (const std::exception& error) {
        warn(std::string("what was found is not kept: ") + error.what());
    }
}

const commission::Finding* Commissioning::decided() const noexcept {
    if (!procedure_ || procedure_->active()) return nullptr;
    const auto& finding = procedure_->finding();
    return finding.outcome == commission::Finding::Outcome::decided ? &finding : nullptr;
}

commission::Progress Commissioning::kept() const {
    return {configuration_.commission.folder, Json(book_.keys(commission::Part::bus))};
}

void Commissioning::enter(journal::Commissioned row) {
    if (!parts_.journal) return;
    const std::string name = commission::name_of_person(row.by);
    if (name.size() + 3 <= row.by.size())
        row.identity = row.by.substr(name.size() + 2, row.by.size() - name.size() - 3);
    row.by = name;
    row.utc_ns = utc_now();
    parts_.journal->commissioned(row);
}

void Commissioning::event(const std::string& text) {
    parts_.events.log(Severity::info, kSource, text);
}

void Commissioning::warn(const std::string& text) {
    parts_.events.log(Severity::warning, kSource, text);
}

void Commissioning::note(const commission::Note& note) {
    enter({note.part, note.step, note.by, {}, note.what, note.data.dump()});
}

void Commissioning::keep(const Json& log) {
    try {
        kept().write(procedure_->by(), procedure_->by_hand(), log, utc_now());
    } catch (const std::exception& error) {
        warn(std::string("what is done is not kept: ") + error.what());
    }
}

}  // namespace vibrig
