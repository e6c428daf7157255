#include "estimator/uncertainty/skew.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <vector>

#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kShaking = 1.07;  ///< kappa; below, the shape is that of a blower's motion
constexpr double kDoubtFrom = 0.3, kNotValidFrom = 2;  ///< u
/// Of a phase's square: what the spread of the dwells about the pattern may do by chance. Spikes
/// spread them unevenly, and few positions stand between two axes.
constexpr double kSigmas = 6;
constexpr int kLeastDegrees = 4;
/// Added to the normal equations: of a pair that no position tells apart nothing is said.
constexpr double kNothingSaid = 1e-4;

struct Pair {
    int a, b;
};
constexpr std::array<Pair, 3> kPairs{{{0, 1}, {0, 2}, {1, 2}}};

/// Share of the motion across the vertical that is a quarter period apart.
double quadrature(const LevelTensor& gamma) {
    return gamma[0] + gamma[2] - gamma[3] * gamma[3] - gamma[5] * gamma[5];
}

constexpr Index kPatterns = 7;
/// By axes u of the vertical: u_a^2 u_b^2 for each pair. What is late of an axis adds to what the
/// base itself does a quarter period apart, north and east: twice their product is of the first
/// order.
Eigen::Matrix<double, 1, kPatterns> patterns(const Eigen::Matrix3d& level) {
    const auto north = level.col(0), up = level.col(1), east = level.col(2);
    Eigen::Matrix<double, 1, kPatterns> out;
    for (std::size_t p = 0; p < kPairs.size(); ++p)
        out[static_cast<Index>(p)] = std::pow(up[kPairs[p].a] * up[kPairs[p].b], 2);
    out.tail<4>() << up[0] * north[0], up[2] * north[2], up[0] * east[0], up[2] * east[2];
    return out;
}

/// Of sines, each row about the mean of its run: what the base moves by is in that mean.
struct Shapes {
    MatrixXd pattern;  ///< of the pairs, and of what the base's own motion does beside them
    VectorXd quadrature;
    Index runs = 0;
    double hz = 0, declared = 0;  ///< mean frequency; (pi f tau)^2
};

Shapes shapes_of(const Settings& settings, std::span<const DwellRow> rows) {
    const Kinematics kinematics(settings);
    std::map<int, std::vector<const DwellRow*>> runs;
    Index n = 0;
    for (const DwellRow& row : rows) {
        if (row.random || !(row.frequency_hz > 0) || !(row.vibration.kappa > kShaking)) continue;
        runs[row.run].push_back(&row);
        ++n;
    }
    Shapes out{MatrixXd(n, kPatterns), VectorXd(n), static_cast<Index>(runs.size())};
    Index first = 0;
    for (const auto& [run, of] : runs) {
        const auto count = static_cast<Index>(of.size());
        for (Index k = 0; k < count; ++k) {
            const DwellRow& row = *of[static_cast<std::size_t>(k)];
            out.pattern.row(first + k) = patterns(kinematics.pose(mapped(row.angles)).level);
            out.quadrature[first + k] = quadrature(row.vibration.gamma);
            out.hz += row.frequency_hz / static_cast<double>(n);
            out.declared = std::max(out.declared, row.relative_error);
        }
        auto pattern = out.pattern.middleRows(first, count);
        pattern.rowwise() -= Eigen::RowVectorXd(pattern.colwise().mean());
        auto values = out.quadrature.segment(first, count);
        values.array() -= values.mean();
        first += count;
    }
    return out;
}

/// Phases between the readings of the pairs, rad; 0 where there is none for certain.
std::array<double, 3> phases(const Shapes& of) {
    std::array<double, 3> out{};
    const Index degrees = of.quadrature.size() - of.runs - of.pattern.cols();
    if (degrees < kLeastDegrees) return out;
    MatrixXd normal = of.pattern.transpose() * of.pattern;
    normal.diagonal().array() += kNothingSaid;
    const MatrixXd inverse = linear_algebra::positive_inverse(normal);
    const VectorXd square = inverse * (of.pattern.transpose() * of.quadrature);
    const double variance =
        (of.quadrature - of.pattern * square).squaredNorm() / static_cast<double>(degrees);
    for (Index p = 0; p < static_cast<Index>(kPairs.size()); ++p) {
        if (!(square[p] > kSigmas * std::sqrt(variance * inverse(p, p)))) continue;
        // At 45 deg between the two axes the share is tan^2 of half the phase, a quarter of it.
        out[static_cast<std::size_t>(p)] = 2 * std::atan(std::sqrt(square[p] / 4));
    }
    return out;
}

/// Whether a coefficient is that of the product of the two.
bool is_product_of(const Settings& settings, std::size_t gyro, std::size_t group, Pair pair) {
    if (group < kDis) return false;
    const auto& axes = settings.gyro_axes[gyro];
    const int p = axes[kCoefficientTable[group].p].axis, q = axes[kCoefficientTable[group].q].axis;
    return std::min(p, q) == pair.a && std::max(p, q) == pair.b;
}

}  // namespace

std::optional<Reason> accelerometers_apart(const Settings& settings, std::span<const DwellRow> rows,
                                           const Assessment& assessed) {
    const Shapes shapes = shapes_of(settings, rows);
    const std::array<double, 3> phase = phases(shapes);
    const double declared = std::min(2 * std::sqrt(shapes.declared), std::numbers::pi);
    Reason reason{"accelerometer skew", ""};
    reason.largest_effect_u = 0;
    double largest = 0;
    std::size_t worst = 0;
    for (std::size_t p = 0; p < kPairs.size(); ++p) {
        // Readings of two axes see their product as if it were smaller, cos(phase) times.
        const double error = std::cos(declared) - std::cos(phase[p]);
        for (std::size_t i = 0; i < kParameters; ++i) {
            const std::size_t internal = internal_of(i);
            const Coefficient& c = assessed.coefficients[i];
            if (!is_product_of(settings, internal % kGyros, internal / kGyros, kPairs[p]) ||
                !(c.u > 0) || !(error * std::abs(c.value) / c.u > largest))
                continue;
            largest = error * std::abs(c.value) / c.u;
            worst = p;
            reason.coefficient = parameter_names()[i];
        }
    }
    if (!(largest > kDoubtFrom)) return {};
    reason.size = 1e3 * phase[worst] / (2 * std::numbers::pi * shapes.hz);
    reason.unit = "ms";
    reason.largest_effect_u = largest;
    reason.level = largest > kNotValidFrom ? Level::not_valid : Level::doubtful;
    reason.text = text(
        "accelerometers %c and %c show the vibration %.2f ms apart (sampling times of "
        "the axes; accelerometer.skew_ms declares %.3g): %s by %.1f u",
        "xyz"[kPairs[worst].a], "xyz"[kPairs[worst].b], reason.size,
        settings.accelerometer_response.skew_ms, reason.coefficient.c_str(), largest);
    return reason;
}

}  // namespace vibrig::estimator::uncertainty
