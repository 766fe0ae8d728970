// Which states, of a chain in which each depends on its neighbours alone, and which parameters that
// all depend on make a sum of squares least, and how certain are the states?
#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/LU>

namespace identikal {

/// What is left of a quadratic function of n parameters and of states when the states are
/// integrated out.
struct MarginalQuadratic {
  Eigen::MatrixXd information;  ///< n x n
  Eigen::VectorXd gradient;     ///< n, at zero
  double log_likelihood = 0.0;  ///< the logarithm of the integral, but for the exponent
};

/// The function 1/2 sum of (r + a p + b x_t (+ c x_t-1))^2 of the moves p (n) of parameters and x_t
/// (2) of the states of one segment. Its second derivative with respect to the path is block
/// tridiagonal, H_t on the diagonal and U_t right of it. Eliminated forwards,
///   D_0 = H_0,  D_t = H_t - U_t-1' D_t-1^-1 U_t-1,  det H = prod det D_t,
/// the same for gradients g_t and cross derivatives G_t; information and gradient of p are what
/// remains. Substituted backwards,
///   x_t = -D_t^-1 (g_t + G_t p + U_t x_t+1),
///   P_t = D_t^-1 + D_t^-1 U_t P_t+1 U_t' D_t^-1,  cov(x_t, x_t+1) = -D_t^-1 U_t P_t+1.
class BlockTridiagonal {
 public:
  /// The two residuals r + by p + from x_t-1 + to x_t of an interval.
  struct Transition {
    Eigen::Matrix<double, 2, Eigen::Dynamic> by;
    Eigen::Matrix2d from, to;
    Eigen::Vector2d r;
  };
  /// The residual r + by p + slope' x_t of a sample.
  struct Sample {
    Eigen::RowVectorXd by;
    Eigen::Vector2d slope;
    double r;
  };
  /// A state at its optimum. `next` and `across` are of the row behind, where there is one.
  struct State {
    Eigen::Vector2d x;
    Eigen::Matrix2d P;
    const State* next = nullptr;
    Eigen::Matrix2d across = Eigen::Matrix2d::Zero();  ///< cov(x_t, x_t+1)
  };

  BlockTridiagonal(Eigen::Index rows, Eigen::Index parameters);

  /// Adds residuals, the parameters' share to `rest`.
  void add(Eigen::Index t, const Transition& step, MarginalQuadratic& rest);
  void add(Eigen::Index t, const Sample& sample, MarginalQuadratic& rest);

  /// Integrates the states out. Once, when all residuals are added.
  /// @param state_scale  units of the states, by which the density of a path is multiplied
  /// @return false when the residuals do not determine the path
  bool eliminate(const Eigen::Vector2d& state_scale, MarginalQuadratic& rest);

  /// The optimum of the path for these parameters and its covariance: calls visit(t, state) from
  /// the last row to the first.
  template <typename Visit>
  void substitute(const Eigen::VectorXd& p, Visit&& visit) const {
    State next;
    for (auto t = static_cast<Eigen::Index>(blocks_.size()); t-- > 0;) {
      const Block& now = blocks_[t];
      const bool last = t + 1 == static_cast<Eigen::Index>(blocks_.size());
      State state;
      state.x = now.g + now.G * p;
      if (last) {
        state.P = now.inverse;
      } else {
        state.x += now.U * next.x;
        const Eigen::Matrix2d back = now.inverse * now.U;
        state.across = -back * next.P;
        state.P = now.inverse + back * next.P * back.transpose();
        state.next = &next;
      }
      state.x = (-now.inverse * state.x).eval();
      visit(t, state);
      state.next = nullptr;
      next = state;
    }
  }

 private:
  struct Block {
    Eigen::Matrix2d H = Eigen::Matrix2d::Zero(), U = Eigen::Matrix2d::Zero();
    Eigen::Matrix2d inverse;  ///< of D
    Eigen::Vector2d g = Eigen::Vector2d::Zero();
    Eigen::Matrix<double, 2, Eigen::Dynamic> G;
  };
  std::vector<Block> blocks_;
};

}  // namespace identikal
