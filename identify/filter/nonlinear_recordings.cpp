#include "identify/filter/nonlinear_recordings.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "identify/filter/changing_recordings.h"
#include "identify/model/late_inputs.h"
#include "identify/model/own_parameters.h"
#include "identify/model/recording_nodes.h"
#include "identify/model/starting_state.h"
#include "lib/base/constants.h"
#include "lib/nonlinear/integration_steps.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Of what is tolerated of the log-likelihood: what steps are chosen by, controlled ones, and those
// that the log-likelihood is checked by.
constexpr double kChosen = 1e-2, kFollowed = 1e-3, kCheckedBy = 1e-4;
constexpr double kFinestControl = 1e-13;
constexpr int kManySteps = 64;  // between two samples: beyond, implicit steps cost less

double followed(const FormulaModel& model) {
  return std::max(kFinestControl, kFollowed * model.integration_tolerance);
}
double checked_by(const FormulaModel& model) {
  return std::max(kFinestControl, kCheckedBy * model.integration_tolerance);
}

// @param without_noise  where more steps are made by themselves
StepTolerance step_tolerance(const FormulaModel& model, bool without_noise) {
  StepTolerance out;
  out.relative = std::max(1e-12, kChosen * model.integration_tolerance);
  if (without_noise) out.most = kManySteps;
  return out;
}

FilterNoise noise_of(const StateSpace& written) {
  return {written.G * written.Q * written.G.transpose(), written.R, written.x0, written.P0};
}

struct StartedFilter {
  FilterNoise noise;
  std::vector<FilterDirection> directions;
};

// From where the motion rests before the recording.
void start_at_rest(const FormulaModel& model, const ParameterSet& at, const Dataset& recording,
                   StartedFilter& out) {
  const Equilibrium from =
      starting_state(model, formula_parameters(model, at), out.noise.x0, recording);
  out.noise.x0 = from.x;
  for (FilterDirection& each : out.directions) {
    each.noise.x0 = (from.wrt_x * each.noise.x0).eval();
    if (each.parameter < 0) continue;
    const Index column = model.equations.column[static_cast<std::size_t>(each.parameter)];
    if (column >= 0) each.noise.x0 += from.wrt_p.col(column);
  }
}

// Noise and start in a recording. A start of its own moves with no parameter.
StartedFilter started(const FormulaModel& model, const ParameterSet& at, const StateSpace& written,
                      const Dataset& recording, std::vector<FilterDirection> directions = {}) {
  StartedFilter out{noise_of(written), std::move(directions)};
  if (recording.start_mean.size() > 0) {
    out.noise.x0 = recording.start_mean;
    out.noise.P0 = recording.start_covariance;
    for (FilterDirection& each : out.directions) {
      each.noise.x0.setZero();
      each.noise.P0.setZero();
    }
  } else if (model.rests_at) {
    start_at_rest(model, at, recording, out);
  }
  return out;
}

// d(G Q G') and the rest.
FilterNoise noise_derivative(const StateSpace& written, const StateSpace& d) {
  const MatrixXd moved = d.G * written.Q * written.G.transpose();
  return {moved + moved.transpose() + written.G * d.Q * written.G.transpose(), d.R, d.x0, d.P0};
}

std::vector<FilterDirection> directions(const FormulaModel& model, const LinearModel& noise,
                                        const ParameterSet& at, const StateSpace& written) {
  std::vector<FilterDirection> out;
  const std::vector<EntryDerivative> entries = entry_derivatives(at);
  const std::vector<StateSpace> derivatives = model_derivatives(noise, at);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const int parameter = entries[i].parameter;
    out.push_back({parameter < model.equations.parameters ? parameter : -1,
                   noise_derivative(written, derivatives[i])});
  }
  return out;
}

// Does the state follow from the start and the inputs alone, whatever the free parameters are?
bool moves_without_noise(const FormulaModel& model, const ParameterSet& at) {
  if (!model.equations.continuous) return false;
  const auto none = [](const StateSpace& noise) {
    return noise.Q.isZero(0.0) && noise.P0.isZero(0.0);
  };
  const std::vector<StateSpace> derivatives = model_derivatives(model.noise, at);
  return none(written_matrices(model.noise, at)) &&
         std::all_of(derivatives.begin(), derivatives.end(), none);
}

