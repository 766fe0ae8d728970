#include "identify/black_box/black_box.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include <Eigen/LU>
#include <fmt/format.h>

#include "identify/black_box/internal/candidates.h"
#include "identify/black_box/internal/characteristics.h"
#include "identify/black_box/internal/choice.h"
#include "identify/black_box/internal/continuous_time.h"
#include "identify/black_box/internal/level.h"
#include "identify/black_box/internal/model_search.h"
#include "identify/black_box/internal/nonlinearity.h"
#include "identify/black_box/internal/polynomial_fit.h"
#include "identify/black_box/internal/predictor_memory.h"
#include "identify/black_box/internal/responses.h"
#include "identify/black_box/internal/scaled_recordings.h"
#include "identify/filter/channel_fit.h"
#include "identify/filter/report.h"
#include "identify/model/builder.h"
#include "identify/noise/estimate.h"
#include "lib/base/error.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Every row of a delay is a state.
constexpr Index kMostDelay = 100;

const char* to_string(Refinement how, ModelStructure structure) {
  if (how == Refinement::simulation) return "simulation";
  if (how == Refinement::prediction_error) return "prediction_error";
  if (how == Refinement::any_poles) return "any_poles";
  if (how == Refinement::output_error) return "output_error";
  switch (structure) {
    case ModelStructure::arx:
      return "arx";
    case ModelStructure::armax:
      return "armax";
    case ModelStructure::output_error:
      return "output_error";
    case ModelStructure::box_jenkins:
      return "box_jenkins";
    case ModelStructure::states:
      break;
  }
  return "states";
}

Model with_channels(const Model& channels, const std::vector<Dataset>& recordings,
                    const InnovationForm& found, const OperatingPoint& point) {
  const Dataset& first = recordings.front();
  std::vector<std::string> inputs, outputs;
  for (const ChannelSource& each : channels.inputs) inputs.push_back(each.name);
  for (const ChannelSource& each : channels.outputs) outputs.push_back(each.name);
  MatrixXd sigma = 0.5 * (found.sigma + found.sigma.transpose());
  sigma.diagonal() *= 1.0 + 1e-12;
  LinearModelBuilder builder = linear_model();
  builder.A(found.A)
      .C(found.C)
      .G(found.K)
      .process_noise(sigma)
      .measurement_noise(sigma)
      .S(sigma)
      .outputs(outputs);
  if (!inputs.empty()) builder.B(found.B).D(found.D).inputs(inputs);
  Model out = builder.step(first.dt).diffuse();
  out.name = channels.name;
  out.source = channels.source;
  out.time = channels.time;
  if (out.time.step == 0.0) out.time.step = first.dt;
  const auto take = [](const std::vector<ChannelSource>& from, const std::vector<Channel>& of,
                       const VectorXd& at, std::vector<ChannelSource>& to) {
    to = from;
    for (std::size_t c = 0; c < to.size(); ++c) {
      to[c].offset -= at[static_cast<Index>(c)] / unit_or_dimensionless(of[c].unit).scale;
    }
  };
  take(channels.inputs, first.inputs, point.u, out.inputs);
  take(channels.outputs, first.outputs, point.y, out.outputs);
  return out;
}

std::vector<Dataset> deviations(std::vector<Dataset> recordings, const OperatingPoint& point) {
  for (Dataset& each : recordings) {
    each.y.colwise() -= point.y;
    each.u.colwise() -= point.u;
  }
  return recordings;
}

BlackBox description(const ModelSearch& search, const std::vector<BlackBoxCandidate>& all,
                     const BlackBoxCandidate& chosen, const BlackBoxOptions& options) {
  BlackBox out;
  out.purpose = search.purpose == BlackBoxPurpose::automatic && search.has_inputs ? "automatic"
                : search.purpose == BlackBoxPurpose::control                      ? "control"
                : search.simulates()                                              ? "simulation"
                                                                                  : "prediction";
  out.horizon = static_cast<long>(search.horizon);
  out.order = chosen.order;
  out.refinement = to_string(chosen.refinement, search.structure);
  out.lags = static_cast<long>(search.of_all.sums.lags);
  out.held_out_share = options.held_out_share;
  const VectorXd& values = search.of_all.states.singular_values();
  out.singular_values = values.head(std::min<Index>(values.size(), 2 * options.most_order));
  for (const BlackBoxCandidate& each : all) {
    out.candidates.push_back({each.order, to_string(each.refinement, search.structure), each.bic,
                              100.0 * each.simulation, 100.0 * each.prediction,
                              100.0 * each.control});
  }
  std::stable_sort(out.candidates.begin(), out.candidates.end(),
                   [](const auto& a, const auto& b) { return a.order < b.order; });
  return out;
}

