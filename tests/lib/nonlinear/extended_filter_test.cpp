// The extended and the iterated filter where their derivatives take several blocks of lanes, where
// steps are made once for many, and behind a gate.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "lib/nonlinear/filter.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

NonlinearModel model_of(const std::vector<std::string>& names, int states, int inputs,
                        const std::vector<std::string>& rates,
                        const std::vector<std::string>& outputs, bool continuous) {
  ModelFormulas formulas;
  formulas.states = states;
  formulas.inputs = inputs;
  formulas.parameters = static_cast<int>(names.size()) - states - inputs - 1;
  formulas.continuous = continuous;
  for (const std::string& text : rates) formulas.dynamics.push_back(parse_expression(text, names));
  for (const std::string& text : outputs) formulas.outputs.push_back(parse_expression(text, names));
  return make_nonlinear_model(formulas, Derivatives::second);
}

// A car on its way: position, course, speed and turn rate, a slow error of the compass and a gyro's
// bias; outputs at different rates, some of them missing.
struct Tracker {
  NonlinearModel model =
      model_of({"x", "y", "psi", "v", "w", "c", "b", "drag", "scale", "tau", "t"}, 7, 0,
               {"v*sin(psi)", "v*cos(psi)", "w", "-drag*v*abs(v)", "-w/tau", "-c/tau", "0"},
               {"x", "y", "scale*v", "b - w", "psi + c", "hypot(x, y + 30)"}, true);
  VectorXd p{{0.02, 1.1, 4.0}};
  FilterNoise noise = zero_noise(model);
  std::vector<FilterDirection> directions;
  InputNodes inputs;
  MatrixXd y;
  NonlinearFilterOptions options;

  explicit Tracker(Random& random, Index N = 60) {
    noise.Q.diagonal() << 0.0, 0.0, 0.0, 0.5, 0.2, 0.01, 1e-5;
    noise.Q(3, 4) = noise.Q(4, 3) = 0.1;
    noise.R.diagonal() << 1.0, 1.0, 0.1, 1e-3, 0.02, 0.5;
    noise.R(0, 1) = noise.R(1, 0) = 0.3;
    noise.P0.diagonal() << 4.0, 4.0, 0.1, 1.0, 0.1, 0.01, 0.01;
    noise.x0 << 0.0, 0.0, 0.5, 8.0, 0.1, 0.0, 0.0;
    options.noise = ProcessNoise::density;
    for (Index i = 0; i < 3; ++i) directions.push_back({i, zero_noise(model)});
    for (Index i = 3; i < 7; ++i) add([i](FilterNoise& n) { n.Q(i, i) = 1.0; });
    add([](FilterNoise& n) { n.Q(3, 4) = n.Q(4, 3) = 1.0; });
    for (Index i = 0; i < 6; ++i) add([i](FilterNoise& n) { n.R(i, i) = 1.0; });
    add([](FilterNoise& n) { n.R(0, 1) = n.R(1, 0) = 1.0; });
    add([](FilterNoise& n) { n.x0[2] = 1.0; });
    add([](FilterNoise& n) { n.P0(3, 3) = 1.0; });
    VectorXd time(N);
    double at = 0.0;
    for (Index t = 0; t < N; ++t) time[t] = at += 0.05 + 0.1 * random.uniform();
    inputs = input_nodes(time, MatrixXd(0, N), InputPath::constant, 0.08);
    y = MatrixXd::Constant(6, N, kNaN);
    for (Index t = 0; t < N; ++t) {
      const double way = 8.0 * time[t];
      const double seen[] = {0.48 * way, 0.88 * way, 8.8,
                             -0.1,       0.5,        std::hypot(0.48 * way, 0.88 * way + 30.0)};
      for (Index i = 0; i < 6; ++i) {
        if (random.uniform() < 0.5) y(i, t) = seen[i] + std::sqrt(noise.R(i, i)) * random.normal();
      }
    }
  }
  template <class Change>
  void add(const Change& change) {
    directions.push_back({-1, zero_noise(model)});
    change(directions.back().noise);
  }
  Likelihood likelihood(const std::vector<FilterDirection>& by,
                        MatrixXd* products = nullptr) const {
    ModelMemory memory = make_memory(model);
    return nonlinear_likelihood(model, memory, p, noise, by, inputs, y, options, products);
  }
};

// Every pair of directions alone has the numbers that it has among all of them.
TEST(ExtendedFilter, ManyDirectionsHaveTheNumbersOfFew) {
  Random random(5);
  const Tracker tracker(random);
  for (const NonlinearMethod method : {NonlinearMethod::extended, NonlinearMethod::iterated}) {
    Tracker s = tracker;
    s.options.method = method;
    MatrixXd products;
    const Likelihood all = s.likelihood(s.directions, &products);
    ASSERT_EQ(all.status, FilterStatus::ok);
    EXPECT_EQ(all.value, s.likelihood({}).value);
    double worst = 0.0;
    const auto k = static_cast<Index>(s.directions.size());
    for (Index i = 0; i < k; ++i) {
      for (Index j = 0; j < i; ++j) {
        MatrixXd own;
        const Likelihood two = s.likelihood(
            {s.directions[static_cast<std::size_t>(j)], s.directions[static_cast<std::size_t>(i)]},
            &own);
        const Eigen::Vector2d size(std::sqrt(all.information(j, j)),
                                   std::sqrt(all.information(i, i)));
        worst = std::max({worst, std::abs(two.gradient[0] - all.gradient[j]) / size[0],
                          std::abs(two.gradient[1] - all.gradient[i]) / size[1],
                          std::abs(two.information(0, 1) - all.information(j, i)) / size.prod(),
                          std::abs(own(0, 1) - products(j, i)) / size.prod()});
      }
    }
    std::printf("%ld directions against pairs of them: %.1e\n", static_cast<long>(k), worst);
    EXPECT_LT(worst, 1e-11);
  }
}

