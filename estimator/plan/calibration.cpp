#include "estimator/plan/calibration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <unsupported/Eigen/SpecialFunctions>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/text.hpp"
#include "estimator/plan/algebra.hpp"

namespace vibrig::estimator::plan {

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
// A reading that alone determines a combination has no residual.
constexpr double kMustFit = 1e-6;

bool stated(const std::vector<Reading>& readings) { return readings.front().sigma > 0; }

std::string short_number(double value) { return text("%g", value); }

void check_size(const std::string& place, double value, double largest) {
    if (std::abs(value) <= largest) return;
    throw PlanError(place + ": found " + short_number(value) + ", expected a number from " +
                    short_number(-largest) + " to " + short_number(largest));
}

void check(const std::vector<Reading>& readings, const Terms& terms) {
    const auto needed = static_cast<std::size_t>(std::count(terms.begin(), terms.end(), true));
    if (needed == 0) throw PlanError("found a model without terms, expected one at least");
    if (readings.size() < needed) {
        throw PlanError("found " + std::to_string(readings.size()) + " readings, expected " +
                        std::to_string(needed) + " at least: as many as coefficients");
    }
    for (std::size_t i = 0; i < readings.size(); ++i) {
        const Reading& r = readings[i];
        const std::string place = "reading " + std::to_string(i + 1) + ": ";
        check_size(place + "input", r.input[0], kLargestInput);
        check_size(place + "input", r.input[1], kLargestInput);
        check_size(place + "input", r.input[2], kLargestInput);
        check_size(place + "output", r.output, kLargestOutput);
        if (!(r.sigma >= 0) || !std::isfinite(r.sigma) || (r.sigma > 0) != stated(readings)) {
            throw PlanError(place + "found sigma " + std::to_string(r.sigma) +
                            ", expected all of them above 0, or none");
        }
        // A mean has less than each of its readings.
        if (r.sigma > 0 && !(r.sigma >= kSmallestSigma / std::sqrt(kMostMeant)))
            throw PlanError(place + "found sigma " + short_number(r.sigma) + ", expected " +
                            short_number(kSmallestSigma) + " or more");
        if (!(r.sigma <= kLargestSigma))
            throw PlanError(place + "found sigma " + short_number(r.sigma) + ", expected " +
                            short_number(kLargestSigma) + " or less");
    }
}

/// Columns are divided by the largest: there has to be one.
void check_excited(const Problem& problem) {
    if (rows(problem.points, problem.terms).squaredNorm() > 0) return;
    throw PlanError("found inputs of 0 alone, expected some that excite a term of the model");
}

/// P(chi-square > x).
double chi_square_tail(double x, double degrees) {
    return Eigen::numext::igammac(degrees / 2, std::max(0.0, x) / 2);
}
/// P(F > x).
double f_tail(double x, double numerator, double denominator) {
    return Eigen::numext::betainc(denominator / 2, numerator / 2,
                                  denominator / (denominator + numerator * x));
}

/// Sum of squares about the means of readings at the same input, and its degrees of freedom.
struct PureError {
    double squares = 0;
    std::size_t degrees = 0;
};
PureError pure_error(const std::vector<Reading>& readings) {
    std::map<Vec3, std::vector<double>> at_input;
    for (const Reading& r : readings) at_input[r.input].push_back(r.output);
    PureError out;
    for (const auto& [input, outputs] : at_input) {
        // From the first on: the mean of equal outputs is theirs, without rounding.
        double mean = outputs.front();
        for (const double y : outputs)
            mean += (y - outputs.front()) / static_cast<double>(outputs.size());
        for (const double y : outputs) out.squares += (y - mean) * (y - mean);
        out.degrees += outputs.size() - 1;
    }
    return out;
}

/// The test of `out`, or why there is none.
void test_residuals(const std::vector<Reading>& readings, double squares, SensorCalibration& out) {
    const auto d = static_cast<double>(out.degrees);
    const PureError error = pure_error(readings);
    if (out.degrees == 0) {
        out.untested = "as many readings as coefficients";
    } else if (stated(readings)) {
        out.test = ResidualTest{squares, chi_square_tail(squares, d), d, 0};
    } else if (error.degrees == 0) {
        out.untested = "neither the noise is stated (--sigma) nor is an input repeated";
    } else if (error.degrees >= out.degrees) {
        out.untested = "as many different inputs as coefficients";
    } else if (!(error.squares > 0)) {
        out.untested = text(
            "repeated readings agree exactly, the model leaves %.3g: either they have less noise "
            "than one step of the output, or the model does not hold (state --sigma)",
            std::sqrt(squares / d));
    } else {
        const auto e = static_cast<double>(error.degrees);
        const double lack = d - e;
        const double ratio = std::max(0.0, squares - error.squares) / lack / (error.squares / e);
        out.test = ResidualTest{ratio, f_tail(ratio, lack, e), lack, e};
    }
}

}  // namespace

