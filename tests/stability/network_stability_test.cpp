// Networks and samplers in integers: XNNPACK and the kernels choose their code by the CPU.
#include "tests/stability/stability_suite.h"

namespace figurine::stability {

INSTANTIATE_TEST_SUITE_P(FixedPoint, Stability, values_in(fixed_point_cases()), name_of);
INSTANTIATE_TEST_SUITE_P(Sampler, Stability, values_in(sampler_cases()), name_of);

}  // namespace figurine::stability
