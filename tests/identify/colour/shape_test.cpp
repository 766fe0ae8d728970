// Coloured noise: the augmented model is what its equations say, the file it is written to gives it
// back, white noise is left alone, and a known filter is found.
#include "identify/colour/shape.h"

#include <cmath>
#include <complex>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <Eigen/LU>
#include <gtest/gtest.h>
#include <unistd.h>

#include "identify/colour/internal/spectrum.h"
#include "identify/model/builder.h"
#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "lib/base/error.h"
#include "lib/base/random.h"
#include "lib/filter/kalman.h"
#include "lib/model/shaping_filter.h"
#include "studies/published_systems.h"
#include "tests/support/matisko_systems.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Transfer from [w; v] to y, and the spectrum.
MatrixXcd output_spectrum(const StateSpace& m, double omega) {
  const Index n = m.states(), nw = m.G.cols(), ny = m.outputs();
  const std::complex<double> z = std::polar(1.0, omega);
  MatrixXcd T(ny, nw + ny);
  T << m.C.cast<std::complex<double>>() *
           (z * MatrixXcd::Identity(n, n) - m.A.cast<std::complex<double>>()).inverse() *
           m.G.cast<std::complex<double>>(),
      MatrixXcd::Identity(ny, ny);
  MatrixXd joint(nw + ny, nw + ny);
  joint << m.Q, m.S, m.S.transpose(), m.R;
  return T * joint.cast<std::complex<double>>() * T.adjoint();
}

TEST(ShapedModel, HasTheSpectrumOfItsFilters) {
  const MatiskoSystem system = matisko_system(7);
  Model base = system.model;
  base.parameters = with_entries(base.parameters, system.truth);
  const ShapingFilter first{Eigen::Vector3d(-0.6, 0.84, 0.1), Eigen::Vector2d(0.5, -0.2)};
  const ShapingFilter second{VectorXd::Constant(1, -0.9), VectorXd(0)};
  const StateSpace plain = instantiate(as_linear(base), base.parameters);
  for (const NoiseSource place : {NoiseSource::process, NoiseSource::measurement}) {
    const Model shaped = with_shaping_filters(base, place, {{1, first, 2.5}, {0, second, 0.7}});
    const StateSpace m = instantiate(as_linear(shaped), shaped.parameters);
    ASSERT_EQ(m.states(), 8);
    for (const double omega : {0.1, 0.9, 2.0, 3.0}) {
      const std::complex<double> h1 = response(first, omega), h2 = response(second, omega);
      MatrixXcd expected;
      if (place == NoiseSource::process) {
        // cov of the noise that enters: H Q H*, Q is diagonal.
        StateSpace coloured = plain;
        coloured.Q.diagonal()[1] *= std::norm(h1);
        coloured.Q.diagonal()[0] *= std::norm(h2);
        expected = output_spectrum(coloured, omega);
      } else {
        expected = output_spectrum(plain, omega);
        expected(1, 1) += 2.5 * std::norm(h1);
        expected(0, 0) += 0.7 * std::norm(h2);
      }
      EXPECT_LT((output_spectrum(m, omega) - expected).norm(), 1e-9 * expected.norm());
    }
  }
}

TEST(ShapedModel, TheFileGivesItBack) {
  const MatiskoSystem system = matisko_system(7);
  Model base = system.model;
  base.parameters = with_entries(base.parameters, system.truth);
  base.time.step = 1.0;
  for (const char* name : {"y1", "y2"}) {
    ChannelSource source;
    source.name = source.column = name;
    base.outputs.push_back(source);
  }
  const ShapingFilter filter{Eigen::Vector2d(-0.6, 0.84), VectorXd::Constant(1, 0.125)};
  for (const NoiseSource place : {NoiseSource::process, NoiseSource::measurement}) {
    const Model shaped = with_shaping_filters(base, place, {{1, filter, 2.5}});
    const std::filesystem::path path =
        std::filesystem::temp_directory_path() /
        ("identikal_shaped_model_" + std::to_string(getpid()) + ".yaml");
    std::ofstream(path) << model_text(shaped, {"a comment"});
    const Model back = read_model_file(path.string());
    std::filesystem::remove(path);
    const StateSpace a = instantiate(as_linear(shaped), shaped.parameters);
    const StateSpace b = instantiate(as_linear(back), back.parameters);
    EXPECT_LT((a.A - b.A).norm() + (a.C - b.C).norm() + (a.G - b.G).norm(), 1e-10);
    EXPECT_LT((a.Q - b.Q).norm() + (a.R - b.R).norm(), 1e-10);
    EXPECT_EQ(coordinates(shaped.parameters).size(), coordinates(back.parameters).size());
  }
}

