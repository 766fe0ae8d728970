#include "identify/study.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <tuple>
#include <utility>

#include <Eigen/Core>
#include <fmt/format.h>

#include "identify/bound.h"
#include "identify/noise_als.h"
#include "identify/noise_ml.h"
#include "identify/recordings_likelihood.h"
#include "identify/study_optimality.h"
#include "lib/error.h"
#include "lib/nearest_name.h"
#include "lib/random.h"
#include "lib/realisation.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The systems of the source, section 4.5.1 and 4.7; Q and R diagonal.
struct System {
  MatrixXd A, G, C;
};

const MatrixXd& fourth_order() {
  static const MatrixXd A =
      (MatrixXd(4, 4) << 0.9, 0, 1, 1, 0, -0.8, 0, -1, 0, -0.1, 0.85, 1, -0.2, 0, 0, -0.9)
          .finished();
  return A;
}

System published_system(int number) {
  const MatrixXd two = (MatrixXd(2, 2) << 0.8, 1, 0, -0.9).finished();
  switch (number) {
    case 1:
      return {MatrixXd::Constant(1, 1, 0.5), MatrixXd::Ones(1, 1), MatrixXd::Ones(1, 1)};
    case 2:
      return {two, MatrixXd::Ones(2, 1), MatrixXd::Ones(1, 2)};
    case 3:
      return {(MatrixXd(3, 3) << 0.8, 1, 0, 0, -0.9, 1, 0, 0, 0.9).finished(), MatrixXd::Ones(3, 1),
              MatrixXd::Ones(1, 3)};
    case 4:
      return {fourth_order(), MatrixXd::Ones(4, 1), MatrixXd::Ones(1, 4)};
    case 5:
      return {fourth_order(), Eigen::Vector4d(0.1, 1, 10, 0.1), Eigen::RowVector4d(1, 0, 0, 1)};
    case 6:
      return {two, MatrixXd::Identity(2, 2), MatrixXd::Identity(2, 2)};
    default:
      return {fourth_order(), (MatrixXd(4, 3) << 0, 0, 0.1, 1, 0, 0, 0, 1, 0, 0, 0, 1).finished(),
              (MatrixXd(2, 4) << 1, 0, 0, 1, 0, 1, 1, 0).finished()};
  }
}

// What the source prints: per unknown the mean, and the standard deviation in % of the truth.
struct Published {
  const char* method;
  std::vector<double> mean, percent;
};
struct Experiment {
  std::vector<double> truth;  // diagonal of Q, then of R
  Index samples;
  std::vector<Published> rows;
};
struct PublishedTable {
  const char* name;
  int system;
  std::vector<Experiment> experiments;
};

// Method names that can be rerun; others are printed as published only.
constexpr const char* kMonteCarloMap = "MC, most probable";
constexpr const char* kMonteCarloMean = "MC, mean";

Experiment monte_carlo(double q, double r, Index samples, double mean_q, double sd_q, double mean_r,
                       double sd_r) {
  return {{q, r}, samples, {{kMonteCarloMap, {mean_q, mean_r}, {sd_q, sd_r}}}};
}

