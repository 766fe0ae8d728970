// What is given at a sample: closed forms of one compartment, finite differences.

#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lib/nonlinear/filter.h"
#include "lib/nonlinear/simulation.h"
#include "tests/support/written_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Absorbed at the rate ka, eliminated at ke; a share F of what is given arrives.
NonlinearModel one_compartment() {
  Written written;
  written.states = {"depot", "central"};
  written.inputs = {"amount"};
  written.parameters = {"ka", "ke", "F"};
  written.dynamics = {"-ka*depot", "ka*depot - ke*central - 0.01*central*depot*(ka - 1.1)"};
  written.outputs = {"central"};
  ModelFormulas formulas = formulas_of(written);
  const std::vector<std::string> names{"depot", "central", "amount", "ka", "ke", "F", "t"};
  formulas.doses = {parse_expression("F*amount", names), parse_expression("0", names)};
  return make_nonlinear_model(formulas, Derivatives::second);
}

const VectorXd kDoseRates = (VectorXd(3) << 1.1, 0.2, 0.8).finished();

// 3 at 0, 2 at 4, 1 at 5 and at 9.5.
struct DosesGiven {
  VectorXd time = VectorXd::LinSpaced(25, 0.0, 12.0);
  MatrixXd amounts = MatrixXd::Zero(1, 25);
  DosesGiven() {
    amounts(0, 0) = 3.0;
    amounts(0, 8) = 2.0;
    amounts(0, 10) = amounts(0, 19) = 1.0;
  }
};

// Of the linear equations, ka = 1.1 above: the sum of what every dose leaves (Bateman 1910).
double superposed(const DosesGiven& given, Index sample) {
  const double ka = kDoseRates[0], ke = kDoseRates[1], F = kDoseRates[2];
  double out = 0.0;
  for (Index k = 0; k < sample; ++k) {  // a sample is measured before its own dose
    const double since = given.time[sample] - given.time[k];
    out +=
        F * given.amounts(0, k) * ka / (ka - ke) * (std::exp(-ke * since) - std::exp(-ka * since));
  }
  return out;
}

TEST(Doses, AreTheSumOfWhatEachOfThemLeaves) {
  const NonlinearModel model = one_compartment();
  const DosesGiven given;
  const FilterNoise none = zero_noise(model);
  const MatrixXd missing = MatrixXd::Constant(1, 25, std::nan(""));
  FilterNoise noise = none;
  noise.R(0, 0) = 1.0;
  for (const InputNodes& inputs :
       {input_nodes(given.time, given.amounts, InputPath::constant, 0.01),
        input_nodes(given.time, given.amounts, InputPath::pchip, 0.01),
        controlled_nodes(given.time, given.amounts, InputPath::linear, 1e-12)}) {
    const FilterResult simulated = nonlinear_filter(model, kDoseRates, noise, inputs, missing);
    ASSERT_EQ(simulated.status, FilterStatus::ok);
    for (Index t = 0; t < 25; ++t) {
      EXPECT_NEAR(simulated.x_pred(1, t), superposed(given, t), 1e-9) << "sample " << t;
    }
  }
}

struct DoseCase {
  NonlinearMethod method;
  bool noisy;
  ProcessNoise kind;
};

TEST(Doses, HaveDerivativesThatAreThoseOfDifferences) {
  const NonlinearModel model = one_compartment();
  const DosesGiven given;
  VectorXd p = kDoseRates;
  p[0] = 1.3;  // not linear
  MatrixXd y(1, 25);
  for (Index t = 0; t < 25; ++t) y(0, t) = superposed(given, t) + 0.1 * std::sin(7.0 * t);
  const InputNodes inputs = input_nodes(given.time, given.amounts, InputPath::constant, 0.25);
  ModelMemory memory = make_memory(model);
  for (const DoseCase& each : {DoseCase{NonlinearMethod::extended, false, ProcessNoise::per_sample},
                               DoseCase{NonlinearMethod::extended, true, ProcessNoise::per_sample},
                               DoseCase{NonlinearMethod::extended, true, ProcessNoise::density},
                               DoseCase{NonlinearMethod::iterated, true, ProcessNoise::density},
                               DoseCase{NonlinearMethod::unscented, true, ProcessNoise::per_sample},
                               DoseCase{NonlinearMethod::unscented, true, ProcessNoise::density}}) {
    FilterNoise noise = zero_noise(model);
    noise.R(0, 0) = 0.04;
    if (each.noisy) {
      noise.Q.diagonal() << 0.05, 0.01;
      noise.P0.diagonal() << 0.02, 0.03;
    }
    std::vector<FilterDirection> directions;
    for (Index i = 0; i < 3; ++i) directions.push_back({i, zero_noise(model)});
    NonlinearFilterOptions options;
    options.method = each.method;
    options.noise = each.kind;
    const auto value_at = [&](const VectorXd& at) {
      return nonlinear_likelihood(model, memory, at, noise, {}, inputs, y, options).value;
    };
    const Likelihood exact =
        nonlinear_likelihood(model, memory, p, noise, directions, inputs, y, options);
    ASSERT_EQ(exact.status, FilterStatus::ok);
    for (Index i = 0; i < 3; ++i) {
      const double h = 1e-5;
      VectorXd up = p, down = p;
      up[i] += h;
      down[i] -= h;
      const double difference = (value_at(up) - value_at(down)) / (2.0 * h);
      EXPECT_NEAR(exact.gradient[i], difference, 2e-6 * (1.0 + std::abs(difference)))
          << "parameter " << i << ", method " << static_cast<int>(each.method);
    }
  }
}

}  // namespace
}  // namespace identikal
