#include "identify/black_box/internal/polynomial_fit.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include "lib/polynomial/polynomial_errors.h"
#include "lib/statistics/autocorrelation.h"
#include "lib/statistics/autoregression.h"
#include "solvers/solve.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

// A model and what was before the recordings, with the sum of squares that they leave.
struct Fitted {
  PolynomialModel model;
  VectorXd unknowns;
  double sum = std::numeric_limits<double>::infinity();
};

Fitted begun(const PolynomialErrors& errors, const PolynomialModel& model) {
  Fitted out{model, errors.start(model)};
  out.sum = errors.sum_of_squares(model, out.unknowns);
  return out;
}

Fitted at(const PolynomialErrors& errors, const Fitted& from, const VectorXd& unknowns) {
  Fitted out{with_coefficients(from.model, unknowns.head(from.model.parameters())), unknowns};
  out.sum = errors.sum_of_squares(out.model, unknowns);
  return out;
}

// The least squares of the slopes here: the answer itself where the errors are linear in all unknowns.
Fitted after_one_step(const PolynomialErrors& errors, const Fitted& from) {
  MatrixXd R;
  if (!errors.evaluate(from.model, from.unknowns, R)) return from;
  const Index n = from.unknowns.size();
  const VectorXd step = R.leftCols(n).completeOrthogonalDecomposition().solve(R.col(n));
  const Fitted out = at(errors, from, from.unknowns - step);
  return out.sum < from.sum ? out : from;
}

Fitted searched(const PolynomialErrors& errors, const Fitted& from) {
  if (!std::isfinite(from.sum)) return from;
  const Index n = from.unknowns.size();
  LeastSquares problem;
  MatrixXd R;
  problem.evaluate = [&](const VectorXd& x, VectorXd& r, LeastSquares::RowMatrix* J) {
    r.setZero(n + 1);
    if (J == nullptr) {
      r[n] = std::sqrt(errors.sum_of_squares(from.model, x));
      return std::isfinite(r[n]);
    }
    if (!errors.evaluate(from.model, x, R)) return false;
    r = R.col(n);
    *J = R.leftCols(n);
    return true;
  };
  problem.residuals = n + 1;
  problem.upper.setConstant(n, std::numeric_limits<double>::infinity());
  problem.lower = -problem.upper;
  SolverOptions options;
  options.max_iterations = 60;
  options.function_tolerance = 1e-9;
  const Fitted out = at(errors, from, solve(problem, from.unknowns, options).x);
  return out.sum < from.sum ? out : from;
}

// Zeros outside of the unit circle mirrored into it, away from its rim.
VectorXd stable(const VectorXd& a) {
  VectorXcd zeros = zeros_of(a);
  for (std::complex<double>& zero : zeros) {
    constexpr double kRim = 0.98;
    if (std::abs(zero) > 1.0) zero = 1.0 / std::conj(zero);
    if (std::abs(zero) > kRim) zero *= kRim / std::abs(zero);
  }
  return with_zeros(zeros);
}

VectorXd cut(const VectorXd& a, Index size) {
  VectorXd out = VectorXd::Zero(size);
  const Index both = std::min(size, a.size());
  out.head(both) = a.head(both);
  return out;
}

// The structure with what a state-space model has for an output: its denominator, the numerators from its impulse responses,
// the zeros of its noise.
PolynomialModel from_states(PolynomialModel structure, const InnovationForm& states, Index output) {
  const VectorXd a = with_zeros(states.A.eigenvalues());
  const VectorXd denominator = stable(a);
  const bool own = structure.A.size() > 0;
  if (own) structure.A = cut(a, structure.A.size());
  structure.C = own ? cut(stable(with_zeros((states.A - states.K * states.C).eval().eigenvalues())),
                          structure.C.size())
                    : VectorXd::Zero(structure.C.size());
  for (std::size_t j = 0; j < structure.B.size(); ++j) {
    structure.F[j] = cut(denominator, structure.F[j].size());
    const VectorXd& below = own ? structure.A : structure.F[j];
    const Index last = structure.delay[j] + structure.B[j].size();
    VectorXd h(last), x = states.B.col(static_cast<Index>(j));
    for (Index k = 0; k < last; ++k) {
      h[k] = k == 0 ? states.D(output, static_cast<Index>(j)) : states.C.row(output).dot(x);
      if (k > 0) x = (states.A * x).eval();
    }
    for (Index k = 0; k < structure.B[j].size(); ++k) {
      const Index lag = structure.delay[j] + k;
      double b = h[lag];
      for (Index i = 1; i <= std::min(lag, below.size()); ++i) b += below[i - 1] * h[lag - i];
      structure.B[j][k] = b;
    }
  }
  return structure;
}

