#include "daemon/campaign/stages/dwelling.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "daemon/campaign/rig_frame.hpp"
#include "daemon/interlock/random_bands.hpp"

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::kSecond;
using drivers::Time;

namespace {

// The order of a dwell goes out this long before its first sample; the last part of settling.
constexpr Time kOrderLead = kSecond;
// How much later than the last sample of a dwell the estimator may report it as done.
constexpr Time kDoneGrace = 2 * kSecond;
constexpr double kAtRestG = 1e-9;
// Of the settling, left for what follows when the vibration is not shown.
constexpr Time kAhead = 200 * drivers::kMillisecond;

}  // namespace

void Dwelling::reset(std::optional<StopDone> before) {
    before_ = before;
    origin_.reset();
}

void Dwelling::aim(const Aim& aim, const ZeroCalibration* zeros) {
    aim_ = aim;
    zeros_ = zeros;
}

CampaignState Dwelling::state() const {
    return part_ == Part::ramp     ? CampaignState::ramping
           : part_ == Part::settle ? CampaignState::settling
                                   : CampaignState::recording;
}

StageStep Dwelling::step(Time now) {
    if (part_ != Part::ramp) return settled_or_recording(now);
    drivers::Gimbal& gimbal = ports_.rig.gimbal;
    const auto at = gimbal.update(ports_.rig.platform(), now);
    if (at == drivers::GimbalState::commanding)
        return StageStep::going_on(std::min(gimbal.next_deadline(), now + kStagePoll));
    if (at != drivers::GimbalState::idle)
        return StageStep::failed(fmt::format("gimbals not released: {}", drivers::name_of(at)));
    return excitation_.asked() ? ramp(now) : StageStep::asks();
}

StageStep Dwelling::ramp(Time now) {
    bool reached = table_g() <= kAtRestG;
    if (!reached) {
        bool may = excitation_.asked();
        std::string why = may ? "" : vibration_may_change(now, may);
        if (may) why = excitation_.climb(table_g(), now, reached);
        if (!why.empty()) return StageStep::failed(std::move(why));
    }
    if (!reached) return StageStep::going_on(now + kStagePoll);
    part_ = Part::settle;
    return StageStep::going_on(now);
}

/// Mode, profile, level and frequency are written at measured rest.
std::string Dwelling::vibration_may_change(Time now, bool& may) const {
    const auto reading = ports_.rig.shaker.reading();
    may = excitation_.chosen() || (reading.at_rest() && stop_.rest(now).measured());
    if (may || now - excitation_.since() <= Excitation::kRampGrace) return {};
    const auto& random = excitation_.random();
    return fmt::format("rest is not measured ({}): {} not written", stop_.what_moves(now),
                       random ? fmt::format("profile {} is", random->set_point.profile)
                       : excitation_.sweep().any()
                           ? fmt::format("the sweep from {:g} to {:g} Hz is",
                                         excitation_.sweep().from_hz, excitation_.sweep().to_hz)
                           : fmt::format("{:g} Hz are", excitation_.frequency_hz()));
}

StageStep Dwelling::settled_or_recording(Time now) {
    if (!ordered_) return order(now);
    if (table_g() > kAtRestG)
        if (auto why = excitation_.off_command(table_g(), now); !why.empty())
            return StageStep::failed(std::move(why));
    if (torquing(ports_.rig))
        return StageStep::failed("the platform is torqued during a dwell, expected free drift");
    follow_sweep(now);
    if (part_ == Part::settle) {
        look_at_vibration(now);
        if (now < from_) return StageStep::going_on(std::min(from_, now + kStagePoll));
        part_ = Part::record;
        begin_in_step();
    }
    note_rms();
    watch_in_step();
    if (done_) {
        ordered_ = power_lost_ = false;
        end_in_step();
        end_sweep();
        return StageStep::done();
    }
    if (now > to_ + kDoneGrace) return StageStep::failed("samples ceased during the dwell");
    return StageStep::going_on(std::min(now < to_ ? to_ : now + poll(), now + poll()));
}

/// Nobody tells of samples that are watched: they are fetched before half of their room is full.
Time Dwelling::poll() const {
    constexpr double kHalf = rt::StageFeed::kCapacity / 2.0;
    return in_step_ ? std::min(kStagePoll, from_seconds(kHalf * settings_.sample_s)) : kStagePoll;
}

