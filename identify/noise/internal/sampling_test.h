// Would every second sample have given the same noise?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/estimate/estimate.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Score test of a linear model at an estimate: where the model is right, the log-likelihood of
/// every m-th sample alone has a gradient g of
///
///   covariance I_m - I_m I^-1 I_m
///
/// at the maximum of all samples' likelihood, I_m and I being the information of the two (Hausman
/// 1978; White 1982). Colour, a missing state or a wrong pole moves the two maxima apart, and
/// I_m^-1 g says how far in each parameter. Beside the maximum g is what all samples' own gradient
/// does not explain.
struct SamplingTest {
  double value = 0.0;     ///< chi-square with `dof` degrees of freedom
  int dof = 0;            ///< 0: there is no test
  Eigen::VectorXd shift;  ///< I_m^-1 g, of the entries asked for
};

/// @return no test where the values lie more than a standard error from the maximum
/// @param entries  free entries (lib/model/parameter.h) that are in question: those inside their
///   bounds
/// @param every    2 or more
SamplingTest sampling_test(const Model& model, const ParameterSet& at,
                           const std::vector<Dataset>& recordings,
                           const std::vector<Eigen::Index>& entries, int every);

/// Serious where two of every second, third and fifth sample alone contradict an estimate, or one
/// beyond doubt, and by more than 5 % of a value. Of linear models without inputs.
Findings check_sampling(const Estimate& estimate, const Model& model, const ParameterSet& end,
                        const std::vector<Dataset>& recordings);

}  // namespace identikal
