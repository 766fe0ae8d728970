// How do states move on without another measurement, and what would be measured then?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/model/nonlinear_model.h"
#include "lib/model/state_space.h"

namespace identikal {

/// The mean of the state along a recording's inputs, from wherever it begins, with derivatives by the
/// free entries (lib/model/parameter.h), k of them. Of linear models and formulas; keeps references to
/// both; one per thread.
///
/// Example:
///
///     PredictedMotion motion(model, recordings[0]);
///     motion.set(model.parameters);
///     Eigen::VectorXd x = Eigen::VectorXd::Zero(2);
///     Eigen::MatrixXd dx = Eigen::MatrixXd::Zero(2, coordinates(model.parameters).size());
///     motion.move(0, x, dx);  // from sample 0 to sample 1
class PredictedMotion {
 public:
  PredictedMotion(const Model& model, const Dataset& recording);

  void set(const ParameterSet& at);
  /// From sample t to the next. @param x  n; @param dx  n x k
  void move(Eigen::Index t, Eigen::VectorXd& x, Eigen::MatrixXd& dx);
  /// @param y  ny, written; @param dy  ny x k, written
  void observe(Eigen::Index t, const Eigen::VectorXd& x, const Eigen::MatrixXd& dx,
               Eigen::VectorXd& y, Eigen::MatrixXd& dy);

 private:
  const Model& model_;
  const Dataset& recording_;
  // Of formulas.
  ModelMemory memory_;
  InputNodes nodes_;
  Jacobian slopes_;
  std::vector<Eigen::Index> column_;  // per entry, of the formulas' derivatives; -1: none
  // Of matrices.
  StateSpace system_;
  std::vector<StateSpace> by_entries_;
  Eigen::MatrixXd inputs_;
};

}  // namespace identikal
