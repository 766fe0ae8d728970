// What must not change when a problem is only written in another way.
#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "identify/noise/ml.h"
#include "lib/base/random.h"
#include "tests/campaigns/noise_problem.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

NoiseEstimate tuned(const NoiseProblem& problem) {
  NoiseMlOptions options;
  options.profiles = false;
  return tune_ml(problem.model, {problem.recording}, options);
}

std::set<std::string> codes(const NoiseEstimate& estimate) {
  std::set<std::string> out;
  for (const Finding& finding : estimate.findings) {
    // How it was evaluated, and where other starts stopped, is told of the search.
    const bool of_search = finding.code == FindingCode::evaluation_method ||
                           finding.code == FindingCode::several_maxima;
    if (!of_search) out.insert(name_of(finding) + " " + to_string(finding.severity));
  }
  return out;
}

const EstimatedParameter& named(const NoiseEstimate& estimate, const std::string& name) {
  return *std::find_if(estimate.parameters.begin(), estimate.parameters.end(),
                       [&](const EstimatedParameter& p) { return p.name == name; });
}

// A problem, the same in another form, and what becomes of names and values by that.
struct Rewritten {
  NoiseProblem problem;
  std::function<std::string(const std::string&)> name = [](const std::string& same) {
    return same;
  };
  double factor = 1.0;          // of every variance
  double log_likelihood = 0.0;  // added to it
};

void expect_the_same(const NoiseProblem& before, const Rewritten& after) {
  const NoiseEstimate a = tuned(before), b = tuned(after.problem);
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(codes(a), codes(b));
  EXPECT_NEAR(a.objective.aic - 2.0 * after.log_likelihood, b.objective.aic,
              1e-6 * std::abs(a.objective.aic));
  for (const EstimatedParameter& p : a.parameters) {
    const EstimatedParameter& q = named(b, after.name(p.name));
    EXPECT_EQ(p.verdict, q.verdict) << p.name;
    EXPECT_NEAR(after.factor * p.value, q.value, 1e-3 * after.factor * p.se) << p.name;
    if (std::isfinite(p.se)) {
      EXPECT_NEAR(after.factor * p.se / q.se, 1.0, 1e-3) << p.name;
    }
  }
  ASSERT_EQ(a.tests.size(), b.tests.size());
}

// Recordings without a fault and with one, so that there is something to find.
void for_each_problem(const std::function<Rewritten(NoiseProblem, Random&)>& rewrite) {
  constexpr std::uint64_t kProblems = 12;
  for (std::uint64_t seed = 0; seed < kProblems; ++seed) {
    const NoiseProblem problem = draw_noise_problem(70'000 + seed, static_cast<int>(seed % 2));
    const bool stamped = std::abs(problem.recording.dt - problem.model.time.step) > 1e-9;
    if (stamped) continue;
    SCOPED_TRACE(problem.words);
    Random random(seed + 1);
    expect_the_same(problem, rewrite(problem, random));
  }
}

TEST(Metamorphic, StatesInOtherUnitsAndDirections) {
  for_each_problem([](NoiseProblem problem, Random& random) {
    LinearModel& m = as_linear(problem.model);
    const Index n = m.A.constant.rows();
    MatrixXd T(n, n);
    for (double& entry : T.reshaped()) entry = random.normal();
    for (Index i = 0; i < n; ++i) T.row(i) *= std::pow(10.0, 4.0 * random.uniform() - 2.0);
    const MatrixXd back = T.inverse();
    m.A.constant = (T * m.A.constant * back).eval();
    m.G.constant = (T * m.G.constant).eval();
    m.C.constant = (m.C.constant * back).eval();
    return Rewritten{std::move(problem)};
  });
}

TEST(Metamorphic, OutputsInAnotherUnit) {
  for_each_problem([](NoiseProblem problem, Random&) {
    constexpr double kScale = 3.6;
    problem.recording.y *= kScale;
    const double samples = static_cast<double>(problem.recording.y.size());
    const double diffuse = as_linear(problem.model).initial == InitialState::diffuse
                               ? static_cast<double>(as_linear(problem.model).A.constant.rows())
                               : 0.0;
    Rewritten out{std::move(problem)};
    out.factor = kScale * kScale;
    out.log_likelihood = -(samples - diffuse) * std::log(kScale);
    return out;
  });
}

TEST(Metamorphic, OutputsInAnotherOrder) {
  for_each_problem([](NoiseProblem problem, Random&) {
    LinearModel& m = as_linear(problem.model);
    m.C.constant = m.C.constant.colwise().reverse().eval();
    problem.recording.y = problem.recording.y.colwise().reverse().eval();
    std::reverse(problem.recording.outputs.begin(), problem.recording.outputs.end());
    std::reverse(problem.model.outputs.begin(), problem.model.outputs.end());
    const Index ny = m.C.constant.rows();
    Rewritten out{std::move(problem)};
    out.name = [ny](const std::string& name) {
      return name[0] == 'r' ? "r" + std::to_string(ny + 1 - std::stol(name.substr(1))) : name;
    };
    return out;
  });
}

TEST(Metamorphic, AnotherStart) {
  for_each_problem([](NoiseProblem problem, Random& random) {
    for (Parameter& p : problem.model.parameters) p.value *= std::pow(10.0, random.uniform() - 0.5);
    return Rewritten{std::move(problem)};
  });
}

TEST(Metamorphic, AnotherTimeOfDay) {
  for_each_problem([](NoiseProblem problem, Random&) {
    problem.recording.time.array() += 4096.0;
    return Rewritten{std::move(problem)};
  });
}

}  // namespace
}  // namespace identikal
