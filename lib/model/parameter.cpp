#include "lib/model/parameter.h"

#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include "lib/base/constants.h"
#include "lib/base/message.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

Eigen::Index coordinate_count(const Parameter& parameter) {
  const Eigen::Index n = parameter.value.rows();
  switch (parameter.domain) {
    case Domain::scalar:
    case Domain::scaled_identity:
      return 1;
    case Domain::diagonal:
      return n;
    case Domain::positive_definite:
      return n * (n + 1) / 2;
  }
  return 0;
}

// A lower triangular factor that exists for semidefinite matrices too: the triangle of a QR of any
// factor's transpose.
Eigen::MatrixXd lower_factor(const Eigen::MatrixXd& value) {
  const Eigen::LLT<Eigen::MatrixXd> llt(value);
  if (llt.info() == Eigen::Success) return llt.matrixL();
  const Eigen::MatrixXd F = semidefinite_factor(value);
  Eigen::MatrixXd L =
      F.transpose().householderQr().matrixQR().triangularView<Eigen::Upper>().transpose();
  for (Eigen::Index j = 0; j < L.cols(); ++j) {
    if (L(j, j) < 0.0) L.col(j) *= -1.0;
  }
  return L;
}

Eigen::VectorXd own_coordinates(const Parameter& parameter) {
  switch (parameter.domain) {
    case Domain::scalar:
    case Domain::scaled_identity:
      return Eigen::VectorXd::Constant(1, parameter.value(0, 0));
    case Domain::diagonal:
      return parameter.value.diagonal();
    case Domain::positive_definite:
      return lower_triangle(lower_factor(parameter.value));
  }
  return {};
}

Eigen::MatrixXd triangle(const Eigen::VectorXd& coordinate, Eigen::Index n) {
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(n, n);
  Eigen::Index k = 0;
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = j; i < n; ++i) L(i, j) = coordinate[k++];
  }
  return L;
}

Eigen::MatrixXd value_at(const Parameter& parameter, const Eigen::VectorXd& coordinate) {
  const Eigen::Index n = parameter.value.rows();
  switch (parameter.domain) {
    case Domain::scalar:
      return Eigen::MatrixXd::Constant(1, 1, coordinate[0]);
    case Domain::scaled_identity:
      return coordinate[0] * Eigen::MatrixXd::Identity(n, n);
    case Domain::diagonal:
      return coordinate.asDiagonal();
    case Domain::positive_definite: {
      const Eigen::MatrixXd L = triangle(coordinate, n);
      return L * L.transpose();
    }
  }
  return {};
}

Eigen::Index free_count(const ParameterSet& parameters) {
  Eigen::Index count = 0;
  for (const Parameter& p : parameters) count += p.fixed ? 0 : coordinate_count(p);
  return count;
}

}  // namespace

int find_parameter(const ParameterSet& parameters, const std::string& name) {
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

bool moves_by_logarithm(const Parameter& p) {
  if (p.domain != Domain::scalar || p.scale == SearchScale::linear) return false;
  return p.scale == SearchScale::logarithm || (p.min > 0.0 && std::isfinite(p.max));
}

Eigen::VectorXd coordinates(const ParameterSet& parameters) {
  Eigen::VectorXd out(free_count(parameters));
  Eigen::Index at = 0;
  for (const Parameter& p : parameters) {
    if (p.fixed) continue;
    const Eigen::VectorXd own = own_coordinates(p);
    out.segment(at, own.size()) = own;
    at += own.size();
  }
  return out;
}

Box coordinate_box(const ParameterSet& parameters) {
  const Eigen::Index count = free_count(parameters);
  Box box{Eigen::VectorXd::Constant(count, -kInfinity),
          Eigen::VectorXd::Constant(count, kInfinity)};
  Eigen::Index at = 0;
  for (const Parameter& p : parameters) {
    if (p.fixed) continue;
    const Eigen::Index own = coordinate_count(p);
    if (p.domain == Domain::scalar) {
      box.lower[at] = p.min;
      box.upper[at] = p.max;
    } else if (p.domain != Domain::positive_definite) {
      box.lower.segment(at, own).setZero();
    }
    at += own;
  }
  return box;
}

ParameterSet with_coordinates(ParameterSet parameters, const Eigen::VectorXd& coordinate) {
  Eigen::Index at = 0;
  for (Parameter& p : parameters) {
    if (p.fixed) continue;
    const Eigen::Index own = coordinate_count(p);
    if (at + own > coordinate.size()) break;
    p.value = value_at(p, coordinate.segment(at, own));
    at += own;
  }
  if (at != coordinate.size()) {
    throw std::invalid_argument(
        message({"with_coordinates: ", coordinate.size(), " coordinates do not fit the set"}));
  }
  return parameters;
}

Eigen::VectorXd lower_triangle(const Eigen::MatrixXd& M) {
  const Eigen::Index n = M.rows();
  Eigen::VectorXd out(n * (n + 1) / 2);
  Eigen::Index k = 0;
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = j; i < n; ++i) out[k++] = M(i, j);
  }
  return out;
}

