#include "identify/shooting/internal/trajectory_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "identify/model/recording_nodes.h"
#include "identify/model/starting_state.h"
#include "lib/base/nearest_turn.h"
#include "lib/nonlinear/filter.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostDoublings = 6;  // of the steps between two samples
constexpr int kJumpDoublings = 3;
constexpr double kJump = 1e-2;        // of a state's scale
constexpr double kControlled = 1e-5;  // tolerance of implicit steps

std::vector<int> same_steps(const Dataset& recording, int steps) {
  return std::vector<int>(static_cast<std::size_t>(recording.size() - 1), steps);
}

}  // namespace

TrajectoryProblem::TrajectoryProblem(const Model& model, const std::vector<Dataset>& recordings)
    : model_(model),
      recordings_(recordings),
      box_(coordinate_box(model.parameters)),
      at_(model.parameters),
      memory_(make_memory(as_formulas(model).equations)) {
  const std::vector<EntryDerivative> entries = entry_derivatives(at_);
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    start_.push_back(noise_of_recording(as_formulas(model), r));
  }
  std::vector<std::vector<StateSpace>> by;
  for (const LinearModel& start : start_) by.push_back(model_derivatives(start, at_));
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const bool moves_start = std::any_of(by.begin(), by.end(), [&](const auto& of_recording) {
      return !of_recording[i].x0.isZero(0.0);
    });
    const auto parameter = static_cast<std::size_t>(entries[i].parameter);
    const std::vector<Index>& columns = equations().column;
    const Index column = parameter < columns.size() ? columns[parameter] : -1;
    if (column < 0 && !moves_start) continue;
    unknowns_.push_back(static_cast<Index>(i));
    column_.push_back(column);
  }
  logarithms_.assign(unknowns_.size(), false);
  slope_ = VectorXd::Ones(static_cast<Index>(unknowns_.size()));
  for (const Dataset& recording : recordings) {
    first_.push_back(samples_);
    samples_ += recording.size();
    nodes_.push_back(recording_nodes(as_formulas(model), at_, recording, same_steps(recording, 1)));
  }
  output_sd = VectorXd::Ones(equations().outputs);
  step_sd = VectorXd::Ones(equations().states);
  moved_.resize(equations().states);
  predicted_.resize(equations().outputs);
  weight_.resize(equations().outputs);
  error_.resize(equations().outputs);
}

void TrajectoryProblem::take_logarithms() {
  const std::vector<EntryDerivative> entries = entry_derivatives(model_.parameters);
  for (std::size_t i = 0; i < unknowns_.size(); ++i) {
    const auto entry = static_cast<std::size_t>(unknowns_[i]);
    const auto parameter = static_cast<std::size_t>(entries[entry].parameter);
    logarithms_[i] = moves_by_logarithm(model_.parameters[parameter]);
  }
}

VectorXd TrajectoryProblem::as_unknowns(const VectorXd& coordinates) const {
  VectorXd out = coordinates(unknowns_);
  for (std::size_t i = 0; i < unknowns_.size(); ++i) {
    const auto at = static_cast<Index>(i);
    if (logarithms_[i]) out[at] = std::log(out[at]);
  }
  return out;
}

VectorXd TrajectoryProblem::values_in(const ParameterSet& parameters) const {
  return as_unknowns(coordinates(parameters));
}

ParameterSet TrajectoryProblem::with_values(const ParameterSet& parameters,
                                            const VectorXd& p) const {
  VectorXd all = coordinates(parameters);
  for (std::size_t i = 0; i < unknowns_.size(); ++i) {
    const double value = p[static_cast<Index>(i)];
    const Index entry = unknowns_[i];
    all[entry] =
        logarithms_[i] ? std::clamp(std::exp(value), box_.lower[entry], box_.upper[entry]) : value;
  }
  return with_coordinates(parameters, all);
}

