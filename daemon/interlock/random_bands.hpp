#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace vibrig::rt {

/// Whether a random vibration is at its level: means of squares over windows as long as their
/// scatter needs. A mean over n independent values strays by itself, so that 1 dB in half a second,
/// the rule of a sine, would trip at random; see docs/theory/spectrum.md, abort bands. Rules: 6 dB
/// too much, 3 dB too much, 3 dB too little. Acquisition thread; add() does not allocate.
class RandomBands {
  public:
    struct Settings {
        double sample_hz = 0;  ///< to be stated
        /// Square of the PSD's integral over the integral of its square: 2 B_e values in a second
        /// are independent, however many are taken.
        double bandwidth_hz = 0;
        double mean_square = 0;  ///< as it is to be, of what is added
    };
    enum class Finding { none, far_above, above, below };
    struct Rule {
        Finding finding = Finding::none;
        double decibels = 0;     ///< that it is there for
        double window_s = 0;     ///< mean over so long
        double independent = 0;  ///< values in it
        double threshold = 0;    ///< of the mean over what it is to be
        std::size_t values = 0;  ///< in a window
    };

    /// Throws std::invalid_argument for what is not above 0. Room for the longest window is taken
    /// here.
    explicit RandomBands(const Settings& settings);

    /// Excitation begins, or the level has been reached: nothing is known yet.
    void begin() noexcept;
    /// The next reading's acceleration along the line of the vibration, mean taken out, in units of
    /// the square root of `mean_square`. A missing reading is one that is not added. The first rule
    /// that is broken.
    [[nodiscard]] Finding add(double acceleration) noexcept;
    /// Whether too little is looked for; what was before does not count then. After the constructor
    /// and begin() it is.
    void watch_below(bool watch) noexcept;
    /// The mean square over what it is to be that the newest finding rests on.
    [[nodiscard]] double judged() const noexcept { return judged_; }
    /// Newest mean square over what it is to be, for people: over the window in which 3 dB too much
    /// are found, so that a right level is not seen beyond the bands by chance; until that is full
    /// over the shortest, and before that 0.
    [[nodiscard]] double ratio() const noexcept;
    [[nodiscard]] const std::array<Rule, 3>& rules() const noexcept { return rules_; }

    /// Threshold of a rule for `decibels` over n independent values: what a right level passes by
    /// chance once in 1e9 looks; with values enough, where neither a right level nor one that is
    /// wrong by so much is likely to be; never beyond `decibels` itself.
    [[nodiscard]] static double threshold(double decibels, double n) noexcept;
    /// Mean square over what it is to be that n independent values fall short of (first) or go
    /// beyond (second) by chance, once in 1e9 looks each.
    [[nodiscard]] static std::array<double, 2> by_chance(double n) noexcept;

  private:
    double mean_square_;
    std::array<Rule, 3> rules_;
    std::array<double, 3> sums_{};
    std::vector<double> squares_;  ///< a ring
    std::size_t next_ = 0, count_ = 0;
    bool below_ = true;
    std::size_t below_from_ = 0;  ///< of count_
    double judged_ = 0;
};

}  // namespace vibrig::rt
