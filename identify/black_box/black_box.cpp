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
#include "identify/black_box/internal/continuous_time.h"
#include "identify/black_box/internal/nonlinearity.h"
#include "identify/black_box/internal/polynomial_fit.h"
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

// Fits closer than this are the same: the smaller order is taken.
constexpr double kSameFit = 0.005;
constexpr double kNoticeably = 0.02;  // of the fit

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

// What the search for a model works on: all rows, and their first ones, which candidates are fitted to.
struct ModelSearch {
  ScaledRecordings all;
  SplitRecordings parts;
  SubspaceStart of_first, of_all;
  BlackBoxPurpose purpose = BlackBoxPurpose::automatic;
  ModelStructure structure = ModelStructure::states;
  std::vector<Index> delays = {};  // of the inputs, for polynomials
  bool has_inputs = false;
  Index horizon = 0;  // rows ahead that count, where control is the purpose
  bool simulates() const {
    return has_inputs && purpose != BlackBoxPurpose::prediction &&
           purpose != BlackBoxPurpose::control;
  }
  bool is_stable(Refinement how) const { return simulates() && how != Refinement::any_poles; }
};

void fit_to_all_rows(const ModelSearch& search, BlackBoxCandidate& candidate) {
  candidate.model = fitted(search.of_all, search.all, candidate.order, candidate.refinement,
                           search.is_stable(candidate.refinement));
  judge_on_fitted(candidate, search.all, search.of_all.sums);
}

// Fits of held-out rows by the first ones; where BIC is wanted the model of all rows too.
BlackBoxCandidate candidate(const ModelSearch& search, int order, Refinement how, bool with_bic) {
  BlackBoxCandidate out{
      order, how, fitted(search.of_first, search.parts.first, order, how, search.is_stable(how))};
  judge_on_held_out(out, search.parts);
  if (with_bic) fit_to_all_rows(search, out);
  return out;
}

std::vector<BlackBoxCandidate> candidates(const ModelSearch& search,
                                          const BlackBoxOptions& options) {
  const auto most = static_cast<int>(
      std::min({static_cast<Index>(options.most_order), search.of_first.states.most_states(),
                search.of_all.states.most_states()}));
  if (options.least_order > most) {
    throw InputError(
        {}, fmt::format("an order of {}", options.least_order),
        fmt::format("at most {}: what is more these recordings do not tell from rounding", most));
  }
  std::vector<BlackBoxCandidate> out;
  for (int order = options.least_order; order <= most; ++order) {
    if (options.progress) options.progress(fmt::format("order {} of {}", order, most));
    out.push_back(candidate(search, order, Refinement::none, true));
    if (search.simulates()) out.push_back(candidate(search, order, Refinement::simulation, false));
  }
  return out;
}

void take_polynomials(const PolynomialModel& structure, const SubspaceStart& start,
                      const ScaledRecordings& recordings, int order, BlackBoxCandidate& out) {
  const auto states = std::min<Index>(order, start.states.most_states());
  out.polynomials = fitted_polynomials(structure, start.states.model(states), recordings);
  const auto p = static_cast<Index>(out.polynomials.size());
  out.model = with_stable_predictor(
      observable_part(innovation_form(out.polynomials, MatrixXd::Identity(p, p))));
}

BlackBoxCandidate polynomial_candidate(const ModelSearch& search, const BlackBoxOptions& options,
                                       int order, int noise_order) {
  const PolynomialModel structure =
      polynomials_of(search.structure, order, noise_order, options.polynomials, search.delays);
  BlackBoxCandidate out;
  out.refinement = Refinement::polynomials;
  take_polynomials(structure, search.of_first, search.parts.first, order, out);
  judge_on_held_out(out, search.parts);
  take_polynomials(structure, search.of_all, search.all, order, out);
  judge_on_fitted(out, search.all, search.of_all.sums);
  out.order = static_cast<int>(out.model.states());
  return out;
}

std::vector<BlackBoxCandidate> polynomial_candidates(const ModelSearch& search,
                                                     const BlackBoxOptions& options) {
  std::vector<BlackBoxCandidate> out;
  const int most = options.polynomials ? options.least_order : options.most_order;
  double least = std::numeric_limits<double>::infinity();
  int since_least = 0;
  // Orders beyond four that are no better are not tried: they take the longest.
  for (int order = options.least_order; order <= most && since_least < 4; ++order) {
    if (options.progress) options.progress(fmt::format("order {} of {}", order, most));
    const bool own_noise = search.structure == ModelStructure::box_jenkins && !options.polynomials;
    ++since_least;
    for (int noise_order = 1; noise_order <= (own_noise ? 2 : 1); ++noise_order) {
      out.push_back(polynomial_candidate(search, options, order, noise_order));
      if (!(out.back().bic < least)) continue;
      least = out.back().bic;
      since_least = 0;
    }
  }
  return out;
}

