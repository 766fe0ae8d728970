#include "lib/statistics/autocovariance.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "lib/base/constants.h"
#include "lib/filter/autocovariance_sums.h"
#include "lib/filter/steady_state.h"
#include "lib/internal/powers.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The gain without the columns of missing samples.
MatrixXd gain_at(const MatrixXd& L, const Eigen::Ref<const VectorXd>& e) {
  MatrixXd out = L;
  for (Index i = 0; i < e.size(); ++i) {
    if (std::isnan(e[i])) out.col(i).setZero();
  }
  return out;
}

// What drives the covariance of the prediction error under the gain L.
MatrixXd drive(const StateSpace& m, const MatrixXd& W, const MatrixXd& Sw, const MatrixXd& L) {
  const MatrixXd cross = Sw * L.transpose();
  return W + L * m.R * L.transpose() - cross - cross.transpose();
}

void check_gain(const StateSpace& model, const Eigen::Ref<const MatrixXd>& L) {
  check_shapes(model);
  if (L.rows() != model.states() || L.cols() != model.outputs()) {
    throw std::invalid_argument("autocovariances: the gain is not states x outputs");
  }
}

}  // namespace

SampleAutocovariances sample_autocovariances(const Eigen::Ref<const MatrixXd>& e, Index lags) {
  const Index ny = e.rows(), N = e.cols();
  if (lags < 1) throw std::invalid_argument("autocovariances: no lags");
  const auto present = (e.array() == e.array());
  SampleAutocovariances out;
  if (present.all()) {
    out.value = autocovariance_sums(e, lags);
    for (Index k = 0; k < lags; ++k) {
      out.pairs.emplace_back(
          MatrixXd::Constant(ny, ny, static_cast<double>(std::max<Index>(0, N - k))));
    }
  } else {
    out.value = autocovariance_sums(present.select(e, 0.0), lags);
    out.pairs = autocovariance_sums(present.cast<double>(), lags);
    // The transform leaves rounding in what are whole numbers.
    for (MatrixXd& pairs : out.pairs) pairs = pairs.array().round();
  }
  for (std::size_t k = 0; k < out.value.size(); ++k) {
    const auto pairs = out.pairs[k].array();
    out.value[k] = (pairs > 0.0).select(out.value[k].array() / pairs, kNaN);
  }
  return out;
}

MatrixXd constant_gain_innovations(const StateSpace& model, const Eigen::Ref<const MatrixXd>& L,
                                   const VectorXd& x0, const Eigen::Ref<const MatrixXd>& y,
                                   const Eigen::Ref<const MatrixXd>& u) {
  check_gain(model, L);
  const Index N = y.cols(), nu = model.inputs();
  if (y.rows() != model.outputs() || u.rows() != nu || (nu > 0 && u.cols() != N) ||
      x0.size() != model.states()) {
    throw std::invalid_argument("autocovariances: x0, y and u do not fit the model");
  }
  MatrixXd e(y.rows(), N);
  VectorXd x = x0, next = x0, correction(y.rows());
  for (Index t = 0; t < N; ++t) {
    e.col(t) = y.col(t);
    e.col(t).noalias() -= model.C * x;
    if (nu > 0) e.col(t).noalias() -= model.D * u.col(t);
    correction = e.col(t).array().isNaN().select(0.0, e.col(t));
    next.noalias() = model.A * x;
    next.noalias() += L * correction;
    if (nu > 0) next.noalias() += model.B * u.col(t);
    x.swap(next);
  }
  return e;
}

Autocovariances innovation_autocovariances(const StateSpace& model,
                                           const Eigen::Ref<const MatrixXd>& L, Index lags) {
  const auto out = innovation_autocovariances(model, std::vector<StateSpace>{model}, L, lags);
  return out.empty() ? Autocovariances() : out.front();
}

std::vector<Autocovariances> innovation_autocovariances(const StateSpace& model,
                                                        const std::vector<StateSpace>& noises,
                                                        const Eigen::Ref<const MatrixXd>& L,
                                                        Index lags) {
  check_gain(model, L);
  const MatrixXd F = model.A - L * model.C;
  Powers<Eigen::Dynamic> powers;
  if (!powers.compute(F)) return {};
  std::vector<Autocovariances> out;
  for (const StateSpace& noise : noises) {
    const MatrixXd Sw = model.G * noise.S;
    MatrixXd P = drive(noise, model.G * noise.Q * model.G.transpose(), Sw, L);
    powers.sum_forward(P);
    if (!P.allFinite()) return {};
    const MatrixXd PC = P * model.C.transpose();
    Autocovariances Y{model.C * PC + noise.R};
    MatrixXd state = F * PC + Sw - L * noise.R;
    for (Index k = 1; k < lags; ++k) {
      Y.emplace_back(model.C * state);
      state = (F * state).eval();
    }
    out.push_back(std::move(Y));
  }
  return out;
}

