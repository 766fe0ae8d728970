#include "studies/figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include <Eigen/Core>
#include <Eigen/LU>
#include <fmt/format.h>

#include "identify/filter/recordings_likelihood.h"
#include "identify/noise/als.h"
#include "identify/noise/ml.h"
#include "identify/noise/track.h"
#include "lib/filter/information.h"
#include "lib/filter/steady_state.h"
#include "studies/published_systems.h"
#include "studies/runs.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

// x+ = a x + w, y = x + v, at these variances.
Model scalar_model(double a, double q, double r) {
  const MatrixXd one = MatrixXd::Ones(1, 1);
  return model_of({a * one, one, one}, q, r);
}

// The Fisher information of `samples` outputs about Q and R.
Eigen::Matrix2d information_of(const Model& truth, Index samples) {
  return expected_information(instantiate(as_linear(truth), truth.parameters),
                              as_linear(truth).initial, samples,
                              model_derivatives(as_linear(truth), truth.parameters), MatrixXd())
      .total;
}

// The log-likelihood at (q(i), r(j)).
MatrixXd log_likelihoods(const Model& model, const Dataset& data, const VectorXd& q,
                         const VectorXd& r) {
  const std::vector<Dataset> recordings{data};
  RecordingsLikelihood likelihood(model, recordings);
  MatrixXd out(q.size(), r.size());
  for (Index i = 0; i < q.size(); ++i) {
    for (Index j = 0; j < r.size(); ++j) {
      const Likelihood* at =
          likelihood.evaluate(with_entries(model.parameters, Vector2d(q[i], r[j])), false);
      out(i, j) = at == nullptr ? -HUGE_VAL : at->value;
    }
  }
  return out;
}

VectorXd logarithmic(Index n, double low, double high) {
  return VectorXd::LinSpaced(n, std::log(low), std::log(high)).array().exp();
}

// Equal steps from 0 to 1; the last takes in what rounding puts above.
std::vector<double> shares() {
  std::vector<double> out;
  for (int i = 0; i <= 10; ++i) out.push_back(0.1 * i);
  out.back() += 1e-12;
  return out;
}

// 1, 2 and 5 of every decade, from below the smallest to above the largest.
std::vector<double> round_levels(double smallest, double largest) {
  std::vector<double> all{0.0};
  for (int decade = -12; decade < 12; ++decade) {
    for (const double digit : {1.0, 2.0, 5.0}) all.push_back(digit * std::pow(10.0, decade));
  }
  const auto from = std::upper_bound(all.begin(), all.end(), smallest) - 1;
  const auto to = std::lower_bound(all.begin(), all.end(), largest) + 1;
  return {from, to};
}

Curve point(const std::string& name, double x, double y) {
  return {name, VectorXd::Constant(1, x), VectorXd::Constant(1, y), Curve::Form::points};
}

// "Q, R, name..." over all points of the grid.
std::string grid_csv(const VectorXd& q, const VectorXd& r,
                     const std::vector<std::pair<std::string, MatrixXd>>& columns) {
  std::string out = "Q,R";
  for (const auto& [name, values] : columns) out += "," + name;
  out += "\n";
  for (Index i = 0; i < q.size(); ++i) {
    for (Index j = 0; j < r.size(); ++j) {
      out += fmt::format("{:.6g},{:.6g}", q[i], r[j]);
      for (const auto& [name, values] : columns) out += fmt::format(",{:.6g}", values(i, j));
      out += "\n";
    }
  }
  return out;
}

// Some of the grid's values, R along the line.
std::string grid_table(const VectorXd& q, const VectorXd& r, const MatrixXd& value,
                       const std::vector<Index>& at) {
  std::string out = fmt::format("  {:>8} |", "Q \\ R");
  for (const Index j : at) out += fmt::format(" {:>9.3g}", r[j]);
  out += "\n";
  for (const Index i : at) {
    out += fmt::format("  {:>8.3g} |", q[i]);
    for (const Index j : at) out += fmt::format(" {:>9.3g}", value(i, j));
    out += "\n";
  }
  return out;
}

// Figures 4 and 5: one recording of x+ = 0.5 x + w, y = x + v.
constexpr double kMapA = 0.5, kMapQ = 2.0, kMapR = 10.0;
const std::vector<Index> kSome{0, 15, 31, 47, 63, 79};

