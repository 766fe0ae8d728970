#include "lib/subspace/prediction_error.h"

#include <cmath>
#include <stdexcept>
#include <vector>

#include <Eigen/Cholesky>

#include "lib/subspace/internal/basis_changes.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Where the blocks of theta begin.
struct ThetaLayout {
  Index n, p, m, A = 0, input, C, D, size;
  explicit ThetaLayout(const InnovationForm& model)
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

// Row a n + l of what comes out: the states that a unit in every channel leaves in state l, seen a samples later, times
// the root of the sums. A unit in the state before the window counts where the window begins.
MatrixXd delayed_states(const InnovationForm& model, const Responses& of, const MatrixXd& root,
                        Index q, Index states) {
  const Index n = model.states(), lags = static_cast<Index>(of.state.size());
  MatrixXd delayed = MatrixXd::Zero((lags + 1) * n, root.rows()), power = MatrixXd::Identity(n, n);
  const MatrixXd A = model.A - model.K * model.C;
  for (Index a = lags; a >= 0; --a) {
    for (Index k = 1; k + a <= lags; ++k) {
      delayed.block(a * n, (k + a) * q, n, q) = of.state[static_cast<std::size_t>(k - 1)];
    }
    if (states > 0) delayed.block(a * n, (lags + 1) * q, n, n) = power;
    power = A * power;
  }
  return delayed * root;
}

}  // namespace

VectorXd predictor_parameters(const InnovationForm& model) {
  const ThetaLayout at(model);
  VectorXd theta(at.size);
  const MatrixXd A = model.A - model.K * model.C;
  MatrixXd input(at.n, at.p + at.m);
  input << model.K, model.B - model.K * model.D;
  theta << A.reshaped(), input.reshaped(), model.C.reshaped(), model.D.reshaped();
  return theta;
}

InnovationForm with_predictor_parameters(InnovationForm model, const VectorXd& theta) {
  const ThetaLayout at(model);
  const MatrixXd input = theta.segment(at.input, at.n * (at.p + at.m)).reshaped(at.n, at.p + at.m);
  model.C = theta.segment(at.C, at.p * at.n).reshaped(at.p, at.n);
  model.D = theta.segment(at.D, at.p * at.m).reshaped(at.p, at.m);
  model.K = input.leftCols(at.p);
  model.B = input.rightCols(at.m) + model.K * model.D;
  model.A = theta.head(at.n * at.n).reshaped(at.n, at.n) + model.K * model.C;
  return model;
}

MatrixXd local_coordinates(const InnovationForm& model) {
  MatrixXd input(model.states(), model.outputs() + model.inputs());
  input << model.K, model.B - model.K * model.D;
  return directions_beside_basis_changes(model.A - model.K * model.C, input, model.C,
                                         model.D.size());
}

MatrixXd gain_directions(const InnovationForm& model) {
  const VectorXd here = predictor_parameters(model);
  MatrixXd out(here.size(), model.K.size());
  for (Index k = 0; k < model.K.size(); ++k) {
    InnovationForm moved = model;
    moved.K.reshaped()[k] += 1.0;  // theta is linear in K
    out.col(k) = predictor_parameters(moved) - here;
  }
  return out;
}

Index free_parameters(const InnovationForm& model) {
  return model.states() * (model.inputs() + 2 * model.outputs()) + model.outputs() * model.inputs();
}

PredictionErrorProblem::PredictionErrorProblem(const LaggedProducts& sums, const MatrixXd& sigma)
    : p_(sums.outputs), q_(sums.channels()), lags_(sums.lags), states_(sums.states) {
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

// Every derivative of the responses is a sum of columns, the whitened outputs that follow a unit in one state, times
// rows of the root of the sums; each column of the result is the vec of p x root.cols().
MatrixXd PredictionErrorProblem::derivatives(const InnovationForm& model) const {
  const ThetaLayout at(model);
  const Index n = at.n, width = root_.cols();
  const Responses of = responses(model, lags_);
  MatrixXd outputs(n * p_, lags_);  // column k - 1: vec of whitened C A^(k-1)
  for (Index k = 0; k < lags_; ++k) {
    outputs.col(k) = (whiten_ * of.out[static_cast<std::size_t>(k)]).reshaped();
  }
  const MatrixXd states = delayed_states(model, of, root_, q_, states_);
  MatrixXd out(p_ * width, at.size);
  const auto put = [&](Index first, const MatrixXd& rows) {  // n p x width, state by state
    for (Index j = 0; j < n; ++j) out.col(first + j) = rows.middleRows(j * p_, p_).reshaped();
  };
  for (Index l = 0; l < n; ++l) {
    const MatrixXd later = states(Eigen::seqN(n + l, lags_, n), Eigen::all);
    put(l * n, outputs * later);
    for (Index i = 0; i < p_; ++i) {
      out.col(at.C + l * p_ + i) = (whiten_.col(i) * states.row(l)).reshaped();
    }
  }
  for (Index c = 0; c < q_; ++c) {
    const MatrixXd channel = root_(Eigen::seqN(q_ + c, lags_, q_), Eigen::all);
    put(at.input + c * n, outputs * channel);
  }
  for (Index j = 0; j < at.m; ++j) {
    for (Index i = 0; i < p_; ++i) {
      out.col(at.D + j * p_ + i) = (whiten_.col(i) * root_.row(p_ + j)).reshaped();
    }
  }
  return out;
}

bool PredictionErrorProblem::evaluate(const InnovationForm& model, VectorXd& r, MatrixXd* J) const {
  MatrixXd error = -predictor_responses(model, lags_, states_ > 0);
  if (!error.allFinite()) return false;
  error.leftCols(p_) += MatrixXd::Identity(p_, p_);
  r = (whiten_ * error * root_).reshaped();
  if (J == nullptr) return r.allFinite();
  *J = -derivatives(model);
  return r.allFinite() && J->allFinite();
}

}  // namespace identikal
