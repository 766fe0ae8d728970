#include "lib/filter/online_filter.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "lib/base/constants.h"
#include "lib/base/message.h"
#include "lib/filter/internal/diffuse_start.h"
#include "lib/filter/internal/recursion.h"
#include "lib/filter/steady_state.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The recursion's own tolerance (lib/filter/internal/recursion.cpp).
constexpr double kSettled = 1e-14;

void find_present(OnlineFilter& f, const Eigen::Ref<const VectorXd>& y) {
  std::size_t count = 0;
  bool same = true;
  for (Index i = 0; i < y.size(); ++i) {
    if (std::isnan(y[i])) continue;
    same = same && count < f.present.size() && f.present[count] == i;
    if (count < f.present.size()) {
      f.present[count] = i;
    } else {
      f.present.push_back(i);
    }
    ++count;
  }
  if (!same || count != f.present.size()) f.settled = false;
  f.present.resize(count);
}

// A factor L L' in the lower triangle; false unless the matrix is positive definite.
bool factorise(Eigen::Ref<MatrixXd> S) {
  for (Index j = 0; j < S.cols(); ++j) {
    const double pivot = S(j, j) - S.row(j).head(j).squaredNorm();
    if (!(pivot > 0.0) || !std::isfinite(pivot)) return false;
    S(j, j) = std::sqrt(pivot);
    for (Index i = j + 1; i < S.rows(); ++i) {
      S(i, j) = (S(i, j) - S.row(i).head(j).dot(S.row(j).head(j))) / S(j, j);
    }
  }
  return true;
}

// S^-1 X in the place of X.
void solve(const Eigen::Ref<const MatrixXd>& L, Eigen::Ref<MatrixXd> X) {
  L.triangularView<Eigen::Lower>().solveInPlace(X);
  L.transpose().triangularView<Eigen::Upper>().solveInPlace(X);
}

// Of the channels present: covariance of the innovation, gain, and what they do to the covariance.
bool find_gain(OnlineFilter& f) {
  const Index m = static_cast<Index>(f.present.size());
  for (Index i = 0; i < m; ++i) f.C.row(i) = f.model.C.row(f.present[static_cast<std::size_t>(i)]);
  auto C = f.C.topRows(m);
  auto PC = f.PC.leftCols(m), M = f.M.leftCols(m), K = f.K.leftCols(m);
  auto Sigma = f.Sigma.topLeftCorner(m, m), L = f.L.topLeftCorner(m, m);
  PC.noalias() = f.P * C.transpose();
  Sigma.noalias() = C * PC;
  M.noalias() = f.model.A * PC;
  for (Index j = 0; j < m; ++j) {
    const Index channel = f.present[static_cast<std::size_t>(j)];
    M.col(j) += f.GS.col(channel);
    for (Index i = 0; i < m; ++i) {
      Sigma(i, j) += f.R(f.present[static_cast<std::size_t>(i)], channel);
    }
  }
  L = Sigma;
  if (!factorise(L)) return false;
  // K' = Sigma^-1 M', in the room of the innovations' products.
  auto Kt = f.KR.leftCols(f.P.rows()).topRows(m);
  Kt = M.transpose();
  solve(L, Kt);
  K = Kt.transpose();
  f.F = f.model.A;
  f.F.noalias() -= K * C;
  Kt = PC.transpose();
  solve(L, Kt);
  f.P_filt = f.P;
  f.P_filt.noalias() -= PC * Kt;
  return true;
}

// Given what is known of delta from the samples before.
void report_innovation(OnlineFilter& f) {
  if (f.diffuse && !f.determined) return;
  const Index d = f.scale.size();
  for (Index i = 0; i < static_cast<Index>(f.present.size()); ++i) {
    const Index channel = f.present[static_cast<std::size_t>(i)];
    double e = f.E(i, 0), variance = f.Sigma(i, i);
    if (f.diffuse) {
      auto response = f.moved.col(0);
      response = f.E.row(i).segment(1, d).transpose();
      e += response.dot(f.delta);
      f.delta_factor.triangularView<Eigen::Lower>().solveInPlace(response);
      variance += response.squaredNorm();
    }
    f.innovation[channel] = e;
    f.innovation_sd[channel] = std::sqrt(variance);
  }
}

