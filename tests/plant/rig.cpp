#include "tests/plant/rig.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "tests/plant/faults.hpp"

namespace vibrig::plant {
namespace {

constexpr double kDegPerRad = 180 / std::numbers::pi;
constexpr double kNowhereDeg = 0.02;  // two counts of the command

/// What is more than a sum over the vibration's sines needs short steps.
bool finely(const Truth& truth) noexcept {
    return truth.elastic_share != Vec3{} || !truth.profiles.empty() ||
           truth.accelerometer_bandwidth_hz > 0 || truth.accelerometer_skew_ms > 0;
}

/// So many dB more with each octave; the level is the controller's.
ShakerProfile tilted(ShakerProfile profile, double decibels) {
    const double from = profile.psd.front().first;
    for (auto& [hz, density] : profile.psd)
        density *= std::pow(10, decibels / 10 * std::log2(hz / from));
    return profile;
}

}  // namespace

Rig::Rig(const Truth& truth)
    : truth_(truth),
      tick_us_(std::llround(1e6 / truth.sample_rate_hz)),
      tick_s_(1e-6 * static_cast<double>(tick_us_)),
      passing_s_(tick_s_ / (1 + truth.time_base)),
      steps_((finely(truth) ? 8 : 2) * static_cast<std::size_t>(std::ceil(1e3 * tick_s_ - 1e-9))),
      platform_(truth),
      gimbals_(truth.slew_deg_per_s, truth.stuck_gimbal,
               {truth.encoder_zero_deg, truth.soft_stop_deg}),
      isolator_(truth.hard ? Isolator::hard(passing_s_ / static_cast<double>(steps_))
                           : Isolator(truth.transmission, truth.frequency_hz, truth.damping,
                                      passing_s_ / static_cast<double>(steps_))),
      random_drive_(truth.seed, passing_s_ / static_cast<double>(steps_)),
      shaker_(truth.limit_g, truth.limit_mm, truth.profiles),
      sensors_(truth, truth.seed),
      increments_(truth, tick_us_),
      drift_(truth),
      gyro_noise_(truth.seed, 0),
      slew_noise_(truth.seed, 7),
      played_(steps_ + 1),
      shakes_(steps_ + 1),
      felt_(steps_ + 1) {
    if (truth.accelerometer_bandwidth_hz > 0)
        band_.emplace(truth.accelerometer_bandwidth_hz, truth.accelerometer_order,
                      passing_s_ / static_cast<double>(steps_));
    shaker_.lie(truth.shaker_lies);
    read();
}

bool Rig::ready() const noexcept {
    return tick_s_ * static_cast<double>(tick_) >= truth_.warm_up_s;
}
bool Rig::gyros_at_speed() const noexcept {
    return tick_s_ * static_cast<double>(tick_) >= 0.5 * truth_.warm_up_s;
}

Vec3 Rig::encoder_deg() const noexcept {
    Vec3 encoder{};
    for (std::size_t i = 0; i < 3; ++i) {
        encoder[i] = truth_.encoder_sign[i] * platform_.angles()[i] * kDegPerRad +
                     truth_.encoder_zero_deg[i];
    }
    return encoder;
}

void Rig::slew_to(const Vec3& command_deg, GimbalMode mode) {
    Vec3 encoder_deg{};
    for (std::size_t i = 0; i < 3; ++i) {
        const auto gimbal = static_cast<std::size_t>(truth_.command_channel[i]);
        encoder_deg[gimbal] = command_deg[i] + truth_.command_offset_deg[gimbal];
    }
    // A command said again is the same slew.
    const bool caged = gimbals_.mode() != GimbalMode::free_drift;
    if (encoder_deg != commanded_deg_ || !caged) {
        const Vec3 here = this->encoder_deg();
        for (std::size_t i = 0; i < 3; ++i) {
            const double error = truth_.slew_error_deg * slew_noise_.normal();
            const double gap = std::abs(std::remainder(encoder_deg[i] - here[i], 360.0));
            // An axis that need not move ends where it is.
            if (caged && encoder_deg[i] == commanded_deg_[i]) continue;
            slew_error_deg_[i] = gap > kNowhereDeg ? error : 0;
        }
    }
    commanded_deg_ = encoder_deg;
    gimbals_.slew_to(encoder_deg + slew_error_deg_, mode);
}

void Rig::release() noexcept {
    if (gimbals_.mode() != GimbalMode::free_drift) drift_.begin_dwell();
    gimbals_.release();
}

void Rig::advance() {
    ++tick_;
    drift_.advance(passing_s_);
    if (!drift_.constant()) platform_.set_coefficients(drift_.coefficients());
    vibrate();
    const Vec3 before = platform_.angles();
    move();
    if (gimbals_.mode() == GimbalMode::calibrate) {
        increments_.advance(time_us(), {before, platform_.angles()}, platform_, shakes_);
    } else {
        increments_.stop();
    }
    read();
}

double Rig::table_g() const noexcept {
    return shaker_.amplitude_g() * (1 + truth_.amplitude_drift_per_h * shaking_s_ / 3600);
}

void Rig::vibrate() {
    const double begin = table_g();
    shaker_.advance(tick_s_);
    shaking_s_ = shaker_.at_rest() ? 0 : shaking_s_ + passing_s_;
    const double end = table_g();
    if (const ShakerProfile* profile = shaker_.played())
        return vibrate_at_random(*profile, begin, end);
    if (shaped_ != nullptr) frequency_hz_ = 0;  // a sine begins anew
    shaped_ = nullptr;
    const double before_hz = std::exchange(frequency_hz_, shaker_.table_hz());
    if (shaker_.sweeps() && before_hz != 0) {
        isolator_.retune((before_hz + frequency_hz_) / 2);
    } else if (frequency_hz_ != before_hz) {
        const auto [share, hz] = distorted_;
        const double second = truth_.second_harmonic + (Fault::at(hz, frequency_hz_) ? share : 0);
        isolator_.set_drive(frequency_hz_, {second, truth_.third_harmonic, truth_.fourth_harmonic,
                                            truth_.fifth_harmonic});
    }
    if (truth_.frequency_drift_hz_per_h != 0)
        isolator_.retune(frequency_hz_ + truth_.frequency_drift_hz_per_h * shaking_s_ / 3600);
    still_ = begin == 0 && end == 0 && isolator_.at_rest();
    if (still_) {
        std::ranges::fill(shakes_, Shake{});
        return;
    }
    shakes_[0] = isolator_.shake();
    const double slope = (end - begin) / static_cast<double>(steps_);
    isolator_.advance(begin, slope, std::span(shakes_).subspan(1));
}

void Rig::vibrate_at_random(const ShakerProfile& profile, double begin_g, double end_g) {
    if (shaped_ != &profile) {
        shaped_ = &profile;
        random_drive_.shape(tilted(profile, shaker_.profile_tilted()));
        heard_ = false;
        played_.assign(played_.size(), {});
    }
    still_ = begin_g == 0 && end_g == 0 && isolator_.at_rest();
    if (still_) {
        std::ranges::fill(shakes_, Shake{});
        std::ranges::fill(played_, Shake{});
        return;
    }
    // The controller's PSD is of the time at level.
    const bool at_level = shaker_.state() == ShakerState::running;
    if (at_level && !heard_) random_drive_.forget();
    if (!at_level && heard_) shaker_.measured(random_drive_.heard(), random_drive_.line_hz());
    heard_ = at_level;
    played_.front() = played_.back();
    const std::span<Shake> next = std::span(played_).subspan(1);
    random_drive_.next(next);
    double mean_square = 0;
    for (std::size_t i = 0; i < next.size(); ++i) {
        const double part = static_cast<double>(i + 1) / static_cast<double>(next.size());
        const double rms = begin_g + part * (end_g - begin_g);
        mean_square += next[i].in_phase * next[i].in_phase / static_cast<double>(next.size());
        next[i] = {rms * next[i].in_phase, rms * next[i].quadrature};
    }
    shaker_.felt(mean_square);
    shakes_[0] = isolator_.shake();
    isolator_.follow(played_, std::span(shakes_).subspan(1));
}

void Rig::feel() noexcept {
    if (!band_) {
        const bool late = truth_.latency_s > 0 || truth_.accelerometer_skew_ms > 0;
        if (late) felt_ = shakes_;
        felt_.back() = isolator_.shake();  // with the kick of a slew that ended
    } else if (still_) {
        band_->rest();
        std::ranges::fill(felt_, Shake{});
    } else {
        band_->follow(shakes_, felt_);
    }
}

Shake Rig::felt_before(double seconds) const noexcept {
    const double back = seconds / passing_s_ * static_cast<double>(steps_);
    const std::size_t last = felt_.size() - 1;
    const std::size_t whole = std::min(static_cast<std::size_t>(back), last - 1);
    const double part = back - static_cast<double>(whole);
    const Shake& late = felt_[last - whole];
    const Shake& early = felt_[last - whole - 1];
    return {late.in_phase + part * (early.in_phase - late.in_phase),
            late.quadrature + part * (early.quadrature - late.quadrature)};
}

void Rig::move() {
    // White rate noise: over a tick its integral is a random walk of N deg per root hour, 60 N
    // arcsec per root second.
    const double rate_sigma =
        60 * gyro_noise_times_ * truth_.gyro_random_walk_deg_per_rt_h / std::sqrt(passing_s_);
    const Vec3 noise{gyro_noise_.normal(), gyro_noise_.normal(), gyro_noise_.normal()};
    if (gimbals_.mode() == GimbalMode::free_drift) {
        Vec3 extra = rate_sigma * noise;
        for (std::size_t i = 0; i < 3; ++i) extra[i] += truth_.torquer_scale[i] * torque_[i];
        platform_.advance(passing_s_, std::span(shakes_).first(still_ ? 1 : shakes_.size()), extra);
        return;
    }
    Vec3 encoder = encoder_deg();
    if (!gimbals_.slewing()) return;
    if (gimbals_.advance(passing_s_, encoder)) isolator_.kick(truth_.slew_kick_g);
    Vec3 angles{};
    for (std::size_t i = 0; i < 3; ++i) {
        angles[i] = truth_.encoder_sign[i] *
                    std::remainder(encoder[i] - truth_.encoder_zero_deg[i], 360.0) / kDegPerRad;
    }
    platform_.set_angles(angles);
}

void Rig::read() {
    const Shake now = isolator_.shake();
    Vec3 encoder = encoder_deg();
    const Vec3 rocking = platform_.rocking(now);
    for (std::size_t i = 0; i < 3; ++i)
        encoder[i] += truth_.encoder_sign[i] * rocking[i] * kDegPerRad;
    feel();
    Vec3 force = platform_.force(felt_before(truth_.latency_s), truth_.vibration_gain);
    for (std::size_t i = 1; i < 3 && truth_.accelerometer_skew_ms > 0; ++i) {
        const double late_s = 5e-4 * static_cast<double>(i) * truth_.accelerometer_skew_ms;
        force[i] =
            platform_.force(felt_before(truth_.latency_s + late_s), truth_.vibration_gain)[i];
    }
    readings_ = sensors_.read(
        encoder, force, shaped_ != nullptr ? played_.back().in_phase : isolator_.table_g(table_g()),
        tick_s_ * static_cast<double>(tick_));
    Vec3 shown = readings_.encoder_deg;
    for (std::size_t i = 0; i < 3; ++i)
        if (truth_.angle_unit[i] != AngleUnit::deg)
            shown[i] = std::fmod(shown[i] * per_degree(truth_.angle_unit[i]), 360.0);
    for (std::size_t i = 0; i < 3; ++i)
        readings_.encoder_deg[i] = shown[static_cast<std::size_t>(truth_.channel[i])];
}

}  // namespace vibrig::plant
