#include "estimator/spectrum/table.hpp"

#include <algorithm>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/mapped.hpp"

namespace vibrig::estimator::spectrum {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Eigen::Matrix3d level_moment(const VibrationMoment& vibration) {
    const LevelTensor& g = vibration.gamma;
    Eigen::Matrix3d moment;
    moment << g[0], g[3], g[4], g[3], g[1], g[5], g[4], g[5], g[2];
    return (vibration.kappa - 1) * moment;
}

double Kind::hz() const noexcept {
    if (profile.empty() && !bands.empty())
        return std::ranges::max_element(bands, {}, &Band::share)->hz;
    double sum = 0;
    for (const Band& band : bands) sum += band.share * band.hz;
    return sum;
}

std::vector<Band> bands_of(const Settings& settings, const DwellRow& row,
                           const std::vector<Band>& of_kind) {
    if (of_kind.size() != 1 || row.random) return of_kind;
    const double hz = of_kind.front().hz;
    const AccelerometerResponse& response = settings.accelerometer_response;
    std::vector<Band> out{{hz, 0, 0}};
    double harmonics = 0, all = 0;
    for (std::size_t k = 0; k < row.harmonics.size(); ++k) {
        const double of = static_cast<double>(k + 2) * hz;
        if (row.harmonics[k] > 0) out.push_back({of, row.harmonics[k] / response.power(of), 0});
        harmonics += row.harmonics[k];
    }
    out.front().share = (1 - harmonics) / response.power(hz);
    for (const Band& band : out) all += band.share;
    for (Band& band : out) band.share /= all;
    return out;
}

Attitude attitude(const Settings& settings, const Eigen::Vector3d& gimbal_rad,
                  const Eigen::Matrix3d& moment) {
    const Pose pose = Kinematics(settings).pose(gimbal_rad);
    const DriftModel model(settings);
    const Eigen::Matrix3d seen = pose.level * moment * pose.level.transpose();
    const Regressors all = model.regressors(pose.up, pose.up * pose.up.transpose() + seen);
    const Regressors shaken = model.regressors(pose.up, seen);
    Attitude out;
    for (std::size_t j = 0; j < kGyros; ++j) {
        for (std::size_t g = 0; g < kGroups; ++g) {
            out.base[j][static_cast<Index>(g)] = all[g][j];
            if (g >= kDii) out.vibration[j][static_cast<Index>(g - kDii)] = shaken[g][j];
        }
    }
    return out;
}

SpectralTable::SpectralTable(const Settings& settings, std::vector<SpectralDwell> dwells,
                             std::vector<Kind> kinds)
    : dwells_(std::move(dwells)) {
    std::vector<std::size_t> order;
    for (std::size_t k = 0; k < kinds.size(); ++k) {
        if (std::any_of(dwells_.begin(), dwells_.end(),
                        [k](const SpectralDwell& dwell) { return dwell.kind == k; }))
            order.push_back(k);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return kinds[a].hz() < kinds[b].hz(); });
    std::vector<std::size_t> now(kinds.size(), 0);
    for (std::size_t k = 0; k < order.size(); ++k) {
        now[order[k]] = k;
        kinds_.push_back(kinds[order[k]]);
    }
    const auto n = static_cast<Index>(dwells_.size());
    for (std::size_t j = 0; j < kGyros; ++j) {
        base_[j].resize(n, kBase);
        vibration_[j] = MatrixXd::Zero(n, kElastic);
    }
    for (Index i = 0; i < n; ++i) {
        SpectralDwell& dwell = dwells_[static_cast<std::size_t>(i)];
        if (dwell.kind) dwell.kind = now[*dwell.kind];
        rows_.push_back(dwell.row);
        if (dwell.kind && dwell.bands.empty()) {
            auto bands = bands_of(settings, dwell.row, kinds_[*dwell.kind].bands);
            if (bands.size() > kinds_[*dwell.kind].bands.size()) dwell.bands = std::move(bands);
        }
        const Attitude at =
            attitude(settings, mapped(dwell.row.angles), level_moment(dwell.row.vibration));
        for (std::size_t j = 0; j < kGyros; ++j) {
            base_[j].row(i) = mapped(dwell.row.regressors[j]);
            // What happened, not what was to happen.
            if (dwell.row.random) base_[j].row(i) = at.base[j];
            if (dwell.kind) vibration_[j].row(i) = at.vibration[j];
        }
    }
}

VectorXd SpectralTable::elastic_weights(const Resonance& of) const {
    std::vector<double> kinds;
    for (const Kind& kind : kinds_) kinds.push_back(elastic_weight(kind.bands, of));
    VectorXd out = VectorXd::Zero(dwells());
    for (Index i = 0; i < dwells(); ++i) {
        const SpectralDwell& dwell = dwells_[static_cast<std::size_t>(i)];
        if (dwell.kind)
            out[i] = dwell.bands.empty() ? kinds[*dwell.kind] : elastic_weight(dwell.bands, of);
    }
    return out;
}

MatrixXd SpectralTable::grouped(std::size_t j) const {
    constexpr Index kLinear = kBase - kElastic;
    const Index groups = std::max<Index>(1, static_cast<Index>(kinds_.size()));
    MatrixXd out = MatrixXd::Zero(dwells(), kLinear + kElastic * groups);
    out.leftCols(kLinear) = base_[j].leftCols(kLinear);
    const MatrixXd still = base_[j].rightCols(kElastic) - vibration_[j];
    out.middleCols(kLinear, kElastic) = still;
    for (Index i = 0; i < dwells(); ++i) {
        const auto& kind = dwells_[static_cast<std::size_t>(i)].kind;
        if (!kind) continue;
        out.block(i, kLinear + kElastic * static_cast<Index>(*kind), 1, kElastic) +=
            vibration_[j].row(i);
    }
    return out;
}

std::size_t SpectralTable::dwells_of(std::size_t kind) const {
    return static_cast<std::size_t>(
        std::count_if(dwells_.begin(), dwells_.end(),
                      [kind](const SpectralDwell& dwell) { return dwell.kind == kind; }));
}

}  // namespace vibrig::estimator::spectrum
