#include "identify/noise/extend.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/check.h"
#include "identify/model/model_file.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "solvers/covariance.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Of more outputs than that, all are extended at once, or none by a state each.
constexpr std::size_t kMostAlone = 4, kMostStates = 6;
constexpr double kStandardErrors = 3.0, kLeastGain = 0.01;  // nats per row

// A model as its file has it, at values that were found for it.
struct ExtendedModel {
  YamlNode root;
  Model model;
  std::vector<VectorXd> densities;  // of held-out rows, per recording; empty: it does not run
  double criterion = 0.0;           // of the first part: log-likelihood less BIC's penalty
};

std::vector<Dataset> first_parts(const std::vector<Dataset>& recordings, double hold_out) {
  std::vector<Dataset> out;
  for (const Dataset& data : recordings) {
    const auto keep = static_cast<Index>(std::ceil((1.0 - hold_out) * data.size()));
    out.push_back(first_samples(data, std::max<Index>(keep, 2)));
  }
  return out;
}

// Values of parameters that both have.
void take_values(const Model& from, Model& to) {
  for (Parameter& p : to.parameters) {
    const int i = find_parameter(from.parameters, p.name);
    if (i < 0 || from.parameters[static_cast<std::size_t>(i)].value.size() != p.value.size()) {
      continue;
    }
    p = from.parameters[static_cast<std::size_t>(i)];
  }
}

// Do the data tell all unknowns inside their bounds?
bool determines(const LikelihoodProblem& problem, const VectorXd& x) {
  double value = 0.0;
  VectorXd gradient;
  MatrixXd information;
  if (!problem.evaluate(x, value, &gradient, &information)) return false;
  std::vector<Index> inside;
  for (Index i = 0; i < x.size(); ++i) {
    if (x[i] > problem.lower[i] && x[i] < problem.upper[i]) inside.push_back(i);
  }
  return inside.empty() || scaled_inverse(information(inside, inside), kFlat).has_value();
}

// False where nothing is found.
bool fit_to(Model& model, const std::vector<Dataset>& recordings) {
  RecordingsLikelihood likelihood(model, recordings);
  if (likelihood.status_at_start() != FilterStatus::ok) return false;
  likelihood.condition_on_beginning();
  likelihood.weigh_by_priors();
  SolverOptions solver;
  solver.max_iterations = 40;
  solver.decrement_tolerance = 1e-4;
  const Solution end = maximise(likelihood.problem(), coordinates(model.parameters), solver);
  if (!std::isfinite(end.summary.objective) || !determines(likelihood.problem(), end.x))
    return false;
  model.parameters = with_coordinates(model.parameters, end.x);
  return true;
}

// log p(y(t) | y(1), ..., y(t-1)) of the rows from `from` on.
std::optional<VectorXd> densities(const Model& model, const Dataset& data, Index from) {
  const FilterResult filter = run_filter(model, model.parameters, data);
  if (filter.status != FilterStatus::ok || filter.first_proper > from) return std::nullopt;
  VectorXd out = VectorXd::Zero(data.size() - from);
  for (Index t = from; t < data.size(); ++t) {
    std::vector<Index> present;
    for (Index i = 0; i < data.y.rows(); ++i) {
      if (!std::isnan(data.y(i, t))) present.push_back(i);
    }
    if (present.empty()) continue;
    const MatrixXd Sigma = filter.Sigma[static_cast<std::size_t>(t)](present, present);
    const Eigen::LLT<MatrixXd> factor(Sigma);
    if (factor.info() != Eigen::Success) return std::nullopt;
    const MatrixXd L = factor.matrixL();
    const VectorXd z = L.triangularView<Eigen::Lower>().solve(VectorXd(filter.e(present, t)));
    out[t - from] = -0.5 * z.squaredNorm() - L.diagonal().array().log().sum() -
                    0.5 * kLogTwoPi * static_cast<double>(present.size());
  }
  return out;
}

