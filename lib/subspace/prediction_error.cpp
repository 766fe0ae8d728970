#include "lib/subspace/prediction_error.h"

#include <cmath>
#include <stdexcept>
#include <vector>

#include <Eigen/Cholesky>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Where the blocks of theta begin.
struct Layout {
  Index n, p, m, A = 0, input, C, D, size;
  explicit Layout(const InnovationForm& model)
      : n(model.states()),
        p(model.outputs()),
        m(model.inputs()),
        input(n * n),
        C(input + n * (p + m)),
        D(C + p * n),
        size(D + p * m) {}
};

// What the derivatives are made of: C A^(k-1) and the states behind a unit in every channel, k = 1 ... L.
struct Responses {
  std::vector<MatrixXd> out, state;
};

Responses responses(const InnovationForm& model, Index lags) {
  const MatrixXd A = model.A - model.K * model.C;
  Responses all;
  MatrixXd O = model.C, X(model.states(), model.outputs() + model.inputs());
  X << model.K, model.B - model.K * model.D;
  for (Index k = 1; k <= lags; ++k) {
    all.out.push_back(O);
    all.state.push_back(X);
    O = O * A;
    X = A * X;
  }
  return all;
}

// Rows: output i of parameter s at s p + i; columns: channel c at lag k at k q + c.
MatrixXd response_derivatives(const InnovationForm& model, Index lags) {
  const Layout at(model);
  const Index n = at.n, p = at.p, q = p + at.m;
  const Responses of = responses(model, lags);
  MatrixXd out = MatrixXd::Zero(at.size * p, (lags + 1) * q);
  for (Index k = 1; k <= lags; ++k) {
    const MatrixXd& O = of.out[static_cast<std::size_t>(k - 1)];
    const MatrixXd& X = of.state[static_cast<std::size_t>(k - 1)];
    for (Index c = 0; c < q; ++c) {
      for (Index j = 0; j < n; ++j) {
        out.block((at.input + c * n + j) * p, k * q + c, p, 1) = O.col(j);
        for (Index i = 0; i < p; ++i) out((at.C + j * p + i) * p + i, k * q + c) = X(j, c);
      }
    }
    for (Index s = 1; s < k;
         ++s) {  // A moves the state s samples behind the unit, and it comes out k - s later
      const MatrixXd& later = of.out[static_cast<std::size_t>(k - s - 1)];
      const MatrixXd& then = of.state[static_cast<std::size_t>(s - 1)];
      for (Index l = 0; l < n; ++l) {
        for (Index j = 0; j < n; ++j) {
          out.block((l * n + j) * p, k * q, p, q).noalias() += later.col(j) * then.row(l);
        }
      }
    }
  }
  for (Index j = 0; j < at.m; ++j) {
    for (Index i = 0; i < p; ++i) out((at.D + j * p + i) * p + i, p + j) = 1.0;
  }
  return out;
}

}  // namespace

VectorXd predictor_parameters(const InnovationForm& model) {
  const Layout at(model);
  VectorXd theta(at.size);
  const MatrixXd A = model.A - model.K * model.C;
  MatrixXd input(at.n, at.p + at.m);
  input << model.K, model.B - model.K * model.D;
  theta << A.reshaped(), input.reshaped(), model.C.reshaped(), model.D.reshaped();
  return theta;
}

InnovationForm with_predictor_parameters(InnovationForm model, const VectorXd& theta) {
  const Layout at(model);
  const MatrixXd input = theta.segment(at.input, at.n * (at.p + at.m)).reshaped(at.n, at.p + at.m);
  model.C = theta.segment(at.C, at.p * at.n).reshaped(at.p, at.n);
  model.D = theta.segment(at.D, at.p * at.m).reshaped(at.p, at.m);
  model.K = input.leftCols(at.p);
  model.B = input.rightCols(at.m) + model.K * model.D;
  model.A = theta.head(at.n * at.n).reshaped(at.n, at.n) + model.K * model.C;
  return model;
}

Index free_parameters(const InnovationForm& model) {
  return model.states() * (model.inputs() + 2 * model.outputs()) + model.outputs() * model.inputs();
}

PredictionErrorProblem::PredictionErrorProblem(const LaggedProducts& sums, const MatrixXd& sigma)
    : p_(sums.outputs), q_(sums.channels()), lags_(sums.lags) {
  const Eigen::LLT<MatrixXd> of_sigma(sigma);
  if (sigma.rows() != p_ || sigma.cols() != p_ || of_sigma.info() != Eigen::Success) {
    throw std::invalid_argument(
        "PredictionErrorProblem: sigma has to be positive definite, outputs x outputs");
  }
  whiten_ = of_sigma.matrixL().solve(MatrixXd::Identity(p_, p_));
  const Eigen::LDLT<MatrixXd> of_gram(sums.gram);
  const VectorXd scale = of_gram.vectorD().cwiseMax(0.0).cwiseSqrt();
  root_ =
      of_gram.transpositionsP().transpose() * (MatrixXd(of_gram.matrixL()) * scale.asDiagonal());
}

bool PredictionErrorProblem::evaluate(const InnovationForm& model, VectorXd& r, MatrixXd* J) const {
  MatrixXd error = -predictor_responses(model, lags_);
  if (!error.allFinite()) return false;
  error.leftCols(p_) += MatrixXd::Identity(p_, p_);
  r = (whiten_ * error * root_).reshaped();
  if (J == nullptr) return r.allFinite();
  const MatrixXd all = response_derivatives(model, lags_) * root_;
  const Index parameters = all.rows() / p_;
  J->resize(r.size(), parameters);
  for (Index s = 0; s < parameters; ++s) {
    J->col(s) = -(whiten_ * all.middleRows(s * p_, p_)).reshaped();
  }
  return r.allFinite() && J->allFinite();
}

}  // namespace identikal
