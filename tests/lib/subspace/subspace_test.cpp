// Subspace identification against dense linear algebra, finite differences and systems that are known.
#include <cmath>
#include <limits>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/subspace/innovation_form.h"
#include "lib/subspace/lagged_products.h"
#include "lib/subspace/prediction_error.h"
#include "lib/subspace/predictor.h"
#include "lib/subspace/realisation.h"
#include "lib/subspace/simulation_error.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

InnovationForm two_states() {
  InnovationForm out;
  out.A = MatrixXd{{0.8, 0.3}, {-0.3, 0.8}};
  out.B = MatrixXd{{1.0}, {0.5}};
  out.C = MatrixXd{{1.0, 0.2}, {-0.4, 1.0}};
  out.D = MatrixXd{{0.0}, {0.3}};
  out.K = MatrixXd{{0.4, 0.1}, {-0.1, 0.3}};
  out.sigma = MatrixXd{{0.04, 0.01}, {0.01, 0.09}};
  return out;
}

struct Record {
  MatrixXd y, u;
};

MatrixXd normal(Index rows, Index columns, Random& random) {
  MatrixXd out(rows, columns);
  for (double& each : out.reshaped()) each = random.normal();
  return out;
}

Record recorded(const InnovationForm& system, Index rows, std::uint64_t seed) {
  Random random(seed);
  const MatrixXd u = normal(system.inputs(), rows, random);
  const MatrixXd root = system.sigma.llt().matrixL();
  const MatrixXd e = root * normal(system.outputs(), rows, random);
  Record out{MatrixXd(system.outputs(), rows), u};
  VectorXd x = VectorXd::Zero(system.states());
  for (Index t = 0; t < rows; ++t) {
    out.y.col(t) = system.C * x + system.D * u.col(t) + e.col(t);
    x = (system.A * x + system.B * u.col(t) + system.K * e.col(t)).eval();
  }
  return out;
}

// The windows one below the other, newest sample first; those with a missing sample left out.
MatrixXd windows(const Record& record, Index lags) {
  MatrixXd z(record.y.rows() + record.u.rows(), record.y.cols());
  z << record.y, record.u;
  MatrixXd out(z.cols(), (lags + 1) * z.rows());
  Index count = 0;
  for (Index t = lags; t < z.cols(); ++t) {
    VectorXd w(out.cols());
    for (Index k = 0; k <= lags; ++k) w.segment(k * z.rows(), z.rows()) = z.col(t - k);
    if (w.allFinite()) out.row(count++) = w.transpose();
  }
  out.conservativeResize(count, Eigen::NoChange);
  return out;
}

TEST(LaggedProducts, AreThoseOfAllWindows) {
  Record first = recorded(two_states(), 300, 1), second = recorded(two_states(), 9000, 2);
  first.y(1, 100) = std::numeric_limits<double>::quiet_NaN();
  second.u(0, 5) = std::numeric_limits<double>::quiet_NaN();
  const LaggedProducts sums = lagged_products({first.y, second.y}, {first.u, second.u}, 7);
  const MatrixXd a = windows(first, 7), b = windows(second, 7);
  EXPECT_EQ(sums.windows, a.rows() + b.rows());
  const MatrixXd dense = a.transpose() * a + b.transpose() * b;
  EXPECT_LT((sums.gram - dense).norm(), 1e-11 * dense.norm());
}

TEST(LaggedProducts, RefuseWhatDoesNotGoTogether) {
  const MatrixXd y = MatrixXd::Zero(1, 10), u = MatrixXd::Zero(1, 9);
  EXPECT_THROW(lagged_products({}, {}, 2), std::invalid_argument);
  EXPECT_THROW(lagged_products({y}, {u}, 2), std::invalid_argument);
  EXPECT_THROW(lagged_products({y}, {y}, 0), std::invalid_argument);
}