Panel map_of(const VectorXd& q, const VectorXd& r, const MatrixXd& share, const std::string& what) {
  Panel panel;
  panel.x = {"Q", 0.0, q[q.size() - 1]};
  panel.y = {"R", r[0], r[r.size() - 1]};
  panel.x.low = q[0];
  panel.map = Map{what + " / its maximum", q, r, share, shares()};
  return panel;
}

StudyReport figure_4(const StudyOptions& options) {
  const Model truth = scalar_model(kMapA, kMapQ, kMapR);
  const VectorXd q = VectorXd::LinSpaced(80, 0.25, 20.0), r = q;
  const double segment = 1.0 / (1.0 - kMapA * kMapA), y = std::sqrt(segment * kMapQ + kMapR);
  Random random(options.seed);
  Dataset data = recording(truth, 1, random);
  data.y(0, 0) = y;  // a typical one, rather than what the seed gives
  const MatrixXd L = log_likelihoods(truth, data, q, r);
  Index i = 0, j = 0;
  const double highest = L.maxCoeff(&i, &j);
  const MatrixXd share = (L.array() - highest).exp();
  StudyReport out;
  out.text = fmt::format(
      "matisko-figure-4: likelihood of Q and R from one sample, a = {:g}, c = g = 1, Q = {:g}, R = "
      "{:g}\n"
      "published: a surface without numbers; its shape \"depends on the system matrices, (mainly "
      "A) and the noise\ncovariances\"\n"
      "ours: y = {:.4f}, one standard deviation. From a stationary start it has variance "
      "Q / (1 - a^2) + R and\n"
      "determines no more: a ridge along Q / (1 - a^2) + R = y^2 = {:.4f}. Highest on the grid at "
      "Q = {:.2f}, R = {:.2f},\n"
      "density {:.5f}.\n"
      "likelihood / its maximum:\n",
      kMapA, kMapQ, kMapR, y, y * y, q[i], r[j], std::exp(highest));
  out.text += grid_table(q, r, share, kSome);
  Panel panel = map_of(q, r, share, "likelihood");
  panel.title = "Likelihood of Q and R, one sample";
  Curve ridge{"Q / (1 − a²) + R = y²", VectorXd::LinSpaced(200, q[0], q[q.size() - 1]), VectorXd(),
              Curve::Form::dashed};
  ridge.y = y * y - segment * ridge.x.array();
  for (double& v : ridge.y) v = v < r[0] || v > r[r.size() - 1] ? std::nan("") : v;
  panel.curves = {point("truth", kMapQ, kMapR), ridge};
  out.csv = grid_csv(q, r, {{"likelihood", L.array().exp()}});
  out.figure = Figure{{panel}};
  return out;
}

StudyReport figure_5(const StudyOptions& options) {
  constexpr Index kSamples = 2000;
  const Model truth = scalar_model(kMapA, kMapQ, kMapR);
  const VectorXd q = VectorXd::LinSpaced(80, 0.075, 6.0), r = VectorXd::LinSpaced(80, 6.1, 14.0);
  StudyOptions once = options;
  once.runs = 1;
  Dataset data;
  repeat(once, 0, [&](int, Random& random) { data = recording(truth, kSamples, random); });
  const MatrixXd L = log_likelihoods(truth, data, q, r);
  Index i = 0, j = 0;
  const double highest = L.maxCoeff(&i, &j);
  const MatrixXd share = (L.array() - highest).exp();
  const MatrixXd weight = share / share.sum();
  const VectorXd of_q = weight.rowwise().sum(), of_r = weight.colwise().sum();
  const Vector2d mean(of_q.dot(q), of_r.dot(r));
  const VectorXd dq = q.array() - mean[0], dr = r.array() - mean[1];
  const Vector2d sd(std::sqrt(of_q.dot(dq.cwiseAbs2())), std::sqrt(of_r.dot(dr.cwiseAbs2())));
  const double correlation = dq.dot(weight * dr) / (sd[0] * sd[1]);
  const Eigen::Matrix2d bound = information_of(truth, kSamples).inverse();
  StudyReport out;
  out.text = fmt::format(
      "matisko-figure-5: posterior of Q and R from {} samples, a = {:g}, c = g = 1, Q = {:g}, R = "
      "{:g}\n"
      "published: a surface without numbers; \"the posterior pdf has a well detectable maximum\"\n"
      "ours, flat prior on the map:\n"
      "  {:<28} {:>8} {:>8}\n",
      kSamples, kMapA, kMapQ, kMapR, "", "Q", "R");
  const auto line = [&out](const char* what, double a, double b) {
    out.text += fmt::format("  {:<28} {:>8.3f} {:>8.3f}\n", what, a, b);
  };
  line("most probable on the grid", q[i], r[j]);
  line("posterior mean", mean[0], mean[1]);
  line("posterior standard deviation", sd[0], sd[1]);
  line("Cramer-Rao bound", std::sqrt(bound(0, 0)), std::sqrt(bound(1, 1)));
  out.text += fmt::format("  {:<28} {:>8.3f}\n  {:<28} {:>8.3f}\nposterior / its maximum:\n",
                          "correlation of Q and R", correlation, "that of the bound",
                          bound(0, 1) / std::sqrt(bound(0, 0) * bound(1, 1)));
  out.text += grid_table(q, r, share, kSome);
  Panel panel = map_of(q, r, share, "posterior");
  panel.title = fmt::format("Posterior of Q and R, {} samples", kSamples);
  panel.curves = {point("truth", kMapQ, kMapR), point("most probable", q[i], r[j])};
  const double cell = (q[1] - q[0]) * (r[1] - r[0]);
  out.csv = grid_csv(q, r, {{"posterior_density", weight / cell}});
  out.figure = Figure{{panel}};
  return out;
}

