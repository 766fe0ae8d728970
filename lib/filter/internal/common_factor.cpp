#include "lib/filter/internal/common_factor.h"

#include <algorithm>
#include <cmath>

#include <Eigen/QR>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Entries of Q, R and S that are not zero everywhere: of the derivatives, and of the model behind them.
MatrixXd noise_entries(const StateSpace& model, const std::vector<StateSpace>& derivatives) {
  const auto k = static_cast<Index>(derivatives.size());
  std::vector<double> rows;
  const auto take = [&](const MatrixXd StateSpace::*matrix) {
    const MatrixXd& M = model.*matrix;
    for (Index at = 0; at < M.size(); ++at) {
      const auto begin = static_cast<Index>(rows.size());
      double largest = std::abs(M.data()[at]);
      for (const StateSpace& d : derivatives) {
        rows.push_back((d.*matrix).data()[at]);
        largest = std::max(largest, std::abs(rows.back()));
      }
      rows.push_back(M.data()[at]);
      if (largest == 0.0) rows.resize(static_cast<std::size_t>(begin));
    }
  };
  take(&StateSpace::Q), take(&StateSpace::R), take(&StateSpace::S);
  return Eigen::Map<MatrixXd>(rows.data(), k + 1, static_cast<Index>(rows.size()) / (k + 1))
      .transpose();
}

// Weights that all entries agree to.
std::optional<VectorXd> common_weights(const StateSpace& model,
                                       const std::vector<StateSpace>& derivatives) {
  constexpr double kRounding = 1e-14;
  MatrixXd entries = noise_entries(model, derivatives);
  const auto k = static_cast<Index>(derivatives.size());
  if (entries.rows() < k || !entries.allFinite()) return std::nullopt;
  // An entry of 1e-12 counts as much as one of 1e12.
  for (Index i = 0; i < entries.rows(); ++i) entries.row(i) /= entries.row(i).cwiseAbs().maxCoeff();
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(entries.leftCols(k));
  if (qr.rank() < k) return std::nullopt;
  const VectorXd weights = qr.solve(entries.col(k));
  for (Index i = 0; i < entries.rows(); ++i) {
    const auto terms = (entries.row(i).head(k).transpose().array() * weights.array()).eval();
    const double size = std::max(terms.abs().maxCoeff(), std::abs(entries(i, k)));
    if (!(std::abs(terms.sum() - entries(i, k)) <= kRounding * size)) return std::nullopt;
  }
  return weights;
}

}  // namespace

std::optional<CommonFactor> common_factor(const StateSpace& model,
                                          const std::vector<StateSpace>& derivatives) {
  if (!std::all_of(derivatives.begin(), derivatives.end(), changes_only_noise)) return std::nullopt;
  const std::optional<VectorXd> weights = common_weights(model, derivatives);
  if (!weights) return std::nullopt;
  // What enters the outputs at once, of the output's variance.
  const MatrixXd CG = model.C * model.G;
  const auto size = [&CG](const StateSpace& of) {
    return VectorXd((CG * of.Q).cwiseProduct(CG).rowwise().sum() + of.R.diagonal());
  };
  const VectorXd all = size(model);
  CommonFactor out{*weights, 0};
  double largest = 0.0;
  for (std::size_t i = 0; i < derivatives.size(); ++i) {
    const VectorXd part = (*weights)[static_cast<Index>(i)] * size(derivatives[i]);
    const double share = (all.array() > 0.0).select(part.cwiseQuotient(all), 0.0).sum();
    if (share > largest) out.left_out = i, largest = share;
  }
  return largest > 0.0 ? std::optional(std::move(out)) : std::nullopt;
}

void add_completed(const Likelihood& of_others, const FactorSums& sums, const CommonFactor& factor,
                   Likelihood& out) {
  const VectorXd& weights = factor.weights;
  const Index k = weights.size(), last = static_cast<Index>(factor.left_out);
  std::vector<Index> others;
  for (Index i = 0; i < k; ++i) {
    if (i != last) others.push_back(i);
  }
  const VectorXd w = weights(others);
  const double by = weights[last];
  const MatrixXd& I = of_others.information;
  const VectorXd row = (sums.half_traces - I * w) / by;
  const double half_trace =
      (0.5 * static_cast<double>(sums.informed) - w.dot(sums.half_traces)) / by;
  out.value += of_others.value;
  for (Index i = 0; i < k - 1; ++i) {
    const Index at = others[static_cast<std::size_t>(i)];
    out.gradient[at] += of_others.gradient[i];
    for (Index j = 0; j < k - 1; ++j) {
      out.information(at, others[static_cast<std::size_t>(j)]) += I(i, j);
    }
    out.information(at, last) += row[i];
    out.information(last, at) += row[i];
  }
  out.information(last, last) += (half_trace - w.dot(row)) / by;
  out.gradient[last] +=
      (0.5 * (sums.squares - static_cast<double>(sums.values)) - w.dot(of_others.gradient)) / by;
}

}  // namespace identikal
