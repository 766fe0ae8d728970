#include "lib/statistics/autoregression.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include <Eigen/Cholesky>

#include "lib/base/constants.h"
#include "lib/statistics/autocorrelation.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Definite beyond rounding, which is relative to the diagonal of `whole`.
bool definite(const MatrixXd& M, const MatrixXd& whole) {
  if (!M.allFinite()) return false;
  const Eigen::LLT<MatrixXd> llt(M);
  return llt.info() == Eigen::Success &&
         (llt.matrixLLT().diagonal().array().square() > 1e-12 * whole.diagonal().array()).all();
}

double log_determinant(const MatrixXd& M) {
  return 2.0 * Eigen::LLT<MatrixXd>(M).matrixLLT().diagonal().array().log().sum();
}

double multiple(Penalty penalty, double N) {
  switch (penalty) {
    case Penalty::aic:
      return 2.0;
    case Penalty::bic:
      return std::log(N);
    case Penalty::hq:
      return 2.0 * std::log(std::log(N));
    case Penalty::edc:
      break;
  }
  return std::sqrt(N);
}

}  // namespace

Autoregressions yule_walker(const Autocovariances& Y) {
  Autoregressions out;
  if (Y.empty() || !definite(Y[0], Y[0])) return out;
  // Forwards A and S predict from the past, backwards B and V from the future.
  MatrixXd S = Y[0], V = Y[0];
  std::vector<MatrixXd> A, B;
  out.S.push_back(S);
  out.A.push_back(A);
  for (std::size_t m = 1; m < Y.size(); ++m) {
    MatrixXd gap = Y[m];
    for (std::size_t k = 0; k < A.size(); ++k) gap -= A[k] * Y[m - 1 - k];
    const MatrixXd forward = V.llt().solve(gap.transpose()).transpose();
    const MatrixXd backward = S.llt().solve(gap).transpose();
    std::vector<MatrixXd> A_next = A, B_next = B;
    for (std::size_t k = 0; k < A.size(); ++k) {
      A_next[k] -= forward * B[A.size() - 1 - k];
      B_next[k] -= backward * A[A.size() - 1 - k];
    }
    A_next.push_back(forward);
    B_next.push_back(backward);
    A = std::move(A_next);
    B = std::move(B_next);
    S -= forward * gap.transpose();
    V -= backward * gap;
    S = (0.5 * (S + S.transpose())).eval();
    V = (0.5 * (V + V.transpose())).eval();
    if (!definite(S, Y[0]) || !definite(V, Y[0])) break;
    out.S.push_back(S);
    out.A.push_back(A);
  }
  return out;
}

OrderChoice autoregressive_order(const Autoregressions& models, Index samples, Penalty penalty) {
  if (models.S.empty()) {
    throw std::invalid_argument("autoregressive_order: the covariance is not positive definite");
  }
  if (samples < 3) {
    throw std::invalid_argument("autoregressive_order: " + std::to_string(samples) + " samples");
  }
  const auto N = static_cast<double>(samples), l = static_cast<double>(models.S[0].rows());
  const double start = log_determinant(models.S[0]);
  OrderChoice out;
  out.criterion.resize(static_cast<Index>(models.S.size()));
  out.least = kNaN;
  for (Index m = 0; m < out.criterion.size(); ++m) {
    out.criterion[m] = N * (log_determinant(models.S[m]) - start) +
                       static_cast<double>(m) * l * l * multiple(penalty, N);
  }
  if (out.criterion.size() > 1) out.least = out.criterion.tail(out.criterion.size() - 1).minCoeff();
  out.criterion.minCoeff(&out.order);
  return out;
}

Eigen::VectorXd share_explained_by_past(const Autoregressions& models, Eigen::Index samples) {
  if (models.S.empty()) return {};
  const Eigen::Index order = static_cast<Eigen::Index>(models.S.size()) - 1;
  const Eigen::VectorXd all = models.S.front().diagonal(), left = models.S.back().diagonal();
  const double by_chance = static_cast<double>(order * all.size()) /
                           static_cast<double>(std::max<Eigen::Index>(samples, 1));
  return (1.0 - left.array() / all.array() - by_chance).cwiseMax(0.0).matrix();
}

double independent_samples(const Eigen::Ref<const Eigen::VectorXd>& e) {
  constexpr Eigen::Index kHighestOrder = 20;
  const Eigen::Index N = e.size(), samples = (e.array() == e.array()).count();
  const Eigen::Index order = std::min(kHighestOrder, N / 10);
  if (samples < 3 || order < 1) return 0.0;
  const Autocovariances Y = sample_autocovariances(e.transpose(), order + 1, Divisor::samples);
  for (const Eigen::MatrixXd& each : Y) {
    if (!each.allFinite()) return 0.0;
  }
  const Autoregressions models = yule_walker(Y);
  if (models.S.empty()) return 0.0;
  const auto chosen =
      static_cast<std::size_t>(autoregressive_order(models, samples, Penalty::aic).order);
  const std::vector<Eigen::MatrixXd>& A = models.A[chosen];
  std::vector<double> rho = {1.0};
  double sum = 0.0;
  for (std::size_t k = 1; k < static_cast<std::size_t>(N); ++k) {
    double next = 0.0;
    if (k <= chosen) {
      next = Y[k](0, 0) / Y[0](0, 0);
    } else {
      for (std::size_t j = 0; j < chosen; ++j) next += A[j](0, 0) * rho[k - 1 - j];
    }
    rho.push_back(next);
    sum += next * next;
  }
  return static_cast<double>(samples) / (1.0 + 2.0 * sum);
}

}  // namespace identikal
