#include "estimator/level/lock_in.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator {
namespace {

/// Below this amplitude, g, there is nothing whose frequency could be refined.
constexpr double kLeastAmplitude = 1e-3;

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

double mean_of(const Window& w) noexcept {
    double sum = 0;
    std::size_t n = 0, at = w.begin;
    for (std::size_t i = 0; i < w.count; ++i) {
        if (w.valid[at]) {
            sum += w.value[at];
            ++n;
        }
        if (++at == w.capacity) at = 0;
    }
    return n > 0 ? sum / static_cast<double>(n) : 0.0;
}

/// Angular frequency from the weighted slope of the phase of block phasors at w0.
double phasor_slope(const Window& w, double w0, double mean) noexcept {
    const std::size_t block = lock_in_block(w0 / (2.0 * kPi), w.period_s, w.count / 3);
    const double step = w0 * w.period_s;
    double phase = 0, sw = 0, st = 0, sp = 0, stt = 0, stp = 0;
    bool first = true;
    std::size_t at = w.begin;
    for (std::size_t start = 0; start + block <= w.count; start += block) {
        double re = 0, im = 0;
        for (std::size_t i = start; i < start + block; ++i) {
            if (w.valid[at]) {
                const double x = w.value[at] - mean;
                const double angle = step * static_cast<double>(i);
                re += x * std::cos(angle);
                im -= x * std::sin(angle);
            }
            if (++at == w.capacity) at = 0;
        }
        const double weight = re * re + im * im;
        if (weight <= 0) continue;
        const double raw = std::atan2(im, re);
        phase = first ? raw : wrap_next_to(raw, phase);
        first = false;
        const double t = static_cast<double>(start) * w.period_s;
        sw += weight;
        st += weight * t;
        sp += weight * phase;
        stt += weight * t * t;
        stp += weight * t * phase;
    }
    const double det = sw * stt - st * st;
    return det > 1e-12 * sw * stt ? w0 + (sw * stp - st * sp) / det : w0;
}

/// The valid readings with c = cos wt, s = sin wt, by turning.
template <typename Take>
void each_reading(const Window& w, double omega, Take&& take) noexcept {
    const double c1 = std::cos(omega * w.period_s), s1 = std::sin(omega * w.period_s);
    double c = 1, s = 0;
    std::size_t at = w.begin;
    for (std::size_t i = 0; i < w.count; ++i) {
        if (w.valid[at]) take(static_cast<double>(i) * w.period_s, c, s, w.value[at]);
        const double next = c * c1 - s * s1;
        s = s * c1 + c * s1;
        c = next;
        if (++at == w.capacity) at = 0;
    }
}

Eigen::Vector4d lines_of(double c, double s) noexcept { return {c, s, c * c - s * s, 2.0 * s * c}; }

/// Least squares of [1, cos wt, sin wt, cos 2wt, sin 2wt, d/dw] about a frequency. What the last
/// column does not take part in is summed once for both fits there.
class LineFit {
  public:
    LineFit(const Window& window, double omega) noexcept : window_(window), omega_(omega) {
        double count = 0, value = 0;
        Eigen::Vector4d lines = Eigen::Vector4d::Zero(), right = lines;
        Eigen::Matrix4d products = Eigen::Matrix4d::Zero();
        each_reading(window, omega, [&](double, double c, double s, double reading) {
            const Eigen::Vector4d row = lines_of(c, s);
            count += 1.0;
            value += reading;
            lines += row;
            right += row * reading;
            // All of it, unrolled: rankUpdate() of half costs more than all the rest here.
            products.noalias() += row.lazyProduct(row.transpose());
        });
        normal_(0, 0) = count;
        normal_.block<4, 1>(1, 0) = lines;
        normal_.block<4, 4>(1, 1) = products;
        right_[0] = value;
        right_.segment<4>(1) = right;
    }

    void solve(Vibration& v) const noexcept { static_cast<void>(solve(normal_, right_, v)); }

    /// Of the fundamental of `v` over the readings.
    [[nodiscard]] double variance_of(const Vibration& v) const noexcept {
        const double mean = v.cosine * normal_(1, 0) + v.sine * normal_(2, 0);
        const double square = v.cosine * v.cosine * normal_(1, 1) +
                              2.0 * v.cosine * v.sine * normal_(2, 1) +
                              v.sine * v.sine * normal_(2, 2);
        const double count = normal_(0, 0);
        return count > 0 ? square / count - mean * mean / (count * count) : 0.0;
    }