// Facts of Matisko (2013), tables 3 to 10.
const std::vector<PublishedTable>& tables() {
  static const std::vector<PublishedTable> all = {
      {"matisko-table-3",
       1,
       {monte_carlo(10, 1, 500, 10.14, 11.2, 0.91, 84.2),
        monte_carlo(10, 1, 1000, 10.50, 7.7, 0.77, 59.7),
        monte_carlo(1, 10, 500, 1.13, 76.2, 9.80, 12.9),
        monte_carlo(1, 10, 1000, 1.14, 51.3, 9.73, 7.5),
        monte_carlo(0.1, 10, 500, 0.30, 383, 9.70, 7.4),
        monte_carlo(0.1, 10, 1000, 0.19, 272, 10.02, 5.7),
        monte_carlo(10, 0.1, 500, 9.82, 7.8, 0.25, 588),
        monte_carlo(10, 0.1, 1000, 9.90, 5.9, 0.19, 288),
        monte_carlo(1, 1, 500, 0.99, 19.2, 1.00, 19.2),
        monte_carlo(1, 1, 1000, 1.00, 15.5, 1.01, 13.0)}},
      {"matisko-table-4",
       2,
       {monte_carlo(10, 1, 500, 9.80, 9.9, 1.36, 163.3),
        monte_carlo(10, 1, 1000, 9.97, 5.9, 1.21, 110.9),
        monte_carlo(1, 10, 500, 0.99, 16.0, 9.92, 8.9),
        monte_carlo(1, 10, 1000, 1.00, 12.0, 9.98, 6.4),
        monte_carlo(0.1, 10, 500, 0.10, 50.9, 10.06, 6.7),
        monte_carlo(0.1, 10, 1000, 0.11, 42.6, 9.94, 5.3),
        monte_carlo(10, 0.1, 500, 9.51, 6.6, 0.99, 1214.8),
        monte_carlo(10, 0.1, 1000, 9.73, 5.2, 0.71, 1042.9),
        monte_carlo(1, 1, 500, 0.98, 14.1, 0.99, 31.9),
        monte_carlo(1, 1, 1000, 1.01, 6.1, 0.99, 16.6)}},
      {"matisko-table-5",
       3,
       {monte_carlo(10, 1, 1000, 9.82, 5.1, 1.47, 163.7),
        monte_carlo(10, 1, 2000, 9.93, 3.0, 1.23, 120.0),
        monte_carlo(1, 10, 1000, 1.00, 9.6, 10.08, 8.5),
        monte_carlo(1, 10, 2000, 1.01, 6.4, 9.99, 6.2),
        monte_carlo(0.1, 10, 1000, 0.1, 18.5, 10.00, 5.6),
        monte_carlo(0.1, 10, 2000, 0.1, 14.0, 9.99, 3.2),
        monte_carlo(10, 0.1, 1000, 9.82, 4.2, 0.75, 1295.9),
        monte_carlo(10, 0.1, 2000, 9.83, 3.9, 0.59, 777.1),
        monte_carlo(1, 1, 1000, 1.00, 6.9, 0.96, 28.1),
        monte_carlo(1, 1, 2000, 0.99, 5.1, 1.01, 21.6)}},
      {"matisko-table-6",
       4,
       {monte_carlo(10, 1, 1000, 9.95, 4.6, 0.91, 70.8),
        monte_carlo(10, 1, 2000, 9.93, 3.5, 1.08, 55.5),
        monte_carlo(1, 10, 1000, 1.00, 5.6, 9.80, 6.9),
        monte_carlo(1, 10, 2000, 1.00, 3.8, 9.97, 4.4),
        monte_carlo(0.1, 10, 1000, 0.10, 7.9, 9.98, 5.5),
        monte_carlo(0.1, 10, 2000, 0.10, 6.2, 9.97, 2.8),
        monte_carlo(10, 0.1, 1000, 9.87, 4.6, 0.31, 471.8),
        monte_carlo(10, 0.1, 2000, 10.01, 3.9, 0.33, 399.0),
        monte_carlo(1, 1, 1000, 1.01, 6.0, 0.97, 13.3),
        monte_carlo(1, 1, 2000, 1.01, 4.2, 0.97, 9.3)}},
      {"matisko-table-7",
       1,
       {{{10, 1},
         1000,
         {{kMonteCarloMap, {10.25, 0.77}, {7.7, 59.7}},
          {kMonteCarloMean, {10.62, 0.99}, {6.1, 51.4}},
          {"recursive MC, most probable", {9.84, 1.10}, {10.0, 70.3}},
          {"recursive MC, mean", {10.05, 0.98}, {7.6, 51.5}},
          {"ALS 10 lags, R0 1", {9.88, 0.96}, {11.6, 84.0}},
          {"ALS 20 lags, R0 1", {10.05, 1.00}, {12.2, 81.9}},
          {"ALS 20 lags, R0 10", {10.15, 0.84}, {13.9, 117.4}}}}}},
      {"matisko-table-8",
       5,
       {{{10, 1},
         2000,
         {{kMonteCarloMap, {9.98, 1.29}, {5.2, 214.2}},
          {kMonteCarloMean, {9.93, 2.06}, {3.3, 330.5}},
          {"recursive MC, most probable", {9.92, 4.43}, {4.6, 328.3}},
          {"recursive MC, mean", {9.95, 2.60}, {3.8, 119.4}},
          {"ALS 20 lags, R0 1", {10.01, -0.50}, {6.8, 781.3}},
          {"ALS 20 lags, R0 10", {9.59, 1.93}, {5.6, 956.1}},
          {"ALS 30 lags, R0 10", {9.56, 1.98}, {4.7, 731.6}},
          {"ALS+SDP 20 lags, R0 1", {9.97, 4.15}, {3.7, 547.6}}}}}},
      {"matisko-table-9",
       6,
       {{{10, 5, 1.5, 3},
         3000,
         {{"recursive MC, most probable", {9.94, 5.00, 1.63, 3.02}, {10.8, 10.0, 41.9, 10.9}},
          {"recursive MC, mean", {9.96, 5.00, 1.61, 3.03}, {12.3, 12.4, 46.9, 11.8}},
          {"ALS 30 lags, R0 1", {15.69, 11.63, -3.55, -3.14}, {8.8, 6.6, 44.6, 16.2}},
          {"ALS+SDP 30 lags, R0 1", {9.88, 5.02, 3.61, 3.00}, {3.9, 5.9, 278.4, 7.5}}}}}},
      {"matisko-table-10",
       7,
       {{{10, 3, 7, 1.5, 3},
         3000,
         {{"recursive MC, most probable",
           {10.89, 3.08, 6.98, 1.36, 2.78},
           {9.0, 9.0, 6.3, 10.4, 14.9}},
          {"ALS 30 lags, R0 10",
           {85.14, 31.40, 1.23, -13.50, -23.19},
           {56.8, 66.0, 4.8, 70.0, 77.8}},
          {"ALS 30 lags, R0 1", {10.21, 24.05, 8.40, -5.26, -0.18}, {16.5, 44.1, 7.7, 29.7, 46.3}},
          {"ALS+SDP 30 lags, R0 1",
           {10.17, 3.07, 6.96, 1.46, 2.89},
           {8.7, 9.0, 5.3, 17.3, 31.5}}}}}}};
  return all;
}

