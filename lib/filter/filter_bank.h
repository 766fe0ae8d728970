// What do many Kalman filters, of one model with noise of their own, say about the same samples?
#pragma once

#include <cstddef>
#include <new>
#include <vector>

#include <Eigen/Core>

#include "lib/model/state_space.h"

namespace identikal {

/// Memory for vectors of any width.
template <class T>
struct CacheLineAllocator {
  using value_type = T;
  static constexpr std::align_val_t kLine{64};
  CacheLineAllocator() = default;
  template <class Other>
  CacheLineAllocator(const CacheLineAllocator<Other>&) {}
  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), kLine)); }
  void deallocate(T* p, std::size_t) { ::operator delete(p, kLine); }
  bool operator==(const CacheLineAllocator&) const { return true; }
};

/// Filters with A, B, C, D in common and G Q G', G S, R of their own, each with the prediction of
/// its state for the next sample. The arrays hold element e of member i at [e * lanes + i].
struct FilterBank {
  using Lanes = std::vector<double, CacheLineAllocator<double>>;
  Eigen::MatrixXd A, B, C, D;
  Eigen::Index members = 0;
  std::size_t lanes = 0;   ///< members, rounded up
  Lanes x, P, GQG, GS, R;  ///< symmetric ones: lower triangle by columns
  /// Room for one step: y - D u and C of the channels present, B u, log-densities, the kernel's
  /// own.
  Lanes rest, C_present, drive, log_density, scratch;
  std::vector<int> present;
  Eigen::Index states() const { return A.rows(); }
  Eigen::Index outputs() const { return C.rows(); }
};

/// Members without noise and with a state of zero. @param shared  A, B, C, D are used
/// @throws std::invalid_argument for no member
FilterBank filter_bank(const StateSpace& shared, Eigen::Index members);

/// The noise of one member from now on. @param noise  G, Q, S, R are used
void set_noise(FilterBank& bank, Eigen::Index member, const StateSpace& noise);

/// The prediction of one member for the next sample. @param x  n  @param P  n x n
void set_state(FilterBank& bank, Eigen::Index member, const Eigen::Ref<const Eigen::VectorXd>& x,
               const Eigen::Ref<const Eigen::MatrixXd>& P);

/// Noise and prediction of member `from` of one bank to member `to` of another of the same model.
void copy_member(const FilterBank& source, Eigen::Index from, FilterBank& target, Eigen::Index to);

/// Every member takes a sample, in Joseph form (lib/filter/kalman.h); works with the widest vectors
/// of the machine, and without allocation.
///
/// Example:
///
///     FilterBank bank = filter_bank(model, 1);
///     set_noise(bank, 0, model);
///     set_state(bank, 0, model.x0, model.P0);
///     Eigen::VectorXd log_density(1);
///     step(bank, y.col(0), u.col(0), log_density);
///
/// @param y            ny, NaN = missing
/// @param u            nu
/// @param log_density  members: receives log p(y | samples before); -infinity where the innovation
///                     covariance is not positive definite or the filter has overflowed
void step(FilterBank& bank, const Eigen::Ref<const Eigen::VectorXd>& y,
          const Eigen::Ref<const Eigen::VectorXd>& u, Eigen::Ref<Eigen::VectorXd> log_density);

/// Mean and covariance of the mixture of the members' predictions, and its mean R.
struct Mixture {
  Eigen::VectorXd x;
  Eigen::MatrixXd P;  ///< sum_i w_i (P_i + (x_i - x)(x_i - x)')
  Eigen::MatrixXd R;
  Eigen::VectorXd away;  ///< room to work in
};
/// @param weight  members, non-negative, with sum one; members of weight zero are not looked at
Mixture mixture(const FilterBank& bank, const Eigen::Ref<const Eigen::VectorXd>& weight);
/// The same into `out`, whose memory is used again.
void mixture(const FilterBank& bank, const Eigen::Ref<const Eigen::VectorXd>& weight, Mixture& out);

}  // namespace identikal
