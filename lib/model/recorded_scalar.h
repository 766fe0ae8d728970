// How does a C++ function become formulas? It runs once on recorded scalars, which write down what
// is done with them; so a user's own dynamics get exact derivatives, shared operations and the speed of a tape.
#pragma once

#include <vector>

#include "lib/model/nonlinear_model.h"

namespace identikal {

/// A number that is being written down: a node of a graph, or a constant. Comparisons give a
/// condition, not a bool, so that `if (x > 0)` does not compile: what is taken must not depend on
/// the values at hand. Write where(x > 0, a, b).
///
/// Example:
///
///     FormulaNodes nodes = empty_nodes({.states = 1, .outputs = 1});
///     const RecordedScalar v = recorded_arguments(nodes).x[0];  // a speed that drag slows down
///     nodes.dynamics = {(-0.02 * v * abs(v)).in(nodes.graph)};
///     nodes.outputs = {v.in(nodes.graph)};
///     const NonlinearModel coasting = make_nonlinear_model(nodes);
class RecordedScalar {
 public:
  RecordedScalar() = default;
  RecordedScalar(double value)
      : value_(value) {}  // NOLINT: constants convert, as they do to double
  RecordedScalar(FormulaGraph& graph, FormulaGraph::Id id) : graph_(&graph), id_(id) {}

  /// Its node in the graph. @throws std::invalid_argument when it belongs to another graph
  FormulaGraph::Id in(FormulaGraph& graph) const;

  /// An operation on up to three of them. @throws std::invalid_argument when graphs differ
  static RecordedScalar of(Op op, const RecordedScalar& a, const RecordedScalar& b,
                           const RecordedScalar& c);
  static RecordedScalar of(Op op, const RecordedScalar& a, const RecordedScalar& b) {
    return of(op, a, b, {});
  }
  static RecordedScalar of(Op op, const RecordedScalar& a) { return of(op, a, {}, {}); }

