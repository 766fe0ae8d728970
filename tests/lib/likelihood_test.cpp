#include "lib/likelihood.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "lib/kalman.h"
#include "lib/random.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr InitialState kStarts[] = {InitialState::given, InitialState::stationary,
                                    InitialState::diffuse};

struct Case {
  StateSpace model;
  MatrixXd y, u;
  std::vector<StateSpace> derivatives;
};

Case random_case(std::uint64_t seed, Index N, bool dynamics) {
  Random random(seed);
  const auto pick = [&](int from, int to) {
    return static_cast<Index>(from + static_cast<int>(random.uniform() * (to - from + 1)));
  };
  Case out;
  const Index n = pick(1, 7), nu = pick(0, 2), ny = pick(1, 3), nw = pick(1, static_cast<int>(n));
  out.model = random_model(random, n, nu, ny, nw);
  out.u = random_matrix(random, nu, N);
  if (nu > 0) out.u.row(0).array() += 5.0;
  out.y = simulate_outputs(random, out.model, out.u, N);
  for (int i = 0; i < 4; ++i) {
    out.derivatives.push_back(dynamics ? random_direction(random, out.model)
                                       : noise_direction(random, out.model));
  }
  return out;
}

void knock_out(MatrixXd& y, Index begin, Index rows, Index channel) {
  for (Index t = begin; t < begin + rows; ++t) {
    for (Index i = 0; i < y.rows(); ++i) {
      if (channel < 0 || channel == i) y(i, t) = kNaN;
    }
  }
}

double relative(const MatrixXd& a, const MatrixXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / std::max(1e-300, b.cwiseAbs().maxCoeff());
}

// value, gradient, information
struct Differences {
  double value = 0.0, gradient = 0.0, information = 0.0;
};
Differences compare(const Case& c, InitialState initial, Path path, Path* taken) {
  LikelihoodEngine engine;
  engine.add_recording(c.y, c.u);
  const Likelihood fast = engine.evaluate(c.model, initial, c.derivatives, path);
  *taken = engine.path_taken().path;
  LikelihoodEngine reference;
  reference.add_recording(c.y, c.u);
  const Likelihood full = reference.evaluate(c.model, initial, c.derivatives, Path::direct);
  EXPECT_EQ(fast.status, full.status);
  if (full.status != FilterStatus::ok) {
    // A state that is forgotten before it is seen.
    EXPECT_EQ(full.status, FilterStatus::undetermined);
    return {};
  }
  return {std::abs(fast.value / full.value - 1.0), relative(fast.gradient, full.gradient),
          relative(fast.information, full.information)};
}

TEST(Likelihood, PathsAgree) {
  Differences worst[3];
  int compressed = 0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Case c = random_case(seed, 3000, seed % 2 == 0);
    for (const InitialState initial : kStarts) {
      for (const Path path : {Path::steady, Path::automatic}) {
        Path taken;
        const Differences d = compare(c, initial, path, &taken);
        compressed += taken == Path::compressed;
        Differences& w = worst[static_cast<int>(taken) - 1];
        w = {std::max(w.value, d.value), std::max(w.gradient, d.gradient),
             std::max(w.information, d.information)};
        EXPECT_LT(d.value, 1e-10) << seed << " " << to_string(taken);
        EXPECT_LT(d.gradient, 1e-8) << seed << " " << to_string(taken);
      }
    }
  }
  EXPECT_GT(compressed, 60);
  for (const Path path : {Path::steady, Path::compressed}) {
    const Differences& w = worst[static_cast<int>(path) - 1];
    printf("%s: value %.1e, gradient %.1e, information %.1e of the full recursion's\n",
           to_string(path), w.value, w.gradient, w.information);
  }
}

TEST(Likelihood, GapsSplitTheRecordingIntoStretches) {
  Differences worst;
  int compressed = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Case c = random_case(seed, 3000, seed % 2 == 0);
    knock_out(c.y, 0, 3, -1);
    knock_out(c.y, 700, 5, -1);
    knock_out(c.y, 1500, 40, c.y.rows() - 1);
    knock_out(c.y, 1570, 1, 0);
    knock_out(c.y, 2999, 1, -1);
    for (const InitialState initial : kStarts) {
      Path taken;
      const Differences d = compare(c, initial, Path::automatic, &taken);
      compressed += taken == Path::compressed;
      worst.value = std::max(worst.value, d.value);
      worst.gradient = std::max(worst.gradient, d.gradient);
      EXPECT_LT(d.value, 1e-10) << seed;
      EXPECT_LT(d.gradient, 1e-8) << seed;
    }
  }
  EXPECT_GT(compressed, 30);
  printf("with gaps: value %.1e, gradient %.1e of the full recursion's\n", worst.value,
         worst.gradient);
}

}  // namespace
}  // namespace identikal