void TrajectoryProblem::take_delays() {
  const FormulaModel& model = as_formulas(model_);
  if (model.late.empty()) return;
  for (std::size_t r = 0; r < recordings_.size(); ++r) {
    const Dataset& data = recordings_[r];
    const double tolerance = nodes_[r].tolerance;
    nodes_[r] = tolerance > 0.0 ? controlled_recording_nodes(model, at_, data, tolerance)
                                : recording_nodes(model, at_, data, nodes_[r].steps);
  }
}

void TrajectoryProblem::set_parameters_to(const VectorXd& p) {
  at_ = with_values(at_, p);
  for (std::size_t i = 0; i < unknowns_.size(); ++i) {
    const auto at = static_cast<Index>(i);
    if (logarithms_[i]) slope_[at] = std::exp(p[at]);
  }
  set_parameters(equations(), memory_, formula_parameters(as_formulas(model_), at_));
  take_delays();
  const auto np = static_cast<Index>(unknowns_.size());
  x0_.resize(equations().states, recordings());
  x0_by_unknowns_.assign(start_.size(), MatrixXd(equations().states, np));
  for (std::size_t r = 0; r < start_.size(); ++r) {
    const Equilibrium from =
        starting_state(as_formulas(model_), formula_parameters(as_formulas(model_), at_),
                       written_matrices(start_[r], at_).x0, recordings_[r]);
    x0_.col(static_cast<Index>(r)) = from.x;
    const std::vector<StateSpace> by = model_derivatives(start_[r], at_);
    for (Index i = 0; i < np; ++i) {
      const auto unknown = static_cast<std::size_t>(i);
      x0_by_unknowns_[r].col(i) = from.wrt_x * by[static_cast<std::size_t>(unknowns_[unknown])].x0;
      if (column_[unknown] >= 0) x0_by_unknowns_[r].col(i) += from.wrt_p.col(column_[unknown]);
      x0_by_unknowns_[r].col(i) *= slope_[i];
    }
  }
}

// Steps from each sample to the next: doubled until that changes nothing.
// @return empty where they do not follow the motion at all
std::vector<int> TrajectoryProblem::explicit_steps(std::size_t recording, const MatrixXd& states,
                                                   const VectorXd& scale, double tolerance) {
  const FormulaModel& model = as_formulas(model_);
  const Dataset& data = recordings_[recording];
  const auto intervals = static_cast<std::size_t>(data.size() - 1);
  std::vector<int> steps(intervals, 0);
  std::vector<double> at_few(intervals, 0.0);  // change by the last of a few doublings
  MatrixXd ends(states.rows(), data.size() - 1);
  VectorXd before(states.rows());
  for (int doubling = 0; doubling <= kMostDoublings; ++doubling) {
    const InputNodes nodes = recording_nodes(model, at_, data, same_steps(data, 1 << doubling));
    bool all = true;
    for (std::size_t k = 0; k < intervals; ++k) {
      if (steps[k] > 0) continue;
      const auto column = static_cast<Index>(k);
      moved_ = states.col(first_[recording] + column);
      before = ends.col(column);
      step(equations(), memory_, nodes, column, moved_);
      ends.col(column) = moved_;
      const double change = ((moved_ - before).array().abs() / scale.array()).maxCoeff();
      if (doubling == kJumpDoublings) at_few[k] = change;
      if (doubling > 0 && change <= tolerance) steps[k] = 1 << (doubling - 1);
      all = all && steps[k] > 0;
    }
    if (all) return steps;
  }
  // The error at a jump of the rates falls slowly, and is small with a few steps already.
  for (std::size_t k = 0; k < intervals; ++k) {
    if (steps[k] > 0) continue;
    if (!(at_few[k] <= kJump)) return {};
    steps[k] = 1 << kJumpDoublings;
  }
  return steps;
}

void TrajectoryProblem::choose_steps(const VectorXd& p, const MatrixXd& states,
                                     const VectorXd& scale, double tolerance) {
  if (!equations().continuous) return;
  set_parameters_to(p);
  for (std::size_t r = 0; r < recordings_.size(); ++r) {
    const std::vector<int> steps = explicit_steps(r, states, scale, tolerance);
    const Dataset& data = recordings_[r];
    nodes_[r] = steps.empty()
                    ? controlled_recording_nodes(as_formulas(model_), at_, data, kControlled)
                    : recording_nodes(as_formulas(model_), at_, data, steps);
  }
}

