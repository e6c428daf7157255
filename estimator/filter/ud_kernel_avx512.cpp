#define VIBRIG_UD_KERNEL kUdKernelAvx512
#define VIBRIG_UD_LANES 8
#include "estimator/filter/ud_kernel.inc"