NonlinearFilterOptions filter_options(const FormulaModel& model, const Dataset& recording) {
  NonlinearFilterOptions out;
  out.noise_scale = recording.noise_scale;
  out.method = model.filter;
  out.noise = model.noise.noise;
  out.wraps = model.wraps;
  out.scales = model.noise_scales ? &*model.noise_scales : nullptr;
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

InputNodes nodes_in(const FormulaModel& model, const ParameterSet& at, const Dataset& recording,
                    const Integration& integration) {
  return integration.controlled ? controlled_recording_nodes(model, at, recording, followed(model))
                                : recording_nodes(model, at, recording, integration.steps.steps);
}

// Twice as many steps, as far as there may be more.
std::vector<int> halved(std::vector<int> steps) {
  for (int& each : steps) each = std::min(2 * each, kMostSteps);
  return steps;
}

// Do these steps follow the motion from x at all? Without noise.
bool follow(const FormulaModel& model, const ParameterSet& at, const Dataset& recording,
            const std::vector<int>& steps, VectorXd x) {
  ModelMemory memory = make_memory(model.equations);
  set_parameters(model.equations, memory, formula_parameters(model, at));
  const InputNodes nodes = recording_nodes(model, at, recording, steps);
  for (Index k = 0; k + 1 < recording.size() && x.allFinite(); ++k) {
    step(model.equations, memory, nodes, k, x);
  }
  return x.allFinite();
}

// For the motion of the mean from x.
Integration motion_integration(const Model& model, const ParameterSet& at, const Dataset& recording,
                               const Eigen::Ref<const VectorXd>& x, bool without_noise) {
  const FormulaModel& formulas = as_formulas(model);
  if (auto given = steps_of_file(model, recording)) {
    return {*given, without_noise && !follow(formulas, at, recording, given->steps, x)};
  }
  const StepTolerance tolerance = step_tolerance(formulas, without_noise);
  Integration out{integration_steps(formulas.equations, formula_parameters(formulas, at), x,
                                    recording.time, inputs_at(formulas, at, recording),
                                    formulas.inputs, tolerance)};
  out.controlled = without_noise && out.steps.status != StepStatus::ok;
  return out;
}

Integration integration_from(const Model& model, const ParameterSet& at, const Dataset& recording,
                             const StateSpace& written);

}  // namespace

Integration integration_of(const Model& model, const ParameterSet& given,
                           const Dataset& recording) {
  const FormulaModel& formulas = as_formulas(model);
  if (formulas.linear) return {};
  const ParameterSet at = values_in(given, recording);
  return integration_from(model, at, recording, written_matrices(formulas.noise, at));
}

InputNodes filter_nodes(const Model& model, const ParameterSet& at, const Dataset& recording) {
  return nodes_in(as_formulas(model), at, recording, integration_of(model, at, recording));
}

namespace {

Integration integration_from(const Model& model, const ParameterSet& at, const Dataset& recording,
                             const StateSpace& written) {
  const FormulaModel& formulas = as_formulas(model);
  const bool without_noise = moves_without_noise(formulas, at);
  const FilterNoise noise = started(formulas, at, written, recording).noise;
  if (auto given = steps_of_file(model, recording)) {
    return {*given, without_noise && !follow(formulas, at, recording, given->steps, noise.x0)};
  }
  const StepTolerance tolerance = step_tolerance(formulas, without_noise);
  Integration out{integration_steps(formulas.equations, formula_parameters(formulas, at), noise,
                                    recording.time, inputs_at(formulas, at, recording),
                                    formulas.inputs, recording.y,
                                    filter_options(formulas, recording), tolerance)};
  out.controlled = without_noise && (out.steps.status != StepStatus::ok ||
                                     !follow(formulas, at, recording, out.steps.steps, noise.x0));
  return out;
}

}  // namespace

NonlinearRecordings::NonlinearRecordings(const Model& model, const std::vector<Dataset>& recordings)
    : model_(model),
      recordings_(recordings),
      memory_(make_memory(as_formulas(model).equations)),
      without_noise_(moves_without_noise(as_formulas(model), model.parameters)) {
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    const Dataset& recording = recordings[i];
    noise_.push_back(noise_of_recording(as_formulas(model), i));
    const Integration integration = integration_from(model, model.parameters, recording,
                                                     written_matrices(noise_[i], model.parameters));
    inputs_.push_back(nodes_in(as_formulas(model), model.parameters, recording, integration));
    options_.push_back(filter_options(as_formulas(model), recording));
    steps_.push_back(integration.steps.steps);
  }
}

