#include "daemon/interlock/random_witness.hpp"

#include <algorithm>
#include <cmath>

namespace vibrig::rt {

using drivers::Channel;
using drivers::Quality;

namespace {

constexpr double kLeastTilt_s = 2, kMostTilt_s = 60;
/// Six standard deviations of the mean over 2 tau n' values are rms 6 / sqrt(2 tau n') = 0.375 g.
constexpr double kSigmas = 6 / 0.375;

RandomBands::Settings bands(double sample_hz, double bandwidth_hz) {
    return {sample_hz, bandwidth_hz, 1};
}

}  // namespace

RandomWitness::RandomWitness(const Settings& s)
    : settings_(s),
      independent_hz_(std::min(s.sample_hz, 2 * s.platform_bandwidth_hz)),
      platform_(bands(s.sample_hz, s.platform_bandwidth_hz)),
      table_(bands(s.sample_hz, s.table_bandwidth_hz)) {
    begin();
}

void RandomWitness::begin() noexcept {
    for (RandomBands* each : {&platform_, &table_}) {
        each->begin();
        each->watch_below(false);
    }
}

RandomWitness::Verdict RandomWitness::add(const drivers::Sample& sample,
                                          const Situation& now) noexcept {
    Verdict verdict;
    const Ramp& ramp = now.ramp;
    const double level_g = std::max(ramp.start_g, ramp.target_g);
    if (!(level_g > 0)) return verdict;
    const bool at_level = now.steady && ramp.target_g >= ramp.start_g;
    const auto judge = [&](RandomBands& of, std::size_t place, Channel channel, double value) {
        of.watch_below(at_level);
        const bool wrong = of.add(value / level_g) != RandomBands::Finding::none;
        const double ratio = of.ratio();
        if (ratio > 0) verdict.seen_g[place] = level_g * std::sqrt(ratio);
        if (wrong && !verdict.off_command.wrong)
            verdict.off_command = {true, channel, level_g * std::sqrt(of.judged())};
    };
    const auto& up = ramp.raw_up;
    const double square = up[0] * up[0] + up[1] * up[1] + up[2] * up[2];
    if (sample.force_good() && square > 0) {
        double along = 0;
        for (std::size_t i = 0; i < 3; ++i)
            along += up[i] * (sample.force[i] - settings_.zero_g[i]) / square;
        judge(platform_, 0, Channel::accel_x, (along - 1) / now.transmission);
    }
    if (sample.of(Channel::table_accel) == Quality::good)
        judge(table_, 1, Channel::table_accel, sample.table_accel);
    return verdict;
}

bool RandomWitness::fast() const noexcept {
    const auto quick = [](const RandomBands& of) {
        return of.rules()[1].window_s <= of.rules()[0].window_s;
    };
    return quick(platform_) && quick(table_);
}

std::optional<double> RandomWitness::time_for_tilt_s(double platform_rms_g) const noexcept {
    const double values = std::pow(kSigmas * platform_rms_g, 2);
    const double needed_s = values / (2 * independent_hz_);
    if (!(needed_s <= kMostTilt_s)) return std::nullopt;
    return std::max(kLeastTilt_s, needed_s);
}

}  // namespace vibrig::rt
