// Linear models that change from sample to sample, against the joint Gaussian density of all samples
// and finite differences.
#include "identify/filter/changing_recordings.h"

#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>
#include <unsupported/Eigen/MatrixFunctions>

#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/check.h"
#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// What a receiver says of its own accuracy scales the variance of its positions.
constexpr const char* kAccuracy = R"(identikal: 1
time: {kind: continuous, column: t, unit: s}
parameters:
  q: {value: 0.6 m^2/s^3, min: 0}
  s: {value: 1.3, min: 0}
states: {p: m, v: m/s}
inputs: {acc: {column: acc, unit: m}}
dynamics: {p: v, v: 0}
outputs: {px: {column: px, unit: m, equals: p}}
noise:
  process: {kind: density, variance: {v: q}}
  measurement: {variance: {px: s*acc^2}}
initial: diffuse
)";

// Poles, gains, cross covariance and noise, all by inputs and time, between stamps of any distance.
constexpr const char* kEverything = R"(identikal: 1
time: {kind: continuous, column: t, unit: s, sampling: irregular}
parameters: {tau: 0.7, b: 0.4, c: 1.2, q: {value: 0.3, min: 0}, r: {value: 0.2, min: 0}}
inputs: {u: {column: u}, n: {column: n}}
states: [x, z]
dynamics: {x: -x/tau*(1 + u^2) + b*u, z: x - z}
outputs: {y: {column: y, equals: c*z*cos(t) + u}}
noise:
  process: {kind: density, variance: {x: q*(1 + n)}}
  measurement: {variance: {y: r*n}}
initial: {mean: {x: 1, z: 0.5}, sd: {x: 0.5, z: 0.2}}
)";

// The same kind by matrices, in discrete time.
constexpr const char* kMatrices = R"(identikal: 1
time: {column: t, unit: s}
parameters: {a: 0.8, g: 0.5, q: {value: 0.3, min: 0}, r: {value: 0.4, min: 0}, k: 0.1}
inputs: [{name: u, column: u}, {name: n, column: n}]
A: [[a*cos(u), 0.1], [0, 0.5]]
B: [[g, 0], [0, 0]]
C: [[1, u]]
D: [[0, 0]]
Q: [[q*n, 0], [0, 0.2]]
R: [[r + 0.1*n*r]]
S: [[k*n], [0]]
initial: {mean: [1, 0], sd: [1, 1]}
outputs: [{name: y, column: y}]
)";

struct ChangingCase {
  Model model;
  std::vector<Dataset> recordings;
};

ChangingCase make_case(const std::string& text, bool irregular, Index N = 25) {
  ChangingCase out{parse_model_file(text, "changing.yaml"), {}};
  Random random(3);
  const auto nu = static_cast<Index>(out.model.inputs.size());
  MatrixXd y(1, N), u(nu, N);
  VectorXd time(N);
  for (Index t = 0; t < N; ++t) {
    time[t] = irregular && t > 0 ? time[t - 1] + 0.05 + std::abs(random.normal()) : 0.2 * t;
    y(0, t) = random.normal();
    for (Index i = 0; i < nu; ++i)
      u(i, t) = i + 1 == nu ? 0.5 + std::abs(random.normal()) : 0.5 * random.normal();
  }
  y(0, 7) = y(0, 8) = std::nan("");
  out.recordings.push_back(recording(out.model, y, SampleTimes(time), u));
  out.model = checked(out.model, out.recordings);
  return out;
}

// The samples' joint density, from a model of every sample that is written here by hand.
struct Sampled {
  MatrixXd A, C, Q, R, S;
  VectorXd b, d;
};
using Witness = std::function<Sampled(const Dataset&, Index)>;

