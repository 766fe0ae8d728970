#include "identify/validation/internal/nested_structure.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "identify/result/estimated_model.h"
#include "identify/result/values.h"
#include "lib/base/error.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kAlike = 1e-9;

bool same_numbers(const MatrixXd& A, const MatrixXd& B) {
  if (A.rows() != B.rows() || A.cols() != B.cols()) return false;
  if (A.size() == 0) return true;
  return (A - B).cwiseAbs().maxCoeff() <= kAlike * std::max(A.cwiseAbs().maxCoeff(), 1e-300);
}

bool same_channels(const std::vector<ChannelSource>& a, const std::vector<ChannelSource>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const ChannelSource& x, const ChannelSource& y) {
                      return x.column == y.column && x.scale == y.scale && x.offset == y.offset &&
                             x.delay == y.delay;
                    });
}

// Of states that nothing is known of, P0 is infinite.
bool same_start(const StateSpace& a, const StateSpace& b) {
  const auto known = [](double variance) { return std::isinf(variance) ? 0.0 : variance; };
  const auto diffuse = [](double variance) { return std::isinf(variance) ? 1.0 : 0.0; };
  return same_numbers(a.x0, b.x0) && same_numbers(a.P0.unaryExpr(known), b.P0.unaryExpr(known)) &&
         same_numbers(a.P0.unaryExpr(diffuse), b.P0.unaryExpr(diffuse));
}

// Noise by what it does, so that a column of G that nothing drives is none.
bool same_noise(const StateSpace& a, const StateSpace& b) {
  return same_numbers(a.G * a.Q * a.G.transpose(), b.G * b.Q * b.G.transpose()) &&
         same_numbers(a.R, b.R) && same_numbers(a.G * a.S, b.G * b.S) && same_start(a, b);
}

NestedStructure same_matrices(const Model& small, const Model& large) {
  const StateSpace a = instantiate(as_linear(small), small.parameters);
  const StateSpace b = instantiate(as_linear(large), large.parameters);
  if (a.states() != b.states()) return NestedStructure::unknown;
  const bool same = same_numbers(a.A, b.A) && same_numbers(a.B, b.B) && same_numbers(a.C, b.C) &&
                    same_numbers(a.D, b.D) && same_noise(a, b);
  return same ? NestedStructure::same : NestedStructure::other;
}

VectorXd scalars(const Model& model) {
  VectorXd out(as_formulas(model).equations.parameters);
  for (Index i = 0; i < out.size(); ++i) {
    out[i] = model.parameters[i].scalar();
  }
  return out;
}

// One step from x, and the outputs there.
VectorXd value_at(const Model& file, VectorXd x, const VectorXd& u) {
  constexpr double kStep = 0.01;  // [s]
  const NonlinearModel& model = as_formulas(file).equations;
  ModelMemory memory = make_memory(model);
  set_parameters(model, memory, scalars(file));
  VectorXd out(model.outputs + model.states);
  observe(model, memory, x, u, 0.0, out.head(model.outputs));
  step(model, memory,
       input_nodes(Eigen::Vector2d(0.0, kStep), u.replicate(1, 2), InputPath::constant, kStep), 0,
       x);
  out.tail(model.states) = x;
  return out;
}

constexpr int kPoints = 20;  // where two models are compared

// Of models that change from sample to sample.
NestedStructure same_changes(const Model& small, const Model& large) {
  LinearModel one = noise_model(small), other = noise_model(large);
  const bool settings = one.continuous == other.continuous && one.irregular == other.irregular &&
                        one.noise == other.noise && one.hold == other.hold;
  if (!settings) return NestedStructure::other;
  Random random(1);
  for (int point = 0; point < kPoints; ++point) {
    MovingValues at{VectorXd(small.inputs.size()), random.normal()};
    for (double& each : at.inputs) each = std::abs(random.normal());
    one.typical = other.typical = at;
    const StateSpace a = written_matrices(one, small.parameters);
    const StateSpace b = written_matrices(other, large.parameters);
    if (a.states() != b.states()) return NestedStructure::unknown;
    const bool same = same_numbers(a.A, b.A) && same_numbers(a.B, b.B) && same_numbers(a.C, b.C) &&
                      same_numbers(a.D, b.D) && same_noise(a, b);
    if (!same) return NestedStructure::other;
  }
  return NestedStructure::same;
}