MatrixXd TrajectoryProblem::states_at_start(const VectorXd& p) {
  set_parameters_to(p);
  MatrixXd out(equations().states, samples_);
  for (std::size_t r = 0; r < recordings_.size(); ++r) {
    out.middleCols(first_[r], recordings_[r].size()).colwise() = x0_.col(static_cast<Index>(r));
  }
  return out;
}

bool TrajectoryProblem::moves_states() {
  constexpr Index kLooked = 10;
  set_parameters_to(values_in(model_.parameters));
  if (unknowns_.empty()) return false;
  for (const MatrixXd& by : x0_by_unknowns_) {
    if (!by.isZero(0.0)) return true;
  }
  moved_ = x0_.col(0);
  for (Index k = 0; k + 1 < std::min(kLooked, recordings_[0].size()); ++k) {
    step(equations(), memory_, nodes_[0], k, moved_, motion_);
    if (!motion_.wrt_p.isZero(0.0)) return true;
  }
  return false;
}

MatrixXd TrajectoryProblem::filtered_states(const VectorXd& p, const VectorXd& scale) {
  MatrixXd out = states_at_start(p);
  const FormulaModel& model = as_formulas(model_);
  FilterNoise noise = zero_noise(equations());
  noise.Q = step_sd.array().square().matrix().asDiagonal();
  noise.R = output_sd.array().square().matrix().asDiagonal();
  noise.P0 = scale.array().square().matrix().asDiagonal();
  NonlinearFilterOptions options;
  options.wraps = model.wraps;
  for (std::size_t r = 0; r < recordings_.size(); ++r) {
    VectorXd last = noise.x0 = x0_.col(static_cast<Index>(r));
    const FilterResult filter =
        nonlinear_filter(equations(), formula_parameters(as_formulas(model_), at_), noise,
                         nodes_[r], recordings_[r].y, options);
    for (Index k = 0; k < recordings_[r].size(); ++k) {
      const bool seen = k < filter.x_filt.cols() && filter.x_filt.col(k).allFinite();
      if (seen) last = filter.x_filt.col(k);
      out.col(first_[r] + k) = last;
    }
  }
  return out;
}

bool TrajectoryProblem::simulate(const VectorXd& p, MatrixXd& states) {
  set_parameters_to(p);
  states.resize(equations().states, samples_);
  for (std::size_t r = 0; r < recordings_.size(); ++r) {
    moved_ = x0_.col(static_cast<Index>(r));
    for (Index k = 0; k < recordings_[r].size(); ++k) {
      if (!moved_.allFinite()) return false;
      states.col(first_[r] + k) = moved_;
      if (k + 1 < recordings_[r].size()) step(equations(), memory_, nodes_[r], k, moved_);
    }
  }
  return true;
}

void TrajectoryProblem::output_errors(const VectorXd& p, const MatrixXd& states, VectorXd& squares,
                                      VectorXd& counts) {
  set_parameters_to(p);
  squares = counts = VectorXd::Zero(equations().outputs);
  for (std::size_t r = 0; r < recordings_.size(); ++r) {
    for (Index k = 0; k < recordings_[r].size(); ++k) {
      look_at(r, k, states.col(first_[r] + k), false);
      for (Index i = 0; i < squares.size(); ++i) {
        if (weight_[i] == 0.0) continue;
        squares[i] += std::pow(error_[i] / weight_[i], 2);
        counts[i] += 1.0;
      }
    }
  }
}

