#include "identify/black_box/internal/characteristics.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "identify/black_box/internal/likeliest_prior.h"
#include "identify/estimate/distribution.h"
#include "lib/subspace/prediction_error.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;
using Complex = std::complex<double>;

// d f / d theta of a quantity whose change is w' dA v with A = (A - K C) + K C.
VectorXcd pole_gradient(const InnovationForm& model, const VectorXcd& w, const VectorXcd& v) {
  const Index n = model.states(), p = model.outputs(), q = p + model.inputs();
  VectorXcd out = VectorXcd::Zero(predictor_parameters(model).size());
  const VectorXcd Cv = model.C * v, Kw = model.K.transpose() * w;
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < n; ++i) out[j * n + i] = w[i] * v[j];
  }
  for (Index c = 0; c < p; ++c) {
    for (Index i = 0; i < n; ++i) out[n * n + c * n + i] = w[i] * Cv[c];
  }
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < p; ++i) out[n * n + n * q + j * p + i] = Kw[i] * v[j];
  }
  return out;
}

double root_of_form(const VectorXd& g, const MatrixXd& covariance) {
  return covariance.size() == 0 ? kNone : std::sqrt(std::max(0.0, g.dot(covariance * g)));
}

BlackBox::Pole in_continuous_time(Complex pole, double dt) {
  BlackBox::Pole out;
  out.real = pole.real();
  out.imaginary = pole.imag();
  if (std::abs(pole) < 1e-12) return out;  // a delay
  const Complex s = std::log(pole) / dt;
  out.frequency = std::abs(s);
  if (out.frequency > 0.0) out.damping = -s.real() / out.frequency;
  if (s.real() < 0.0) out.time_constant = -1.0 / s.real();
  return out;
}

}  // namespace

MatrixXd predictor_covariance(const InnovationForm& model, const LaggedProducts& sums) {
  VectorXd r;
  MatrixXd J, sigma = model.sigma;
  sigma.diagonal() *= 1.0 + 1e-12;
  if (sigma.llt().info() != Eigen::Success) return {};
  const PredictionErrorProblem errors(sums, sigma);
  if (!errors.evaluate(model, r, &J)) return {};
  const MatrixXd directions = local_coordinates(model), along = J * directions;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> modes(along.transpose() * along);
  const VectorXd& values = modes.eigenvalues();
  if (!(values[0] > 1e-12 * values[values.size() - 1])) return {};
  const MatrixXd V = directions * modes.eigenvectors();
  return V * values.cwiseInverse().asDiagonal() * V.transpose();
}

std::vector<BlackBox::Pole> poles_with_errors(const InnovationForm& model,
                                              const MatrixXd& covariance, double dt) {
  const Eigen::EigenSolver<MatrixXd> modes(model.A);
  const Eigen::MatrixXcd V = modes.eigenvectors(), W = V.inverse();
  std::vector<BlackBox::Pole> out;
  for (Index k = 0; k < model.states(); ++k) {
    const Complex pole = modes.eigenvalues()[k];
    if (pole.imag() < 0.0) continue;
    out.push_back(in_continuous_time(pole, dt));
    const VectorXcd g = pole_gradient(model, W.row(k).transpose(), V.col(k));
    if (!g.allFinite()) continue;
    out.back().real_se = root_of_form(g.real(), covariance);
    if (pole.imag() > 0.0) out.back().imaginary_se = root_of_form(g.imag(), covariance);
  }
  std::stable_sort(out.begin(), out.end(), [](const BlackBox::Pole& a, const BlackBox::Pole& b) {
    return std::hypot(a.real - 1.0, a.imaginary) < std::hypot(b.real - 1.0, b.imaginary);
  });
  return out;
}

