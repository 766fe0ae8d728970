#include "identify/model/check.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include <fmt/format.h>

#include "identify/model/matrix_reader.h"
#include "lib/base/error.h"
#include "lib/base/median.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

template <typename... Parts>
[[noreturn]] void refuse(fmt::format_string<Parts...> text, Parts&&... parts) {
  throw std::invalid_argument(fmt::format(text, std::forward<Parts>(parts)...));
}

void check_parameters(const ParameterSet& parameters) {
  for (const Parameter& p : parameters) {
    if (p.value.size() == 0) refuse("parameter '{}' has no value", p.name);
    if (p.value.rows() != p.value.cols()) {
      refuse("parameter '{}' is {} x {}; expected a square matrix", p.name, p.value.rows(),
             p.value.cols());
    }
    if (!p.value.allFinite()) refuse("parameter '{}' is not finite", p.name);
    if (!(p.min <= p.max)) refuse("parameter '{}' has min {} above max {}", p.name, p.min, p.max);
  }
}

Index rows_of(const ParametrisedMatrix& matrix, const ParameterSet& parameters) {
  return matrix.block >= 0 ? parameters[matrix.block].value.rows() : matrix.constant.rows();
}

Index columns_of(const ParametrisedMatrix& matrix, const ParameterSet& parameters) {
  return matrix.block >= 0 ? parameters[matrix.block].value.cols() : matrix.constant.cols();
}

// Every entry lies in the matrix and refers to a scalar parameter that is there.
void check_entries(const char* name, const ParametrisedMatrix& matrix,
                   const ParameterSet& parameters) {
  const auto count = static_cast<int>(parameters.size());
  if (matrix.block >= count) {
    refuse("{} refers to parameter {} of {}", name, matrix.block + 1, count);
  }
  const auto inside = [&](int row, int col) {
    return row >= 0 && col >= 0 && row < matrix.constant.rows() && col < matrix.constant.cols();
  };
  const auto check_place = [&](int row, int col) {
    if (inside(row, col)) return;
    refuse("{} is {} x {}, and an entry is given for row {}, column {}", name,
           matrix.constant.rows(), matrix.constant.cols(), row + 1, col + 1);
  };
  for (const ParametrisedMatrix::Entry& entry : matrix.entries) {
    check_place(entry.row, entry.col);
    if (entry.parameter < 0 || entry.parameter >= count) {
      refuse("{} refers to parameter {} of {}", name, entry.parameter + 1, count);
    }
    if (parameters[entry.parameter].value.size() != 1) {
      refuse("an entry of {} refers to parameter '{}', which is a matrix", name,
             parameters[entry.parameter].name);
    }
    if (!std::isfinite(entry.factor)) refuse("a factor in {} is not finite", name);
  }
  for (const ParametrisedMatrix::Formula& formula : matrix.formulas) {
    check_place(formula.row, formula.col);
  }
  if (!matrix.constant.allFinite()) refuse("{} has an entry that is not finite", name);
}

void check_size(const char* name, const ParametrisedMatrix& matrix, const ParameterSet& parameters,
                Index rows, Index columns, const char* sides) {
  const Index own_rows = rows_of(matrix, parameters), own = columns_of(matrix, parameters);
  if (own_rows == rows && own == columns) return;
  refuse("{} is {} x {}; expected {} x {} ({})", name, own_rows, own, rows, columns, sides);
}

void check_symmetric(const char* name, const MatrixXd& value) {
  if ((value - value.transpose()).cwiseAbs().maxCoeff() <= 1e-12 * value.cwiseAbs().maxCoeff())
    return;
  refuse("{} is not symmetric", name);
}

// Models that a program fills by hand may leave their channels without names.
Index inputs_of(const Model& model) {
  if (!model.inputs.empty() || !has_filter(model)) return static_cast<Index>(model.inputs.size());
  if (is_formula_model(model)) return as_formulas(model).equations.inputs;
  const LinearModel& linear = as_linear(model);
  return linear.B.constant.cols() - (linear.offset ? 1 : 0);
}

Index outputs_of(const Model& model) {
  if (!model.outputs.empty() || !has_filter(model)) return static_cast<Index>(model.outputs.size());
  return is_formula_model(model) ? as_formulas(model).equations.outputs
                                 : as_linear(model).C.constant.rows();
}