// Coefficients from deviations in units of their scatter to SI: B alone has a unit.
void add_polynomials(const std::vector<PolynomialModel>& models,
                     const std::vector<MatrixXd>& covariances, const OperatingPoint& point,
                     BlackBox& out) {
  for (std::size_t i = 0; i < models.size(); ++i) {
    const PolynomialModel& model = models[i];
    Index at = 0;
    const auto add = [&](const char* name, const std::string& input, long delay, double scale,
                         const VectorXd& value) {
      const Index n = value.size(), lead = input.empty() || *name == 'F' ? 1 : 0;
      if (n == 0) return;
      BlackBox::Polynomial each{
          out.outputs[i], name, input, delay, VectorXd::Ones(n + lead), VectorXd::Zero(n + lead)};
      each.value.tail(n) = scale * value;
      if (covariances[i].size() == 0)
        each.se.tail(n).setConstant(kNone);
      else
        each.se.tail(n) = scale * covariances[i].diagonal().segment(at, n).cwiseSqrt();
      out.polynomials.push_back(std::move(each));
      at += n;
    };
    add("A", "", 0, 1.0, model.A);
    for (std::size_t j = 0; j < model.B.size(); ++j) {
      const double scale = point.y_sd[static_cast<Index>(i)] / point.u_sd[static_cast<Index>(j)];
      add("B", out.inputs[j], static_cast<long>(model.delay[j]), scale, model.B[j]);
    }
    add("C", "", 0, 1.0, model.C);
    add("D", "", 0, 1.0, model.D);
    for (std::size_t j = 0; j < model.F.size(); ++j) add("F", out.inputs[j], 0, 1.0, model.F[j]);
  }
}

void name_channels(const Dataset& first, const OperatingPoint& point, BlackBox& out) {
  const auto put = [&](const std::vector<Channel>& channels, const VectorXd& at,
                       std::vector<std::string>& names) {
    for (std::size_t c = 0; c < channels.size(); ++c) {
      names.push_back(channels[c].name);
      const double value = at[static_cast<Index>(c)];
      const Unit unit = unit_or_dimensionless(channels[c].unit);
      out.operating_point.push_back(
          {channels[c].name, channels[c].unit, value == 0.0 ? 0.0 : unit.from_si(value)});
    }
  };
  put(first.inputs, point.u, out.inputs);
  put(first.outputs, point.y, out.outputs);
}

// A model with the moves of its errors.
struct ModelWithMoves {
  InnovationForm form;
  std::vector<Move> moves;
};

// And the poles of it.
ModelWithMoves with_moves(const ModelSearch& search, const BlackBoxCandidate& chosen, double dt,
                          BlackBox& out) {
  if (chosen.polynomials.empty()) {
    std::vector<Move> moves = independent_moves(
        chosen.model, sums_around(chosen.model, search.all, search.of_all.sums.lags));
    out.poles = poles_with_errors(chosen.model, moves, dt);
    return {chosen.model, std::move(moves)};
  }
  std::vector<MatrixXd> covariances;
  for (std::size_t i = 0; i < chosen.polynomials.size(); ++i) {
    covariances.push_back(
        coefficient_covariance(chosen.polynomials[i], search.all, static_cast<Index>(i)));
  }
  add_polynomials(chosen.polynomials, covariances, search.all.point, out);
  out.poles = poles_with_errors(chosen.polynomials, covariances, dt);
  return {innovation_form(chosen.polynomials, chosen.model.sigma),
          independent_moves(chosen.polynomials, covariances)};
}