// cov(h_k, h_l) = size decay^max(k, l), channel by channel: outputs from lag 1, inputs from lag 0 on.
MatrixXd prior_covariance(const PredictorPrior& prior, Index outputs, Index inputs, Index lags) {
  const Index size = outputs * lags + inputs * (lags + 1);
  MatrixXd out = MatrixXd::Zero(size, size);
  Index at = 0;
  for (Index c = 0; c < outputs + inputs; ++c) {
    const bool is_output = c < outputs;
    const Index count = is_output ? lags : lags + 1;
    for (Index k = 0; k < count; ++k) {
      for (Index l = 0; l < count; ++l) {
        const double decay = is_output ? prior.output_decay : prior.input_decay;
        out(at + k, at + l) = (is_output ? prior.output_size : prior.input_size) *
                              std::pow(decay, static_cast<double>(std::max(k, l) + 1));
      }
    }
    at += count;
  }
  return out;
}

// The regressors channel by channel.
MatrixXd regressors(const MatrixXd& w, Index outputs, Index inputs, Index lags) {
  const Index q = outputs + inputs;
  MatrixXd out(w.rows(), outputs * lags + inputs * (lags + 1));
  Index at = 0;
  for (Index c = 0; c < q; ++c) {
    for (Index k = c < outputs ? 1 : 0; k <= lags; ++k) out.col(at++) = w.col(k * q + c);
  }
  return out;
}

TEST(PredictorRegression, HasTheEvidenceOfTheDenseGaussian) {
  const Record record = recorded(two_states(), 80, 3);
  const Index lags = 5;
  const LaggedProducts sums = lagged_products({record.y}, {record.u}, lags);
  const MatrixXd w = windows(record, lags), Z = regressors(w, 2, 1, lags);
  const auto N = static_cast<double>(w.rows());
  const auto dense = [&](const PredictorPrior& prior) {
    MatrixXd V = Z * prior_covariance(prior, 2, 1, lags) * Z.transpose();
    V.diagonal().array() += 1.0;
    const Eigen::LLT<MatrixXd> factor(V);
    double out = 0.0;
    for (Index i = 0; i < 2; ++i) {  // the noise variance at its maximum
      const VectorXd y = w.col(i), white = factor.matrixL().solve(y);
      out -= 0.5 * N * std::log(white.squaredNorm() / N) +
             MatrixXd(factor.matrixL()).diagonal().array().log().sum();
    }
    return out;
  };
  const PredictorRegression regression(sums);
  const PredictorPrior one{10.0, 0.7, 3.0, 0.5}, other{0.2, 0.9, 40.0, 0.3};
  EXPECT_NEAR(regression.log_evidence(one), dense(one), 1e-8 * std::abs(dense(one)));
  EXPECT_NEAR(regression.log_evidence(other), dense(other), 1e-8 * std::abs(dense(other)));
}

TEST(PredictorRegression, EstimatesThePosteriorMean) {
  const Record record = recorded(two_states(), 200, 4);
  const Index lags = 4;
  const PredictorPrior prior{2.0, 0.6, 5.0, 0.8};
  const Predictor found =
      PredictorRegression(lagged_products({record.y}, {record.u}, lags)).estimate(prior);
  const MatrixXd w = windows(record, lags), Z = regressors(w, 2, 1, lags);
  const MatrixXd precision = prior_covariance(prior, 2, 1, lags).inverse();
  const MatrixXd f = (Z.transpose() * Z + precision).ldlt().solve(Z.transpose() * w.leftCols(2));
  for (Index k = 1; k <= lags; ++k) {
    for (Index i = 0; i < 2; ++i) {
      EXPECT_NEAR(found.H(i, (k - 1) * 3), f(k - 1, i), 1e-9);
      EXPECT_NEAR(found.H(i, (k - 1) * 3 + 1), f(lags + k - 1, i), 1e-9);
      EXPECT_NEAR(found.H(i, (k - 1) * 3 + 2), f(2 * lags + k, i), 1e-9);
    }
  }
  EXPECT_NEAR(found.D(1, 0), f(2 * lags, 1), 1e-9);
  const MatrixXd e = w.leftCols(2) - Z * f;
  EXPECT_LT((found.sigma - e.transpose() * e / static_cast<double>(w.rows())).norm(), 1e-10);
}

