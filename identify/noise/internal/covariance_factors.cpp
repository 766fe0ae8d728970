#include "identify/noise/internal/covariance_factors.h"

#include <algorithm>
#include <map>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// How often each parameter occurs in the model.
std::map<int, int> occurrences(const LinearModel& model) {
  std::map<int, int> out;
  for (const ParametrisedMatrix* M : {&model.A, &model.B, &model.C, &model.D, &model.G, &model.Q,
                                      &model.R, &model.S, &model.x0, &model.P0}) {
    for (const ParametrisedMatrix::Entry& entry : M->entries) ++out[entry.parameter];
    for (const ParametrisedMatrix::Formula& formula : M->formulas) {
      for (const int parameter : formula.parameters) out[parameter] += 2;
    }
  }
  return out;
}

bool is_free_number(const Parameter& p) {
  return !p.fixed && p.domain == Domain::scalar && p.prior.kind == Prior::Kind::none &&
         p.max == kInfinity;
}

// The parameter that alone is M(i, j), or -1.
int alone_at(const ParametrisedMatrix& M, Index i, Index j) {
  int found = -1, count = 0;
  for (const ParametrisedMatrix::Entry& entry : M.entries) {
    if (entry.row != i || entry.col != j) continue;
    ++count;
    if (entry.factor == 1.0) found = entry.parameter;
  }
  return count == 1 && M.constant(i, j) == 0.0 ? found : -1;
}

// Rows of M that are connected by anything off its diagonal.
std::vector<std::vector<Index>> connected_rows(const ParametrisedMatrix& M) {
  const Index n = M.constant.rows();
  Eigen::MatrixXi linked = (M.constant.array() != 0.0).cast<int>();
  for (const auto& entry : M.entries) linked(entry.row, entry.col) = 1;
  std::vector<std::vector<Index>> out;
  std::vector<bool> taken(static_cast<std::size_t>(n), false);
  for (Index first = 0; first < n; ++first) {
    if (taken[first]) continue;
    std::vector<Index> rows = {first};
    taken[first] = true;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      for (Index j = 0; j < n; ++j) {
        if (taken[j] || (linked(rows[k], j) == 0 && linked(j, rows[k]) == 0)) continue;
        taken[j] = true;
        rows.push_back(j);
      }
    }
    std::sort(rows.begin(), rows.end());
    out.push_back(rows);
  }
  return out;
}

std::optional<CovarianceEntries> covariance_in(const ParametrisedMatrix& M,
                                               const std::vector<Index>& rows,
                                               const ParameterSet& parameters,
                                               const std::map<int, int>& occur) {
  const std::vector<Index> first = first_entries(parameters);
  CovarianceEntries out;
  out.size = static_cast<Index>(rows.size());
  for (std::size_t j = 0; j < rows.size(); ++j) {
    for (std::size_t i = j; i < rows.size(); ++i) {
      const int p = alone_at(M, rows[i], rows[j]);
      if (p < 0 || p != alone_at(M, rows[j], rows[i]) || !is_free_number(parameters[p]) ||
          occur.at(p) != (i == j ? 1 : 2) || parameters[p].min != (i == j ? 0.0 : -kInfinity)) {
        return std::nullopt;
      }
      out.entries.push_back(first[p]);
    }
  }
  return out;
}

}  // namespace

std::vector<Index> first_entries(const ParameterSet& parameters) {
  std::vector<Index> out;
  Index at = 0;
  for (const Parameter& p : parameters) {
    out.push_back(at);
    if (!p.fixed) at += free_entries({p}).size();
  }
  return out;
}

std::vector<CovarianceEntries> named_covariances(const Model& model) {
  std::vector<CovarianceEntries> out;
  if (is_formula_model(model)) return out;  // equations may hold any number
  const LinearModel& linear = as_linear(model);
  if (!linear.S.entries.empty() || !linear.S.constant.isZero(0.0)) return out;
  const std::map<int, int> occur = occurrences(linear);
  for (const ParametrisedMatrix* M : {&linear.Q, &linear.R}) {
    if (M->block >= 0 || !M->formulas.empty()) continue;
    for (const std::vector<Index>& rows : connected_rows(*M)) {
      if (rows.size() < 2) continue;
      if (const auto found = covariance_in(*M, rows, model.parameters, occur)) {
        out.push_back(*found);
      }
    }
  }
  return out;
}

