#pragma once

#include <cstddef>
#include <span>
#include <stdexcept>
#include <vector>

namespace vibrig::estimator::allan {

/// Data that cannot be analysed; the message says what was needed and what was there.
class DataError : public std::invalid_argument {
  public:
    using std::invalid_argument::invalid_argument;
};

/// Phase points [begin, end) without a gap between them.
struct Segment {
    std::size_t begin = 0;
    std::size_t end = 0;
    [[nodiscard]] std::size_t points() const { return end - begin; }
};

/// Phase (for a gyro: angle) at equal steps. A mean rate is removed, which no difference of second
/// order sees, so that long records keep their digits.
struct Series {
    double tau0 = 1.0;          ///< s
    std::vector<double> phase;  ///< rate unit times s; n rates give n + 1 points
    std::vector<Segment> segments;
    std::size_t samples = 0;      ///< what the record should hold
    std::size_t missing = 0;      ///< samples that are not finite
    std::size_t longest_gap = 0;  ///< samples

    /// Not a number (or infinite) means: missing. No difference will span it.
    [[nodiscard]] static Series from_rate(std::span<const double> rate, double tau0);
    [[nodiscard]] static Series from_phase(std::span<const double> phase, double tau0);

    [[nodiscard]] std::size_t rates() const { return phase.empty() ? 0 : phase.size() - 1; }
};

/// What is odd in a record but does not stop the analysis.
struct Inspection {
    std::size_t outliers = 0;       ///< more than 10 median absolute deviations from the median
    std::size_t first_outlier = 0;  ///< index
    double lsb = 0;                 ///< smallest step between values, 0 if all are equal
    bool constant = false;
};

[[nodiscard]] Inspection inspect(std::span<const double> values);
/// Indices of the values that inspect() counts.
[[nodiscard]] std::vector<std::size_t> outliers(std::span<const double> values);

/// Throws DataError when the record is too short or constant, or when more than a tenth is missing.
void require_usable(const Series& series, const Inspection& inspection, double first_value);

}  // namespace vibrig::estimator::allan
