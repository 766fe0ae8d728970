#include "lib/polynomial/polynomial_model.h"

#include <algorithm>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

namespace {

template <typename Model, typename Visit>
void visit_polynomials(Model& model, const Visit& visit) {
  visit(model.A);
  for (auto& each : model.B) visit(each);
  visit(model.C);
  visit(model.D);
  for (auto& each : model.F) visit(each);
}

Index lags_of(const PolynomialModel& model, std::size_t input) {
  return model.B[input].size() == 0 ? 0 : model.delay[input] + model.B[input].size() - 1;
}

// Coefficients of q^-1 to q^-n, zeros behind the last one.
VectorXd padded(const VectorXd& polynomial, Index n) {
  VectorXd out = VectorXd::Zero(n);
  out.head(polynomial.size()) = polynomial;
  return out;
}

// Coefficients of q^0 to q^-n of an input's numerator.
VectorXd numerator(const PolynomialModel& model, std::size_t input, Index n) {
  VectorXd out = VectorXd::Zero(n + 1);
  out.segment(model.delay[input], model.B[input].size()) = model.B[input];
  return out;
}

// One output: its states, and where their blocks begin.
struct OneOutput {
  InnovationForm form;
  Index at = 0;
};

InnovationForm empty_form(Index states, Index inputs) {
  InnovationForm out;
  out.A = MatrixXd::Zero(states, states);
  out.B = MatrixXd::Zero(states, inputs);
  out.C = MatrixXd::Zero(1, states);
  out.D = MatrixXd::Zero(1, inputs);
  out.K = MatrixXd::Zero(states, 1);
  return out;
}

// x_i(t+1) = x_(i+1) - a_i x_1, output x_1: the observer form of 1 / (1 + a_1 q^-1 + ...).
void put_denominator(const VectorXd& a, Index at, MatrixXd& A) {
  const Index n = a.size();
  A.block(at, at, n, 1) = -a;
  for (Index i = 0; i + 1 < n; ++i) A(at + i, at + i + 1) = 1.0;
}

// B_j / F_j in states of its own; its output also drives what 1/A makes of it, the first `direct` states.
void add_transfer(const PolynomialModel& model, std::size_t j, const VectorXd& a, OneOutput& out) {
  const Index n = std::max(model.F[j].size(), lags_of(model, j)), at = out.at;
  const VectorXd f = padded(model.F[j], n), b = numerator(model, j, n);
  const auto column = static_cast<Index>(j);
  put_denominator(f, at, out.form.A);
  out.form.B.block(at, column, n, 1) = b.tail(n) - f * b[0];
  out.form.C(0, at) = 1.0;
  out.form.D(0, column) += b[0];
  out.form.A.block(0, at, a.size(), 1) -= a;
  out.form.B.block(0, column, a.size(), 1) -= a * b[0];
  out.at += n;
}

// C / D likewise, driven by the innovations.
void add_noise(const PolynomialModel& model, const VectorXd& a, OneOutput& out) {
  const Index n = std::max(model.C.size(), model.D.size()), at = out.at;
  const VectorXd d = padded(model.D, n);
  put_denominator(d, at, out.form.A);
  out.form.K.block(at, 0, n, 1) = padded(model.C, n) - d;
  out.form.C(0, at) = 1.0;
  out.form.A.block(0, at, a.size(), 1) -= a;
  out.form.K.block(0, 0, a.size(), 1) -= a;
  out.at += n;
}

InnovationForm one_output(const PolynomialModel& model) {
  const bool own_noise = model.D.size() > 0;
  Index n = std::max(model.A.size(), own_noise ? Index{0} : model.C.size()), more = 0;
  for (std::size_t j = 0; j < model.B.size(); ++j) {
    if (model.F[j].size() == 0)
      n = std::max(n, lags_of(model, j));
    else
      more += std::max(model.F[j].size(), lags_of(model, j));
  }
  if (own_noise) more += std::max(model.C.size(), model.D.size());
  OneOutput out{empty_form(n + more, model.inputs()), n};
  const VectorXd a = padded(model.A, n);
  put_denominator(a, 0, out.form.A);
  if (n > 0) out.form.C(0, 0) = 1.0;
  for (std::size_t j = 0; j < model.B.size(); ++j) {
    if (model.F[j].size() > 0) {
      add_transfer(model, j, a, out);
      continue;
    }
    const VectorXd b = numerator(model, j, n);
    const auto column = static_cast<Index>(j);
    out.form.B.block(0, column, n, 1) += b.tail(n) - a * b[0];
    out.form.D(0, column) += b[0];
  }
  if (own_noise)
    add_noise(model, a, out);
  else
    out.form.K.block(0, 0, n, 1) += padded(model.C, n) - a;
  return out.form;
}

}  // namespace

Index PolynomialModel::parameters() const {
  Index count = 0;
  visit_polynomials(*this, [&](const VectorXd& each) { count += each.size(); });
  return count;
}