TEST(Realisation, FindsASystemFromItsExactPredictor) {
  const InnovationForm truth = two_states();
  const Record record = recorded(truth, 4000, 5);
  const LaggedProducts sums = lagged_products({record.y}, {record.u}, 30);
  const MatrixXd responses = predictor_responses(truth, 30);
  Predictor exact;
  exact.H = responses.rightCols(30 * 3);
  exact.D = truth.D;
  exact.sigma = truth.sigma;
  const Realisation states(sums, exact);
  EXPECT_LT(states.singular_values()[2], 1e-4 * states.singular_values()[1]);
  const InnovationForm found = states.model(2);
  EXPECT_NEAR(found.A.trace(), truth.A.trace(), 0.01);
  EXPECT_NEAR(found.A.determinant(), truth.A.determinant(), 0.01);
  EXPECT_LT((predictor_responses(found, 10) - predictor_responses(truth, 10)).norm(), 0.03);
  EXPECT_THROW(states.model(0), std::invalid_argument);
}

TEST(PredictionErrorProblem, ResidualsAreThePredictionErrors) {
  const InnovationForm model = two_states();
  const Record record = recorded(model, 500, 6);
  const LaggedProducts sums = lagged_products({record.y}, {record.u}, 40);
  const PredictionErrorProblem problem(sums, model.sigma);
  VectorXd r;
  ASSERT_TRUE(problem.evaluate(model, r, nullptr));
  const MatrixXd V = prediction_error_covariance(model, sums);
  EXPECT_NEAR(r.squaredNorm(),
              static_cast<double>(sums.windows) * (model.sigma.inverse() * V).trace(),
              1e-7 * r.squaredNorm());
  const MatrixXd e = record.y - one_step_predictions(model, record.y, record.u, VectorXd::Zero(2));
  const MatrixXd of_rows = e.rightCols(460) * e.rightCols(460).transpose() / 460.0;
  EXPECT_LT((V - of_rows).norm(), 1e-6 * V.norm());
}

void expect_derivatives_of_differences(const PredictionErrorProblem& problem,
                                       const InnovationForm& model) {
  VectorXd r, ahead, behind;
  MatrixXd J;
  ASSERT_TRUE(problem.evaluate(model, r, &J));
  const VectorXd theta = predictor_parameters(model);
  ASSERT_EQ(J.cols(), theta.size());
  for (Index i = 0; i < theta.size(); ++i) {
    constexpr double kStep = 1e-6;
    VectorXd moved = theta;
    moved[i] += kStep;
    problem.evaluate(with_predictor_parameters(model, moved), ahead, nullptr);
    moved[i] -= 2.0 * kStep;
    problem.evaluate(with_predictor_parameters(model, moved), behind, nullptr);
    EXPECT_LT(((ahead - behind) / (2.0 * kStep) - J.col(i)).norm(), 1e-6 * (1.0 + J.col(i).norm()))
        << i;
  }
}

TEST(PredictionErrorProblem, DerivativesAreThoseOfDifferences) {
  const InnovationForm model = two_states();
  const Record record = recorded(model, 300, 7);
  const PredictionErrorProblem problem(lagged_products({record.y}, {record.u}, 12), model.sigma);
  expect_derivatives_of_differences(problem, model);
}

// With the states of its own predictor before every window nothing is cut off, however few the lags.
TEST(PredictionErrorProblem, WithStatesNothingIsCutOff) {
  const InnovationForm model = two_states();
  const Record record = recorded(model, 500, 9);
  const MatrixXd x = predictor_states(model, record.y, record.u, VectorXd::Zero(2));
  const LaggedProducts sums = lagged_products({record.y}, {record.u}, 3, {x});
  const MatrixXd e = record.y - one_step_predictions(model, record.y, record.u, VectorXd::Zero(2));
  const MatrixXd of_rows = e.rightCols(497) * e.rightCols(497).transpose() / 497.0;
  EXPECT_LT((prediction_error_covariance(model, sums) - of_rows).norm(), 1e-12);

  const PredictionErrorProblem problem(sums, model.sigma);
  expect_derivatives_of_differences(problem, model);
}

TEST(PredictionErrorProblem, LocalCoordinatesAreNoChangeOfBasis) {
  const InnovationForm model = two_states();
  const MatrixXd directions = local_coordinates(model);
  EXPECT_EQ(directions.cols(), predictor_parameters(model).size() - 4);
  EXPECT_LT((directions.transpose() * directions -
             MatrixXd::Identity(directions.cols(), directions.cols()))
                .norm(),
            1e-12);
  constexpr double kStep = 1e-6;
  const MatrixXd T = MatrixXd::Identity(2, 2) + kStep * MatrixXd{{0.3, -1.0}, {0.7, 0.2}};
  InnovationForm turned = model;
  turned.A = T * model.A * T.inverse();
  turned.B = T * model.B;
  turned.K = T * model.K;
  turned.C = model.C * T.inverse();
  const VectorXd moved = (predictor_parameters(turned) - predictor_parameters(model)) / kStep;
  EXPECT_LT((directions.transpose() * moved).norm(), 1e-5 * moved.norm());
}

