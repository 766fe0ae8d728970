// Where does one start lead, by simulations and by free trajectories?
#pragma once

#include <cmath>
#include <vector>

#include "identify/shooting/internal/trajectory_problem.h"
#include "identify/shooting/shooting.h"

namespace identikal {

/// One start of shoot(). Keeps references to model and recordings.
class Attempt {
 public:
  /// @param candidates  at least one
  Attempt(const Model& model, const std::vector<Dataset>& recordings,
          const std::vector<ParameterSet>& candidates);

  /// Least squares of the simulation on coarse steps of integration: a few steps from each of the best
  /// candidates, and from the lowest end of these to the end.
  void search_from_candidates();
  /// From the lowest so far, on fine steps and with outputs weighted by their errors, or their known
  /// noise.
  void refine();

  /// Begins the path of multiple shooting at the first candidate.
  void begin_path();
  /// @return is there another stage?
  bool next_stage();
  /// Least squares of the simulation from the end of the path, where that is lower than what the
  /// candidates have led to.
  void search_from_path();

  /// Do both lead to the same place? Where they are not further apart than noise can tell.
  bool meets(const Attempt& other) const;

  /// Has the path ended where the candidates had led?
  bool is_confirmed() const { return confirmed_; }

  ShootingEnd end() const;
  double loss() const { return loss_; }
  int iterations() const { return iterations_; }
  /// Outputs are this many times worse than those of a loss, on average over all of them.
  double worse_than(double loss) const;
  /// The outputs' errors, as a geometric mean in SI.
  double error() const { return std::exp(loss_ / values_); }
  /// Lower than another by more than a search leaves open.
  bool is_below(const Attempt& other) const;

 private:
  struct SimulatedEnd {
    Eigen::VectorXd p;
    double loss = std::numeric_limits<double>::infinity();
    bool converged = false;
    Eigen::MatrixXd root_information;
  };
  Eigen::MatrixXd choose_first_steps();
  SimulatedEnd best_of(std::vector<SimulatedEnd> ends);
  SimulatedEnd search_simulation(const Eigen::VectorXd& start, double tolerance, int iterations);
  void polish();
  // Outputs are weighted by their noise where it is known.
  void weigh_outputs(const Eigen::VectorXd& otherwise);
  void take(const SimulatedEnd& found, std::vector<ShootingStage> stages);
  double loss_of(const Eigen::VectorXd& squares, const Eigen::VectorXd& counts) const;
  double relative(const Eigen::VectorXd& squares, const Eigen::VectorXd& counts) const;
  bool simulation_follows(double allowed);
  void solve_and_count(const ChainedLeastSquares& problem, ChainedSolution& at, int iterations,
                       double tolerance);

  const Model& model_;
  const std::vector<Dataset>& recordings_;
  const Eigen::VectorXd known_;  // standard deviations of outputs; empty: some are not
  TrajectoryProblem problem_;
  std::vector<Eigen::VectorXd> candidates_;
  ParameterSet parameters_;
  Eigen::VectorXd deviation_, finest_;  // of outputs: what they scatter by, and the least error
  double values_ = 0.0;                 // measured
  int iterations_ = 0, evaluations_ = 0;
  // The lowest simulation so far.
  Eigen::VectorXd p_;
  double loss_ = std::numeric_limits<double>::infinity();
  bool converged_ = false, refined_ = false, confirmed_ = false;
  Eigen::MatrixXd root_information_;  // of errors that are as large as those there
  std::vector<ShootingStage> stages_;
  // The path.
  ChainedSolution trajectory_;
  Eigen::VectorXd scale_;
  double freedom_ = 0.0, tolerance_ = 0.0;
  std::vector<ShootingStage> path_;
};

}  // namespace identikal
