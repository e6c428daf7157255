#pragma once

namespace vibrig::bench {

/// Multiply-adds of one step of the UD filter, predict and three updates, each element that is not
/// zero counted once.
constexpr int multiply_adds_of_step() {
    constexpr int kConstants = 30, kStates = 33;
    constexpr int kAbove = kConstants * (kConstants - 1) / 2;
    constexpr int kPredict = kAbove + kConstants     // h U
                             + kConstants * (9 + 9)  // F angles + G drift
                             + 18 + 18 + 36 + 18;    // Gram-Schmidt on three rows of six
    constexpr int kUpdate = 3 * kStates * 10         // Bierman's recursion along the columns
                            + 6 * kAbove             // gains and new columns of the constants
                            + 3 * kStates;           // state
    return kPredict + kUpdate;
}

/// That many or a few more, independent of each other and in registers: as fast as this machine
/// can. Returns something that depends on all of them.
[[gnu::visibility("default")]] double multiply_adds_at_peak(double x);

}  // namespace vibrig::bench