// In the order in which one matrix determines the size of the next. Of a nonlinear model A, B, C
// and D hold sizes alone.
void check_matrices(const Model& model) {
  const LinearModel& m = noise_model(model);
  const ParameterSet& p = model.parameters;
  const std::pair<const char*, const ParametrisedMatrix*> all[] = {
      {"A", &m.A}, {"B", &m.B}, {"C", &m.C}, {"D", &m.D},   {"G", &m.G},
      {"Q", &m.Q}, {"R", &m.R}, {"S", &m.S}, {"x0", &m.x0}, {"P0", &m.P0}};
  for (const auto& [name, matrix] : all) check_entries(name, *matrix, p);
  const Index n = rows_of(m.A, p);
  if (n == 0) refuse("the model has no states: A is 0 x 0");
  check_size("A", m.A, p, n, n, "states x states");
  const bool linear = is_linear(model) || changes(model);
  const Index ny = outputs_of(model);
  if (ny == 0) refuse("the model has no outputs");
  const Index nu = columns_of(m.B, p);
  if (linear) {
    check_size("C", m.C, p, ny, n, "outputs x states");
    check_size("B", m.B, p, n, nu, "states x inputs");
    check_size("D", m.D, p, ny, nu, "outputs x inputs");
  }
  const Index nw = columns_of(m.G, p);
  check_size("G", m.G, p, n, nw, "states x process noises");
  check_size("Q", m.Q, p, nw, nw, "process noises x process noises");
  check_size("R", m.R, p, ny, ny, "outputs x outputs");
  if (linear) check_size("S", m.S, p, nw, ny, "process noises x outputs");
  if (m.initial == InitialState::given) {
    check_size("x0", m.x0, p, n, 1, "states x 1");
    check_size("P0", m.P0, p, n, n, "states x states");
  }
}

void check_references(const Model& model) {
  const StateReferences& references = model.references;
  const auto count = static_cast<Index>(references.channels.size());
  if (count == 0) return;
  if (!has_filter(model)) refuse("a reference of states, and the model has no filter");
  if (static_cast<Index>(references.sd.size()) != count || references.quantities.outputs != count) {
    refuse("{} references with {} standard deviations and {} quantities", count,
           references.sd.size(), references.quantities.outputs);
  }
}

// A free parameter that nothing depends on has no estimate.
void refuse_unused(const Model& model) {
  const LinearModel& m = noise_model(model);
  std::vector<bool> used(model.parameters.size(), false);
  for (const ParametrisedMatrix* matrix :
       {&m.A, &m.B, &m.C, &m.D, &m.G, &m.Q, &m.R, &m.S, &m.x0, &m.P0}) {
    for (const int i : parameters_in(*matrix)) used[i] = true;
  }
  if (is_formula_model(model)) {
    const auto use = [&](const std::vector<Index>& column) {
      for (std::size_t i = 0; i < column.size(); ++i) {
        if (column[i] != NonlinearModel::kInNoFormula) used[i] = true;
      }
    };
    use(as_formulas(model).equations.column);
    if (as_formulas(model).noise_scales) use(as_formulas(model).noise_scales->column);
    for (const ParametrisedMatrix& start : as_formulas(model).starts) {
      for (const int i : parameters_in(start)) used[static_cast<std::size_t>(i)] = true;
    }
  }
  for (const RecordingTable::Row& row : model.recordings.rows) {
    for (const auto& [parameter, source] : row.sources)
      used[static_cast<std::size_t>(source)] = true;
  }
  const int freedom = model.student ? model.student->parameter : -1;
  if (freedom >= 0) used[static_cast<std::size_t>(freedom)] = true;
  for (std::size_t i = 0; i < used.size(); ++i) {
    const bool own = model.parameters[i].scope == Scope::recording;  // another's value somewhere
    if (used[i] || own || model.parameters[i].fixed) continue;
    refuse("parameter '{}' is free, and nothing in the model uses it", model.parameters[i].name);
  }
}

