// How many independent sources of process noise do the data require? The trade-off between fit and
// rank of Q.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/estimate/details.h"
#include "identify/estimate/estimate.h"
#include "solvers/psd_least_squares.h"

namespace identikal {

/// 1/2 |design theta - target|^2.
struct Misfit {
  Eigen::MatrixXd design;
  Eigen::VectorXd target;
};

struct MinimumRankProblem {
  Misfit fit;                          ///< what the method minimises
  Misfit chance;                       ///< the same whitened: its residuals have unit variance
  Eigen::MatrixXd constant;            ///< [Q S; S' R] at theta = 0
  std::vector<Eigen::MatrixXd> basis;  ///< its derivatives with respect to theta
  Eigen::Index process_noises = 0;     ///< size of Q
  std::vector<PsdBlock> limits;        ///< bounds of theta
};

struct MinimumRank {
  Eigen::VectorXd theta;
  RankSelection report;
};

/// Follows the minimum of
///
///   fit(theta) + penalty tr Q(theta),  [Q S; S' R] positive semidefinite,
///
/// from the penalty at which Q vanishes down to none: as it grows, Q loses rank. The penalty also
/// shrinks what it keeps; so on the way the fit is repeated without it, Q confined to the range
/// that it has there, and to the leading parts of that. Of the ranges with as many sources the one
/// is taken whose re-fit is best. The number picked is the smallest whose re-fit exceeds the
/// minimum over all Q by no more chi-square than chance allows at 99 %, with as many degrees of
/// freedom as unknowns were given up. theta is the method's own re-fit of that range: the penalised
/// one is biased. Sources: Rajamani & Rawlings (2009), Automatica 45 (the penalty, and a curve to
/// look at); the re-fit as in Meinshausen (2007), Relaxed Lasso, Comput. Stat. Data Anal. 52.
MinimumRank minimum_rank(const MinimumRankProblem& problem);

}  // namespace identikal
