#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "daemon/study/study.hpp"
#include "daemon/study/worker.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig::study {

/// What is kept of one coefficient: the budget's estimate, u and expanded u, then what a block
/// drew, less the estimate: mean, u, symmetric and shortest interval. NaN: not determined.
inline constexpr std::size_t kDrawn = 6;
struct BlockNumbers {
    double value, u, expanded;
    std::array<double, kDrawn> drawn;
};
using BlockRecord = std::array<BlockNumbers, estimator::kParameters>;
static_assert(sizeof(BlockRecord) == estimator::kParameters * 9 * sizeof(double));

/// Draws blocks of trials of a recording's inputs: JCGM 101 beside the budget.
class PropagationWorker final : public Worker {
  public:
    explicit PropagationWorker(const Study& study);
    ~PropagationWorker() override;
    /// Throws StudyError if the recording is not what was planned.
    [[nodiscard]] std::string run(std::uint64_t index) override;

  private:
    struct Model;
    const Study& study_;
    std::unique_ptr<Model> model_;
};

/// Takes blocks in their order until they suffice (JCGM 101, 7.9.4 and 8.2), and judges the budget
/// by them.
class PropagationSums {
  public:
    explicit PropagationSums(int digits);
    ~PropagationSums();
    void add(const std::string& bytes);
    /// What a result has of it: trials, coefficients, verdict.
    [[nodiscard]] nlohmann::ordered_json json() const;

  private:
    struct Sums;
    std::unique_ptr<Sums> sums_;
};

}  // namespace vibrig::study
