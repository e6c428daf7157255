#pragma once

#include <array>
#include <string>
#include <vector>

#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::estimator::uncertainty {

/// Bias, linear terms, squares, products.
inline constexpr std::size_t kKinds = 4;
[[nodiscard]] const char* kind_name(std::size_t kind) noexcept;
/// Kind of a coefficient in the order of parameter_names().
[[nodiscard]] std::size_t kind_of(std::size_t coefficient) noexcept;

/// What one part of the budget does to the combined uncertainties.
struct Leverage {
    std::string input;
    bool declared = false;
    double u = 0;  ///< of the input, of its largest element, in the unit of its key
    /// rms over the coefficients of a kind of u without the part, and what is correlated with it,
    /// over u with it; above 1 where its correlations take more off than it adds.
    std::array<double, kKinds> without{1, 1, 1, 1};
    /// The kind that it shrinks most.
    [[nodiscard]] std::size_t strongest() const;
    /// What would have to be done, in words: "calibrating ...".
    [[nodiscard]] std::string remedy() const;
};

/// All parts of the budget, what shrinks a kind most first; noise and drift states among them.
[[nodiscard]] std::vector<Leverage> leverages(const Assessment& assessed);

/// "calibrating the gain ... would make U of the squares 0.75 times what it is".
[[nodiscard]] std::string advice(const Leverage& of);

}  // namespace vibrig::estimator::uncertainty