StudyReport figure_6(const StudyOptions&) {
  constexpr double kA = 0.95;
  constexpr Index kSide = 61;
  const VectorXd q = logarithmic(kSide, 0.1, 10.0), r = q;
  MatrixXd by_q(kSide, kSide), by_r(kSide, kSide), gain(kSide, kSide);
  for (Index i = 0; i < kSide; ++i) {
    for (Index j = 0; j < kSide; ++j) {
      const Model model = scalar_model(kA, q[i], r[j]);
      const auto steady =
          steady_gain_sensitivity(instantiate(as_linear(model), model.parameters),
                                  model_derivatives(as_linear(model), model.parameters));
      gain(i, j) = steady->K(0, 0);
      by_q(i, j) = steady->K_theta[0](0, 0);
      by_r(i, j) = steady->K_theta[1](0, 0);
    }
  }
  StudyReport out;
  const std::vector<Index> some{0, 15, 30, 45, 60};
  out.text = fmt::format(
      "matisko-figure-6: sensitivity (4.33) of the steady gain l to Q and R, a = {:g}, c = g = 1\n"
      "published: two surfaces without numbers; \"the sensitivity decreases with increasing "
      "covariances\"\n"
      "ours: of the predictor's gain l = a P / (P + R), a times that of a filter that updates "
      "first. l depends\n"
      "on Q / R alone, so that Q dl/dQ = -R dl/dR, and ten times the Q and R have a tenth of the "
      "sensitivity.\n"
      "dl/dQ falls with Q at any R, |dl/dR| with R at any Q; each grows with the other covariance "
      "while that is\nthe smaller one.\n",
      kA);
  out.text += "dl/dQ:\n" + grid_table(q, r, by_q, some) + "dl/dR:\n" + grid_table(q, r, by_r, some);
  Figure figure;
  const auto add = [&](const std::string& title, const std::string& label, const MatrixXd& value) {
    Panel panel;
    panel.title = title;
    panel.x = {"Q", q[0], q[kSide - 1], true};
    panel.y = {"R", r[0], r[kSide - 1], true};
    panel.map = Map{label, q, r, value, round_levels(value.minCoeff(), value.maxCoeff())};
    figure.panels.push_back(panel);
  };
  add("Sensitivity of the gain to Q, a = 0.95", "∂l/∂Q", by_q);
  add("Sensitivity of the gain to R, a = 0.95", "−∂l/∂R", -by_r);
  out.csv = grid_csv(q, r, {{"l", gain}, {"dl_dQ", by_q}, {"dl_dR", by_r}});
  out.figure = figure;
  return out;
}

// Figures 14 and 15: x+ = -0.5 x + w, y = x + v, Q = 10, R = 2.
constexpr double kBoundA = -0.5, kBoundQ = 10.0, kBoundR = 2.0;
constexpr std::array<Index, 7> kLengths = {50, 100, 200, 500, 1000, 2000, 5000};

struct Estimator {
  const char* name;
  std::function<Vector2d(const Model& truth, const Dataset& data)> run;
};