Eigen::VectorXd free_entries(const ParameterSet& parameters) {
  Eigen::VectorXd out(free_count(parameters));
  Eigen::Index at = 0;
  for (const Parameter& p : parameters) {
    if (p.fixed) continue;
    const Eigen::Index own = coordinate_count(p);
    out.segment(at, own) =
        p.domain == Domain::positive_definite ? lower_triangle(p.value) : own_coordinates(p);
    at += own;
  }
  return out;
}

ParameterSet with_entries(ParameterSet parameters, const Eigen::VectorXd& entries) {
  if (entries.size() != free_count(parameters)) {
    throw std::invalid_argument("with_entries: the number of entries does not fit the set");
  }
  Eigen::Index at = 0;
  for (Parameter& p : parameters) {
    if (p.fixed) continue;
    const Eigen::Index own = coordinate_count(p);
    if (p.domain == Domain::positive_definite) {
      const Eigen::MatrixXd lower = triangle(entries.segment(at, own), p.value.rows());
      p.value = lower.selfadjointView<Eigen::Lower>();
    } else {
      p.value = value_at(p, entries.segment(at, own));
    }
    at += own;
  }
  return parameters;
}

std::vector<EntryDerivative> entry_derivatives(const ParameterSet& parameters) {
  std::vector<EntryDerivative> out;
  for (std::size_t index = 0; index < parameters.size(); ++index) {
    const Parameter& p = parameters[index];
    if (p.fixed) continue;
    const Eigen::Index n = p.value.rows(), own = coordinate_count(p);
    for (Eigen::Index k = 0; k < own; ++k) {
      const Eigen::VectorXd unit = Eigen::VectorXd::Unit(own, k);
      Eigen::MatrixXd d;
      if (p.domain == Domain::positive_definite) {
        d = triangle(unit, n).selfadjointView<Eigen::Lower>();
      } else {
        d = value_at(p, unit);  // linear in its coordinates
      }
      out.push_back({static_cast<int>(index), std::move(d)});
    }
  }
  return out;
}

Eigen::MatrixXd entry_jacobian(const ParameterSet& parameters, const Eigen::VectorXd& coordinate) {
  Eigen::MatrixXd J = Eigen::MatrixXd::Identity(coordinate.size(), coordinate.size());
  Eigen::Index at = 0;
  for (const Parameter& p : parameters) {
    if (p.fixed) continue;
    const Eigen::Index n = p.value.rows(), own = coordinate_count(p);
    if (p.domain == Domain::positive_definite) {
      const Eigen::MatrixXd L = triangle(coordinate.segment(at, own), n);
      for (Eigen::Index k = 0; k < own; ++k) {
        const Eigen::MatrixXd half = triangle(Eigen::VectorXd::Unit(own, k), n) * L.transpose();
        J.block(at, at + k, own, 1) = lower_triangle(half + half.transpose());
      }
    }
    at += own;
  }
  return J;
}

Eigen::MatrixXd coordinate_curvature(const ParameterSet& parameters,
                                     const Eigen::VectorXd& entry_gradient) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(entry_gradient.size(), entry_gradient.size());
  Eigen::Index at = 0;
  for (const Parameter& p : parameters) {
    if (p.fixed) continue;
    const Eigen::Index n = p.value.rows(), own = coordinate_count(p);
    if (p.domain == Domain::positive_definite) {
      // d^2 (L L') / dL_ij dL_kj = e_i e_k' + e_k e_i', for every column j by itself. An
      // off-diagonal entry stands twice in the matrix.
      Eigen::MatrixXd G = triangle(entry_gradient.segment(at, own), n);
      G = 0.5 * (G + G.transpose()).eval();
      Eigen::Index column = at;
      for (Eigen::Index j = 0; j < n; ++j) {
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
            -2.0 * G.bottomRightCorner(n - j, n - j));
        out.block(column, column, n - j, n - j) = eigen.eigenvectors() *
                                                  eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
                                                  eigen.eigenvectors().transpose();
        column += n - j;
      }
    }
    at += own;
  }
  return out;
}

ReportedEntries reported_entries(const ParameterSet& parameters) {
  ReportedEntries out;
  std::vector<double> values;
  for (std::size_t index = 0; index < parameters.size(); ++index) {
    const Parameter& p = parameters[index];
    if (p.scope == Scope::replaced) continue;
    const auto add = [&](const std::string& name, Eigen::Index i, Eigen::Index j) {
      out.names.push_back(name);
      out.units.push_back(p.unit);
      out.parameter.push_back(static_cast<int>(index));
      values.push_back(p.value(i, j));
      out.variance.push_back(p.domain == Domain::scalar ? p.min >= 0.0 : i == j);
    };
    if (p.domain == Domain::scalar || p.domain == Domain::scaled_identity) {
      add(p.name, 0, 0);
      continue;
    }
    for (Eigen::Index j = 0; j < p.value.cols(); ++j) {
      for (Eigen::Index i = j; i < p.value.rows(); ++i) {
        if (i != j && p.domain == Domain::diagonal) continue;
        add(p.name + "(" + std::to_string(i + 1) + "," + std::to_string(j + 1) + ")", i, j);
      }
    }
  }
  out.value =
      Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  return out;
}

}  // namespace identikal
