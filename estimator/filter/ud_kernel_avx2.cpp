#define VIBRIG_UD_KERNEL kUdKernelAvx2
#define VIBRIG_UD_LANES 4
#include "estimator/filter/ud_kernel.inc"