Vector2d of(const Estimate& estimate) {
  return {estimate.parameters[0].value, estimate.parameters[1].value};
}

// The most probable point of 80 x 80 in equal ratios.
Vector2d on_grid(const Model& truth, const Dataset& data, double low, double high) {
  const VectorXd side = logarithmic(80, low, high);
  Index i = 0, j = 0;
  log_likelihoods(truth, data, side, side).maxCoeff(&i, &j);
  return {side[i], side[j]};
}

const std::vector<Estimator>& estimators() {
  const auto unknown = [] { return scalar_model(kBoundA, 1.0, 1.0); };
  static const std::vector<Estimator> all = {
      {"ALS, optimal gain, 15 lags",
       [](const Model& truth, const Dataset& data) {
         NoiseAlsOptions options;
         options.weighted = false;
         options.lags = 15;
         return of(tune_als(truth, {data}, options));
       }},
      {"ALS, weighted",
       [unknown](const Model&, const Dataset& data) { return of(tune_als(unknown(), {data})); }},
      {"Bayes, grid 0.1 to 10",
       [](const Model& truth, const Dataset& data) { return on_grid(truth, data, 0.1, 10.0); }},
      {"Bayes, grid 0.1 to 100",
       [](const Model& truth, const Dataset& data) { return on_grid(truth, data, 0.1, 100.0); }},
      {"maximum likelihood", [unknown](const Model&, const Dataset& data) {
         NoiseMlOptions options;
         options.starts = 1;
         return of(tune_ml(unknown(), {data}, options));
       }}};
  return all;
}

// Figures 14 and 15. Of each length a column; of each method two rows, Q and R.
struct EstimateMoments {
  MatrixXd mean, variance;
  Eigen::RowVectorXd at_edge;  // runs whose Q, on the grid to 10, is that
};

EstimateMoments moments_of_estimates(const Model& truth, const StudyOptions& options) {
  const auto methods = static_cast<Index>(estimators().size());
  const auto lengths = static_cast<Index>(kLengths.size());
  std::vector<MatrixXd> runs(static_cast<std::size_t>(options.runs));
  repeat(options, 0, [&](int run, Random& random) {
    const Dataset whole = recording(truth, kLengths.back(), random);
    MatrixXd& out = runs[run];
    out.resize(2 * methods, lengths);
    for (Index l = 0; l < lengths; ++l) {
      const Dataset data = first_samples(whole, kLengths[l]);
      for (Index m = 0; m < methods; ++m) {
        out.block(2 * m, l, 2, 1) = estimators()[m].run(truth, data);
      }
    }
  });
  const auto count = static_cast<double>(options.runs);
  EstimateMoments out{MatrixXd::Zero(2 * methods, lengths), MatrixXd::Zero(2 * methods, lengths),
                      Eigen::RowVectorXd::Zero(lengths)};
  for (const MatrixXd& run : runs) {
    out.mean += run / count;
    out.at_edge += (run.row(4).array() > 0.999 * kBoundQ).cast<double>().matrix();
  }
  for (const MatrixXd& run : runs) out.variance += (run - out.mean).cwiseAbs2() / (count - 1.0);
  return out;
}

// What a variance is compared with, at every length.
struct Bounds {
  VectorXd k;         // samples
  VectorXd bound;     // Cramer-Rao
  VectorXd complete;  // of who sees the noise itself
};

// @param unknown  0: Q, figure 14; 1: R, figure 15; so below
Bounds bounds_of(const Model& truth, int unknown) {
  const auto lengths = static_cast<Index>(kLengths.size());
  const double true_value = unknown == 0 ? kBoundQ : kBoundR;
  Bounds out{VectorXd(lengths), VectorXd(lengths), VectorXd(lengths)};
  for (Index l = 0; l < lengths; ++l) {
    const Index samples = kLengths[l];
    out.k[l] = static_cast<double>(samples);
    out.bound[l] = information_of(truth, samples).inverse()(unknown, unknown);
    out.complete[l] = 2.0 * true_value * true_value / out.k[l];
  }
  return out;
}

char name_of(int unknown) { return unknown == 0 ? 'Q' : 'R'; }

