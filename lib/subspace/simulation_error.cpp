#include "lib/subspace/simulation_error.h"

#include <algorithm>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include "lib/subspace/internal/basis_changes.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kRowsAtOnce =
    256;  // rows of the regression that are added to the normal equations at once

// Normal equations of [vec B; vec D'; x0], of one recording. x0 is eliminated at its end.
struct NormalEquations {
  MatrixXd M;
  VectorXd v;
};

// d y / d B, n columns for every input: the states that a unit in every row of B has moved by now.
class InputResponses {
 public:
  InputResponses(const InnovationForm& model, Index inputs)
      : A_(model.A), state_(MatrixXd::Zero(model.states(), model.states() * inputs)) {}
  const MatrixXd& state() const { return state_; }
  void step(const Eigen::Ref<const VectorXd>& u) {
    const Index n = A_.rows();
    state_ = A_ * state_;
    for (Index j = 0; j < u.size(); ++j) state_.middleCols(j * n, n).diagonal().array() += u[j];
  }

 private:
  const MatrixXd& A_;
  MatrixXd state_;
};

NormalEquations normal_equations(const InnovationForm& model, const MatrixXd& y,
                                 const MatrixXd& u) {
  const Index n = model.states(), m = model.inputs(), p = model.outputs();
  const Index of_B = n * m, of_D = p * m, size = of_B + of_D + n;
  NormalEquations sums{MatrixXd::Zero(size, size), VectorXd::Zero(size)};
  MatrixXd J(kRowsAtOnce * p, size);
  VectorXd r(kRowsAtOnce * p);
  InputResponses responses(model, m);
  MatrixXd start = model.C;
  for (Index from = 0; from < y.cols(); from += kRowsAtOnce) {
    const Index count = std::min(kRowsAtOnce, y.cols() - from);
    J.setZero();
    r.setZero();
    for (Index k = 0; k < count; ++k) {
      const Index t = from + k;
      const MatrixXd rows = model.C * responses.state();
      for (Index i = 0; i < p; ++i) {
        if (!std::isfinite(y(i, t))) continue;
        J.row(k * p + i).head(of_B) = rows.row(i);
        J.row(k * p + i).segment(of_B + i * m, m) = u.col(t).transpose();
        J.row(k * p + i).tail(n) = start.row(i);
        r[k * p + i] = y(i, t);
      }
      responses.step(u.col(t));
      start = start * model.A;
    }
    sums.M.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose());
    sums.v.noalias() += J.transpose() * r;
  }
  sums.M.triangularView<Eigen::StrictlyUpper>() = sums.M.transpose();
  return sums;
}

// A model's matrices along all directions, one below the other.
struct Steps {
  Index count = 0;
  MatrixXd A, B, C, D;
};

Steps steps(const InnovationForm& model, const MatrixXd& directions) {
  const Index n = model.states(), m = model.inputs(), p = model.outputs(), d = directions.cols();
  Steps out{d, MatrixXd(n * d, n), MatrixXd(n * d, m), MatrixXd(p * d, n), MatrixXd(p * d, m)};
  for (Index k = 0; k < d; ++k) {
    const InnovationForm along = with_simulation_parameters(model, directions.col(k));
    out.A.middleRows(n * k, n) = along.A;
    out.B.middleRows(n * k, n) = along.B;
    out.C.middleRows(p * k, p) = along.C;
    out.D.middleRows(p * k, p) = along.D;
  }
  return out;
}

// What a unit in every first state leaves in the outputs, sample by sample; zero where one is missing.
MatrixXd first_state_responses(const InnovationForm& model, const MatrixXd& y) {
  const Index p = model.outputs();
  MatrixXd out(p * y.cols(), model.states()), now = model.C;
  for (Index t = 0; t < y.cols(); ++t) {
    for (Index i = 0; i < p; ++i) {
      out.row(t * p + i) = (std::isfinite(y(i, t)) ? 1.0 : 0.0) * now.row(i);
    }
    now = now * model.A;
  }
  return out;
}

VectorXd errors_from(const InnovationForm& model, const MatrixXd& y, const MatrixXd& u,
                     const VectorXd& x0) {
  const MatrixXd e = y - simulated_outputs(model, u, x0);
  return e.reshaped().unaryExpr([](double x) { return std::isfinite(x) ? x : 0.0; });
}

// -dr along every direction, the first state held.
MatrixXd slopes_from(const InnovationForm& model, const Steps& along, const MatrixXd& y,
                     const MatrixXd& u, VectorXd x) {
  const Index n = model.states(), p = model.outputs(), d = along.count;
  MatrixXd out(p * u.cols(), d), moved = MatrixXd::Zero(n, d), next = moved;
  VectorXd driven(n * d), seen(p * d), next_x(n);
  for (Index t = 0; t < u.cols(); ++t) {
    seen.noalias() = along.C * x;
    seen.noalias() += along.D * u.col(t);
    driven.noalias() = along.A * x;
    driven.noalias() += along.B * u.col(t);
    auto rows = out.middleRows(t * p, p);
    rows.noalias() = model.C * moved;
    rows += seen.reshaped(p, d);
    next.noalias() = model.A * moved;
    next += driven.reshaped(n, d);
    for (Index i = 0; i < p; ++i) {
      if (!std::isfinite(y(i, t))) rows.row(i).setZero();
    }
    next_x.noalias() = model.A * x;
    next_x.noalias() += model.B * u.col(t);
    x.swap(next_x);
    moved.swap(next);
  }
  return out;
}

