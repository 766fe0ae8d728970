// What is done with linear models has to work the same for models whose formulas are not: the
// witness is one model in two spellings, of which the second, max(x, -1e9) for x, is not recognised
// as linear and takes the general filter.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "identify/filter/model_filter.h"
#include "identify/filter/nonlinear_recordings.h"
#include "identify/filter/run.h"
#include "identify/filter/simulated_fit.h"
#include "identify/model/model_file.h"
#include "identify/noise/bayes.h"
#include "identify/noise/ml.h"
#include "identify/optimality/bound.h"
#include "identify/optimality/check.h"
#include "identify/optimality/compare_filters.h"
#include "identify/simulation/simulate.h"
#include "identify/validation/validate.h"
#include "lib/base/error.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

const std::string kTwoCoupled = R"(identikal: 1
name: two states
time: {kind: discrete, step: 1 s}
parameters:
  a: {value: 0.8, min: 0, max: 1}
  q: {value: 0.5, min: 0}
  r: {value: 1, min: 0}
states: [x1, x2]
inputs: {u: {column: u}}
dynamics: {x1: "a*x1 + 0.3*x2 + u", x2: "0.5*x2 - 0.1*x1"}
outputs: {y1: {column: y1, equals: x1 + 0.2*u}, y2: {column: y2, equals: x2 - x1}}
noise: {process: {variance: {x1: q, x2: 0.2}}, measurement: {variance: {y1: r, y2: 0.5}}}
initial: {mean: {x1: 1, x2: 0}, sd: {x1: 1, x2: 0.5}}
)";

enum class Form { linear, formulas };

Model two_states(Form form) {
  std::string text = kTwoCoupled;
  if (form == Form::formulas) {
    text.replace(text.find("0.1*x1\""), 6, "0.1*max(x1, -1e9)");
  }
  Model model = parse_model_file(text, "two_states.yaml");
  if (is_linear(model) != (form == Form::linear))
    throw std::logic_error("two_states: another form");
  return model;
}

// One recording of the truth, with the inputs seen and a tenth of the outputs missing.
Dataset two_states_recording(Index N, std::uint64_t seed) {
  const Model model = two_states(Form::formulas);
  Random random(seed);
  Dataset out;
  out.name = "two_states.csv";
  out.dt = 1.0;
  out.time = VectorXd::LinSpaced(N, 0.0, static_cast<double>(N - 1));
  out.u.resize(1, N);
  for (double& u : out.u.reshaped()) u = random.normal();
  out.inputs = {{"u", ""}};
  out.y = simulated_outputs(model, out, random);
  for (double& y : out.y.reshaped()) {
    if (random.uniform() < 0.1) y = kNone;
  }
  out.outputs = {{"y1", ""}, {"y2", ""}};
  return out;
}

void expect_same(const std::vector<ChannelFit>& a, const std::vector<ChannelFit>& b, double bound) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_NEAR(a[i].fit_percent, b[i].fit_percent, bound) << a[i].channel;
    EXPECT_NEAR(a[i].rmse, b[i].rmse, bound) << a[i].channel;
  }
}

void expect_same_tests(const std::vector<TestResult>& a, const std::vector<TestResult>& b,
                       double bound) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].id, b[i].id);
    EXPECT_EQ(a[i].channel, b[i].channel);
    EXPECT_EQ(a[i].pass, b[i].pass);
    EXPECT_NEAR(a[i].value, b[i].value, bound * (1.0 + std::abs(b[i].value))) << a[i].id;
  }
}

// Numbers of a CSV text, cell by cell; empty cells are NaN.
std::vector<double> csv_numbers(const std::string& text) {
  std::vector<double> out;
  std::istringstream lines(text);
  std::string line, cell;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    std::istringstream row(line);
    while (std::getline(row, cell, ',')) out.push_back(cell.empty() ? kNone : std::stod(cell));
  }
  return out;
}

