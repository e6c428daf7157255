#include "estimator/commissioning/amplitude_unit.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vibrig::estimator::commissioning {

namespace {
constexpr double kDecided = 25;
constexpr double kFits_sigma = 4;
constexpr double kMps2 = 9.80665;
}  // namespace

UnitFinding amplitude_unit(double ratio, double uncertainty) {
    UnitFinding found;
    found.all = {{{"g peak", 1, 0},
                  {"g rms", std::numbers::sqrt2, 0},
                  {"g peak-peak", 0.5, 0},
                  {"m/s2 peak", 1 / kMps2, 0},
                  {"m/s2 rms", std::numbers::sqrt2 / kMps2, 0}}};
    if (!(ratio > 0) || !(uncertainty > 0)) return found;
    const double sigma = std::log1p(uncertainty);  // a factor above and below are as likely
    for (auto& unit : found.all) {
        const double off = std::log(ratio / unit.factor) / sigma;
        unit.ln_ratio = -off * off / 2;
    }
    std::ranges::stable_sort(found.all, std::greater{}, &UnitHypothesis::ln_ratio);
    const double best = found.all[0].ln_ratio;
    for (auto& unit : found.all) unit.ln_ratio -= best;
    found.decided = best >= -kFits_sigma * kFits_sigma / 2 && found.all[1].ln_ratio <= -kDecided;
    return found;
}

}  // namespace vibrig::estimator::commissioning
