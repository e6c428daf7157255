#include "estimator/uncertainty/budget.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/linear_algebra.hpp"
#include "estimator/uncertainty/breaks.hpp"
#include "estimator/uncertainty/inputs_check.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::array<const char*, 3> kGimbal{"outer", "inner", "azimuth"};
constexpr std::array<const char*, 3> kAxis{"x", "y", "z"};
constexpr std::array<const char*, 6> kCross{"xy", "xz", "yx", "yz", "zx", "zy"};
constexpr std::array<const char*, 2> kSkew{"outer-inner", "inner-azimuth"};
constexpr std::array<const char*, 2> kLevel{"north", "east"};

/// The steps of differences, in SI units: where the model is linear to many digits.
constexpr double kAngleStep = 60 * kRadPerArcsec, kShareStep = 1e-3;

using Set = std::function<void(Disturbance&, double)>;

/// Calls each(input, element, declared, unit in SI, step in SI, set, with_next) for all inputs that
/// act through a signature of the forward model.
template <class Each>
void each_input(const Inputs& in, const Each& each) {
    const auto one = [&](const char* key, std::string element, const Declared& d, double unit,
                         double step, const Set& set) {
        each(key, std::move(element), d, unit, step, set, false);
    };
    one("latitude", "", in.latitude_arcsec, kRadPerArcsec, kAngleStep,
        [](Disturbance& d, double x) { d.latitude_rad = x; });
    one("azimuth", "", in.azimuth_arcsec, kRadPerArcsec, kAngleStep,
        [](Disturbance& d, double x) { d.azimuth_rad = x; });
    for (std::size_t k = 0; k < 3; ++k)
        one("encoder_zero", kGimbal[k], in.encoder_zero_arcsec[k], kRadPerArcsec, kAngleStep,
            [k](Disturbance& d, double x) { d.encoder_zero_rad[k] = x; });
    for (std::size_t k = 0; k < 2; ++k)
        one("non_orthogonality", kSkew[k], in.non_orthogonality_arcsec[k], kRadPerArcsec,
            kAngleStep, [k](Disturbance& d, double x) { d.non_orthogonality_rad[k] = x; });
    for (const Harmonic& harmonic : in.resolver_harmonics) {
        const Declared phase{harmonic.arcsec / std::sqrt(2.0), Shape::arcsine,
                             std::numeric_limits<double>::infinity(),
                             in.resolver_harmonics_declared};
        for (std::size_t k = 0; k < 3; ++k) {
            for (std::size_t part = 0; part < 2; ++part) {
                each(
                    "resolver_harmonics",
                    std::to_string(harmonic.order) + " per turn, " + kGimbal[k] +
                        (part == 0 ? ", cosine" : ", sine"),
                    phase, kRadPerArcsec, kRadPerArcsec,
                    [order = harmonic.order, k, part](Disturbance& d, double x) {
                        d.resolver_rad(order, k, part) = x;
                    },
                    part == 0);
            }
        }
    }
    one("time_base", "", in.time_base, 1, kShareStep,
        [](Disturbance& d, double x) { d.time_base = x; });
    one("accelerometer_gain", "", in.accelerometer_gain, 1, kShareStep,
        [](Disturbance& d, double x) { d.accelerometer_gain = x; });
    for (std::size_t k = 0; k < 3; ++k)
        one("accelerometer_zero_g", kAxis[k], in.accelerometer_zero_g[k], 1, kShareStep,
            [k](Disturbance& d, double x) { d.accelerometer_zero_g[k] = x; });
    for (std::size_t k = 0; k < 6; ++k)
        one("accelerometer_cross", kCross[k], in.accelerometer_cross[k], 1, kShareStep,
            [k](Disturbance& d, double x) { d.accelerometer_cross[k] = x; });
    for (std::size_t k = 0; k < 2; ++k)
        one("cross_axis", kLevel[k], in.cross_axis[k], 1, kShareStep,
            [k](Disturbance& d, double x) { (k == 0 ? d.cross_north : d.cross_east) = x; });
}

void append(InputSignatures& to, InputSignature input, const VectorXd& rates) {
    to.list.push_back(std::move(input));
    to.rates.conservativeResize(rates.size(), to.rates.cols() + 1);
    to.rates.rightCols<1>() = rates;
}

/// A step of the bias of each gyro, about its mean, where the power may have been cut. Who declares
/// one says that it may go with the run, unless it is stated not to.
void add_run_steps(const Inputs& inputs, Drift drift, const DwellTable& table,
                   InputSignatures& to) {
    if (!(inputs.bias_step_between_runs.u > 0)) return;
    if (drift.power == Power::unknown) drift.power = Power::per_run;
    for (const std::size_t after : breaks_of(table, drift)) {
        VectorXd z = VectorXd::Zero(table.dwells());
        z.tail(table.dwells() - static_cast<Index>(after)).setOnes();
        z.array() -= z.mean();
        for (std::size_t j = 0; j < 3; ++j) {
            VectorXd rates = VectorXd::Zero(3 * table.dwells());
            for (Index r = 0; r < table.dwells(); ++r) rates[3 * r + static_cast<Index>(j)] = z[r];
            append(to,
                   {"bias_step_between_runs",
                    "after dwell " + std::to_string(after) + ", " + kAxis[j],
                    inputs.bias_step_between_runs,
                    false,
                    {}},
                   rates);
        }
    }
}