// Of what was measured at a sample: y - h over its standard deviation, and one over that; 0 where
// nothing was.
void TrajectoryProblem::look_at(std::size_t recording, Index sample,
                                const Eigen::Ref<const VectorXd>& x, bool with_derivatives) {
  const Dataset& data = recordings_[recording];
  const auto u = nodes_[recording].at_sample.col(sample);
  const double time = nodes_[recording].time[sample];
  if (with_derivatives) {
    observe(equations(), memory_, x, u, time, predicted_, output_);
  } else {
    observe(equations(), memory_, x, u, time, predicted_);
  }
  const std::vector<bool>& wraps = as_formulas(model_).wraps;
  for (Index i = 0; i < predicted_.size(); ++i) {
    const bool measured = !std::isnan(data.y(i, sample));
    const double scale = data.noise_scale.size() > 0 ? data.noise_scale(i, sample) : 1.0;
    weight_[i] = measured ? 1.0 / (scale * output_sd[i]) : 0.0;
    double e = measured ? data.y(i, sample) - predicted_[i] : 0.0;
    if (!wraps.empty() && wraps[static_cast<std::size_t>(i)]) e = nearest_turn(e);
    error_[i] = weight_[i] * e;
  }
}

// Derivatives by the unknowns that stand in the formulas, one row of them times a factor.
void TrajectoryProblem::add_columns(const MatrixXd& from, Index of, double factor, MatrixXd& to,
                                    Index row) const {
  for (std::size_t j = 0; j < column_.size(); ++j) {
    const auto at = static_cast<Index>(j);
    if (column_[j] >= 0) to(row, at) += factor * slope_[at] * from(of, column_[j]);
  }
}

// From the sample to the next. @return the row behind
Index TrajectoryProblem::write_motion(std::size_t recording, Index sample, const MatrixXd& states,
                                      bool with_derivatives, Index row, ChainLink& link) {
  const Dataset& data = recordings_[recording];
  const Index at = first_[recording] + sample;
  moved_ = states.col(at);
  if (with_derivatives) {
    step(equations(), memory_, nodes_[recording], sample, moved_, motion_);
  } else {
    step(equations(), memory_, nodes_[recording], sample, moved_);
  }
  const double average = (data.time[data.size() - 1] - data.time[0]) / double(data.size() - 1);
  const double longer = std::sqrt((data.time[sample + 1] - data.time[sample]) / average);
  for (Index i = 0; i < moved_.size(); ++i, ++row) {
    const double weight = 1.0 / (step_sd[i] * longer);
    link.residuals[row] = weight * (moved_[i] - states(i, at + 1));
    if (!with_derivatives) continue;
    link.by_state.row(row) = weight * motion_.wrt_x.row(i);
    link.by_next_state(row, i) = -weight;
    add_columns(motion_.wrt_p, i, weight, link.by_shared, row);
  }
  return row;
}

bool TrajectoryProblem::write_link(std::size_t recording, Index sample, const MatrixXd& states,
                                   bool with_derivatives, ChainLink& link) {
  const Index nx = equations().states, np = static_cast<Index>(unknowns_.size());
  const Index at = first_[recording] + sample;
  const bool is_first = sample == 0, is_last = sample + 1 == recordings_[recording].size();
  look_at(recording, sample, states.col(at), with_derivatives);
  const Index measured = (weight_.array() > 0.0).count();
  const Index rows = measured + (is_first ? nx : 0) + (is_last ? 0 : nx);
  link.residuals.resize(rows);
  if (with_derivatives) {
    link.by_state.setZero(rows, nx);
    link.by_next_state.setZero(rows, nx);
    link.by_shared.setZero(rows, np);
  }
  Index row = 0;
  for (Index i = 0; i < weight_.size(); ++i) {
    if (weight_[i] == 0.0) continue;
    link.residuals[row] = error_[i];
    if (with_derivatives) {
      link.by_state.row(row) = -weight_[i] * output_.wrt_x.row(i);
      add_columns(output_.wrt_p, i, -weight_[i], link.by_shared, row);
    }
    ++row;
  }
  for (Index i = 0; is_first && i < nx; ++i, ++row) {
    link.residuals[row] = (x0_(i, static_cast<Index>(recording)) - states(i, at)) / step_sd[i];
    if (!with_derivatives) continue;
    link.by_state(row, i) = -1.0 / step_sd[i];
    link.by_shared.row(row) = x0_by_unknowns_[recording].row(i) / step_sd[i];
  }
  if (!is_last) write_motion(recording, sample, states, with_derivatives, row, link);
  return link.residuals.allFinite() &&
         (!with_derivatives || (link.by_state.allFinite() && link.by_shared.allFinite()));
}