Index PolynomialModel::rows_back() const {
  Index rows = A.size();
  for (std::size_t j = 0; j < B.size(); ++j) rows = std::max(rows, lags_of(*this, j));
  return rows;
}

PolynomialModel polynomial_model(const PolynomialOrders& orders, const std::vector<Index>& delay) {
  const Index least = std::min({orders.na, orders.nb, orders.nc, orders.nd, orders.nf});
  if (least < 0 || (!delay.empty() && *std::min_element(delay.begin(), delay.end()) < 0)) {
    throw std::invalid_argument("polynomial_model: orders and delays from 0 on");
  }
  PolynomialModel out;
  out.A = VectorXd::Zero(orders.na);
  out.C = VectorXd::Zero(orders.nc);
  out.D = VectorXd::Zero(orders.nd);
  out.B.assign(delay.size(), VectorXd::Zero(orders.nb));
  out.F.assign(delay.size(), VectorXd::Zero(orders.nb > 0 ? orders.nf : 0));
  out.delay = delay;
  if (out.parameters() == 0)
    throw std::invalid_argument("polynomial_model: without any coefficient");
  return out;
}

VectorXd coefficients(const PolynomialModel& model) {
  VectorXd out(model.parameters());
  Index at = 0;
  visit_polynomials(model, [&](const VectorXd& each) {
    out.segment(at, each.size()) = each;
    at += each.size();
  });
  return out;
}

PolynomialModel with_coefficients(PolynomialModel model, const VectorXd& theta) {
  if (theta.size() != model.parameters())
    throw std::invalid_argument("with_coefficients: another number of coefficients");
  Index at = 0;
  visit_polynomials(model, [&](VectorXd& each) {
    each = theta.segment(at, each.size()).eval();
    at += each.size();
  });
  return model;
}

VectorXcd zeros_of(const VectorXd& a) {
  const Index n = a.size();
  if (n == 0) return {};
  MatrixXd companion = MatrixXd::Zero(n, n);
  companion.row(0) = -a.transpose();
  for (Index i = 1; i < n; ++i) companion(i, i - 1) = 1.0;
  return companion.eigenvalues();
}

VectorXd with_zeros(const VectorXcd& zeros) {
  VectorXcd out = VectorXcd::Zero(zeros.size() + 1);
  out[0] = 1.0;
  for (Index k = 0; k < zeros.size(); ++k) {
    for (Index i = k + 1; i >= 1; --i) out[i] -= zeros[k] * out[i - 1];
  }
  return out.tail(zeros.size()).real();
}

InnovationForm innovation_form(const std::vector<PolynomialModel>& outputs, const MatrixXd& sigma) {
  const auto p = static_cast<Index>(outputs.size());
  if (p == 0 || sigma.rows() != p || sigma.cols() != p)
    throw std::invalid_argument("innovation_form: sigma is outputs x outputs, of at least one");
  const Index m = outputs.front().inputs();
  std::vector<InnovationForm> parts;
  Index states = 0;
  for (const PolynomialModel& each : outputs) {
    if (each.inputs() != m)
      throw std::invalid_argument("innovation_form: outputs with other numbers of inputs");
    parts.push_back(one_output(each));
    states += parts.back().states();
  }
  InnovationForm out = empty_form(states, m);
  out.C = MatrixXd::Zero(p, states);
  out.D = MatrixXd::Zero(p, m);
  out.K = MatrixXd::Zero(states, p);
  out.sigma = sigma;
  Index at = 0;
  for (Index i = 0; i < p; ++i) {
    const InnovationForm& part = parts[static_cast<std::size_t>(i)];
    const Index n = part.states();
    out.A.block(at, at, n, n) = part.A;
    out.B.middleRows(at, n) = part.B;
    out.C.block(i, at, 1, n) = part.C;
    out.D.row(i) = part.D;
    out.K.block(at, i, n, 1) = part.K;
    at += n;
  }
  return out;
}

InnovationForm observable_part(const InnovationForm& model) {
  const Index n = model.states(), p = model.outputs();
  if (n == 0) return model;
  MatrixXd observability(n * p, n), rows = model.C;
  for (Index k = 0; k < n; ++k) {
    // Every block by itself to the size of one: what fades or grows has the same kernel.
    const double size = rows.norm();
    observability.middleRows(k * p, p) = rows / (size > 0.0 ? size : 1.0);
    rows = rows * model.A / (size > 0.0 ? size : 1.0);
  }
  const Eigen::JacobiSVD<MatrixXd> svd(observability, Eigen::ComputeThinV);
  const VectorXd& values = svd.singularValues();
  const Index seen = (values.array() > 1e-10 * values[0]).count();
  if (seen == n) return model;
  const MatrixXd T = svd.matrixV().leftCols(seen);
  InnovationForm out = model;
  out.A = T.transpose() * model.A * T;
  out.B = T.transpose() * model.B;
  out.K = T.transpose() * model.K;
  out.C = model.C * T;
  return out;
}

}  // namespace identikal