 private:
  FormulaGraph* graph_ = nullptr;  // null: a constant
  FormulaGraph::Id id_ = -1;
  double value_ = 0.0;
};

inline RecordedScalar operator+(const RecordedScalar& a, const RecordedScalar& b) {
  return RecordedScalar::of(Op::add, a, b);
}
inline RecordedScalar operator-(const RecordedScalar& a, const RecordedScalar& b) {
  return RecordedScalar::of(Op::subtract, a, b);
}
inline RecordedScalar operator*(const RecordedScalar& a, const RecordedScalar& b) {
  return RecordedScalar::of(Op::multiply, a, b);
}
inline RecordedScalar operator/(const RecordedScalar& a, const RecordedScalar& b) {
  return RecordedScalar::of(Op::divide, a, b);
}
inline RecordedScalar operator-(const RecordedScalar& a) {
  return RecordedScalar::of(Op::negate, a);
}
inline RecordedScalar& operator+=(RecordedScalar& a, const RecordedScalar& b) { return a = a + b; }
inline RecordedScalar& operator-=(RecordedScalar& a, const RecordedScalar& b) { return a = a - b; }
inline RecordedScalar& operator*=(RecordedScalar& a, const RecordedScalar& b) { return a = a * b; }
inline RecordedScalar& operator/=(RecordedScalar& a, const RecordedScalar& b) { return a = a / b; }
inline RecordedScalar operator<(const RecordedScalar& a, const RecordedScalar& b) {
  return RecordedScalar::of(Op::less, a, b);
}
inline RecordedScalar operator<=(const RecordedScalar& a, const RecordedScalar& b) {
  return RecordedScalar::of(Op::less_equal, a, b);
}
inline RecordedScalar operator>(const RecordedScalar& a, const RecordedScalar& b) {
  return RecordedScalar::of(Op::greater, a, b);
}
inline RecordedScalar operator>=(const RecordedScalar& a, const RecordedScalar& b) {
  return RecordedScalar::of(Op::greater_equal, a, b);
}
inline RecordedScalar where(const RecordedScalar& condition, const RecordedScalar& then,
                            const RecordedScalar& otherwise) {
  return RecordedScalar::of(Op::choose, condition, then, otherwise);
}
/// The same where the function runs on numbers.
inline double where(bool condition, double then, double otherwise) {
  return condition ? then : otherwise;
}
inline RecordedScalar sin(const RecordedScalar& a) { return RecordedScalar::of(Op::sin, a); }
inline RecordedScalar cos(const RecordedScalar& a) { return RecordedScalar::of(Op::cos, a); }
inline RecordedScalar tan(const RecordedScalar& a) { return RecordedScalar::of(Op::tan, a); }
inline RecordedScalar asin(const RecordedScalar& a) { return RecordedScalar::of(Op::asin, a); }
inline RecordedScalar acos(const RecordedScalar& a) { return RecordedScalar::of(Op::acos, a); }
inline RecordedScalar atan(const RecordedScalar& a) { return RecordedScalar::of(Op::atan, a); }
inline RecordedScalar atan2(const RecordedScalar& y, const RecordedScalar& x) {
  return RecordedScalar::of(Op::atan2, y, x);
}
inline RecordedScalar sinh(const RecordedScalar& a) { return RecordedScalar::of(Op::sinh, a); }
inline RecordedScalar cosh(const RecordedScalar& a) { return RecordedScalar::of(Op::cosh, a); }
inline RecordedScalar tanh(const RecordedScalar& a) { return RecordedScalar::of(Op::tanh, a); }
inline RecordedScalar exp(const RecordedScalar& a) { return RecordedScalar::of(Op::exp, a); }
inline RecordedScalar log(const RecordedScalar& a) { return RecordedScalar::of(Op::log, a); }
inline RecordedScalar sqrt(const RecordedScalar& a) { return RecordedScalar::of(Op::sqrt, a); }
inline RecordedScalar abs(const RecordedScalar& a) { return RecordedScalar::of(Op::abs, a); }
inline RecordedScalar pow(const RecordedScalar& a, const RecordedScalar& b) {
  return RecordedScalar::of(Op::power, a, b);
}
inline RecordedScalar hypot(const RecordedScalar& a, const RecordedScalar& b) {
  return RecordedScalar::of(Op::hypot, a, b);
}

/// Sizes of a model that is given as a function.
struct ModelSizes {
  int states = 0, inputs = 0, parameters = 0, outputs = 0;
  bool continuous = true;
};

/// The symbols of a model with these sizes, as a function's arguments.
struct RecordedArguments {
  std::vector<RecordedScalar> x, u, p;
  RecordedScalar time;
};
FormulaNodes empty_nodes(const ModelSizes& sizes);
RecordedArguments recorded_arguments(FormulaNodes& nodes);

/// The formulas of a function object with
///
///   void dynamics(const T* x, const T* u, const T* p, T t, T* f) const;
///   void outputs(const T* x, const T* u, const T* p, T t, T* y) const;
///
/// templates of the type T, f the rates of change of x, or in discrete time the next x. They are
/// called once, with T = RecordedScalar; written for any T, they run on double as well.
template <typename Function>
FormulaNodes trace(const Function& function, const ModelSizes& sizes) {
  FormulaNodes nodes = empty_nodes(sizes);
  const RecordedArguments at = recorded_arguments(nodes);
  std::vector<RecordedScalar> f(at.x.size()), y(static_cast<std::size_t>(sizes.outputs));
  function.dynamics(at.x.data(), at.u.data(), at.p.data(), at.time, f.data());
  function.outputs(at.x.data(), at.u.data(), at.p.data(), at.time, y.data());
  for (const RecordedScalar& each : f) nodes.dynamics.push_back(each.in(nodes.graph));
  for (const RecordedScalar& each : y) nodes.outputs.push_back(each.in(nodes.graph));
  return nodes;
}

}  // namespace identikal