SensorCalibration calibrate(const std::vector<Reading>& readings, const Terms& terms) {
    check(readings, terms);
    Problem problem;
    problem.terms = terms;
    Vector y(at(readings.size()));
    for (std::size_t i = 0; i < readings.size(); ++i) {
        const double sigma = stated(readings) ? readings[i].sigma : 1;
        problem.points.push_back({turntable_row(readings[i].input), sigma, 1});
        y[at(i)] = readings[i].output / sigma;
    }
    check_excited(problem);
    SensorCalibration out;
    out.plan = evaluate(problem, Effort(readings.size(), 1.0));
    Vector scale;
    const Matrix a = scaled_rows(problem, scale);
    // The least of all solutions where several do as well: what is determined does not depend.
    const auto svd = linear_algebra::right_singular(a);
    const Matrix v = svd.v.leftCols(at(out.plan.rank));
    const Vector inverse = svd.values.head(at(out.plan.rank)).cwiseAbs2().cwiseInverse();
    const Matrix spread = linear_algebra::product(v * inverse.asDiagonal(), v.transpose());
    const Vector x = v * linear_algebra::least_squares(linear_algebra::product(a, v), y);
    const Vector rest = y - a * x;
    out.degrees = readings.size() - out.plan.rank;
    const double squares = rest.squaredNorm();
    const double unit = stated(readings)  ? 1
                        : out.degrees > 0 ? std::sqrt(squares / static_cast<double>(out.degrees))
                                          : kNaN;
    test_residuals(readings, squares, out);
    const Vector leverage = linear_algebra::product(a, spread).cwiseProduct(a).rowwise().sum();
    for (std::size_t i = 0; i < readings.size(); ++i) {
        const double sigma = stated(readings) ? readings[i].sigma : 1;
        const double own = 1 - leverage[at(i)];
        out.residual.push_back(rest[at(i)] * sigma);
        out.standardised.push_back(own > kMustFit ? rest[at(i)] / (unit * std::sqrt(own)) : kNaN);
        out.noise += std::pow(unit * sigma, 2) / static_cast<double>(readings.size());
    }
    out.noise = std::sqrt(out.noise);
    const std::vector<std::size_t> columns = active(terms);
    for (std::size_t k = 0; k < columns.size(); ++k) {
        out.value[columns[k]] = x[at(k)] / scale[at(k)];
        out.sigma[columns[k]] = std::isfinite(out.plan.sigma[columns[k]])
                                    ? unit * std::sqrt(spread(at(k), at(k))) / scale[at(k)]
                                    : out.plan.sigma[columns[k]];
    }
    out.covariance = unit * unit * scale.cwiseInverse().asDiagonal() * spread *
                     scale.cwiseInverse().asDiagonal();
    if (!out.plan.identifies_all()) out.covariance.setConstant(kNaN);
    return out;
}

}  // namespace vibrig::estimator::plan