bool predict(ExtendedModel& candidate, const std::vector<Dataset>& recordings,
             const std::vector<Dataset>& first) {
  constexpr Index kSettles = 5;  // a share of the first part: diffuse starts do not compare
  candidate.densities.clear();
  candidate.criterion = 0.0;
  double rows = 0.0;
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    const Index held = first[r].size(), begin = held / kSettles;
    const auto all = densities(candidate.model, recordings[r], begin);
    if (!all) return false;
    candidate.criterion += all->head(held - begin).sum();
    rows += static_cast<double>(held - begin);
    candidate.densities.push_back(all->tail(all->size() - (held - begin)));
  }
  const auto unknowns = static_cast<double>(free_entries(candidate.model.parameters).size());
  candidate.criterion -= 0.5 * unknowns * std::log(rows);
  return true;
}

// The mean gain per row, and its standard error from blocks of rows.
std::pair<double, double> gain_of(const ExtendedModel& more, const ExtendedModel& less) {
  constexpr Index kBlocks = 10;
  std::vector<double> blocks;
  double sum = 0.0, rows = 0.0;
  for (std::size_t r = 0; r < more.densities.size(); ++r) {
    const VectorXd gain = more.densities[r] - less.densities[r];
    sum += gain.sum();
    rows += static_cast<double>(gain.size());
    const Index length = std::max<Index>(1, gain.size() / kBlocks);
    for (Index at = 0; at + length <= gain.size(); at += length) {
      blocks.push_back(gain.segment(at, length).mean());
    }
  }
  const double mean = sum / rows;
  double squares = 0.0;
  for (const double block : blocks) squares += (block - mean) * (block - mean);
  const auto count = static_cast<double>(blocks.size());
  return {mean, std::sqrt(squares / (count - 1.0) / count)};
}

std::vector<ModelExtension> extensions_of(const Model& model, const std::vector<Dataset>& first) {
  std::vector<ModelExtension> out;
  const FilterResult filter = run_filter(model, model.parameters, first[0], Keep::innovations);
  if (filter.status != FilterStatus::ok) return out;
  ModelExtension biases{ExtensionKind::bias, {}, {}}, errors{ExtensionKind::lasting_error, {}, {}};
  const auto has = [&](const std::string& name) {
    return find_parameter(model.parameters, name) >= 0;
  };
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    const auto e = filter.e.row(static_cast<Index>(i)).array();
    const double rows = static_cast<double>((e == e).count());
    const double size = std::sqrt((e == e).select(e.square(), 0.0).sum() / std::max(1.0, rows));
    if (!(size > 0.0)) continue;
    const std::string& name = model.outputs[i].name;
    for (ModelExtension* each : {&biases, &errors}) {
      const bool is_bias = each->kind == ExtensionKind::bias;
      if (has((is_bias ? "bias_" : "tau_") + name)) continue;
      each->names.push_back(name);
      each->size.push_back(0.5 * size);
    }
  }
  for (const ModelExtension& all : {biases, errors}) {
    const std::size_t count = all.names.size();
    for (std::size_t i = 0; count <= kMostAlone && i < count; ++i) {
      out.push_back({all.kind, {all.names[i]}, {all.size[i]}});
    }
    const bool many_states = all.kind == ExtensionKind::lasting_error && count > kMostStates;
    if (count > 1 && !many_states) out.push_back(all);
  }
  const StateSpace written = written_matrices(noise_model(model), model.parameters);
  const MatrixXd Q = written.G * written.Q * written.G.transpose();
  for (std::size_t i = 0; i < model.states.size(); ++i) {
    const auto at = static_cast<Index>(i);
    const std::string& name = model.states[i].name;
    if (Q(at, at) != 0.0 || name.starts_with("error_") || has("q_" + name)) continue;
    const double of_others = std::sqrt(Q.diagonal().maxCoeff());
    if (of_others > 0.0) out.push_back({ExtensionKind::process_noise, {name}, {0.1 * of_others}});
  }
  return out;
}

// The model with one more part, fitted; nothing where it does not go with it.
std::optional<ExtendedModel> tried(const ExtendedModel& base, const ModelExtension& extension,
                                   const std::vector<Dataset>& recordings,
                                   const std::vector<Dataset>& first) {
  try {
    ExtendedModel out;
    out.root = extended(base.root, extension, first[0].dt);
    out.model = model_of(out.root, base.model.source);
    take_values(base.model, out.model);
    out.model = checked(std::move(out.model), first);
    if (!fit_to(out.model, first) || !predict(out, recordings, first)) return std::nullopt;
    return out;
  } catch (const InputError&) {
    return std::nullopt;  // units that do not fit, no named noise, a start of another kind
  }
}

