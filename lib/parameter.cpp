#include "lib/parameter.h"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include "lib/random.h"

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
  const Eigen::Index n = parameter.value.rows();
  switch (parameter.domain) {
    case Domain::scalar:
    case Domain::scaled_identity:
      return Eigen::VectorXd::Constant(1, parameter.value(0, 0));
    case Domain::diagonal:
      return parameter.value.diagonal();
    case Domain::positive_definite: {
      const Eigen::MatrixXd L = lower_factor(parameter.value);
      Eigen::VectorXd out(coordinate_count(parameter));
      Eigen::Index k = 0;
      for (Eigen::Index j = 0; j < n; ++j) {
        for (Eigen::Index i = j; i < n; ++i) out[k++] = L(i, j);
      }
      return out;
    }
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

}  // namespace

int find_parameter(const ParameterSet& parameters, const std::string& name) {
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

Eigen::VectorXd coordinates(const ParameterSet& parameters) {
  Eigen::Index count = 0;
  for (const Parameter& p : parameters) count += p.fixed ? 0 : coordinate_count(p);
  Eigen::VectorXd out(count);
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
  const double infinity = std::numeric_limits<double>::infinity();
  const Eigen::Index count = coordinates(parameters).size();
  Box box{Eigen::VectorXd::Constant(count, -infinity), Eigen::VectorXd::Constant(count, infinity)};
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
    std::ostringstream text;
    text << "with_coordinates: " << coordinate.size() << " coordinates do not fit the set";
    throw std::invalid_argument(text.str());
  }
  return parameters;
}

std::vector<CoordinateDerivative> coordinate_derivatives(const ParameterSet& parameters) {
  std::vector<CoordinateDerivative> out;
  for (std::size_t index = 0; index < parameters.size(); ++index) {
    const Parameter& p = parameters[index];
    if (p.fixed) continue;
    const Eigen::Index n = p.value.rows(), own = coordinate_count(p);
    for (Eigen::Index k = 0; k < own; ++k) {
      const Eigen::VectorXd unit = Eigen::VectorXd::Unit(own, k);
      Eigen::MatrixXd d;
      if (p.domain == Domain::positive_definite) {
        const Eigen::MatrixXd L = lower_factor(p.value), dL = triangle(unit, n);
        d = dL * L.transpose() + L * dL.transpose();
      } else {
        d = value_at(p, unit);  // linear in its coordinates
      }
      out.push_back({static_cast<int>(index), std::move(d)});
    }
  }
  return out;
}

ReportedEntries reported_entries(const ParameterSet& parameters) {
  const std::vector<CoordinateDerivative> derivatives = coordinate_derivatives(parameters);
  struct Place {
    Eigen::Index row, col;
  };
  ReportedEntries out;
  std::vector<Place> places;
  std::vector<double> values;
  for (std::size_t index = 0; index < parameters.size(); ++index) {
    const Parameter& p = parameters[index];
    const auto add = [&](const std::string& name, Eigen::Index i, Eigen::Index j) {
      out.names.push_back(name);
      out.units.push_back(p.unit);
      out.parameter.push_back(static_cast<int>(index));
      places.push_back({i, j});
      values.push_back(p.value(i, j));
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
  const auto rows = static_cast<Eigen::Index>(places.size());
  out.value = Eigen::Map<const Eigen::VectorXd>(values.data(), rows);
  out.J = Eigen::MatrixXd::Zero(rows, static_cast<Eigen::Index>(derivatives.size()));
  for (Eigen::Index e = 0; e < rows; ++e) {
    const auto i = static_cast<std::size_t>(e);
    for (std::size_t k = 0; k < derivatives.size(); ++k) {
      if (derivatives[k].parameter != out.parameter[i]) continue;
      out.J(e, static_cast<Eigen::Index>(k)) = derivatives[k].value(places[i].row, places[i].col);
    }
  }
  return out;
}

}  // namespace identikal
