#pragma once

#include <complex>
#include <span>
#include <vector>

#include "tests/plant/isolator.hpp"

namespace vibrig::plant {

/// The low-pass that the platform's accelerometers are: Butterworth's, half of the power at its
/// bandwidth. Each pole by itself, exact for a motion that is straight between the steps.
class AccelerometerBand {
  public:
    AccelerometerBand(double bandwidth_hz, int order, double step_s);

    /// `motion` at the ends of equal steps, the first that of the end of the call before; `shown`
    /// as long.
    void follow(std::span<const Shake> motion, std::span<Shake> shown) noexcept;
    void rest() noexcept;

  private:
    using Complex = std::complex<double>;
    struct Pole {
        Complex part;           ///< of what is shown, of its state
        Complex decay;          ///< of the state in a step
        Complex held, risen;    ///< under a motion that is 1, or gets so
        Complex up{}, ahead{};  ///< state: of the two parts of a Shake
    };
    [[nodiscard]] Shake shown() const noexcept;

    std::vector<Pole> poles_;
};

}  // namespace vibrig::plant