TEST(ShapedModel, SaysWhatItCannotTake) {
  Model model = model_of(oscillating_system(), 1.0, 1.0);
  EXPECT_EQ(shaping_fault(model, NoiseSource::process), "");
  as_linear(model).continuous = true;
  EXPECT_NE(shaping_fault(model, NoiseSource::process), "");
  EXPECT_THROW(with_shaping_filters(model, NoiseSource::process, {}), std::invalid_argument);
}

// dx/dt of a trolley, pushed by a force and by noise.
LinearModelBuilder trolley(double friction = 0.5) {
  return linear_model()
      .A({{0, 1}, {0, -friction}})
      .B({{0}, {2}})
      .C({{1, 0}})
      .G({{0}, {1}})
      .measurement_noise(variance("r", 0.3))
      .continuous()
      .step(0.2)
      .diffuse();
}

void expect_same_samples(const Model& continuous) {
  const Model sampled = sampled_model(continuous);
  ASSERT_FALSE(as_linear(sampled).continuous);
  ASSERT_EQ(free_entries(sampled.parameters).size(), free_entries(continuous.parameters).size());
  const StateSpace a = instantiate(as_linear(continuous), continuous.parameters);
  const StateSpace b = instantiate(as_linear(sampled), sampled.parameters);
  EXPECT_LT((a.A - b.A).norm() + (a.B - b.B).norm() + (a.C - b.C).norm(), 1e-14);
  EXPECT_LT((a.G * a.Q * a.G.transpose() - b.G * b.Q * b.G.transpose()).norm(), 1e-14);
  EXPECT_LT((a.R - b.R).norm(), 1e-14);
  EXPECT_EQ(shaping_fault(sampled, NoiseSource::process), "");
  EXPECT_EQ(shaping_fault(sampled, NoiseSource::measurement), "");
}

TEST(ShapedModel, OfAContinuousModelTheSampledOneIsTaken) {
  expect_same_samples(trolley().process_noise(variance("q", 0.8)));
  expect_same_samples(
      trolley().G({{1, 0}, {0, 1}}).process_noise(variances({{"q1", 0.1}, {"q2", 2.0}})));
  Model as_block = trolley().process_noise(variance("q", 0.8));
  const int q = find_parameter(as_block.parameters, "q");
  as_block.parameters[q].domain = Domain::scaled_identity;
  as_linear(as_block).Q.entries.clear();
  as_linear(as_block).Q.block = q;
  expect_same_samples(as_block);
  Model free_pole = trolley().process_noise(variance("q", 0.8));
  free_pole.parameters.emplace_back();
  free_pole.parameters.back().name = "d";
  free_pole.parameters.back().value = MatrixXd::Constant(1, 1, -0.5);
  as_linear(free_pole).A.entries = {{1, 1, static_cast<int>(free_pole.parameters.size()) - 1, 1.0}};
  EXPECT_TRUE(as_linear(sampled_model(free_pole)).continuous);
}

constexpr double kPole =
    0.8;  // of the sensor's error, which lasts for a second; its variance is 0.5

