// What do trajectories of a model of formulas lack that are free at every sample?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/model/nonlinear_model.h"
#include "solvers/chained_least_squares.h"

namespace identikal {

/// States at all samples of recordings, one after the other, and the unknowns that they move by.
/// The residuals are
///
///   (y(k) - h(x(k))) / output_sd   of what was measured,
///   (F(x(k)) - x(k+1)) / step_sd   from each sample to the next, F being the motion between them,
///   (x0 - x(1)) / step_sd          at the start of each recording.
///
/// With a small step_sd the states are those of a simulation, with a large one the trajectory
/// follows the measurements. Keeps references to model and recordings; one per thread.
class TrajectoryProblem {
 public:
  /// @param model  of formulas; its start has no variance
  TrajectoryProblem(const Model& model, const std::vector<Dataset>& recordings);

  /// Coordinates of the model's parameters that move trajectories; p below are their values, or the
  /// logarithms of those.
  const std::vector<Eigen::Index>& unknowns() const { return unknowns_; }
  Eigen::Index states() const { return equations().states; }
  Eigen::Index samples() const { return samples_; }
  Eigen::Index recordings() const { return static_cast<Eigen::Index>(recordings_.size()); }

  /// Does one of the unknowns move a state, over the first samples?
  bool moves_states();

  /// From here on p has the logarithms of what moves by them (lib/model/parameter.h).
  void take_logarithms();
  /// Of each of p: is it a logarithm?
  const std::vector<bool>& logarithms() const { return logarithms_; }

  /// The values of p in a set of parameters, and the other way round.
  Eigen::VectorXd values_in(const ParameterSet& parameters) const;
  ParameterSet with_values(const ParameterSet& parameters, const Eigen::VectorXd& p) const;

  Eigen::VectorXd output_sd;  ///< ny, SI
  Eigen::VectorXd
      step_sd;  ///< nx, SI: from a sample to the next, where those are as far apart as on average

  /// As many steps of the integration as the motion from each of these states needs, to `tolerance`
  /// of `scale`, or where it has a jump a few; implicit ones where that is too many.
  void choose_steps(const Eigen::VectorXd& p, const Eigen::MatrixXd& states,
                    const Eigen::VectorXd& scale, double tolerance);

  /// At every sample the start, nx x samples().
  Eigen::MatrixXd states_at_start(const Eigen::VectorXd& p);

  /// Where the extended filter sees the states, with these standard deviations.
  /// @param scale  nx: standard deviation of the start
  Eigen::MatrixXd filtered_states(const Eigen::VectorXd& p, const Eigen::VectorXd& scale);

  /// States without noise from the start; false where they are not finite.
  bool simulate(const Eigen::VectorXd& p, Eigen::MatrixXd& states);

  /// Per output: squares of y - h, summed, and how many there are.
  void output_errors(const Eigen::VectorXd& p, const Eigen::MatrixXd& states,
                     Eigen::VectorXd& squares, Eigen::VectorXd& counts);

  /// Refers to this object.
  ChainedLeastSquares problem();
  /// The same where no state is free: one link a recording. Refers to this object.
  ChainedLeastSquares simulation_problem();

 private:
  const NonlinearModel& equations() const { return as_formulas(model_).equations; }
  std::vector<int> explicit_steps(std::size_t recording, const Eigen::MatrixXd& states,
                                  const Eigen::VectorXd& scale, double tolerance);
  void set_parameters_to(const Eigen::VectorXd& p);
  Eigen::VectorXd as_unknowns(const Eigen::VectorXd& coordinates) const;
  // Inputs as they are with these delays, where a model has any.
  void take_delays();
  bool write_links(const Eigen::MatrixXd& states, const Eigen::VectorXd& p, bool with_derivatives,
                   std::vector<ChainLink>& links);
  bool write_simulation(const Eigen::VectorXd& p, bool with_derivatives,
                        std::vector<ChainLink>& links);
  bool write_link(std::size_t recording, Eigen::Index sample, const Eigen::MatrixXd& states,
                  bool with_derivatives, ChainLink& link);

  Eigen::Index write_motion(std::size_t recording, Eigen::Index sample,
                            const Eigen::MatrixXd& states, bool with_derivatives, Eigen::Index row,
                            ChainLink& link);
  void move_on(std::size_t recording, Eigen::Index sample, bool with_derivatives,
               Eigen::VectorXd& x, Eigen::MatrixXd& by);
  void look_at(std::size_t recording, Eigen::Index sample,
               const Eigen::Ref<const Eigen::VectorXd>& x, bool with_derivatives);
  void add_columns(const Eigen::MatrixXd& from, Eigen::Index of, double factor, Eigen::MatrixXd& to,
                   Eigen::Index row) const;

  const Model& model_;
  const std::vector<Dataset>& recordings_;
  std::vector<Eigen::Index> unknowns_;
  std::vector<Eigen::Index> column_;  // of each in the derivatives of the formulas; -1: none
  const Box box_;
  std::vector<bool> logarithms_;
  Eigen::VectorXd slope_;            // of each unknown's value, by p
  std::vector<Eigen::Index> first_;  // sample of each recording
  std::vector<InputNodes> nodes_;
  Eigen::Index samples_ = 0;
  ParameterSet at_;
  std::vector<LinearModel> start_;               // of each recording
  Eigen::MatrixXd x0_;                           // a column a recording
  std::vector<Eigen::MatrixXd> x0_by_unknowns_;  // of each recording
  ModelMemory memory_;
  Jacobian motion_, output_;
  Eigen::VectorXd moved_, predicted_;
  Eigen::VectorXd weight_, error_;  // of the outputs at a sample, see look_at()
};

}  // namespace identikal
