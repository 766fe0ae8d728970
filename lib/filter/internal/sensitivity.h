// How does the recursion move with one parameter? The derivatives of the model, which are given,
// and those of the recursion's own quantities. Internal to the filter.
#pragma once

#include <Eigen/Core>

namespace identikal {

/// The measurement side of a model, or of its derivative, restricted to the channels present.
struct Measurement {
  Eigen::MatrixXd C, D, R;
  Eigen::MatrixXd Sw;  ///< G S, n x ny
};

/// Derivatives with respect to one parameter.
struct Sensitivity {
  Eigen::MatrixXd A, B;
  Eigen::MatrixXd W;      ///< of G Q G'
  Measurement full, now;  ///< all channels; those present at this sample
  Eigen::MatrixXd P;
  Eigen::MatrixXd Z;            ///< of [x, X]: the state and its responses to delta
  Eigen::MatrixXd Sigma, K, E;  ///< at this sample
};

}  // namespace identikal
