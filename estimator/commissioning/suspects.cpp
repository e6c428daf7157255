// Which single key, changed, would explain dwells that contradict their configuration.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "estimator/commissioning/consistency.hpp"
#include "estimator/commissioning/dwell_fit.hpp"
#include "estimator/commissioning/rig.hpp"
#include "estimator/commissioning/suspect_search.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::commissioning {

namespace {

constexpr double kForceSigma_g = 3e-3;
/// Linear drift terms are believed to be about so large, deg/h/g: what the sign of the latitude is
/// recognised by.
constexpr double kLinearSigma = 2, kEarthFixed = 1e-3;
/// Verticals that spread less, in two directions of the platform, are explained by zeros, whatever
/// is wrong; the mean square of three axes up and down is 1/3 in each.
constexpr std::size_t kZeroDwells = 4;
constexpr double kZeroSpread = 0.05;
constexpr double kLargestZero_g = 0.03;
constexpr std::array<const char*, 3> kGimbalNames{"outer", "inner", "azimuth"};

class Search {
  public:
    Search(const Settings& settings, const std::vector<DwellMean>& dwells, const Judge& judge)
        : as_is_(settings), dwells_(dwells), judge_(judge) {}

    std::vector<Suspect> run() {
        signs_and_zeros();
        accelerometers();
        accelerometer_zeros();
        verticals_up();
        lean();
        site();
        time();
        std::ranges::stable_sort(found_, {}, &Suspect::cost);
        return std::move(found_);
    }

  private:
    [[nodiscard]] double gravity(const Settings& s) const {
        double cost = 0;
        for (const Verticals& v : verticals(s, dwells_))
            cost += (v.force - v.encoders).squaredNorm() / (kForceSigma_g * kForceSigma_g);
        return cost;
    }
    [[nodiscard]] double rates(const Settings& s, double time_factor) const {
        return judge_.earth ? judge_.rates(s, time_factor) : 0;
    }
    [[nodiscard]] double cost(const Settings& s) const { return gravity(s) + rates(s, 1); }

    /// Takes it if all limits hold with it.
    void consider(const Settings& s, std::string what) {
        if (!judge_.fits(s, dwells_)) return;
        found_.push_back({std::move(what), cost(s), s});
    }

    /// The value about which the cost is least: `steps` of `step` to both sides, then finer.
    double best_of(const std::function<Settings(double)>& with, double step, int steps) const {
        double best = 0, least = HUGE_VAL;
        for (; step > 0.004; step /= 5, steps = 6) {
            const double middle = best;
            for (int n = -steps; n <= steps; ++n) {
                const double at = middle + n * step, c = cost(with(at));
                if (c >= least) continue;
                least = c;
                best = at;
            }
        }
        return best;
    }

    void signs_and_zeros() {
        for (std::size_t i = 0; i < 3; ++i) {
            Settings s = as_is_;
            s.encoder_sign[i] = -s.encoder_sign[i];
            consider(s, text("platform.encoder_sign: %d instead of %d of the %s gimbal",
                             s.encoder_sign[i], as_is_.encoder_sign[i], kGimbalNames[i]));
            const auto with = [&](double off) {
                Settings z = as_is_;
                z.encoder_zero_deg[i] += off;
                return z;
            };
            const Settings best = with(best_of(with, 5, 36));
            consider(best,
                     text("platform.encoder_zero_deg: %.2f instead of %g of the %s gimbal",
                          best.encoder_zero_deg[i], as_is_.encoder_zero_deg[i], kGimbalNames[i]));
        }
    }

    void accelerometers() {
        for (const Eigen::Matrix3d& order : signed_permutations()) {
            if (order.isIdentity()) continue;
            Settings s = as_is_;
            for (std::size_t i = 0; i < 3; ++i) {
                for (std::size_t k = 0; k < 3; ++k) {
                    s.accelerometer_matrix[i][k] = 0;
                    for (std::size_t j = 0; j < 3; ++j)
                        s.accelerometer_matrix[i][k] +=
                            order(static_cast<int>(i), static_cast<int>(j)) *
                            as_is_.accelerometer_matrix[j][k];
                }
            }
            // Gravity tells at once; the rates do not know the accelerometers.
            double worst = 0;
            for (const Verticals& v : verticals(s, dwells_)) worst = std::max(worst, v.apart_deg());
            if (!(worst <= judge_.gravity_deg)) continue;
            std::string what = "accelerometer.matrix: x, y, z are";
            for (int i = 0; i < 3; ++i) {
                int from = 0;
                order.row(i).cwiseAbs().maxCoeff(&from);
                what +=
                    text("%s %c%c", i == 0 ? "" : ",", order(i, from) > 0 ? '+' : '-', "xyz"[from]);
            }
            consider(s, std::move(what));
        }
    }