// The smallest order whose simulation of held-out rows is as good as the best, and no luck (as of outputs that wander off
// by themselves): who knows the outputs until now predicts the next no worse than who does not, unless his noise is wrong.
std::size_t best_simulation(const std::vector<BlackBoxCandidate>& all) {
  const bool some = std::any_of(all.begin(), all.end(), [](const auto& c) { return !c.lucky; });
  const auto simulation = [&](const BlackBoxCandidate& each) {
    return some && each.lucky ? -std::numeric_limits<double>::infinity() : each.simulation;
  };
  double best = -std::numeric_limits<double>::infinity();
  for (const BlackBoxCandidate& each : all) best = std::max(best, simulation(each));
  std::size_t chosen = 0;
  for (std::size_t k = all.size(); k-- > 0;) {
    if (simulation(all[k]) < best - kSameFit) continue;
    const bool same_order =
        all[k].order == all[chosen].order && simulation(all[chosen]) >= best - kSameFit;
    if (!same_order || all[k].simulation > all[chosen].simulation) chosen = k;
  }
  return chosen;
}

std::size_t least_bic(const std::vector<BlackBoxCandidate>& all) {
  std::size_t least = 0;
  for (std::size_t k = 1; k < all.size(); ++k) {
    // Also past one that has none: a predictor that overflows.
    if (all[k].bic < all[least].bic || !std::isfinite(all[least].bic)) least = k;
  }
  return least;
}

// Rows until the slowest pole has come to 1/e.
Index horizon_of(const InnovationForm& model) {
  constexpr double kLeast = 2.0, kMost = 100.0;
  const double radius = spectral_radius(model.A);
  if (!(radius < 1.0)) return static_cast<Index>(kMost);
  return static_cast<Index>(std::clamp(std::ceil(-1.0 / std::log(radius)), kLeast, kMost));
}

// The smallest order whose predictions up to the horizon are as good as the best, or its model by the prediction error method
// where that does better.
std::size_t best_for_control(ModelSearch& search, std::vector<BlackBoxCandidate>& all,
                             const BlackBoxOptions& options) {
  search.horizon = options.horizon.value_or(horizon_of(all[least_bic(all)].model));
  const auto judge = [&](BlackBoxCandidate& each) {
    judge_for_control(each, search.parts.rest, search.horizon);
  };
  for (BlackBoxCandidate& each : all) judge(each);
  if (std::isnan(all.front().control)) {
    throw InputError({}, fmt::format("held-out rows are too few for {} rows ahead", search.horizon),
                     "longer recordings", "a shorter --steps, or a larger --hold-out");
  }
  const auto is_worse = [](const BlackBoxCandidate& a, const BlackBoxCandidate& b) {
    return a.control < b.control;
  };
  const double best = std::max_element(all.begin(), all.end(), is_worse)->control;
  const auto good = std::find_if(all.begin(), all.end(), [&](const BlackBoxCandidate& each) {
    return each.control > best - kSameFit;
  });
  const auto chosen = static_cast<std::size_t>(good - all.begin());
  if (search.structure != ModelStructure::states) return chosen;
  all.push_back(candidate(search, all[chosen].order, Refinement::prediction_error, false));
  judge(all.back());
  return all.back().control > all[chosen].control ? all.size() - 1 : chosen;
}

// The order of least BIC and its neighbours by the prediction error method.
void refine_likeliest(const ModelSearch& search, std::vector<BlackBoxCandidate>& all, int around) {
  const int order = all[least_bic(all)].order;
  const int least = all.front().order, most = all.back().order;
  for (int each = std::max(least, order - around); each <= std::min(most, order + around); ++each) {
    all.push_back(candidate(search, each, Refinement::prediction_error, around > 0));
  }
}

// Does the last candidate, a refined one, predict held-out rows worse than some that are not refined?
bool overfits(const std::vector<BlackBoxCandidate>& all) {
  constexpr double kWorse = 0.001;  // of the fit
  double best = -std::numeric_limits<double>::infinity();
  for (const BlackBoxCandidate& each : all) {
    if (each.refinement == Refinement::none) best = std::max(best, each.prediction);
  }
  return all.back().prediction < best - kWorse;
}

