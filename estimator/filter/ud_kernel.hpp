#pragma once

#include "estimator/filter/ud_memory.hpp"

namespace vibrig::estimator {

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
