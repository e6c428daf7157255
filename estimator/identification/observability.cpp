#include "estimator/identification/observability.hpp"

#include <algorithm>
#include <cmath>

namespace vibrig::estimator {
namespace {

constexpr double kUndeterminedVariance = 0.25;  ///< of the prior variance: half the prior sigma
constexpr double kOneLevel = 0.02;
/// A coefficient whose share in an undetermined direction is below this is determined.
constexpr double kShare = 0.05;

using Vector30 = Eigen::Matrix<double, kParameters, 1>;

Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

void append(Observability& found, Vector30 direction, double least_new_part) noexcept {
    if (found.undetermined == kParameters) return;
    for (std::size_t k = 0; k < found.undetermined; ++k) {
        direction -= found.directions.col(index(k)) * found.directions.col(index(k)).dot(direction);
    }
    const double norm = direction.norm();
    if (!(norm > least_new_part)) return;
    found.directions.col(index(found.undetermined++)) = direction / norm;
}

}  // namespace

void KappaSpread::add(double kappa) noexcept {
    least = dwells == 0 ? kappa : std::min(least, kappa);
    largest = dwells == 0 ? kappa : std::max(largest, kappa);
    ++dwells;
    mean += (kappa - mean) / static_cast<double>(dwells);
}

bool KappaSpread::one_level() const noexcept {
    return dwells > 0 && largest - mean <= kOneLevel * mean && mean - least <= kOneLevel * mean;
}

Observability observability(const Covariance& posterior, const ParameterArray& prior,
                            const KappaSpread& kappa) noexcept {
    Observability found;
    const Eigen::Map<const Vector30> sigma(prior.data());
    if (kappa.one_level()) {
        // |u| = 1: at one kappa (Dt, Dii, Dss, Doo) = (-kappa, 1, 1, 1) has no effect (Tang et al.
        // 2009, eq. 10).
        for (std::size_t gyro = 0; gyro < kGyros; ++gyro) {
            Vector30 v = Vector30::Zero();
            v[index(internal_index(kDt, gyro))] = -kappa.mean;
            for (const std::size_t square : {kDii, kDss, kDoo})
                v[index(internal_index(square, gyro))] = 1.0;
            append(found, v.cwiseQuotient(sigma).normalized(), 0.5);
        }
    }
    const Covariance normalised =
        sigma.cwiseInverse().asDiagonal() * posterior * sigma.cwiseInverse().asDiagonal();
    if (!normalised.allFinite()) {
        found.undetermined = kParameters;
        found.directions.setIdentity();
        return found;
    }
    const auto eigen = linear_algebra::covariance_eigen(normalised);
    for (std::size_t k = kParameters; k-- > 0;) {
        if (!(eigen.values[index(k)] > kUndeterminedVariance)) break;
        append(found, eigen.vectors.col(index(k)), 0.5);
    }
    const auto basis = found.directions.leftCols(index(found.undetermined));
    for (std::size_t i = 0; i < kParameters; ++i) {
        found.observable[i] = found.undetermined == 0 || basis.row(index(i)).norm() < kShare;
    }
    return found;
}

namespace {

/// As many coefficients as undetermined directions, such that fixing them would determine
/// everything; squares along the output axis first, as in Tang et al. 2009, section 2.
std::vector<std::size_t> pivots(const Observability& found) {
    std::vector<std::size_t> preference{kDoo};
    for (std::size_t group = kGroups; group-- > 0;)
        if (group != kDoo) preference.push_back(group);
    std::vector<std::size_t> candidates;
    for (const std::size_t group : preference) {
        for (std::size_t gyro = 0; gyro < kGyros; ++gyro) {
            if (!found.observable[internal_index(group, gyro)])
                candidates.push_back(internal_index(group, gyro));
        }
    }
    Eigen::MatrixXd rows = found.directions.leftCols(index(found.undetermined));
    std::vector<std::size_t> chosen;
    while (chosen.size() < found.undetermined && !candidates.empty()) {
        const auto strong = std::find_if(candidates.begin(), candidates.end(), [&](std::size_t i) {
            return rows.row(index(i)).norm() > 0.1;
        });
        const auto pick =
            strong != candidates.end()
                ? strong
                : std::max_element(candidates.begin(), candidates.end(), [&](auto a, auto b) {
                      return rows.row(index(a)).norm() < rows.row(index(b)).norm();
                  });
        const Eigen::RowVectorXd unit = rows.row(index(*pick)).normalized();
        rows -= (rows * unit.transpose()).eval() * unit;
        chosen.push_back(*pick);
        candidates.erase(pick);
    }
    return chosen;
}

}  // namespace

std::vector<Combination> determined_combinations(const Observability& found,
                                                 const Covariance& posterior,
                                                 const ParameterArray& value,
                                                 const ParameterArray& prior) {
    std::vector<Combination> result;
    if (found.undetermined == 0) return result;
    const std::vector<std::size_t> pivot = pivots(found);
    const auto count = index(pivot.size());
    const Eigen::Map<const Vector30> sigma(prior.data());
    const Eigen::MatrixXd physical =
        sigma.asDiagonal() * found.directions.leftCols(index(found.undetermined));
    Eigen::MatrixXd at_pivots(count, physical.cols());
    for (Eigen::Index k = 0; k < count; ++k)
        at_pivots.row(k) = physical.row(index(pivot[static_cast<std::size_t>(k)]));
    const Eigen::MatrixXd shares =
        linear_algebra::least_squares(at_pivots.transpose(), physical.transpose());

    for (std::size_t name = 0; name < kParameters; ++name) {
        const std::size_t i = internal_of(name);
        if (found.observable[i] || std::find(pivot.begin(), pivot.end(), i) != pivot.end())
            continue;
        const auto share = shares.col(index(i));
        Vector30 w = Vector30::Zero();
        w[index(i)] = 1.0;
        for (Eigen::Index k = 0; k < count; ++k) {
            const std::size_t p = pivot[static_cast<std::size_t>(k)];
            double weight = -share[k];
            // Rounding of the eigenvectors, not information.
            if (std::abs(weight) * prior[p] < 1e-5 * prior[i]) continue;
            if (std::abs(weight - std::round(weight)) < 1e-6 * std::abs(weight))
                weight = std::round(weight);
            w[index(p)] = weight;
        }
        Combination combination;
        const Eigen::Map<const Vector30> x(value.data());
        combination.value = w.dot(x);
        combination.sigma = std::sqrt(w.dot(posterior * w));
        combination.weights.emplace_back(parameter_names()[name], 1.0);
        for (std::size_t other = 0; other < kParameters; ++other) {
            const double weight = w[index(internal_of(other))];
            if (other != name && weight != 0.0)
                combination.weights.emplace_back(parameter_names()[other], weight);
        }
        result.push_back(std::move(combination));
    }
    return result;
}

}  // namespace vibrig::estimator