double dense_log_density(const Dataset& data, const Witness& at, const VectorXd* x0,
                         const MatrixXd* P0) {
  const Index N = data.size(), n = at(data, 0).A.rows();
  // The state at t as a sum of the first one, the noise of every sample, and what is known.
  MatrixXd by_first = MatrixXd::Identity(n, n), by_noise = MatrixXd::Zero(n, n * N);
  VectorXd known = VectorXd::Zero(n);
  MatrixXd O(N, n), W(N, n * N), all = MatrixXd::Zero(n * N, n * N), V = MatrixXd::Zero(N, N);
  MatrixXd cross = MatrixXd::Zero(n * N, N);
  VectorXd mean(N);
  std::vector<Index> present;
  for (Index t = 0; t < N; ++t) {
    const Sampled m = at(data, t);
    O.row(t) = m.C * by_first;
    W.row(t) = m.C * by_noise;
    mean[t] = (m.C * known + m.d)(0);
    all.block(n * t, n * t, n, n) = m.Q;
    V(t, t) = m.R(0, 0);
    cross.block(n * t, t, n, 1) = m.S;
    by_first = (m.A * by_first).eval();
    by_noise = (m.A * by_noise).eval();
    by_noise.middleCols(n * t, n) += MatrixXd::Identity(n, n);
    known = (m.A * known + m.b).eval();
    if (!std::isnan(data.y(0, t))) present.push_back(t);
  }
  MatrixXd Sigma = W * all * W.transpose() + V + W * cross + (W * cross).transpose();
  if (x0 != nullptr) {
    mean += O * *x0;
    Sigma += O * *P0 * O.transpose();
  }
  const MatrixXd S = Sigma(present, present), o = O(present, Eigen::all);
  VectorXd e = data.y.row(0).transpose()(present) - mean(present);
  const Eigen::LDLT<MatrixXd> ldlt(S);
  double log_determinant = ldlt.vectorD().array().log().sum();
  auto count = static_cast<double>(present.size());
  if (x0 == nullptr) {
    const MatrixXd information = o.transpose() * ldlt.solve(o);
    e -= o * information.ldlt().solve(o.transpose() * ldlt.solve(e));
    log_determinant += std::log(information.determinant());
    count -= static_cast<double>(n);
  }
  return -0.5 * (log_determinant + e.dot(ldlt.solve(e)) + count * std::log(2.0 * std::numbers::pi));
}

// Phi, Gamma and the noise's integral by a fine sum: no exponential of blocks.
Sampled sampled(const MatrixXd& A, const VectorXd& b, const MatrixXd& W, double h) {
  constexpr int kPieces = 400;
  const double piece = h / kPieces;
  Sampled out{
      (A * h).exp(),    {}, MatrixXd::Zero(2, 2), {}, MatrixXd::Zero(2, 1), VectorXd::Zero(2),
      VectorXd::Zero(1)};
  const MatrixXd half = (A * (0.5 * piece)).exp(), step = half * half;
  // Simpson's rule over every piece.
  MatrixXd Phi = MatrixXd::Identity(2, 2);
  const auto add = [&](const MatrixXd& at, double weight) {
    out.Q += weight * at * W * at.transpose();
    out.b += weight * at * b;
  };
  for (int i = 0; i < kPieces; ++i) {
    add(Phi, piece / 6.0);
    add(Phi * half, 4.0 * piece / 6.0);
    Phi = (Phi * step).eval();
    add(Phi, piece / 6.0);
  }
  return out;
}

double log_density(ChangingCase& of, const ParameterSet& at) {
  RecordingsLikelihood likelihood(of.model, of.recordings);
  const Likelihood* found = likelihood.evaluate(at, false);
  return found == nullptr ? std::nan("") : found->value;
}

void expect_exact_gradient(ChangingCase& of) {
  RecordingsLikelihood likelihood(of.model, of.recordings);
  const Likelihood* found = likelihood.evaluate(of.model.parameters, true);
  ASSERT_NE(found, nullptr);
  const VectorXd gradient = found->gradient, z = free_entries(of.model.parameters);
  const MatrixXd products = likelihood.score_products(of.model.parameters);
  ASSERT_EQ(products.rows(), gradient.size());
  for (Index i = 0; i < gradient.size(); ++i) {
    const double h = 1e-5 * std::max(std::abs(z[i]), 0.1);
    const auto moved = [&](double by) {
      return log_density(of,
                         with_entries(of.model.parameters, z + by * VectorXd::Unit(z.size(), i)));
    };
    const double difference = (moved(h) - moved(-h)) / (2.0 * h);
    EXPECT_NEAR(gradient[i], difference, 1e-7 * std::max(1.0, std::abs(difference))) << i;
  }
}

