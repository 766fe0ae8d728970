#include "identify/filter/simulated_fit.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "identify/estimate/covariance_factor.h"
#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "identify/filter/channel_fit.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/nonlinear_recordings.h"
#include "identify/filter/report.h"
#include "identify/model/row_order.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/base/nearest_turn.h"
#include "lib/data/units.h"
#include "lib/statistics/whiteness.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd in_units(const MatrixXd& y, const std::vector<Channel>& outputs) {
  MatrixXd out = y;
  for (Index i = 0; i < y.rows(); ++i) {
    const Unit unit = unit_or_dimensionless(outputs[i].unit);
    out.row(i) = (y.row(i).array() - unit.offset) / unit.scale;
  }
  return out.array().isFinite().select(out, kNone);
}

void append(MatrixXd& to, const MatrixXd& more) {
  const Index had = to.cols();
  to.conservativeResize(more.rows(), had + more.cols());
  to.rightCols(more.cols()) = more;
}

// Of an angle that is measured up to whole turns, the nearest of them to what is measured.
MatrixXd with_nearest_turns(const Model& model, const MatrixXd& measured, MatrixXd simulated) {
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    if (!model.outputs[i].wraps) continue;
    const auto row = static_cast<Index>(i);
    for (Index t = 0; t < simulated.cols(); ++t) {
      const double y = measured(row, t);
      if (!std::isnan(y)) simulated(row, t) = y - nearest_turn(y - simulated(row, t));
    }
  }
  return simulated;
}

std::vector<ChannelFit> fits_of(const std::vector<Channel>& outputs, const MatrixXd& y,
                                const MatrixXd& errors) {
  std::vector<ChannelFit> out;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const auto row = static_cast<Index>(i);
    out.push_back(channel_fit(outputs[i], y.row(row).transpose(), errors.row(row).transpose()));
  }
  return out;
}

// The state at the first sample, as the whole recording determines it.
VectorXd smoothed_start(const Model& model, const ParameterSet& parameters,
                        const Dataset& recording) {
  const SmootherResult known = run_smoother(model, parameters, recording, std::nullopt);
  const bool runs = known.status == FilterStatus::ok && known.x.col(0).allFinite();
  return runs ? VectorXd(known.x.col(0)) : written_matrices(noise_model(model), parameters).x0;
}

// Does an error of the start fade, in one step or over a recording? Where it stays, as in an
// integrator, so does what noise adds.
bool fades(const MatrixXd& transition) {
  constexpr double kStays = 1e-9;
  return transition.allFinite() && transition.eigenvalues().cwiseAbs().maxCoeff() < 1.0 - kStays;
}

bool start_fades(const Model& model, const ParameterSet& parameters, const Dataset& recording) {
  if (is_linear(model)) return fades(instantiate(as_linear(model), parameters).A);
  const SmootherResult known = run_smoother(model, parameters, recording, std::nullopt);
  if (known.status != FilterStatus::ok || !known.x.allFinite()) return true;  // nothing is known
  return fades(transition_along(model, parameters, recording, known.x));
}

// A model that holds leaves innovations there as it does here.
void check_held_out(FilterEstimate& estimate, const MatrixXd& standardised) {
  constexpr double kRare = 1e-3, kMatters = 1.1;
  const ChiSquareStatistic held = normalised_innovation_squared(standardised);
  const ChiSquareStatistic own = normalised_innovation_squared(estimate.series.standardised);
  if (!(held.dof > 0.0 && own.dof > 0.0)) return;
  const double ratio = held.value / held.dof / (own.value / own.dof);
  if (f_upper_tail(ratio, held.dof, own.dof) >= kRare || std::sqrt(ratio) < kMatters) return;
  estimate.findings.push_back(make_finding(
      FindingCode::hold_out, {},
      fmt::format("on held-out rows the innovations are {:.3g} times as large, compared with "
                  "their standard deviation",
                  std::sqrt(ratio)),
      "what holds there is another model or noise, or too many parameters are free: validate"));
  estimate.derived.push_back({kCovarianceFactor + std::string("held-out rows"), "", ratio, kNone});
}

}  // namespace

MatrixXd outputs_from(const Model& model, const ParameterSet& parameters, const Dataset& recording,
                      const VectorXd& start) {
  VectorXd x = start;
  if (is_formula_model(model)) {
    return noise_free_outputs(model, parameters, recording, x);
  }
  const StateSpace system = instantiate(as_linear(model), parameters);
  const MatrixXd u = model_inputs(as_linear(model), recording.u);
  MatrixXd out(system.outputs(), recording.size());
  for (Index t = 0; t < recording.size(); ++t) {
    out.col(t) = system.C * x + system.D * u.col(t);
    x = (system.A * x + system.B * u.col(t)).eval();
  }
  return out;
}