std::string text_of_bounds(int unknown, int runs, const EstimateMoments& moments,
                           const Bounds& bounds) {
  std::string out = fmt::format(
      "matisko-figure-{}: variance of estimates of {}, a = {:g}, Q = {:g}, R = {:g}, {} runs\n"
      "published: curves without numbers. {}\n\nvariance\n",
      14 + unknown, name_of(unknown), kBoundA, kBoundQ, kBoundR, runs,
      unknown == 0 ? "\"Bayesian algorithm gives better estimates in case of covariance Q than\n"
                     "ALS even with very small sets of data (around 50 samples)\"; it \"converges "
                     "faster to the CR bound\"."
                   : "\"The simulation, Figure 15, and the fast convergence indicate that the "
                     "CR bound might\nbe reachable\": that of complete data, 2 R^2 / k.");
  const auto row = [&out](const std::string& what, const Eigen::Ref<const VectorXd>& values,
                          const char* form) {
    out += fmt::format("  {:<27}", what);
    for (const double v : values) {
      out += fmt::format(" {:>8}", fmt::format(fmt::runtime(form), v));
    }
    out += "\n";
  };
  row("samples", bounds.k, "{:.0f}");
  row(fmt::format("complete data, 2 {}^2 / k", name_of(unknown)), bounds.complete, "{:.4g}");
  row("Cramer-Rao bound", bounds.bound, "{:.4g}");
  Index at = unknown;
  for (const Estimator& e : estimators()) {
    row(e.name, moments.variance.row(at).transpose(), "{:.4g}");
    at += 2;
  }
  out += "mean\n";
  at = unknown;
  for (const Estimator& e : estimators()) {
    row(e.name, moments.mean.row(at).transpose(), "{:.3f}");
    at += 2;
  }
  row("runs at the edge Q = 10", moments.at_edge.transpose(), "{:.0f}");
  return out +
         "\nThe true Q = 10 is the edge of the published grid, 0.1 to 10: what lies above counts "
         "as 10, which cuts the\n"
         "spread of Q (and, as R makes up for Q, of R) below the bound that an unbiased method "
         "has, and makes the mean\n"
         "of Q too low, that of R too high. The grid to 100 has no such help. ALS here keeps Q "
         "and R from being negative.\n";
}

Panel panel_of_bounds(int unknown, int runs, const EstimateMoments& moments, const Bounds& bounds) {
  Panel panel;
  panel.title = fmt::format("Variance of estimates of {}, {} runs", name_of(unknown), runs);
  panel.x = {"samples k", 40.0, 6000.0, true};
  panel.y = {fmt::format("variance of the estimate of {}", name_of(unknown)), 1.0, 1.0, true};
  Index at = unknown;
  for (const Estimator& e : estimators()) {
    panel.curves.push_back({e.name, bounds.k, moments.variance.row(at), Curve::Form::marked});
    at += 2;
  }
  panel.curves.push_back({"Cramér-Rao bound", bounds.k, bounds.bound, Curve::Form::solid});
  panel.curves.push_back({fmt::format("complete data, 2 {}²/k", name_of(unknown)), bounds.k,
                          bounds.complete, Curve::Form::dashed});
  double lowest = bounds.complete.minCoeff(), highest = bounds.bound.maxCoeff();
  for (const Curve& curve : panel.curves) {
    for (const double v : curve.y) {
      if (v > 0.0) lowest = std::min(lowest, v);
      highest = std::max(highest, v);
    }
  }
  panel.y.low = 0.7 * lowest;
  panel.y.high = highest * std::sqrt(highest / lowest);  // room for the legend
  return panel;
}

std::string csv_of_bounds(int unknown, const EstimateMoments& moments, const Bounds& bounds) {
  std::string out = "samples,bound,complete_data_bound";
  for (const Estimator& e : estimators()) {
    std::string column = e.name;
    std::replace(column.begin(), column.end(), ',', ' ');
    out += fmt::format(",mean: {},variance: {}", column, column);
  }
  out += "\n";
  for (Index l = 0; l < bounds.k.size(); ++l) {
    out += fmt::format("{:.0f},{:.6g},{:.6g}", bounds.k[l], bounds.bound[l], bounds.complete[l]);
    for (Index at = unknown; at < moments.mean.rows(); at += 2) {
      out += fmt::format(",{:.6g},{:.6g}", moments.mean(at, l), moments.variance(at, l));
    }
    out += "\n";
  }
  return out;
}

