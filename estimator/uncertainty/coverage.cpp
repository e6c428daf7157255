#include "estimator/uncertainty/coverage.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/filter/parameters.hpp"
#include "estimator/uncertainty/distributions.hpp"

namespace vibrig::estimator::uncertainty {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// A ramp is stated per so much.
constexpr double kRampSpan_s = 100;

/// Where these terms begin, filter order.
constexpr auto kOfLinear = static_cast<Index>(internal_index(kDi, 0)),
               kOfQuadratic = static_cast<Index>(internal_index(kDii, 0));

void use_again(const Inputs& in, std::size_t internal, double growth, Coefficient& c) {
    const std::size_t group = internal / kGyros;
    // Stays NaN while nobody has said how it repeats. Of quadratic terms nothing can be said: they
    // have it where all others have.
    if (group != kDt && !in.turn_on_linear) return;
    if ((group == kDt || group > kDo) && !in.turn_on_bias) return;
    double square = c.u * c.u;
    if (group == kDt) {
        const Declared seen{std::abs(growth) / 2 / std::sqrt(3.0)};
        for (const Declared& one : {*in.turn_on_bias, in.ramp_in_dwell.value_or(seen)})
            square += one.u * one.u;
    } else if (group <= kDo) {
        square += in.turn_on_linear->u * in.turn_on_linear->u;
    }
    c.u_use = std::sqrt(square);
}

}  // namespace

VectorXd per_gravity(const VectorXd& value) {
    VectorXd out = value;
    out.head(kOfLinear).setZero();
    out.tail(out.size() - kOfQuadratic) *= 2.0;
    return out;
}

MatrixXd unseen_covariance(const Inputs& inputs, const VectorXd& value, double sync_bound) {
    const double u = inputs.local_g.u;
    const VectorXd c = per_gravity(value);
    MatrixXd out = u * u * c * c.transpose();
    if (inputs.sync_motion == SyncMotionOf::platform)
        out.diagonal().tail(out.rows() - kOfQuadratic).array() += sync_bound * sync_bound / 3;
    return out;
}

void add_unseen(const Inputs& inputs, const VectorXd& value, double sync_bound,
                std::size_t internal, std::vector<Contribution>& budget) {
    const auto i = static_cast<Index>(internal);
    const Declared& g = inputs.local_g;
    const double c = per_gravity(value)[i];
    if (g.u > 0)
        budget.push_back({"local_g", "", c, g.u, std::abs(c) * g.u, g.shape, g.dof, g.declared});
    if (inputs.sync_motion == SyncMotionOf::platform && i >= kOfQuadratic)
        budget.push_back({"sync_motion", "", 1, sync_bound / std::sqrt(3.0),
                          sync_bound / std::sqrt(3.0), Shape::rectangular,
                          std::numeric_limits<double>::infinity(), true});
}

void add_correlations(const std::vector<Correlated>& inputs, Coefficient& c) {
    c.correlation = 0;
    for (const Correlated& pair : inputs) {
        Contribution &a = c.budget.at(1 + pair.first), &b = c.budget.at(1 + pair.second);
        const double shared = pair.value * a.sensitivity * a.u * b.sensitivity * b.u;
        const auto half = a.input == b.input ? &Contribution::with_own : &Contribution::with_others;
        a.*half += shared;
        b.*half += shared;
        c.correlation += 2 * shared;
    }
}

double growth_in_dwell(double ramp, std::span<const DwellRow> rows) {
    double sum_s = 0;
    for (const DwellRow& row : rows) sum_s += row.duration_s;
    return rows.empty() ? 0 : ramp * sum_s / static_cast<double>(rows.size()) / kRampSpan_s;
}

void expand(const Inputs& inputs, std::size_t internal, double spare, double growth,
            Coefficient& c) {
    std::stable_sort(c.budget.begin(), c.budget.end(),
                     [](const auto& x, const auto& y) { return x.contribution > y.contribution; });
    const double rho = std::min(1.0, c.noise * c.noise / (c.u_a * c.u_a));
    double inverse = rho * rho / inputs.noise_dof;
    if (rho < 1) inverse += (1 - rho) * (1 - rho) / std::max(spare, 1.0);
    double sum = std::pow(c.u_a, 4) * inverse;
    // Its part of the variance with what it shares: of a pair that cancels nothing is left to vary.
    for (const Contribution& one : c.budget) {
        const double part = one.contribution * one.contribution + one.with_own + one.with_others;
        if (std::isfinite(one.dof)) sum += part * part / one.dof;
    }
    c.nu_eff = sum > 0 ? std::pow(c.u, 4) / sum : std::numeric_limits<double>::infinity();
    c.k = student_quantile(inputs.coverage, std::max(1.0, std::floor(c.nu_eff)));
    c.expanded = c.k * c.u;
    use_again(inputs, internal, growth, c);
}

}  // namespace vibrig::estimator::uncertainty
