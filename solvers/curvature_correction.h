// What has to be added to expected information to have the observed one?
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace identikal {

/// Expected and observed curvature differ at finite N, which makes pure scoring converge linearly.
/// Near the maximum the difference E is learnt from the gradients, by symmetric rank one:
///   E += r r' / (r's),  r = fallen - (information + E) s.
/// Source: Dennis, Gay, Welsch (1981), "An adaptive nonlinear least-squares algorithm".
///
/// Example:
///
///     CurvatureCorrection correction(Eigen::MatrixXd::Zero(1, 1));
///     const Eigen::MatrixXd J{{2.0}};
///     correction.learn(Eigen::VectorXd{{0.1}}, Eigen::VectorXd{{0.3}}, J);  // the slope fell by 0.3
///     const auto observed = correction.apply(J, {0});                       // 3
class CurvatureCorrection {
 public:
  /// @param E  n x n, what is known of the difference
  explicit CurvatureCorrection(Eigen::MatrixXd E) : E_(std::move(E)) {}

  /// @param moved        n: s, a step
  /// @param fallen       n: the gradient before it minus that behind it
  /// @param information  n x n: the expected one, behind it
  void learn(const Eigen::VectorXd& moved, const Eigen::VectorXd& fallen,
             const Eigen::MatrixXd& information);

  /// E := diag(ratio) E diag(ratio): where information has changed as much.
  void scale(const Eigen::VectorXd& ratio);

  void forget() { E_.setZero(); }
  /// Is nothing known?
  bool is_empty() const { return E_.isZero(0.0); }

  /// The information with E added, as long as that is, on every combination of free coordinates, no
  /// less than a tenth of the information, where steps would grow too long, and no more than a
  /// thousand times it (a steering delay under a coarse model comes near that).
  std::optional<Eigen::MatrixXd> apply(const Eigen::MatrixXd& information,
                                       const std::vector<Eigen::Index>& free) const;

 private:
  Eigen::MatrixXd E_;
};

}  // namespace identikal