ModelFile model_of(const System& system, double q0, double r0) {
  ModelFile out;
  out.path = "study";
  LinearModel& m = out.linear;
  const Index n = system.A.rows(), nw = system.G.cols(), ny = system.C.rows();
  m.A.constant = system.A;
  m.G.constant = system.G;
  m.C.constant = system.C;
  m.B.constant.resize(n, 0);
  m.D.constant.resize(ny, 0);
  m.S.constant = MatrixXd::Zero(nw, ny);
  for (const auto& [name, size, value] : {std::tuple{"Q", nw, q0}, std::tuple{"R", ny, r0}}) {
    Parameter p;
    p.name = name;
    p.domain = Domain::diagonal;
    p.value = value * MatrixXd::Identity(size, size);
    out.parameters.push_back(p);
  }
  m.Q.block = 0;
  m.R.block = 1;
  m.initial = InitialState::stationary;
  for (Index i = 0; i < ny; ++i) {
    ChannelSource source;
    source.name = fmt::format("y{}", i + 1);
    out.outputs.push_back(source);
  }
  return out;
}

// The published Monte Carlo (section 4.5): points from a logarithmic grid of 20 x 20 in (0.01, 15),
// 15 iterations of weighting, resampling and log-normal perturbation of variance 0.012 times the
// value (4.32). Most probable point and mean of the last iteration.
struct MonteCarlo {
  VectorXd map, mean;
};
MonteCarlo published_monte_carlo(const ModelFile& model, const Dataset& data, Random& random) {
  constexpr int kSide = 20, kIterations = 15;
  constexpr double kLow = 0.01, kHigh = 15.0, kPerturbation = 0.012;
  RecordingsLikelihood likelihood(model, {data});
  MatrixXd points(2, kSide * kSide);
  const auto value = [](int i) { return kLow * std::pow(kHigh / kLow, i / (kSide - 1.0)); };
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) points.col(i * kSide + j) << value(i), value(j);
  }
  MonteCarlo out;
  for (int iteration = 0;; ++iteration) {
    VectorXd L(points.cols());
    for (Index p = 0; p < points.cols(); ++p) {
      const Likelihood* at =
          likelihood.evaluate(with_entries(model.parameters, points.col(p)), false);
      L[p] = at == nullptr ? -HUGE_VAL : at->value;
    }
    Index best = 0;
    const double largest = L.maxCoeff(&best);
    const VectorXd weight = (L.array() - largest).exp() / (L.array() - largest).exp().sum();
    out.map = points.col(best);
    out.mean = points * weight;
    if (iteration + 1 == kIterations) return out;
    MatrixXd next(2, points.cols());
    for (Index p = 0; p < next.cols(); ++p) {
      double left = random.uniform();
      Index from = 0;
      while (from + 1 < weight.size() && left > weight[from]) left -= weight[from++];
      for (Index i = 0; i < 2; ++i) {
        const double x = points(i, from);
        next(i, p) = x * std::exp(std::sqrt(kPerturbation * x) * random.normal());
      }
    }
    points = next;
  }
}

