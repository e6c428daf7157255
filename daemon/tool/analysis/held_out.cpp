#include "daemon/tool/analysis/held_out.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "daemon/results/text_line.hpp"
#include "daemon/tool/recordings/identified.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/spectrum/profile.hpp"

namespace vibrig::tool {

using namespace estimator::spectrum;
using Eigen::Index;

namespace {

/// That shook as the profile has it: its sine at its level, or at random by its name.
bool under(const Profile& profile, const AtPlatform& vibration, const HeldOut& held) {
    constexpr double kSameShare = 0.02, kSamePower = 1.26;  // 1 dB
    const estimator::DwellRow& row = held.row;
    if (!(row.vibration.kappa > 1)) return false;
    if (!profile.psd.empty()) return row.random && held.kind.profile == profile.name;
    if (row.random) return false;
    const double power = level_moment(row.vibration).trace() / vibration.moment.trace();
    if (!(power < kSamePower && power > 1 / kSamePower)) return false;
    if (profile.sines.size() == 1 && held.kind.bands.size() <= 1)
        return estimator::same_vibration(row.frequency_hz, profile.sines.front().first);
    double all = 0;
    for (const auto& [hz, peak] : profile.sines) all += peak * peak;
    return held.kind.bands.size() == profile.sines.size() &&
           std::ranges::all_of(profile.sines, [&](const auto& sine) {
               return std::ranges::any_of(held.kind.bands, [&](const Band& band) {
                   return estimator::same_vibration(band.hz, sine.first) &&
                          std::abs(band.share - sine.second * sine.second / all) < kSameShare;
               });
           });
}

/// What a fit was made of proves nothing of it. `result`: of vibrig identify --json.
void refuse_fitted(const nlohmann::json& result, const std::vector<HeldOut>& held,
                   const std::string& recording) {
    constexpr double kSameRate = 1e-9;  // deg/h; two dwells differ by their noise
    const auto rows = result.find("dwell_rates");
    if (rows == result.end() || !rows->is_array()) return;
    for (const HeldOut& one : held) {
        for (const auto& fitted : *rows) {
            const auto rate = fitted.find("rate");
            if (rate == fitted.end() || !rate->is_array() || rate->size() != 3) continue;
            bool same = true;
            for (std::size_t j = 0; same && j < 3; ++j)
                same = (*rate)[j].is_number() &&
                       std::abs((*rate)[j].get<double>() - one.row.rate[j]) < kSameRate;
            if (same)
                throw std::runtime_error(
                    recording + ": found run " + std::to_string(one.row.run) + ", position " +
                    std::to_string(one.row.position) +
                    ", with which the result was fitted, expected dwells that it has not seen");
        }
    }
}

}  // namespace

Held held_out(const std::string& recording, const std::string& config, const Profile& profile,
              const AtPlatform& vibration, const nlohmann::json& result) {
    if (profile.axes.stated())
        throw std::runtime_error(
            "--verify: found a profile along several axes, expected one along the vertical: one "
            "shaker shakes along a line");
    if (!profile.psd.empty() && !profile.sines.empty())
        throw std::runtime_error(
            "--verify: found a profile of psd and sines, expected one of them");
    SpectrumRequest request;
    request.held_out = true;
    Identified found = identify_recording(recording, config, request);
    std::erase_if(found.held_out,
                  [&](const HeldOut& one) { return !under(profile, vibration, one); });
    refuse_fitted(result, found.held_out, recording);
    if (found.held_out.empty())
        throw std::runtime_error(
            recording + ": found no dwell " +
            (profile.psd.empty()
                 ? printed("at the profile's frequenc%s and level (%.4g g rms at the platform)",
                           profile.sines.size() > 1 ? "ies" : "y",
                           std::sqrt(vibration.moment.trace()))
                 : "under the profile '" + profile.name + "'") +
            " that can be used, expected one (in a campaign of role \"verify\")");
    Held held;
    held.simulated = found.simulated;
    // Dwells that their own configuration does not fit prove nothing of the result.
    for (const auto& reason : found.assessed.verdict.reasons)
        if (reason.code == "configuration") held.doubt = recording + ": " + reason.text;
    const auto count = static_cast<Index>(found.held_out.size());
    held.rates.resize(count, 3);
    for (Index k = 0; k < count; ++k) {
        const HeldOut& one = found.held_out[static_cast<std::size_t>(k)];
        const estimator::DwellRow& row = one.row;
        // What happened, not what was asked for.
        held.situations.push_back({estimator::mapped(row.angles), level_moment(row.vibration),
                                   row.psd > 0 && !one.kind.bands.empty()
                                       ? one.kind.bands
                                       : bands_of(found.settings, row, vibration.bands),
                                   row.duration_s, true});
        held.rates.row(k) = estimator::mapped(row.rate);
        held.variances.emplace_back(estimator::mapped(row.variance));
        held.relative_errors.push_back(row.relative_error);
        std::array<double, 3> deg{};
        for (std::size_t i = 0; i < 3; ++i) deg[i] = row.angles[i] * estimator::kDegPerRad;
        held.deg.push_back(deg);
    }
    return held;
}

}  // namespace vibrig::tool