    /// With the last column, about `v`; returns the change of w.
    [[nodiscard]] double frequency_change(const Vibration& v) const noexcept {
        double one = 0, square = 0, value = 0;
        Eigen::Vector4d lines = Eigen::Vector4d::Zero();
        each_reading(window_, omega_, [&](double t, double c, double s, double reading) {
            const double slope = t * (v.sine * c - v.cosine * s +
                                      2.0 * (v.sine2 * (c * c - s * s) - 2.0 * v.cosine2 * s * c));
            one += slope;
            lines += slope * lines_of(c, s);
            square += slope * slope;
            value += slope * reading;
        });
        Matrix6 normal = normal_;
        normal(5, 0) = one;
        normal.block<1, 4>(5, 1) = lines.transpose();
        normal(5, 5) = square;
        Vector6 right = right_;
        right[5] = value;
        Vibration about_it;
        return solve(normal, right, about_it);
    }

  private:
    double solve(Matrix6 normal, const Vector6& right, Vibration& v) const noexcept {
        // Columns that coincide at this sampling (2f on f, or constant) share their part instead of
        // exploding.
        const double ridge = 1e-9 * static_cast<double>(window_.count);
        for (int k = 0; k < 6; ++k) normal(k, k) += ridge;
        const Vector6 x = normal.selfadjointView<Eigen::Lower>().ldlt().solve(right);
        v.mean = x[0];
        v.cosine = x[1];
        v.sine = x[2];
        v.cosine2 = x[3];
        v.sine2 = x[4];
        return x[5];
    }

    Window window_;
    double omega_;
    Matrix6 normal_ = Matrix6::Zero();  ///< on and below the diagonal
    Vector6 right_ = Vector6::Zero();
};

}  // namespace

double Vibration::at(double time_s) const noexcept {
    const double angle = 2.0 * kPi * frequency_hz * time_s;
    const double c = std::cos(angle), s = std::sin(angle);
    return mean + cosine * c + sine * s + cosine2 * (c * c - s * s) + sine2 * 2.0 * s * c;
}

std::size_t lock_in_block(double frequency_hz, double period_s, std::size_t longest) noexcept {
    std::size_t best = 1;
    double least = 1.0;
    for (std::size_t n = 3; n <= std::max<std::size_t>(longest, 3); ++n) {
        const double periods = static_cast<double>(n) * frequency_hz * period_s;
        const double miss = std::abs(periods - std::round(periods));
        if (std::round(periods) >= 1 && miss < least - 1e-9) {
            least = miss;
            best = n;
            if (miss < 1e-6) break;
        }
        // The slope of the phase must stay within half a turn per block for 1 Hz of frequency
        // error.
        if (static_cast<double>(n) * period_s > 0.45) break;
    }
    return best;
}

Vibration lock_in(const Window& window, double nominal_hz) noexcept {
    Vibration v;
    v.mean = mean_of(window);
    v.frequency_hz = nominal_hz;
    if (window.count < 12 || window.period_s <= 0) return v;
    const double nominal = 2.0 * kPi * nominal_hz;
    double omega = phasor_slope(window, nominal, v.mean);
    // More than one step of the phasor per 2 s away is no lock.
    if (!std::isfinite(omega) || std::abs(omega - nominal) > 2.0 * kPi * 3.0) omega = nominal;
    LineFit fit(window, omega);
    fit.solve(v);
    const double span = static_cast<double>(window.count) * window.period_s;
    for (int pass = 0; pass < 2 && std::hypot(v.cosine, v.sine) > kLeastAmplitude; ++pass) {
        const double change = fit.frequency_change(v);
        if (!std::isfinite(change) || std::abs(change) > 2.0 / span) break;
        omega += change;
        fit = LineFit(window, omega);
        fit.solve(v);
    }
    v.frequency_hz = omega / (2.0 * kPi);
    v.amplitude = std::hypot(v.cosine, v.sine);
    v.variance = fit.variance_of(v);
    v.phase = std::atan2(v.cosine, v.sine);
    return v;
}

}  // namespace vibrig::estimator
