// Autocovariances of a filter's innovations: as they are in a recording, as a model says they
// should be, and how far the two may lie apart by chance.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/model/state_space.h"

namespace identikal {

/// Y_k, k = 0 .. lags - 1, each ny x ny: E e(t+k) e(t)', or its sample value.
using Autocovariances = std::vector<Eigen::MatrixXd>;

struct SampleAutocovariances {
  /// Mean of e_i(t+k) e_j(t) over the pairs present; NaN where there is none.
  Autocovariances value;
  Autocovariances pairs;  ///< how many pairs that is
};

/// The unbiased estimate: every entry is divided by its own number of pairs.
/// @param e  ny x N, NaN = missing
/// Source: Matisko (2013), (4.13), not transposed as printed there: Y_k = E e(t+k) e(t)'.
SampleAutocovariances sample_autocovariances(const Eigen::Ref<const Eigen::MatrixXd>& e,
                                             Eigen::Index lags);

/// Innovations e = y - C x - D u of the filter x+ = A x + B u + L e with a constant gain, which
/// need not be the optimal one. A missing sample gives no innovation and no correction.
/// @param L  n x ny     @param x0  n, the prediction of the first state
/// @param y  ny x N, NaN = missing     @param u  nu x N
/// @return ny x N, NaN where y is
Eigen::MatrixXd constant_gain_innovations(const StateSpace& model,
                                          const Eigen::Ref<const Eigen::MatrixXd>& L,
                                          const Eigen::VectorXd& x0,
                                          const Eigen::Ref<const Eigen::MatrixXd>& y,
                                          const Eigen::Ref<const Eigen::MatrixXd>& u);

/// What the autocovariances of those innovations are, with F = A - L C:
///
///   P = F P F' + G Q G' + L R L' - G S L' - L S' G'
///   Y_0 = C P C' + R,   Y_k = C F^(k-1) (F P C' + G S - L R)
///
/// They are linear in Q, R, S, which need not be definite: with a basis of these they are the
/// columns of the least-squares problem.
///
/// Example:
///
///     const Eigen::MatrixXd L = steady_state(model).value().K;  // or any other gain
///     const auto innovations = constant_gain_innovations(model, L, model.x0, y, u);
///     const Autocovariances seen = sample_autocovariances(innovations, 20).value;
///     const Autocovariances expected = innovation_autocovariances(model, L, 20);
///
/// @return empty when F is not stable
/// Source: Matisko (2013), (4.6) to (4.8), with G in (4.19) and S added (Akesson et al. 2008).
Autocovariances innovation_autocovariances(const StateSpace& model,
                                           const Eigen::Ref<const Eigen::MatrixXd>& L,
                                           Eigen::Index lags);

/// The same with Q, R and S of each of `noises` in place of the model's, the powers of F shared.
/// @return empty when F is not stable
std::vector<Autocovariances> innovation_autocovariances(const StateSpace& model,
                                                        const std::vector<StateSpace>& noises,
                                                        const Eigen::Ref<const Eigen::MatrixXd>& L,
                                                        Eigen::Index lags);

/// The same where samples are missing: the mean of E e_i(t+k) e_j(t) over the pairs that are
/// present in `e` from sample `first` on. The covariance of the prediction error follows the gaps.
/// @return empty when F is not stable
Autocovariances innovation_autocovariances(const StateSpace& model,
                                           const Eigen::Ref<const Eigen::MatrixXd>& L,
                                           const Eigen::Ref<const Eigen::MatrixXd>& e,
                                           Eigen::Index first, Eigen::Index lags);

/// Entries as one vector: of Y_0 the lower triangle, of Y_1, Y_2, ... all, column by column.
Eigen::VectorXd stacked(const Autocovariances& Y);

/// N times the covariance of stacked(sample autocovariances) of a long Gaussian record, from its
/// true ones (Isserlis' theorem):
///
///   cov(Y_k(i,j), Y_l(p,q)) = sum_tau [ Y_(tau+k-l)(i,p) Y_tau(j,q) + Y_(tau+k)(i,q)
///   Y_(tau-l)(j,p) ]
///
/// @param Y     true autocovariances up to where they vanish, at least `lags` of them
/// @param lags  of the sample autocovariances
Eigen::MatrixXd covariance_of_autocovariances(const Autocovariances& Y, Eigen::Index lags);

}  // namespace identikal