// Innovations and responses, and the state given them.
void innovate(OnlineFilter& f, const Eigen::Ref<const VectorXd>& y,
              const Eigen::Ref<const VectorXd>& u) {
  const Index m = static_cast<Index>(f.present.size()), columns = f.columns;
  auto E = f.E.topRows(m).leftCols(columns), SiE = f.SiE.topRows(m).leftCols(columns);
  E.noalias() = -f.C.topRows(m) * f.Z.leftCols(columns);
  for (Index i = 0; i < m; ++i) {
    const Index channel = f.present[static_cast<std::size_t>(i)];
    E(i, 0) += y[channel] - f.model.D.row(channel).dot(u);
  }
  SiE = E;
  solve(f.L.topLeftCorner(m, m), SiE);
  auto Z_filt = f.Z_filt.leftCols(columns);
  Z_filt = f.Z.leftCols(columns);
  Z_filt.noalias() += f.PC.leftCols(m) * SiE;
  report_innovation(f);
  if (!f.diffuse) return;
  const Index d = f.scale.size();
  f.delta_information.noalias() += E.rightCols(d).transpose() * SiE.rightCols(d);
  f.delta_score.noalias() += E.rightCols(d).transpose() * SiE.col(0);
}

// -I^-1 s, and whether the samples so far determine it.
bool estimate_delta(OnlineFilter& f) {
  if (!f.determined) {
    const auto sd = f.scale.cwiseSqrt().asDiagonal();
    f.moved = sd * f.delta_information * sd;
    f.solver.compute(f.moved, Eigen::EigenvaluesOnly);
    f.determined = f.solver.eigenvalues().minCoeff() >= kDetermined;
  }
  if (!f.determined) return false;
  f.delta_factor = f.delta_information;
  if (!factorise(f.delta_factor)) return false;
  f.delta = -f.delta_score;
  solve(f.delta_factor, f.delta);
  return true;
}

void report_state(OnlineFilter& f) {
  if (!f.diffuse) {
    f.state = f.Z_filt.col(0);
    f.state_sd = f.P_filt.diagonal().cwiseMax(0.0).cwiseSqrt();
    return;
  }
  f.state.setConstant(kNaN);
  f.state_sd.setConstant(kNaN);
  if (!estimate_delta(f)) return;
  const Index d = f.scale.size();
  f.state = f.Z_filt.col(0);
  f.state.noalias() += f.Z_filt.middleCols(1, d) * f.delta;
  // cov = P + X I^-1 X'; its diagonal by the factor of I.
  f.responses = f.Z_filt.middleCols(1, d).transpose();
  f.delta_factor.triangularView<Eigen::Lower>().solveInPlace(f.responses);
  f.state_sd = (f.P_filt.diagonal() + f.responses.colwise().squaredNorm().transpose()).cwiseSqrt();
}

bool has_settled(const OnlineFilter& f) {
  const Index n = f.P.rows();
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < n; ++i) {
      const double size = std::sqrt(f.P(i, i) * f.P(j, j));
      if (!(std::abs(f.P_next(i, j) - f.P(i, j)) <= kSettled * size)) return false;
    }
  }
  return true;
}

void advance(OnlineFilter& f, const Eigen::Ref<const VectorXd>& u, bool keep_gain) {
  const Index m = static_cast<Index>(f.present.size()), columns = f.columns;
  auto Z_next = f.Z_next.leftCols(columns);
  Z_next.noalias() = f.model.A * f.Z.leftCols(columns);
  Z_next.noalias() += f.K.leftCols(m) * f.E.topRows(m).leftCols(columns);
  Z_next.col(0).noalias() += f.model.B * u;
  f.Z.swap(f.Z_next);
  if (keep_gain) return;
  // The Joseph form: F P F' + W - K S' - S K' + K R K'.
  f.FP.noalias() = f.F * f.P;
  f.P_next = f.GQG;
  f.P_next.noalias() += f.FP * f.F.transpose();
  auto K = f.K.leftCols(m), KR = f.M.leftCols(m);
  for (Index j = 0; j < m; ++j) {
    const Index channel = f.present[static_cast<std::size_t>(j)];
    f.P_next.noalias() -= K.col(j) * f.GS.col(channel).transpose();
    f.P_next.noalias() -= f.GS.col(channel) * K.col(j).transpose();
    KR.col(j).setZero();
    for (Index i = 0; i < m; ++i) {
      KR.col(j) += f.R(f.present[static_cast<std::size_t>(i)], channel) * K.col(i);
    }
  }
  f.P_next.noalias() += KR * K.transpose();
  f.FP = f.P_next.transpose();
  f.P_next = 0.5 * (f.P_next + f.FP);
  f.settled = m == f.model.outputs() && !f.diffuse && has_settled(f);
  f.P.swap(f.P_next);
}

