#define VIBRIG_UD_KERNEL kUdKernelAvx2
#define VIBRIG_UD_LANES 4
#include "estimator/ud_kernel.inc"
