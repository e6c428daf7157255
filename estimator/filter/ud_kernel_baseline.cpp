#define VIBRIG_UD_KERNEL kUdKernelBaseline
#define VIBRIG_UD_LANES 2
#include "estimator/filter/ud_kernel.inc"