TEST(ChangingRecordings, AnAccuracyFromAColumnHasItsJointDensity) {
  ChangingCase of = make_case(kAccuracy, false);
  ASSERT_TRUE(changes(of.model));
  const auto at = [](const Dataset& data, Index t) {
    Sampled out = sampled((MatrixXd(2, 2) << 0, 1, 0, 0).finished(), VectorXd::Zero(2),
                          (MatrixXd(2, 2) << 0, 0, 0, 0.6).finished(), 0.2);
    out.C = (MatrixXd(1, 2) << 1, 0).finished();
    out.R = MatrixXd::Constant(1, 1, 1.3 * data.u(0, t) * data.u(0, t));
    return out;
  };
  const double dense = dense_log_density(of.recordings[0], at, nullptr, nullptr);
  EXPECT_NEAR(log_density(of, of.model.parameters) / dense, 1.0, 1e-9);
  expect_exact_gradient(of);
}

TEST(ChangingRecordings, EveryMatrixMayHoldInputsAndTimeBetweenStampsOfAnyDistance) {
  ChangingCase of = make_case(kEverything, true);
  ASSERT_TRUE(changes(of.model));
  const auto at = [](const Dataset& data, Index t) {
    const double u = data.u(0, t), n = data.u(1, t);
    const double h = t + 1 < data.size() ? data.time[t + 1] - data.time[t] : 1.0;
    Sampled out = sampled((MatrixXd(2, 2) << -(1 + u * u) / 0.7, 0, 1, -1).finished(),
                          Eigen::Vector2d(0.4 * u, 0),
                          (MatrixXd(2, 2) << 0.3 * (1 + n), 0, 0, 0).finished(), h);
    out.C = (MatrixXd(1, 2) << 0, 1.2 * std::cos(data.time[t])).finished();
    out.d = VectorXd::Constant(1, u);
    out.R = MatrixXd::Constant(1, 1, 0.2 * n);
    return out;
  };
  const VectorXd x0 = Eigen::Vector2d(1, 0.5);
  const MatrixXd P0 = Eigen::Vector2d(0.25, 0.04).asDiagonal();
  const double dense = dense_log_density(of.recordings[0], at, &x0, &P0);
  EXPECT_NEAR(log_density(of, of.model.parameters) / dense, 1.0, 1e-9);
  expect_exact_gradient(of);
}

TEST(ChangingRecordings, MatricesHoldInputsInDiscreteTimeWithCrossCovariance) {
  ChangingCase of = make_case(kMatrices, false);
  ASSERT_TRUE(changes(of.model));
  const auto at = [](const Dataset& data, Index t) {
    const double u = data.u(0, t), n = data.u(1, t);
    Sampled out;
    out.A = (MatrixXd(2, 2) << 0.8 * std::cos(u), 0.1, 0, 0.5).finished();
    out.b = Eigen::Vector2d(0.5 * u, 0);
    out.d = VectorXd::Zero(1);
    out.C = (MatrixXd(1, 2) << 1, u).finished();
    out.Q = Eigen::Vector2d(0.3 * n, 0.2).asDiagonal();
    out.R = MatrixXd::Constant(1, 1, 0.4 + 0.04 * n);
    out.S = Eigen::Vector2d(0.1 * n, 0);
    return out;
  };
  const VectorXd x0 = Eigen::Vector2d(1, 0);
  const MatrixXd P0 = MatrixXd::Identity(2, 2);
  const double dense = dense_log_density(of.recordings[0], at, &x0, &P0);
  EXPECT_NEAR(log_density(of, of.model.parameters) / dense, 1.0, 1e-9);
  expect_exact_gradient(of);
}

