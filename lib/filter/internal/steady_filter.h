// The Kalman predictor with constant gain, for a number of states known at compile time (or
// Dynamic). Others use lib/filter/steady_state.h and lib/filter/likelihood.h.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include "lib/internal/powers.h"
#include "lib/internal/small_product.h"
#include "lib/model/state_space.h"

namespace identikal {

/// Outputs, or outputs and inputs together, that matrices kept on the stack have room for.
inline constexpr int kMaxChannels = 16;
template <int channels>
using ChannelSquare = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, channels, channels>;
using SmallMatrix = ChannelSquare<kMaxChannels>;
/// One column of n numbers per channel.
template <int n, int channels = kMaxChannels>
using ChannelColumns = Eigen::Matrix<double, n, Eigen::Dynamic,
                                     n == 1 ? Eigen::RowMajor : Eigen::ColMajor, n, channels>;

///   P = A P A' + G Q G' - K Sigma K',  Sigma = C P C' + R,
///   K = (A P C' + G S) Sigma^-1,       F = A - K C.
/// @tparam channels  most outputs; Dynamic = any, on the heap
template <int n, int channels = kMaxChannels>
struct SteadySolution {
  using Square = Eigen::Matrix<double, n, n>;
  using Columns = ChannelColumns<n, channels>;
  using OutputSquare = ChannelSquare<channels>;

  Square A, W, P, F;       // W = G Q G'
  Columns Ct, Sw, PCt, K;  // C', G S, P C', gain
  OutputSquare Sigma, Sigma_inverse;
  Eigen::LLT<OutputSquare> llt;
  Powers<n> powers;
  bool slow = false;  ///< solve() gave up

  /// @param longest  give up once it is certain that the filter takes longer to settle
  /// @return false when there is no stabilising solution: a mode that does not decay and is not
  ///         observed, or is not excited; or a singular Sigma.
  bool solve(const StateSpace& model,
             Eigen::Index longest = std::numeric_limits<Eigen::Index>::max()) {
    longest_ = longest;
    slow = false;
    A = model.A;
    Ct = model.C.transpose();
    set_product(work_, model.G, model.Q);
    set_product(W, work_, model.G.transpose());
    set_product(Sw, model.G, model.S);
    const bool doubled = start_by_doubling(model);
    if (!doubled && (slow || endless_ || !start_by_iteration(model))) return false;
    // Newton's method (Kleinman 1968) polishes: the gain's error enters P squared.
    constexpr int kRounds = 12;
    for (int round = 0; round < kRounds; ++round) {
      if (!gain(model)) return false;
      if (!powers.compute(F)) {
        // Where w and v are the same noise P = 0 is a solution, of a filter that may be unstable; the recursion
        // comes down to the other one.
        if (round > 0 || !doubled || !start_by_iteration(model)) return false;
        if (!gain(model) || !powers.compute(F)) return false;
      }
      Square next = W;
      noise_of_gain(model, next);
      powers.sum_forward(next);
      symmetrise(next);
      if (!next.allFinite()) return false;
      const bool done = close(P, next, 1e-11, noise_size());
      // Where w and v are the same noise nothing is left of P but rounding, which no round makes smaller.
      const bool rounding = round == kRounds - 1 && close(P, next, 1e-7, noise_size());
      P = next;
      if (done || rounding) return gain(model) && powers.compute(F);
    }
    return false;
  }

 private:
  Eigen::MatrixXd work_;  // G Q
  OutputSquare R_inverse_;
  Eigen::Index longest_ = 0;
  bool endless_ = false;  // a variance falls, or grows, for ever: no recursion comes to an end

  bool gain(const StateSpace& model) {
    set_product(PCt, P, Ct);
    Sigma = model.R;
    add_product(Sigma, Ct.transpose(), PCt);
    llt.compute(Sigma);
    if (llt.info() != Eigen::Success) return false;
    Sigma_inverse.setIdentity(Sigma.rows(), Sigma.cols());
    llt.solveInPlace(Sigma_inverse);
    K_Sigma_ = Sw;
    add_product(K_Sigma_, A, PCt);
    K.resize(K_Sigma_.rows(), K_Sigma_.cols());
    // Not by the inverse, which loses digits where outputs are nearly copies of each other.
    for (Eigen::Index i = 0; i < K_Sigma_.rows(); ++i) {
      row_ = K_Sigma_.row(i).transpose();
      llt.solveInPlace(row_);
      K.row(i) = row_.transpose();
    }
    F = A;
    add_product(F, K, Ct.transpose(), -1.0);
    return true;
  }

  // += K R K' - K (G S)' - (G S) K'
  void noise_of_gain(const StateSpace& model, Square& to) {
    set_product(K_R_, K, model.R);
    add_product(to, K_R_, K.transpose());
    add_product(to, K, Sw.transpose(), -1.0);
    add_product(to, Sw, K.transpose(), -1.0);
  }

  using Size = Eigen::Matrix<double, n, 1>;

  // Variances that cancel in P where w and v are nearly the same noise.
  Size noise_size() const {
    Size out = W.diagonal();
    for (Eigen::Index i = 0; i < out.size(); ++i) {
      for (Eigen::Index j = 0; j < K_R_.cols(); ++j) out[i] += K_R_(i, j) * K(i, j);
    }
    if ((out.array() == 0.0).any()) measure_copies(out);
    return out;
  }

