#pragma once

#include "estimator/filter/coefficients.hpp"

namespace vibrig::estimator {

// Plain arrays only: files compiled for different instruction sets share these, and inline code of
// a library would be compiled once for each of them with the linker keeping any one.

inline constexpr int kUdAngles = 3;
inline constexpr int kUdConstants = static_cast<int>(kParameters);
inline constexpr int kUdPadded = (kUdConstants + 7) / 8 * 8;  ///< to whole vectors of eight

/// State of the filter, P = U diag(d) U^T with the angles first. What pads is zero.
struct UdMemory {
    /// column[c]: rows of the constants in the column of constant c, unit upper triangular.
    alignas(64) double column[kUdConstants][kUdPadded];
    /// angle_row[r][c]: row of angle r in the column of constant c.
    alignas(64) double angle_row[kUdAngles][kUdPadded];
    alignas(64) double d_constant[kUdPadded];
    alignas(64) double x_constant[kUdPadded];
    double angle_block[kUdAngles][kUdAngles];  ///< [column][row], unit upper triangular
    double d_angle[kUdAngles];
    double x_angle[kUdAngles];
};

/// One time step: angles' = f angles + g (sum over groups h[3 group + j] D[3 group + j])_j.
struct UdTransition {
    double angle_increment[kUdAngles];       ///< of the mean, arcsec
    double f[kUdAngles][kUdAngles];          ///< I + dt/RAD * Jacobian
    double g[kUdAngles][kUdAngles];          ///< drift_sign * dt * M
    double noise_map[kUdAngles][kUdAngles];  ///< M
    double noise;                            ///< q dt, arcsec^2
    alignas(64) double h[kUdPadded];
};

/// The two steps of the filter, compiled for one instruction set.
struct UdKernel {
    /// Thornton's time update; only the rows of the angles change.
    void (*predict)(UdMemory& memory, const UdTransition& transition);
    /// Three scalar updates of Bierman with equal `variance`, unless the squared length `nis` of
    /// the innovation in its own covariance is not within `gate`: then nothing changes and the
    /// answer is false.
    bool (*update)(UdMemory& memory, const double* measured, double variance, double gate,
                   double* nis);
};

extern const UdKernel kUdKernelBaseline;  ///< any machine of this architecture (x86-64: SSE2)
#ifdef VIBRIG_X86_KERNELS
/// What the baseline computes, to the last bit, with AVX2's registers.
extern const UdKernel kUdKernelBaselineWide;
extern const UdKernel kUdKernelAvx2;  ///< with FMA
extern const UdKernel kUdKernelAvx512;
#endif

}  // namespace vibrig::estimator