TEST(PredictionErrorProblem, ParametersGoThereAndBack) {
  const InnovationForm model = two_states();
  const InnovationForm back = with_predictor_parameters(model, predictor_parameters(model));
  EXPECT_LT((back.A - model.A).norm() + (back.B - model.B).norm() + (back.K - model.K).norm(),
            1e-14);
  EXPECT_EQ(free_parameters(model), 2 * (1 + 4) + 2);
}

TEST(SimulationError, InputsAreThoseOfDenseLeastSquares) {
  InnovationForm model = two_states();
  const Record record = recorded(model, 400, 8);
  Record gap = record;
  gap.y(0, 17) = std::numeric_limits<double>::quiet_NaN();
  model.B.setZero();
  model.D.setZero();
  const InnovationForm found =
      with_inputs_by_simulation(model, {gap.y, record.y}, {gap.u, record.u});
  // Unknowns: B, D, and a first state of each recording; columns by linearity, from simulations.
  const auto simulation = [&](Index unknown, int of) {
    InnovationForm one = model;
    VectorXd x0 = VectorXd::Zero(2);
    if (unknown < 2) one.B(unknown, 0) = 1.0;
    if (unknown >= 2 && unknown < 4) one.D(unknown - 2, 0) = 1.0;
    if (unknown >= 4 && (unknown - 4) / 2 == of) x0[(unknown - 4) % 2] = 1.0;
    return simulated_outputs(one, record.u, x0);
  };
  MatrixXd Z(1600, 8);
  VectorXd y(1600);
  y << gap.y.reshaped(), record.y.reshaped();
  for (Index c = 0; c < 8; ++c)
    Z.col(c) << simulation(c, 0).reshaped(), simulation(c, 1).reshaped();
  Z.row(34).setZero();
  y[34] = 0.0;
  const VectorXd dense = Z.colPivHouseholderQr().solve(y);
  EXPECT_LT((found.B - dense.head(2)).norm(), 1e-7);
  EXPECT_LT((found.D - dense.segment(2, 2)).norm(), 1e-7);
}

// The squares of the simulation's errors from the best first states, by dense linear algebra.
double squares_of(const InnovationForm& model, const std::vector<Record>& records) {
  double sum = 0.0;
  for (const Record& each : records) {
    VectorXd e = (each.y - simulated_outputs(model, each.u, VectorXd::Zero(2))).reshaped();
    MatrixXd start(e.size(), 2);
    for (Index c = 0; c < 2; ++c) {
      start.col(c) =
          simulated_outputs(model, MatrixXd::Zero(1, each.u.cols()), VectorXd::Unit(2, c))
              .reshaped();
    }
    for (Index i = 0; i < e.size(); ++i) {
      if (std::isfinite(e[i])) continue;
      e[i] = 0.0;
      start.row(i).setZero();
    }
    sum += (e - start * start.colPivHouseholderQr().solve(e)).squaredNorm();
  }
  return sum;
}

TEST(SimulationErrorProblem, GradientIsThatOfDifferences) {
  InnovationForm model = two_states();
  Record first = recorded(model, 60, 8), second = recorded(model, 45, 9);
  first.y(1, 12) = std::numeric_limits<double>::quiet_NaN();
  model.A(0, 1) += 0.05;
  model.B(0, 0) -= 0.2;
  const SimulationErrorProblem errors({first.y, second.y}, {first.u, second.u});
  const VectorXd theta = simulation_parameters(model);
  const MatrixXd all = MatrixXd::Identity(theta.size(), theta.size());
  VectorXd r;
  MatrixXd J;
  ASSERT_TRUE(errors.evaluate(model, all, r, &J));
  ASSERT_EQ(r.size(), errors.residuals());
  EXPECT_NEAR(r.squaredNorm(), squares_of(model, {first, second}), 1e-10);
  // The derivative of Kaufman gives the gradient exactly: J' r.
  const VectorXd gradient = 2.0 * J.transpose() * r;
  constexpr double kStep = 1e-6;
  for (Index k = 0; k < theta.size(); ++k) {
    const auto at = [&](double step) {
      const VectorXd there = theta + step * VectorXd::Unit(theta.size(), k);
      return squares_of(with_simulation_parameters(model, there), {first, second});
    };
    EXPECT_NEAR(gradient[k], (at(kStep) - at(-kStep)) / (2.0 * kStep), 1e-5 * gradient.norm()) << k;
  }
}