bool TrajectoryProblem::write_links(const MatrixXd& states, const VectorXd& p,
                                    bool with_derivatives, std::vector<ChainLink>& links) {
  set_parameters_to(p);
  for (std::size_t r = 0; r < recordings_.size(); ++r) {
    for (Index k = 0; k < recordings_[r].size(); ++k) {
      ChainLink& link = links[static_cast<std::size_t>(first_[r] + k)];
      if (!write_link(r, k, states, with_derivatives, link)) return false;
    }
  }
  return true;
}

// From here the simulation goes on by one sample, x and its derivatives by the unknowns.
void TrajectoryProblem::move_on(std::size_t recording, Index sample, bool with_derivatives,
                                VectorXd& x, MatrixXd& by) {
  if (!with_derivatives) {
    step(equations(), memory_, nodes_[recording], sample, x);
    return;
  }
  step(equations(), memory_, nodes_[recording], sample, x, motion_);
  by = (motion_.wrt_x * by).eval();
  for (Index i = 0; i < x.size(); ++i) add_columns(motion_.wrt_p, i, 1.0, by, i);
}

bool TrajectoryProblem::write_simulation(const VectorXd& p, bool with_derivatives,
                                         std::vector<ChainLink>& links) {
  set_parameters_to(p);
  const auto np = static_cast<Index>(unknowns_.size());
  for (std::size_t r = 0; r < recordings_.size(); ++r) {
    const Dataset& data = recordings_[r];
    const Index rows = (data.y.array() == data.y.array()).count();
    ChainLink& link = links[r];
    link.residuals.resize(rows);
    if (with_derivatives) link.by_shared.resize(rows, np);
    link.by_state.resize(rows, 0);
    link.by_next_state.resize(rows, 0);
    VectorXd x = x0_.col(static_cast<Index>(r));
    MatrixXd by = x0_by_unknowns_[r];
    Index row = 0;
    for (Index k = 0; k < data.size(); ++k) {
      if (!x.allFinite()) return false;
      look_at(r, k, x, with_derivatives);
      for (Index i = 0; i < weight_.size(); ++i) {
        if (weight_[i] == 0.0) continue;
        link.residuals[row] = error_[i];
        if (with_derivatives) {
          link.by_shared.row(row) = -weight_[i] * output_.wrt_x.row(i) * by;
          add_columns(output_.wrt_p, i, -weight_[i], link.by_shared, row);
        }
        ++row;
      }
      if (k + 1 < data.size()) move_on(r, k, with_derivatives, x, by);
    }
    if (!link.residuals.allFinite() || (with_derivatives && !link.by_shared.allFinite())) {
      return false;
    }
  }
  return true;
}

ChainedLeastSquares TrajectoryProblem::simulation_problem() {
  ChainedLeastSquares out = problem();
  out.links = static_cast<Index>(recordings_.size());
  out.state = 0;
  out.evaluate = [this](const MatrixXd&, const VectorXd& p, bool with_derivatives,
                        std::vector<ChainLink>& links) {
    return write_simulation(p, with_derivatives, links);
  };
  return out;
}

ChainedLeastSquares TrajectoryProblem::problem() {
  ChainedLeastSquares out;
  out.links = samples_;
  out.state = equations().states;
  out.shared = static_cast<Index>(unknowns_.size());
  out.evaluate = [this](const MatrixXd& states, const VectorXd& p, bool with_derivatives,
                        std::vector<ChainLink>& links) {
    return write_links(states, p, with_derivatives, links);
  };
  out.lower = as_unknowns(box_.lower);
  out.upper = as_unknowns(box_.upper);
  return out;
}

}  // namespace identikal
