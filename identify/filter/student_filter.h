// What does a filter make of samples whose measurement noise follows Student's t?
#pragma once

#include <memory>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/filter_result.h"

namespace identikal {

struct StudentRun {
  /// As run_filter() has it (model_filter.h). `standardised` are the quantiles of a standard normal
  /// variable at the probabilities that each output had, given those before it in its row; `e_sd`
  /// and Sigma take the variance R nu / (nu - 2), nu at least 2.5.
  FilterResult filter;
  Eigen::VectorXd
      log_density;         ///< N: log p(y(t) | y(1), ..., y(t-1)); 0 in rows of a diffuse start
  Eigen::MatrixXd weight;  ///< ny x N: E[lambda | y(1), ..., y(t)]; 1 where nothing was measured
};

/// The filter of a model with StudentNoise over one recording,
///
///   y_i = h_i(x) + v_i,  v_i | lambda ~ N(0, R_ii / lambda),  lambda ~ Gamma(nu/2, nu/2),
///
/// so that v_i is Student's t with nu degrees of freedom and scale R_ii^1/2; outputs and samples are
/// independent. The state is taken for Gaussian before every output; with s = C_i P C_i', an output
/// has the density
///
///   p(e) = integral of N(e; 0, v) Gamma(lambda; nu/2, nu/2) d lambda,  v = s + R_ii / lambda,
///
/// and the state after it the exact mean and covariance, with g = -d log p / de and G = dg/de
///
///   x+ = x + P C_i' g,   P+ = P - P C_i' G C_i P,   g = e E[1/v],  G = E[1/v] - e^2 Var[1/v],
///
/// expectations over lambda given e. Outputs of a row come one after the other, formulas straight at
/// the mean before the row (extended filter). The rows that determine a diffuse start count as if
/// their noise were normal. Pseudo-measurements have the normal noise that the model states.
/// Source: Masreliez (1975), "Approximate non-Gaussian filtering with linear state and observation
/// relations", IEEE Trans. Automatic Control 20(1), eq. (5) to (10); the scale mixture: Roth, Ozkan &
/// Gustafsson (2013), "A Student's t filter for heavy tailed process and measurement noise".
///
/// Example:
///
///     StudentFilter filter(model, recordings[0]);
///     const StudentRun run = filter.run(model.parameters);
///     std::printf("log-likelihood %g\n", run.filter.log_likelihood);
class StudentFilter {
 public:
  /// Neither may be a temporary.
  /// @throws InputError when noises of outputs or of state and output are correlated, and for a
  ///   nonlinear filter other than the extended one
  StudentFilter(const Model& model, const Dataset& recording);
  ~StudentFilter();
  StudentFilter(StudentFilter&&) noexcept;

  StudentRun run(const ParameterSet& at, Keep keep = Keep::everything);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// The degrees of freedom nu of the model's measurement noise at these values.
double degrees_of_freedom(const Model& model, const ParameterSet& at);

}  // namespace identikal