void check_filter(const Model& model) {
  check_matrices(model);
  refuse_unused(model);
  const LinearModel& noise = noise_model(model);
  const bool linear = is_linear(model) || changes(model);
  const StateSpace at =
      linear ? written_matrices(noise, model.parameters) : instantiate(noise, model.parameters);
  check_symmetric("Q", at.Q);
  check_symmetric("R", at.R);
  if (const std::optional<ModelFault> fault = fault_at(noise, model.parameters)) {
    refuse("{}", fault->text);
  }
}

void check_time(const Dataset& data, Index size) {
  if (data.time.size() == 0) refuse("the recording has {} samples and no time", size);
  if (data.time.size() != size) {
    refuse("the recording has {} times for {} samples", data.time.size(), size);
  }
  if (!data.time.allFinite()) refuse("a time of the recording is not finite");
  for (Index k = 1; k < size; ++k) {
    if (data.time[k] > data.time[k - 1]) continue;
    refuse("time {} s follows {} s; expected times that rise", data.time[k], data.time[k - 1]);
  }
  if (!(data.dt > 0.0) || !std::isfinite(data.dt)) {
    refuse("the recording's sampling period is {} s; expected a time above 0", data.dt);
  }
}

// @param what  that the recording has `samples` of
void check_input_rows(const Model& model, const Dataset& data, Index samples, const char* what) {
  if (data.u.rows() != inputs_of(model)) {
    refuse("the recording has {} inputs, the model {}", data.u.rows(), inputs_of(model));
  }
  if (data.u.rows() > 0 && data.u.cols() != samples) {
    refuse("the recording has {} samples of its inputs and {} {}", data.u.cols(), samples, what);
  }
  if (data.inputs.size() != static_cast<std::size_t>(data.u.rows())) {
    refuse("the recording names {} inputs and has {}", data.inputs.size(), data.u.rows());
  }
}

constexpr double kPeriodTolerance = 0.01;  // of a step

bool takes_any_times(const Model& model) {
  return !has_filter(model) || (is_formula_model(model) && as_formulas(model).irregular);
}

void check_period(const Model& model, const Dataset& data) {
  const double step = model.time.step;
  const bool irregular = is_formula_model(model) && as_formulas(model).irregular;
  if (step > 0.0 && !irregular && !(std::abs(data.dt - step) <= kPeriodTolerance * step)) {
    refuse("the recording is sampled every {} s, the model every {} s", data.dt, step);
  }
  if (takes_any_times(model)) return;
  for (Index k = 1; k < data.time.size(); ++k) {
    const double between = data.time[k] - data.time[k - 1];
    if (std::abs(between - data.dt) <= kPeriodTolerance * data.dt) continue;
    refuse(
        "samples {} and {} are {} s apart, and the sampling period is {} s; expected one step, "
        "and a missing sample (NaN) where nothing was recorded",
        k, k + 1, between, data.dt);
  }
}

// Matrices of one step cannot serve recordings of two.
void check_one_period(const Model& model, const std::vector<Dataset>& recordings) {
  if (takes_any_times(model)) return;
  const double first = recordings.front().dt;
  for (std::size_t i = 1; i < recordings.size(); ++i) {
    if (std::abs(recordings[i].dt - first) <= kPeriodTolerance * first) continue;
    refuse("recording {} is sampled every {} s, the first every {} s", i + 1, recordings[i].dt,
           first);
  }
}

LinearModel with_defaults(LinearModel model) {
  const Index n = model.A.constant.rows(), ny = model.C.constant.rows();
  const auto set = [](ParametrisedMatrix& matrix, const MatrixXd& value) {
    const bool is_empty = matrix.constant.size() == 0 && matrix.block < 0;
    if (is_empty && (matrix.constant.rows() != value.rows() || matrix.constant.cols() == 0)) {
      matrix.constant = value;
    }
  };
  set(model.G, MatrixXd::Identity(n, n));
  const Index nu = std::max(model.B.constant.cols(), model.D.constant.cols());
  set(model.B, MatrixXd::Zero(n, nu));
  set(model.D, MatrixXd::Zero(ny, nu));
  set(model.S, MatrixXd::Zero(model.G.constant.cols(), ny));
  return model;
}