bool pays(double gain, double se) { return gain > kStandardErrors * se && gain > kLeastGain; }

// An extension that was tried.
struct Fitted {
  ExtendedModel candidate;
  std::size_t trial;
};

// Of those that pay and that none predicts better than, the one that the first part asks for, by BIC.
std::optional<std::size_t> chosen_of(const std::vector<Fitted>& fitted,
                                     const std::vector<ExtensionTrial>& tried) {
  const auto gains = [&](const Fitted& each) {
    return pays(tried[each.trial].gain, tried[each.trial].gain_se);
  };
  const auto beaten = [&](const Fitted& each) {
    return std::any_of(fitted.begin(), fitted.end(), [&](const Fitted& other) {
      const auto [lead, lead_se] = gain_of(other.candidate, each.candidate);
      return gains(other) && pays(lead, lead_se);
    });
  };
  std::optional<std::size_t> out;
  for (std::size_t i = 0; i < fitted.size(); ++i) {
    if (!gains(fitted[i]) || beaten(fitted[i])) continue;
    if (!out || fitted[i].candidate.criterion > fitted[*out].candidate.criterion) out = i;
  }
  return out;
}

std::vector<std::string> table_of(const std::vector<ExtensionTrial>& tried) {
  std::vector<std::string> out{"further parts tried, by the log-likelihood per row held out:"};
  for (const ExtensionTrial& trial : tried) {
    out.push_back(fmt::format("  {:<36} {}{}", trial.what,
                              std::isnan(trial.gain)
                                  ? "no filter, or no estimate"
                                  : fmt::format("{:+.3f} +- {:.3f}", trial.gain, trial.gain_se),
                              trial.adopted ? "  adopted"
                              : trial.rival ? "  as good"
                                            : ""));
  }
  return out;
}

}  // namespace

ExtendResult tune_extended(const YamlNode& root, const Model& given,
                           const std::vector<Dataset>& recordings, const ExtendOptions& options) {
  if (given.states.empty()) {
    throw InputError({given.source, 0, 0}, "a model by matrices cannot be extended",
                     "a model of formulas: states, dynamics and outputs by their names",
                     "'identikal shape' finds coloured noise of a model by matrices");
  }
  ExtendResult out;
  ExtendedModel best;
  best.root = root;
  best.model = checked(given, recordings);
  const std::vector<Dataset> first = first_parts(recordings, options.hold_out);
  fit_to(best.model, first);  // where it does not determine all, it predicts with what it has
  bool runs = predict(best, recordings, first);
  for (int step = 0; runs && step < options.most; ++step) {
    std::vector<Fitted> fitted;
    for (const ModelExtension& extension : extensions_of(best.model, first)) {
      if (options.progress && !options.progress(in_words(extension))) runs = false;
      if (!runs) break;
      ExtensionTrial trial{in_words(extension), kNone, kNone, false};
      auto candidate = tried(best, extension, recordings, first);
      if (candidate) {
        std::tie(trial.gain, trial.gain_se) = gain_of(*candidate, best);
        fitted.push_back({std::move(*candidate), out.tried.size()});
      }
      out.tried.push_back(std::move(trial));
    }
    const auto chosen = chosen_of(fitted, out.tried);
    if (!chosen) break;
    Fitted& better = fitted[*chosen];
    for (const Fitted& each : fitted) {
      ExtensionTrial& trial = out.tried[each.trial];
      trial.adopted = each.trial == better.trial;
      const auto [lead, lead_se] = gain_of(better.candidate, each.candidate);
      trial.rival = !trial.adopted && trial.gain > kLeastGain && !pays(lead, lead_se);
    }
    best = std::move(better.candidate);
    out.text = model_file_text(best.root);
  }
  Model chosen = out.text.empty() ? given : best.model;
  out.estimate = tune_ml(chosen, recordings, options.search);
  const std::vector<std::string> lines = table_of(out.tried);
  out.estimate.notes.insert(out.estimate.notes.end(), lines.begin(), lines.end());
  return out;
}

}  // namespace identikal
