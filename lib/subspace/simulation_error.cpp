#include "lib/subspace/simulation_error.h"

#include <algorithm>
#include <stdexcept>

#include <Eigen/Cholesky>

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

}  // namespace identikal