void regularise(MatrixXd& M) { M.diagonal().array() += 1e-11 * M.diagonal().maxCoeff(); }

}  // namespace

InnovationForm with_inputs_by_simulation(InnovationForm model, const std::vector<MatrixXd>& y,
                                         const std::vector<MatrixXd>& u) {
  const Index n = model.states(), m = model.inputs(), p = model.outputs(), of_B = n * m;
  if (m == 0 || y.empty() || y.size() != u.size()) {
    throw std::invalid_argument("with_inputs_by_simulation: needs inputs and recordings");
  }
  const Index size = of_B + p * m;
  MatrixXd M = MatrixXd::Zero(size, size);
  VectorXd v = VectorXd::Zero(size);
  for (std::size_t k = 0; k < y.size(); ++k) {
    if (y[k].rows() != p || u[k].rows() != m || y[k].cols() != u[k].cols()) {
      throw std::invalid_argument(
          "with_inputs_by_simulation: a recording has other channels than the model");
    }
    NormalEquations each = normal_equations(model, y[k], u[k]);
    MatrixXd of_start = each.M.bottomRightCorner(n, n);
    regularise(of_start);
    const Eigen::LDLT<MatrixXd> start(of_start);
    const MatrixXd across = each.M.topRightCorner(size, n);
    M += each.M.topLeftCorner(size, size) - across * start.solve(across.transpose());
    v += each.v.head(size) - across * start.solve(each.v.tail(n));
  }
  regularise(M);
  const VectorXd found = M.ldlt().solve(v);
  model.B = Eigen::Map<const MatrixXd>(found.data(), n, m);
  model.D = Eigen::Map<const MatrixXd>(found.data() + of_B, m, p).transpose();
  return model;
}

VectorXd simulation_parameters(const InnovationForm& model) {
  VectorXd theta(model.A.size() + model.B.size() + model.C.size() + model.D.size());
  theta << model.A.reshaped(), model.B.reshaped(), model.C.reshaped(), model.D.reshaped();
  return theta;
}

InnovationForm with_simulation_parameters(InnovationForm model, const VectorXd& theta) {
  Index at = 0;
  for (MatrixXd* each : {&model.A, &model.B, &model.C, &model.D}) {
    *each = theta.segment(at, each->size()).reshaped(each->rows(), each->cols());
    at += each->size();
  }
  return model;
}

MatrixXd simulation_coordinates(const InnovationForm& model) {
  return directions_beside_basis_changes(model.A, model.B, model.C, model.D.size());
}

SimulationErrorProblem::SimulationErrorProblem(const std::vector<MatrixXd>& y,
                                               const std::vector<MatrixXd>& u)
    : y_(y), u_(u) {
  if (y.empty() || y.size() != u.size()) {
    throw std::invalid_argument("SimulationErrorProblem: needs inputs of every recording");
  }
  for (std::size_t k = 0; k < y.size(); ++k) {
    if (y[k].cols() != u[k].cols()) {
      throw std::invalid_argument("SimulationErrorProblem: numbers of rows differ");
    }
    residuals_ += y[k].size();
  }
}

bool SimulationErrorProblem::evaluate(const InnovationForm& model, const MatrixXd& directions,
                                      VectorXd& r, MatrixXd* J) const {
  r.resize(residuals_);
  if (J != nullptr) J->resize(residuals_, directions.cols());
  const Steps along = J != nullptr ? steps(model, directions) : Steps{};
  Index at = 0;
  for (std::size_t k = 0; k < y_.size(); ++k) {
    const Index size = y_[k].size();
    const Eigen::ColPivHouseholderQR<MatrixXd> of_start(first_state_responses(model, y_[k]));
    const VectorXd from_zero = errors_from(model, y_[k], u_[k], VectorXd::Zero(model.states()));
    if (!from_zero.allFinite()) return false;
    const VectorXd x0 = of_start.solve(from_zero);
    const Index rank = of_start.rank();
    const MatrixXd Q = of_start.householderQ() * MatrixXd::Identity(size, rank);
    r.segment(at, size) = errors_from(model, y_[k], u_[k], x0);
    if (J != nullptr) {
      auto slopes = J->middleRows(at, size);
      slopes = -slopes_from(model, along, y_[k], u_[k], x0);
      slopes -= Q * (Q.transpose() * slopes).eval();
    }
    at += size;
  }
  return r.allFinite() && (J == nullptr || J->allFinite());
}

}  // namespace identikal
