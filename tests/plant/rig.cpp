#include "tests/plant/rig.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace vibrig::plant {
namespace {

constexpr double kDegPerRad = 180 / std::numbers::pi;
constexpr double kNowhereDeg = 0.02;  // two counts of the command

}  // namespace

Rig::Rig(const Truth& truth)
    : truth_(truth),
      tick_us_(std::llround(1e6 / truth.sample_rate_hz)),
      tick_s_(1e-6 * static_cast<double>(tick_us_)),
      steps_(static_cast<std::size_t>(std::ceil(1e3 * tick_s_ - 1e-9))),
      platform_(truth),
      gimbals_(truth.slew_deg_per_s),
      isolator_(truth.transmission, truth.frequency_hz, truth.damping,
                tick_s_ / static_cast<double>(2 * steps_)),
      shaker_(truth.limit_g, truth.limit_mm),
      sensors_(truth, truth.seed),
      increments_(truth, tick_us_),
      gyro_noise_(truth.seed, 0),
      slew_noise_(truth.seed, 7),
      a1_(2 * steps_ + 1) {
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

void Rig::slew_to(const Vec3& encoder_deg, GimbalMode mode) {
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

void Rig::advance() {
    ++tick_;
    vibrate();
    const Vec3 before = platform_.angles();
    move();
    if (gimbals_.mode() == GimbalMode::calibrate) {
        increments_.advance(time_us(), {before, platform_.angles()}, platform_, a1_);
    } else {
        increments_.stop();
    }
    read();
}

void Rig::vibrate() {
    const double begin = shaker_.amplitude_g();
    shaker_.advance(tick_s_);
    const double end = shaker_.amplitude_g();
    if (shaker_.frequency_hz() != frequency_hz_) {
        frequency_hz_ = shaker_.frequency_hz();
        isolator_.set_drive(frequency_hz_, truth_.second_harmonic);
    }
    still_ = begin == 0 && end == 0 && isolator_.at_rest();
    if (still_) {
        std::ranges::fill(a1_, 0.0);
        return;
    }
    a1_[0] = isolator_.platform_g();
    const double slope = (end - begin) / static_cast<double>(2 * steps_);
    for (std::size_t i = 1; i < a1_.size(); ++i) {
        isolator_.advance(begin + slope * (static_cast<double>(i) - 0.5));
        a1_[i] = isolator_.platform_g();
    }
}

void Rig::move() {
    // White rate noise: over a tick its integral is a random walk of N deg per root hour, 60 N
    // arcsec per root second.
    const double rate_sigma =
        60 * gyro_noise_times_ * truth_.gyro_random_walk_deg_per_rt_h / std::sqrt(tick_s_);
    const Vec3 noise{gyro_noise_.normal(), gyro_noise_.normal(), gyro_noise_.normal()};
    if (gimbals_.mode() == GimbalMode::free_drift) {
        Vec3 extra = rate_sigma * noise;
        for (std::size_t i = 0; i < 3; ++i) extra[i] += truth_.torquer_scale[i] * torque_[i];
        if (still_) {
            const std::array<double, 3> rest{};
            platform_.advance(tick_s_, rest, extra);
        } else {
            platform_.advance(tick_s_ / static_cast<double>(steps_), a1_, extra);
        }
        return;
    }
    Vec3 encoder = encoder_deg();
    if (!gimbals_.slewing()) return;
    if (gimbals_.advance(tick_s_, encoder)) isolator_.kick(truth_.slew_kick_g);
    Vec3 angles{};
    for (std::size_t i = 0; i < 3; ++i) {
        angles[i] = truth_.encoder_sign[i] *
                    std::remainder(encoder[i] - truth_.encoder_zero_deg[i], 360.0) / kDegPerRad;
    }
    platform_.set_angles(angles);
}

void Rig::read() {
    const double a1 = isolator_.platform_g();
    const Vec3 force = (1 + a1) * platform_.up_in_platform();
    readings_ = sensors_.read(encoder_deg(), force, isolator_.table_g(shaker_.amplitude_g()),
                              tick_s_ * static_cast<double>(tick_));
}

}  // namespace vibrig::plant