TEST(NonlinearJobs, FilterAndSmootherWriteTheLinearOnesFiles) {
  const Model linear = two_states(Form::linear), extended = two_states(Form::formulas);
  const std::vector<Dataset> recordings{two_states_recording(80, 1), two_states_recording(40, 2)};
  for (const NonlinearMethod method :
       {NonlinearMethod::extended, NonlinearMethod::iterated, NonlinearMethod::unscented}) {
    for (const std::optional<Index> lag :
         {std::optional<Index>(0), std::optional<Index>(3), std::optional<Index>()}) {
      Model general = extended;
      as_formulas(general).filter = method;
      const StateEstimate a = filter_recordings(linear, recordings, {lag}),
                          b = filter_recordings(general, recordings, {lag});
      const auto states = [&](const Model& model, const StateEstimate& run) {
        std::ostringstream out;
        write_states_csv(out, model, recordings, run);
        return csv_numbers(out.str());
      };
      const auto innovations = [&](const StateEstimate& run) {
        std::ostringstream out;
        write_innovations_csv(out, recordings, run);
        return csv_numbers(out.str());
      };
      for (const auto& [x, y] : {std::pair{states(linear, a), states(general, b)},
                                 std::pair{innovations(a), innovations(b)}}) {
        ASSERT_EQ(x.size(), y.size());
        double worst = 0.0;
        for (std::size_t i = 0; i < x.size(); ++i) {
          ASSERT_EQ(std::isnan(x[i]), std::isnan(y[i])) << i;
          if (!std::isnan(x[i]))
            worst = std::max(worst, std::abs(x[i] - y[i]) / (1 + std::abs(x[i])));
        }
        EXPECT_LT(worst, 1e-8);
      }
      EXPECT_EQ(a.notes, b.notes);
    }
  }
}

TEST(NonlinearJobs, CheckGivesTheLinearOnesTests) {
  const std::vector<Dataset> recordings{two_states_recording(400, 3)};
  for (const double r : {1.0, 3.0}) {
    Model linear = two_states(Form::linear), general = two_states(Form::formulas);
    set_parameter(linear, "r=" + std::to_string(r));
    set_parameter(general, "r=" + std::to_string(r));
    const OptimalityReport a = check(linear, recordings), b = check(general, recordings);
    EXPECT_EQ(a.status, r == 1.0 ? Status::ok : Status::rejected);
    EXPECT_EQ(a.status, b.status);
    EXPECT_EQ(a.message, b.message);
    expect_same_tests(a.tests, b.tests, 1e-7);
    expect_same(a.one_step, b.one_step, 1e-8);
    // The loss: by steady filters, and by what both filters make of these samples.
    ASSERT_EQ(a.derived.size(), 1U);
    ASSERT_EQ(b.derived.size(), 1U);
    EXPECT_EQ(a.derived[0].name, b.derived[0].name);
    EXPECT_NEAR(a.derived[0].value, b.derived[0].value, 1.0 + 0.3 * a.derived[0].value);
  }
}

TEST(NonlinearJobs, CompareRanksThemAlike) {
  const std::vector<Dataset> recordings{two_states_recording(300, 4)};
  const auto ranked = [&](Form form) {
    Model better = two_states(form), worse = better;
    better.source = "better.yaml";
    worse.source = "worse.yaml";
    set_parameter(worse, "q=3");
    return compare_filters({worse, better}, {recordings, recordings});
  };
  const Comparison a = ranked(Form::linear), b = ranked(Form::formulas);
  EXPECT_EQ(a.message, b.message);
  EXPECT_EQ(a.message.find("better.yaml"), 0U);
  expect_same_tests(a.tests, b.tests, 1e-7);
}

