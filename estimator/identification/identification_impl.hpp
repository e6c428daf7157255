#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "estimator/filter/drift_filter.hpp"
#include "estimator/identification/batch_solver.hpp"
#include "estimator/identification/dwell_buffer.hpp"
#include "estimator/identification/dwell_record.hpp"
#include "estimator/identification/observability.hpp"
#include "estimator/identification/result.hpp"
#include "estimator/identification/two_step.hpp"
#include "estimator/level/growing_tensor.hpp"
#include "estimator/level/harmonics.hpp"
#include "estimator/level/paper_level.hpp"
#include "estimator/level/saturation_detector.hpp"
#include "estimator/level/stuck_detector.hpp"
#include "estimator/level/sync_motion.hpp"
#include "estimator/level/vibration_level.hpp"

namespace vibrig::estimator {

/// A filter and the runs it has seen: one for all runs of the joint method, one per run of the
/// two-step route.
struct RunFilter {
    DriftFilter filter;
    UdFilter saved;     ///< as it was when the dwell began
    BatchSolver batch;  ///< of the same readings, to check the filter's answer
    KappaSpread kappa;  ///< of the dwells it keeps
    int run = 0;        ///< two-step route only; 0: not yet taken

    RunFilter(const Settings& settings, const ParameterArray& sigma)
        : filter(settings, sigma), saved(filter.state()), batch(settings, sigma) {}
};

/// Values and covariance in filter order, and what of them means something.
struct Solution {
    ParameterArray value{};
    Covariance covariance = Covariance::Zero();
    Observability found;
};

struct Identification::Impl {
    Impl(const Settings& s, std::size_t max_dwells);

    void reserve(std::size_t max_dwells);
    void begin_dwell(const DwellInfo& dwell) noexcept;
    StepResult add(const Measurement& measurement) noexcept;
    DwellSummary end_dwell(bool cut_short = false) noexcept;
    DwellSummary played(const PlayedRandom& played) noexcept;
    void estimate(Estimate& out) const noexcept;
    void solved(Estimate& out) const noexcept;
    [[nodiscard]] Result result() const;

    void solve(Solution& out) const noexcept;
    /// Compares the solution with that of the batches.
    [[nodiscard]] CrossCheck cross_check(const std::vector<Combination>& combinations) const;
    [[nodiscard]] bool batch_solution(RunSolution& out) const noexcept;
    [[nodiscard]] bool two_runs() const noexcept;

    Settings settings;
    ParameterArray prior;  ///< standard deviations, filter order
    std::array<RunFilter, 2> filters;
    NoiseLevels noise;  ///< that the filters take
    Solution solution;  ///< after the last ended dwell, as with constant biases
    std::vector<DwellSummary> dwells;
    std::vector<DwellMeans> means;  ///< of the same
    std::vector<DwellRow> rows;
    std::size_t dwells_not_kept = 0;  ///< summaries beyond max_dwells
    std::uint64_t samples = 0, used = 0, rejected = 0, nis_count = 0;
    std::uint32_t dwells_ended = 0;
    double nis_sum = 0;
    bool refused_run = false;  ///< the two-step route met a third run

  private:
    [[nodiscard]] Reading prepare(const Measurement& measurement) const noexcept;
    [[nodiscard]] RunFilter* filter_of(int run) noexcept;
    /// `hz`: of a sine.
    [[nodiscard]] Seen seen_of(const DwellInfo& dwell, double hz) const noexcept;
    void begin_paper_level() noexcept;
    void take_paper_level(DwellSummary& summary) const noexcept;
    StepResult accept(const Reading& reading) noexcept;
    [[nodiscard]] bool takes_longer() noexcept;
    StepResult leave_alone(const Measurement& measurement) noexcept;
    StepResult replay() noexcept;
    StepResult through_filter(const Reading& reading) noexcept;
    void to_level(const Reading& reading) noexcept;
    void refresh_vibration() noexcept;
    void let_biases_walk() noexcept;
    void note_shape(double weight) noexcept;
    /// Values and sigmas, filter order, with the counts.
    void tell(const ParameterArray& value, const ParameterArray& sigma,
              Estimate& out) const noexcept;
    void end_stretch() noexcept;
    [[nodiscard]] bool row_of(const DwellSummary& summary, DwellRow& row) noexcept;
    static void take_level(const DwellSummary& summary, DwellRow& row) noexcept;
    void keep_row(DwellRow& row) noexcept;

    /// Final eq. 13 amplitude of a position of the first run, for eq. 17.
    struct PaperStart {
        int position = 0;
        double amplitude_g = 0, table_g = -1;
    };

    Kinematics kinematics_;
    Eigen::Matrix3d accelerometer_matrix_;
    Eigen::Vector3d accelerometer_zero_;
    StuckDetector stuck_;
    SaturationDetector saturation_;
    DwellBuffer buffer_;
    VibrationLevel level_;
    GrowingTensor tensor_;
    SyncMotion sync_;
    Harmonics harmonics_;        ///< of a sine
    VibrationMoment vibration_;  ///< as the filter takes it
    PaperLevel paper_;
    std::vector<PaperStart> paper_starts_;
    RunFilter* active_ = nullptr;
    DwellRecord record_;
    bool power_lost_ = false;  ///< since the row kept last
    /// The random dwell that ended last, until it is known what was played in it.
    struct Random {
        DwellRecord record;
        DwellSummary summary;
        std::optional<DwellRow> row;  ///< none: there is nothing to be had of it
        bool kept = false;
    };
    std::optional<Random> last_random_;
    bool in_dwell_ = false;
    bool apart_ = false;   ///< this dwell: see DwellRow
    bool random_ = false;  ///< likewise
    bool swept_ = false;   ///< likewise: the filter is left alone
    bool primed_ = false;  ///< the level of this stretch is known
    /// Variance of the biases' walk since the dwell kept before, (deg/h)^2; none: not in the filter
    /// yet.
    std::optional<double> walked_;
    double walk_begin_s_ = 0;  ///< of this dwell's readings, on the dwells' clock if there is one
    /// The dwell kept last: its readings begin and last so long.
    std::optional<std::pair<double, double>> walked_from_;
    double last_time_s_ = 0, stretch_begin_s_ = 0, dwell_begin_s_ = 0;
    double period_s_ = 0;  ///< of the newest stretch with two readings or more; 0: none yet
    int bad_times_in_a_row_ = 0;
    std::array<double, 3> innovation_arcsec_{};
};

}  // namespace vibrig::estimator
