#include "identify/black_box/internal/characteristics.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "identify/estimate/distribution.h"
#include "lib/subspace/prediction_error.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;
using Complex = std::complex<double>;

// theta of predictor_parameters() along a direction; A = (A - K C) + K C and B likewise by the rule of products.
Move along(const InnovationForm& model, const VectorXd& theta, const VectorXd& direction) {
  const InnovationForm d = with_predictor_parameters(model, theta + direction);
  const MatrixXd K = d.K - model.K, C = d.C - model.C, D = d.D - model.D;
  // The predictor's parameters are these products less what is of second order.
  return {d.A - model.A - K * C, d.B - model.B - K * D, C, D};
}

// A pole in continuous time, and what a move of it by dz there does to its frequency, damping and time constant.
struct ContinuousPole {
  BlackBox::Pole pole;
  Complex s, per_z;  // ds/dz
};

ContinuousPole in_continuous_time(Complex z, double dt) {
  ContinuousPole out;
  out.pole.real = z.real();
  out.pole.imaginary = z.imag();
  if (std::abs(z) < 1e-12) return out;  // a delay
  out.s = std::log(z) / dt;
  out.per_z = 1.0 / (z * dt);
  out.pole.frequency = std::abs(out.s);
  if (out.pole.frequency > 0.0) out.pole.damping = -out.s.real() / out.pole.frequency;
  if (out.s.real() < 0.0) out.pole.time_constant = -1.0 / out.s.real();
  return out;
}

// @param moves  of the pole, by one standard deviation each along independent directions
BlackBox::Pole with_errors(const ContinuousPole& at, const VectorXcd& moves) {
  BlackBox::Pole out = at.pole;
  if (moves.size() == 0 || !moves.allFinite()) return out;
  out.real_se = moves.real().norm();
  if (out.imaginary > 0.0) out.imaginary_se = moves.imag().norm();
  const double frequency = out.frequency;
  if (!(frequency > 0.0)) return out;
  const VectorXcd s = moves * at.per_z;
  const VectorXd of_frequency = (s * std::conj(at.s)).real() / frequency;
  out.frequency_se = of_frequency.norm();
  if (out.imaginary > 0.0)
    out.damping_se = ((s.real() + out.damping * of_frequency) / frequency).norm();
  if (at.s.real() < 0.0) out.time_constant_se = s.real().norm() / (at.s.real() * at.s.real());
  return out;
}

void sort_by_frequency(std::vector<BlackBox::Pole>& poles) {
  std::stable_sort(
      poles.begin(), poles.end(), [](const BlackBox::Pole& a, const BlackBox::Pole& b) {
        return std::hypot(a.real - 1.0, a.imaginary) < std::hypot(b.real - 1.0, b.imaginary);
      });
}

// Zeros of q^n + a_1 q^(n-1) + ..., one of each conjugate pair.
// @param root  of the covariance of a, empty where it is not known
void add_zeros(const VectorXd& a, const MatrixXd& root, double dt,
               std::vector<BlackBox::Pole>& out) {
  const Index n = a.size();
  if (n == 0) return;
  const VectorXcd zeros = zeros_of(a);
  for (Index k = 0; k < n; ++k) {
    const Complex z = zeros[k];
    if (z.imag() < 0.0) continue;
    Complex slope = 1.0;
    for (Index i = 0; i < n; ++i) {
      if (i != k) slope *= z - zeros[i];
    }
    VectorXcd gradient(n);
    for (Index i = 0; i < n; ++i) gradient[i] = -std::pow(z, n - 1 - i) / slope;
    const VectorXcd moves =
        root.size() == 0 ? VectorXcd() : VectorXcd(root.transpose().cast<Complex>() * gradient);
    out.push_back(with_errors(in_continuous_time(z, dt), moves));
  }
}

MatrixXd root_of(const MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> modes(covariance);
  return modes.eigenvectors() * modes.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

bool all_known(const std::vector<MatrixXd>& covariances) {
  return std::all_of(covariances.begin(), covariances.end(),
                     [](const MatrixXd& each) { return each.size() > 0; });
}

}  // namespace

std::vector<Move> independent_moves(const InnovationForm& model, const LaggedProducts& sums) {
  VectorXd r;
  MatrixXd J, sigma = model.sigma;
  sigma.diagonal() *= 1.0 + 1e-12;
  if (sigma.llt().info() != Eigen::Success) return {};
  const PredictionErrorProblem errors(sums, sigma);
  if (!errors.evaluate(model, r, &J)) return {};
  const MatrixXd directions = local_coordinates(model), slopes = J * directions;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> modes(slopes.transpose() * slopes);
  const VectorXd& values = modes.eigenvalues();
  if (!(values[0] > 1e-12 * values[values.size() - 1])) return {};
  const MatrixXd roots =
      directions * modes.eigenvectors() * values.cwiseSqrt().cwiseInverse().asDiagonal();
  const VectorXd theta = predictor_parameters(model);
  std::vector<Move> out;
  for (Index k = 0; k < roots.cols(); ++k) out.push_back(along(model, theta, roots.col(k)));
  return out;
}