PolynomialModel without_noise(PolynomialModel model) {
  model.C.resize(0);
  model.D.resize(0);
  return model;
}

// The ARX model as a start: its A is the denominator of all that the structure has.
PolynomialModel from_arx(PolynomialModel structure, const PolynomialErrors& errors) {
  PolynomialModel arx = without_noise(structure);
  const Index order = std::max(structure.A.size(), structure.F.empty() ? 0 : structure.F[0].size());
  arx.A = VectorXd::Zero(order);
  for (VectorXd& each : arx.F) each.resize(0);
  const PolynomialModel found = after_one_step(errors, begun(errors, arx)).model;
  if (structure.A.size() > 0) structure.A = found.A;
  structure.B = found.B;
  for (VectorXd& each : structure.F) each = cut(stable(found.A), each.size());
  return structure;
}

const Fitted& better(const Fitted& a, const Fitted& b) { return b.sum < a.sum ? b : a; }

// From all starts with white noise of the output, then D and after it C.
Fitted with_own_noise(const PolynomialErrors& errors, const PolynomialModel& structure,
                      const InnovationForm& states, Index output) {
  const PolynomialModel plain = without_noise(structure);
  const Fitted first = searched(errors, begun(errors, from_states(plain, states, output)));
  Fitted best = better(first, searched(errors, begun(errors, from_arx(plain, errors))));
  for (VectorXd PolynomialModel::*polynomial : {&PolynomialModel::D, &PolynomialModel::C}) {
    const Index size = (structure.*polynomial).size();
    if (size == 0 || !std::isfinite(best.sum)) continue;
    Fitted next = best;
    (next.model.*polynomial) = VectorXd::Zero(size);
    // What was before the recordings stays at the end of the unknowns.
    const Index before = best.unknowns.size() - best.model.parameters();
    next.unknowns.resize(next.model.parameters() + before);
    next.unknowns << coefficients(next.model), best.unknowns.tail(before);
    best = searched(errors, next);
  }
  return best;
}

Fitted with_common_noise(const PolynomialErrors& errors, const PolynomialModel& structure,
                         const InnovationForm& states, Index output) {
  const Fitted arx = after_one_step(errors, begun(errors, from_arx(structure, errors)));
  const Fitted first = searched(errors, arx);
  if (structure.C.size() == 0) return first;
  const Fitted second = searched(errors, begun(errors, from_states(structure, states, output)));
  return better(first, second);
}

PolynomialErrors errors_of(const ScaledRecordings& recordings, Index output) {
  std::vector<RowVectorXd> y;
  for (const MatrixXd& each : recordings.y) y.emplace_back(each.row(output));
  return {std::move(y), recordings.u};
}

// Coefficients of e(t) + a_1 e(t-1) + ... = white noise, of the order of least BIC.
VectorXd colour_of(const VectorXd& e) {
  const Index most = std::min<Index>(20, e.size() / 10);
  const Autoregressions all =
      yule_walker(sample_autocovariances(e.transpose(), most, Divisor::samples));
  const auto rows = static_cast<double>(e.size());
  double least = std::numeric_limits<double>::infinity();
  std::size_t best = 0;
  for (std::size_t order = 0; order < all.S.size(); ++order) {
    const double criterion =
        rows * std::log(all.S[order](0, 0)) + static_cast<double>(order) * std::log(rows);
    if (!(criterion < least)) continue;
    least = criterion;
    best = order;
  }
  VectorXd out(static_cast<Index>(best));
  for (std::size_t k = 0; k < best; ++k) out[static_cast<Index>(k)] = -all.A[best][k](0, 0);
  return out;
}

}  // namespace