TEST(NonlinearJobs, TuneHoldsOutAndValidates) {
  const Dataset whole = two_states_recording(500, 5), other = two_states_recording(200, 6);
  const Index cut = 350;
  NoiseEstimate estimates[2];
  for (const Form form : {Form::linear, Form::formulas}) {
    const Model model = two_states(form);
    NoiseMlOptions options;
    options.starts = 1;
    options.profiles = false;
    NoiseEstimate& e = estimates[form == Form::linear ? 0 : 1];
    e = tune_ml(model, {first_samples(whole, cut)}, options);
    ASSERT_EQ(e.status, Status::ok);
    report_hold_out(e, model, {{whole, cut}, {other, 0}});
  }
  expect_same(estimates[0].hold_out, estimates[1].hold_out, 1e-4);
  expect_same(estimates[0].hold_out_one_step, estimates[1].hold_out_one_step, 1e-4);
  ASSERT_EQ(estimates[1].hold_out.size(), 2U);
  EXPECT_TRUE(estimates[0].simulation.empty());
  ASSERT_EQ(estimates[1].simulation.size(), 2U);
  EXPECT_NEAR(estimates[0].derived.back().value, estimates[1].derived.back().value, 1e-6);

  // The held-out rows of one recording, by hand: the filter runs through, the likelihood of what
  // follows is that of all less that of what came before.
  const Model model = two_states(Form::formulas);
  NoiseEstimate e = estimates[1];
  report_hold_out(e, model, {{whole, cut}});
  Model found = model;
  for (std::size_t i = 0; i < 3; ++i) {
    found.parameters[i].value(0, 0) = e.parameters[i].value;
  }
  const FilterResult all = run_filter(found, found.parameters, whole),
                     before = run_filter(found, found.parameters, first_samples(whole, cut));
  EXPECT_NEAR(e.derived.back().value, (all.log_likelihood - before.log_likelihood) / 150.0, 1e-9);
  double squares = 0.0, count = 0.0;
  for (Index t = cut; t < 500; ++t) {
    if (std::isnan(whole.y(0, t))) continue;
    squares += std::pow(all.e(0, t), 2);
    count += 1.0;
  }
  EXPECT_NEAR(e.hold_out_one_step[0].rmse, std::sqrt(squares / count), 1e-9);
  EXPECT_EQ(e.pictures.held_time.size(), 150);
  EXPECT_EQ(e.pictures.held_out_simulation.cols(), 150);

  Validation validated[2];
  for (int i = 0; i < 2; ++i) {
    Model there = two_states(i == 0 ? Form::linear : Form::formulas);
    for (std::size_t p = 0; p < 3; ++p) {
      there.parameters[p].value(0, 0) = estimates[0].parameters[p].value;
    }
    NoiseEstimate result = estimates[0];
    result.inputs = {{"two_states.csv", "", 350, 350}};
    validated[i] = validate(sections_of(result), there, {other}, {{"other.csv", "", 200, 200}});
  }
  EXPECT_EQ(validated[0].status, validated[1].status);
  expect_same_tests(validated[0].tests, validated[1].tests, 1e-7);
}

TEST(NonlinearJobs, AFreeRunNeedsNothingButTheFirstState) {
  // Without noise but for the start, which the smoother has to find.
  std::string text = kTwoCoupled;
  const auto put = [&text](const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
  };
  put("0.1*x1\"", "0.1*sin(x1)\"");
  put("variance: {x1: q, x2: 0.2}", "variance: {x1: 1e-30*q, x2: 0}");
  put("variance: {y1: r, y2: 0.5}", "variance: {y1: 1e-10*r, y2: 1e-10}");
  const Model model = parse_model_file(text, "sine.yaml");
  Dataset data = two_states_recording(60, 7);
  Random random(1);
  data.y = simulated_outputs(model, data, random);
  const MatrixXd y = simulated_outputs(model, model.parameters, data);
  EXPECT_LT((y - data.y).cwiseAbs().maxCoeff(), 1e-4);
  FilterEstimate estimate;
  report_simulation(estimate, model, model.parameters, {data});
  EXPECT_GT(estimate.simulation[0].fit_percent, 99.99);
}

TEST(NonlinearJobs, TheBoundIsTheLinearOnes) {
  const Dataset planned = two_states_recording(300, 8);
  BoundOptions options;
  options.samples = 300;
  options.runs = 100;
  const CramerRaoBound a = bound_of(two_states(Form::linear), options, &planned),
                       b = bound_of(two_states(Form::formulas), options, &planned);
  EXPECT_FALSE(a.bound.simulated);
  ASSERT_TRUE(b.bound.simulated);
  EXPECT_EQ(b.bound.simulated->recordings, 100);
  ASSERT_LT(b.bound.simulated->relative_se, 0.02);
  for (std::size_t i = 0; i < 3; ++i) {
    const double off = b.parameters[i].crb_se / a.parameters[i].crb_se - 1.0;
    std::printf("%s: %.4g, exact %.4g, %.2f %% off\n", a.parameters[i].name.c_str(),
                b.parameters[i].crb_se, a.parameters[i].crb_se, 100.0 * off);
    // False alarms: 3 in 1000 each.
    EXPECT_LT(std::abs(off), 3.0 * b.bound.simulated->relative_se);
  }
}