VectorXd values_of(const Estimate& estimate) {
  VectorXd out(static_cast<Index>(estimate.parameters.size()));
  for (Index i = 0; i < out.size(); ++i) {
    out[i] = estimate.parameters[static_cast<std::size_t>(i)].value;
  }
  return out;
}

struct Line {
  std::string method;
  std::vector<VectorXd> estimates;
};

// One line of a table: mean and standard deviation in % per unknown.
std::string line_text(const std::string& method, const VectorXd& mean, const VectorXd& percent) {
  std::string out = fmt::format("  {:<30}", method);
  for (Index i = 0; i < percent.size(); ++i) {
    out += fmt::format("{:>9} {:>7.1f} %", mean.size() > 0 ? fmt::format("{:.3f}", mean[i]) : "",
                       percent[i]);
  }
  return out + "\n";
}

std::string line_text(const Line& line, const VectorXd& truth) {
  const auto runs = static_cast<double>(line.estimates.size());
  VectorXd mean = VectorXd::Zero(truth.size()), squares = mean;
  for (const VectorXd& e : line.estimates) mean += e / runs;
  for (const VectorXd& e : line.estimates) squares += (e - mean).cwiseAbs2() / (runs - 1.0);
  return line_text(line.method, mean, 100.0 * squares.cwiseSqrt().cwiseQuotient(truth));
}

struct AlsSetting {
  Index lags;
  double r0;
};
// "ALS 20 lags, R0 10": the settings of a published line; nothing for another method.
bool als_setting(const std::string& method, AlsSetting& out) {
  long lags = 0;
  int r0 = 0;
  const std::size_t at = method.find(' ');
  if (!method.starts_with("ALS") || at == std::string::npos) return false;
  if (std::sscanf(method.c_str() + at, " %ld lags, R0 %d", &lags, &r0) != 2) return false;
  out = {lags, static_cast<double>(r0)};
  return true;
}

Dataset recording(const ModelFile& model, Index samples, Random& random) {
  Dataset out;
  out.name = "simulated";
  out.dt = 1.0;
  out.time = VectorXd::LinSpaced(samples, 0.0, static_cast<double>(samples - 1));
  out.y = realisation(instantiate(model.linear, model.parameters), model.linear.initial, {},
                      samples, random);
  out.u.resize(0, samples);
  for (const ChannelSource& source : model.outputs) out.outputs.push_back({source.name, ""});
  return out;
}

