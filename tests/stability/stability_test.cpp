// Everything but networks in integers.
#include "tests/stability/stability_suite.h"

namespace figurine::stability {

INSTANTIATE_TEST_SUITE_P(Splatter, Stability, values_in(splat_cases()), name_of);
INSTANTIATE_TEST_SUITE_P(File, Stability, values_in(file_cases()), name_of);
INSTANTIATE_TEST_SUITE_P(Pose, Stability, values_in(pose_cases()), name_of);
INSTANTIATE_TEST_SUITE_P(Live, Stability, values_in(live_cases()), name_of);
INSTANTIATE_TEST_SUITE_P(Sampling, Stability, values_in(sampling_cases()), name_of);
INSTANTIATE_TEST_SUITE_P(Package, Stability, values_in(package_cases()), name_of);

}  // namespace figurine::stability
