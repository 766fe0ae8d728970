#include "identify/black_box/internal/continuous_time.h"

#include <cmath>
#include <complex>
#include <optional>

#include <Eigen/Eigenvalues>
#include <unsupported/Eigen/MatrixFunctions>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

constexpr double kPartOfMove = 1e-3;  // for differences

// s^n + a_1 s^(n-1) + ...: 1, a_1, ...
VectorXd characteristic_polynomial(const MatrixXd& A) {
  const VectorXcd roots = A.eigenvalues();
  VectorXcd out = VectorXcd::Zero(A.rows() + 1);
  out[0] = 1.0;
  for (Index k = 0; k < roots.size(); ++k) {
    for (Index i = k + 1; i > 0; --i) out[i] -= roots[k] * out[i - 1];
  }
  return out.real();
}

bool has_real_logarithm(const MatrixXd& A) {
  constexpr double kNearZero = 1e-6, kNearAxis = 1e-9;
  for (const std::complex<double>& pole : A.eigenvalues()) {
    const double size = std::abs(pole);
    if (size < kNearZero || (pole.real() < 0.0 && std::abs(pole.imag()) < kNearAxis * size)) {
      return false;
    }
  }
  return true;
}

// Coefficients of falling powers of s times the time between two rows, the denominator's first.
struct Coefficients {
  VectorXd denominator;
  std::vector<VectorXd> numerators;  // inputs of the first output, of the second, ...
};

// det(s I - A + B C) = det(s I - A) (1 + C (s I - A)^-1 B).
std::optional<Coefficients> coefficients_of(const MatrixXd& A, const MatrixXd& B, const MatrixXd& C,
                                            const MatrixXd& D) {
  const Index n = A.rows(), m = B.cols();
  if (!has_real_logarithm(A)) return std::nullopt;
  MatrixXd held = MatrixXd::Identity(n + m, n + m);
  held.topRows(n) << A, B;
  const MatrixXd rate = held.log();
  if (!rate.allFinite()) return std::nullopt;
  const MatrixXd A_rate = rate.topLeftCorner(n, n), B_rate = rate.topRightCorner(n, m);
  Coefficients out{characteristic_polynomial(A_rate), {}};
  for (Index i = 0; i < C.rows(); ++i) {
    for (Index j = 0; j < m; ++j) {
      VectorXd numerator =
          characteristic_polynomial(A_rate - B_rate.col(j) * C.row(i)) - out.denominator;
      out.numerators.push_back(numerator + D(i, j) * out.denominator);
    }
  }
  return out;
}

// Adds the squares of what one move does.
void add_squares(const InnovationForm& model, const Move& move, Coefficients& to) {
  const auto at = [&](double part) {
    return coefficients_of(model.A + part * move.A, model.B + part * move.B,
                           model.C + part * move.C, model.D + part * move.D);
  };
  const auto up = at(kPartOfMove), down = at(-kPartOfMove);
  if (!up || !down) {
    to.denominator.setConstant(kNone);
    for (VectorXd& each : to.numerators) each.setConstant(kNone);
    return;
  }
  constexpr double kBetween = 2.0 * kPartOfMove;
  to.denominator += ((up->denominator - down->denominator) / kBetween).cwiseAbs2();
  for (std::size_t k = 0; k < to.numerators.size(); ++k) {
    to.numerators[k] += ((up->numerators[k] - down->numerators[k]) / kBetween).cwiseAbs2();
  }
}

// Of s in place of s times dt, the denominator's first coefficient 1.
VectorXd per_second(const VectorXd& of, double dt) {
  VectorXd out = of;
  for (Index k = 0; k < out.size(); ++k) out[k] /= std::pow(dt, static_cast<double>(k));
  return out;
}

}  // namespace

std::vector<BlackBox::TransferFunction> transfer_functions(const InnovationForm& model,
                                                           const std::vector<Move>& moves,
                                                           const OperatingPoint& point,
                                                           const Dataset& channels) {
  const auto found = coefficients_of(model.A, model.B, model.C, model.D);
  if (!found || model.inputs() == 0) return {};
  Coefficients squares = *found;
  const double none = moves.empty() ? kNone : 0.0;
  squares.denominator.setConstant(none);
  for (VectorXd& each : squares.numerators) each.setConstant(none);
  for (const Move& move : moves) add_squares(model, move, squares);
  std::vector<BlackBox::TransferFunction> out;
  for (Index i = 0; i < model.outputs(); ++i) {
    for (Index j = 0; j < model.inputs(); ++j) {
      const auto k = static_cast<std::size_t>(i * model.inputs() + j);
      const double unit = point.y_sd[i] / point.u_sd[j];
      out.push_back({channels.inputs[static_cast<std::size_t>(j)].name,
                     channels.outputs[static_cast<std::size_t>(i)].name,
                     unit * per_second(found->numerators[k], channels.dt),
                     unit * per_second(squares.numerators[k].cwiseSqrt(), channels.dt),
                     per_second(found->denominator, channels.dt),
                     per_second(squares.denominator.cwiseSqrt(), channels.dt)});
    }
  }
  return out;
}

}  // namespace identikal
