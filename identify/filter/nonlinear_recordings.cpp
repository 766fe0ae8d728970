#include "identify/filter/nonlinear_recordings.h"

#include <algorithm>

#include <fmt/format.h>

#include "identify/filter/changing_recordings.h"
#include "lib/base/constants.h"
#include "lib/nonlinear/integration_steps.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd formula_parameters(const FormulaModel& model, const ParameterSet& at) {
  VectorXd out(model.equations.parameters);
  for (Index i = 0; i < out.size(); ++i) out[i] = at[i].scalar();
  return out;
}

FilterNoise noise_of(const StateSpace& written) {
  return {written.G * written.Q * written.G.transpose(), written.R, written.x0, written.P0};
}

// d(G Q G') and the rest.
FilterNoise noise_derivative(const StateSpace& written, const StateSpace& d) {
  const MatrixXd moved = d.G * written.Q * written.G.transpose();
  return {moved + moved.transpose() + written.G * d.Q * written.G.transpose(), d.R, d.x0, d.P0};
}

std::vector<FilterDirection> directions(const FormulaModel& model, const ParameterSet& at,
                                        const StateSpace& written) {
  std::vector<FilterDirection> out;
  const std::vector<EntryDerivative> entries = entry_derivatives(at);
  const std::vector<StateSpace> derivatives = model_derivatives(model.noise, at);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const int parameter = entries[i].parameter;
    out.push_back({parameter < model.equations.parameters ? parameter : -1,
                   noise_derivative(written, derivatives[i])});
  }
  return out;
}

NonlinearFilterOptions filter_options(const FormulaModel& model) {
  NonlinearFilterOptions out;
  out.method = model.filter;
  out.noise = model.noise.noise;
  out.wraps = model.wraps;
  return out;
}

// What `integration_step` asks for; one each in discrete time.
std::optional<IntegrationSteps> steps_of_file(const Model& model, const Dataset& recording) {
  const FormulaModel& formulas = as_formulas(model);
  const bool continuous = formulas.equations.continuous;
  if (continuous && !(formulas.longest_step > 0.0)) return std::nullopt;
  const double longest = continuous ? formulas.longest_step : kInfinity;
  const Index N = recording.size();
  const double widest =
      N < 2 ? 0.0 : (recording.time.tail(N - 1) - recording.time.head(N - 1)).maxCoeff();
  if (widest > kMostSteps * longest) {
    throw InputError({model.source, 0, 0},
                     fmt::format("integration_step {:.3g} s makes {:.3g} steps between two samples "
                                 "of '{}'",
                                 longest, widest / longest, recording.name),
                     fmt::format("at most {}", kMostSteps), "a longer step, or none");
  }
  IntegrationSteps out;
  out.steps = input_nodes(recording.time, recording.u, formulas.inputs, longest).steps;
  return out;
}

InputNodes nodes_in(const FormulaModel& model, const Dataset& recording,
                    const std::vector<int>& steps) {
  return input_nodes(recording.time, recording.u, model.inputs, steps);
}

// For the filter with these values.
InputNodes filter_nodes(const Model& model, const ParameterSet& at, const Dataset& recording) {
  return nodes_in(as_formulas(model), recording, integration_of(model, at, recording).steps);
}

// For the motion without noise from x.
IntegrationSteps motion_steps(const Model& model, const ParameterSet& at, const Dataset& recording,
                              const Eigen::Ref<const VectorXd>& x) {
  if (auto given = steps_of_file(model, recording)) return *given;
  const FormulaModel& formulas = as_formulas(model);
  return integration_steps(formulas.equations, formula_parameters(formulas, at), x, recording.time,
                           recording.u, formulas.inputs);
}

}  // namespace

IntegrationSteps integration_of(const Model& model, const ParameterSet& at,
                                const Dataset& recording) {
  const FormulaModel& formulas = as_formulas(model);
  if (formulas.linear) return {};
  if (auto given = steps_of_file(model, recording)) return *given;
  return integration_steps(formulas.equations, formula_parameters(formulas, at),
                           noise_of(written_matrices(formulas.noise, at)), recording.time,
                           recording.u, formulas.inputs, recording.y, filter_options(formulas));
}

NonlinearRecordings::NonlinearRecordings(const Model& model, const std::vector<Dataset>& recordings)
    : model_(model),
      recordings_(recordings),
      memory_(make_memory(as_formulas(model).equations)),
      options_(filter_options(as_formulas(model))) {
  for (const Dataset& recording : recordings) {
    steps_.push_back(integration_of(model, model.parameters, recording).steps);
    inputs_.push_back(nodes_in(as_formulas(model), recording, steps_.back()));
  }
}

bool NonlinearRecordings::refine(const ParameterSet& at) {
  bool halved = false;
  for (std::size_t i = 0; i < recordings_.size(); ++i) {
    const std::vector<int> needed = integration_of(model_, at, recordings_[i]).steps;
    bool here = false;
    for (std::size_t k = 0; k < needed.size(); ++k) {
      here = here || needed[k] > steps_[i][k];
      steps_[i][k] = std::max(steps_[i][k], needed[k]);
    }
    if (here) inputs_[i] = nodes_in(as_formulas(model_), recordings_[i], steps_[i]);
    halved = halved || here;
  }
  return halved;
}

