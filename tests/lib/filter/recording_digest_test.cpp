#include "lib/filter/recording_digest.h"

#include <cmath>
#include <cstdio>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/filter/likelihood.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double relative_to(const MatrixXd& a, const MatrixXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / std::max(1e-300, b.cwiseAbs().maxCoeff());
}

struct DigestCase {
  StateSpace model;
  MatrixXd y, u;
  std::vector<StateSpace> derivatives;
};

// The greatest relative difference of value, gradient and information, of a likelihood at another
// point than the digest was made for.
double difference(const DigestCase& c, InitialState initial) {
  const RecordingDigest digest = digest_of(c.y, c.u, c.model);
  StateSpace other = c.model;
  other.Q *= 1.3;
  other.R *= 0.8;
  LikelihoodEngine whole, small;
  whole.add_recording(c.y, c.u);
  small.add_digest(digest);
  const Likelihood a = whole.evaluate(other, initial, c.derivatives);
  const Likelihood b = small.evaluate(other, initial, c.derivatives);
  EXPECT_EQ(a.status, FilterStatus::ok);
  EXPECT_EQ(b.status, FilterStatus::ok);
  if (b.status != FilterStatus::ok) return HUGE_VAL;
  return std::max({std::abs(a.value - b.value) / std::abs(a.value),
                   relative_to(b.gradient, a.gradient), relative_to(b.information, a.information)});
}

StateSpace local_level(double q, double r) {
  StateSpace m;
  m.A = m.C = m.G = MatrixXd::Identity(1, 1);
  m.B = MatrixXd(1, 0);
  m.D = MatrixXd(1, 0);
  m.Q = MatrixXd::Constant(1, 1, q);
  m.R = MatrixXd::Constant(1, 1, r);
  m.S = MatrixXd::Zero(1, 1);
  m.x0 = VectorXd::Zero(1);
  m.P0 = MatrixXd::Identity(1, 1);
  return m;
}

TEST(RecordingDigest, GivesTheLikelihoodOfTheRecording) {
  double worst = 0.0;
  int compared = 0;
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    Random random(seed);
    const Index n = 1 + static_cast<Index>(seed % 6), nu = static_cast<Index>(seed % 3);
    DigestCase c;
    c.model = random_model(random, n, nu, 1 + static_cast<Index>(seed % 2), 1);
    const Index N = 20000;
    c.u = random_matrix(random, nu, N);
    if (nu > 0) c.u.row(0).array() += 5.0;
    c.y = simulate_outputs(random, c.model, c.u, N);
    const bool dynamics = seed % 2 == 0;
    for (int i = 0; i < 3; ++i) {
      c.derivatives.push_back(dynamics ? random_direction(random, c.model)
                                       : noise_direction(random, c.model));
    }
    for (const InitialState initial : {InitialState::stationary, InitialState::diffuse}) {
      LikelihoodEngine engine;
      engine.add_recording(c.y, c.u);
      engine.evaluate(c.model, initial, c.derivatives);
      if (engine.evaluation_taken().method != EvaluationMethod::autocovariances) continue;
      worst = std::max(worst, difference(c, initial));
      ++compared;
    }
  }
  std::printf("%d likelihoods, greatest relative difference %.1e\n", compared, worst);
  EXPECT_GT(compared, 30);
  EXPECT_LT(worst, 1e-9);
}

TEST(RecordingDigest, OfOutputsThatDriftIsOfANominalFiltersInnovations) {
  Random random(3);
  DigestCase c;
  c.model = local_level(1.0, 4.0);
  c.y.resize(1, 5000);
  c.u.resize(0, 5000);
  double x = 1000.0;
  for (Index t = 0; t < 5000; ++t) {
    x += random.normal();
    c.y(0, t) = x + 2.0 * random.normal();
  }
  c.derivatives = {local_level(1.0, 0.0), local_level(0.0, 1.0)};
  for (StateSpace& d : c.derivatives) {
    for (MatrixXd* M : {&d.A, &d.C, &d.G, &d.P0}) M->setZero();
  }
  EXPECT_TRUE(digest_of(c.y, c.u, c.model).nominal.has_value());
  EXPECT_LT(difference(c, InitialState::diffuse), 1e-9);
}

TEST(RecordingDigest, ComesBackFromItsBytes) {
  Random random(5);
  const StateSpace model = random_model(random, 2, 1, 1, 1);
  const MatrixXd u = random_matrix(random, 1, 3000);
  const RecordingDigest digest = digest_of(simulate_outputs(random, model, u, 3000), u, model);
  const std::string bytes = bytes_of(digest);
  std::string_view rest = bytes;
  const RecordingDigest back = digest_in(rest);
  EXPECT_TRUE(rest.empty());
  EXPECT_EQ(back.samples, digest.samples);
  EXPECT_EQ(back.head, digest.head);
  EXPECT_EQ(back.tail, digest.tail);
  EXPECT_EQ(back.sums, digest.sums);
}

TEST(RecordingDigest, OtherBytesAreRefused) {
  Random random(6);
  const StateSpace model = random_model(random, 2, 0, 1, 1);
  const MatrixXd u(0, 1000);
  const std::string bytes = bytes_of(digest_of(simulate_outputs(random, model, u, 1000), u, model));
  for (int trial = 0; trial < 1000; ++trial) {
    std::string changed = bytes;
    const auto at = [&](std::size_t size) {
      return static_cast<std::size_t>(random.uniform() * static_cast<double>(size));
    };
    // Counts lie among the first bytes.
    changed[at(trial % 2 == 0 ? 120 : changed.size())] = static_cast<char>(at(256));
    if (trial % 3 == 0) changed.resize(at(changed.size()));
    std::string_view rest = changed;
    try {
      const RecordingDigest digest = digest_in(rest);
      LikelihoodEngine engine;
      engine.add_digest(digest);
      if (digest.outputs == model.outputs() && digest.inputs == model.inputs()) {
        engine.evaluate(model, InitialState::stationary);
      }
    } catch (const std::invalid_argument&) {
    }
  }
}

TEST(RecordingDigest, WhatHasNoneIsRefused) {
  Random random(7);
  const StateSpace model = random_model(random, 2, 0, 1, 1);
  const MatrixXd u(0, 1000);
  MatrixXd y = simulate_outputs(random, model, u, 1000);
  EXPECT_THROW(digest_of(y.leftCols(100), u.leftCols(100), model), std::invalid_argument);
  EXPECT_THROW(digest_of(y, MatrixXd(1, 1000), model), std::invalid_argument);
  y(0, 500) = std::nan("");
  EXPECT_THROW(digest_of(y, u, model), std::invalid_argument);
}

// A filter that remembers longer than the digest reaches has no likelihood, and that is told.
TEST(RecordingDigest, SlowerFiltersAreBeyondIt) {
  Random random(8);
  DigestCase c;
  c.model = local_level(1.0, 1.0);
  c.model.A(0, 0) = 0.9999;
  const MatrixXd u(0, 20000);
  const MatrixXd y = simulate_outputs(random, c.model, u, 20000);
  LikelihoodEngine engine;
  engine.add_digest(digest_of(y, u, c.model));
  EXPECT_EQ(engine.evaluate(c.model, InitialState::stationary).status, FilterStatus::ok);
  StateSpace slow = c.model;
  slow.Q *= 1e-7;
  EXPECT_EQ(engine.evaluate(slow, InitialState::stationary).status, FilterStatus::beyond_digest);
}

}  // namespace
}  // namespace identikal
