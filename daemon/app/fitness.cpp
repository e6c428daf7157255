#include "daemon/app/fitness.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

namespace vibrig {

using drivers::Time;

namespace {
// That make a bus alive.
constexpr std::uint64_t kFramesWithoutTime = 20;
constexpr double kRateTolerance = 0.01, kRateJitter_s = 0.02;
}  // namespace

std::string Fitness::misfit() const {
    const auto misfit = clock_misfit();
    return misfit.empty() ? rate_misfit() : misfit;
}

std::string Fitness::clock_misfit() const {
    const auto view = acquisition_.view();
    if (configuration_.clock == configuration::Configuration::ClockKind::rig)
        return view.rig_ticks == 0 && port_.counters().delivered > kFramesWithoutTime
                   ? "clock.source is \"rig\", but no simulated rig sends its time on the bus: "
                     "vibrig-plant --clock rig, or clock.source = \"real\""
                   : "";
    // Frames of that number may be anybody's on a real bus; with samples they are no matter.
    const bool sampled =
        view.sample.time != 0 && clock_.now() - view.sample.time <= drivers::kSecond;
    return view.foreign_time > 0 && !sampled
               ? "clock.source is \"real\", but a simulated rig that owns the time (RigTime on the "
                 "bus) waits for an answer: vibrig-plant --clock real, or clock.source = \"rig\""
               : "";
}

std::string Fitness::rate_misfit() const {
    const auto view = acquisition_.view();
    const bool sampled =
        view.sample.time != 0 && clock_.now() - view.sample.time <= 2 * drivers::kSecond;
    const auto rate = sampled ? view.rate : rt::RateMeter{};
    const double configured = 1 / drivers::to_seconds(configuration_.assembler.sample_period);
    if (const auto link = port_.state(); link != drivers::PortState::running) {
        const auto& port = configuration_.can;
        return fmt::format("the CAN bus is lost: {}: {}",
                           port.path.empty() ? port.interface : port.path, drivers::name_of(link));
    }
    if (!sampled) return "the rig is silent: no complete sample for 2 s";
    const auto measured = [&rate] {
        return rate.hz() == 0 ? std::string("no sample rate measured yet")
                              : fmt::format("{:.4g} samples/s measured", rate.hz());
    };
    // The ends of what is measured may be late by so much.
    const double tolerance = kRateTolerance + kRateJitter_s / std::max(rate.span_s(), 0.5);
    if (rate.hz() > 0 && std::abs(rate.hz() / configured - 1) <= tolerance) return {};
    return fmt::format("{}, can.sample_rate_hz = {:g}: expected within {:g} %", measured(),
                       configured, 100 * kRateTolerance);
}

std::string Fitness::resume_gate() const {
    const auto view = acquisition_.view();
    const auto& sample = view.sample;
    const Time now = clock_.now();
    if (now - sample.time > drivers::kSecond || !sample.angles_good() || !sample.force_good())
        return "no good sample within the last second";
    if (view.platform.time == 0 || now - view.platform.time > configuration_.gimbal.status_deadline)
        return "no platform status";
    // The shaker rests: the accelerometers see gravity, as they did before.
    constexpr double kGravityTolerance = 0.05;
    double square = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        double force = 0;
        for (std::size_t j = 0; j < 3; ++j) {
            force += configuration_.estimator.accelerometer_matrix[i][j] *
                     (sample.force[j] - configuration_.estimator.accelerometer_zero_g[j]);
        }
        square += force * force;
    }
    if (!(std::abs(std::sqrt(square) - 1) <= kGravityTolerance))
        return fmt::format("specific force {:.3f} g at rest, expected 1 g within {:g} g",
                           std::sqrt(square), kGravityTolerance);
    return {};
}

}  // namespace vibrig
