// Coloured noise: the augmented model is what its equations say, the file it is written to gives it
// back, white noise is left alone, and a known filter is found.
#include "identify/shape.h"

#include <cmath>
#include <complex>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/error.h"
#include "lib/kalman.h"
#include "lib/shaping_filter.h"
#include "tests/support/coloured_systems.h"
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
  ModelFile base = system.model;
  base.parameters = with_entries(base.parameters, system.truth);
  const ShapingFilter first{Eigen::Vector3d(-0.6, 0.84, 0.1), Eigen::Vector2d(0.5, -0.2)};
  const ShapingFilter second{VectorXd::Constant(1, -0.9), VectorXd(0)};
  const StateSpace plain = instantiate(base.linear, base.parameters);
  for (const NoisePlace place : {NoisePlace::process, NoisePlace::measurement}) {
    const ModelFile shaped = with_shaping_filters(base, place, {{1, first, 2.5}, {0, second, 0.7}});
    const StateSpace m = instantiate(shaped.linear, shaped.parameters);
    ASSERT_EQ(m.states(), 8);
    for (const double omega : {0.1, 0.9, 2.0, 3.0}) {
      const std::complex<double> h1 = response(first, omega), h2 = response(second, omega);
      MatrixXcd expected;
      if (place == NoisePlace::process) {
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
  ModelFile base = system.model;
  base.parameters = with_entries(base.parameters, system.truth);
  base.time.step = 1.0;
  for (const char* name : {"y1", "y2"}) {
    ChannelSource source;
    source.name = source.column = name;
    base.outputs.push_back(source);
  }
  const ShapingFilter filter{Eigen::Vector2d(-0.6, 0.84), VectorXd::Constant(1, 0.125)};
  for (const NoisePlace place : {NoisePlace::process, NoisePlace::measurement}) {
    const ModelFile shaped = with_shaping_filters(base, place, {{1, filter, 2.5}});
    const std::filesystem::path path =
        std::filesystem::temp_directory_path() / "identikal_shaped_model_test.yaml";
    std::ofstream(path) << model_text(shaped, {"a comment"});
    const ModelFile back = read_model_file(path.string());
    std::filesystem::remove(path);
    const StateSpace a = instantiate(shaped.linear, shaped.parameters);
    const StateSpace b = instantiate(back.linear, back.parameters);
    EXPECT_LT((a.A - b.A).norm() + (a.C - b.C).norm() + (a.G - b.G).norm(), 1e-10);
    EXPECT_LT((a.Q - b.Q).norm() + (a.R - b.R).norm(), 1e-10);
    EXPECT_EQ(coordinates(shaped.parameters).size(), coordinates(back.parameters).size());
  }
}

TEST(ShapedModel, SaysWhatItCannotTake) {
  ModelFile model = system_5_17();
  EXPECT_EQ(shaping_fault(model, NoisePlace::process), "");
  model.linear.continuous = true;
  EXPECT_NE(shaping_fault(model, NoisePlace::process), "");
  EXPECT_THROW(with_shaping_filters(model, NoisePlace::process, {}), std::invalid_argument);
}

TEST(Shape, WhiteNoiseIsLeftAlone) {
  ModelFile truth = system_5_17();
  Random random(3);
  const Dataset data =
      realised(instantiate(truth.linear, truth.parameters), truth.linear.initial, 3000, random);
  const ShapeResult result = shape(truth, {data});
  EXPECT_EQ(result.estimate.status, Status::answer_no);
  EXPECT_FALSE(result.model.has_value());
  ASSERT_TRUE(result.estimate.shaping.has_value());
  EXPECT_GT(result.estimate.shaping->colour_p, 0.05);
}

TEST(Shape, FindsThePublishedFilter) {
  // (5.17) with process noise through (5.21): a peak at 1.19 rad/s.
  const ModelFile base = system_5_17();
  const ModelFile truth =
      with_shaping_filters(base, NoisePlace::process, {{0, filter_5_21(), 1.0}});
  Random random(4);
  const Dataset data =
      realised(instantiate(truth.linear, truth.parameters), truth.linear.initial, 4000, random);
  const ShapeResult result = shape(base, {data});
  const Shaping& s = *result.estimate.shaping;
  std::printf("%s noise, order %d, output's peak at %.4f rad/s; %s\n", s.place.c_str(), s.order,
              s.output_peak, result.estimate.message.c_str());
  for (const Shaping::Candidate& c : s.candidates) {
    std::printf("  %-12s %-4s %d %d  %.2f  %.2f\n", c.place.c_str(), c.channels.c_str(), c.order,
                c.zeros, c.log_likelihood, c.bic);
  }
  EXPECT_EQ(result.estimate.status, Status::ok) << result.estimate.message;
  ASSERT_TRUE(result.model.has_value());
  EXPECT_EQ(s.place, "process");
  EXPECT_EQ(s.order, 2);
  EXPECT_NEAR(s.output_peak, 1.194, 0.04);
  // As good a likelihood as the truth's has, or better.
  const double L = log_likelihood(instantiate(truth.linear, truth.parameters), truth.linear.initial,
                                  data.y, data.u)
                       .value;
  EXPECT_GT(result.estimate.objective.log_likelihood, L);
  EXPECT_LT(s.with(0, 0), s.without(0, 0));
  EXPECT_GT(s.held_out_with, s.held_out_without + 100.0);
}

TEST(Shape, PolesOnTheUnitCircleDoNoHarm) {
  // (5.26): an integrator and a slow pole; a damped sine of 46 s as process noise.
  Random random(5);
  const Dataset data = realised(truth_5_26(), InitialState::given, 3000, random);
  const ShapeResult result = shape(system_5_26(), {data});
  const Shaping& s = *result.estimate.shaping;
  std::printf("%s noise, order %d; %s\n", s.place.c_str(), s.order,
              result.estimate.message.c_str());
  for (Index h = 0; h < s.with.cols(); ++h) {
    std::printf("  %2d steps: %.3f white, %.3f shaped\n", s.horizons[static_cast<std::size_t>(h)],
                s.without(0, h), s.with(0, h));
  }
  ASSERT_TRUE(result.model.has_value());
  EXPECT_LT(s.with(0, 0), 0.28);
  EXPECT_LT(s.with(0, 4), 0.75);
}

}  // namespace
}  // namespace identikal
