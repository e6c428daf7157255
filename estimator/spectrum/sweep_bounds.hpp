#pragma once

#include "estimator/filter/measurement.hpp"

namespace vibrig::estimator::spectrum {

/// How a controller sweeps, by its own statement, and how it is commanded and read.
struct SweptBy {
    double begins_s = 8;              ///< after its level is there, at most
    double rate_tolerance = 0.05;     ///< relative
    double poll_s = 0.2;              ///< between two readings of its registers
    double frequency_step_hz = 1e-3;  ///< of the register of the actual frequency
    double rate_step = 1e-2;          ///< of the register of its rate, octaves a minute
};

/// How far a sweep may be from what was asked for while all that it is read by is honest; one that
/// is farther does not do what was commanded (docs/theory/spectrum.md, "How far a sweep may be
/// off"). Nothing in it is chosen but what the controller states (SweptBy):
///
///  * A frequency that is off by d over a block of T seconds leaves W(d T)^2 of the power under it,
///    W(x) = sin(pi x)/(pi x)/(1 - x^2) of a Hann window. What leaves SweepBlocks::kShown is not
///    contradicted by the accelerometers: d = 0.285 Hz, unseen_hz(). With half a step of its
///    register that is what a statement may be off: off_hz(). However it comes about: by a register
///    that is refreshed late, or by what the controller measures.
///  * At f the sweep does f |ln(to/from)|/s Hz a second, so in time a statement is off by
///    off_s(f) = off_hz() over that.
///  * A reading bears the time at which it was asked for, and its answer comes before the next one
///    is: it is off by a period of polling more.
///  * A rate goes as a whole number of steps of its register: half a step of what was asked for,
///    relative, comes to the controller's own tolerance: rate_off().
///
/// So the beginnings that the first moving reading implies, and a later one at f, after the sweep
/// has lasted L s, differ by late_s(f, L) = poll + off_s(from) + off_s(f) + rate_off() L at most.
/// One that stands may be said to be off_hz() farther on than it is, and one that has moved as much
/// less: it has moved for sure 2 off_s(from)/(1 - rate_off()) after it began, begins_s() after its
/// level.
class SweepBounds {
  public:
    SweepBounds(const SweptSine& of, const SweptBy& by);

    [[nodiscard]] static double unseen_hz();
    [[nodiscard]] double off_hz() const noexcept { return off_hz_; }
    [[nodiscard]] double off_s(double hz) const noexcept;
    [[nodiscard]] double rate_off() const noexcept { return rate_off_; }
    /// s after the level, by when it has begun as its statements show it.
    [[nodiscard]] double begins_s() const noexcept;
    /// s, either way; it lasts of.seconds/(1 - rate_off()) at most.
    [[nodiscard]] double late_s(double hz, double lasted_s) const noexcept;
    /// s from its level until it is over, at the latest.
    [[nodiscard]] double dwell_s() const noexcept;

  private:
    SweptSine of_;
    SweptBy by_;
    double off_hz_, rate_off_;
};

}  // namespace vibrig::estimator::spectrum
