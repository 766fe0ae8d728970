#include "identify/model/simulation_model.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "identify/model/parameter_prior.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// A new unknown, by a name that is free.
int add_unknown(ParameterSet& parameters, std::string name, const std::string& unit, double value,
                double min) {
  while (find_parameter(parameters, name) >= 0) name += "_";
  Parameter unknown;
  unknown.name = std::move(name);
  unknown.unit = unit;
  unknown.value = MatrixXd::Constant(1, 1, value);
  unknown.min = min;
  parameters.push_back(std::move(unknown));
  return static_cast<int>(parameters.size()) - 1;
}

// The start of one recording: unknown where the file gives a state a standard deviation.
ParametrisedMatrix unknown_start(Model& model, const StateSpace& written, std::size_t recording,
                                 bool alone) {
  ParametrisedMatrix out = noise_model(model).x0;
  for (Index i = 0; i < written.P0.rows(); ++i) {
    if (!(written.P0(i, i) > 0.0)) continue;
    const auto row = static_cast<int>(i);
    const StateName& state = model.states[static_cast<std::size_t>(i)];
    std::erase_if(out.entries, [&](const auto& entry) { return entry.row == row; });
    std::erase_if(out.formulas, [&](const auto& formula) { return formula.row == row; });
    const std::string name =
        state.name + "_start" + (alone ? "" : fmt::format("_{}", recording + 1));
    const int unknown = add_unknown(model.parameters, name, state.unit, written.x0[i], -kInfinity);
    out.constant(i, 0) = 0.0;
    out.entries.push_back({row, 0, unknown, 1.0});
  }
  return out;
}

// The unit of a variance.
std::string unit_squared(const std::string& unit) {
  if (unit.empty() || unit == "1") return unit;
  return unit.find_first_of(" */^") == std::string::npos ? unit + "^2" : "(" + unit + ")^2";
}

// A variance of its own for the errors of every output.
ParametrisedMatrix own_variances(Model& model, const StateSpace& written, bool in_si) {
  const Index ny = written.R.rows();
  ParametrisedMatrix out = constant_matrix(MatrixXd::Zero(ny, ny));
  for (Index j = 0; j < ny; ++j) {
    const ChannelSource& output = model.outputs[static_cast<std::size_t>(j)];
    const double value = written.R(j, j) > 0.0 ? written.R(j, j) : 1.0;
    const bool has_unit = !in_si && output.transform == Transform::none;
    const int unknown = add_unknown(model.parameters, kVarianceName + output.name,
                                    has_unit ? unit_squared(output.unit) : "", value, 0.0);
    out.entries.push_back({static_cast<int>(j), static_cast<int>(j), unknown, 1.0});
  }
  return out;
}

// Is a formula a multiple of its parameter, or of its square, as a standard deviation's variance is?
bool is_size(const Model& model, const ParametrisedMatrix::Formula& formula, int parameter) {
  const auto at = [&](double value) {
    ParameterSet values = model.parameters;
    values[static_cast<std::size_t>(parameter)].value.setConstant(value);
    return written_matrices(noise_model(model), values).R(formula.row, formula.col);
  };
  const double ratio = at(2.0) / at(1.0);
  constexpr double kRounding = 1e-12;
  return std::abs(ratio - 2.0) < kRounding || std::abs(ratio - 4.0) < kRounding;
}

// Does each output have a variance or a standard deviation that is a free parameter, and nothing
// else is?
bool has_own_variances(const Model& model) {
  const LinearModel& noise = noise_model(model);
  const ParametrisedMatrix& R = noise.R;
  if (R.block >= 0 || !R.constant.isZero(0.0)) return false;
  const std::vector<Index>& column = as_formulas(model).equations.column;
  const std::vector<int> of_start = parameters_in(noise.x0);
  std::vector<int> sizes(model.outputs.size(), 0);
  const auto takes = [&](int row, int col, int parameter) {
    const auto p = static_cast<std::size_t>(parameter);
    const bool moves = (p < column.size() && column[p] >= 0) ||
                       std::count(of_start.begin(), of_start.end(), parameter) > 0;
    if (row != col || moves || model.parameters[p].fixed) return false;
    ++sizes[static_cast<std::size_t>(row)];
    return true;
  };
  for (const ParametrisedMatrix::Entry& entry : R.entries) {
    if (!takes(entry.row, entry.col, entry.parameter)) return false;
  }
  for (const ParametrisedMatrix::Formula& formula : R.formulas) {
    if (formula.moves || formula.parameters.size() != 1) return false;
    const int parameter = formula.parameters.front();
    if (!takes(formula.row, formula.col, parameter) || !is_size(model, formula, parameter)) {
      return false;
    }
  }
  return std::all_of(sizes.begin(), sizes.end(), [](int n) { return n == 1; });
}