StageStep Dwelling::order(Time now) {
    // On a whole millisecond: how often clocks were read on the way here does not show.
    const Time settled =
        excitation_.since() + std::max(from_seconds(settings_.settle_s), kOrderLead);
    from_ = (settled + drivers::kMillisecond - 1) / drivers::kMillisecond * drivers::kMillisecond;
    to_ = from_ + from_seconds(dwell_s());
    done_ = false;
    ordered_ = true;
    rt::DwellOrder order;
    order.from = from_;
    order.to = to_;
    utc_ns_ = ports_.log.utc_ns() + (from_ - now);
    if (!origin_) take_over_origin();
    order.dwell = info();
    square_ = readings_ = 0;
    if (zeros_ != nullptr) {
        order.zero_g = zeros_->raw_zero_g();
        order.level_sigma_g = zeros_->level_sigma(aim_.stop.position_deg);
    }
    watch_vibration(order);
    if (!ports_.dwells.order(order)) return StageStep::failed("the estimator takes no order");
    return StageStep::going_on(now + kStagePoll);
}

/// After a restart the clock may be another one: what both have in common is UTC, unless that was
/// set back meanwhile.
void Dwelling::take_over_origin() {
    origin_ = from_;
    if (!before_ || !std::isfinite(before_->begin_s)) return;
    const Time least = from_seconds(settings_.dwell_s);
    const Time since = utc_ns_ - before_->begun_utc_ns;
    *origin_ -= from_seconds(before_->begin_s) + std::max(since, least);
}

estimator::DwellInfo Dwelling::info() const {
    return {aim_.run,
            aim_.position,
            table_g(),
            drivers::to_seconds(from_ - origin_.value_or(from_)),
            power_lost_ && !aim_.first,
            aim_.stop.frequency_hz,
            aim_.stop.verify,
            random_at_platform(),
            {},
            aim_.stop.sweep,
            {}};
}

estimator::RandomVibration Dwelling::random_at_platform() const {
    if (!aim_.stop.random) return {};
    auto there = aim_.stop.random->at_platform;
    there.mean_square_g2 *= excitation_.power_ratio(*aim_.stop.random);
    return there;
}

void Dwelling::leave() {
    if (std::exchange(watching_, false) || sweep_) ports_.rig.feed->order(rt::StageFeed::Mode::off);
    sweep_.reset();
    end_in_step();
    if (std::exchange(ordered_, false)) {
        rt::DwellOrder cancel;
        cancel.cancel = true;
        static_cast<void>(ports_.dwells.order(cancel));
    }
}

double Dwelling::part_done(Time now) const {
    if (to_ <= from_) return 0;
    return std::clamp(static_cast<double>(now - from_) / static_cast<double>(to_ - from_), 0.0,
                      1.0);
}

double Dwelling::left_s(Time now) const { return std::max(drivers::to_seconds(to_ - now), 0.0); }

/// Of a plan that says no frequency there is one only, which the loop check has measured.
void Dwelling::watch_vibration(const rt::DwellOrder& order) {
    watching_ = aim_.stop.kind() != 0 && table_g() > kAtRestG && ports_.rig.feed != nullptr;
    shown_.clear();
    swept_hz_.clear();
    if (!watching_) return;
    ports_.rig.feed->order(rt::StageFeed::Mode::samples);
    if (!aim_.stop.sweep.any()) return;
    sweep_.emplace(settings_.rig, order, excitation_.since(), settings_.swept_by);
    read_at_ = 0;
}

double Dwelling::dwell_s() const { return settings_.dwell_s_of(aim_.stop); }

void Dwelling::trip(const std::string& why) {
    ports_.log.event(Severity::trip, why);
    ports_.rig.wrong_vibration();
    excitation_.order_stop("another vibration than was asked for");
}

/// By the controller's word, and by the accelerometers'.
void Dwelling::follow_sweep(Time now) {
    if (!sweep_) return;
    std::string other;
    const RigFrame frame(settings_.rig);
    rt::Motion motion;
    while (ports_.rig.feed->pop(motion)) {
        if (watching_ && motion.good)
            shown_.push_back({drivers::to_seconds(motion.time), frame.force(motion.force, 1),
                              motion.table, motion.table_good, motion.angle});
        sweep_->add(motion);
    }
    const auto reading = ports_.rig.shaker.reading();
    if (reading.valid && reading.sweep && reading.time > std::exchange(read_at_, reading.time))
        other = sweep_->frequency(reading.time, reading.sweep->actual_hz);
    if (const auto begun = sweep_->begun(); begun && other.empty())
        excitation_.follow(*begun, sweep_->octaves_per_s(), now);
    if (sweep_->moved()) watching_ = false;  // it is elsewhere already
    if (other.empty()) return;
    ports_.rig.feed->order(rt::StageFeed::Mode::off);
    sweep_.reset();
    watching_ = false;
    trip(other);
}

/// What its PSD is held against.
void Dwelling::note_rms() {
    if (!excitation_.random()) return;
    const auto reading = ports_.rig.shaker.reading();
    if (!reading.valid || !reading.random || reading.time <= read_at_ || reading.time < from_ ||
        reading.time > to_)
        return;
    read_at_ = reading.time;
    square_ += reading.random->measured_g_rms * reading.random->measured_g_rms;
    ++readings_;
}