// From the state x on.
Dataset with_lasting_error(const Model& model, VectorXd x, std::uint64_t seed) {
  StateSpace m = instantiate(as_linear(model), model.parameters);
  Random random(seed);
  const MatrixXd L = semidefinite_factor(m.Q);
  constexpr Index kSamples = 3000;
  MatrixXd y(1, kSamples), u(1, kSamples);
  double error = 0.0;
  for (Index t = 0; t < kSamples; ++t) {
    u(0, t) = random.normal();
    error = kPole * error + std::sqrt(0.5 * (1.0 - kPole * kPole)) * random.normal();
    y(0, t) = x[0] + error + std::sqrt(0.3) * random.normal();
    x = m.A * x + m.B * u.col(t) + L * random.normal(2);
  }
  return recording(model, y, 0.2, u);
}

TEST(Shape, AContinuousModelTakesAFilter) {
  const Model model = trolley().process_noise(variance("q", 0.8));
  ShapeOptions options;
  options.source = NoiseSource::measurement;
  const ShapeResult found =
      shape(model, {with_lasting_error(model, VectorXd::Zero(2), 3)}, options);
  ASSERT_EQ(found.estimate.status, Status::ok) << found.estimate.message;
  const std::map<std::string, double> truth = {{"q", 0.8}, {"r", 0.3}, {"v1_a1", -kPole}};
  for (const EstimatedParameter& p : found.estimate.parameters) {
    if (truth.contains(p.name)) {
      EXPECT_NEAR(p.value, truth.at(p.name), 3.0 * p.se) << p.name;
    }
  }
}

// The trolley's place is not known, its speed is in its steady state.
Model trolley_of_unknown_place() {
  Model out = sampled_model(trolley().process_noise(variance("q", 0.8)));
  as_linear(out).initial = InitialState::partly_diffuse;
  as_linear(out).stationary = {1};
  out.time.step = 0.2;
  return out;
}

TEST(ShapedModel, EveryStateStartsAsItDidAndFiltersInTheirSteadyState) {
  Model base = trolley_of_unknown_place();
  ChannelSource place, force;
  place.name = place.column = "place";
  force.name = force.column = "force";
  base.outputs = {place};
  base.inputs = {force};
  const ShapingFilter filter{Eigen::Vector2d(-0.6, 0.3), VectorXd::Constant(1, 0.125)};
  for (const NoiseSource source : {NoiseSource::process, NoiseSource::measurement}) {
    const Model shaped = with_shaping_filters(base, source, {{0, filter, 0.5}});
    const Model back = parse_model_file(model_text(shaped, {}), "shaped.yaml");
    EXPECT_EQ(as_linear(shaped).stationary, (std::vector<Index>{0, 1, 3}));
    EXPECT_EQ(as_linear(back).stationary, as_linear(shaped).stationary);
    const StateSpace a = instantiate(as_linear(shaped), shaped.parameters);
    const StateSpace b = instantiate(as_linear(back), back.parameters);
    EXPECT_TRUE(std::isinf(a.P0(2, 2)));
    const std::vector<Index> known = {0, 1, 3};
    EXPECT_LT((a.P0(known, known) - b.P0(known, known)).norm(), 1e-10);
    const MatrixXd moved =
        a.A * MatrixXd(a.P0.array().isInf().select(0.0, a.P0)) * a.A.transpose() +
        a.G * a.Q * a.G.transpose();
    EXPECT_LT((moved(known, known) - a.P0(known, known)).norm(), 1e-10);
  }
}

TEST(Shape, AStartThatIsPartlyDiffuseTakesAFilter) {
  const Model model = trolley_of_unknown_place();
  ShapeOptions options;
  options.source = NoiseSource::measurement;
  const ShapeResult found =
      shape(model, {with_lasting_error(model, Eigen::Vector2d(100.0, 0.0), 4)}, options);
  ASSERT_TRUE(found.model.has_value()) << found.estimate.message;
  EXPECT_EQ(found.estimate.status, Status::ok) << found.estimate.message;
  for (const EstimatedParameter& p : found.estimate.parameters) {
    if (p.name == "v1_a1") {
      EXPECT_NEAR(p.value, -kPole, 3.0 * p.se);
    }
  }
}