    /// Three values at once: what the forces of several attitudes have in common.
    void accelerometer_zeros() {
        if (dwells_.size() < kZeroDwells) return;
        Eigen::Matrix3d matrix;
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k)
                matrix(i, k) = as_is_.accelerometer_matrix[static_cast<std::size_t>(i)]
                                                          [static_cast<std::size_t>(k)];
        const auto count = static_cast<double>(dwells_.size());
        Eigen::Vector3d off = Eigen::Vector3d::Zero(), middle = Eigen::Vector3d::Zero();
        Eigen::Matrix3d square = Eigen::Matrix3d::Zero();
        for (const Verticals& v : verticals(as_is_, dwells_)) {
            off += (v.force - v.encoders) / count;
            middle += v.encoders / count;
            square += v.encoders * v.encoders.transpose() / count;
        }
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> spread(square -
                                                                    middle * middle.transpose());
        if (!(spread.eigenvalues()[1] > kZeroSpread)) return;
        off = matrix.inverse() * off;
        if (!(off.cwiseAbs().maxCoeff() <= kLargestZero_g)) return;
        Settings s = as_is_;
        for (std::size_t k = 0; k < 3; ++k) s.accelerometer_zero_g[k] += off[static_cast<int>(k)];
        const auto list = [](const std::array<double, 3>& g, const char* form) {
            return text(form, g[0], g[1], g[2]);
        };
        consider(s, "accelerometer.zero_g: about " +
                        list(s.accelerometer_zero_g, "[%.4f, %.4f, %.4f]") + " instead of " +
                        list(as_is_.accelerometer_zero_g, "[%g, %g, %g]"));
    }

    void verticals_up() {
        for (int axis = 0; axis < 3; ++axis) {
            for (const int sign : {1, -1}) {
                Settings s = as_is_;
                s.up = {axis, sign};
                if (axis == as_is_.up.axis && sign == as_is_.up.sign) continue;
                consider(
                    s, text("platform.up: %c%c instead of %c%c", sign > 0 ? '+' : '-', "xyz"[axis],
                            as_is_.up.sign > 0 ? '+' : '-', "xyz"[as_is_.up.axis]));
            }
        }
    }

    void lean() {
        const auto with = [&](double off) {
            Settings s = as_is_;
            s.elevation_deg = std::clamp(s.elevation_deg + off, -2.0, 2.0);
            return s;
        };
        const Settings s = with(best_of(with, 0.5, 8));
        consider(s, text("site.elevation_deg: %.2f instead of %g", s.elevation_deg + 0.0,
                         as_is_.elevation_deg));
    }

    void site() {
        if (!judge_.earth) return;
        Settings s = as_is_;
        s.latitude_deg = -s.latitude_deg;
        consider(s,
                 text("site.latitude_deg: %g instead of %g", s.latitude_deg, as_is_.latitude_deg));
        const auto latitude = [&](double off) {
            Settings l = as_is_;
            // Its sign was another suspect.
            const bool south = as_is_.latitude_deg < 0;
            l.latitude_deg =
                std::clamp(l.latitude_deg + off, south ? -90.0 : 0.0, south ? 0.0 : 90.0);
            return l;
        };
        s = latitude(best_of(latitude, 5, 36));
        consider(
            s, text("site.latitude_deg: %.2f instead of %g", s.latitude_deg, as_is_.latitude_deg));
        const auto azimuth = [&](double off) {
            Settings a = as_is_;
            a.azimuth_deg += off;
            return a;
        };
        s = azimuth(best_of(azimuth, 5, 36));
        consider(s, text("site.azimuth_deg: %.2f instead of %g",
                         std::remainder(s.azimuth_deg, 360.0), as_is_.azimuth_deg));
    }

    void time() {
        if (!judge_.earth) return;
        for (const auto& [factor, name] : {std::pair{60.0, "minutes"},
                                           {3600.0, "hours"},
                                           {1 / 1000.0, "milliseconds"},
                                           {1e-6, "microseconds"},
                                           {1000.0, "units of 1000 s"},
                                           {2.0, "units of 2 s"},
                                           {0.5, "units of 0.5 s"},
                                           {1 / 60.0, "1/60 s"}}) {
            auto scaled = dwells_;
            for (DwellMean& dwell : scaled) {
                for (double& slope : dwell.slope_deg_h) slope /= factor;
                for (double& variance : dwell.slope_variance) variance /= factor * factor;
                dwell.begin_s *= factor;
                dwell.duration_s *= factor;
            }
            if (!judge_.fits(as_is_, scaled)) continue;
            found_.push_back({text("time_s: it is in %s", name),
                              gravity(as_is_) + rates(as_is_, factor), as_is_, factor});
        }
    }

    Settings as_is_;
    const std::vector<DwellMean>& dwells_;
    const Judge& judge_;
    std::vector<Suspect> found_;
};

}  // namespace

std::vector<Suspect> search_suspects(const Settings& settings, const std::vector<DwellMean>& dwells,
                                     const Judge& judge, std::size_t most) {
    auto found = Search(settings, dwells, judge).run();
    if (found.size() > most) found.resize(most);
    return found;
}

std::vector<Suspect> suspects(const Settings& settings, const std::vector<DwellMean>& dwells,
                              const ConsistencyLimits& limits, std::size_t most) {
    Judge judge;
    judge.fits = [&limits](const Settings& s, const std::vector<DwellMean>& of) {
        return consistency(s, of, limits).contradictions.empty();
    };
    judge.rates = [&dwells](const Settings& s, double time_factor) {
        return fit_rates(s, dwells, {kEarthFixed, kLinearSigma}, time_factor).cost;
    };
    judge.gravity_deg = limits.gravity_deg;
    judge.earth = consistency(settings, dwells, limits).earth_known;
    return search_suspects(settings, dwells, judge, most);
}

}  // namespace vibrig::estimator::commissioning
