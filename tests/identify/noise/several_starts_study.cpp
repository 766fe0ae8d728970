// Where a fit speaks of several maxima, are there several? AR(1) with noise, beside a grid.
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "identify/model/model_file.h"
#include "identify/noise/ml.h"
#include "lib/filter/kalman.h"
#include "tests/support/scalar_case.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

const char* const kModel = R"(identikal: 1
name: AR(1) with noise
time: {step: 1 s}
parameters:
  a: {value: 0.5, min: -0.999, max: 0.999}
  q: {value: 1, min: 0}
  r: {value: 1, min: 0}
A: [[a]]
C: [[1]]
Q: [[q]]
R: [[r]]
initial: stationary
outputs: [{name: y1, column: y1}]
)";

// Log-likelihood at the best common scale of q = 1 - share, r = share: from two scales, as both
// terms of it are known functions of the scale.
double concentrated(const Model& model, const MatrixXd& y, double a, double share) {
  const auto at = [&](double scale) {
    ParameterSet set = model.parameters;
    set[0].value(0, 0) = a;
    set[1].value(0, 0) = scale * (1.0 - share);
    set[2].value(0, 0) = scale * share;
    return log_likelihood(instantiate(as_linear(model), set), InitialState::stationary, y,
                          MatrixXd(0, y.cols()))
        .value;
  };
  const double n = static_cast<double>(y.cols()), at_one = at(1.0);
  const double squares = 2.0 * (n * std::log(2.0) - 2.0 * (at_one - at(2.0)));
  return at_one + 0.5 * squares - 0.5 * n * (1.0 + std::log(squares / n));
}

// Maxima of it on a grid, the border's included, that is finer near poles of +-1 and shares of zero.
int maxima_on_a_grid(const Model& model, const MatrixXd& y) {
  constexpr Index kPoles = 121, kShares = 71;
  const double widest = std::atanh(0.999);
  MatrixXd L(kPoles, kShares);
  for (Index i = 0; i < kPoles; ++i) {
    for (Index j = 0; j < kShares; ++j) {
      const double a = std::tanh(widest * (2.0 * static_cast<double>(i) / (kPoles - 1) - 1.0));
      const double of_process = std::pow(10.0, -7.0 * static_cast<double>(j) / (kShares - 1));
      L(i, j) = concentrated(model, y, a, 1.0 - of_process);
    }
  }
  int out = 0;
  for (Index i = 0; i < kPoles; ++i) {
    for (Index j = 0; j < kShares; ++j) {
      const Index i0 = std::max<Index>(i - 1, 0), j0 = std::max<Index>(j - 1, 0);
      const MatrixXd near =
          L.block(i0, j0, std::min(kPoles - i0, i - i0 + 2), std::min(kShares - j0, j - j0 + 2));
      out += near.maxCoeff() == L(i, j);
    }
  }
  return out;
}

TEST(SeveralStartsStudy, AnArProcessWithNoise) {
  constexpr int kRuns = 250, kSamples = 300;
  const Model model = parse_model_file(kModel, "ar.yaml");
  int warned = 0, wrongly = 0, noted = 0, unconverged = 0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const MatrixXd y = simulate_scalar(0.8, 1.0, 1.0, kSamples, seed);
    const NoiseEstimate e = tune_ml(model, {dataset_of(y)});
    unconverged += exit_code(e, false) == 3;
    for (const Finding& f : e.findings) {
      if (f.code != FindingCode::several_maxima) continue;
      noted += f.severity == Severity::note;
      if (f.severity == Severity::note) continue;
      ++warned;
      if (maxima_on_a_grid(model, y) > 1) continue;
      ++wrongly;
      std::printf("seed %d: %s\n", static_cast<int>(seed), f.text.c_str());
    }
  }
  std::printf("of %d fits: several maxima in %d, %d of them one on the grid; a note in %d\n", kRuns,
              warned, wrongly, noted);
  EXPECT_EQ(wrongly, 0);
  EXPECT_EQ(unconverged, 0);
}

}  // namespace
}  // namespace identikal
