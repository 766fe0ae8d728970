// Which state-space models stand behind impulse responses?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/subspace/innovation_form.h"

namespace identikal {

/// x(t+1) = A x + B u, y = C x + D u from h_0 = D, h_k = C A^(k-1) B: Ho and Kalman's realisation by the singular value
/// decomposition of the block Hankel matrix, its states balanced over that horizon (Kung 1978). Of responses of a model it is
/// that model, or with fewer states a reduced one.
///
/// Example:
///
///     std::vector<Eigen::MatrixXd> h;  // 0, 1, 0.8, 0.64, ...
///     for (double value : {0.0, 1.0, 0.8, 0.64, 0.512}) h.push_back(Eigen::MatrixXd{{value}});
///     const ImpulseRealisation realisation(h);
///     const InnovationForm one_state = realisation.model(1);
class ImpulseRealisation {
 public:
  /// @param h  outputs x inputs of every lag from 0 on
  /// @throws std::invalid_argument for fewer than three, of unlike sizes, or not finite
  explicit ImpulseRealisation(const std::vector<Eigen::MatrixXd>& h);
  /// Falling.
  const Eigen::VectorXd& singular_values() const { return values_; }
  /// Orders above it are rounding.
  Eigen::Index most_states() const { return most_; }
  /// K and sigma are zero. @throws std::invalid_argument for an order below 1 or above most_states()
  InnovationForm model(Eigen::Index states) const;

 private:
  Eigen::MatrixXd D_, shifted_;  // shifted: the Hankel matrix one lag later
  Eigen::MatrixXd U_, V_;
  Eigen::VectorXd values_;
  Eigen::Index most_ = 0;
};

}  // namespace identikal