NonlinearSteps::NonlinearSteps(const Model& model, const Dataset& recording)
    : model_(model),
      recording_(recording),
      nodes_(filter_nodes(model, model.parameters, recording)),
      memory_(make_memory(as_formulas(model).equations)) {}

void NonlinearSteps::set(const ParameterSet& given) {
  const FormulaModel& formulas = as_formulas(model_);
  const ParameterSet at = values_in(given, recording_);
  if (!formulas.late.empty()) nodes_ = filter_nodes(model_, at, recording_);
  set_parameters(formulas.equations, memory_, formula_parameters(formulas, at));
  noise_ = started(formulas, at, written_matrices(formulas.noise, at), recording_).noise;
  if (!noise_.R.isDiagonal(0.0)) {
    throw InputError({model_.source, 0, 0}, "outputs whose noises are correlated",
                     "a diagonal R: every output has a noise of its own");
  }
  gramians_.densities = noise_.Q.reshaped(noise_.Q.size(), 1);
}

void NonlinearSteps::start(VectorXd& x, MatrixXd& P) const {
  x = noise_.x0;
  P = noise_.P0;
}

void NonlinearSteps::see(Index t, const VectorXd& x, MatrixXd& C, VectorXd& h, VectorXd& R) {
  const FormulaModel& formulas = as_formulas(model_);
  h.resize(formulas.equations.outputs);
  observe(formulas.equations, memory_, x, nodes_.at_sample.col(t), nodes_.time[t], h, slopes_);
  C = slopes_.wrt_x;
  R = noise_.R.diagonal();
}

void NonlinearSteps::move(Index t, VectorXd& x, MatrixXd& P) {
  const FormulaModel& formulas = as_formulas(model_);
  const bool density = formulas.equations.continuous &&
                       formulas.noise.noise == ProcessNoise::density && !noise_.Q.isZero(0.0);
  step(formulas.equations, memory_, nodes_, t, x, slopes_, Derivatives::first,
       density ? &gramians_ : nullptr);
  const Index n = x.size();
  const MatrixXd W = density ? MatrixXd(gramians_.values.reshaped(n, n)) : noise_.Q;
  P = (slopes_.wrt_x * P * slopes_.wrt_x.transpose() + W).eval();
}

void NonlinearRecordings::take_delays(const ParameterSet& at) {
  const FormulaModel& model = as_formulas(model_);
  if (model.late.empty()) return;
  for (std::size_t i = 0; i < recordings_.size(); ++i) {
    const double tolerance = inputs_[i].tolerance;
    inputs_[i] = tolerance > 0.0 ? controlled_recording_nodes(model, at, recordings_[i], tolerance)
                                 : recording_nodes(model, at, recordings_[i], steps_[i]);
  }
}

double NonlinearRecordings::controlled_change(const ParameterSet& at, std::size_t i) {
  take_delays(at);
  const StateSpace written = written_matrices(noise_[i], at);
  const InputNodes controlled = controlled_recording_nodes(as_formulas(model_), at, recordings_[i],
                                                           checked_by(as_formulas(model_)));
  const Likelihood exact = evaluate_one(at, i, controlled, written, {}, nullptr);
  const Likelihood taken = evaluate_one(at, i, inputs_[i], written, {}, nullptr);
  if (exact.status != FilterStatus::ok) return 0.0;
  return taken.status == FilterStatus::ok ? exact.value - taken.value : kInfinity;
}

// Where noise moves the state there are no controlled steps: halved ones, of order 4.
double NonlinearRecordings::halved_change(const ParameterSet& at, std::size_t i) {
  constexpr double kOfTheRest = 16.0 / 15.0;
  take_delays(at);
  const StateSpace written = written_matrices(noise_[i], at);
  const InputNodes finer =
      recording_nodes(as_formulas(model_), at, recordings_[i], halved(steps_[i]));
  const Likelihood exact = evaluate_one(at, i, finer, written, {}, nullptr);
  const Likelihood taken = evaluate_one(at, i, inputs_[i], written, {}, nullptr);
  const bool both = exact.status == FilterStatus::ok && taken.status == FilterStatus::ok;
  return both ? kOfTheRest * (exact.value - taken.value) : 0.0;
}

double NonlinearRecordings::integration_change(const ParameterSet& at, std::size_t i) {
  return without_noise_ ? controlled_change(at, i) : halved_change(at, i);
}