// The form is at most of second degree in the coefficients: central differences have no error but rounding.
std::vector<Move> independent_moves(const std::vector<PolynomialModel>& models,
                                    const std::vector<MatrixXd>& covariances) {
  if (!all_known(covariances)) return {};
  std::vector<Move> out;
  const auto p = static_cast<Index>(models.size());
  const MatrixXd sigma = MatrixXd::Identity(p, p);
  for (std::size_t i = 0; i < models.size(); ++i) {
    const MatrixXd root = root_of(covariances[i]);
    const VectorXd theta = coefficients(models[i]);
    for (Index k = 0; k < root.cols(); ++k) {
      std::vector<PolynomialModel> after = models, before = models;
      after[i] = with_coefficients(models[i], theta + root.col(k));
      before[i] = with_coefficients(models[i], theta - root.col(k));
      const InnovationForm a = innovation_form(after, sigma), b = innovation_form(before, sigma);
      out.push_back({(a.A - b.A) / 2.0, (a.B - b.B) / 2.0, (a.C - b.C) / 2.0, (a.D - b.D) / 2.0});
    }
  }
  return out;
}

std::vector<BlackBox::Pole> poles_with_errors(const InnovationForm& model,
                                              const std::vector<Move>& moves, double dt) {
  const Eigen::EigenSolver<MatrixXd> modes(model.A);
  const Eigen::MatrixXcd V = modes.eigenvectors(), W = V.inverse();
  std::vector<BlackBox::Pole> out;
  for (Index k = 0; k < model.states(); ++k) {
    const Complex pole = modes.eigenvalues()[k];
    if (pole.imag() < 0.0) continue;
    VectorXcd of_pole(static_cast<Index>(moves.size()));
    for (Index i = 0; i < of_pole.size(); ++i) {
      const MatrixXd& A = moves[static_cast<std::size_t>(i)].A;
      of_pole[i] = (W.row(k) * A.cast<Complex>() * V.col(k))(0, 0);
    }
    out.push_back(with_errors(in_continuous_time(pole, dt), of_pole));
  }
  sort_by_frequency(out);
  return out;
}

std::vector<BlackBox::Pole> poles_with_errors(const std::vector<PolynomialModel>& models,
                                              const std::vector<MatrixXd>& covariances, double dt) {
  std::vector<BlackBox::Pole> out;
  for (std::size_t i = 0; i < models.size(); ++i) {
    const PolynomialModel& model = models[i];
    const bool known = covariances[i].size() > 0;
    const MatrixXd root = known ? root_of(covariances[i]) : MatrixXd();
    Index at = 0;
    const auto add = [&](const VectorXd& polynomial, bool has_poles) {
      if (has_poles)
        add_zeros(polynomial, known ? MatrixXd(root.middleRows(at, polynomial.size())) : MatrixXd(),
                  dt, out);
      at += polynomial.size();
    };
    add(model.A, true);
    for (const VectorXd& each : model.B) add(each, false);
    add(model.C, false);
    add(model.D, true);
    for (const VectorXd& each : model.F) add(each, true);
  }
  sort_by_frequency(out);
  return out;
}

// G = C X + D, X = (I - A)^-1 B; dG = dC X + C (I - A)^-1 (dA X + dB) + dD.
SteadyGain steady_gain(const InnovationForm& model, const std::vector<Move>& moves) {
  const Index n = model.states(), p = model.outputs(), m = model.inputs();
  SteadyGain out{MatrixXd::Constant(p, m, kNone), MatrixXd::Constant(p, m, kNone)};
  if (m == 0) return out;
  const Eigen::FullPivLU<MatrixXd> lu(MatrixXd::Identity(n, n) - model.A);
  if (lu.rcond() < 1e-10) return out;
  const MatrixXd X = lu.solve(model.B);
  out.value = model.C * X + model.D;
  if (moves.empty()) return out;
  MatrixXd variance = MatrixXd::Zero(p, m);
  for (const Move& d : moves) {
    const MatrixXd of_gain = d.C * X + model.C * lu.solve(d.A * X + d.B) + d.D;
    variance += of_gain.cwiseAbs2();
  }
  out.se = variance.cwiseSqrt();
  return out;
}

std::vector<BlackBox::Delay> input_delays(const LaggedProducts& sums) {
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
  std::vector<BlackBox::Delay> out(static_cast<std::size_t>(m));
  for (Index j = 0; j < m; ++j) {
    BlackBox::Delay& delay = out[static_cast<std::size_t>(j)];
    for (Index d = 1; d <= sums.lags; ++d) {
      const auto lags = Eigen::seqN(j, d, q);
      const MatrixXd h = f(lags, Eigen::all), V = inverse(lags, lags);
      const double wald = (V.ldlt().solve(h) * of_sigma.solve(h.transpose())).trace();
      if (!(chi_square_upper_tail(wald, static_cast<double>(d * p)) > 0.01)) break;
      delay.rows = d;
    }
    const auto early = Eigen::seqN(j, delay.rows, q);
    if (delay.rows == 0 || delay.rows > sums.lags) continue;
    const MatrixXd responses = f(Eigen::seqN(j, sums.lags + 1, q), Eigen::all);
    const VectorXd largest = responses.cwiseAbs().colwise().maxCoeff().transpose();
    const VectorXd sd = sigma.diagonal().cwiseSqrt().cwiseQuotient(largest);
    delay.before = 2.0 * std::sqrt(inverse.diagonal()(early).maxCoeff()) * sd.minCoeff();
  }
  return out;
}

}  // namespace identikal
