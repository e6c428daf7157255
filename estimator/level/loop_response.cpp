#include "estimator/level/loop_response.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "estimator/filter/angles.hpp"

namespace vibrig::estimator {
namespace {

constexpr double kSearchHz = 0.5;
constexpr std::size_t kFewestReadings = 10;
constexpr Eigen::Index kTable = 3;  ///< column after the three axes

/// constant, cosine, sine by axis; the fourth column is the table's.
struct Fit {
    Eigen::Matrix<double, 3, 4> terms = Eigen::Matrix<double, 3, 4>::Zero();
    double residual = 0;  ///< sum of squares over the three axes

    [[nodiscard]] std::complex<double> phasor(Eigen::Index column) const {
        return {terms(1, column), -terms(2, column)};
    }
};

Eigen::Vector3d basis_at(double time_s, double hz) {
    const double angle = 2 * std::numbers::pi * hz * time_s;
    return {1, std::cos(angle), std::sin(angle)};
}

Fit fit_at(std::span<const LoopReading> readings, double middle_s, double hz) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Matrix<double, 3, 4> right = Eigen::Matrix<double, 3, 4>::Zero();
    double square = 0;
    for (const LoopReading& r : readings) {
        const Eigen::Vector3d basis = basis_at(r.time_s - middle_s, hz);
        const Eigen::RowVector4d value(r.force_g[0], r.force_g[1], r.force_g[2], r.table_g);
        normal += basis * basis.transpose();
        right += basis * value;
        square += value.head<3>().squaredNorm();
    }
    Fit fit;
    fit.terms = normal.ldlt().solve(right);
    fit.residual = square - fit.terms.leftCols<3>().cwiseProduct(right.leftCols<3>()).sum();
    return fit;
}

double best_frequency(std::span<const LoopReading> readings, double middle_s, double span_s,
                      double nominal_hz) {
    const auto left = [&](double hz) { return fit_at(readings, middle_s, hz).residual; };
    // A grid finer than the width of the peak, then golden sections around the best.
    const double step = 1 / (8 * span_s);
    double best = nominal_hz, least = left(nominal_hz);
    for (double off = step; off <= kSearchHz; off += step) {
        for (const double hz : {nominal_hz - off, nominal_hz + off}) {
            if (const double residual = left(hz); residual < least) {
                least = residual;
                best = hz;
            }
        }
    }
    const double golden = std::numbers::phi - 1;
    double low = best - step, high = best + step;
    while (high - low > 1e-6) {
        const double a = high - golden * (high - low), b = low + golden * (high - low);
        (left(a) < left(b) ? high : low) = left(a) < left(b) ? b : a;
    }
    return (low + high) / 2;
}

/// Span of the readings, s; 0: they are too few, or too short.
double span_of(std::span<const LoopReading> readings, double hz) {
    if (readings.size() < kFewestReadings || !(hz > kSearchHz)) return 0;
    const double span_s = readings.back().time_s - readings.front().time_s;
    return span_s * hz >= 1 ? span_s : 0;
}

}  // namespace

LoopResponse loop_response(std::span<const LoopReading> readings, double nominal_hz) {
    const double span_s = span_of(readings, nominal_hz);
    if (span_s == 0) return {};
    const double middle_s = readings.front().time_s + span_s / 2;
    return loop_response_at(readings, best_frequency(readings, middle_s, span_s, nominal_hz));
}

LoopResponse loop_response_at(std::span<const LoopReading> readings, double hz) {
    const double span_s = span_of(readings, hz);
    if (span_s == 0) return {};
    const double middle_s = readings.front().time_s + span_s / 2;
    LoopResponse out;
    out.frequency_hz = hz;
    const Fit fit = fit_at(readings, middle_s, out.frequency_hz);
    const Eigen::Vector3d mean = fit.terms.row(0).head<3>().transpose();
    out.mean_force_g = mean.norm();
    if (!(out.mean_force_g > 0)) return {};
    const Eigen::Vector3d up = mean / out.mean_force_g;
    const Eigen::Vector3cd motion(fit.phasor(0), fit.phasor(1), fit.phasor(2));
    const std::complex<double> along = up.cast<std::complex<double>>().dot(motion);
    out.platform_g = std::abs(along);
    out.cross_share =
        (motion - up.cast<std::complex<double>>() * along).norm() / std::max(out.platform_g, 1e-12);
    double rest = 0, across = 0;
    for (const LoopReading& r : readings) {
        const Eigen::Vector3d basis = basis_at(r.time_s - middle_s, out.frequency_hz);
        const Eigen::Vector3d force(r.force_g[0], r.force_g[1], r.force_g[2]);
        const Eigen::Vector3d left = force - fit.terms.leftCols<3>().transpose() * basis;
        const double off = up.dot(left);
        rest += off * off;
        across += left.squaredNorm() - off * off;
    }
    // Two axes across, three terms each; a sine's amplitude of n readings is known to 2 v/n.
    const auto n = static_cast<double>(readings.size());
    out.cross_sigma =
        std::sqrt(std::max(0.0, across) / (2 * (n - 3)) * 2 / n) / std::max(out.platform_g, 1e-12);
    out.distortion = std::sqrt(2 * rest / n) / std::max(out.platform_g, 1e-12);
    out.table_known = std::ranges::all_of(readings, &LoopReading::table_good);
    if (out.table_known) {
        const std::complex<double> table = fit.phasor(kTable);
        out.table_g = std::abs(table);
        out.phase_deg = std::arg(along * std::conj(table)) * kDegPerRad;
    }
    return out;
}

}  // namespace vibrig::estimator
