// Along what can an estimate still move, where some of its entries lie on a boundary?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/noise/internal/covariance_factors.h"
#include "identify/noise/internal/root_coordinates.h"

namespace identikal {

/// The free entries (lib/model/parameter.h) near an estimate as a function of numbers t, one for
/// each direction in which it is free:
///
/// a number inside its bounds moves by itself, one at a bound stays there; coefficients of a polynomial
/// with roots on the unit circle move along it, by the partial autocorrelations that it does
/// not hold: off it the likelihood of a moving average has no slope, whatever the data (it is the same
/// for the images of the roots outside); a covariance of rank r
/// moves among those of rank r,
///   Q(t) = F F', F = F(0) + sum_j t_j B_j, n x r,
/// with B_j that change Q, n r - r (r - 1)/2 of them. The likelihood as a function of t has
/// its maximum at zero, and its curvature there holds that of the cone.
class FreeDirections {
 public:
  /// @param entries      the estimate, z
  /// @param at_bound     of each entry; those of covariances are not looked at
  /// @param covariances  at the estimate
  /// @param polynomials  at the estimate, with roots on the unit circle
  /// @param gradient     of the log-likelihood by the entries
  /// @param information  by the entries. What could be set to zero without the log-likelihood
  ///   falling by more than 1e-4 counts as zero.
  FreeDirections(const Eigen::VectorXd& entries, const std::vector<bool>& at_bound,
                 const std::vector<CovarianceEntries>& covariances,
                 const std::vector<RootsOnCircle>& polynomials, const Eigen::VectorXd& gradient,
                 const Eigen::MatrixXd& information);

  Eigen::Index size() const { return size_; }
  /// z(t)
  Eigen::VectorXd entries(const Eigen::VectorXd& t) const;
  /// dz/dt at t
  Eigen::MatrixXd jacobian(const Eigen::VectorXd& t) const;
  /// Entry of the number that direction j moves, or -1.
  Eigen::Index number(Eigen::Index j) const;
  /// The covariances that have lost rank.
  std::vector<CovarianceEntries> singular() const;

 private:
  struct Factor {
    CovarianceEntries of;
    Eigen::Index first;                  // of its directions
    Eigen::MatrixXd start;               // n x r
    std::vector<Eigen::MatrixXd> moves;  // n x r each
  };
  struct Polynomial {
    RootsOnCircle of;
    Eigen::Index first;     // of its directions
    Eigen::MatrixXd moves;  // of the partial autocorrelations, by direction
  };
  Eigen::VectorXd partial_at(const Polynomial& polynomial, const Eigen::VectorXd& t) const;
  Eigen::MatrixXd factor_at(const Factor& factor, const Eigen::VectorXd& t) const;

  Eigen::VectorXd at_;
  std::vector<Eigen::Index> numbers_;  // entries that move by themselves
  std::vector<Factor> factors_;
  std::vector<Polynomial> polynomials_;
  Eigen::Index size_ = 0;
};

}  // namespace identikal
