#include "lib/filter/innovations.h"

#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

const MatrixXd& covariance(const Innovations& run, Index t) {
  return run.Sigma[run.Sigma.size() == 1 ? 0 : static_cast<std::size_t>(t)];
}

void check(const Innovations& run, const Innovations& like) {
  bool fits = run.e.rows() == like.e.rows() && run.e.cols() == like.e.cols() &&
              (run.Sigma.size() == 1 || static_cast<Index>(run.Sigma.size()) == run.e.cols());
  for (const MatrixXd& S : run.Sigma) {
    fits = fits && S.rows() == run.e.rows() && S.cols() == run.e.rows();
  }
  if (!fits) {
    throw std::invalid_argument(
        "innovations_likelihood: e is ny x N and Sigma one or N matrices of ny x ny, in every run");
  }
}

}  // namespace

Likelihood innovations_likelihood(const Innovations& at,
                                  const std::vector<InnovationsBeside>& beside,
                                  MatrixXd* score_products) {
  check(at, at);
  for (const InnovationsBeside& each : beside) {
    check(each.above, at);
    check(each.below, at);
    if (!(each.distance > 0.0)) {
      throw std::invalid_argument("innovations_likelihood: a distance is not above 0");
    }
  }
  const auto k = static_cast<Index>(beside.size());
  Likelihood out;
  out.gradient.setZero(k);
  out.information.setZero(k, k);
  if (score_products != nullptr) score_products->setZero(k, k);
  std::vector<Index> here;
  VectorXd score(k);
  for (Index t = 0; t < at.e.cols(); ++t) {
    here.clear();
    for (Index i = 0; i < at.e.rows(); ++i) {
      if (!std::isnan(at.e(i, t))) here.push_back(i);
    }
    if (here.empty()) continue;
    const auto n = static_cast<Index>(here.size());
    const VectorXd e = at.e.col(t)(here);
    const MatrixXd S = covariance(at, t)(here, here);
    const Eigen::LLT<MatrixXd> llt(S);
    if (!e.allFinite() || !S.allFinite()) return {FilterStatus::not_finite, 0.0, {}, {}};
    if (llt.info() != Eigen::Success) return {FilterStatus::indefinite, 0.0, {}, {}};
    const VectorXd weighted = llt.solve(e);
    out.value -= llt.matrixLLT().diagonal().array().log().sum() +
                 0.5 * (e.dot(weighted) + static_cast<double>(n) * kLogTwoPi);
    if (k == 0) continue;
    MatrixXd moved(n, k);                         // Sigma^-1 de
    std::vector<MatrixXd> turned(beside.size());  // Sigma^-1 dSigma
    MatrixXd de(n, k);
    for (Index i = 0; i < k; ++i) {
      const InnovationsBeside& pair = beside[i];
      de.col(i) = (pair.above.e.col(t)(here) - pair.below.e.col(t)(here)) / pair.distance;
      const MatrixXd dS =
          (covariance(pair.above, t)(here, here) - covariance(pair.below, t)(here, here)) /
          pair.distance;
      MatrixXd& T = turned[i];
      T = llt.solve(dS);
      moved.col(i) = llt.solve(de.col(i));
      score[i] = -0.5 * T.trace() + 0.5 * weighted.dot(dS * weighted) - weighted.dot(de.col(i));
    }
    if (!score.allFinite()) return {FilterStatus::not_finite, 0.0, {}, {}};
    out.gradient += score;
    if (score_products != nullptr) *score_products += score * score.transpose();
    out.information += de.transpose() * moved;
    for (Index i = 0; i < k; ++i) {
      for (Index j = 0; j <= i; ++j) {
        const double trace = 0.5 * turned[i].cwiseProduct(turned[j].transpose()).sum();
        out.information(i, j) += trace;
        if (i != j) out.information(j, i) += trace;
      }
    }
  }
  return out;
}

}  // namespace identikal