Autocovariances innovation_autocovariances(const StateSpace& model,
                                           const Eigen::Ref<const MatrixXd>& L,
                                           const Eigen::Ref<const MatrixXd>& e, Index first,
                                           Index lags) {
  check_gain(model, L);
  const Index ny = model.outputs(), N = e.cols();
  const MatrixXd F = model.A - L * model.C, Sw = model.G * model.S;
  const MatrixXd W = model.G * model.Q * model.G.transpose();
  const auto steady = solve_discrete_lyapunov(F, drive(model, W, Sw, L));
  if (!steady) return {};
  const MatrixXd present = (e.array() == e.array()).cast<double>();
  Autocovariances sum(static_cast<std::size_t>(lags), MatrixXd::Zero(ny, ny)), pairs = sum;
  // The correlations of x(t) - xhat(t) with e(t - k), k = 1 .. lags - 1, newest first.
  std::vector<MatrixXd> reach;
  MatrixXd P = *steady;
  for (Index t = 0; t < N; ++t) {
    const MatrixXd now = gain_at(L, e.col(t));
    const MatrixXd F_now = model.A - now * model.C;
    if (t >= first) {
      const auto mask = [&](Index k) {
        return MatrixXd(present.col(t) * present.col(t - k).transpose());
      };
      sum[0] += mask(0).cwiseProduct(model.C * P * model.C.transpose() + model.R);
      pairs[0] += mask(0);
      for (std::size_t k = 1; k <= reach.size(); ++k) {
        sum[k] += mask(static_cast<Index>(k)).cwiseProduct(model.C * reach[k - 1]);
        pairs[k] += mask(static_cast<Index>(k));
      }
      for (MatrixXd& r : reach) r = (F_now * r).eval();
      reach.insert(reach.begin(), F_now * P * model.C.transpose() + Sw - now * model.R);
      if (static_cast<Index>(reach.size()) > lags - 1) reach.pop_back();
    }
    P = (F_now * P * F_now.transpose() + drive(model, W, Sw, now)).eval();
  }
  for (std::size_t k = 0; k < sum.size(); ++k) sum[k] = sum[k].cwiseQuotient(pairs[k]).eval();
  return sum;
}

VectorXd stacked(const Autocovariances& Y) {
  if (Y.empty()) return {};
  const Index ny = Y[0].rows(), triangle = ny * (ny + 1) / 2;
  VectorXd out(triangle + (static_cast<Index>(Y.size()) - 1) * ny * ny);
  Index at = 0;
  for (std::size_t k = 0; k < Y.size(); ++k) {
    for (Index j = 0; j < ny; ++j) {
      for (Index i = k == 0 ? j : 0; i < ny; ++i) out[at++] = Y[k](i, j);
    }
  }
  return out;
}

MatrixXd covariance_of_autocovariances(const Autocovariances& Y, Index lags) {
  const Index ny = Y[0].rows(), reach = static_cast<Index>(Y.size()) - 1;
  const auto at = [&](Index tau) -> MatrixXd {
    if (std::abs(tau) > reach) return MatrixXd::Zero(ny, ny);
    const MatrixXd& value = Y[std::abs(tau)];
    return tau >= 0 ? value : MatrixXd(value.transpose());
  };
  // Both sums are correlations of pairs of entries, one for each distance between the lags:
  //   sum_tau Y_(tau+d)(i,p) Y_tau(j,q), d = k - l, and, with tau moved by l, d = k + l of the
  //   entries (i,q) and (j,p).
  const Index most = 2 * (lags - 1), entries = ny * ny;
  MatrixXd Gamma(entries, 2 * reach + 1);
  for (Index tau = -reach; tau <= reach; ++tau) Gamma.col(tau + reach) = at(tau).reshaped();
  std::vector<MatrixXd> correlation;  // [d + lags - 1]: entries x entries
  for (Index d = -(lags - 1); d <= most; ++d) {
    const Index count = std::max<Index>(0, 2 * reach + 1 - std::abs(d));
    const Index ahead = std::max<Index>(0, d), behind = std::max<Index>(0, -d);
    correlation.emplace_back(Gamma.middleCols(ahead, count) *
                             Gamma.middleCols(behind, count).transpose());
  }
  struct Entry {
    Index k, i, j;
  };
  std::vector<Entry> order;
  for (Index k = 0; k < lags; ++k) {
    for (Index j = 0; j < ny; ++j) {
      for (Index i = k == 0 ? j : 0; i < ny; ++i) order.push_back({k, i, j});
    }
  }
  const auto size = static_cast<Index>(order.size());
  MatrixXd out(size, size);
  for (Index a = 0; a < size; ++a) {
    const Entry& x = order[a];
    for (Index b = 0; b <= a; ++b) {
      const Entry& z = order[b];
      const MatrixXd& near = correlation[x.k - z.k + lags - 1];
      const MatrixXd& far = correlation[x.k + z.k + lags - 1];
      out(a, b) = out(b, a) =
          near(x.i + ny * z.i, x.j + ny * z.j) + far(x.i + ny * z.j, x.j + ny * z.i);
    }
  }
  return out;
}

}  // namespace identikal
