#include "tests/stability/stability_suite.h"

namespace figurine::stability {

INSTANTIATE_TEST_SUITE_P(Training, Stability, values_in(training_cases()), name_of);

}  // namespace figurine::stability
