#include "lib/filter/filter_result.h"

namespace identikal {

const char* describe(FilterStatus status) {
  switch (status) {
    case FilterStatus::ok:
      return "the filter ran";
    case FilterStatus::unstable:
      return "a stationary start needs a stable A: every eigenvalue inside the unit circle";
    case FilterStatus::indefinite:
      return "an innovation covariance is not positive definite: some output has no noise at all, "
             "or Q or "
             "R is indefinite";
    case FilterStatus::undetermined:
      return "the recording does not determine the diffuse initial state";
    case FilterStatus::not_finite:
      return "the filter overflowed, or an input sample is missing";
  }
  return "";
}

}  // namespace identikal