NestedStructure same_formulas(const Model& small, const Model& large) {
  const FormulaModel &one_model = as_formulas(small), &other_model = as_formulas(large);
  const NonlinearModel &a = one_model.equations, &b = other_model.equations;
  if (a.states != b.states || a.inputs != b.inputs) return NestedStructure::unknown;
  const bool settings = a.continuous == b.continuous && a.outputs == b.outputs &&
                        one_model.filter == other_model.filter &&
                        one_model.inputs == other_model.inputs;
  if (!settings || !same_noise(written_matrices(one_model.noise, small.parameters),
                               written_matrices(other_model.noise, large.parameters))) {
    return NestedStructure::other;
  }
  Random random(1);
  int compared = 0;
  for (int point = 0; point < kPoints; ++point) {
    VectorXd x(a.states), u(a.inputs);
    for (double& each : x) each = random.normal();
    for (double& each : u) each = random.normal();
    // Half of them where roots and logarithms have values.
    if (point % 2 == 0) {
      x = x.cwiseAbs().eval();
      u = u.cwiseAbs().eval();
    }
    const VectorXd one = value_at(small, x, u), other = value_at(large, x, u);
    if (!one.allFinite() || !other.allFinite()) continue;
    if (!same_numbers(one, other)) return NestedStructure::other;
    ++compared;
  }
  return compared > 0 ? NestedStructure::same : NestedStructure::unknown;
}

// Is vehicle b what vehicle a is, or more?
NestedStructure same_vehicle(const VehicleModel& a, const VehicleModel& b) {
  const auto same_sensor = [](const auto& x, const auto& y) {
    return x.first == y.first && x.second.x == y.second.x && x.second.y == y.second.y &&
           x.second.angle == y.second.angle;
  };
  const bool curves = a.curve == b.curve || a.curve == TyreCurve::linear;
  const bool same = curves && a.steering_at_road_wheel == b.steering_at_road_wheel &&
                    a.min_speed == b.min_speed && a.max_gap == b.max_gap &&
                    std::equal(a.sensors.begin(), a.sensors.end(), b.sensors.begin(),
                               b.sensors.end(), same_sensor);
  return same ? NestedStructure::same : NestedStructure::other;
}

}  // namespace

NestedStructure structure_at(const StoredResult& small, const StoredResult& large) {
  if (!small.estimate.model_file || !large.estimate.model_file) return NestedStructure::unknown;
  try {
    const Model a = estimated_model(small.estimate, small.path);
    Model b = estimated_model(large.estimate, large.path);
    if (a.form.index() != b.form.index()) return NestedStructure::unknown;
    if (!same_channels(a.inputs, b.inputs) || !same_channels(a.outputs, b.outputs)) {
      return NestedStructure::other;
    }
    if (is_vehicle(a)) return same_vehicle(as_vehicle(a), as_vehicle(b));
    StoredEstimate there = large.estimate;
    for (EstimatedParameter& p : there.parameters) {
      const auto& of_small = small.estimate.parameters;
      const auto at = std::find_if(of_small.begin(), of_small.end(),
                                   [&](const EstimatedParameter& s) { return s.name == p.name; });
      p.value = at == of_small.end() ? 0.0 : at->value;
    }
    set_values(b, there, large.path);
    if (changes(a) != changes(b)) return NestedStructure::unknown;
    if (changes(a)) return same_changes(a, b);
    return is_formula_model(a) ? same_formulas(a, b) : same_matrices(a, b);
  } catch (const InputError&) {  // a file that it included is gone; no model at these values
    return NestedStructure::unknown;
  }
}

}  // namespace identikal