std::string run_experiment(const System& system, const Experiment& experiment,
                           const StudyOptions& options, std::uint64_t seed) {
  const auto k = static_cast<Index>(experiment.truth.size());
  const VectorXd truth = Eigen::Map<const VectorXd>(experiment.truth.data(), k);
  ModelFile model = model_of(system, 1.0, 1.0);
  const ModelFile true_model = [&] {
    ModelFile out = model;
    out.parameters = with_entries(out.parameters, truth);
    return out;
  }();
  std::vector<Line> lines;
  const auto line = [&lines](const std::string& method) -> Line& {
    for (Line& l : lines) {
      if (l.method == method) return l;
    }
    return lines.emplace_back(Line{method, {}});
  };
  Random random(seed);
  for (int run = 0; run < options.runs; ++run) {
    const Dataset data = recording(true_model, experiment.samples, random);
    bool monte_carlo_done = false;
    for (const Published& row : experiment.rows) {
      AlsSetting als{};
      if (als_setting(row.method, als)) {
        const ModelFile prior = model_of(system, 1.0, als.r0);
        NoiseAlsOptions settings;
        settings.weighted = false;
        settings.lags = als.lags;
        line(std::string("ours: ") + row.method)
            .estimates.push_back(values_of(tune_als(prior, {data}, settings)));
      } else if (!monte_carlo_done && k == 2) {
        const MonteCarlo mc = published_monte_carlo(model, data, random);
        line(std::string("ours: ") + kMonteCarloMap).estimates.push_back(mc.map);
        line(std::string("ours: ") + kMonteCarloMean).estimates.push_back(mc.mean);
        monte_carlo_done = true;
      }
    }
    line("ours: als-weighted").estimates.push_back(values_of(tune_als(model, {data})));
    NoiseMlOptions one;
    one.starts = 1;
    line("ours: maximum likelihood").estimates.push_back(values_of(tune_ml(model, {data}, one)));
    if (options.progress) options.progress(run + 1, options.runs);
  }
  std::string out = "true values";
  for (const double v : experiment.truth) out += fmt::format(" {:g}", v);
  out += fmt::format(", {} samples, {} runs\n", experiment.samples, options.runs);
  for (const Published& row : experiment.rows) {
    out += line_text(std::string("published: ") + row.method,
                     Eigen::Map<const VectorXd>(row.mean.data(), k),
                     Eigen::Map<const VectorXd>(row.percent.data(), k));
  }
  for (const Line& l : lines) out += line_text(l, truth);
  BoundOptions bound;
  bound.samples = experiment.samples;
  VectorXd percent(k);
  const Estimate limit = bound_of(true_model, bound, nullptr);
  for (Index i = 0; i < k; ++i) {
    percent[i] = 100.0 * limit.parameters[static_cast<std::size_t>(i)].crb_se / truth[i];
  }
  return out + line_text("Cramer-Rao bound", VectorXd(), percent) + "\n";
}

}  // namespace

std::vector<std::string> study_names() {
  std::vector<std::string> out = optimality_study_names();
  for (const PublishedTable& table : tables()) out.emplace_back(table.name);
  return out;
}

std::string study(const std::string& name, const StudyOptions& options) {
  const std::vector<std::string> tests = optimality_study_names();
  if (std::find(tests.begin(), tests.end(), name) != tests.end()) {
    return study_optimality(name, options);
  }
  const auto table = std::find_if(tables().begin(), tables().end(),
                                  [&name](const PublishedTable& t) { return name == t.name; });
  if (table == tables().end()) {
    std::string known;
    for (const std::string& each : study_names()) known += (known.empty() ? "" : ", ") + each;
    throw InputError({}, fmt::format("unknown study '{}'", name), known,
                     did_you_mean(name, study_names()));
  }
  std::string out = fmt::format(
      "{}: System {} of Matisko (2013); of each variance the mean of the estimates and their\n"
      "standard deviation in % of the truth, Q first, then R\n\n",
      table->name, table->system);
  std::uint64_t seed = options.seed;
  for (const Experiment& experiment : table->experiments) {
    out += run_experiment(published_system(table->system), experiment, options, seed++);
  }
  return out;
}

}  // namespace identikal
