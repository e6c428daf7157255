#include "daemon/campaign/stages/loop_checking.hpp"

#include <spdlog/fmt/fmt.h>

#include <array>
#include <cmath>
#include <utility>

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::kSecond;
using drivers::Time;

namespace {
// Peak at the table: a tenth of a g is beyond doubt only after a thirtieth.
constexpr std::array kLadder_g{0.03, 0.1, 0.3};
constexpr double kAbove_hz = 1;
constexpr double kLaw = 0.05;          // pads are not quite a spring; both are measured by the same
constexpr Time kRung = 5 * kSecond;    // how long each counts
constexpr double kLadderUnit = 1.122;  // 1 dB: the table's own accelerometer is good to 2 %
}  // namespace

void LoopChecking::aim(const std::string& by, bool climbs) {
    by_ = by;
    rungs_.clear();
    for (const double rung_g : kLadder_g)
        if (climbs && rung_g < level_.settings.loop.table_g) rungs_.push_back(rung_g);
}

void LoopChecking::begin(Time now) {
    level_.loop.begin(by_);
    rung_ = 0;
    further_ = LoopCheck::further_frequencies(level_.settings);
    further_at_ = 0;
    above_hz_ = above_transmission_ = 0;
    if (!rungs_.empty()) {
        above_hz_ = level_.settings.frequency_hz + kAbove_hz;
        std::erase_if(further_,
                      [this](const Stop& stop) { return stop.frequency_hz == above_hz_; });
        further_.push_back({{}, level_.settings.loop.table_g, above_hz_});
    }
    level_.begin(by_, level_.settings.loop.table_g, now);
    part_ = Part::look;
}

void LoopChecking::go_on_to(Part part, Time now) {
    part_ = part;
    rung_counts_ = false;
    level_.begin_part(part == Part::settle || part == Part::measure, Proving::nothing, now);
}

double LoopChecking::table_g() const {
    if (part_ == Part::none || part_ == Part::look || part_ == Part::rest) return 0;
    return part_ == Part::climb || part_ == Part::rung ? rungs_[rung_]
                                                       : level_.settings.loop.table_g;
}

StageStep LoopChecking::step(Time now) {
    if (auto why = level_.lacks(now); !why.empty()) return StageStep::failed(std::move(why));
    const Time since = now - level_.excitation.since();
    if (part_ == Part::settle || part_ == Part::measure)
        if (auto why = level_.off_command(now); !why.empty())
            return StageStep::failed(std::move(why));
    switch (part_) {
        case Part::none:
            break;
        case Part::look:
            if (since >= kLook) return look(now);
            break;
        case Part::climb:
            return ramp(Part::rung, now);
        case Part::rung:
            return stand_on_rung(now);
        case Part::rest:
            return come_to_rest(now);
        case Part::ramp:
            return ramp(Part::settle, now);
        case Part::settle:
            if (since < from_seconds(level_.settings.settle_s)) break;
            level_.loop.measure();
            go_on_to(Part::measure, now);
            if (!at_further()) return StageStep::asks();
            break;
        case Part::measure:
            if (since < from_seconds(level_.settings.loop.measure_s)) break;
            if (!at_further()) return measured();
            measured_further();
            go_on_to(Part::rest, now);
            break;
    }
    return StageStep::going_on(now + kStagePoll);
}

StageStep LoopChecking::look(Time now) {
    if (auto why = level_.look_at_rest(now); !why.empty()) return StageStep::failed(std::move(why));
    if (!rungs_.empty()) {
        go_on_to(Part::climb, now);
    } else if (at_further()) {
        next_frequency(now);
    } else {
        go_on_to(Part::ramp, now);
    }
    return StageStep::going_on(now + kStagePoll);
}

StageStep LoopChecking::ramp(Part then, Time now) {
    bool reached = false;
    if (auto why = level_.excitation.climb(table_g(), now, reached); !why.empty())
        return StageStep::failed(std::move(why));
    if (reached) go_on_to(then, now);
    return StageStep::going_on(now + kStagePoll);
}

