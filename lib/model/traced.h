// How does a C++ function become formulas? It runs once on values that write down what is done with
// them; so a user's own dynamics get exact derivatives, shared operations and the speed of a tape.
#pragma once

#include <vector>

#include "lib/model/nonlinear_model.h"

namespace identikal {

/// A number that is being written down: a node of a graph, or a constant. Comparisons give a
/// condition, not a bool, so that `if (x > 0)` does not compile: what is taken must not depend on
/// the values at hand. Write where(x > 0, a, b).
class Traced {
 public:
  Traced() = default;
  Traced(double value) : value_(value) {}  // NOLINT: constants convert, as they do to double
  Traced(FormulaGraph& graph, FormulaGraph::Id id) : graph_(&graph), id_(id) {}

  /// Its node in the graph. @throws std::invalid_argument when it belongs to another graph
  FormulaGraph::Id in(FormulaGraph& graph) const;

  /// An operation on up to three of them. @throws std::invalid_argument when graphs differ
  static Traced of(Op op, const Traced& a, const Traced& b, const Traced& c);
  static Traced of(Op op, const Traced& a, const Traced& b) { return of(op, a, b, {}); }
  static Traced of(Op op, const Traced& a) { return of(op, a, {}, {}); }

 private:
  FormulaGraph* graph_ = nullptr;  // null: a constant
  FormulaGraph::Id id_ = -1;
  double value_ = 0.0;
};

inline Traced operator+(const Traced& a, const Traced& b) { return Traced::of(Op::add, a, b); }
inline Traced operator-(const Traced& a, const Traced& b) { return Traced::of(Op::subtract, a, b); }
inline Traced operator*(const Traced& a, const Traced& b) { return Traced::of(Op::multiply, a, b); }
inline Traced operator/(const Traced& a, const Traced& b) { return Traced::of(Op::divide, a, b); }
inline Traced operator-(const Traced& a) { return Traced::of(Op::negate, a); }
inline Traced& operator+=(Traced& a, const Traced& b) { return a = a + b; }
inline Traced& operator-=(Traced& a, const Traced& b) { return a = a - b; }
inline Traced& operator*=(Traced& a, const Traced& b) { return a = a * b; }
inline Traced& operator/=(Traced& a, const Traced& b) { return a = a / b; }
inline Traced operator<(const Traced& a, const Traced& b) { return Traced::of(Op::less, a, b); }
inline Traced operator<=(const Traced& a, const Traced& b) {
  return Traced::of(Op::less_equal, a, b);
}
inline Traced operator>(const Traced& a, const Traced& b) { return Traced::of(Op::greater, a, b); }
inline Traced operator>=(const Traced& a, const Traced& b) {
  return Traced::of(Op::greater_equal, a, b);
}
inline Traced where(const Traced& condition, const Traced& then, const Traced& otherwise) {
  return Traced::of(Op::choose, condition, then, otherwise);
}
/// The same where the function runs on numbers.
inline double where(bool condition, double then, double otherwise) {
  return condition ? then : otherwise;
}
inline Traced sin(const Traced& a) { return Traced::of(Op::sin, a); }
inline Traced cos(const Traced& a) { return Traced::of(Op::cos, a); }
inline Traced tan(const Traced& a) { return Traced::of(Op::tan, a); }
inline Traced asin(const Traced& a) { return Traced::of(Op::asin, a); }
inline Traced acos(const Traced& a) { return Traced::of(Op::acos, a); }
inline Traced atan(const Traced& a) { return Traced::of(Op::atan, a); }
inline Traced atan2(const Traced& y, const Traced& x) { return Traced::of(Op::atan2, y, x); }
inline Traced sinh(const Traced& a) { return Traced::of(Op::sinh, a); }
inline Traced cosh(const Traced& a) { return Traced::of(Op::cosh, a); }
inline Traced tanh(const Traced& a) { return Traced::of(Op::tanh, a); }
inline Traced exp(const Traced& a) { return Traced::of(Op::exp, a); }
inline Traced log(const Traced& a) { return Traced::of(Op::log, a); }
inline Traced sqrt(const Traced& a) { return Traced::of(Op::sqrt, a); }
inline Traced abs(const Traced& a) { return Traced::of(Op::abs, a); }
inline Traced pow(const Traced& a, const Traced& b) { return Traced::of(Op::power, a, b); }
inline Traced hypot(const Traced& a, const Traced& b) { return Traced::of(Op::hypot, a, b); }

/// Sizes of a model that is given as a function.
struct ModelSizes {
  int states = 0, inputs = 0, parameters = 0, outputs = 0;
  bool continuous = true;
};

/// The symbols of a model with these sizes, as a function's arguments.
struct TracedArguments {
  std::vector<Traced> x, u, p;
  Traced time;
};
FormulaNodes untraced_nodes(const ModelSizes& sizes);
TracedArguments traced_arguments(FormulaNodes& nodes);

/// The formulas of a function object with
///
///   void dynamics(const T* x, const T* u, const T* p, T t, T* f) const;
///   void outputs(const T* x, const T* u, const T* p, T t, T* y) const;
///
/// templates of the type T,
/// f the rates of change of x, or in discrete time the next x. They are called once, with
/// T = Traced; written for any T, they run on double as well.
template <typename Function>
FormulaNodes trace(const Function& function, const ModelSizes& sizes) {
  FormulaNodes nodes = untraced_nodes(sizes);
  const TracedArguments at = traced_arguments(nodes);
  std::vector<Traced> f(at.x.size()), y(static_cast<std::size_t>(sizes.outputs));
  function.dynamics(at.x.data(), at.u.data(), at.p.data(), at.time, f.data());
  function.outputs(at.x.data(), at.u.data(), at.p.data(), at.time, y.data());
  for (const Traced& each : f) nodes.dynamics.push_back(each.in(nodes.graph));
  for (const Traced& each : y) nodes.outputs.push_back(each.in(nodes.graph));
  return nodes;
}

}  // namespace identikal