// What moves nothing any more.
void fix_unused(Model& model) {
  const FormulaModel& formulas = as_formulas(model);
  std::vector<bool> used(model.parameters.size(), false);
  for (std::size_t p = 0; p < formulas.equations.column.size(); ++p) {
    used[p] = formulas.equations.column[p] >= 0;
  }
  const auto use = [&](const ParametrisedMatrix& matrix) {
    for (const int p : parameters_in(matrix)) used[static_cast<std::size_t>(p)] = true;
  };
  use(formulas.noise.R);
  use(formulas.noise.P0);
  use(formulas.noise.x0);
  for (const ParametrisedMatrix& start : formulas.starts) use(start);
  for (std::size_t p = 0; p < used.size(); ++p) {
    if (used[p] || model.parameters[p].fixed) continue;
    model.parameters[p].fixed = true;
    model.parameters[p].value.setZero();
    model.parameters[p].min = std::min(model.parameters[p].min, 0.0);
    model.parameters[p].max = std::max(model.parameters[p].max, 0.0);
    model.parameters[p].prior = {};
  }
}

}  // namespace

Model without_process_noise(Model model, bool all_in_si) {
  if (!is_formula_model(model) || as_formulas(model).linear) {
    throw InputError({model.source, 0, 0}, "the objective 'simulation' belongs to formulas",
                     "states, dynamics and outputs as formulas",
                     "identikal model DATA --for simulation, where there are no equations");
  }
  if (as_formulas(model).noise_scales) {
    throw InputError({model.source, 0, 0},
                     "measurement noise that follows the prediction, inputs or time, and the "
                     "objective 'simulation'",
                     "noise of a constant size", "its errors have a variance of their own");
  }
  LinearModel& noise = noise_model(model);
  const StateSpace written = written_matrices(noise, model.parameters);
  noise.Q = constant_matrix(MatrixXd::Zero(written.Q.rows(), written.Q.cols()));
  if (all_in_si || !has_own_variances(model)) {
    noise.R = own_variances(model, written, all_in_si);
  }
  fix_unused(model);
  return model;
}

Model simulation_model(Model model, const std::vector<Dataset>& recordings) {
  if (!model.recordings.empty()) {
    throw InputError({model.source, 0, 0},
                     "parameters with values of their own in each recording, and the objective "
                     "'simulation'",
                     "--objective one-step",
                     "without process noise and with a start that is known, or parameters, it is "
                     "a simulation");
  }
  model = without_process_noise(std::move(model));
  FormulaModel& formulas = as_formulas(model);
  LinearModel& noise = formulas.noise;
  const StateSpace written = written_matrices(noise, model.parameters);
  if (formulas.rests_at && !written.P0.isZero(0.0)) {
    throw InputError({model.source, 0, 0},
                     "a start in a steady state that has standard deviations, and the objective "
                     "'simulation'",
                     "a steady state without 'sd', or a start with it",
                     "a simulation has one start, known or unknown");
  }
  noise.P0 = constant_matrix(MatrixXd::Zero(written.P0.rows(), written.P0.cols()));
  if (recordings.size() == 1) {
    noise.x0 = unknown_start(model, written, 0, true);
  } else {
    for (std::size_t r = 0; r < recordings.size(); ++r) {
      formulas.starts.push_back(unknown_start(model, written, r, false));
    }
    noise.x0 = constant_matrix(written.x0);
  }
  fix_unused(model);
  if (const auto names = names_with_priors(model.parameters); !names.empty()) {
    throw InputError({model.source, 0, 0},
                     fmt::format("the prior of {} with the objective 'simulation'", names.front()),
                     "no prior", "its errors are weighed against those of a filter");
  }
  return model;
}

std::vector<Dataset> with_starts(const Model& model, const ParameterSet& at,
                                 std::vector<Dataset> recordings) {
  const FormulaModel& formulas = as_formulas(model);
  if (formulas.starts.empty()) return recordings;
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    const StateSpace written = written_matrices(noise_of_recording(formulas, r), at);
    recordings[r].start_mean = written.x0;
    recordings[r].start_covariance = written.P0;
  }
  return recordings;
}

}  // namespace identikal