  // States without noise of their own are measured against what innovations, or states that move them,
  // are: of outputs measured exactly, those before are known but for rounding.
  void measure_copies(Size& size) const {
    constexpr double kRounding = 1e-12;
    const auto noiseless = (size.array() == 0.0).eval();
    const Eigen::Index states = size.size();
    for (Eigen::Index i = 0; i < states; ++i) {
      if (noiseless[i]) size[i] = K.row(i).dot(Sigma * K.row(i).transpose());
    }
    bool more = true;
    for (Eigen::Index round = 0; more && round < states; ++round) {
      more = false;
      for (Eigen::Index i = 0; i < states; ++i) {
        const double from = A.row(i).transpose().cwiseAbs2().cwiseProduct(size).maxCoeff();
        if (!noiseless[i] || size[i] >= kRounding * from) continue;
        size[i] = from;
        more = true;
      }
    }
  }

  // Entries are measured against the standard deviations they belong to, of P or, a hundredth, of
  // `size`: finer than the rounding of that they do not get.
  static bool close(const Square& before, const Square& after, double tolerance, const Size& size) {
    constexpr double kFloor = 1e-4;
    const auto deviation = [&](Eigen::Index i) {
      return std::sqrt(std::max(std::abs(after(i, i)), kFloor * size[i]));
    };
    for (Eigen::Index j = 0; j < after.rows(); ++j) {
      for (Eigen::Index i = 0; i <= j; ++i) {
        const double scale = deviation(i) * deviation(j);
        if (std::abs(after(i, j) - before(i, j)) > tolerance * scale) return false;
      }
    }
    return true;
  }

  // Structure-preserving doubling (Chu, Fan & Lin 2005) on the equation with S and R eliminated.
  // Step k stands for 2^k steps of the Riccati recursion from P = 0.
  bool start_by_doubling(const StateSpace& model) {
    endless_ = false;
    llt.compute(model.R);
    if (llt.info() != Eigen::Success) return false;
    const auto diagonal = llt.matrixLLT().diagonal();
    for (Eigen::Index i = 0; i < diagonal.size(); ++i) {
      if (!(diagonal[i] * diagonal[i] > 1e-10 * model.R(i, i))) return false;
    }
    R_inverse_.setIdentity(model.R.rows(), model.R.cols());
    llt.solveInPlace(R_inverse_);
    set_product(PCt, Ct, R_inverse_);
    Square G, H = W, Ak = A.transpose(), step, inverse, Gk;
    set_product(G, PCt, Ct.transpose());
    if (!Sw.isZero(0.0)) {
      add_product(Ak, PCt, Sw.transpose(), -1.0);
      set_product(K, Sw, R_inverse_);
      add_product(H, K, Sw.transpose(), -1.0);
    }
    bool neared = false;  // what rounding keeps from settling, the recursion may settle
    // Settled to 1e-9 after 2^k steps, it takes twice as many to forget to rounding.
    for (int k = 0; k < 50 && !slow; ++k) {
      slow = (Eigen::Index(1) << k) > longest_;
      step.setIdentity(A.rows(), A.cols());
      add_product(step, G, H);
      inverse = step.inverse();
      set_product(Gk, inverse, G);
      set_product(step, Ak, Gk);
      set_product(Gk, step, Ak.transpose());
      add_with_transpose(G, Gk, 0.5);
      set_product(Gk, inverse, Ak);  // W^-1 A
      set_product(step, Ak.transpose(), H);
      set_product(inverse, step, Gk);  // the increase of H
      P = H;
      add_with_transpose(P, inverse, 0.5);
      set_product(step, Ak, Gk);
      Ak = step;
      if (!P.allFinite()) return false;
      if (close(H, P, 1e-9, Size::Zero(A.rows()))) {
        slow = false;
        return true;
      }
      neared = neared || close(H, P, 1e-5, Size::Zero(A.rows()));
      H = P;
    }
    endless_ = !neared;
    return false;
  }

  // R is singular, or nearly: the recursion itself, which only ever inverts Sigma.
  bool start_by_iteration(const StateSpace& model) {
    Powers<n> open_loop;
    // The covariance without measurements, from which the recursion descends; where A is not stable
    // there is none, and any positive definite start will do.
    P = W;
    constexpr int kForgetful = 20;  // doublings: roots of 1 that rounding has moved take more
    if (open_loop.compute(A) && open_loop.count() <= kForgetful) {
      open_loop.sum_forward(P);
    } else {
      P.diagonal().array() += 1.0;
    }
    Square next, step;
    for (int k = 0; k < 2000 && !slow; ++k) {
      slow = k > longest_;
      if (!gain(model)) return false;
      set_product(step, F, P);
      next = W;
      add_product(next, step, F.transpose());
      noise_of_gain(model, next);
      symmetrise(next);
      if (!next.allFinite()) return false;
      const bool done = close(P, next, 1e-9, noise_size());
      P = next;
      if (done) {
        slow = false;
        return true;
      }
    }
    return false;
  }

  Columns K_Sigma_, K_R_;
  Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, channels, 1> row_;
};

}  // namespace identikal