StudyReport figure_of_bounds(int unknown, const StudyOptions& options) {
  const Model truth = scalar_model(kBoundA, kBoundQ, kBoundR);
  const EstimateMoments moments = moments_of_estimates(truth, options);
  const Bounds bounds = bounds_of(truth, unknown);
  StudyReport out;
  out.text = text_of_bounds(unknown, options.runs, moments, bounds);
  out.csv = csv_of_bounds(unknown, moments, bounds);
  out.figure = Figure{{panel_of_bounds(unknown, options.runs, moments, bounds)}};
  return out;
}

// Section 3.4, example 2: the gain of an adaptive filter that starts far off.
StudyReport figure_3(const StudyOptions& options) {
  constexpr Index kSamples = 2000;
  const MatrixXd A =
      (MatrixXd(4, 4) << 0.85, 1, 0, 0, 0, -0.6, 1, 0, -0.2, 0, 0.8, -1, 0, 0, 0, 0.9).finished();
  const PublishedSystem system{A, MatrixXd::Identity(4, 4), Eigen::RowVector4d(1, 0.8, -1, 0)};
  const VectorXd true_values = (VectorXd(5) << 10, 3, 4, 2, 1).finished();
  const Model start = model_of(system, 0.01, 100.0);
  const Model truth = with_variances(start, true_values);
  const auto gain = [&](const VectorXd& variances) {
    const Model at = with_variances(start, variances);
    return MatrixXd(steady_state(instantiate(as_linear(at), at.parameters))->K);
  };
  const MatrixXd optimal = gain(true_values);
  MatrixXd distance(options.runs, kSamples);
  std::vector<Index> changes(static_cast<std::size_t>(options.runs));
  repeat(options, 0, [&](int run, Random& random) {
    NoiseTrackOptions adaptive;
    adaptive.adaptive = true;
    const NoiseTrack track = track_noise(start, recording(truth, kSamples, random), adaptive);
    for (Index t = 0; t < kSamples; ++t) {
      distance(run, t) = (gain(track.mean.col(t)) - optimal).norm();
    }
    changes[run] = static_cast<Index>(track.changes.size());
  });
  const VectorXd mean = distance.colwise().mean();
  StudyReport out;
  out.text = fmt::format(
      "matisko-figure-3: an adaptive filter that starts with Q = 0.01 I, R = 100; the truth is\n"
      "Q = diag(10, 3, 4, 2), R = 1. Distance |K - K_opt| (Frobenius) of the gain in use\n"
      "published: a curve without numbers that \"is decreasing\"\n"
      "ours: {} runs; re-estimated {:.2f} times a run (once is the start itself)\n"
      "{:>10} {:>12} {:>12}\n",
      options.runs,
      static_cast<double>(std::accumulate(changes.begin(), changes.end(), Index{0})) / options.runs,
      "sample", "first run", "mean");
  out.csv = "sample,first_run,mean\n";
  for (const Index t : {1, 10, 20, 50, 100, 200, 500, 1000, 2000}) {
    out.text += fmt::format("{:>10} {:>12.3f} {:>12.3f}\n", t, distance(0, t - 1), mean[t - 1]);
  }
  for (Index t = 0; t < kSamples; ++t) {
    out.csv += fmt::format("{},{:.6g},{:.6g}\n", t + 1, distance(0, t), mean[t]);
  }
  const VectorXd sample = VectorXd::LinSpaced(kSamples, 1.0, static_cast<double>(kSamples));
  Panel panel;
  panel.title = "Adaptation of the gain from a poor start";
  panel.x = {"sample", 1.0, static_cast<double>(kSamples), true};
  panel.y = {"distance from the optimal gain", 0.0, 1.05 * distance.maxCoeff(), false};
  panel.curves.push_back({"one run", sample, distance.row(0).transpose(), Curve::Form::solid});
  panel.curves.push_back(
      {fmt::format("mean of {}", options.runs), sample, mean, Curve::Form::dashed});
  out.figure = Figure{{panel}};
  return out;
}

}  // namespace

std::vector<Study> figure_studies() {
  constexpr int kPublishedRuns = 300, kAdaptations = 20;
  return {
      {"matisko-figure-3", kAdaptations, figure_3},
      {"matisko-figure-4", 0, figure_4},
      {"matisko-figure-5", 0, figure_5},
      {"matisko-figure-6", 0, figure_6},
      {"matisko-figure-14", kPublishedRuns,
       [](const StudyOptions& options) { return figure_of_bounds(0, options); }},
      {"matisko-figure-15", kPublishedRuns,
       [](const StudyOptions& options) { return figure_of_bounds(1, options); }},
  };
}

}  // namespace identikal
