#include "daemon/archive/type_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "daemon/archive/vibration.hpp"

namespace vibrig::archive {

namespace {

using estimator::uncertainty::Found;

bool all_determined(const Entry& one) {
    return std::ranges::all_of(one.coefficients,
                               [](const auto& c) { return c && std::isfinite(c->value); });
}

/// The stored correlations with the uncertainties that differ from campaign to campaign.
Found found_of(const Entry& one, bool several_rigs) {
    constexpr auto kSize = static_cast<Eigen::Index>(estimator::kParameters);
    Found out{Eigen::VectorXd(kSize), Eigen::MatrixXd::Zero(kSize, kSize)};
    const bool stored =
        one.covariance.size() == estimator::kParameters * (estimator::kParameters + 1) / 2;
    Eigen::VectorXd u(kSize);
    for (Eigen::Index i = 0; i < kSize; ++i) {
        const Coefficient& c = *one.coefficients[static_cast<std::size_t>(i)];
        out.value(i) = c.value;
        u(i) = several_rigs ? c.u : c.u_a;
    }
    const auto at = [&](Eigen::Index i, Eigen::Index j) {
        return one.covariance[static_cast<std::size_t>(i * (i + 1) / 2 + j)];
    };
    for (Eigen::Index i = 0; i < kSize; ++i) {
        for (Eigen::Index j = 0; j < i && stored; ++j) {
            const double correlation = at(i, j) / std::sqrt(at(i, i) * at(j, j));
            if (std::isfinite(correlation))
                out.covariance(i, j) = out.covariance(j, i) =
                    std::clamp(correlation, -1.0, 1.0) * u(i) * u(j);
        }
        out.covariance(i, i) = u(i) * u(i);
    }
    return out;
}

}  // namespace

TypeCampaigns by_unit(const std::vector<Entry>& campaigns, const std::string& without,
                      bool simulated, const Coefficients& like) {
    TypeCampaigns out;
    std::vector<const Entry*> kept;
    for (const Entry& one : campaigns) {
        if (one.unit_serial.empty() || one.unit_serial == without || one.simulated != simulated)
            continue;
        if (one.verdict == "not valid" || !all_determined(one)) {
            ++out.left_out;
            continue;
        }
        kept.push_back(&one);
    }
    const bool asked = std::ranges::any_of(like, [](const auto& c) { return c.has_value(); });
    if (asked || !kept.empty()) {
        const Coefficients& of = asked ? like : kept.back()->coefficients;
        out.vibration = vibrations_in(of);
        out.of_other_vibration = std::erase_if(
            kept, [&of](const Entry* one) { return !same_vibration(one->coefficients, of); });
    }
    const bool several_rigs =
        std::ranges::any_of(kept, [&](const Entry* one) { return one->rig != kept.front()->rig; });
    std::map<std::string, std::vector<Found>> units;
    for (const Entry* one : kept) units[one->unit_serial].push_back(found_of(*one, several_rigs));
    for (auto& [serial, found] : units) out.units.push_back(std::move(found));
    out.campaigns = kept.size();
    return out;
}

TypeCampaigns campaigns_of_type(Index& index, const std::string& type, const std::string& without,
                                bool simulated, const Coefficients& like,
                                const std::string& folder) {
    Filter filter;
    filter.type = type;
    filter.newest = kNewestOfType;
    const auto newest = index.campaigns(filter);
    if (newest.empty()) return {};
    filter.since_utc_ns = newest.front().started_utc_ns;
    auto found = index.results(filter, true);
    read_vibrations(index, folder, found);
    return by_unit(found, without, simulated, like);
}

}  // namespace vibrig::archive
