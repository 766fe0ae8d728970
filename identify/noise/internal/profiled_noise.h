// How likely is a simulation once the size of its noise is the best there is?
#pragma once

#include <optional>
#include <vector>

#include "identify/model/model.h"
#include "solvers/scoring.h"

namespace identikal {

/// Unknowns that say how large the noise of outputs is, each of its own, and nothing else.
struct NoiseScales {
  std::vector<Eigen::Index> scales, others;  ///< coordinates
  Eigen::VectorXd exponent;  ///< of each scale s: R_jj is proportional to s^exponent
  /// The noise follows the prediction besides: what is left once it is profiled out is no sum of
  /// squares alone.
  bool follow_prediction = false;
};

/// Nothing where the model has process noise or priors, or noise that no such unknown scales.
std::optional<NoiseScales> noise_scales(const Model& model);

/// Those of the others in which outputs are linear, whatever the rest is, and which have no bounds:
/// their share of the information stays, and slopes follow it, when all of them move at once.
std::vector<Eigen::Index> linear_coordinates(const LikelihoodProblem& problem,
                                             const NoiseScales& which,
                                             const Eigen::VectorXd& start);

/// The log-likelihood by the other coordinates, maximised over the scales: with n values and
/// S = sum e^2/R of the outputs that s scales, the maximum lies at s (S/n)^(1/exponent), and both
/// follow from slope and information by s,
///
///   n = 2 s^2 I_ss / exponent^2,   S = n + 2 s g_s / exponent.
///
/// and over coordinates in which outputs are linear, which one step of least squares brings to
/// their best (variable projection: Golub & Pereyra 1973; the information is Kaufman's, 1975).
/// Coordinates refer to the problem, which has to outlive this.
class ProfiledLikelihood {
 public:
  /// @param start   all coordinates
  /// @param linear  linear_coordinates(), or none
  ProfiledLikelihood(const LikelihoodProblem& problem, NoiseScales which,
                     const Eigen::VectorXd& start, std::vector<Eigen::Index> linear = {});

  LikelihoodProblem problem();
  Eigen::VectorXd start() const { return at_(which_.others); }
  /// All coordinates where the others are these, the scales at their best.
  Eigen::VectorXd all(const Eigen::VectorXd& others);

 private:
  bool settle(Eigen::VectorXd& gradient, Eigen::MatrixXd& information, double& L);
  bool settle_linear(Eigen::VectorXd& gradient, Eigen::MatrixXd& information, double& L);
  double move_scales(const Eigen::VectorXd& gradient, const Eigen::MatrixXd& information);

  const LikelihoodProblem& of_all_;
  NoiseScales which_;
  std::vector<Eigen::Index> linear_;
  Eigen::VectorXd at_;  // all coordinates, scales as the last evaluation left them
};

}  // namespace identikal
