#pragma once

#include <memory>

#include "estimator/filter/ud_kernel.hpp"

namespace vibrig::bench {

/// The reference of the filter's benchmark: a textbook covariance filter of 33 states on
/// fixed-size dense Eigen matrices, compiled for this very machine. Plain arrays at its face.
class [[gnu::visibility("default")]] DenseFilter {
  public:
    explicit DenseFilter(double prior_sigma);
    ~DenseFilter();
    DenseFilter(const DenseFilter&) = delete;
    DenseFilter& operator=(const DenseFilter&) = delete;

    void predict(const estimator::UdTransition& transition);
    void update(const double* measured, double variance);
    [[nodiscard]] const double* state() const;  ///< 3 angles, 30 constants
    [[nodiscard]] double sigma(int index) const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vibrig::bench