// The time between two stamps is one interval, in the middle of which nothing need be measured.
TEST(ChangingRecordings, ARowWithoutMeasurementChangesNothing) {
  const std::string text = R"(identikal: 1
time: {kind: continuous, column: t, unit: s, sampling: irregular}
parameters: {q: {value: 1, min: 0}, r: {value: 0.5, min: 0}}
states: [x, v]
dynamics: {x: v, v: 0}
outputs: {y: {column: y, equals: x}}
noise: {process: {kind: density, variance: {v: q}}, measurement: {variance: {y: r}}}
initial: diffuse
)";
  const ChangingCase of = make_case(text, true);
  const Dataset& given = of.recordings[0];
  std::vector<Index> present;
  for (Index t = 0; t < given.size(); ++t) {
    if (!std::isnan(given.y(0, t))) present.push_back(t);
  }
  std::vector<Dataset> without{recording(of.model, MatrixXd(given.y(Eigen::all, present)),
                                         SampleTimes(VectorXd(given.time(present))))};
  RecordingsLikelihood all(of.model, of.recordings), fewer(of.model, without);
  const Likelihood one = *all.evaluate(of.model.parameters, true);
  const Likelihood other = *fewer.evaluate(of.model.parameters, true);
  EXPECT_NEAR(one.value, other.value, 1e-9);
  EXPECT_TRUE(one.gradient.isApprox(other.gradient, 1e-8));
  const SmootherResult smooth = run_smoother(of.model, of.model.parameters, of.recordings[0], {});
  const SmootherResult smooth_fewer = run_smoother(of.model, of.model.parameters, without[0], {});
  ASSERT_EQ(smooth.status, FilterStatus::ok);
  EXPECT_TRUE(smooth.x(Eigen::all, present).isApprox(smooth_fewer.x, 1e-8));
  EXPECT_TRUE(smooth.sd(Eigen::all, present).isApprox(smooth_fewer.sd, 1e-8));
}

// Starts of the states one by one: known, in the steady state, diffuse.
double with_start_of(const std::string& initial) {
  const std::string text =
      "identikal: 1\ntime: {kind: discrete, step: 1 s}\n"
      "A: [[1, 0, 0], [0, 0.7, 0], [0, 0, 1]]\nC: [[1, 1, 0.5]]\n"
      "Q: [[0.1, 0, 0], [0, 0.5, 0], [0, 0, 0]]\nR: [[0.3]]\n"
      "outputs: [{name: y, column: y}]\ninitial: " +
      initial;
  const Model model = parse_model_file(text, "model.yaml");
  const MatrixXd y{{1.0, 2.5, 3.0, 2.0, -1.0, 2.0, 0.5}};
  const std::vector<Dataset> data{recording(model, y, SampleTimes(1.0))};
  return RecordingsLikelihood(model, data).evaluate(model.parameters, false)->value;
}

TEST(ChangingRecordings, EveryStateMayStartInItsOwnWay) {
  const std::string sd = "0.9901475429766743";  // of x2 in its steady state, (0.5/(1 - 0.49))^(1/2)
  const double known = with_start_of("{mean: [2, 0, 0.3], sd: [1.5, " + sd + ", 0.2]}");
  EXPECT_NEAR(with_start_of("{x1: {mean: 2, sd: 1.5}, x2: stationary, x3: {mean: 0.3, sd: 0.2}}"),
              known, 1e-12);
  const double vague = with_start_of("{mean: [0, 0, 0.3], sd: [1e6, " + sd + ", 0.2]}");
  EXPECT_NEAR(with_start_of("{x1: diffuse, x2: stationary, x3: {mean: 0.3, sd: 0.2}}"),
              vague + std::log(1e6) + 0.5 * std::log(2.0 * std::numbers::pi), 1e-9);
  EXPECT_EQ(
      with_start_of("{x1: {mean: 2, sd: 1.5}, x2: {sd: " + sd + "}, x3: {mean: 0.3, sd: 0.2}}"),
      known);
  const double exact = with_start_of("{mean: [2, 0, 0.3], sd: [1.5, " + sd + ", 0]}");
  EXPECT_NEAR(with_start_of("{x1: {mean: 2, sd: 1.5}, x2: stationary, x3: 0.3}"), exact, 1e-12);
}

}  // namespace
}  // namespace identikal