TEST(SimulationErrorProblem, DirectionsAreNoChangeOfBasis) {
  const InnovationForm model = two_states();
  const MatrixXd directions = simulation_coordinates(model);
  EXPECT_EQ(directions.cols(), directions.rows() - 4);
  constexpr double kStep = 1e-6;
  MatrixXd T = MatrixXd::Identity(2, 2);
  T += kStep * MatrixXd{{0.3, -0.7}, {0.5, 0.2}};
  InnovationForm turned = model;
  turned.A = T * model.A * T.inverse();
  turned.B = T * model.B;
  turned.C = model.C * T.inverse();
  const VectorXd moved = (simulation_parameters(turned) - simulation_parameters(model)) / kStep;
  EXPECT_LT((directions.transpose() * moved).norm(), 1e-5 * moved.norm());
}

TEST(PredictionErrorProblem, GainDirectionsMoveTheGainAlone) {
  const InnovationForm model = two_states();
  const VectorXd step{{0.1, -0.2, 0.05, 0.3}};
  const InnovationForm moved =
      with_predictor_parameters(model, predictor_parameters(model) + gain_directions(model) * step);
  EXPECT_LT((moved.K.reshaped() - model.K.reshaped() - step).norm(), 1e-14);
  EXPECT_LT((moved.A - model.A).norm() + (moved.B - model.B).norm() + (moved.C - model.C).norm() +
                (moved.D - model.D).norm(),
            1e-14);
}

TEST(InnovationForm, FirstStateOfASimulation) {
  const InnovationForm model = two_states();
  const VectorXd x0{{0.7, -1.2}};
  const MatrixXd u = MatrixXd::Ones(1, 40);
  MatrixXd y = simulated_outputs(model, u, x0);
  y(0, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_LT((initial_state(model, y, u, 30) - x0).norm(), 1e-12);
}

// The autocovariances of what the innovations make of y, by Lyapunov's equation.
std::vector<MatrixXd> autocovariances(const InnovationForm& model) {
  const MatrixXd Q = model.K * model.sigma * model.K.transpose();
  MatrixXd P = Q;
  for (int k = 0; k < 2000; ++k) P = (model.A * P * model.A.transpose() + Q).eval();
  std::vector<MatrixXd> out{model.C * P * model.C.transpose() + model.sigma};
  MatrixXd cross = model.A * P * model.C.transpose() + model.K * model.sigma;
  for (int k = 0; k < 5; ++k) {
    out.push_back(model.C * cross);
    cross = (model.A * cross).eval();
  }
  return out;
}

TEST(InnovationForm, AStablePredictorHasTheSameSpectrum) {
  InnovationForm model = two_states();
  model.K *= 6.0;
  ASSERT_GT(spectral_radius(model.A - model.K * model.C), 1.0);
  const InnovationForm stable = with_stable_predictor(model);
  EXPECT_LT(spectral_radius(stable.A - stable.K * stable.C), 1.0);
  const auto before = autocovariances(model), after = autocovariances(stable);
  for (std::size_t k = 0; k < before.size(); ++k) {
    EXPECT_LT((before[k] - after[k]).norm(), 1e-8 * before[0].norm());
  }
}

TEST(InnovationForm, PolesGoOntoTheCircleAlongTheirDirections) {
  InnovationForm model = two_states();
  model.A = MatrixXd{{1.1, 0.0}, {0.0, 0.5}};
  const InnovationForm within = with_poles_within(model, 0.99);
  EXPECT_LT((within.A - MatrixXd{{0.99, 0.0}, {0.0, 0.5}}).norm(), 1e-12);
}

}  // namespace
}  // namespace identikal
