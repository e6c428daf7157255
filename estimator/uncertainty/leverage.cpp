#include "estimator/uncertainty/leverage.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/parameters.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

struct Remedy {
    const char *input, *words;
};
constexpr std::array<Remedy, 14> kRemedies{
    {{"noise and drift states", "more dwells, longer ones, or a quieter and warmer gyro"},
     {"latitude", "a surveyed latitude"},
     {"azimuth", "aligning the rig's north axis anew"},
     {"encoder_zero", "levelling the gimbals and setting the encoders' zeros anew"},
     {"non_orthogonality", "measuring the gimbal axes against one another"},
     {"resolver_harmonics", "calibrating the resolvers' errors over a turn"},
     {"time_base", "a better time base"},
     {"accelerometer_gain",
      "calibrating the accelerometers' gain at the vibration's frequency against that for gravity"},
     {"accelerometer_zero_g", "zeroing the accelerometers in place"},
     {"accelerometer_cross", "measuring the accelerometers' axes"},
     {"cross_axis", "accelerometers across the vertical, or a stiffer fixture"},
     {"local_g", "a surveyed local gravity"},
     {"bias_step_between_runs", "the balanced order, or power that is not interrupted"},
     {"sync_motion", "an autocollimator on the platform"}}};

}  // namespace

const char* kind_name(std::size_t kind) noexcept {
    constexpr std::array<const char*, kKinds> kNames{"bias", "linear terms", "squares", "products"};
    return kNames[kind];
}

std::size_t kind_of(std::size_t coefficient) noexcept {
    const std::size_t group = internal_of(coefficient) / kGyros;
    return group == kDt ? 0 : group <= kDo ? 1 : group <= kDoo ? 2 : 3;
}

std::size_t Leverage::strongest() const {
    return static_cast<std::size_t>(std::min_element(without.begin(), without.end()) -
                                    without.begin());
}

std::string Leverage::remedy() const {
    for (const Remedy& one : kRemedies) {
        if (input == one.input) return one.words;
    }
    return "knowing " + input + " better";
}

std::vector<Leverage> leverages(const Assessment& assessed) {
    std::vector<Leverage> list;
    std::vector<std::array<double, kKinds>> ratio_sums;
    std::array<double, kKinds> count{};
    for (std::size_t i = 0; i < kParameters; ++i) {
        const Coefficient& c = assessed.coefficients[i];
        if (!(c.u > 0)) continue;
        count[kind_of(i)] += 1;
        for (const Contribution& part : c.budget) {
            auto at = std::find_if(list.begin(), list.end(),
                                   [&](const Leverage& l) { return l.input == part.input; });
            if (at == list.end()) {
                list.push_back({part.input, part.declared, 0, {}});
                ratio_sums.push_back({});
                at = list.end() - 1;
            }
            if (part.input != "noise and drift states") at->u = std::max(at->u, part.u);
            ratio_sums[static_cast<std::size_t>(at - list.begin())][kind_of(i)] +=
                (part.contribution * part.contribution + part.with_own + 2 * part.with_others) /
                (c.u * c.u);
        }
    }
    for (std::size_t l = 0; l < list.size(); ++l) {
        for (std::size_t k = 0; k < kKinds; ++k)
            list[l].without[k] =
                count[k] > 0 ? std::sqrt(std::max(0.0, 1 - ratio_sums[l][k] / count[k])) : 1;
    }
    std::stable_sort(list.begin(), list.end(), [](const Leverage& a, const Leverage& b) {
        return a.without[a.strongest()] < b.without[b.strongest()];
    });
    return list;
}

std::string advice(const Leverage& of) {
    const std::size_t kind = of.strongest();
    return text("%s (%s%s) would make U of the %s %.2f times what it is at best",
                of.remedy().c_str(), of.input.c_str(),
                of.declared || of.u == 0 ? "" : ", not declared so far", kind_name(kind),
                of.without[kind]);
}

}  // namespace vibrig::estimator::uncertainty