// What simulates best, with all of it fitted to simulations where held-out rows say that this is noticeably better:
// it follows one recording as closely as its order allows.
std::size_t by_output_error(const ModelSearch& search, std::vector<BlackBoxCandidate>& all,
                            std::size_t simulator) {
  all.push_back(candidate(search, all[simulator].order, Refinement::output_error, false));
  const bool better = all.back().simulation > all[simulator].simulation + kNoticeably;
  return better ? all.size() - 1 : simulator;
}

// Where nothing is said what the model is for: the likeliest one, unless another simulates better.
std::size_t choose_stable(ModelSearch& search, std::vector<BlackBoxCandidate>& all,
                          const BlackBoxOptions& options) {
  if (search.purpose == BlackBoxPurpose::control) return best_for_control(search, all, options);
  if (search.structure != ModelStructure::states) {
    return search.simulates() && search.purpose == BlackBoxPurpose::simulation
               ? best_simulation(all)
               : least_bic(all);
  }
  if (!search.has_inputs || search.purpose == BlackBoxPurpose::prediction) {
    refine_likeliest(search, all, 1);
    return least_bic(all);
  }
  const std::size_t simulator = best_simulation(all);
  // BIC that still falls at the highest order says that none of them is the true one.
  const bool settled = all[least_bic(all)].order < all.back().order;
  if (search.purpose == BlackBoxPurpose::automatic && settled) {
    refine_likeliest(search, all, 0);
    const bool simulates_as_well = all.back().simulation > all[simulator].simulation - kSameFit;
    if (simulates_as_well && !overfits(all)) return all.size() - 1;
    if (all.back().order == all[simulator].order) return by_output_error(search, all, simulator);
  }
  all.push_back(candidate(search, all[simulator].order, Refinement::prediction_error, false));
  const bool better = all.back().simulation > all[simulator].simulation && !overfits(all);
  return by_output_error(search, all, better ? all.size() - 1 : simulator);
}

// The same, and of what wanders off by itself a model that does too, where that simulates and predicts held-out rows better,
// one of both noticeably.
std::size_t choose(ModelSearch& search, std::vector<BlackBoxCandidate>& all,
                   const BlackBoxOptions& options) {
  const std::size_t chosen = choose_stable(search, all, options);
  const bool open = search.structure == ModelStructure::states && search.has_inputs &&
                    search.purpose == BlackBoxPurpose::automatic;
  if (!open) return chosen;
  const BlackBoxCandidate& likeliest = all[least_bic(all)];
  if (spectral_radius(likeliest.of_first.A) < kLargestPole * (1.0 - 1e-9)) return chosen;
  const int order = likeliest.order;
  all.push_back(candidate(search, order, Refinement::any_poles, false));
  const double simulation = all.back().simulation - all[chosen].simulation,
               prediction = all.back().prediction - all[chosen].prediction;
  const bool better =
      std::min(simulation, prediction) > 0.0 && std::max(simulation, prediction) > kNoticeably;
  return better ? all.size() - 1 : chosen;
}

