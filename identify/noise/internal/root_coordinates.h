// How does a search move coefficients whose polynomial must keep its roots outside the unit circle?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/noise/internal/covariance_factors.h"
#include "lib/base/random.h"
#include "solvers/scoring.h"

namespace identikal {

/// Coefficients of one polynomial with roots on the unit circle, or as near as a search goes.
struct RootsOnCircle {
  std::vector<Eigen::Index> entries;  ///< of the free ones (lib/model/parameter.h), by power
  Eigen::VectorXd sign;               ///< as in PolynomialFactor
  Eigen::VectorXd partial;            ///< partial autocorrelations
  std::vector<bool> held;             ///< those of them that the circle holds
  bool moving_average;
};

/// Coordinates in which the coefficients of autoregressions and moving averages
/// (lib/model/polynomial_factors.h) are partial autocorrelations: the region of stability and
/// invertibility, whose border a search along the coefficients themselves creeps along, is a box.
/// The others are those of FactorCoordinates. A moving average may lie on the border, where the
/// likelihood is what it is anywhere else; an autoregression has no stationary start there, and ends
/// a millionth before, where one more digit of it says nothing of the recording and costs as many.
///
/// Example:
///
///     const RootCoordinates roots(model, factors);
///     const LikelihoodProblem problem = factors.problem(likelihood.problem());
///     const Solution end = maximise(roots.problem(problem), roots.from(factors.from(start)));
class RootCoordinates {
 public:
  RootCoordinates(const Model& model, const FactorCoordinates& factors);

  bool any() const { return !factors_.empty(); }
  /// Is everything that is unknown of A, C and G a coefficient?
  bool hold_all_dynamics() const { return all_dynamics_; }
  /// Coefficients with roots inside or on the unit circle are taken nearer to zero.
  Eigen::VectorXd from(const Eigen::VectorXd& y) const;
  Eigen::VectorXd to(const Eigen::VectorXd& z) const;
  /// Partial autocorrelations anywhere, of small size more often where there are many; the others
  /// are left as they are.
  Eigen::VectorXd scattered(Eigen::VectorXd z, Random& random) const;
  /// z with a pole and a zero side by side at frequency 0 or at half of the sampling rate, or two of
  /// each over a grid of frequencies, in the place of those that cancel each other the most: a narrow
  /// line of the spectrum may be the likeliest thing there is, and no search from elsewhere sees it.
  /// By kind, in the order of frequency.
  std::vector<std::vector<Eigen::VectorXd>> with_lines(const Eigen::VectorXd& z) const;
  /// The largest difference of partial autocorrelations, by their atanh: 0.999 is far from 0.99.
  double distance(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const;
  /// Polynomials that lie on the border at z.
  std::vector<RootsOnCircle> on_circle(const Eigen::VectorXd& z) const;
  /// z with the moving averages on the border that are within a hundredth of it, where the
  /// log-likelihood is as high there to 1e-4. Towards it slopes vanish, and a search ends short.
  Eigen::VectorXd drawn_to_circle(const LikelihoodProblem& inside, Eigen::VectorXd z) const;
  /// The same problem with the partial autocorrelations that the circle holds at z held there: along
  /// them slopes and information are rounding.
  LikelihoodProblem held_to_circle(LikelihoodProblem inside, const Eigen::VectorXd& z) const;
  /// @param by_coefficients  in y, referred to
  LikelihoodProblem problem(const LikelihoodProblem& by_coefficients) const;

 private:
  struct Factor {
    std::vector<Eigen::Index> at, entries;  // of the coefficients: coordinates, free entries
    Eigen::VectorXd sign;
    bool moving_average;
    int lag, group;
  };
  void add_lines(const Eigen::VectorXd& z, const Factor& poles, const Factor& zeros,
                 std::size_t count, std::vector<std::vector<Eigen::VectorXd>>& out) const;

  std::vector<Factor> factors_;
  bool all_dynamics_ = false;
};

}  // namespace identikal
