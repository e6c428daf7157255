#pragma once

namespace vibrig::estimator::uncertainty {

/// P(chi-square with `dof` degrees of freedom > x).
[[nodiscard]] double chi_square_tail(double x, double dof);
/// P(F with these degrees of freedom > x); an infinite second is the chi-square over `first`.
[[nodiscard]] double f_tail(double x, double first, double second);
/// t with P(|Student's t| <= t) = coverage; an infinite `dof` is the normal distribution.
[[nodiscard]] double student_quantile(double coverage, double dof);

}  // namespace vibrig::estimator::uncertainty