MatrixXd simulated_outputs(const Model& model, const ParameterSet& parameters,
                           const Dataset& recording) {
  const VectorXd x = smoothed_start(model, parameters, recording);
  const MatrixXd out = outputs_from(model, parameters, recording, x);
  return out.array().isFinite().select(out, kInfinity);
}

MatrixXd simulation_errors(const Model& model, const ParameterSet& parameters,
                           const Dataset& recording) {
  const MatrixXd simulated = simulated_outputs(model, parameters, recording);
  return recording.y - with_nearest_turns(model, recording.y, simulated);
}

std::string why_no_simulation(const Model& model, const ParameterSet& parameters,
                              const Dataset& recording, const std::vector<ChannelFit>& fits) {
  if (rows_have_no_order(model, parameters)) return "";
  if (recording.u.rows() == 0) return "no input drives the model";
  // A fit that is no number explains nothing either.
  const bool explains = std::all_of(fits.begin(), fits.end(),
                                    [](const ChannelFit& fit) { return fit.fit_percent > 0.0; });
  if (explains) return "";
  if (start_fades(model, parameters, recording)) return "";
  return "it explains nothing, and the model is not asymptotically stable: an error of its start "
         "does "
         "not fade";
}

void report_simulation(FilterEstimate& estimate, const Model& model, const ParameterSet& parameters,
                       const std::vector<Dataset>& recordings) {
  MatrixXd y, errors;
  for (const Dataset& data : recordings) {
    append(y, data.y);
    append(errors, simulation_errors(model, parameters, data));
  }
  estimate.simulation = fits_of(recordings[0].outputs, y, errors);
  // A model that was fitted by its simulation is judged by it, whatever it explains.
  if (estimate.objective.method == kSimulationMethod) return;
  const std::string why = why_no_simulation(model, parameters, recordings[0], estimate.simulation);
  if (why.empty()) return;
  estimate.simulation.clear();
  estimate.notes.push_back("no simulation: " + why);
}

void report_hold_out(FilterEstimate& estimate, const Model& model,
                     const std::vector<HeldOut>& held_out) {
  const ParameterSet end = parameters_of(estimate, model.parameters);
  const std::vector<Channel>& outputs = held_out[0].recording.outputs;
  MatrixXd y, innovations, standardised, simulated;
  VectorXd time;
  std::vector<int> recording;
  double log_likelihood = 0.0;
  const auto fail = [&](const HeldOut& held, const std::string& why) {
    estimate.findings.push_back(
        make_finding(FindingCode::hold_out, {},
                     "the filter does not run on held-out " + held.recording.name + ": " + why));
  };
  for (const HeldOut& held : held_out) {
    const Dataset data = samples_from(held.recording, held.from);
    Model here;
    FilterResult filter;
    // The estimate stands whatever these rows are.
    try {
      here = going_on(model, end, held.recording, held.from).value_or(model);
      filter = run_filter(here, end, data, Keep::innovations);
    } catch (const InputError& error) {
      return fail(held, error.what());
    }
    if (filter.status != FilterStatus::ok) return fail(held, describe(filter.status));
    log_likelihood += filter.log_likelihood;
    append(y, data.y);
    append(innovations, filter.e);
    append(standardised, filter.standardised);
    append(simulated, with_nearest_turns(model, data.y, simulated_outputs(here, end, data)));
    time.conservativeResize(y.cols());
    time.tail(data.size()) = data.time;
    recording.resize(static_cast<std::size_t>(y.cols()),
                     recording.empty() ? 1 : recording.back() + 1);
  }
  // It takes the errors as white.
  if (estimate.objective.method != kSimulationMethod) {
    check_held_out(estimate, standardised);
  }
  estimate.hold_out = fits_of(outputs, y, y - simulated);
  std::string why;
  if (estimate.objective.method != kSimulationMethod) {
    why = why_no_simulation(model, end, held_out[0].recording, estimate.hold_out);
  }
  if (!why.empty()) {
    estimate.hold_out.clear();
    simulated.setConstant(kNone);
    const std::string note = "no simulation: " + why;
    const auto& notes = estimate.notes;
    if (std::find(notes.begin(), notes.end(), note) == notes.end()) estimate.notes.push_back(note);
  }
  estimate.hold_out_one_step = fits_of(outputs, y, innovations);
  const auto rows = static_cast<double>(estimate.series.time.size());
  estimate.derived.push_back(
      {"log-likelihood per row", "", estimate.objective.log_likelihood / rows, kNone});
  estimate.objective.held_out = log_likelihood / static_cast<double>(y.cols());
  estimate.derived.push_back({"  on held-out rows", "", estimate.objective.held_out, kNone});
  estimate.pictures.held_time = std::move(time);
  estimate.pictures.held_recording = std::move(recording);
  estimate.pictures.held_standardised = std::move(standardised);
  estimate.pictures.held_measured = in_units(y, outputs);
  estimate.pictures.held_out_simulation = in_units(simulated, outputs);
}

}  // namespace identikal