/// Of a sine, once it records.
void Dwelling::begin_in_step() {
    if (!aim_.in_step || sweep_ || excitation_.random() || table_g() <= kAtRestG ||
        ports_.rig.feed == nullptr)
        return;
    const double asked_hz = aim_.stop.frequency_hz;
    in_step_.emplace(settings_.rig, settings_.sample_s, *aim_.in_step,
                     asked_hz > 0 ? asked_hz : settings_.frequency_hz, ports_.rig.grown_limits());
    ports_.rig.feed->order(rt::StageFeed::Mode::watched);
}

void Dwelling::watch_in_step() {
    if (!in_step_) return;
    const RigFrame frame(settings_.rig);
    rt::Motion motion;
    while (ports_.rig.feed->pop(motion)) {
        if (!motion.good) continue;
        const auto look =
            in_step_->add({drivers::to_seconds(motion.time), frame.force(motion.force, 1),
                           motion.table, motion.table_good, motion.angle});
        if (!look) continue;
        for (const auto& said : look->said) ports_.log.event(Severity::alarm, said);
        ports_.rig.grown(look->times);
    }
}

/// The next dwell begins anew.
void Dwelling::end_in_step() {
    if (!in_step_) return;
    in_step_.reset();
    ports_.rig.feed->order(rt::StageFeed::Mode::off);
    ports_.rig.grown(std::nullopt);
}

void Dwelling::end_sweep() {
    if (!sweep_) return;
    ports_.rig.feed->order(rt::StageFeed::Mode::off);
    const auto sweep = sweep_->finish();
    swept_hz_ = sweep_->readings();
    sweep_.reset();
    ports_.dwells.swept(sweep, swept_hz_);
}

void Dwelling::look_at_vibration(Time now) {
    if (!watching_) return;
    const RigFrame frame(settings_.rig);
    rt::Motion motion;
    while (ports_.rig.feed->pop(motion)) {
        if (motion.good)
            shown_.push_back({drivers::to_seconds(motion.time), frame.force(motion.force, 1),
                              motion.table, motion.table_good, motion.angle});
    }
    if (now < from_ - kAhead) return;
    watching_ = false;
    if (!sweep_) ports_.rig.feed->order(rt::StageFeed::Mode::off);
    const std::string other = excitation_.random() ? other_level() : other_frequency();
    if (!other.empty()) trip(other);
}

std::string Dwelling::other_frequency() const {
    const double asked_hz = excitation_.frequency_hz();
    const auto found = estimator::loop_response(shown_, asked_hz);
    if (found.platform_g > 0 &&
        std::abs(found.frequency_hz - asked_hz) <= settings_.loop.frequency_tolerance_hz)
        return {};
    return fmt::format("the accelerometers show {:.3f} Hz, {:.3f} Hz were asked for and read back",
                       found.frequency_hz, asked_hz);
}

/// Of a random vibration slow samples tell the rms alone, as well as so many values know it; which
/// profile it is tells the controller's checksum.
std::string Dwelling::other_level() const {
    const RandomStop& random = *excitation_.random();
    const double expected_g = std::sqrt(random.at_platform.mean_square_g2);
    const auto up = RigFrame(settings_.rig).up_at_deg(excitation_.position_deg());
    double platform = 0, table = 0, tables = 0;
    for (const auto& reading : shown_) {
        double along = -1;
        for (std::size_t i = 0; i < 3; ++i) along += up[i] * reading.force_g[i];
        platform += along * along;
        if (!reading.table_good) continue;
        table += reading.table_g * reading.table_g;
        ++tables;
    }
    const auto mismatch = [&](const char* where, double sum, double count, double rms_g) {
        // As many independent values as there are readings, or as the band has.
        const double values =
            std::min(count, 2 * random.at_platform.bandwidth_hz * count * settings_.sample_s);
        const auto [least, most] = rt::RandomBands::by_chance(std::max(values, 1.0));
        const double over = count > 0 ? sum / count / (rms_g * rms_g) : 0;
        if (over >= least && over <= most) return std::string();
        return fmt::format(
            "the {} {:.3g} g rms, {:.3g} g of profile {} at {:g} dB were asked "
            "for and read back",
            where, rms_g * std::sqrt(over), rms_g, random.set_point.profile,
            random.set_point.level_db);
    };
    std::string other = mismatch("accelerometers of the platform show", platform,
                                 static_cast<double>(shown_.size()), expected_g);
    if (other.empty() && tables > 0)
        other = mismatch("accelerometer of the table shows", table, tables, table_g());
    return other;
}

}  // namespace vibrig::campaign
