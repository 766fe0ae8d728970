#include "identify/model/check.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include <fmt/format.h>

#include "identify/model/matrix_reader.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

template <typename... Parts>
[[noreturn]] void refuse(fmt::format_string<Parts...> text, Parts&&... parts) {
  throw std::invalid_argument(fmt::format(text, std::forward<Parts>(parts)...));
}

bool is_filter(const ModelFile& model) {
  return model.form == ModelFile::Form::linear || model.form == ModelFile::Form::nonlinear;
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
Index inputs_of(const ModelFile& model) {
  if (!model.inputs.empty()) return static_cast<Index>(model.inputs.size());
  if (model.form == ModelFile::Form::nonlinear) return model.formulas.model.inputs;
  return model.linear.B.constant.cols() - (model.linear.offset ? 1 : 0);
}

Index outputs_of(const ModelFile& model) {
  if (!model.outputs.empty()) return static_cast<Index>(model.outputs.size());
  return model.form == ModelFile::Form::nonlinear ? model.formulas.model.outputs
                                                  : model.linear.C.constant.rows();
}

// In the order in which one matrix determines the size of the next. Of a nonlinear model A, B, C
// and D hold sizes alone.
void check_matrices(const ModelFile& model) {
  const LinearModel& linear = model.linear;
  const ParameterSet& p = model.parameters;
  const std::pair<const char*, const ParametrisedMatrix*> all[] = {
      {"A", &linear.A}, {"B", &linear.B}, {"C", &linear.C}, {"D", &linear.D},   {"G", &linear.G},
      {"Q", &linear.Q}, {"R", &linear.R}, {"S", &linear.S}, {"x0", &linear.x0}, {"P0", &linear.P0}};
  for (const auto& [name, matrix] : all) check_entries(name, *matrix, p);
  const Index n = rows_of(linear.A, p);
  if (n == 0) refuse("the model has no states: A is 0 x 0");
  check_size("A", linear.A, p, n, n, "states x states");
  const bool is_linear = model.form == ModelFile::Form::linear;
  const Index ny = outputs_of(model);
  if (ny == 0) refuse("the model has no outputs");
  const Index nu = columns_of(linear.B, p);
  if (is_linear) {
    check_size("C", linear.C, p, ny, n, "outputs x states");
    check_size("B", linear.B, p, n, nu, "states x inputs");
    check_size("D", linear.D, p, ny, nu, "outputs x inputs");
  }
  const Index nw = columns_of(linear.G, p);
  check_size("G", linear.G, p, n, nw, "states x process noises");
  check_size("Q", linear.Q, p, nw, nw, "process noises x process noises");
  check_size("R", linear.R, p, ny, ny, "outputs x outputs");
  if (is_linear) check_size("S", linear.S, p, nw, ny, "process noises x outputs");
  if (linear.initial == InitialState::given) {
    check_size("x0", linear.x0, p, n, 1, "states x 1");
    check_size("P0", linear.P0, p, n, n, "states x states");
  }
}

// A free parameter that nothing depends on has no estimate.
void refuse_unused(const ModelFile& model) {
  const LinearModel& m = model.linear;
  std::vector<bool> used(model.parameters.size(), false);
  for (const ParametrisedMatrix* matrix :
       {&m.A, &m.B, &m.C, &m.D, &m.G, &m.Q, &m.R, &m.S, &m.x0, &m.P0}) {
    for (const int i : parameters_in(*matrix)) used[i] = true;
  }
  const NonlinearModel& formulas = model.formulas.model;
  for (std::size_t i = 0; model.form == ModelFile::Form::nonlinear && i < formulas.column.size();
       ++i) {
    if (formulas.column[i] != NonlinearModel::kInNoFormula) used[i] = true;
  }
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (used[i] || model.parameters[i].fixed) continue;
    refuse("parameter '{}' is free, and nothing in the model uses it", model.parameters[i].name);
  }
}

void check_filter(const ModelFile& model) {
  check_matrices(model);
  refuse_unused(model);
  const StateSpace at = model.form == ModelFile::Form::linear
                            ? written_matrices(model.linear, model.parameters)
                            : instantiate(model.linear, model.parameters);
  check_symmetric("Q", at.Q);
  check_symmetric("R", at.R);
  if (const std::optional<ModelFault> fault = fault_at(model.linear, model.parameters)) {
    refuse("{}", fault->text);
  }
}

void check_time(const Dataset& data) {
  const Index size = data.y.cols();
  if (data.time.size() == 0) refuse("the recording has {} samples and no time", size);
  if (data.time.size() != size) {
    refuse("the recording has {} times for {} samples", data.time.size(), size);
  }
  if (!(data.dt > 0.0) || !std::isfinite(data.dt)) {
    refuse("the recording's sampling period is {} s; expected a time above 0", data.dt);
  }
  if (!data.time.allFinite()) refuse("a time of the recording is not finite");
  for (Index k = 1; k < size; ++k) {
    if (data.time[k] > data.time[k - 1]) continue;
    refuse("time {} s follows {} s; expected times that rise", data.time[k], data.time[k - 1]);
  }
}

void check_period(const ModelFile& model, const Dataset& data) {
  const double step = model.time.step;
  if (!(step > 0.0) || model.formulas.irregular) return;
  if (std::abs(data.dt - step) <= 0.01 * step) return;
  refuse("the recording is sampled every {} s, the model every {} s", data.dt, step);
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

}  // namespace

void check_model(const ModelFile& model) {
  check_parameters(model.parameters);
  if (is_filter(model)) check_filter(model);
}

void check_recording(const ModelFile& model, const Dataset& data) {
  if (data.y.rows() == 0)
    refuse("the recording has no outputs; the model has {}", outputs_of(model));
  if (data.y.rows() != outputs_of(model)) {
    refuse("the recording has {} outputs, the model {}", data.y.rows(), outputs_of(model));
  }
  if (data.outputs.size() != static_cast<std::size_t>(data.y.rows())) {
    refuse("the recording names {} outputs and has {}", data.outputs.size(), data.y.rows());
  }
  if (data.u.rows() != inputs_of(model)) {
    refuse("the recording has {} inputs, the model {}", data.u.rows(), inputs_of(model));
  }
  if (data.u.rows() > 0 && data.u.cols() != data.y.cols()) {
    refuse("the recording has {} samples of its inputs and {} of its outputs", data.u.cols(),
           data.y.cols());
  }
  if (data.inputs.size() != static_cast<std::size_t>(data.u.rows())) {
    refuse("the recording names {} inputs and has {}", data.inputs.size(), data.u.rows());
  }
  if (data.y.cols() == 0) refuse("the recording has no samples");
  check_time(data);
  check_period(model, data);
  if (data.y.array().isInf().any()) refuse("a sample of the outputs is infinite");
  if (data.u.array().isInf().any()) refuse("a sample of the inputs is infinite");
}

ModelFile checked(ModelFile model, const std::vector<Dataset>& recordings) {
  if (recordings.empty()) throw std::invalid_argument("there is no recording");
  if (is_filter(model)) model.linear = with_defaults(std::move(model.linear));
  for (const Dataset& recording : recordings) check_recording(model, recording);
  if (model.time.step == 0.0) model.linear.dt = recordings.front().dt;
  check_model(model);
  return model;
}

}  // namespace identikal
