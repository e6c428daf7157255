#include "estimator/uncertainty/beside_drift.hpp"

#include <algorithm>

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// What is found changes what the biases have done, and that what is found.
constexpr int kRounds = 3;

NullFit fit_with(const DriftingCampaign& campaign, const std::array<DriftAverage, 3>& averages) {
    std::vector<DwellRow> rows(campaign.table.rows.begin(), campaign.table.rows.end());
    MatrixXd all = campaign.declared;
    for (Index j = 0; j < 3; ++j) {
        const auto gyro = static_cast<std::size_t>(j);
        const DriftColumns of = drift_columns(campaign.gyros[gyro], averages[gyro]);
        for (DwellRow& row : rows) row.variance[gyro][gyro] += of.scatter;
        const Index more = of.columns.cols();
        all.conservativeResize(all.rows(), all.cols() + more);
        all.rightCols(more).setZero();
        for (Index k = 0; k < of.columns.rows(); ++k)
            all.row(3 * k + j).tail(more) = of.columns.row(k);
    }
    DwellTable table = campaign.table;
    table.rows = rows;
    return NullFit(table, all, campaign.prior_information, campaign.freed);
}

std::array<DriftAverage, 3> averages_without(const VectorXd& rates,
                                             const DriftingCampaign& campaign) {
    std::array<DriftAverage, 3> out;
    for (std::size_t j = 0; j < kGyros; ++j) {
        GyroRates gyro = campaign.gyros[j];
        for (Index k = 0; k < gyro.dwells(); ++k)
            gyro.rate[k] -= rates[3 * k + static_cast<Index>(j)];
        out[j] = average_drift(gyro, campaign.drift);
    }
    return out;
}

double log_evidence(const std::array<DriftAverage, 3>& averages) {
    double sum = 0;
    for (const DriftAverage& one : averages) sum += one.log_evidence;
    return sum;
}

Evidence weigh(Pattern pattern, const DriftingCampaign& campaign, const ForwardModel& model) {
    const Signatures of = signatures(pattern, campaign.table, model, 1);
    std::array<DriftAverage, 3> averages = campaign.averages;
    Evidence out;
    double occam = 0;
    for (int round = 0; round < kRounds; ++round) {
        const NullFit fit = fit_with(campaign, averages);
        out = weigh(pattern, of, fit);
        occam = log_occam(of, fit, out);
        // Where scatter as large as the pattern makes it explains as much, nothing is to be gained.
        if (!(out.log_odds > 0)) return out;
        averages = averages_without(out.rates, campaign);
    }
    // Of the drifts alone with those beside it; where inputs are declared, no more than beside
    // them.
    const double gained = log_evidence(averages) - log_evidence(campaign.averages);
    out.log_odds = std::min(out.log_odds, gained + occam);
    return out;
}

}  // namespace

std::vector<Evidence> weigh_beside_drift(const DriftingCampaign& campaign,
                                         const ForwardModel& model) {
    std::vector<Evidence> all;
    for (std::size_t i = 0; i < kStructuralNames.size(); ++i)
        all.push_back(weigh(static_cast<Pattern>(i), campaign, model));
    std::stable_sort(all.begin(), all.end(),
                     [](const Evidence& a, const Evidence& b) { return a.log_odds > b.log_odds; });
    return all;
}

}  // namespace vibrig::estimator::uncertainty
