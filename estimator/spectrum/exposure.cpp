#include "estimator/spectrum/exposure.hpp"

#include <utility>

namespace vibrig::estimator::spectrum {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::VectorXd;

constexpr std::array<std::pair<Index, Index>, 6> kElements{
    {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};

Exposure::Row elements_of(const Matrix3d& moment) {
    Exposure::Row out;
    for (std::size_t e = 0; e < kElements.size(); ++e)
        out[static_cast<Index>(e)] = moment(kElements[e].first, kElements[e].second);
    return out;
}

/// Q of tr(Q R), from what a gyro's drift gets of each element of R.
Matrix3d quadratic_form(const Exposure::Row& of_elements) {
    Matrix3d q;
    for (std::size_t e = 0; e < kElements.size(); ++e) {
        const auto [a, b] = kElements[e];
        q(a, b) = q(b, a) = of_elements[static_cast<Index>(e)] / (a == b ? 1 : 2);
    }
    return q;
}

}  // namespace

Exposure::Exposure(const Settings& settings, Situation in)
    : in_(std::move(in)), at_(attitude(settings, in_.gimbal_rad, in_.moment)) {
    if (in_.moments.empty()) return;
    for (std::size_t e = 0; e < kElements.size(); ++e) {
        Matrix3d unit = Matrix3d::Zero();
        unit(kElements[e].first, kElements[e].second) = 1;
        unit(kElements[e].second, kElements[e].first) = 1;
        const Attitude seen = attitude(settings, in_.gimbal_rad, unit);
        for (std::size_t j = 0; j < kGyros; ++j)
            of_moment_[j].col(static_cast<Index>(e)) = seen.vibration[j];
    }
}

template <class Weight>
Exposure::Row Exposure::weighed(std::size_t j, const Weight& weight) const {
    if (in_.moments.empty()) {
        double sum = 0;
        for (const Band& band : in_.bands) sum += band.share * weight(band);
        return sum * at_.vibration[j];
    }
    Matrix3d sum = Matrix3d::Zero();
    for (std::size_t b = 0; b < in_.bands.size(); ++b) sum += weight(in_.bands[b]) * in_.moments[b];
    return of_moment_[j] * elements_of(sum);
}

Exposure::Row Exposure::elastic(std::size_t j, const Resonance& of) const {
    return weighed(j, [&](const Band& band) { return in_phase(band.hz, of) - 1; });
}

Exposure::Row Exposure::above(std::size_t j, double hz) const {
    return weighed(j, [hz](const Band& band) { return band.hz > hz ? 1.0 : 0.0; });
}

double Exposure::realisation(std::size_t j, const VectorXd& x,
                             const std::vector<Resonance>& resonances) const {
    if (!(in_.duration_s > 0)) return 0;
    if (!in_.moments.empty()) return along_axes(j, x, resonances);
    const double still = at_.vibration[j].dot(x.head<kElastic>());
    std::vector<double> elastic;
    for (std::size_t r = 0; r < resonances.size(); ++r)
        elastic.push_back(
            at_.vibration[j].dot(x.segment<kElastic>(kElastic * (static_cast<Index>(r) + 1))));
    std::vector<double> drifts;
    double mean = 0;
    for (const Band& band : in_.bands) {
        double drift = still;
        for (std::size_t r = 0; r < elastic.size(); ++r)
            drift += elastic[r] * (in_phase(band.hz, resonances[r]) - 1);
        drifts.push_back(drift);
        mean += band.share * drift;
    }
    double sum = 0;
    for (std::size_t b = 0; b < drifts.size(); ++b) {
        const Band& band = in_.bands[b];
        if (!(band.width_hz > 0)) continue;
        // Of a realised mean square only how it lies over the bands varies.
        const double varies = drifts[b] - (in_.realised ? mean : 0);
        sum += varies * varies * band.share * band.share / (band.width_hz * in_.duration_s);
    }
    return sum;
}

double Exposure::along_axes(std::size_t j, const VectorXd& x,
                            const std::vector<Resonance>& resonances) const {
    std::vector<Matrix3d> q;
    for (Index r = 0; r <= static_cast<Index>(resonances.size()); ++r)
        q.push_back(quadratic_form(of_moment_[j].transpose() * x.segment<kElastic>(kElastic * r)));
    double sum = 0;
    for (std::size_t b = 0; b < in_.bands.size(); ++b) {
        const Band& band = in_.bands[b];
        if (!(band.width_hz > 0)) continue;
        Matrix3d of_band = q[0];
        for (std::size_t r = 0; r < resonances.size(); ++r)
            of_band += (in_phase(band.hz, resonances[r]) - 1) * q[r + 1];
        const Matrix3d drift = of_band * in_.moments[b];
        sum += (drift * drift).trace() / (band.width_hz * in_.duration_s);
    }
    return sum;
}

}  // namespace vibrig::estimator::spectrum