// Of a model that its inputs drive far from linear, with noise that is small against its curvature,
// so that the filter's likelihood is the model's; against the second moments of its scores: s' J^-1
// s of 200 recordings has mean k and variance close to 2 k. False alarms: 3 in 1000. (With noise a
// hundred times as large the extended filter's mean is 3.5.)
TEST(NonlinearJobs, ScoresScatterAsTheBoundSays) {
  std::string text = kTwoCoupled;
  const auto put = [&text](const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
  };
  put("a*x1 + 0.3*x2 + u", "2*sin(a*x1) + 0.3*x2 + u");
  put("q: {value: 0.5", "q: {value: 0.005");
  put("r: {value: 1", "r: {value: 0.01");
  put("x2: 0.2}", "x2: 0.002}");
  put("y2: 0.5}", "y2: 0.005}");
  put("sd: {x1: 1, x2: 0.5}", "sd: {x1: 0.1, x2: 0.05}");
  const Model model = parse_model_file(text, "sine.yaml");
  Dataset data = two_states_recording(200, 9);
  BoundOptions options;
  options.samples = 200;
  options.seed = 11;
  options.runs = 200;
  const CramerRaoBound bound = bound_of(model, options, &data);
  ASSERT_EQ(bound.status, Status::ok);
  MatrixXd J = MatrixXd::Zero(3, 3);
  std::vector<VectorXd> scores;
  Random random(12);
  constexpr int kRuns = 200;
  for (int run = 0; run < kRuns; ++run) {
    const std::vector<Dataset> drawn = [&] {
      std::vector<Dataset> out{data};
      out[0].y = simulated_outputs(model, data, random);
      return out;
    }();
    NonlinearRecordings likelihood(model, drawn);
    const Likelihood& at = likelihood.evaluate(model.parameters, true);
    ASSERT_EQ(at.status, FilterStatus::ok);
    scores.push_back(at.gradient);
    J += at.information / kRuns;
  }
  const VectorXd se = J.inverse().diagonal().cwiseSqrt();
  double sum = 0.0;
  for (const VectorXd& s : scores) sum += s.dot(J.inverse() * s) / kRuns;
  std::printf("s' J^-1 s: %.3f, expected 3 +- %.3f\n", sum, std::sqrt(6.0 / kRuns));
  EXPECT_NEAR(sum, 3.0, 3.0 * std::sqrt(6.0 / kRuns));
  for (Index i = 0; i < 3; ++i) {
    EXPECT_NEAR(bound.parameters[static_cast<std::size_t>(i)].crb_se / se[i], 1.0, 0.05);
  }
}

