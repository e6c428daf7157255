#include "tests/plant/drift.hpp"

#include <algorithm>
#include <cmath>

namespace vibrig::plant {
namespace {

bool zero(const Vec3& v) { return v == Vec3{}; }

bool never_changes(const Truth& t) {
    return zero(t.bias_step_deg_h) && zero(t.bias_ramp_deg_h_h) &&
           zero(t.bias_ramp_in_dwell_deg_h) && t.bias_walk_deg_h_rt_h == 0 &&
           t.bias_scatter_deg_h == 0 && t.bias_markov_deg_h == 0 &&
           t.unbalance_step_deg_h_g == Mat3{} && t.unbalance_ramp_deg_h_g_h == Mat3{};
}

}  // namespace

Drift::Drift(const Truth& truth)
    : truth_(truth),
      constant_(never_changes(truth)),
      walk_noise_(truth.seed, 8),
      scatter_noise_(truth.seed, 9),
      markov_noise_(truth.seed, 10),
      now_(truth.coefficients) {
    for (double& x : markov_) x = truth.bias_markov_deg_h * markov_noise_.normal();
    put_together();
}

bool Drift::stepped() const noexcept {
    return (truth_.step_at_s && time_s_ >= *truth_.step_at_s) ||
           (truth_.step_after_dwell && dwells_ > *truth_.step_after_dwell);
}

void Drift::begin_dwell() noexcept {
    begun_s_ = time_s_;
    ++dwells_;
    for (double& x : scatter_) x = truth_.bias_scatter_deg_h * scatter_noise_.normal();
    put_together();
}

void Drift::advance(double dt_s) noexcept {
    time_s_ += dt_s;
    if (constant_) return;
    if (truth_.bias_walk_deg_h_rt_h > 0) {
        const double sigma = truth_.bias_walk_deg_h_rt_h * std::sqrt(dt_s / 3600);
        for (double& x : walk_) x += sigma * walk_noise_.normal();
    }
    if (truth_.bias_markov_deg_h > 0) {
        const double kept = std::exp(-dt_s / truth_.bias_markov_s);
        const double sigma = truth_.bias_markov_deg_h * std::sqrt(1 - kept * kept);
        for (double& x : markov_) x = kept * x + sigma * markov_noise_.normal();
    }
    put_together();
}

void Drift::put_together() noexcept {
    const double hours = time_s_ / 3600;
    const double step = stepped() ? 1 : 0;
    const double in_dwell = dwells_ > 0 ? (time_s_ - begun_s_) / 100 : 0;
    for (std::size_t g = 0; g < 3; ++g) {
        now_[g][kF] = truth_.coefficients[g][kF] + walk_[g] + scatter_[g] + markov_[g] +
                      step * truth_.bias_step_deg_h[g] + hours * truth_.bias_ramp_deg_h_h[g] +
                      in_dwell * truth_.bias_ramp_in_dwell_deg_h[g];
        for (std::size_t i = 0; i < 3; ++i) {
            now_[g][kI + i] = truth_.coefficients[g][kI + i] +
                              step * truth_.unbalance_step_deg_h_g[g][i] +
                              hours * truth_.unbalance_ramp_deg_h_g_h[g][i];
        }
    }
}

}  // namespace vibrig::plant
