// Numbers that carry derivatives, for functions that are templates on their scalar.
#pragma once

#include <array>
#include <cmath>
#include <utility>

#include <Eigen/Core>

namespace identikal {

/// A value and its derivatives with respect to N variables (forward mode, exact).
template <int N>
struct Dual {
  double a = 0.0;             ///< value
  std::array<double, N> v{};  ///< derivatives

  Dual() = default;
  explicit Dual(double value) : a(value) {}
  /// The variable number `index`.
  Dual(double value, int index) : a(value) { v[index] = 1.0; }

  Dual& operator+=(const Dual& y) { return *this = *this + y; }
};

namespace detail {
/// value, with derivatives p x' + q y'.
template <int N>
[[gnu::always_inline]] inline Dual<N> chain(double value, double p, const Dual<N>& x, double q,
                                            const Dual<N>& y) {
  Dual<N> out(value);
  for (std::size_t i = 0; i < N; ++i) out.v[i] = p * x.v[i] + q * y.v[i];
  return out;
}
/// value, with derivatives p x'.
template <int N>
[[gnu::always_inline]] inline Dual<N> chain(double value, double p, const Dual<N>& x) {
  Dual<N> out(value);
  for (std::size_t i = 0; i < N; ++i) out.v[i] = p * x.v[i];
  return out;
}
}  // namespace detail

template <int N>
[[gnu::always_inline]] inline Dual<N> operator+(const Dual<N>& x, const Dual<N>& y) {
  return detail::chain(x.a + y.a, 1.0, x, 1.0, y);
}
template <int N>
[[gnu::always_inline]] inline Dual<N> operator-(const Dual<N>& x, const Dual<N>& y) {
  return detail::chain(x.a - y.a, 1.0, x, -1.0, y);
}
template <int N>
[[gnu::always_inline]] inline Dual<N> operator*(const Dual<N>& x, const Dual<N>& y) {
  return detail::chain(x.a * y.a, y.a, x, x.a, y);
}
template <int N>
[[gnu::always_inline]] inline Dual<N> operator/(const Dual<N>& x, const Dual<N>& y) {
  const double inverse = 1.0 / y.a, ratio = x.a * inverse;
  return detail::chain(ratio, inverse, x, -ratio * inverse, y);
}
template <int N>
[[gnu::always_inline]] inline Dual<N> operator-(const Dual<N>& x) {
  return detail::chain(-x.a, -1.0, x);
}

template <int N>
[[gnu::always_inline]] inline Dual<N> operator+(const Dual<N>& x, double y) {
  return detail::chain(x.a + y, 1.0, x);
}
template <int N>
[[gnu::always_inline]] inline Dual<N> operator+(double x, const Dual<N>& y) {
  return y + x;
}
template <int N>
[[gnu::always_inline]] inline Dual<N> operator-(const Dual<N>& x, double y) {
  return x + -y;
}
template <int N>
[[gnu::always_inline]] inline Dual<N> operator-(double x, const Dual<N>& y) {
  return detail::chain(x - y.a, -1.0, y);
}
template <int N>
[[gnu::always_inline]] inline Dual<N> operator*(const Dual<N>& x, double y) {
  return detail::chain(x.a * y, y, x);
}
template <int N>
[[gnu::always_inline]] inline Dual<N> operator*(double x, const Dual<N>& y) {
  return y * x;
}
template <int N>
[[gnu::always_inline]] inline Dual<N> operator/(const Dual<N>& x, double y) {
  return x * (1.0 / y);
}
template <int N>
[[gnu::always_inline]] inline Dual<N> operator/(double x, const Dual<N>& y) {
  const double ratio = x / y.a;
  return detail::chain(ratio, -ratio / y.a, y);
}

template <int N>
bool operator<(const Dual<N>& x, double y) {
  return x.a < y;
}

template <int N>
Dual<N> abs(const Dual<N>& x) {
  return x.a < 0.0 ? -x : x;
}
template <int N>
Dual<N> sqrt(const Dual<N>& x) {
  const double root = std::sqrt(x.a);
  return detail::chain(root, 0.5 / root, x);
}
template <int N>
bool operator<(double x, const Dual<N>& y) {
  return x < y.a;
}

template <int N>
Dual<N> cos(const Dual<N>& x) {
  return detail::chain(std::cos(x.a), -std::sin(x.a), x);
}
template <int N>
Dual<N> sin(const Dual<N>& x) {
  return detail::chain(std::sin(x.a), std::cos(x.a), x);
}
template <int N>
Dual<N> tanh(const Dual<N>& x) {
  const double value = std::tanh(x.a);
  return detail::chain(value, 1.0 - value * value, x);
}
template <int N>
Dual<N> atan2(const Dual<N>& y, const Dual<N>& x) {
  const double scale = 1.0 / (x.a * x.a + y.a * y.a);
  return detail::chain(std::atan2(y.a, x.a), x.a * scale, y, -y.a * scale, x);
}

/// Value and gradient of f(std::array<T, N>) -> T at x.
///
/// Example:
///
///     const auto [range, gradient] = value_and_gradient(  // of a throw at 20 m/s and 40 degrees
///         std::array{20.0, 0.7}, [](const auto& x) { return x[0] * x[0] * sin(2 * x[1]) / 10; });
template <std::size_t N, typename F>
std::pair<double, Eigen::Matrix<double, static_cast<int>(N), 1>> value_and_gradient(
    const std::array<double, N>& x, F&& f) {
  using T = Dual<static_cast<int>(N)>;
  std::array<T, N> variables;
  for (std::size_t i = 0; i < N; ++i) variables[i] = T(x[i], static_cast<int>(i));
  const T y = f(variables);
  return {y.a, Eigen::Map<const Eigen::Matrix<double, static_cast<int>(N), 1>>(y.v.data())};
}

}  // namespace identikal
