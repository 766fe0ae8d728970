#include "identify/black_box/black_box.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "identify/black_box/internal/candidates.h"
#include "identify/black_box/internal/characteristics.h"
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

// Fits closer than this are the same: the smaller order is taken.
constexpr double kSameFit = 0.005;

const char* to_string(Refinement how) {
  if (how == Refinement::simulation) return "simulation";
  return how == Refinement::prediction_error ? "prediction_error" : "states";
}

// What the search for a model works on: all rows, and their first ones, which candidates are fitted to.
struct ModelSearch {
  ScaledRecordings all;
  SplitRecordings parts;
  SubspaceStart of_first, of_all;
  BlackBoxPurpose purpose = BlackBoxPurpose::automatic;
  bool has_inputs = false;
  bool simulates() const { return has_inputs && purpose != BlackBoxPurpose::prediction; }
};

void fit_to_all_rows(const ModelSearch& search, BlackBoxCandidate& candidate) {
  candidate.model =
      fitted(search.of_all, search.all, candidate.order, candidate.refinement, search.simulates());
  judge_on_fitted(candidate, search.all, search.of_all.sums);
}

// Fits of held-out rows by the first ones; where BIC is wanted the model of all rows too.
BlackBoxCandidate candidate(const ModelSearch& search, int order, Refinement how, bool with_bic) {
  BlackBoxCandidate out{
      order, how, fitted(search.of_first, search.parts.first, order, how, search.simulates())};
  judge_on_held_out(out, search.parts.rest);
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

// The smallest order whose simulation of held-out rows is as good as the best.
std::size_t best_simulation(const std::vector<BlackBoxCandidate>& all) {
  double best = -std::numeric_limits<double>::infinity();
  for (const BlackBoxCandidate& each : all) best = std::max(best, each.simulation);
  std::size_t chosen = 0;
  for (std::size_t k = all.size(); k-- > 0;) {
    if (all[k].simulation < best - kSameFit) continue;
    const bool same_order =
        all[k].order == all[chosen].order && all[chosen].simulation >= best - kSameFit;
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

// Where nothing is said what the model is for: the likeliest one, unless another simulates better.
std::size_t choose(const ModelSearch& search, std::vector<BlackBoxCandidate>& all) {
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
    if (all.back().order == all[simulator].order) return simulator;
  }
  all.push_back(candidate(search, all[simulator].order, Refinement::prediction_error, false));
  const bool better = all.back().simulation > all[simulator].simulation && !overfits(all);
  return better ? all.size() - 1 : simulator;
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
                : search.simulates()                                              ? "simulation"
                                                                                  : "prediction";
  out.order = chosen.order;
  out.refinement = to_string(chosen.refinement);
  out.lags = static_cast<long>(search.of_all.sums.lags);
  out.held_out_share = options.held_out_share;
  const VectorXd& values = search.of_all.states.singular_values();
  out.singular_values = values.head(std::min<Index>(values.size(), 2 * options.most_order));
  for (const BlackBoxCandidate& each : all) {
    out.candidates.push_back({each.order, to_string(each.refinement), each.bic,
                              100.0 * each.simulation, 100.0 * each.prediction});
  }
  std::stable_sort(out.candidates.begin(), out.candidates.end(),
                   [](const auto& a, const auto& b) { return a.order < b.order; });
  return out;
}

// Poles, gains, delays and the operating point of the chosen model.
void add_characteristics(const ModelSearch& search, const Dataset& first,
                         const BlackBoxCandidate& chosen, BlackBox& out) {
  const MatrixXd covariance = predictor_covariance(
      chosen.model, sums_around(chosen.model, search.all, search.of_all.sums.lags));
  out.poles = poles_with_errors(chosen.model, covariance, first.dt);
  const SteadyGain gain = steady_gain(chosen.model, covariance);
  const OperatingPoint& point = search.all.point;
  const auto to_si = [&](const MatrixXd& of) -> MatrixXd {
    return point.y_sd.asDiagonal() * of * point.u_sd.cwiseInverse().asDiagonal();
  };
  out.gain = to_si(gain.value);
  out.gain_se = to_si(gain.se);
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
  constexpr Index kResponse = 100;  // rows
  out.impulse_responses = impulse_responses(search.all, first, kResponse);
  const std::vector<long> delays = input_delays(search.of_all.sums);
  for (std::size_t j = 0; j < delays.size(); ++j) out.delays.push_back({out.inputs[j], delays[j]});
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
  const double fit = search.simulates() ? chosen.simulation : chosen.prediction;
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
    out.push_back(
        make_finding(FindingCode::other, {},
                     "the model is unstable: its predictions are not, its simulations are",
                     "recorded in closed loop that may be right"));
  }
  return out;
}

void check_options(const BlackBoxOptions& options) {
  if (options.least_order < 1 || options.most_order < options.least_order ||
      options.most_order > 60) {
    throw std::invalid_argument("estimate_black_box: orders from 1 to 60, rising");
  }
  if (!(options.held_out_share > 0.0 && options.held_out_share < 0.8)) {
    throw std::invalid_argument("estimate_black_box: a share above 0 and below 0.8 is held out");
  }
}

}  // namespace

BlackBoxResult estimate_black_box(const Model& channels, const std::vector<Dataset>& recordings,
                                  const BlackBoxOptions& options) {
  check_options(options);
  ScaledRecordings all = scaled(recordings);
  SplitRecordings parts = split(all, 1.0 - options.held_out_share);
  constexpr Index kMostHeldOut = 40000;  // rows
  parts.rest = first_rows(parts.rest, kMostHeldOut);
  const Index lags = suitable_lags(parts.first, options.most_order);
  SubspaceStart of_first = subspace_start(parts.first, lags, nullptr);
  SubspaceStart of_all = subspace_start(all, lags, &of_first.prior);
  ModelSearch search{std::move(all), std::move(parts), std::move(of_first), std::move(of_all)};
  search.has_inputs = !channels.inputs.empty();
  search.purpose = options.purpose;
  if (search.purpose == BlackBoxPurpose::simulation && !search.has_inputs) {
    throw std::invalid_argument("estimate_black_box: without inputs nothing can be simulated");
  }
  std::vector<BlackBoxCandidate> tried = candidates(search, options);
  const std::size_t best = choose(search, tried);
  if (!std::isfinite(tried[best].bic)) fit_to_all_rows(search, tried[best]);
  const BlackBoxCandidate& chosen = tried[best];

  BlackBoxResult out;
  out.model = with_channels(channels, recordings, in_units(chosen.model, search.all.point),
                            search.all.point);
  BlackBoxEstimate& estimate = out.estimate;
  estimate.model_name = channels.name;
  estimate.objective.method = "subspace";
  estimate.black_box = description(search, tried, chosen, options);
  add_characteristics(search, recordings.front(), chosen, estimate.black_box);
  const std::vector<Dataset> seen = deviations(recordings, search.all.point);
  report_filter(estimate, out.model, out.model.parameters, seen);
  if (search.has_inputs) simulate_all(search, chosen, recordings.front().outputs, estimate);
  Findings left = check_innovations(estimate);
  for (Finding& each : left)
    each.remedy = "a higher --order, a shorter step, or inputs that are missing";
  append(estimate.findings, left);
  append(estimate.findings, judged(search, chosen));
  conclude(estimate, fmt::format("{} states", chosen.order));
  return out;
}

}  // namespace identikal