TEST(ShapedModel, ItsNamesAreNobodyElses) {
  Model base = model_of(oscillating_system(), 1.0, 1.0);
  base.name = "it's \"5.17\"";
  base.time.step = 1.0;
  base.outputs[0].name = base.outputs[0].column = "y \"1\": 'a'";
  base.parameters[1].name = "w1_a1";
  const Model shaped =
      with_shaping_filters(base, NoiseSource::process, {{0, oscillating_noise_filter(), 1.0}});
  std::set<std::string> names;
  for (const Parameter& p : shaped.parameters) names.insert(p.name);
  EXPECT_EQ(names.size(), shaped.parameters.size());
  const std::filesystem::path path =
      std::filesystem::temp_directory_path() /
      ("identikal_shaped_names_" + std::to_string(getpid()) + ".yaml");
  std::ofstream(path) << model_text(shaped, {});
  const Model back = read_model_file(path.string());
  std::filesystem::remove(path);
  EXPECT_EQ(back.name, base.name);
  EXPECT_EQ(back.outputs[0].column, base.outputs[0].column);
}

// S_e of identify/colour/internal/spectrum.h, written out.
std::vector<MatrixXcd> innovation_spectrum_at(const InnovationSpectrum& seen,
                                              const ShapingStructure& structure,
                                              const VectorXd& x) {
  const Index nw = seen.Q.rows(), ny = seen.R.rows();
  std::vector<MatrixXcd> out;
  for (std::size_t k = 0; k < seen.T_G.size(); ++k) {
    MatrixXcd H = MatrixXcd::Identity(nw, nw), added = MatrixXcd::Zero(ny, ny);
    for (std::size_t c = 0; c < structure.channels.size(); ++c) {
      Index at = nw + ny + static_cast<Index>(c) * structure.unknowns();
      const double q = structure.own_variance() ? std::exp(x[at++]) : 1.0;
      const ShapingFilter filter{
          stable_polynomial(x.segment(at, structure.order)),
          stable_polynomial(x.segment(at + structure.order, structure.zeros()))};
      const std::complex<double> h = response(filter, seen.measured.omega[static_cast<Index>(k)]);
      const Index channel = structure.channels[c];
      (structure.own_variance() ? added(channel, channel) : H(channel, channel)) =
          structure.own_variance() ? q * std::norm(h) : h;
    }
    const VectorXd fq = (0.5 * x.head(nw)).array().exp(),
                   fr = (0.5 * x.segment(nw, ny)).array().exp();
    MatrixXd Q = fq.asDiagonal() * seen.Q * fq.asDiagonal();
    MatrixXd R = fr.asDiagonal() * seen.R * fr.asDiagonal();
    MatrixXd S = fq.asDiagonal() * seen.S * fr.asDiagonal();
    const MatrixXcd W = seen.T_G[k] * H, &V = seen.T_V[k];
    out.push_back(W * Q * W.adjoint() + V * (R.cast<std::complex<double>>() + added) * V.adjoint() +
                  W * S * V.adjoint() + V * S.transpose() * W.adjoint());
  }
  return out;
}

