#include "identify/black_box/black_box.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "identify/black_box/internal/candidates.h"
#include "identify/black_box/internal/innovation_errors.h"
#include "identify/black_box/internal/scaled_recordings.h"
#include "identify/filter/report.h"
#include "identify/filter/simulated_fit.h"
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
struct Search {
  ScaledRecordings all;
  SplitRecordings parts;
  SubspaceStart of_first, of_all;
  bool simulation = false;  // is it the purpose?
  bool has_inputs = false;
};

BlackBoxCandidate candidate(const Search& search, int order, Refinement how) {
  BlackBoxCandidate out{order, how,
                        fitted(search.of_first, search.parts.first, order, how, search.simulation)};
  judge_on_held_out(out, search.parts.rest);
  BlackBoxCandidate on_all{order, how,
                           fitted(search.of_all, search.all, order, how, search.simulation)};
  judge_on_sums(on_all, search.of_all.sums);
  out.model = std::move(on_all.model);
  out.log_likelihood = on_all.log_likelihood;
  out.bic = on_all.bic;
  return out;
}

std::vector<BlackBoxCandidate> candidates(const Search& search, const BlackBoxOptions& options) {
  const auto most = static_cast<int>(
      std::min({static_cast<Index>(options.most_order), search.of_first.states.most_states(),
                search.of_all.states.most_states()}));
  std::vector<BlackBoxCandidate> out;
  for (int order = std::min(options.least_order, most); order <= most; ++order) {
    if (options.progress) options.progress(fmt::format("order {} of {}", order, most));
    out.push_back(candidate(search, order, Refinement::none));
    if (search.simulation) out.push_back(candidate(search, order, Refinement::simulation));
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
  const auto less = [](const BlackBoxCandidate& a, const BlackBoxCandidate& b) {
    return a.bic < b.bic;
  };
  return static_cast<std::size_t>(std::min_element(all.begin(), all.end(), less) - all.begin());
}

// By the prediction error method, what was chosen and, for predictions, its neighbours.
void refine_chosen(const Search& search, std::size_t chosen, std::vector<BlackBoxCandidate>& all) {
  const int order = all[chosen].order, around = search.simulation ? 0 : 1;
  const auto orders = std::minmax_element(
      all.begin(), all.end(),
      [](const BlackBoxCandidate& a, const BlackBoxCandidate& b) { return a.order < b.order; });
  const int least = orders.first->order, most = orders.second->order;
  for (int each = std::max(least, order - around); each <= std::min(most, order + around); ++each) {
    all.push_back(candidate(search, each, Refinement::prediction_error));
  }
}

std::size_t choose(const Search& search, std::vector<BlackBoxCandidate>& all) {
  const std::size_t first = search.simulation ? best_simulation(all) : least_bic(all);
  refine_chosen(search, first, all);
  if (!search.simulation) return least_bic(all);
  return all.back().simulation > all[first].simulation ? all.size() - 1 : first;
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

BlackBox description(const Search& search, const std::vector<BlackBoxCandidate>& all,
                     const BlackBoxCandidate& chosen, const BlackBoxOptions& options) {
  BlackBox out;
  out.purpose = search.simulation ? "simulation" : "prediction";
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
void describe_model(const Search& search, const Dataset& first, const BlackBoxCandidate& chosen,
                    BlackBox& out) {
  const MatrixXd covariance = predictor_covariance(chosen.model, search.of_all.sums);
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
  const std::vector<long> delays = input_delays(search.of_all.sums);
  for (std::size_t j = 0; j < delays.size(); ++j) out.delays.push_back({out.inputs[j], delays[j]});
}

// What the candidates' fits say of the answer.
Findings judged(const Search& search, const BlackBoxCandidate& chosen) {
  Findings out;
  const double fit = search.simulation ? chosen.simulation : chosen.prediction;
  if (!(fit > 0.0)) {
    out.push_back(make_finding(
        FindingCode::does_not_predict, {},
        fmt::format("no model of any order {} the held-out rows better than their mean does",
                    search.simulation ? "simulates" : "predicts"),
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
  const Index lags = suitable_lags(parts.first, options.most_order);
  SubspaceStart of_first = subspace_start(parts.first, lags, nullptr);
  SubspaceStart of_all = subspace_start(all, lags, &of_first.prior);
  Search search{std::move(all), std::move(parts), std::move(of_first), std::move(of_all)};
  search.has_inputs = !channels.inputs.empty();
  search.simulation = options.purpose == BlackBoxPurpose::simulation ||
                      (options.purpose == BlackBoxPurpose::automatic && search.has_inputs);
  if (search.simulation && !search.has_inputs) {
    throw std::invalid_argument("estimate_black_box: without inputs nothing can be simulated");
  }
  std::vector<BlackBoxCandidate> tried = candidates(search, options);
  const BlackBoxCandidate chosen = tried[choose(search, tried)];

  BlackBoxResult out;
  out.model = with_channels(channels, recordings, in_units(chosen.model, search.all.point),
                            search.all.point);
  BlackBoxEstimate& estimate = out.estimate;
  estimate.model_name = channels.name;
  estimate.black_box = description(search, tried, chosen, options);
  describe_model(search, recordings.front(), chosen, estimate.black_box);
  const std::vector<Dataset> seen = deviations(recordings, search.all.point);
  report_filter(estimate, out.model, out.model.parameters, seen);
  if (search.has_inputs) report_simulation(estimate, out.model, out.model.parameters, seen);
  Findings left = check_innovations(estimate);
  for (Finding& each : left)
    each.remedy = "a higher --order, a shorter step, or inputs that are missing";
  append(estimate.findings, left);
  append(estimate.findings, judged(search, chosen));
  conclude(estimate, fmt::format("{} states", chosen.order));
  return out;
}

}  // namespace identikal
