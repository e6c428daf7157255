#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "daemon/record/campaign_file.hpp"

namespace vibrig::record {

/// In words, the first number of a recorded dwell, /dwells' row `row` from 0, that a replay gives
/// otherwise, to the last bit; empty: none. When it was done, why it is flagged, and columns that
/// an older recording lacks are not compared.
[[nodiscard]] std::string dwell_difference(std::size_t row, const Dwell& was, const Dwell& is);

/// Likewise of a finished campaign that has other than the `replayed` dwells.
[[nodiscard]] std::string row_difference(const Campaign& campaign, std::size_t replayed);

/// Likewise a level in /orders that no row of /conditions has while its dwell went on. The result
/// of a joint identification depends on no level, so that no other number shows a changed one.
[[nodiscard]] std::string level_difference(const Campaign& campaign,
                                           const std::vector<RecordedDwell>& dwells);

/// The rows of /estimates against a replay of their dwells. Of which sample a row was is not
/// recorded, since the recorder looked while the filter worked: it has to be the state after one of
/// them.
class EstimatesAgain {
  public:
    /// `dwells` are replayed; rows beside them are not compared.
    EstimatesAgain(const Campaign& campaign, const std::vector<RecordedDwell>& dwells);

    /// There is something to compare.
    [[nodiscard]] bool wanted() const { return !rows_.empty(); }
    /// After a sample of a dwell, or after its end: in the order of time.
    void see(drivers::Time time, const estimator::Estimate& estimate);
    /// Nothing comes any more.
    void end();

    [[nodiscard]] std::size_t compared() const { return compared_; }
    [[nodiscard]] std::size_t different() const { return different_; }
    [[nodiscard]] const std::string& first_difference() const { return first_difference_; }

  private:
    struct Times {
        drivers::Time from = 0, to = 0;
    };
    struct Seen {
        EstimateRow state;
        std::uint64_t print = 0;
    };
    [[nodiscard]] bool any() const { return next_ < rows_.size(); }  ///< to be looked at
    void look_at_next();

    const std::vector<EstimateRow>& rows_;
    std::vector<Times> dwells_;
    std::deque<Seen> again_;             ///< around the next row
    std::vector<std::uint64_t> prints_;  ///< of all states
    /// Rows that are none of those around them, each with what it is most like.
    std::vector<std::pair<std::size_t, EstimateRow>> strange_;
    std::size_t next_ = 0, compared_ = 0, different_ = 0;
    std::string first_difference_;
};

}  // namespace vibrig::record