std::string joined(const std::string& input, const std::string& element) {
    return element.empty() ? input : input + "." + element;
}

}  // namespace

std::string InputSignature::name() const { return joined(input, element); }

InputSignatures input_signatures(const Inputs& inputs, const Drift& drift, const DwellTable& table,
                                 const ForwardModel& model) {
    InputSignatures out{{}, MatrixXd(3 * table.dwells(), 0)};
    each_input(inputs, [&](const char* key, std::string element, const Declared& declared,
                           double unit, double step, const Set& set, bool with_next) {
        if (!(declared.u > 0)) return;
        append(out,
               {key, std::move(element), declared, with_next,
                [set, unit](Disturbance& d, double x) { set(d, unit * x); }},
               unit * signature(table, model, set, step));
    });
    add_run_steps(inputs, drift, table, out);
    return out;
}

void add_skew(const DwellTable& table, const ForwardModel& model, InputSignatures& to) {
    double error = 0;
    for (const DwellRow& row : table.rows)
        if (!row.random) error = std::max(error, row.relative_error);
    if (!(error > 0)) return;
    // The moment goes with the square of the gain, by which the forward model has it.
    const Set set = [](Disturbance& d, double x) { d.accelerometer_gain = x / 2; };
    append(to, {"accelerometer_skew", "", Declared{error}, false, set},
           signature(table, model, set, kShareStep));
}

MatrixXd input_covariance(const Inputs& inputs, const std::vector<InputSignature>& list) {
    const auto n = static_cast<Index>(list.size());
    MatrixXd u = MatrixXd::Zero(n, n);
    for (Index i = 0; i < n; ++i) {
        const double sigma = list[static_cast<std::size_t>(i)].declared.u;
        u(i, i) = sigma * sigma;
    }
    const auto find = [&](const std::string& name) {
        const auto at = std::find_if(list.begin(), list.end(),
                                     [&](const InputSignature& one) { return one.name() == name; });
        return at == list.end() ? Index{-1} : static_cast<Index>(at - list.begin());
    };
    for (const Correlation& c : inputs.correlations) {
        const Index a = find(c.first), b = find(c.second);
        if (a < 0 || b < 0 || a == b) continue;  // one of them is certain
        u(a, b) = u(b, a) = c.value * std::sqrt(u(a, a) * u(b, b));
    }
    return u;
}

std::vector<Correlated> correlated(const MatrixXd& covariance) {
    std::vector<Correlated> list;
    for (Index a = 0; a < covariance.rows(); ++a) {
        for (Index b = a + 1; b < covariance.cols(); ++b) {
            if (covariance(a, b) == 0) continue;
            list.push_back({static_cast<std::size_t>(a), static_cast<std::size_t>(b),
                            covariance(a, b) / std::sqrt(covariance(a, a) * covariance(b, b))});
        }
    }
    return list;
}

void check(const Inputs& inputs) {
    std::vector<std::string> names;
    each_input(inputs, [&](const char* key, const std::string& element, const Declared& declared,
                           double, double, const Set&, bool) {
        names.push_back(joined(key, element));
        if (!std::isfinite(declared.u) || declared.u < 0)
            throw SettingsError("uncertainty." + names.back() + ": found " +
                                std::to_string(declared.u) + ", expected a number from 0 on");
    });
    const auto n = static_cast<Index>(names.size());
    MatrixXd r = MatrixXd::Identity(n, n);
    std::set<std::pair<Index, Index>> pairs;
    for (const Correlation& c : inputs.correlations) {
        const auto at = [&](const std::string& name) {
            const auto found = std::find(names.begin(), names.end(), name);
            if (found == names.end())
                throw SettingsError("uncertainty.correlation: found '" + name +
                                    "', expected an input such as latitude, azimuth or "
                                    "encoder_zero.inner");
            return static_cast<Index>(found - names.begin());
        };
        const Index a = at(c.first), b = at(c.second);
        if (a == b || !(std::abs(c.value) <= 1))
            throw SettingsError("uncertainty.correlation: found " + std::to_string(c.value) +
                                " of '" + c.first + "' with '" + c.second +
                                "', expected two inputs and a number from -1 to 1");
        if (!pairs.insert(std::minmax(a, b)).second)
            throw SettingsError("uncertainty.correlation: found '" + c.first + "' with '" +
                                c.second + "' twice, expected each pair once");
        r(a, b) = r(b, a) = c.value;
    }
    const double least = linear_algebra::symmetric_eigenvalues(r)[0];
    if (least < -1e-12)
        throw SettingsError(
            "uncertainty.correlation: found correlations that exclude one another "
            "(smallest eigenvalue " +
            std::to_string(least) + "), expected a positive semidefinite matrix");
}

}  // namespace vibrig::estimator::uncertainty