// Poles, gains, responses, delays and the operating point of the chosen model.
void add_characteristics(const ModelSearch& search, const Dataset& first,
                         const BlackBoxCandidate& chosen, BlackBox& out) {
  const OperatingPoint& point = search.all.point;
  name_channels(first, point, out);
  const auto [model, moves] = with_moves(search, chosen, first.dt, out);
  const SteadyGain gain = steady_gain(model, moves);
  const auto to_si = [&](const MatrixXd& of) -> MatrixXd {
    return point.y_sd.asDiagonal() * of * point.u_sd.cwiseInverse().asDiagonal();
  };
  out.gain = to_si(gain.value);
  out.gain_se = to_si(gain.se);
  constexpr Index kResponse = 100;  // rows
  out.impulse_responses = impulse_responses(search.all, first, kResponse);
  out.step_responses = step_responses(model, moves, point, first, kResponse);
  out.transfer_functions = transfer_functions(model, moves, point, first);
  out.frequency_responses = frequency_responses(model, moves, search.all, first);
  out.delays = input_delays(search.of_all.sums);
  for (std::size_t j = 0; j < out.delays.size(); ++j) out.delays[j].input = out.inputs[j];
}

// Fit of the outputs by the inputs alone, from a first state that the first rows tell.
void simulate_all(const ModelSearch& search, const BlackBoxCandidate& chosen,
                  const std::vector<Channel>& outputs, FilterEstimate& estimate) {
  const Index p = chosen.model.outputs();
  MatrixXd y(p, search.all.rows()), e = y;
  Index at = 0;
  for (std::size_t k = 0; k < search.all.y.size(); ++k) {
    const MatrixXd& here = search.all.y[k];
    const VectorXd x0 = initial_state(chosen.model, here, search.all.u[k], kRowsForState);
    y.middleCols(at, here.cols()) = here;
    e.middleCols(at, here.cols()) = here - simulated_outputs(chosen.model, search.all.u[k], x0);
    at += here.cols();
  }
  const OperatingPoint& point = search.all.point;
  for (Index i = 0; i < p; ++i) {
    const double unit = point.y_sd[i];
    estimate.simulation.push_back(channel_fit(outputs[static_cast<std::size_t>(i)],
                                              unit * y.row(i).transpose(),
                                              unit * e.row(i).transpose()));
  }
}

// How far outside of the unit circle, and whether that is more than its error.
std::string unstable_in_words(const std::vector<BlackBox::Pole>& poles, bool has_inputs) {
  double radius = 0.0, se = 0.0;
  for (const BlackBox::Pole& each : poles) {
    const double here = std::hypot(each.real, each.imaginary);
    if (!(here > radius)) continue;
    radius = here;
    const double of_imaginary = each.imaginary == 0.0 ? 0.0 : each.imaginary * each.imaginary_se;
    se = std::hypot(each.real * each.real_se, of_imaginary) / here;
  }
  const char* what = has_inputs
                         ? "the model is unstable: its predictions are not, its simulations are"
                         : "the model is unstable: forecasts grow";
  if (!(radius > 1.0) || !std::isfinite(se)) return what;
  const char* certain =
      radius - 1.0 < 2.0 * se ? ", which is none that these recordings are sure of" : "";
  return fmt::format("{} (its largest pole lies {:.2g} +- {:.1g} outside of the unit circle{})",
                     what, radius - 1.0, se, certain);
}

// What the candidates' fits say of the answer.
Findings judged(const ModelSearch& search, const BlackBoxCandidate& chosen,
                const std::vector<BlackBox::Pole>& poles) {
  Findings out;
  if (search.stopped) {
    out.push_back(make_finding(FindingCode::stopped, {},
                               "stopped by the caller before all orders were tried",
                               "let it go on, or ask for fewer orders"));
  }
  const bool controls = search.purpose == BlackBoxPurpose::control;
  const double fit = search.simulates() ? chosen.simulation
                     : controls         ? chosen.control
                                        : chosen.prediction;
  constexpr double kNothing = 0.01;  // what a model of pure noise reaches by chance
  if (!(fit > kNothing)) {
    out.push_back(make_finding(
        FindingCode::does_not_predict, {},
        fmt::format(
            "no model of any order {} the held-out rows noticeably better than their mean does",
            search.simulates() ? "simulates" : "predicts"),
        "other inputs, longer recordings, or a model of what is known of the system"));
  }
  if (spectral_radius(chosen.model.A) > 1.0) {
    out.push_back(make_finding(FindingCode::other, {}, unstable_in_words(poles, search.has_inputs),
                               "of a closed loop, or of outputs that wander off by themselves, "
                               "that may be right"));
  }
  return out;
}