// The choice, fitted to all rows; a model whose predictions of them overflow is none.
std::size_t choose_finite(ModelSearch& search, std::vector<BlackBoxCandidate>& all,
                          const BlackBoxOptions& options) {
  std::size_t chosen = choose(search, all, options);
  for (;;) {
    BlackBoxCandidate& best = all[chosen];
    const bool of_states = best.polynomials.empty();
    if (of_states && !std::isfinite(best.bic)) fit_to_all_rows(search, best);
    if (best.model.A.allFinite() && best.model.K.allFinite() && best.model.sigma.allFinite()) {
      return chosen;
    }
    all.erase(all.begin() + static_cast<std::ptrdiff_t>(chosen));
    if (all.empty()) {
      throw InputError({}, "no order has a model whose predictions stay finite",
                       "recordings that a linear model of these orders can follow",
                       "fewer states: a lower --order");
    }
    chosen = search.simulates() ? best_simulation(all) : least_bic(all);
  }
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

// What the candidates' fits say of the answer.
Findings judged(const ModelSearch& search, const BlackBoxCandidate& chosen) {
  Findings out;
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
    const char* what = "the model is unstable: its predictions are not, its simulations are";
    out.push_back(make_finding(
        FindingCode::other, {}, search.has_inputs ? what : "the model is unstable: forecasts grow",
        "of a closed loop, or of outputs that wander off by themselves, that may be right"));
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

std::vector<Index> delays_of(const ModelSearch& search, const BlackBoxOptions& options) {
  const Index m = search.all.u.front().rows();
  const bool needs_input = options.structure == ModelStructure::output_error ||
                           options.structure == ModelStructure::box_jenkins;
  if (needs_input && m == 0) {
    throw InputError({}, "a model of how inputs drive outputs, without an input",
                     "input columns, or ARX and ARMAX, which do without");
  }
  std::vector<Index> out(static_cast<std::size_t>(m), options.delay.value_or(0));
  if (options.delay) return out;
  const std::vector<BlackBox::Delay> found = input_delays(search.of_all.sums);
  for (std::size_t j = 0; j < found.size(); ++j) {
    const bool seen = found[j].rows < search.of_all.sums.lags;
    out[j] = seen ? static_cast<Index>(found[j].rows) : 1;
  }
  return out;
}

// Held-out rows, and the states of the first ones.
struct HeldOut {
  SplitRecordings parts;
  SubspaceStart start;
};

HeldOut held_out(SplitRecordings parts, const BlackBoxOptions& options) {
  constexpr Index kMostHeldOut = 40000;  // rows
  parts.rest = first_rows(parts.rest, kMostHeldOut);
  SubspaceStart start =
      subspace_start(parts.first, suitable_lags(parts.first, options.most_order), nullptr);
  return {std::move(parts), std::move(start)};
}

// The best simulation of held-out rows by the first ones, of any order.
double best_simulation(const HeldOut& of, const BlackBoxOptions& options) {
  const auto most =
      static_cast<int>(std::min<Index>(options.most_order, of.start.states.most_states()));
  double best = -std::numeric_limits<double>::infinity();
  for (int order = std::min(options.least_order, most); order <= most; ++order) {
    BlackBoxCandidate each{order, Refinement::none,
                           fitted(of.start, of.parts.first, order, Refinement::none, true)};
    judge_on_held_out(each, of.parts);
    best = std::max(best, each.simulation);
  }
  return best;
}

// Recordings about zero, where that is what they move around. The mean of few slow swings is no operating point: what is taken
// off for it is missing in all later rows. Channels that pass through zero all the time are likely to be deviations
// already; others have to do noticeably better so on rows that were held out. Without inputs the mean is all that is known.
std::optional<HeldOut> about_zero(const ScaledRecordings& from_mean, const HeldOut& by_means,
                                  const BlackBoxOptions& options) {
  constexpr double kThrough = 1.0, kFar = 10.0;  // by the channel's scatter
  constexpr double kDoubt = 0.05;                // of the fit
  const double far = farthest_mean(from_mean.point);
  if (from_mean.point.u.size() == 0 || !(far < kFar)) return std::nullopt;
  HeldOut out = held_out(split(from_zero(from_mean), 1.0 - options.held_out_share), options);
  const double gain = best_simulation(out, options) - best_simulation(by_means, options);
  if (!(gain > (far < kThrough ? -kDoubt : kSameFit))) return std::nullopt;
  return out;
}

ModelSearch begun(const std::vector<Dataset>& recordings, const BlackBoxOptions& options) {
  ScaledRecordings all = scaled(recordings);
  HeldOut chosen = held_out(about_first_means(split(all, 1.0 - options.held_out_share)), options);
  if (std::optional<HeldOut> zero = about_zero(all, chosen, options)) {
    all = from_zero(std::move(all));
    SubspaceStart of_all = subspace_start(all, zero->start.sums.lags, &zero->start.prior);
    return {std::move(all), std::move(zero->parts), std::move(zero->start), std::move(of_all)};
  }
  SubspaceStart of_all = subspace_start(all, chosen.start.sums.lags, &chosen.start.prior);
  return {std::move(all), std::move(chosen.parts), std::move(chosen.start), std::move(of_all)};
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
  ModelSearch search = begun(recordings, options);
  search.has_inputs = !channels.inputs.empty();
  search.purpose = options.purpose;
  search.structure = options.structure;
  if (options.structure != ModelStructure::states) search.delays = delays_of(search, options);
  const bool by_inputs =
      search.purpose == BlackBoxPurpose::simulation || search.purpose == BlackBoxPurpose::control;
  if (by_inputs && !search.has_inputs) {
    throw std::invalid_argument(
        "estimate_black_box: without inputs nothing can be simulated or controlled");
  }
  const bool of_states = options.structure == ModelStructure::states;
  std::vector<BlackBoxCandidate> tried =
      of_states ? candidates(search, options) : polynomial_candidates(search, options);
  BlackBoxCandidate& chosen = tried[choose_finite(search, tried, options)];
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
  append(estimate.findings, judged(search, chosen));
  BlackBox& box = estimate.black_box;
  box.nonlinearities =
      nonlinearities(chosen.model, search.all, box.inputs, box.outputs, search.of_all.sums.lags);
  append(estimate.findings, check_linearity(box.nonlinearities));
  conclude(estimate, fmt::format("{} states", chosen.order));
  return out;
}

}  // namespace identikal
