// Which state-space models of every order stand behind a predictor of many lags? Canonical variates: those
// combinations of the past that say most of the future.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/subspace/innovation_form.h"
#include "lib/subspace/predictor.h"

namespace identikal {

/// The state is what the past says of the outputs to come: x = T z_past, T from one singular value decomposition
/// of the predictor's block Hankel matrix, weighed by the innovations' covariance from the left (Larimore's
/// CVA) and by the past's from the right, as in the predictor form of subspace identification
/// (Chiuso 2007; Jansson 2003), which holds in closed loop. C, D, then A, B and K by regression on it, from the
/// sums alone.
///
/// Example:
///
///     const Realisation variates(sums, predictor);
///     const InnovationForm second_order = variates.model(2);
class Realisation {
 public:
  /// @throws std::invalid_argument where predictor and sums differ in lags or channels
  Realisation(const LaggedProducts& sums, const Predictor& predictor);

  /// Falling: how much each state says of the future, as a share of the root of its variance.
  const Eigen::VectorXd& singular_values() const { return singular_values_; }
  /// Orders above it are rounding.
  Eigen::Index most_states() const { return most_states_; }
  /// States of unit variance. Poles may lie outside of the unit circle.
  /// @throws std::invalid_argument for an order below 1 or above most_states()
  InnovationForm model(Eigen::Index states) const;

 private:
  const LaggedProducts sums_;
  Eigen::MatrixXd T_;  // rows: states, falling; columns: the past
  Eigen::VectorXd singular_values_;
  Eigen::Index most_states_ = 0;
};

}  // namespace identikal
