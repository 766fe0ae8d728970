// Which entries of a matrix do parameters move, and how? Internal to the filter.
#pragma once

#include <cstddef>
#include <new>
#include <vector>

#include <Eigen/Core>

#include "lib/model/state_space.h"

namespace identikal {

// Vectors of eight numbers that lie across two lines of the cache take twice as long to load.
template <typename T>
struct LineAllocator {
  using value_type = T;
  static constexpr std::align_val_t kLine{64};
  LineAllocator() = default;
  template <typename U>
  explicit LineAllocator(const LineAllocator<U>&) {}
  T* allocate(std::size_t count) {
    return static_cast<T*>(::operator new(count * sizeof(T), kLine));
  }
  void deallocate(T* at, std::size_t) { ::operator delete(at, kLine); }
  bool operator==(const LineAllocator&) const { return true; }
};
using Lanes = std::vector<double, LineAllocator<double>>;

/// Of the rows asked for, row by row; the derivatives in lanes as tangent_kernel.h has them.
struct MovedEntries {
  std::vector<int> row, column;
  Lanes by;  ///< the first lane is zero
};

MovedEntries moved_entries(const std::vector<StateSpace>& derivatives,
                           const Eigen::MatrixXd StateSpace::*matrix, const std::vector<int>& rows,
                           std::size_t lanes);

}  // namespace identikal
