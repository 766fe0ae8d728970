#include "identify/optimality/compare_filters.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/test_result.h"
#include "identify/filter/leading_samples.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/report.h"
#include "identify/model/check.h"
#include "identify/optimality/optimality.h"
#include "lib/base/constants.h"
#include "lib/statistics/autocorrelation.h"
#include "lib/statistics/autoregression.h"
#include "lib/statistics/long_run_covariance.h"
#include "lib/statistics/whiteness.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kHighestPairOrder = 10;

struct Scored {
  double log_likelihood = kNone, mean = kNone, worst = kNone, order = kNone;
  bool optimal = false;
  int lags = 0;      // of the autocorrelations behind mean and worst
  VectorXd squares;  // e' Sigma^-1 e of each sample; NaN where none is present
};

// e' Sigma^-1 e of each sample, recordings side by side; 0 where nothing is present.
VectorXd squares_behind(std::vector<FilterResult> filters, Index gap, Index beginning) {
  for (FilterResult& filter : filters) {
    const Index first = std::min(beginning, filter.standardised.cols());
    filter.standardised.leftCols(first).setConstant(kNone);
  }
  const MatrixXd e = side_by_side(filters, gap);
  return (e.array() == e.array()).select(e, 0.0).colwise().squaredNorm().transpose();
}

/// @param beginning  leading samples of every recording that count for nothing
Scored scored(const Model& model, const std::vector<Dataset>& recordings, Index beginning) {
  Scored out;
  FilterEstimate described;
  const std::vector<FilterResult> filters =
      report_filter(described, model, model.parameters, recordings);
  out.log_likelihood = described.objective.log_likelihood;
  if (beginning > 0) {
    const LeadingSamples leading = leading_samples(model, model.parameters, recordings);
    described.objective.leading = leading.log_likelihood;
    out.log_likelihood = log_likelihood_behind(described.objective, beginning);
  }
  out.optimal = test_optimality(model, recordings, filters).optimal;
  Index shortest = recordings[0].size();
  for (const Dataset& data : recordings) shortest = std::min(shortest, data.size());
  const int lags = out.lags = default_lags(shortest);
  const MatrixXd e =
      side_by_side(of_measured(filters, recordings[0].outputs), std::max(lags, kHighestPairOrder));
  const auto present = (e.array() == e.array());
  out.squares = squares_behind(filters, std::max(lags, kHighestPairOrder), beginning);
  const auto samples = static_cast<Index>(present.colwise().all().count());
  const VectorXd psi = published_chi_square(
      autocorrelations(sample_autocovariances(e, lags + 1, Divisor::equal_variance)), samples);
  out.mean = psi.mean();
  out.worst = psi.maxCoeff();
  const Autoregressions models =
      yule_walker(sample_autocovariances(e, kHighestPairOrder + 1, Divisor::samples));
  if (models.S.size() > 1 && samples >= 3) {
    out.order = -autoregressive_order(models, samples, Penalty::bic).least;
  }
  return out;
}

// Two-sided p-value of the difference in log-likelihood.
double difference(const Scored& a, const Scored& best) {
  const double gap = a.log_likelihood - best.log_likelihood;
  if (a.squares.size() != best.squares.size() || gap == 0.0) return 1.0;
  VectorXd d = 0.5 * (best.squares - a.squares);
  d.array() -= d.mean();
  const double variance =
      long_run_covariance(d.transpose(), andrews_bandwidth(d.transpose(), d.size() / 4 + 1))(0, 0);
  return variance > 0.0 ? normal_two_sided(gap / std::sqrt(variance)) : 0.0;
}

void check_models(const std::vector<Model>& models, std::size_t lists) {
  if (models.size() != lists) {
    throw std::invalid_argument(
        fmt::format("{} models and {} lists of recordings", models.size(), lists));
  }
  if (models.size() < 2) {
    throw InputError({}, "one filter cannot be compared", "identikal compare A.yaml B.yaml DATA");
  }
  for (const Model& model : models) {
    if (!has_filter(model)) {
      const bool vehicle = is_vehicle(model);
      throw InputError({model.source, 0, 0},
                       fmt::format("'compare' ranks Kalman filters, this is a {}",
                                   vehicle ? "vehicle" : "regression"),
                       "a model with Q and R");
    }
    const auto same = [](const ChannelSource& a, const ChannelSource& b) {
      return a.column == b.column;
    };
    if (!std::equal(model.outputs.begin(), model.outputs.end(), models[0].outputs.begin(),
                    models[0].outputs.end(), same)) {
      throw InputError({model.source, 0, 0},
                       "its outputs are other columns than those of " + models[0].source,
                       "the same measurements in the same order",
                       "likelihoods of different data cannot be compared");
    }
  }
}

