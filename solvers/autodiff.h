// Numbers that carry derivatives, for functions that are templates on their scalar.
#pragma once

#include <Eigen/Core>
#include <array>
#include <ceres/jet.h>
#include <stdexcept>
#include <type_traits>

namespace identikal {

/// A value and its derivatives with respect to N variables.
template <int N>
using Dual = ceres::Jet<double, N>;

/// Calls f(std::integral_constant<int, N>) with the smallest N of a fixed list that is at least n, so that
/// few variables cost little: the number of derivatives is a compile-time size.
/// @throws std::invalid_argument for n above 20
template <typename F>
decltype(auto) with_dual_size(Eigen::Index n, F&& f) {
  if (n <= 4) return f(std::integral_constant<int, 4>());
  if (n <= 6) return f(std::integral_constant<int, 6>());
  if (n <= 8) return f(std::integral_constant<int, 8>());
  if (n <= 12) return f(std::integral_constant<int, 12>());
  if (n <= 20) return f(std::integral_constant<int, 20>());
  throw std::invalid_argument("more than 20 variables to differentiate by");
}

/// Value and gradient of f(std::array<T, N>) -> T at x.
template <std::size_t N, typename F>
std::pair<double, Eigen::Matrix<double, static_cast<int>(N), 1>> value_and_gradient(
    const std::array<double, N>& x, F&& f) {
  std::array<Dual<static_cast<int>(N)>, N> variables;
  for (std::size_t i = 0; i < N; ++i) {
    variables[i] = Dual<static_cast<int>(N)>(x[i], static_cast<int>(i));
  }
  const Dual<static_cast<int>(N)> y = f(variables);
  return {y.a, y.v};
}

}  // namespace identikal