/// One step of the ladder: what table and platform do is held against the command before more is
/// asked for. A wrong unit shows itself here, while the worst confusion makes 0.42 g of 0.03.
StageStep LoopChecking::stand_on_rung(Time now) {
    const double rung_g = table_g();
    const Time since = now - level_.excitation.since();
    const Time settled = from_seconds(level_.settings.settle_s);
    if (const auto why = level_.excitation.off_command(rung_g, now); !why.empty())
        return StageStep::failed("ladder: " + why);
    auto& loop = level_.loop;
    auto& proof = level_.proof;
    if (since >= settled && !std::exchange(rung_counts_, true)) loop.measure();
    if (since < settled + kRung) return StageStep::going_on(now + kStagePoll);
    const auto peak = loop.peak();
    const double platform = peak.platform_g / (level_.settings.rig.transmission * rung_g);
    const double table = peak.table_g / rung_g;
    const bool table_known = loop.noise().table_g > 0;  // zero where it has none
    const std::string at = fmt::format("ladder, {:g} g, ", rung_g);
    proof.row(at + "platform over expected", "", platform, 0.5, 2);
    bool passed = proof.record().rows.back().passed();
    if (table_known) {
        proof.row(at + "table over command", "", table, 1 / kLadderUnit, kLadderUnit);
        passed = passed && proof.record().rows.back().passed();
    }
    if (!passed) {
        const auto unit = unit_of_ratio(table_known ? table : platform);
        return StageStep::failed(fmt::format(
            "ladder: at {:g} g the platform does {:.3g} times, the table {} what was expected{}{}",
            rung_g, platform, table_known ? fmt::format("{:.3g} times", table) : "unseen",
            unit.empty() ? "" : ": ", unit));
    }
    ++rung_;
    go_on_to(rung_ < rungs_.size() ? Part::climb : at_further() ? Part::rest : Part::ramp, now);
    return StageStep::going_on(now + kStagePoll);
}

StageStep LoopChecking::come_to_rest(Time now) {
    switch (level_.excitation.come_to_rest(now)) {
        case Excitation::Rests::not_yet:
            break;
        case Excitation::Rests::at_rest:
            next_frequency(now);
            break;
        case Excitation::Rests::overdue:
            return StageStep::failed("no rest between two frequencies: " +
                                     level_.stop.what_moves(now));
    }
    return StageStep::going_on(now + kStagePoll);
}

void LoopChecking::next_frequency(Time now) {
    level_.excitation.from_rest(at_further() ? further_[further_at_] : Stop{}, now);
    go_on_to(Part::ramp, now);
}

void LoopChecking::measured_further() {
    const Stop& stop = further_[further_at_++];
    const double expected =
        stop.transmission > 0 ? stop.transmission : level_.settings.rig.transmission;
    const bool above = stop.frequency_hz == above_hz_;
    const double tolerance = level_.settings.loop.transmission_tolerance;
    const auto law = above ? isolator_ratio(level_.settings.rig.transmission,
                                            level_.settings.frequency_hz, above_hz_)
                           : std::array<double, 2>{1, 1};
    const auto found = level_.loop.finish_at(stop.frequency_hz, expected * law[0] * (1 - tolerance),
                                             expected * law[1] * (1 + tolerance));
    if (above) above_transmission_ = found.transmission;
    bool passed = true;
    for (const auto& row : found.rows) {
        level_.proof.row(fmt::format("{:g} Hz, {}", found.hz, row.name), row.unit, row.value,
                         row.low, row.high);
        passed = passed && row.passed();
    }
    if (!passed) return;
    level_.excitation.measured(found.hz, found.transmission);
    level_.proof.record().transmissions.emplace_back(found.hz, found.transmission);
    level_.proof.record().found(found.hz, found.in_step);
}

StageStep LoopChecking::measured() {
    auto& loop = level_.loop;
    auto& proof = level_.proof;
    loop.finish(level_.ports.rig.shaker.reading().measured_g);
    level_.ports.log.loop_checked(by_, loop.out_of_band());
    if (loop.out_of_band().empty()) {
        proof.record().transmission = loop.transmission();
        level_.ports.rig.transmission(loop.transmission());
        level_.excitation.measured(level_.settings.frequency_hz, loop.transmission());
        proof.record().found(level_.settings.frequency_hz, loop.in_step());
    }
    proof.row("loop check in band", loop.out_of_band().empty());
    for (const auto& row : loop.status().rows) {  // the ratios
        if (std::isfinite(row.value) && std::isfinite(row.low) && std::isfinite(row.high))
            proof.row(row.name, row.unit, row.value, row.low, row.high);
    }
    if (auto why = compare(); !why.empty()) return StageStep::failed(std::move(why));
    return StageStep::done();
}

std::string LoopChecking::compare() {
    if (above_hz_ == 0 || !(level_.loop.transmission() > 0)) return {};
    const auto law =
        isolator_ratio(level_.loop.transmission(), level_.settings.frequency_hz, above_hz_);
    auto& proof = level_.proof;
    proof.row("f + 1 Hz over f, transmission", "", above_transmission_ / level_.loop.transmission(),
              law[0] * (1 - kLaw), law[1] * (1 + kLaw));
    return proof.record().rows.back().passed()
               ? ""
               : "1 Hz above the platform does not do what its pads would";
}

std::string LoopChecking::suspect_unit() const {
    const Time asked = level_.excitation.asked_at();
    if (part_ != Part::ramp || asked == 0) return {};
    const double ratio = level_.loop.over_command(asked, level_.settings.ramp_s);
    const auto suspect = unit_of_ratio(ratio);
    return suspect.empty() ? "" : fmt::format("; {:.2f} times the command: {}", ratio, suspect);
}

}  // namespace vibrig::campaign
