// How likely are the shared unknowns, with every segment's initial state at its best for them?
#pragma once

#include <Eigen/Core>

#include "identify/vehicle/internal/initial_states.h"
#include "identify/vehicle/output_error.h"

namespace identikal {

/// The likelihood of a problem's parameters (and gain) alone: initial states are where it is largest,
/// found by Gauss-Newton steps from where they are expected to have moved since the likeliest
/// point so far. While what they still lack is little, it is added by the quadratic instead, and the slopes are
/// those there. One evaluation costs as many simulations as the steps take, mostly one, and time linear in the
/// number of segments. Source: variable projection, Golub and Pereyra (1973), "The differentiation of
/// pseudo-inverses and nonlinear least squares problems whose variables separate", SIAM J. Numer. Anal. 10.
class ProfiledStates {
 public:
  /// @param start  coordinates, from whose initial states it begins
  ProfiledStates(const VehicleProblem& problem, const Eigen::VectorXd& start);

  /// At these parameters and gains; as LikelihoodProblem::evaluate. false where the simulation diverges.
  bool evaluate(const Eigen::VectorXd& shared, double& L, Eigen::VectorXd& gradient,
                Eigen::MatrixXd& information);
  /// The same with the initial states where they belong. What coordinates() and errors() say is right then.
  bool settle(const Eigen::VectorXd& shared, double& L, Eigen::VectorXd& gradient,
              Eigen::MatrixXd& information);

  /// All coordinates of the last evaluation, and its errors.
  const Eigen::VectorXd& coordinates() const { return now_.z; }
  const Eigen::VectorXd& errors() const { return now_.e; }

 private:
  struct Point {
    Eigen::VectorXd z, e;
    double L = 0.0;
    EliminatedStates eliminated;
  };

  bool move_states(const Eigen::VectorXd& shared, double lacking);
  void report(double& L, Eigen::VectorXd& gradient, Eigen::MatrixXd& information) const;
  bool linearise(const Eigen::VectorXd& z, Point& out);
  Eigen::VectorXd expected(const Eigen::VectorXd& shared) const;
  Eigen::VectorXd clipped(Eigen::VectorXd z) const;

  const VehicleProblem& problem_;
  Eigen::Index shared_;
  LeastSquares::RowMatrix J_;
  Point now_, next_;
  Eigen::VectorXd likeliest_;  // coordinates
  Eigen::MatrixXd by_shared_;  // of the initial states, there; empty before the first evaluation
  double highest_;
};

}  // namespace identikal