// The linear spelling is drawn from by sequential Monte Carlo, the other one, whose likelihood is
// dear, by importance sampling: one posterior. The second recording has hardly any measurement
// noise, so that the posterior of r is as wide as its prior goes below.
TEST(NonlinearBayes, ImportanceSamplingAgreesWithSequentialMonteCarlo) {
  for (const bool vanishing : {false, true}) {
    Dataset data = two_states_recording(100, 4);
    if (vanishing) {
      Model quiet = two_states(Form::formulas);
      quiet.parameters[2].value *= 1e-4;
      Random random(5);
      data.y = simulated_outputs(quiet, data, random);
    }
    NoiseBayesOptions options;
    options.draws = 2000;
    const PosteriorPoints drawn = posterior(two_states(Form::linear), {data}, options);
    const PosteriorPoints weighed = posterior(two_states(Form::formulas), {data}, options);
    ASSERT_EQ(drawn.method, "sequential Monte Carlo");
    ASSERT_EQ(weighed.method, "importance sampling");
    EXPECT_GT(weighed.effective, 1000.0);
    EXPECT_LT(weighed.summary.evaluations, 30'000);
    // 2000 draws from the prior on know the evidence to 0.15, the weights to 0.02.
    EXPECT_NEAR(weighed.log_evidence, drawn.log_evidence, 0.5);
    options.seed = 2;
    EXPECT_NEAR(weighed.log_evidence,
                posterior(two_states(Form::formulas), {data}, options).log_evidence, 0.08);
    for (Index i = 0; i < 3; ++i) {
      const VectorXd x = drawn.coordinates.row(i), z = weighed.coordinates.row(i);
      const double mean = x.dot(drawn.weight), own = z.dot(weighed.weight);
      const double sd = std::sqrt((x.array() - mean).square().matrix().dot(drawn.weight));
      const double other = std::sqrt((z.array() - own).square().matrix().dot(weighed.weight));
      std::printf("%s: %.4f +- %.4f by draws, %.4f +- %.4f by weights (%d of %d filter runs)\n",
                  two_states(Form::linear).parameters[static_cast<std::size_t>(i)].name.c_str(),
                  mean, sd, own, other, weighed.summary.evaluations, drawn.summary.evaluations);
      EXPECT_NEAR(own, mean, 0.1 * sd);
      EXPECT_NEAR(other, sd, 0.1 * sd);
    }
  }
}

TEST(NonlinearBayes, StopsWhenTold) {
  NoiseBayesOptions options;
  int calls = 0;
  options.progress = [&](double share) {
    EXPECT_GE(share, 0.0);
    EXPECT_LT(share, 1.0);
    return ++calls < 3;
  };
  const NoiseEstimate e =
      tune_bayes(two_states(Form::formulas), {two_states_recording(100, 4)}, options);
  EXPECT_EQ(e.status, Status::not_converged);
  EXPECT_EQ(calls, 3);
}

TEST(NonlinearBayes, SaysWhatToDoAtItsTimeLimit) {
  NoiseBayesOptions options;
  options.max_seconds = 0.0;
  options.draws = 500;
  options.grid = false;
  const NoiseEstimate e =
      tune_bayes(two_states(Form::linear), {two_states_recording(100, 4)}, options);
  EXPECT_EQ(e.status, Status::not_converged);
  EXPECT_NE(e.message.find("--method ml answers without draws"), std::string::npos) << e.message;
}

// What a simulation shows is the model only where inputs drive it and errors of its start fade.
TEST(SimulatedFit, IsNoneWhereItSaysNothing) {
  const auto noted = [](const std::vector<std::string>& notes, const std::string& text) {
    return std::any_of(notes.begin(), notes.end(), [&](const std::string& note) {
      return note.find(text) != std::string::npos;
    });
  };
  NoiseMlOptions once;
  once.starts = 1;
  const Dataset data = two_states_recording(200, 4);
  const NoiseEstimate driven = tune_ml(two_states(Form::formulas), {data}, once);
  EXPECT_EQ(driven.simulation.size(), 2u);
  EXPECT_FALSE(noted(driven.notes, "no simulation"));

  Dataset alone = data;
  alone.inputs.clear();
  alone.u.resize(0, data.size());
  std::string text = kTwoCoupled;
  const auto without = [&text](const std::string& part) {
    text.erase(text.find(part), part.size());
  };
  without("inputs: {u: {column: u}}\n");
  without(" + u");
  without(" + 0.2*u");
  text.replace(text.find("0.1*x1\""), 6, "0.1*max(x1, -1e9)");
  const Model still = parse_model_file(text, "still.yaml");
  const NoiseEstimate undriven = tune_ml(still, {alone}, once);
  EXPECT_TRUE(undriven.simulation.empty());
  EXPECT_TRUE(noted(undriven.notes, "no simulation: no input drives the model"));

  for (const Form form : {Form::linear, Form::formulas}) {
    Model integrating = two_states(form);
    ChannelFit off, on;
    off.fit_percent = -480.0;
    on.fit_percent = 30.0;
    EXPECT_EQ(why_no_simulation(integrating, integrating.parameters, data, {on, off}), "");
    std::string tracker = kTwoCoupled;
    tracker.replace(tracker.find("a*x1 + 0.3*x2 + u"), 17, "x1 + 0.3*x2 + u  ");
    tracker.replace(tracker.find("0.5*x2 - 0.1*x1"), 15,
                    form == Form::linear ? "0.5*x2" : "0.5*max(x2, -1e9)");
    const std::string unused = "  a: {value: 0.8, min: 0, max: 1}\n";
    tracker.erase(tracker.find(unused), unused.size());
    integrating = parse_model_file(tracker, "tracker.yaml");
    EXPECT_NE(why_no_simulation(integrating, integrating.parameters, data, {on, off})
                  .find("asymptotically stable"),
              std::string::npos);
    EXPECT_EQ(why_no_simulation(integrating, integrating.parameters, data, {on, on}), "");
  }
}

}  // namespace
}  // namespace identikal