PolynomialModel polynomials_of(ModelStructure structure, int order, int noise_order,
                               const std::optional<PolynomialOrders>& given,
                               const std::vector<Index>& delays) {
  if (given) return polynomial_model(*given, delays);
  PolynomialOrders orders;
  const Index n = order;
  orders.nb = n;
  switch (structure) {
    case ModelStructure::armax:
      orders.nc = n;
      [[fallthrough]];
    case ModelStructure::arx:
      orders.na = n;
      break;
    case ModelStructure::box_jenkins:
      orders.nc = orders.nd = noise_order;
      [[fallthrough]];
    case ModelStructure::output_error:
      orders.nf = n;
      break;
    case ModelStructure::states:
      break;
  }
  PolynomialModel out = polynomial_model(orders, delays);
  // What answers at once has one coefficient more, as D has beside n states.
  for (std::size_t j = 0; j < delays.size(); ++j) {
    if (delays[j] == 0) out.B[j] = VectorXd::Zero(n + 1);
  }
  return out;
}

std::vector<PolynomialModel> fitted_polynomials(const PolynomialModel& structure,
                                                const InnovationForm& states,
                                                const ScaledRecordings& recordings) {
  // A search on these, and on longer recordings one from its end: so many rows tell where the minimum is.
  constexpr Index kRowsOfSearch = 20000;
  const bool long_one = recordings.rows() > kRowsOfSearch;
  const ScaledRecordings few = first_rows(recordings, kRowsOfSearch);
  const bool common = structure.A.size() > 0 || structure.B.empty();
  std::vector<PolynomialModel> out;
  for (Index i = 0; i < recordings.y.front().rows(); ++i) {
    const PolynomialErrors errors = errors_of(few, i);
    Fitted found = common ? with_common_noise(errors, structure, states, i)
                          : with_own_noise(errors, structure, states, i);
    if (long_one) {
      const PolynomialErrors all = errors_of(recordings, i);
      found = searched(all, begun(all, found.model));
    }
    out.push_back(found.model);
  }
  return out;
}

MatrixXd coefficient_covariance(const PolynomialModel& model, const ScaledRecordings& recordings,
                                Index output) {
  const PolynomialErrors errors = errors_of(first_rows(recordings, kEnoughRows), output);
  const PolynomialErrors::Rows rows =
      errors.in_rows(model, searched(errors, begun(errors, model)).unknowns);
  const Index N = rows.e.size(), P = model.parameters();
  if (N <= P) return {};
  const Eigen::SelfAdjointEigenSolver<MatrixXd> modes(rows.slopes.transpose() * rows.slopes);
  if (!(modes.eigenvalues()[0] > 1e-12 * modes.eigenvalues()[P - 1])) return {};
  const MatrixXd inverse = modes.eigenvectors() * modes.eigenvalues().cwiseInverse().asDiagonal() *
                           modes.eigenvectors().transpose();
  const bool no_noise_model = model.A.size() == 0 && model.C.size() == 0 && model.D.size() == 0;
  const VectorXd a = no_noise_model ? colour_of(rows.e) : VectorXd();
  // Measured rows of all, where N of them are enough for the slopes.
  const auto measured = static_cast<double>(errors_of(recordings, output).rows(model));
  const double degrees = measured / static_cast<double>(N) * static_cast<double>(N - P);
  if (a.size() == 0) {
    return inverse * (rows.e.squaredNorm() / degrees);
  }
  // Slopes through the noise's filter, backwards in time, and its white source.
  MatrixXd filtered = rows.slopes;
  for (Index t = N - 1; t >= 0; --t) {
    for (Index k = 1; k <= std::min(a.size(), N - 1 - t); ++k) {
      filtered.row(t) -= a[k - 1] * filtered.row(t + k);
    }
  }
  VectorXd source = rows.e;
  for (Index k = 1; k <= a.size(); ++k) source.tail(N - k) += a[k - 1] * rows.e.head(N - k);
  const double variance = source.squaredNorm() / degrees;
  return inverse * (filtered.transpose() * filtered) * inverse * variance;
}

}  // namespace identikal
