// Which parameters make the innovations of a user's own filter most likely? Any filter, in any
// library, is tuned through a function that runs it.
#pragma once

#include <functional>
#include <optional>

#include "identify/estimate/results.h"
#include "lib/filter/innovations.h"
#include "lib/model/parameter.h"

namespace identikal {

/// Runs the filter over its recordings with these parameters; nothing where it does not run. It has
/// to be smooth in the parameters: the same samples used, no random numbers, tolerances of
/// iterations well below 1e-9.
using ExternalFilter = std::function<std::optional<Innovations>(const ParameterSet& at)>;

struct ExternalFilterOptions {
  int max_iterations = 100;
  std::function<bool(int iteration, double log_likelihood)> progress;  ///< return false to stop
};

/// Maximises the likelihood of the filter's innovations (lib/filter/innovations.h) over the free
/// parameters by Fisher scoring. Derivatives are central differences of innovations and
/// covariances, so an iteration takes two runs of the filter per free number. Standard errors come
/// from the information at the maximum, beside them those of a sandwich. The innovations at the
/// maximum are tested: their size (nis) and, channel by channel, whiteness (ljung_box).
///
/// Example:
///
///     const Parameter level{.name = "level", .value = Eigen::MatrixXd::Constant(1, 1, 900.0)};
///     const Eigen::MatrixXd Sigma = Eigen::MatrixXd::Identity(y.rows(), y.rows());
///     const ExternalFilter constant = [&](const ParameterSet& at) {
///       return Innovations{(y.array() - at[0].scalar()).matrix(), {Sigma}}; };
///     const auto estimate = fit_external_filter({level}, constant);
///
/// @throws std::invalid_argument when nothing is free or the filter does not run at the start
NoiseEstimate fit_external_filter(const ParameterSet& parameters, const ExternalFilter& filter,
                                  const ExternalFilterOptions& options = {});

}  // namespace identikal
