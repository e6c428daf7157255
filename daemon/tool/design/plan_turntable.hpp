#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "estimator/plan/evaluation.hpp"

namespace vibrig::tool::planner {

/// A test on a turntable or centrifuge: inputs along directions on one or several spheres.
struct TurntableRequest {
    std::vector<double> spheres{1, 2};  ///< |x|: g, deg/s ..., above 0
    std::string allocation = "free";    ///< or "both", "split-68", "split-86" of [6]8 + [8]6
    std::size_t runs = 0;               ///< of a free one; 0: twice as many as coefficients
    std::vector<std::string> without;   ///< terms the model has not
    std::uint64_t seed = 1;
};

struct TurntableRun {
    estimator::plan::Vec3 input{};
    double radius = 1;
    std::size_t count = 1;
};

/// The same runs with the outer sphere r times the inner one.
struct Growth {
    double r = 1;
    double log10_det = 0;  ///< of the information, unit noise
};

struct TurntablePlan {
    TurntableRequest request;
    std::vector<TurntableRun> runs;  ///< inner sphere first
    estimator::plan::Evaluation evaluation;
    double d_efficiency = 0, bound = 0;
    std::vector<std::pair<double, double>> optimal_shares;  ///< sphere, share of the runs
    std::vector<Growth> growth;                             ///< two spheres only
    double growth_exponent = 0;                             ///< of det M in r, for large r
    std::string refusal;                                    ///< empty: everything is determined
    [[nodiscard]] std::size_t run_count() const;
};

/// Throws std::runtime_error for bad input.
[[nodiscard]] TurntablePlan turntable_plan(const TurntableRequest& request);
[[nodiscard]] std::string turntable_json(const TurntablePlan& plan);
[[nodiscard]] std::string turntable_table(const TurntablePlan& plan);
/// One line a run, with an empty column y: what `vibrig calibrate` reads once it is filled in.
[[nodiscard]] std::string turntable_csv(const TurntablePlan& plan);

}  // namespace vibrig::tool::planner
