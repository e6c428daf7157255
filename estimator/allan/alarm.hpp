#pragma once

#include <cstddef>

namespace vibrig::estimator::allan {

enum class Reading : unsigned char {
    short_tau,   ///< quantisation or vibration leakage
    middle_tau,  ///< angle random walk N
    long_tau,    ///< temperature, K, R
    mean_step    ///< the mean of adjacent windows differs
};
[[nodiscard]] const char* words_of(Reading reading);
/// Of an octave: the lower, middle or upper third of so many.
[[nodiscard]] Reading reading_of(std::size_t octave, std::size_t octaves);

struct Alarm {
    Reading reading = Reading::middle_tau;
    double tau = 0;    ///< s; the window's length for a step
    double ratio = 1;  ///< AVAR over the reference; a step: in standard deviations, signed
    double limit = 1;  ///< the bound that was crossed
    double since_s = 0;
};

}  // namespace vibrig::estimator::allan
