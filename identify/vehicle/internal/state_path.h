// How likely are parameters and a path of the state together, and parameters and noise alone?
#pragma once

#include <limits>
#include <vector>

#include <Eigen/Core>

#include "identify/vehicle/internal/block_tridiagonal.h"
#include "identify/vehicle/output_error.h"
#include "solvers/sparse_least_squares.h"

namespace identikal {

/// sd of the outputs, then of the process: in this order everywhere.
using NoiseSd = Eigen::VectorXd;

/// The least squares problem over (parameters, states of all rows), all scaled. Its residuals, in
/// this order: for every row of every segment the two of the interval that ends there (none at a
/// segment's first row), then one for each of its samples; at the end one for every prior.
class StatePath {
 public:
  explicit StatePath(const VehicleProblem& problem);
  StatePath(const StatePath&) = delete;
  StatePath& operator=(const StatePath&) = delete;

  Eigen::Index outputs() const { return outputs_; }
  const SparseLeastSquares& sparse() const { return sparse_; }

  /// @param weight  of every sample: 1, or next to nothing where it is left out
  void set_noise(const NoiseSd& noise, const Eigen::VectorXd& weight) {
    noise_ = noise;
    weight_ = weight;
  }

  /// The simulation's motion as a path to begin at.
  /// @param z  coordinates of the simulation
  Eigen::VectorXd begin(const Eigen::VectorXd& z) const;

  /// Simulation coordinates of the same parameters and first states.
  Eigen::VectorXd coordinates(const Eigen::VectorXd& x) const;

  /// (vy, r) of every segment, a column per row, SI.
  std::vector<Eigen::Matrix2Xd> states(const Eigen::VectorXd& x) const;

  /// The problem about x, at the noise that is set.
  struct Linearisation {
    Eigen::VectorXd r;
    std::vector<double> J;
    NoiseSd noise;
    Eigen::VectorXd parameters, weight;
  };
  Linearisation linearise(const Eigen::VectorXd& x) const;

  /// What is left of the linearised problem at other noise when parameters and path have moved to
  /// their optimum and the path is integrated out.
  struct Marginal {
    double log_likelihood = -std::numeric_limits<double>::infinity();
    NoiseSd moved;                ///< squares expected of each standardised noise, summed
    NoiseSd counts;               ///< and how many there are
    Eigen::MatrixXd information;  ///< of the parameters' coordinates
    Eigen::VectorXd residuals;    ///< of the samples over their sd, as the problem orders them
    Eigen::VectorXd deviation;    ///< of each from its prediction by all others, over its sd
  };
  Marginal marginal(const Linearisation& about, const NoiseSd& noise) const;

 private:
  /// Where the residuals and derivatives of a row of the recording begin, and its samples.
  struct Place {
    bool has_transition = false;
    Eigen::Index residual = 0;
    std::size_t derivative = 0;
    std::size_t sample = 0, samples = 0;
  };
  struct Evaluation;
  struct Rescaled;

  bool evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& r, std::vector<double>* J) const;

  /// The residuals of a segment's rows; the parameters' share goes to `rest`.
  BlockTridiagonal assembled(std::size_t segment, const Rescaled& rows,
                             MarginalQuadratic& rest) const;

  /// Adds what is expected of the noise of one segment, its path at the optimum.
  void add_expected_noise(std::size_t segment, const BlockTridiagonal& path, const Rescaled& rows,
                          const Eigen::VectorXd& p, Marginal& out) const;

  /// The parameters' move, which leaves alone what the optimiser has at a bound.
  Eigen::VectorXd move_of(const Eigen::VectorXd& at, const Eigen::MatrixXd& information,
                          const Eigen::VectorXd& gradient) const;

  bool has_prior(Eigen::Index i) const;

  const VehicleProblem& problem_;
  Eigen::Index outputs_, parameters_;
  SparseLeastSquares sparse_;
  std::vector<std::vector<Place>> places_;  // of every row of every segment
  Place end_;                               // behind the last row: the priors
  NoiseSd noise_;
  Eigen::VectorXd weight_;
};

}  // namespace identikal
