#pragma once

#include <array>
#include <optional>
#include <string>

#include "daemon/rt/dwell_order.hpp"
#include "daemon/rt/stage_feed.hpp"
#include "estimator/spectrum/read_sweep.hpp"
#include "estimator/spectrum/sweep_bounds.hpp"

namespace vibrig::campaign {

/// Whether a sweep goes as it was asked for: by what the controller reports of its frequency, and
/// by what the accelerometers make of that. How far it may be off follows from the sweep, the
/// registers and their polling, and what the controller states: estimator::spectrum::SweepBounds.
/// Makes its blocks on the way. Control thread only.
class SweepWatch {
  public:
    /// `at_level`: since when the level is there; `by`: how the controller sweeps, and is read.
    SweepWatch(const estimator::Settings& rig, const rt::DwellOrder& order, drivers::Time at_level,
               const estimator::spectrum::SweptBy& by);

    /// What the controller reports of its frequency. Why that is not what was asked for, else
    /// empty.
    [[nodiscard]] std::string frequency(drivers::Time at, double hz);
    void add(const rt::Motion& sample);

    /// The newest reading gives another frequency than the first one, by more than its register's
    /// step: from here on what the accelerometers show is judged along the sweep, not at its
    /// beginning.
    [[nodiscard]] bool moved() const;
    /// When it began, as far as the newest reading knows; none: it has not yet.
    [[nodiscard]] std::optional<drivers::Time> begun() const;
    [[nodiscard]] double octaves_per_s() const { return octaves_ / of_.seconds; }
    [[nodiscard]] estimator::spectrum::Sweep finish() { return read_.finish(); }
    /// s since the dwell began, and Hz.
    [[nodiscard]] const std::vector<std::array<double, 2>>& readings() const {
        return read_.readings();
    }

  private:
    [[nodiscard]] std::string contradicted();

    estimator::SweptSine of_;
    estimator::spectrum::SweepBounds bounds_;
    double step_hz_;  ///< of the register
    double octaves_;
    drivers::Time from_, at_level_;
    std::array<double, 3> zero_g_;
    estimator::spectrum::ReadSweep read_;
    std::optional<double> began_s_, begins_s_;  ///< by the first reading that moved, by the newest
    std::size_t judged_ = 0;
    int in_a_row_ = 0;  ///< seconds that show another frequency
};

}  // namespace vibrig::campaign