double NonlinearRecordings::integration_error(const ParameterSet& at) {
  double out = 0.0;
  if (!as_formulas(model_).equations.continuous) return out;
  for (std::size_t i = 0; i < recordings_.size(); ++i) out += integration_change(at, i);
  return out;
}

bool NonlinearRecordings::refine(const ParameterSet& at) {
  take_delays(at);
  bool changed = false;
  for (std::size_t i = 0; i < recordings_.size(); ++i) {
    if (inputs_[i].tolerance > 0.0) continue;
    const Integration needed =
        integration_from(model_, at, recordings_[i], written_matrices(noise_[i], at));
    bool here = needed.controlled;
    if (here) {
      inputs_[i] = controlled_recording_nodes(as_formulas(model_), at, recordings_[i],
                                              followed(as_formulas(model_)));
    } else {
      const std::vector<int>& steps = needed.steps.steps;
      for (std::size_t k = 0; k < steps.size(); ++k) {
        here = here || steps[k] > steps_[i][k];
        steps_[i][k] = std::max(steps_[i][k], steps[k]);
      }
      if (here) inputs_[i] = recording_nodes(as_formulas(model_), at, recordings_[i], steps_[i]);
    }
    changed = changed || here;
  }
  const FormulaModel& model = as_formulas(model_);
  const bool chosen = !(model.longest_step > 0.0);
  if (!model.equations.continuous || !chosen || changed) return changed;
  const double size = std::max(1.0, std::abs(evaluate(at, false).value));
  for (std::size_t i = 0; i < recordings_.size(); ++i) {
    if (inputs_[i].tolerance > 0.0) continue;
    if (!(std::abs(integration_change(at, i)) > model.integration_tolerance * size)) continue;
    if (without_noise_) {
      inputs_[i] = controlled_recording_nodes(model, at, recordings_[i], followed(model));
    } else {
      steps_[i] = halved(steps_[i]);
      inputs_[i] = recording_nodes(model, at, recordings_[i], steps_[i]);
    }
    changed = true;
  }
  return changed;
}

// A trial that fixed steps do not follow is followed by controlled ones.
Likelihood NonlinearRecordings::evaluate_one(const ParameterSet& at, std::size_t recording,
                                             const InputNodes& inputs, const StateSpace& written,
                                             const std::vector<FilterDirection>& by,
                                             MatrixXd* score_products) {
  const FormulaModel& model = as_formulas(model_);
  const StartedFilter start = started(model, at, written, recordings_[recording], by);
  const auto through = [&](const InputNodes& nodes) {
    return nonlinear_likelihood(model.equations, memory_, formula_parameters(model, at),
                                start.noise, start.directions, nodes, recordings_[recording].y,
                                options_[recording], score_products);
  };
  const Likelihood out = through(inputs);
  if (out.status != FilterStatus::not_finite || !without_noise_ || inputs.tolerance > 0.0) {
    return out;
  }
  return through(controlled_recording_nodes(model, at, recordings_[recording], followed(model)));
}