// As soon as nothing of delta is left in the state it is an ordinary filter.
void forget_delta(OnlineFilter& f) {
  if (!f.determined) return;
  const Index n = f.P.rows();
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < f.scale.size(); ++j) {
      const double response = f.Z(i, 1 + j);
      if (!(response * response * f.scale[j] <= 1e-46 * f.P(i, i))) return;
    }
  }
  f.columns = 1;
  f.diffuse = false;
}

void make_room(OnlineFilter& f) {
  const Index n = f.model.states(), ny = f.model.outputs(), d = f.scale.size();
  f.state = f.state_sd = VectorXd::Zero(n);
  f.delta = f.delta_score = VectorXd::Zero(d);
  f.innovation = f.innovation_sd = VectorXd::Zero(ny);
  f.delta_information = f.delta_factor = f.moved = MatrixXd::Zero(d, d);
  f.responses = MatrixXd::Zero(d, n);
  f.FP = f.F = f.P_next = f.P_filt = MatrixXd::Zero(n, n);
  f.C = MatrixXd::Zero(ny, n);
  f.Sigma = f.L = MatrixXd::Zero(ny, ny);
  f.PC = f.M = f.K = MatrixXd::Zero(n, ny);
  f.E = f.SiE = f.KR = MatrixXd::Zero(ny, 1 + n);
  f.Z_next = f.Z_filt = f.Z;
  f.solver = Eigen::SelfAdjointEigenSolver<MatrixXd>(d);
  f.present.reserve(static_cast<std::size_t>(ny));
}

}  // namespace

namespace {

void start_diffuse(OnlineFilter& f, InitialState initial) {
  const std::optional<ProperStart> start = proper_start(f.model, initial);
  if (!start) {
    throw std::invalid_argument(
        "a stationary start of states that are not stable; expected a start that is given, or a "
        "diffuse one");
  }
  f.diffuse = start->diffuse() > 0;
  f.determined = !f.diffuse;
  f.scale = start->scale;
  f.P = start->P;
  f.columns = 1 + start->diffuse();
  f.Z.leftCols(f.columns) = start->Z;
}

}  // namespace

OnlineFilter start_online_filter(const StateSpace& model, InitialState initial) {
  check_shapes(model, initial, {});
  OnlineFilter f;
  const Index n = model.states();
  f.model = model;
  f.GQG = model.G * model.Q * model.G.transpose();
  f.GS = model.G * model.S;
  f.R = model.R;
  f.Z = MatrixXd::Zero(n, 1 + n);
  if (initial == InitialState::given) {
    f.Z.col(0) = model.x0;
    f.P = model.P0;
  } else if (initial == InitialState::stationary) {
    const auto P = solve_discrete_lyapunov(model.A, f.GQG);
    if (!P) {
      throw std::invalid_argument(
          "a stationary start of a model that is not stable; expected a start that is given, or a "
          "diffuse one");
    }
    f.P = *P;
  } else {
    start_diffuse(f, initial);
  }
  make_room(f);
  return f;
}

bool step(OnlineFilter& f, const Eigen::Ref<const VectorXd>& y,
          const Eigen::Ref<const VectorXd>& u) {
  if (y.size() != f.model.outputs() || u.size() != f.model.inputs()) {
    throw std::invalid_argument(
        message({"a sample has ", y.size(), " outputs and ", u.size(), " inputs; expected ",
                 f.model.outputs(), " and ", f.model.inputs()}));
  }
  // Nor may their powers overflow, which a state would never forget.
  if (!u.array().square().allFinite() || y.array().square().isInf().any()) return false;
  find_present(f, y);
  const bool keep_gain = f.settled;
  f.innovation.setConstant(kNaN);
  f.innovation_sd.setConstant(kNaN);
  if (f.present.empty()) {
    f.K.setZero();
    f.F = f.model.A;
    f.P_filt = f.P;
    f.Z_filt = f.Z;
  } else {
    if (!keep_gain && !find_gain(f)) return false;
    innovate(f, y, u);
  }
  report_state(f);
  advance(f, u, keep_gain);
  if (f.diffuse) forget_delta(f);
  return true;
}

}  // namespace identikal
