#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace vibrig::study {

/// A sum that keeps what rounding takes (Neumaier 1974). In one order it is one number.
class Sum {
  public:
    void add(double x) noexcept;
    [[nodiscard]] double value() const noexcept { return sum_ + lost_; }

  private:
    double sum_ = 0, lost_ = 0;
};

struct Interval {
    double value = 0, low = 0, high = 0;
};

/// All intervals at 95 %.
/// Root of the mean of `n` squares that add up to `sum`, of normal numbers.
[[nodiscard]] Interval rms_interval(double sum, std::uint64_t n);
/// Share of `hits` in `n`, Clopper and Pearson.
[[nodiscard]] Interval share_interval(std::uint64_t hits, std::uint64_t n);
/// Mean of `n` numbers of chi-square with `degrees`, that add up to `sum`; its interval if they
/// are, and the two-sided probability of what is as far off.
struct ChiSquareMean {
    double mean = 0, low = 0, high = 0, p = 0;
};
[[nodiscard]] ChiSquareMean chi_square_mean(double sum, std::uint64_t n, double degrees);
/// Bounds between `bins` bins that are equally likely under chi-square.
[[nodiscard]] std::vector<double> chi_square_bounds(std::size_t bins, double degrees);

/// Error squared in units of its covariance; NaN if that is none.
[[nodiscard]] double nees(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance);

}  // namespace vibrig::study
