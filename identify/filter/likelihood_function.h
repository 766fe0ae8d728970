// How likely are recordings, for those who bring an optimiser or a sampler of their own?
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Of p free parameters, in SI.
struct LikelihoodValue {
  bool defined = false;         ///< else there is no likelihood here, and what follows is empty
  double log_likelihood = 0.0;  ///< sum over recordings, log 2 pi included
  Eigen::VectorXd gradient;     ///< p: of the log-likelihood, exact
  Eigen::MatrixXd information;  ///< p x p: Fisher's, expected given the inputs
};

/// The log-likelihood of recordings under a linear or nonlinear model as a function of its free
/// parameters: the sum over innovations e(t) ~ N(0, Sigma(t)) of the filter,
///
///   log L = -1/2 sum_t (log det 2 pi Sigma(t) + e(t)' Sigma(t)^-1 e(t)).
///
/// Example:
///
///     LikelihoodFunction likelihood(model, recordings);
///     Eigen::VectorXd p = likelihood.start();
///     const LikelihoodValue at = likelihood(p);
///     p += at.information.ldlt().solve(at.gradient);  // a step of the method of scoring
///
/// With a diffuse start it is the exact diffuse one, without log 2 pi for the diffuse states.
/// Source: Durbin & Koopman (2012), chapter 5 for the diffuse start; lib/filter/likelihood.h. It
/// owns what it needs; one per thread.
class LikelihoodFunction {
 public:
  /// @throws std::invalid_argument as checked() (identify/model/check.h); InputError for a vehicle,
  ///   a regression, and inputs with gaps
  LikelihoodFunction(const Model& model, std::vector<Dataset> recordings);
  ~LikelihoodFunction();
  LikelihoodFunction(LikelihoodFunction&&) noexcept;
  LikelihoodFunction& operator=(LikelihoodFunction&&) noexcept;

  /// Of the free parameters and of distinct entries of unknown matrices, "Q(2,1)": p.
  const std::vector<std::string>& names() const;
  /// Their values in the model.
  Eigen::VectorXd start() const;
  /// @param p            free parameters in the order of names(), SI
  /// @param derivatives  gradient and information are computed too
  /// @throws std::invalid_argument when their number differs
  LikelihoodValue operator()(const Eigen::VectorXd& p, bool derivatives = true);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace identikal