// Of y = a + b x with the same x in every row that both have: log |b|, once for every value behind
// the beginning. It makes a density of y one of x.
// @throws InputError where they are not such views of one measurement
double log_units(const std::vector<Dataset>& of, const std::vector<Dataset>& in, Index output,
                 Index beginning, const Model& model) {
  constexpr double kRounding = 1e-9;
  double least = kInfinity, most = -kInfinity, at_least = kNone, at_most = kNone, values = 0.0;
  const auto each = [&](const auto& see) {
    for (std::size_t k = 0; k < of.size(); ++k) {
      const Index rows = std::min(of[k].y.cols(), in[k].y.cols());
      for (Index t = 0; t < rows; ++t) {
        const double y = of[k].y(output, t), x = in[k].y(output, t);
        if (std::isfinite(y) && std::isfinite(x)) see(t, y, x);
      }
    }
  };
  each([&](Index t, double y, double x) {
    values += t >= beginning ? 1.0 : 0.0;
    if (x < least) least = x, at_least = y;
    if (x > most) most = x, at_most = y;
  });
  if (!(most > least)) return 0.0;
  const double b = (at_most - at_least) / (most - least);
  double off = 0.0;
  each([&](Index, double y, double x) {
    off = std::max(off, std::abs(y - at_least - b * (x - least)));
  });
  const double size = std::abs(b) * std::max({std::abs(least), std::abs(most), most - least});
  if (b != 0.0 && off <= kRounding * size) return values * std::log(std::abs(b));
  throw InputError({model.source, 0, 0},
                   fmt::format("its '{}' is no multiple of that of the first model",
                               of.front().outputs[static_cast<std::size_t>(output)].name),
                   "the same measurements, but for units and offsets",
                   "likelihoods of different data cannot be compared");
}

// All of them behind the same beginning, densities in the units of the first.
struct ScoredModels {
  std::vector<Scored> all;
  Index beginning = 0;
};

ScoredModels score_all(const std::vector<Model>& models,
                       const std::vector<std::vector<Dataset>>& recordings) {
  ScoredModels out;
  std::vector<Model> filters;
  for (std::size_t i = 0; i < models.size(); ++i) {
    const Model model = checked(models[i], recordings[i]);
    check_channels(recordings[i]);
    const LeadingSamples leading = leading_samples(model, model.parameters, recordings[i]);
    out.beginning = std::max(out.beginning, leading.diffuse);
    filters.push_back(model);
  }
  for (std::size_t i = 0; i < models.size(); ++i) {
    Scored score = scored(filters[i], recordings[i], out.beginning);
    for (std::size_t j = 0; i > 0 && j < models[i].outputs.size(); ++j) {
      const ChannelSource &here = models[i].outputs[j], &first = models[0].outputs[j];
      // Offsets change no density.
      if (here.unit == first.unit && here.scale == first.scale) continue;
      score.log_likelihood +=
          log_units(recordings[i], recordings[0], static_cast<Index>(j), out.beginning, models[i]);
    }
    if (std::isnan(score.log_likelihood)) {
      throw InputError(
          {models[i].source, 0, 0},
          fmt::format("{} samples determine the diffuse start of another", out.beginning),
          "longer recordings, or starts that fewer samples determine");
    }
    out.all.push_back(std::move(score));
  }
  return out;
}

}  // namespace

Comparison compare_filters(const std::vector<Model>& models,
                           const std::vector<std::vector<Dataset>>& recordings) {
  check_models(models, recordings.size());
  const ScoredModels scores = score_all(models, recordings);
  const std::vector<Scored>& all = scores.all;
  std::vector<std::size_t> order(models.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return all[a].log_likelihood > all[b].log_likelihood;
  });
  const Scored& best = all[order[0]];

  Comparison out;
  out.model_name = fmt::format("{} filters", models.size());
  out.objective.method = "compare";
  out.objective.log_likelihood = best.log_likelihood;
  const auto least = [&](double Scored::*measure) {
    double value = kInfinity;
    for (const Scored& s : all) value = std::min(value, s.*measure);
    return value;
  };
  const std::pair<const char*, double Scored::*> measures[] = {{"measure_mean", &Scored::mean},
                                                               {"measure_worst", &Scored::worst},
                                                               {"measure_order", &Scored::order}};
  out.notes.emplace_back("rank log-likelihood  to best      p Q mean  Q max    AR opt file");
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    const Scored& s = all[order[rank]];
    const std::string& path = models[order[rank]].source;
    TestResult likelihood = reported_figure("log_likelihood", path, s.log_likelihood, rank == 0);
    likelihood.p = difference(s, best);
    out.tests.push_back(likelihood);
    for (const auto& [id, measure] : measures) {
      out.tests.push_back(reported_figure(id, path, s.*measure, s.*measure == least(measure)));
    }
    out.tests.push_back(reported_figure("optimal", path, s.optimal ? 1.0 : 0.0, s.optimal));
    // Within the width of the console.
    const std::string file = path.size() <= 19 ? path : "..." + path.substr(path.size() - 16);
    out.notes.push_back(
        fmt::format("{:>4} {:>14.2f} {:>8.2f} {:>6.2g} {:>6.1f} {:>6.1f} {:>5.0f} {:>3} {}",
                    rank + 1, s.log_likelihood, s.log_likelihood - best.log_likelihood,
                    likelihood.p, s.mean, s.worst, s.order, s.optimal ? "yes" : "no", file));
  }
  out.notes.push_back(
      fmt::format("Q: N times the sum of squared autocorrelations of an output's innovations at {} "
                  "lags, about {} where they are white: mean over the outputs, largest",
                  best.lags, best.lags));
  out.notes.emplace_back(
      "AR: what an autoregressive model of the innovations would gain, below 0 where they are "
      "white");
  out.notes.emplace_back("opt: passes the tests of 'check'");
  if (scores.beginning > 0) {
    out.notes.push_back(fmt::format(
        "log-likelihoods are those of the samples behind the first {}, which determine a diffuse "
        "start",
        scores.beginning));
  }
  const double p = difference(all[order[1]], best);
  const std::string doubt =
      p < kFamilyError ? "" : fmt::format(", but not significantly (p = {:.2g})", p);
  conclude(out, fmt::format("{} has the highest likelihood{}", models[order[0]].source, doubt),
           Basis::tests);
  return out;
}

}  // namespace identikal