// G = C X + D, X = (I - A)^-1 B; dG = dC X + C (I - A)^-1 (dA X + dB) + dD, of the predictor's own matrices
// A = Abar + K C, B = Bbar + K D.
SteadyGain steady_gain(const InnovationForm& model, const MatrixXd& covariance) {
  const Index n = model.states(), p = model.outputs(), m = model.inputs(), q = p + m;
  SteadyGain out{MatrixXd::Constant(p, m, kNone), MatrixXd::Constant(p, m, kNone)};
  if (m == 0) return out;
  const MatrixXd M = MatrixXd::Identity(n, n) - model.A;
  const Eigen::FullPivLU<MatrixXd> lu(M);
  if (lu.rcond() < 1e-10) return out;
  const MatrixXd X = lu.solve(model.B);
  const MatrixXd L =
      M.transpose().fullPivLu().solve(model.C.transpose()).transpose();  // C (I - A)^-1
  out.value = model.C * X + model.D;
  const Index input = n * n, at_C = input + n * q, at_D = at_C + p * n;
  for (Index i = 0; i < p; ++i) {
    const VectorXd l = L.row(i), k = model.K.transpose() * l;
    for (Index j = 0; j < m; ++j) {
      const VectorXd x = X.col(j), y = out.value.col(j);
      VectorXd g = VectorXd::Zero(predictor_parameters(model).size());
      for (Index b = 0; b < n; ++b) {
        g.segment(b * n, n) = l * x[b];
        for (Index a = 0; a < p; ++a) g[at_C + b * p + a] = ((a == i ? 1.0 : 0.0) + k[a]) * x[b];
      }
      for (Index c = 0; c < p; ++c) g.segment(input + c * n, n) = l * y[c];
      g.segment(input + (p + j) * n, n) = l;
      for (Index a = 0; a < p; ++a) g[at_D + j * p + a] = (a == i ? 1.0 : 0.0) + k[a];
      out.se(i, j) = root_of_form(g, covariance);
    }
  }
  return out;
}

std::vector<long> input_delays(const LaggedProducts& sums) {
  const Index p = sums.outputs, m = sums.inputs, q = p + m, size = sums.gram.rows() - p;
  if (m == 0 || sums.windows < 2 * size) return {};
  const MatrixXd G =
      sums.gram.bottomRightCorner(size, size);  // inputs at lag 0, then all at lags 1 to L
  const Eigen::LDLT<MatrixXd> factor(G);
  const MatrixXd of_y = sums.gram.bottomLeftCorner(size, p);
  const MatrixXd f = factor.solve(of_y), inverse = factor.solve(MatrixXd::Identity(size, size));
  const MatrixXd sigma = (sums.gram.topLeftCorner(p, p) - of_y.transpose() * f) /
                         static_cast<double>(sums.windows - size);
  const Eigen::LDLT<MatrixXd> of_sigma(sigma);
  std::vector<long> out(static_cast<std::size_t>(m), 0);
  for (Index j = 0; j < m; ++j) {
    for (Index d = 1; d <= sums.lags; ++d) {
      const auto lags = Eigen::seqN(j, d, q);
      const MatrixXd h = f(lags, Eigen::all), V = inverse(lags, lags);
      const double wald = (V.ldlt().solve(h) * of_sigma.solve(h.transpose())).trace();
      if (!(chi_square_upper_tail(wald, static_cast<double>(d * p)) > 0.01)) break;
      out[static_cast<std::size_t>(j)] = d;
    }
  }
  return out;
}

std::vector<BlackBox::ImpulseResponse> impulse_responses(const ScaledRecordings& recordings,
                                                         const Dataset& channels, Index rows) {
  const Index p = recordings.y.front().rows(), m = recordings.u.front().rows(), q = p + m;
  if (m == 0) return {};
  constexpr Index kMostColumns = 200;
  const Index lags = std::min({rows, recordings.rows() / 4, kMostColumns / m});
  if (lags < 2) return {};
  constexpr Index kEnough = 200000;
  const ScaledRecordings rows_used = first_rows(recordings, kEnough);
  const PredictorRegression regression(lagged_products(rows_used.y, rows_used.u, lags),
                                       PredictorRegression::On::inputs);
  const PredictorPrior prior = likeliest_impulse_prior(regression);
  const Predictor value = regression.estimate(prior), error = regression.standard_errors(prior);
  const auto response = [&](const Predictor& of, Index i, Index j) {
    VectorXd out(lags + 1);
    out[0] = of.D(i, j);
    for (Index k = 1; k <= lags; ++k) out[k] = of.H(i, (k - 1) * q + p + j);
    return VectorXd(out * (recordings.point.y_sd[i] / recordings.point.u_sd[j]));
  };
  std::vector<BlackBox::ImpulseResponse> all;
  for (Index i = 0; i < p; ++i) {
    for (Index j = 0; j < m; ++j) {
      all.push_back({channels.inputs[static_cast<std::size_t>(j)].name,
                     channels.outputs[static_cast<std::size_t>(i)].name, response(value, i, j),
                     response(error, i, j)});
    }
  }
  return all;
}

}  // namespace identikal