// Medians: one sample that stands for all, where a model that changes is printed.
MovingValues typical_values(const std::vector<Dataset>& recordings) {
  MovingValues out;
  out.inputs.resize(recordings.front().u.rows());
  for (Index i = 0; i < out.inputs.size(); ++i) {
    std::vector<double> all;
    for (const Dataset& data : recordings) {
      for (const double value : data.u.row(i)) {
        if (std::isfinite(value)) all.push_back(value);
      }
    }
    out.inputs[i] = all.empty() ? 1.0 : median(std::move(all));
  }
  const Eigen::VectorXd& time = recordings.front().time;
  out.time = time[time.size() / 2];
  return out;
}

}  // namespace

void check_model(const Model& model) {
  check_parameters(model.parameters);
  check_references(model);
  if (has_filter(model)) check_filter(model);
}

void check_recording(const Model& model, const Dataset& data) {
  if (data.y.rows() == 0)
    refuse("the recording has no outputs; the model has {}", outputs_of(model));
  if (data.y.rows() != outputs_of(model)) {
    refuse("the recording has {} outputs, the model {}", data.y.rows(), outputs_of(model));
  }
  if (data.outputs.size() != static_cast<std::size_t>(data.y.rows())) {
    refuse("the recording names {} outputs and has {}", data.outputs.size(), data.y.rows());
  }
  check_input_rows(model, data, data.y.cols(), "of its outputs");
  if (data.y.cols() == 0) refuse("the recording has no samples");
  check_time(data, data.y.cols());
  check_period(model, data);
  if (data.y.array().isInf().any()) refuse("a sample of the outputs is infinite");
  if (data.u.array().isInf().any()) refuse("a sample of the inputs is infinite");
  const auto references = static_cast<Index>(model.references.channels.size());
  if (data.reference.rows() == 0) return;
  if (data.reference.rows() != references || data.reference.cols() != data.y.cols()) {
    refuse("the recording has {} x {} reference values; expected {} x {}", data.reference.rows(),
           data.reference.cols(), references, data.y.cols());
  }
}

void check_inputs(const Model& model, const Dataset& data) {
  if (data.time.size() == 0) refuse("the recording of the inputs has no samples, or no time");
  check_input_rows(model, data, data.time.size(), "times");
  check_time(data, data.time.size());
  check_period(model, data);
  for (Index k = 0; k < data.u.cols(); ++k) {
    if (data.u.col(k).allFinite()) continue;
    refuse(
        "{}: an input is missing or infinite in row {}; expected every input in every row, or a "
        "part of the recording where it is so",
        data.name, k + 1);
  }
}

Model checked_with_inputs(Model model, const Dataset* inputs) {
  const bool filter = has_filter(model);
  if (filter) noise_model(model) = with_defaults(std::move(noise_model(model)));
  if (inputs != nullptr) check_inputs(model, *inputs);
  if (inputs != nullptr && filter && model.time.step == 0.0) noise_model(model).dt = inputs->dt;
  check_model(model);
  return model;
}

Model checked(Model model, const std::vector<Dataset>& recordings) {
  if (recordings.empty()) throw std::invalid_argument("there is no recording");
  const bool filter = has_filter(model);
  if (filter) noise_model(model) = with_defaults(std::move(noise_model(model)));
  for (const Dataset& recording : recordings) check_recording(model, recording);
  check_one_period(model, recordings);
  if (filter && model.time.step == 0.0) noise_model(model).dt = recordings.front().dt;
  if (changes(model)) noise_model(model).typical = typical_values(recordings);
  check_model(model);
  return model;
}

void refuse_constraints(const Model& model, const std::string& what) {
  for (const SplineCurve& curve : model.curves) {
    if (!curve.smooth) continue;
    throw InputError({model.source, 0, 0},
                     fmt::format("{} with the smooth curve '{}'", what, curve.name),
                     "a curve that is not smooth", "'tune --method ml' and 'fit' learn how smooth");
  }
  if (model.constraints.empty()) return;
  throw InputError({model.source, 0, 0},
                   fmt::format("{} with the constraint '{}'", what, model.constraints.text[0]),
                   "no constraints", "'fit', and 'tune --method ml', keep them");
}

}  // namespace identikal