std::vector<CovarianceEntries> all_covariances(const Model& model) {
  std::vector<CovarianceEntries> out = named_covariances(model);
  const std::vector<Index> first = first_entries(model.parameters);
  for (std::size_t k = 0; k < model.parameters.size(); ++k) {
    const Parameter& p = model.parameters[k];
    if (p.fixed || p.domain != Domain::positive_definite) continue;
    CovarianceEntries each{p.value.rows(), {}};
    for (Index i = 0; i < free_entries({p}).size(); ++i) each.entries.push_back(first[k] + i);
    out.push_back(each);
  }
  return out;
}

FactorCoordinates::FactorCoordinates(const ParameterSet& parameters,
                                     const std::vector<CovarianceEntries>& named)
    : any_(!named.empty()) {
  std::vector<bool> in_matrix(static_cast<std::size_t>(coordinates(parameters).size()), false);
  for (const CovarianceEntries& each : named) {
    for (const Index i : each.entries) in_matrix[i] = true;
  }
  for (std::size_t i = 0; i < in_matrix.size(); ++i) {
    if (in_matrix[i]) continue;
    Parameter number;
    number.value = MatrixXd::Zero(1, 1);
    shape_.push_back(number);
    position_.push_back(static_cast<Index>(i));
  }
  for (const CovarianceEntries& each : named) {
    Parameter matrix;
    matrix.domain = Domain::positive_definite;
    matrix.value = MatrixXd::Identity(each.size, each.size);
    shape_.push_back(matrix);
    position_.insert(position_.end(), each.entries.begin(), each.entries.end());
  }
}

VectorXd FactorCoordinates::from(const VectorXd& x) const {
  constexpr double kSingular = 1e-6, kInside = 1e-3;  // beside variances of one
  if (!any_) return x;
  ParameterSet at = with_entries(shape_, x(position_));
  for (Parameter& p : at) {
    if (p.domain != Domain::positive_definite) continue;
    const MatrixXd floor = kSingular * MatrixXd(p.value.diagonal().asDiagonal());
    if (Eigen::LLT<MatrixXd>(p.value - floor).info() == Eigen::Success) continue;
    // A factor's column of zeros has no gradient to be moved by.
    const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(p.value);
    const VectorXd inside = axes.eigenvalues().cwiseMax(0.0);
    p.value = axes.eigenvectors() * inside.asDiagonal() * axes.eigenvectors().transpose();
    p.value.diagonal() *= 1.0 + kInside;
  }
  return coordinates(at);
}

VectorXd FactorCoordinates::to(const VectorXd& y) const {
  if (!any_) return y;
  VectorXd x(y.size());
  x(position_) = free_entries(with_coordinates(shape_, y));
  return x;
}

Index FactorCoordinates::coordinate_of(Index i) const {
  if (!any_) return i;
  for (std::size_t k = 0; k < shape_.size() && shape_[k].domain == Domain::scalar; ++k) {
    if (position_[k] == i) return static_cast<Index>(k);
  }
  return -1;
}

LikelihoodProblem FactorCoordinates::problem(const LikelihoodProblem& by_entries) const {
  if (!any_) return by_entries;
  LikelihoodProblem out;
  out.lower = by_entries.lower(position_);
  out.upper = by_entries.upper(position_);
  Index at = 0;
  for (const Parameter& p : shape_) {
    const Index own = coordinates({p}).size();
    if (p.domain == Domain::positive_definite) {
      out.lower.segment(at, own).setConstant(-kInfinity);
      out.upper.segment(at, own).setConstant(kInfinity);
    }
    at += own;
  }
  out.evaluate = [this, &by_entries](const VectorXd& y, double& L, VectorXd* gradient,
                                     MatrixXd* information) {
    if (!by_entries.evaluate(to(y), L, gradient, information)) return false;
    if (gradient == nullptr) return true;
    const MatrixXd J = entry_jacobian(shape_, y);
    const VectorXd by_entry = (*gradient)(position_);
    *gradient = J.transpose() * by_entry;
    if (information != nullptr) {
      const MatrixXd inner = (*information)(position_, position_);
      *information = J.transpose() * inner * J + coordinate_curvature(shape_, by_entry);
    }
    return true;
  };
  return out;
}

}  // namespace identikal
