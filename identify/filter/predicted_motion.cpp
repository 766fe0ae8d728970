#include "identify/filter/predicted_motion.h"

#include "identify/filter/nonlinear_recordings.h"
#include "identify/model/own_parameters.h"
#include "identify/model/starting_state.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

PredictedMotion::PredictedMotion(const Model& model, const Dataset& recording)
    : model_(model), recording_(recording) {
  if (is_linear(model)) {
    inputs_ = model_inputs(as_linear(model), recording.u);
  } else {
    memory_ = make_memory(as_formulas(model).equations);
  }
}

void PredictedMotion::set(const ParameterSet& given) {
  if (is_linear(model_)) {
    system_ = instantiate(as_linear(model_), given);
    by_entries_ = model_derivatives(as_linear(model_), given);
    return;
  }
  const FormulaModel& formulas = as_formulas(model_);
  const ParameterSet at = values_in(given, recording_);
  set_parameters(formulas.equations, memory_, formula_parameters(formulas, at));
  nodes_ = filter_nodes(model_, at, recording_);
  column_.clear();
  for (const EntryDerivative& entry : entry_derivatives(given)) {
    const auto parameter = static_cast<std::size_t>(entry.parameter);
    const std::vector<Index>& columns = formulas.equations.column;
    column_.push_back(parameter < columns.size() ? columns[parameter] : -1);
  }
}

void PredictedMotion::move(Index t, VectorXd& x, MatrixXd& dx) {
  if (!is_linear(model_)) {
    step(as_formulas(model_).equations, memory_, nodes_, t, x, slopes_);
    dx = (slopes_.wrt_x * dx).eval();
    for (std::size_t e = 0; e < column_.size(); ++e) {
      if (column_[e] >= 0) dx.col(static_cast<Index>(e)) += slopes_.wrt_p.col(column_[e]);
    }
    return;
  }
  const VectorXd u = inputs_.col(t);
  dx = (system_.A * dx).eval();
  for (std::size_t e = 0; e < by_entries_.size(); ++e) {
    dx.col(static_cast<Index>(e)) += by_entries_[e].A * x + by_entries_[e].B * u;
  }
  x = (system_.A * x + system_.B * u).eval();
}

void PredictedMotion::observe(Index t, const VectorXd& x, const MatrixXd& dx, VectorXd& y,
                              MatrixXd& dy) {
  if (!is_linear(model_)) {
    const NonlinearModel& equations = as_formulas(model_).equations;
    y.resize(equations.outputs);
    identikal::observe(equations, memory_, x, nodes_.at_sample.col(t), nodes_.time[t], y, slopes_);
    dy = slopes_.wrt_x * dx;
    for (std::size_t e = 0; e < column_.size(); ++e) {
      if (column_[e] >= 0) dy.col(static_cast<Index>(e)) += slopes_.wrt_p.col(column_[e]);
    }
    return;
  }
  const VectorXd u = inputs_.col(t);
  y = system_.C * x + system_.D * u;
  dy = system_.C * dx;
  for (std::size_t e = 0; e < by_entries_.size(); ++e) {
    dy.col(static_cast<Index>(e)) += by_entries_[e].C * x + by_entries_[e].D * u;
  }
}

}  // namespace identikal