const Likelihood& NonlinearRecordings::evaluate(const ParameterSet& at, bool with_derivatives,
                                                MatrixXd* score_products) {
  const FormulaModel& model = as_formulas(model_);
  const StateSpace written = written_matrices(model.noise, at);
  const FilterNoise noise = noise_of(written);
  const VectorXd p = formula_parameters(model, at);
  const std::vector<FilterDirection> by =
      with_derivatives ? directions(model, at, written) : std::vector<FilterDirection>{};
  const auto k = static_cast<Index>(by.size());
  sum_.status = FilterStatus::ok;
  sum_.value = 0.0;
  sum_.gradient.setZero(k);
  sum_.information.setZero(k, k);
  if (score_products != nullptr) score_products->setZero(k, k);
  MatrixXd products;
  for (std::size_t i = 0; i < recordings_.size(); ++i) {
    const Likelihood one =
        nonlinear_likelihood(model.equations, memory_, p, noise, by, inputs_[i], recordings_[i].y,
                             options_, score_products ? &products : nullptr);
    sum_.status = one.status;
    if (one.status != FilterStatus::ok) return sum_;
    sum_.value += one.value;
    if (k == 0) continue;
    sum_.gradient += one.gradient;
    sum_.information += one.information;
    if (score_products != nullptr) *score_products += products;
  }
  return sum_;
}

FilterStatus NonlinearRecordings::watch(const ParameterSet& at, bool with_derivatives,
                                        std::size_t recording, const FilteredStateWatcher& see) {
  const FormulaModel& model = as_formulas(model_);
  const StateSpace written = written_matrices(model.noise, at);
  const std::vector<FilterDirection> by =
      with_derivatives ? directions(model, at, written) : std::vector<FilterDirection>{};
  return watch_filtered_states(model.equations, memory_, formula_parameters(model, at),
                               noise_of(written), by, inputs_[recording], recordings_[recording].y,
                               options_, see)
      .status;
}

NonlinearRealisation simulate_nonlinear_outputs(const Model& model, const Dataset& recording,
                                                Random& random) {
  const FormulaModel& formulas = as_formulas(model);
  const FilterNoise noise = noise_of(written_matrices(formulas.noise, model.parameters));
  const IntegrationSteps steps = motion_steps(model, model.parameters, recording, noise.x0);
  if (steps.status == StepStatus::not_finite) {
    throw InputError({model.source, 0, 0},
                     fmt::format("simulated through '{}', at {:.6g} s: {}", recording.name,
                                 recording.time[steps.sample], describe(steps.status)),
                     "values from which the model can be simulated",
                     "other values, or time: {integration_step: ...}");
  }
  return simulate_nonlinear_outputs(
      formulas.equations, formula_parameters(formulas, model.parameters), noise,
      formulas.noise.noise, nodes_in(formulas, recording, steps.steps), random);
}

MatrixXd noise_free_outputs(const Model& model, const ParameterSet& at, const Dataset& recording,
                            const Eigen::Ref<const VectorXd>& x) {
  const FormulaModel& formulas = as_formulas(model);
  if (formulas.linear) return noise_free_changing_outputs(model, at, recording, x);
  FilterNoise noise = zero_noise(formulas.equations);
  noise.x0 = x;
  IntegrationSteps steps = motion_steps(model, at, recording, x);
  // Where it diverges any number does to show it.
  if (steps.steps.empty()) {
    steps.steps.assign(static_cast<std::size_t>(std::max<Index>(recording.size() - 1, 0)), 1);
  }
  Random unused(1);
  return simulate_nonlinear_outputs(formulas.equations, formula_parameters(formulas, at), noise,
                                    ProcessNoise::per_sample,
                                    nodes_in(formulas, recording, steps.steps), unused)
      .y;
}

MatrixXd transition_along(const Model& model, const ParameterSet& at, const Dataset& recording,
                          const Eigen::Ref<const MatrixXd>& states) {
  const FormulaModel& formulas = as_formulas(model);
  if (formulas.linear) return changing_transition(model, at, recording);
  ModelMemory memory = make_memory(formulas.equations);
  set_parameters(formulas.equations, memory, formula_parameters(formulas, at));
  const InputNodes nodes = filter_nodes(model, at, recording);
  MatrixXd out = MatrixXd::Identity(states.rows(), states.rows());
  Jacobian here;
  for (Index k = 0; k + 1 < states.cols(); ++k) {
    VectorXd x = states.col(k);
    step(formulas.equations, memory, nodes, k, x, here);
    out = (here.wrt_x * out).eval();
  }
  return out;
}

FilterResult nonlinear_filter(const Model& model, const ParameterSet& at, const Dataset& recording,
                              Keep keep) {
  const FormulaModel& formulas = as_formulas(model);
  return nonlinear_filter(formulas.equations, formula_parameters(formulas, at),
                          noise_of(written_matrices(formulas.noise, at)),
                          filter_nodes(model, at, recording), recording.y, filter_options(formulas),
                          keep);
}

SmootherResult nonlinear_smoother(const Model& model, const ParameterSet& at,
                                  const Dataset& recording, std::optional<Index> lag) {
  const FormulaModel& formulas = as_formulas(model);
  return nonlinear_smoother(formulas.equations, formula_parameters(formulas, at),
                            noise_of(written_matrices(formulas.noise, at)),
                            filter_nodes(model, at, recording), recording.y,
                            filter_options(formulas), lag, SmootherKeep::deviations);
}

}  // namespace identikal