const Likelihood& NonlinearRecordings::evaluate(const ParameterSet& at, bool with_derivatives,
                                                MatrixXd* score_products) {
  const FormulaModel& model = as_formulas(model_);
  take_delays(at);
  StateSpace written;
  std::vector<FilterDirection> by;
  const Index k = with_derivatives ? free_entries(at).size() : 0;
  sum_.status = FilterStatus::ok;
  sum_.value = 0.0;
  sum_.gradient.setZero(k);
  sum_.information.setZero(k, k);
  if (score_products != nullptr) score_products->setZero(k, k);
  MatrixXd products;
  for (std::size_t i = 0; i < recordings_.size(); ++i) {
    if (i == 0 || !model.starts.empty()) {
      written = written_matrices(noise_[i], at);
      if (with_derivatives) by = directions(model, noise_[i], at, written);
    }
    const Likelihood one =
        evaluate_one(at, i, inputs_[i], written, by, score_products ? &products : nullptr);
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
  take_delays(at);
  const StateSpace written = written_matrices(noise_[recording], at);
  const std::vector<FilterDirection> by = with_derivatives
                                              ? directions(model, noise_[recording], at, written)
                                              : std::vector<FilterDirection>{};
  const StartedFilter start = started(model, at, written, recordings_[recording], by);
  return watch_filtered_states(model.equations, memory_, formula_parameters(model, at), start.noise,
                               start.directions, inputs_[recording], recordings_[recording].y,
                               options_[recording], see)
      .status;
}

namespace {
[[noreturn]] void refuse_motion(const Model& model, const Dataset& recording, double time) {
  throw InputError({model.source, 0, 0},
                   fmt::format("simulated through '{}', at {:.6g} s: {}", recording.name, time,
                               describe(StepStatus::not_finite)),
                   "values from which the model can be simulated",
                   "other values, or time: {integration_step: ...}");
}
}  // namespace

NonlinearRealisation simulate_nonlinear_outputs(const Model& model, const Dataset& recording,
                                                Random& random) {
  const FormulaModel& formulas = as_formulas(model);
  const ParameterSet at = values_in(model.parameters, recording);
  StartedFilter start{noise_of(written_matrices(formulas.noise, at)), {}};
  if (formulas.rests_at) start_at_rest(formulas, at, recording, start);
  const FilterNoise& noise = start.noise;
  const Integration integration =
      motion_integration(model, at, recording, noise.x0, noise.Q.isZero(0.0));
  const IntegrationSteps& steps = integration.steps;
  if (!integration.controlled && steps.status == StepStatus::not_finite) {
    refuse_motion(model, recording, recording.time[steps.sample]);
  }
  NonlinearRealisation out = simulate_nonlinear_outputs(
      formulas.equations, formula_parameters(formulas, at), noise, formulas.noise.noise,
      nodes_in(formulas, at, recording, integration), random,
      formulas.noise_scales ? &*formulas.noise_scales : nullptr);
  for (Index k = 0; integration.controlled && k < out.x.cols(); ++k) {
    if (!out.x.col(k).allFinite()) refuse_motion(model, recording, recording.time[k]);
  }
  return out;
}

MatrixXd noise_free_outputs(const Model& model, const ParameterSet& given, const Dataset& recording,
                            const Eigen::Ref<const VectorXd>& x) {
  const FormulaModel& formulas = as_formulas(model);
  if (formulas.linear) return noise_free_changing_outputs(model, given, recording, x);
  const ParameterSet at = values_in(given, recording);
  FilterNoise noise = zero_noise(formulas.equations);
  noise.x0 = x;
  const Integration integration = motion_integration(model, at, recording, x, true);
  Random unused(1);
  return simulate_nonlinear_outputs(formulas.equations, formula_parameters(formulas, at), noise,
                                    ProcessNoise::per_sample,
                                    nodes_in(formulas, at, recording, integration), unused)
      .y;
}

MatrixXd transition_along(const Model& model, const ParameterSet& given, const Dataset& recording,
                          const Eigen::Ref<const MatrixXd>& states) {
  const FormulaModel& formulas = as_formulas(model);
  if (formulas.linear) return changing_transition(model, given, recording);
  const ParameterSet at = values_in(given, recording);
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

FilterResult nonlinear_filter(const Model& model, const ParameterSet& given,
                              const Dataset& recording, Keep keep) {
  const FormulaModel& formulas = as_formulas(model);
  const ParameterSet at = values_in(given, recording);
  return nonlinear_filter(
      formulas.equations, formula_parameters(formulas, at),
      started(formulas, at, written_matrices(formulas.noise, at), recording).noise,
      filter_nodes(model, at, recording), recording.y, filter_options(formulas, recording), keep);
}

FilterResult gated_innovations(const Model& model, const ParameterSet& given, Dataset& recording,
                               Index most_in_a_row,
                               const std::function<int(Index t, const FilterResult&)>& far) {
  const FormulaModel& formulas = as_formulas(model);
  const ParameterSet at = values_in(given, recording);
  const StartedFilter start =
      started(formulas, at, written_matrices(formulas.noise, at), recording);
  return gated_innovations(formulas.equations, formula_parameters(formulas, at), start.noise,
                           filter_nodes(model, at, recording), recording.y,
                           filter_options(formulas, recording), most_in_a_row, far);
}

SmootherResult nonlinear_smoother(const Model& model, const ParameterSet& given,
                                  const Dataset& recording, std::optional<Index> lag) {
  const FormulaModel& formulas = as_formulas(model);
  const ParameterSet at = values_in(given, recording);
  return nonlinear_smoother(
      formulas.equations, formula_parameters(formulas, at),
      started(formulas, at, written_matrices(formulas.noise, at), recording).noise,
      filter_nodes(model, at, recording), recording.y, filter_options(formulas, recording), lag,
      SmootherKeep::deviations);
}

}  // namespace identikal
