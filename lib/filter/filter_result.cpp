#include "lib/filter/filter_result.h"

#include "lib/base/constants.h"

namespace identikal {

const char* describe(FilterStatus status) {
  switch (status) {
    case FilterStatus::ok:
      return "the filter ran";
    case FilterStatus::unstable:
      return "a stationary start needs a stable A: every eigenvalue inside the unit circle";
    case FilterStatus::indefinite:
      return "an innovation covariance is not positive definite: some output has no noise at all, "
             "or Q or R is indefinite";
    case FilterStatus::undetermined:
      return "the recording does not determine the diffuse initial state";
    case FilterStatus::not_finite:
      return "the filter overflowed, or an input sample is missing";
    case FilterStatus::beyond_digest:
      return "the filter remembers longer than the digest of the recording reaches";
  }
  return "";
}

FilterResult empty_filter_result(Eigen::Index states, Eigen::Index outputs, Eigen::Index N,
                                 Keep keep) {
  FilterResult out;
  out.e = Eigen::MatrixXd::Constant(outputs, N, kNaN);
  out.standardised = out.e;
  out.e_sd = out.e;
  if (keep == Keep::everything) {
    out.x_pred = Eigen::MatrixXd::Constant(states, N, kNaN);
    out.x_filt = out.x_pred;
    out.P_pred.resize(static_cast<std::size_t>(N));
    out.P_filt.resize(static_cast<std::size_t>(N));
    out.Sigma.resize(static_cast<std::size_t>(N));
  }
  return out;
}

}  // namespace identikal