TEST(ShapingSpectrum, GradientAndInformationAreExact) {
  const MatiskoSystem system = matisko_system(7);
  Model white = system.model;
  white.parameters = with_entries(white.parameters, system.truth);
  white.source = "white.yaml";
  Random random(11);
  const Dataset data = recording(white, 600, random);
  InnovationSpectrum spectrum = innovation_spectrum(white, data);
  for (const NoiseSource place : {NoiseSource::process, NoiseSource::measurement}) {
    const LikelihoodProblem problem = spectral_problem(spectrum, {place, {1, 0}, 3, true});
    VectorXd x(problem.lower.size());
    for (Index i = 0; i < x.size(); ++i) x[i] = 0.4 * std::sin(1.7 * static_cast<double>(i) + 0.3);
    double L = 0.0;
    VectorXd gradient;
    MatrixXd information;
    ASSERT_TRUE(problem.evaluate(x, L, &gradient, &information));
    constexpr double kStep = 1e-5;
    for (Index i = 0; i < x.size(); ++i) {
      double up = 0.0, down = 0.0;
      VectorXd moved = x;
      moved[i] += kStep;
      ASSERT_TRUE(problem.evaluate(moved, up, nullptr, nullptr));
      moved[i] -= 2.0 * kStep;
      ASSERT_TRUE(problem.evaluate(moved, down, nullptr, nullptr));
      EXPECT_NEAR(gradient[i], (up - down) / (2.0 * kStep), 1e-6 * gradient.norm()) << i;
    }
    // Where the spectrum is the model's own, the likelihood's curvature is the information.
    InnovationSpectrum own = spectrum;
    own.measured.S = innovation_spectrum_at(spectrum, {place, {1, 0}, 3, true}, x);
    const LikelihoodProblem there = spectral_problem(own, {place, {1, 0}, 3, true});
    ASSERT_TRUE(there.evaluate(x, L, &gradient, &information));
    EXPECT_LT(gradient.norm(), 1e-8 * information.diagonal().sum());
    for (Index i = 0; i < x.size(); ++i) {
      VectorXd moved = x, up, down;
      MatrixXd unused;
      moved[i] += kStep;
      ASSERT_TRUE(there.evaluate(moved, L, &up, &unused));
      moved[i] -= 2.0 * kStep;
      ASSERT_TRUE(there.evaluate(moved, L, &down, &unused));
      EXPECT_LT((information.col(i) + (up - down) / (2.0 * kStep)).norm(),
                1e-5 * information.col(i).norm())
          << i;
    }
  }
}

TEST(Shape, WhiteNoiseIsLeftAlone) {
  Model truth = model_of(oscillating_system(), 1.0, 1.0);
  Random random(3);
  const Dataset data = recording(truth, 3000, random);
  const ShapeResult result = shape(truth, {data});
  EXPECT_EQ(result.estimate.status, Status::rejected);
  EXPECT_FALSE(result.model.has_value());
  EXPECT_GT(result.estimate.shaping.whiteness_p, 0.05);
}

// At whatever stage: no filter then, and the white model is what there is.
TEST(Shape, StopsWhenTold) {
  const Model base = model_of(oscillating_system(), 1.0, 1.0);
  const Model truth =
      with_shaping_filters(base, NoiseSource::process, {{0, oscillating_noise_filter(), 1.0}});
  Random random(4);
  const Dataset data = recording(truth, 1000, random);
  for (const char* const stage :
       {"tuning the white model", "spectrum: process noise, order 2", "likelihood: order",
        "errors of the shaped model", "held-out comparison"}) {
    ShapeOptions options;
    options.most_order = 2;
    int after = -1;
    options.progress = [&](const std::string& what) {
      if (after >= 0) ++after;
      if (what.find(stage) == std::string::npos) return true;
      after = std::max(after, 0);
      return false;
    };
    const ShapeResult result = shape(base, {data}, options);
    EXPECT_EQ(after, 0) << stage;  // asked once, and never again
    EXPECT_EQ(result.estimate.status, Status::not_converged) << stage;
    EXPECT_NE(result.estimate.message.find("stopped by the caller"), std::string::npos);
    EXPECT_FALSE(result.model.has_value());
    EXPECT_FALSE(result.in_measurement.has_value());
  }
}