// An output-error model says nothing of the noise: that it is coloured is no fault of it.
void allow_for_colour(Finding& finding) {
  if (finding.code != FindingCode::coloured_innovations) return;
  finding.severity = Severity::note;
  finding.text =
      "what the model leaves is coloured: the standard errors allow for that, predictions of the "
      "next row make no use of it";
  finding.remedy = "a Box-Jenkins model has the noise, too";
}

void check_options(const BlackBoxOptions& options) {
  if (options.least_order < 1 || options.most_order < options.least_order ||
      options.most_order > 60) {
    throw std::invalid_argument("estimate_black_box: orders from 1 to 60, rising");
  }
  if (!(options.held_out_share > 0.0 && options.held_out_share < 0.8)) {
    throw std::invalid_argument("estimate_black_box: a share above 0 and below 0.8 is held out");
  }
  if ((options.polynomials || options.delay) && options.structure == ModelStructure::states) {
    throw std::invalid_argument("estimate_black_box: polynomials and delay are of polynomials");
  }
  if (options.horizon && !(*options.horizon >= 1 && *options.horizon <= 1000))
    throw std::invalid_argument("estimate_black_box: a horizon from 1 to 1000 rows");
  if (options.horizon && options.purpose != BlackBoxPurpose::control)
    throw std::invalid_argument("estimate_black_box: a horizon is of control");
  if (options.delay && !(*options.delay >= 0 && *options.delay <= kMostDelay))
    throw std::invalid_argument("estimate_black_box: a delay from 0 to 100 rows");
}

// The outputs' level by the model's innovations: means of transients are others.
void take_level(ModelSearch& search, BlackBoxCandidate& chosen) {
  if (search.all.point.y.isZero(0.0)) return;
  const VectorXd level = level_of(chosen.model, search.all, search.of_all.sums.lags);
  for (MatrixXd& each : search.all.y) each.colwise() -= level;
  search.all.point.y += level.cwiseProduct(search.all.point.y_sd);
  if (search.all.rows() <= kEnoughRows) judge_on_fitted(chosen, search.all, search.of_all.sums);
}

}  // namespace

BlackBoxResult estimate_black_box(const Model& channels, const std::vector<Dataset>& recordings,
                                  const BlackBoxOptions& options) {
  check_options(options);
  ModelSearch search = begun_search(recordings, options);
  const bool by_inputs =
      search.purpose == BlackBoxPurpose::simulation || search.purpose == BlackBoxPurpose::control;
  if (by_inputs && !search.has_inputs) {
    throw std::invalid_argument(
        "estimate_black_box: without inputs nothing can be simulated or controlled");
  }
  const bool of_states = options.structure == ModelStructure::states;
  std::vector<BlackBoxCandidate> tried = candidates_of_all_orders(search, options);
  BlackBoxCandidate& chosen = tried[chosen_candidate(search, tried, options)];
  take_level(search, chosen);

  BlackBoxResult out;
  out.model = with_channels(channels, recordings, in_units(chosen.model, search.all.point),
                            search.all.point);
  BlackBoxEstimate& estimate = out.estimate;
  estimate.model_name = channels.name;
  estimate.objective.method = of_states ? "subspace" : "prediction_error";
  estimate.black_box = description(search, tried, chosen, options);
  add_characteristics(search, recordings.front(), chosen, estimate.black_box);
  out.recordings = deviations(recordings, search.all.point);
  report_filter(estimate, out.model, out.model.parameters, out.recordings);
  if (search.has_inputs) simulate_all(search, chosen, recordings.front().outputs, estimate);
  Findings left = check_innovations(estimate);
  for (Finding& each : left) {
    each.remedy = "a higher --order, a shorter step, or inputs that are missing";
    if (options.structure == ModelStructure::output_error) allow_for_colour(each);
  }
  append(estimate.findings, left);
  append(estimate.findings, judged(search, chosen, estimate.black_box.poles));
  BlackBox& box = estimate.black_box;
  box.nonlinearities =
      nonlinearities(chosen.model, search.all, box.inputs, box.outputs, search.of_all.sums.lags);
  append(estimate.findings, check_linearity(box.nonlinearities));
  conclude(estimate, fmt::format("{} states", chosen.order));
  return out;
}

}  // namespace identikal
