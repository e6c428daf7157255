#pragma once

#include "tests/plant/random.hpp"
#include "tests/plant/truth.hpp"

namespace vibrig::plant {

/// The gyros' coefficients as they change in the course of a campaign: steps, ramps, walk, scatter.
class Drift {
  public:
    explicit Drift(const Truth& truth);

    /// The platform is let go: scatter is drawn anew, the ramp in a dwell begins at zero.
    void begin_dwell() noexcept;
    void advance(double dt_s) noexcept;

    [[nodiscard]] const std::array<GyroCoefficients, 3>& coefficients() const noexcept {
        return now_;
    }
    [[nodiscard]] bool constant() const noexcept { return constant_; }

  private:
    [[nodiscard]] bool stepped() const noexcept;
    void put_together() noexcept;

    Truth truth_;
    bool constant_;
    Random walk_noise_;
    Random scatter_noise_;
    Random markov_noise_;
    double time_s_ = 0;
    double begun_s_ = 0;                  ///< of the present dwell
    int dwells_ = 0;                      ///< begun
    Vec3 walk_{}, scatter_{}, markov_{};  ///< deg/h
    std::array<GyroCoefficients, 3> now_;
};

}  // namespace vibrig::plant