// Central differences, extrapolated.
TEST(ExtendedFilter, GradientOfManyDirectionsIsExact) {
  Random random(6);
  Tracker s(random);
  const Likelihood exact = s.likelihood(s.directions);
  double worst = 0.0;
  for (std::size_t i = 0; i < s.directions.size(); ++i) {
    const FilterDirection& d = s.directions[i];
    const auto at = static_cast<Index>(i);
    const double h0 = 3e-3 / std::sqrt(exact.information(at, at));
    const auto slope = [&](double h) {
      double both[2];
      for (const int sign : {1, -1}) {
        Tracker moved = s;
        const double way = sign * h;
        if (d.parameter >= 0) moved.p[d.parameter] += way;
        moved.noise.Q += way * d.noise.Q;
        moved.noise.R += way * d.noise.R;
        moved.noise.x0 += way * d.noise.x0;
        moved.noise.P0 += way * d.noise.P0;
        both[sign > 0 ? 0 : 1] = moved.likelihood({}).value;
      }
      return (both[0] - both[1]) / (2.0 * h);
    };
    const double numerical = (4.0 * slope(0.5 * h0) - slope(h0)) / 3.0;
    worst = std::max(
        worst, std::abs(numerical - exact.gradient[at]) / std::sqrt(exact.information(at, at)));
  }
  std::printf("gradient by differences: %.1e\n", worst);
  EXPECT_LT(worst, 2e-8);
}

// A model that is linear in its state has one step for all intervals of a length; where every stamp
// is a little off there is none to be had.
TEST(ExtendedFilter, StepsThatAreMadeOnceAreTheStepsOfEveryInterval) {
  Random random(7);
  const NonlinearModel model = model_of({"a", "b", "u", "k", "d", "t"}, 2, 1,
                                        {"b", "-k*a - d*b + sin(u)*k"}, {"a", "a + d*b"}, true);
  const Index N = 80;
  FilterNoise noise = zero_noise(model);
  noise.Q.diagonal() << 0.0, 0.6;
  noise.R.diagonal() << 0.1, 0.2;
  noise.P0.setIdentity();
  MatrixXd u(1, N), y(2, N);
  for (double& entry : u.reshaped()) entry = random.normal();
  for (double& entry : y.reshaped()) entry = random.normal();
  y(1, 7) = kNaN;
  std::vector<FilterDirection> directions{{0, zero_noise(model)}, {1, zero_noise(model)}};
  directions.push_back({-1, zero_noise(model)});
  directions.back().noise.Q(1, 1) = 1.0;
  VectorXd time = VectorXd::LinSpaced(N, 0.0, 0.1 * (N - 1));
  time.tail(30).array() += 0.05;
  VectorXd moved = time;
  for (double& t : moved) t += 1e-10 * random.uniform();
  const VectorXd p{{3.0, 0.7}};
  NonlinearFilterOptions options;
  options.noise = ProcessNoise::density;
  const auto at = [&](const VectorXd& stamps) {
    ModelMemory memory = make_memory(model);
    const InputNodes inputs = input_nodes(stamps, u, InputPath::linear, std::vector<int>(N - 1, 2));
    return nonlinear_likelihood(model, memory, p, noise, directions, inputs, y, options);
  };
  const Likelihood once = at(time), each = at(moved);
  EXPECT_NEAR(once.value, each.value, 1e-8 * std::abs(each.value));
  EXPECT_LT((once.gradient - each.gradient).norm(), 1e-8 * each.gradient.norm());
  EXPECT_LT((once.information - each.information).norm(), 1e-8 * each.information.norm());
}

TEST(ExtendedFilter, GatedInnovationsAreThoseOfTheRecordingWithoutWhatWasRefused) {
  Random random(8);
  for (const NonlinearMethod method :
       {NonlinearMethod::extended, NonlinearMethod::iterated, NonlinearMethod::unscented}) {
    Tracker s(random, 300);
    s.options.method = method;
    std::vector<std::pair<Index, Index>> wanted;
    for (const Index t : {Index{20}, Index{170}, Index{171}, Index{299}}) {
      for (const Index i : {Index{0}, Index{3}}) {
        if (t == 299 && i == 3) continue;
        s.y(i, t) = 1e3;
        wanted.emplace_back(t, i);
      }
    }
    std::vector<std::pair<Index, Index>> refused;
    const auto far = [&](Index t, const FilterResult& so_far) {
      for (Index i = 0; i < 6; ++i) {
        if (!(std::abs(so_far.e(i, t)) > 30.0 * so_far.e_sd(i, t))) continue;
        refused.emplace_back(t, i);
        return static_cast<int>(i);
      }
      return -1;
    };
    MatrixXd kept = s.y;
    const FilterResult gated =
        gated_innovations(s.model, s.p, s.noise, s.inputs, kept, s.options, 50, far);
    ASSERT_EQ(gated.status, FilterStatus::ok);
    EXPECT_EQ(refused, wanted);
    const FilterResult whole =
        nonlinear_filter(s.model, s.p, s.noise, s.inputs, kept, s.options, Keep::innovations);
    for (Index e = 0; e < kept.size(); ++e) {
      ASSERT_EQ(std::isnan(gated.e(e)), std::isnan(kept(e)));
      if (std::isnan(kept(e))) continue;
      EXPECT_EQ(gated.e(e), whole.e(e));
      EXPECT_EQ(gated.standardised(e), whole.standardised(e));
    }
  }
}

}  // namespace
}  // namespace identikal
