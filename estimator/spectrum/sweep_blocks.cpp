#include "estimator/spectrum/sweep_blocks.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/median.hpp"
#include "estimator/spectrum/sampling.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Eigen::Index;

// Below so many samples a Hann window has nothing of a sine.
constexpr std::size_t kFewest = 10;
constexpr double kWhole = 0.9;   ///< of a block: its length
constexpr double kShakes = 100;  ///< of the noise's variance

}  // namespace

bool clear_of_samples(double from_hz, double to_hz, double sample_hz) noexcept {
    const auto free = [sample_hz](double hz) {
        return !forbidden(hz, sample_hz, SweepBlocks::kBlock_s);
    };
    return free(from_hz) && free((from_hz + to_hz) / 2) && free(to_hz);
}

SweepBlocks::SweepBlocks(const Settings& settings, int run, int position)
    : settings_(settings), sweep_{run, position, {}} {}

void SweepBlocks::add(const Measurement& m, double hz) {
    if (!begun_) begin_s_ = m.time_s;
    begun_ = true;
    if (m.time_s >= begin_s_ + kBlock_s) {
        end_block();
        begin_s_ += kBlock_s;
    }
    if (m.time_s >= begin_s_ + kBlock_s) {  // a gap: no rate goes across it
        end_block();
        begin_s_ = m.time_s;
    }
    Sample sample{m.time_s, hz, {}, m.force_good};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j)
            sample.force[i] += settings_.accelerometer_matrix[i][j] *
                               (m.force_g[j] - settings_.accelerometer_zero_g[j]);
        const bool beyond = settings_.accelerometer_range_g > 0 &&
                            std::abs(m.force_g[i]) >= settings_.accelerometer_range_g;
        sample.force_good = sample.force_good && std::isfinite(m.force_g[i]) && !beyond;
    }
    samples_.push_back(sample);
    const bool finite = std::ranges::all_of(m.angle_rad, [](double a) { return std::isfinite(a); });
    if (!m.angles_good || !finite) return;
    if (angles_++ == 0) first_ = m.angle_rad;
    for (std::size_t i = 0; i < 3; ++i) sum_[i] += wrap(m.angle_rad[i] - first_[i]);
}

Sweep SweepBlocks::finish() {
    if (!samples_.empty() && samples_.back().time_s - begin_s_ > kWhole * kBlock_s) end_block();
    samples_.clear();
    return sweep_;
}

double SweepBlocks::shown() const {
    if (shares_.empty()) return 1;
    auto shares = shares_;
    return median(shares);
}

void SweepBlocks::end_block() {
    SweepBlock block;
    block.time_s = begin_s_ + kBlock_s / 2;
    block.samples = angles_;
    if (angles_ > 0) {
        const auto before = sweep_.blocks.empty() ? first_ : sweep_.blocks.back().angle_rad;
        for (std::size_t i = 0; i < 3; ++i)
            block.angle_rad[i] =
                wrap_next_to(first_[i] + sum_[i] / static_cast<double>(angles_), before[i]);
    } else if (!sweep_.blocks.empty()) {
        block.angle_rad = sweep_.blocks.back().angle_rad;
    }
    if (!samples_.empty()) {
        block.from_hz = samples_.front().hz;
        block.to_hz = samples_.back().hz;
    }
    take_moment(block);
    sweep_.blocks.push_back(block);
    samples_.clear();
    angles_ = 0;
    sum_ = {};
}

/// From its samples under a Hann window, gravity and the noise taken out.
void SweepBlocks::take_moment(SweepBlock& block) {
    const std::size_t n = samples_.size();
    const bool whole = n >= kFewest && angles_ >= n / 2 && angles_ > 0 &&
                       std::ranges::all_of(samples_, [](const Sample& s) {
                           return s.force_good && std::isfinite(s.hz) && s.hz > 0;
                       });
    if (!whole || samples_.back().time_s - samples_.front().time_s < kWhole * kBlock_s) return;
    Eigen::MatrixXd columns(static_cast<Index>(n), 3), force(static_cast<Index>(n), 3);
    Eigen::VectorXd root(static_cast<Index>(n));
    double phase = 0, sum = 0;
    for (std::size_t k = 0; k < n; ++k) {
        const Sample& s = samples_[k];
        if (k > 0)
            phase += std::numbers::pi * (s.hz + samples_[k - 1].hz) *
                     (s.time_s - samples_[k - 1].time_s);
        const double window = std::max(
            0.0, 0.5 - 0.5 * std::cos(2 * std::numbers::pi * (s.time_s - begin_s_) / kBlock_s));
        const auto i = static_cast<Index>(k);
        root[i] = std::sqrt(window);
        columns.row(i) << 1, std::cos(phase), std::sin(phase);
        force.row(i) = mapped(s.force);
        sum += window;
    }
    if (!(sum > 0)) return;
    const auto weighted = [&](const Eigen::MatrixXd& rows) {
        return Eigen::MatrixXd(root.asDiagonal() * rows);
    };
    const Eigen::Vector3d mean = weighted(force).transpose() * root / sum;
    const Eigen::MatrixXd moving = weighted(force.rowwise() - mean.transpose());
    Eigen::Matrix3d moment = moving.transpose() * moving / sum;
    const double noise = settings_.accelerometer_g * settings_.accelerometer_g;
    const double power = moment.trace() - 3 * noise;
    if (power > kShakes * 3 * noise) {
        const Eigen::MatrixXd of = weighted(columns);
        const Eigen::MatrixXd left =
            moving - linear_algebra::product(of, linear_algebra::least_squares(of, moving));
        shares_.push_back(1 - std::max(0.0, left.squaredNorm() / sum - 3 * noise) / power);
    }
    // It can be told apart from others there; its size cannot be had.
    if (!clear_of_samples(block.from_hz, block.to_hz, static_cast<double>(n) / kBlock_s)) return;
    moment -= noise * Eigen::Matrix3d::Identity();
    const double seen =
        settings_.accelerometer_response.power(std::sqrt(block.from_hz * block.to_hz));
    if (seen < kLeastSeen) return;
    moment /= seen;
    const Kinematics kinematics(settings_);
    const Pose pose = kinematics.pose(kinematics.gimbal_angles(block.angle_rad));
    moment = (pose.level.transpose() * moment * pose.level).eval();
    if (!moment.allFinite()) return;
    mapped(block.moment.emplace()) = moment;
}

}  // namespace vibrig::estimator::spectrum