TEST(Shape, FindsThePublishedFilter) {
  // (5.17) with process noise through (5.21): a peak at 1.19 rad/s.
  const Model base = model_of(oscillating_system(), 1.0, 1.0);
  const Model truth =
      with_shaping_filters(base, NoiseSource::process, {{0, oscillating_noise_filter(), 1.0}});
  Random random(4);
  const Dataset data = recording(truth, 4000, random);
  const ShapeResult result = shape(base, {data});
  const Shaping& s = result.estimate.shaping;
  std::printf("%s noise, order %d, output's peak at %.4f rad/s; %s\n", s.noise_source.c_str(),
              s.order, s.output_peak, result.estimate.message.c_str());
  for (const Shaping::Candidate& c : s.candidates) {
    std::printf("  %-12s %-4s %d %d  %.2f  %.2f\n", c.noise_source.c_str(), c.channels.c_str(),
                c.order, c.zeros, c.log_likelihood, c.bic);
  }
  EXPECT_EQ(result.estimate.status, Status::ok) << result.estimate.message;
  ASSERT_TRUE(result.model.has_value());
  EXPECT_EQ(s.noise_source, "process");
  EXPECT_EQ(s.order, 2);
  EXPECT_NEAR(s.output_peak, 1.194, 0.04);
  // As good a likelihood as the truth's has, or better.
  const double L = log_likelihood(instantiate(as_linear(truth), truth.parameters),
                                  as_linear(truth).initial, data.y, data.u)
                       .value;
  EXPECT_GT(result.estimate.objective.log_likelihood, L);
  EXPECT_LT(s.predictions.at(0).rmse_with, s.predictions.at(0).rmse_without);
  // The other place has the same likelihood.
  ASSERT_TRUE(result.in_measurement.has_value());
  const auto likelihood = [&](const Model& model) {
    return log_likelihood(instantiate(as_linear(model), model.parameters), as_linear(model).initial,
                          data.y, data.u)
        .value;
  };
  EXPECT_NEAR(likelihood(*result.in_measurement), likelihood(*result.model), 1e-6);
  EXPECT_GT(s.held_out_log_likelihood_with, s.held_out_log_likelihood_without + 100.0);
}

TEST(Shape, PolesOnTheUnitCircleDoNoHarm) {
  // (5.26): an integrator and a slow pole; a damped sine of 46 s as process noise.
  Random random(5);
  const Dataset data =
      recording(system_with_damped_sine_noise(), InitialState::given, 3000, random);
  const ShapeResult result = shape(model_without_noise_filter(), {data});
  const Shaping& s = result.estimate.shaping;
  std::printf("%s noise, order %d; %s\n", s.noise_source.c_str(), s.order,
              result.estimate.message.c_str());
  for (const Shaping::Prediction& p : s.predictions) {
    std::printf("  %2d steps: %.3f white, %.3f shaped\n", p.steps, p.rmse_without, p.rmse_with);
  }
  ASSERT_TRUE(result.model.has_value());
  EXPECT_EQ(s.spectrum_shaped.cols(), s.spectrum_white.cols());
  EXPECT_EQ(s.spectrum_shaped.cols(), s.frequency.size());
  EXPECT_LT(s.predictions.at(0).rmse_with, 0.28);
  EXPECT_LT(s.predictions.at(4).rmse_with, 0.75);
}

TEST(Shape, TheOutputsUnitDoesNotMatter) {
  // With a diffuse start a likelihood has a unit: the choice must not hang on it.
  Random random(6);
  Dataset data = recording(system_with_damped_sine_noise(), InitialState::given, 1500, random);
  Model model = model_without_noise_filter();
  ShapeOptions options;
  options.most_order = 2;
  const ShapeResult metres = shape(model, {data}, options);
  data.y *= 1e3;
  for (Parameter& p : model.parameters) p.value *= 1e6;
  const ShapeResult millimetres = shape(model, {data}, options);
  ASSERT_TRUE(metres.model.has_value());
  ASSERT_TRUE(millimetres.model.has_value());
  const Shaping &a = metres.estimate.shaping, &b = millimetres.estimate.shaping;
  EXPECT_EQ(a.noise_source, b.noise_source);
  EXPECT_EQ(a.order, b.order);
  EXPECT_EQ(a.zeros, b.zeros);
  ASSERT_FALSE(a.poles.empty());
  EXPECT_NEAR(a.poles[0].frequency, b.poles[0].frequency, 1e-4);
  EXPECT_NEAR(a.candidates[0].bic - a.candidates[1].bic, b.candidates[0].bic - b.candidates[1].bic,
              0.1);
}

}  // namespace
}  // namespace identikal
