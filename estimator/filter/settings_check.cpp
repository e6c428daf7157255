#include "estimator/filter/settings_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

namespace vibrig::estimator {
namespace {

template <class Value>
void require(bool good, const std::string& key, const Value& value, const char* expected) {
    if (good) return;
    std::ostringstream text;
    text << key << ": got " << value << ", expected " << expected;
    throw SettingsError(text.str());
}

void require_axis(const SignedAxis& axis, const std::string& key) {
    require(axis.axis >= 0 && axis.axis <= 2, key, axis.axis, "an axis 0, 1 or 2 (x, y, z)");
    require(axis.sign == 1 || axis.sign == -1, key, axis.sign, "a sign +1 or -1");
}

bool positive(double value) { return std::isfinite(value) && value > 0; }
bool non_negative(double value) { return std::isfinite(value) && value >= 0; }

void check_platform(const Settings& s) {
    static constexpr std::array<const char*, 3> kAxesKey{
        "platform.gyro_x_axes", "platform.gyro_y_axes", "platform.gyro_z_axes"};
    require_axis(s.up, "platform.up");
    for (std::size_t j = 0; j < 3; ++j) {
        const auto& axes = s.gyro_axes[j];
        for (const SignedAxis& axis : axes) require_axis(axis, kAxesKey[j]);
        std::ostringstream found;
        for (const SignedAxis& axis : axes) {
            found << (axis.sign > 0 ? '+' : '-') << "xyz"[axis.axis] << ' ';
        }
        require(axes[0].axis != axes[1].axis && axes[1].axis != axes[2].axis &&
                    axes[0].axis != axes[2].axis,
                kAxesKey[j], found.str(), "three different axes");
    }
    require(s.drift_sign == 1 || s.drift_sign == -1, "platform.drift_sign", s.drift_sign,
            "+1 or -1");
    for (std::size_t k = 0; k < 3; ++k) {
        require(s.encoder_sign[k] == 1 || s.encoder_sign[k] == -1, "platform.encoder_sign",
                s.encoder_sign[k], "+1 or -1");
        require(std::isfinite(s.encoder_zero_deg[k]), "platform.encoder_zero_deg",
                s.encoder_zero_deg[k], "a finite angle in deg");
    }
}

}  // namespace

double determinant(const std::array<std::array<double, 3>, 3>& m) noexcept {
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
           m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

void check(const Settings& s) {
    require(std::abs(s.latitude_deg) <= 90, "site.latitude_deg", s.latitude_deg, "-90 to 90");
    require(std::isfinite(s.azimuth_deg), "site.azimuth_deg", s.azimuth_deg,
            "a finite angle in deg");
    require(std::abs(s.elevation_deg) <= 2, "site.elevation_deg", s.elevation_deg,
            "-2 to 2: a base that leans more is to be shimmed");
    require(positive(s.gravity_mps2), "site.gravity_mps2", s.gravity_mps2, "above 0");
    require(positive(s.frequency_hz), "vibration.frequency_hz", s.frequency_hz, "above 0");
    require(positive(s.transmission), "vibration.transmission", s.transmission, "above 0");
    require(s.level_window_s >= 2 && s.level_window_s <= 600, "vibration.level_window_s",
            s.level_window_s, "2 to 600 s");
    check_platform(s);
    for (std::size_t i = 0; i < 3; ++i) {
        require(std::isfinite(s.accelerometer_zero_g[i]), "accelerometer.zero_g",
                s.accelerometer_zero_g[i], "a finite number of g");
        for (double element : s.accelerometer_matrix[i]) {
            require(std::isfinite(element), "accelerometer.matrix", element, "finite elements");
        }
    }
    require(non_negative(s.accelerometer_range_g), "accelerometer.range_g", s.accelerometer_range_g,
            "0 or above");
    const double det = determinant(s.accelerometer_matrix);
    require(std::abs(det) > 1e-6, "accelerometer.matrix", det, "a determinant that is not 0");
    require(positive(s.resolver_arcsec), "noise.resolver_arcsec", s.resolver_arcsec, "above 0");
    require(s.resolver_bits >= 8 && s.resolver_bits <= 40, "noise.resolver_bits", s.resolver_bits,
            "8 to 40");
    require(non_negative(s.gyro_random_walk_deg_per_rt_h), "noise.gyro_random_walk_deg_per_rt_h",
            s.gyro_random_walk_deg_per_rt_h, "0 or above");
    require(non_negative(s.accelerometer_g), "noise.accelerometer_g", s.accelerometer_g,
            "0 or above");
    require(s.method == Method::joint || s.method == Method::two_step, "estimator.method",
            static_cast<int>(s.method), "joint or two-step");
    require(positive(s.prior_bias), "estimator.prior_sigma.bias", s.prior_bias, "above 0");
    require(positive(s.prior_linear), "estimator.prior_sigma.linear", s.prior_linear, "above 0");
    require(positive(s.prior_quadratic), "estimator.prior_sigma.quadratic", s.prior_quadratic,
            "above 0");
    require(s.forgetting >= 0 && s.forgetting < 1, "estimator.forgetting", s.forgetting,
            "0 or above, below 1");
    require(positive(s.gate_nis), "estimator.gate_nis", s.gate_nis, "above 0");
}

namespace {

/// As the configuration has them, one of them the other way; 3: none.
std::string listed(const std::array<SignedAxis, 3>& axes, std::size_t reversed) {
    std::string text;
    for (std::size_t i = 0; i < axes.size(); ++i) {
        const bool plus = (axes[i].sign > 0) != (i == reversed);
        text += std::string(i > 0 ? ", " : "") + (plus ? "\"+" : "\"-") + "xyz"[axes[i].axis] + '"';
    }
    return '[' + text + ']';
}

std::vector<DoubtfulKey> doubtful_axes(const Settings& settings) {
    constexpr std::array kKeys{"platform.gyro_x_axes", "platform.gyro_y_axes",
                               "platform.gyro_z_axes"};
    std::vector<DoubtfulKey> doubts;
    for (std::size_t j = 0; j < 3; ++j) {
        const auto& axes = settings.gyro_axes[j];
        const std::string gyro(1, "xyz"[j]), key = kKeys[j];
        const int input = axes[0].axis;
        if (input != static_cast<int>(j)) {
            std::string found =
                std::string("\"") + (axes[0].sign > 0 ? '+' : '-') + "xyz"[input] + '"';
            if (settings.gyro_axes[static_cast<std::size_t>(input)][0].axis == input)
                found += std::string(", the input axis of gyro ") + "xyz"[input] + " too";
            doubts.push_back({key + "[0]", found,
                              "\"+" + gyro + "\" or \"-" + gyro + "\": gyro " + gyro +
                                  " drifts about platform " + gyro});
        }
        // Input, output, spin in cyclic order with an even number of minus signs, or the reverse.
        const bool cyclic = (axes[1].axis - input + 3) % 3 == 1;
        const int signs = axes[0].sign * axes[1].sign * axes[2].sign;
        if ((cyclic ? 1 : -1) * signs > 0) continue;
        const std::string left = listed(axes, 3);
        doubts.push_back({key, left + ", left-handed",
                          "a right-handed triad, input cross output is spin: by the drawing " +
                              listed(axes, 1) + ", " + listed(axes, 2) +
                              ", or output and spin axis exchanged"});
    }
    return doubts;
}

}  // namespace

std::vector<DoubtfulKey> doubtful_keys(const Settings& settings) {
    std::vector<DoubtfulKey> doubts = doubtful_axes(settings);
    const auto& across = settings.uncertainty.cross_axis;
    if (settings.second_moment == SecondMoment::vertical &&
        std::ranges::none_of(across, [](const auto& share) { return share.declared; }))
        doubts.push_back(
            {"platform.second_moment", "\"vertical\" without uncertainty.cross_axis",
             "uncertainty.cross_axis declared, north and east: what the accelerometers "
             "do not measure"});
    return doubts;
}

}  // namespace vibrig::estimator
