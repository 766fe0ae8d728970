#include "lib/model/nonlinear_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "lib/base/message.h"
#include "lib/internal/add_scaled.h"
#include "lib/internal/fixed_steps.h"
#include "lib/model/equilibrium.h"
#include "lib/model/internal/affine_motion.h"
#include "lib/model/internal/controlled_motion.h"
#include "lib/model/internal/doses.h"
#include "lib/model/internal/rates.h"

namespace identikal {
namespace {

using Eigen::Index;
using Id = FormulaGraph::Id;

std::vector<std::vector<Id>> jacobian_of(FormulaGraph& graph, const std::vector<Id>& values,
                                         const std::vector<int>& by) {
  std::vector<std::vector<Id>> out;
  for (const Id value : values) out.push_back(graph.gradient(value, by));
  return out;
}

bool is_zero(const FormulaGraph& graph, Id id) {
  const FormulaGraph::Node& node = graph.node(id);
  return node.op == Op::number && node.value == 0.0;
}

// Entries of the first columns that are not the number zero.
std::vector<FormulaSlopes::Entry> entries_not_zero(const FormulaGraph& graph,
                                                   const std::vector<std::vector<Id>>& jacobian,
                                                   std::size_t columns) {
  std::vector<FormulaSlopes::Entry> out;
  for (std::size_t i = 0; i < jacobian.size(); ++i) {
    for (std::size_t j = 0; j < columns; ++j) {
      if (is_zero(graph, jacobian[i][j])) continue;
      out.push_back({static_cast<Index>(i), static_cast<Index>(j)});
    }
  }
  return out;
}

// Which derivatives are not the number zero, and with second ones the tape that gives all of them.
FormulaSlopes slopes_of(FormulaGraph& graph, const std::vector<Id>& values,
                        const std::vector<std::vector<Id>>& jacobian, std::size_t nx,
                        const std::vector<int>& by, Derivatives order) {
  FormulaSlopes out;
  out.wrt_x = entries_not_zero(graph, jacobian, nx);
  out.wrt_z = entries_not_zero(graph, jacobian, by.size());
  if (order == Derivatives::first) return out;
  std::vector<Id> all = values;
  for (const auto& [i, j] : out.wrt_z) all.push_back(jacobian[static_cast<std::size_t>(i)][j]);
  for (const auto& [i, j] : out.wrt_x) {
    const std::vector<Id> second = graph.gradient(jacobian[static_cast<std::size_t>(i)][j], by);
    const std::size_t before = out.second.size();
    for (std::size_t l = 0; l < second.size(); ++l) {
      if (is_zero(graph, second[l])) continue;
      out.second.push_back({i, j, static_cast<Index>(l)});
      all.push_back(second[l]);
    }
    if (out.second.size() > before) out.curved.push_back({i, j});
  }
  out.tape = make_tape(graph, all);
  return out;
}

// States, inputs and the time.
std::vector<int> moving_symbols(const FormulaNodes& nodes) {
  std::vector<int> out = symbol_range(0, nodes.states + nodes.inputs);
  out.push_back(nodes.states + nodes.inputs + nodes.parameters);
  return out;
}

// Do the rates' derivatives by the inputs depend on the parameters alone, and nothing on the time?
bool is_linear_in_inputs(FormulaGraph& graph, const FormulaNodes& nodes) {
  const std::vector<int> moving = moving_symbols(nodes);
  const std::vector<int> inputs(moving.begin() + nodes.states, moving.end() - 1);
  const auto stays = [&](Id slope) { return graph.is_free_of(slope, moving); };
  return std::all_of(nodes.dynamics.begin(), nodes.dynamics.end(), [&](Id rate) {
    const std::vector<Id> slopes = graph.gradient(rate, inputs);
    return graph.is_free_of(rate, {&moving.back(), 1}) &&
           std::all_of(slopes.begin(), slopes.end(), stays);
  });
}

void check_step_arguments(const NonlinearModel& model, const InputNodes& inputs, Index k) {
  if (inputs.u.rows() == model.inputs && k >= 0 && k + 1 < inputs.time.size()) return;
  throw std::invalid_argument(
      message({"step: from sample ", k, " of ", inputs.time.size(), " with ", inputs.u.rows(),
               " inputs; the model has ", model.inputs}));
}

void check_order(const NonlinearModel& model, Derivatives order) {
  if (order == Derivatives::second && model.order == Derivatives::first) {
    throw std::invalid_argument("the model was made without second derivatives");
  }
}

// What moves with the state, and where it stands in a vector of ModelMemory. Derivatives are taken
// by [x; p] at the step's begin, in nx + model.columns columns; curvature row i + nx j is that of
// d x_i / d x_j, row i + nx j of what belongs to Gramians that of entry (i, j).
class MotionParts {
 public:
  MotionParts(const NonlinearModel& model, Derivatives order, Index gramians)
      : nx_(model.states),
        columns_(nx_ + model.columns),
        gramians_(gramians),
        curvatures_(order == Derivatives::second ? nx_ * nx_ : 0) {}
  using Rows = Eigen::Map<ModelMemory::Rows>;
  Rows jacobian(Eigen::VectorXd& motion) const { return {motion.data() + nx_, nx_, columns_}; }
  Rows curvature(Eigen::VectorXd& motion) const {
    return {motion.data() + nx_ + nx_ * columns_, curvatures_, columns_};
  }
  Rows gramians(Eigen::VectorXd& motion) const {
    return {motion.data() + nx_ + (nx_ + curvatures_) * columns_, nx_ * nx_, gramians_};
  }
  Rows gramian_jacobian(Eigen::VectorXd& motion) const {
    const Index before = nx_ + (nx_ + curvatures_) * columns_ + nx_ * nx_ * gramians_;
    return {motion.data() + before, gramians_ > 0 ? curvatures_ : 0, columns_};
  }
  Index size() const {
    const Index of_gramians = nx_ * nx_ * gramians_ + (gramians_ > 0 ? curvatures_ * columns_ : 0);
    return nx_ + (nx_ + curvatures_) * columns_ + of_gramians;
  }

 private:
  Index nx_, columns_, gramians_, curvatures_;
};

// Values, slopes and second derivatives as they lie in `all`.
SlopesAt parts_of(const FormulaSlopes& slopes, std::size_t values, const Eigen::VectorXd& all,
                  bool second) {
  const double* const first = all.data() + values;
  return {{all.data(), values},
          {first, slopes.wrt_z.size()},
          {first + slopes.wrt_z.size(), second ? slopes.second.size() : 0}};
}
SlopesAt values_of(const FormulaSlopes& slopes, TapeMemory& memory, Index values,
                   Eigen::VectorXd& all) {
  evaluate_values(slopes.tape, memory, span_of(all));
  return parts_of(slopes, static_cast<std::size_t>(values), all, true);
}
// From a tape of values and a whole Jacobian.
SlopesAt values_of(const FormulaSlopes& slopes, const Tape& tape, TapeMemory& memory,
                   ModelMemory::Rows& jacobian, Eigen::VectorXd& all) {
  evaluate_jacobian(tape, memory, {all.data(), tape.values}, span_of(jacobian));
  double* to = all.data() + tape.values;
  for (const auto& [i, j] : slopes.wrt_z) *to++ = jacobian(i, j);
  return parts_of(slopes, tape.values, all, false);
}

// What a tape of FormulaSlopes gives, into a Jacobian by [x; p] and the derivatives of its first nx
// columns. Other entries than those stay zero.
void spread(const FormulaSlopes& slopes, const SlopesAt& at, ModelMemory::Rows& jacobian,
            ModelMemory::Rows& second) {
  const Index rows = jacobian.rows();
  for (std::size_t e = 0; e < slopes.wrt_z.size(); ++e) {
    jacobian(slopes.wrt_z[e].row, slopes.wrt_z[e].column) = at.wrt_z[e];
  }
  for (std::size_t e = 0; e < slopes.second.size(); ++e) {
    const auto& [i, j, by] = slopes.second[e];
    second(i + rows * j, by) = at.second[e];
  }
}

// f at the stage, into the rate of x, J and, second order, H.
void evaluate_rates(const NonlinearModel& model, ModelMemory& m, Derivatives order, const double* x,
                    const double* u, double time) {
  if (order == Derivatives::first) return evaluate_rate_slopes(model, m, x, u, time);
  const SlopesAt at = rates_at(model, m, order, x, u, time);
  std::copy(at.values.begin(), at.values.end(), m.rate.data());
  spread(model.rate, at, m.J, m.H);
}

// out.row(to) += weight from.row(at).
template <class Out, class From>
void add_row(Out& out, Index to, double weight, const From& from, Index at) {
  const Index columns = out.cols();
  add_scaled(out.data() + columns * to, weight, from.data() + columns * at, columns);
}

// Row i of by [inner; 0 I]: derivatives by the step's begin of what has derivatives `by` at a state
// that itself has the derivatives `inner`.
template <class Inner, class Out>
void chain_row(const ModelMemory::Rows& by, Index i, const Inner& inner, Out& out) {
  const Index nx = inner.rows(), columns = by.cols();
  const double* const slope = by.data() + columns * i;
  double* const row = out.data() + columns * i;
  for (Index c = 0; c < columns; ++c) row[c] = c < nx ? 0.0 : slope[c];
  for (Index j = 0; j < nx; ++j) add_row(out, i, slope[j], inner, j);
}

// Derivatives of the rates by the step's begin, from those of the stage's state.
void chain_jacobian(const NonlinearModel& model, const MotionParts& parts, ModelMemory& m,
                    Derivatives order) {
  const auto S = parts.jacobian(m.stage);
  const Index nx = S.rows();
  auto moved = parts.jacobian(m.rate);
  for (Index i = 0; i < nx; ++i) chain_row(m.J, i, S, moved);
  if (order == Derivatives::first) return;
  // d/dtheta (f_x S_x) = f_x dS_x + df_x S_x
  const auto V = parts.curvature(m.stage);
  auto rate = parts.curvature(m.rate);
  rate.setZero();
  for (const auto& [i, l] : model.rate.wrt_x) {
    for (Index j = 0; j < nx; ++j) add_row(rate, i + nx * j, m.J(i, l), V, l + nx * j);
  }
  for (const auto& [i, l] : model.rate.curved) {
    chain_row(m.H, i + nx * l, S, m.turned);
    for (Index j = 0; j < nx; ++j) add_row(rate, i + nx * j, S(l, j), m.turned, i + nx * l);
  }
}

// out += half + half', whose rows are entries (i, j) of symmetric matrices; other rows of half are
// zero than those that have a slope.
template <class Rows>
void add_both_triangles(const NonlinearModel& model, const MotionParts::Rows& half, Rows& out) {
  const Index nx = model.states;
  for (std::size_t k = 0; k < model.rate.wrt_x.size(); ++k) {
    const Index i = model.rate.wrt_x[k].row;
    if (k > 0 && model.rate.wrt_x[k - 1].row == i) continue;
    for (Index j = 0; j < nx; ++j) {
      add_row(out, i + nx * j, 1.0, half, i + nx * j);
      add_row(out, j + nx * i, 1.0, half, i + nx * j);
    }
  }
}

// Memory of rates, which stays for the larger of its uses.
MotionParts::Rows zero_half(ModelMemory& m, Index rows, Index columns) {
  if (m.half.size() < rows * columns) m.half.resize(rows, columns);
  MotionParts::Rows out(m.half.data(), rows, columns);
  out.setZero();
  return out;
}

// W' = f_x W + W f_x' + Q, and its derivatives with respect to the step's begin.
void add_gramian_rates(const NonlinearModel& model, const MotionParts& parts, ModelMemory& m,
                       Derivatives order) {
  const auto W = parts.gramians(m.stage);
  const Index nx = m.J.rows();
  auto rate = parts.gramians(m.rate);
  rate = m.densities;
  auto half = zero_half(m, nx * nx, W.cols());
  for (const auto& [i, l] : model.rate.wrt_x) {
    for (Index j = 0; j < nx; ++j) add_row(half, i + nx * j, m.J(i, l), W, l + nx * j);
  }
  add_both_triangles(model, half, rate);
  if (order == Derivatives::first) return;
  const auto V = parts.gramian_jacobian(m.stage);
  auto jacobian = parts.gramian_jacobian(m.rate);
  jacobian.setZero();
  auto moved_half = zero_half(m, nx * nx, V.cols());
  for (const auto& [i, l] : model.rate.wrt_x) {
    for (Index j = 0; j < nx; ++j) add_row(moved_half, i + nx * j, m.J(i, l), V, l + nx * j);
  }
  for (const auto& [i, l] : model.rate.curved) {
    for (Index j = 0; j < nx; ++j) {
      add_row(moved_half, i + nx * j, W(l + nx * j, 0), m.turned, i + nx * l);
    }
  }
  add_both_triangles(model, moved_half, jacobian);
}

// The state with its derivatives and Gramians through the Runge-Kutta steps of an interval.
void follow_motion(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs, Index k,
                   Eigen::Ref<Eigen::VectorXd> x, Jacobian& jacobian, Derivatives order,
                   Gramians* gramians) {
  const Index nx = model.states;
  const bool noisy = gramians != nullptr;
  const auto interval = static_cast<std::size_t>(k);
  const Index first = inputs.first[interval];
  const MotionParts parts(model, order, noisy ? gramians->densities.cols() : 0);
  // Larger ones stay: another call may need less, and the next one more.
  const Index size = parts.size();
  for (Eigen::VectorXd* motion : {&m.begin, &m.stage, &m.rate, &m.sum}) {
    if (motion->size() < size) motion->resize(size);
  }
  const int steps = inputs.steps[interval];
  const double h = (inputs.time[k + 1] - inputs.time[k]) / steps;
  m.begin.setZero();
  m.begin.head(nx) = x;
  parts.jacobian(m.begin).leftCols(nx).diagonal().setOnes();
  if (noisy) m.densities = gramians->densities;
  for (int i = 0; i < steps; ++i) {
    auto at_stage = m.stage.head(size), sum = m.sum.head(size);
    const auto begin = m.begin.head(size), rate = m.rate.head(size);
    sum = begin;
    at_stage = begin;
    for (const RungeKuttaStage& stage : kRungeKuttaStages) {
      if (stage.reach > 0.0) at_stage = begin + (stage.reach * h) * rate;
      evaluate_rates(model, m, order, m.stage.data(),
                     inputs.u.col(first + 2 * i + stage.node).data(),
                     inputs.time[k] + (i + stage.reach) * h);
      chain_jacobian(model, parts, m, order);
      if (noisy) add_gramian_rates(model, parts, m, order);
      sum += (stage.weight * h) * rate;
    }
    m.begin.swap(m.sum);
  }
  x = m.begin.head(nx);
  jacobian.wrt_x = parts.jacobian(m.begin).leftCols(nx);
  jacobian.wrt_p = parts.jacobian(m.begin).rightCols(model.columns);
  if (order == Derivatives::second) jacobian.wrt_x_jacobian = parts.curvature(m.begin);
  if (!noisy) return;
  gramians->values = parts.gramians(m.begin);
  if (order == Derivatives::second) gramians->jacobian = parts.gramian_jacobian(m.begin);
}

// A step that differs from this one in its state, and in its inputs, alone.
const RepeatedStep* made_before(const ModelMemory& m, const InputNodes& inputs, Index k,
                                Derivatives order, const Gramians* gramians) {
  const double interval = inputs.time[k + 1] - inputs.time[k];
  const double rounding = interval_rounding(inputs.time);
  for (const RepeatedStep& each : m.repeated) {
    if (std::abs(each.interval - interval) > rounding || each.order != order ||
        each.steps != inputs.steps[static_cast<std::size_t>(k)]) {
      continue;
    }
    if (gramians == nullptr) {
      if (each.gramians.densities.size() == 0) return &each;
    } else if (each.gramians.densities.cols() == gramians->densities.cols() &&
               each.gramians.densities == gramians->densities) {
      return &each;
    }
  }
  return nullptr;
}

// x+ = to + Phi (x - from), and its derivatives with respect to p.
void repeat_motion(const NonlinearModel& model, const RepeatedStep& made,
                   Eigen::Ref<Eigen::VectorXd> x, Jacobian& jacobian) {
  const Index nx = model.states;
  jacobian.wrt_x = made.slopes.wrt_x;
  jacobian.wrt_p = made.slopes.wrt_p;
  const Eigen::VectorXd away = x - made.from;
  for (Index j = 0; j < nx; ++j) {
    jacobian.wrt_p += away[j] * made.slopes.wrt_x_jacobian.block(nx * j, nx, nx, model.columns);
  }
  x = made.to;
  x.noalias() += made.slopes.wrt_x.lazyProduct(away);
}

void step_linear_in_state(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs,
                          Index k, Eigen::Ref<Eigen::VectorXd> x, Jacobian& jacobian,
                          Derivatives order, Gramians* gramians) {
  const bool second = order == Derivatives::second;
  if (const RepeatedStep* made = made_before(m, inputs, k, order, gramians)) {
    if (second && model.autonomous) {
      repeat_motion(model, *made, x, jacobian);
    } else {
      follow_motion(model, m, inputs, k, x, jacobian, Derivatives::first, nullptr);
    }
    if (second) jacobian.wrt_x_jacobian = made->slopes.wrt_x_jacobian;
    if (gramians == nullptr) return;
    gramians->values = made->gramians.values;
    if (second) gramians->jacobian = made->gramians.jacobian;
    return;
  }
  RepeatedStep made{inputs.time[k + 1] - inputs.time[k],
                    inputs.steps[static_cast<std::size_t>(k)],
                    order,
                    x,
                    {},
                    {},
                    {}};
  follow_motion(model, m, inputs, k, x, jacobian, order, gramians);
  if (m.repeated.size() == kMostRepeated) return;
  made.to = x;
  made.slopes = jacobian;
  if (gramians != nullptr) made.gramians = *gramians;
  m.repeated.push_back(std::move(made));
}

void move(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs, Index k,
          Eigen::Ref<Eigen::VectorXd> x, Jacobian& jacobian, Derivatives order, Gramians* gramians);

bool comes_to_rest(const InputNodes& inputs, Index k) {
  return inputs.at_rest >= 0 && k + 1 >= inputs.at_rest;
}

// To where the motion rests under the inputs of the next sample.
void come_to_rest(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs, Index k,
                  Eigen::Ref<Eigen::VectorXd> x, Jacobian* jacobian) {
  const Equilibrium rest = equilibrium(model, m, x, inputs.at_sample.col(k + 1));
  x = rest.x;
  if (!rest.found) x.setConstant(std::numeric_limits<double>::quiet_NaN());
  if (jacobian == nullptr) return;
  jacobian->wrt_x = rest.wrt_x;
  jacobian->wrt_p = rest.wrt_p;
}

}  // namespace

FormulaNodes insert_formulas(const ModelFormulas& formulas) {
  const int first = formulas.states + formulas.inputs, time = first + formulas.parameters;
  std::vector<bool> held(static_cast<std::size_t>(time) + 1, false);
  for (int i = first; i < time; ++i) held[i] = true;
  FormulaNodes out{
      FormulaGraph(held), {}, {}, formulas.states, formulas.inputs, formulas.parameters,
      formulas.continuous};
  std::vector<Id> symbols;
  for (int i = 0; i <= time; ++i) symbols.push_back(out.graph.symbol(i));
  for (const ModelFormulas::LateInput& late : formulas.late) {
    const auto at = static_cast<std::size_t>(formulas.states + late.input);
    const std::vector<Id> parts{symbols[at], out.graph.symbol(formulas.states + late.slope),
                                out.graph.symbol(first + late.parameter)};
    const std::vector<std::string> names{"u", "slope", "tau"};
    symbols[at] = out.graph.insert(parse_expression("u - slope*tau", names), parts);
  }
  for (const Expression& definition : formulas.definitions) {
    symbols.push_back(out.graph.insert(definition, symbols));
  }
  for (const Expression& f : formulas.dynamics) {
    out.dynamics.push_back(out.graph.insert(f, symbols));
  }
  for (const Expression& h : formulas.outputs) out.outputs.push_back(out.graph.insert(h, symbols));
  for (const Expression& d : formulas.doses) out.doses.push_back(out.graph.insert(d, symbols));
  return out;
}

NonlinearModel make_nonlinear_model(FormulaNodes nodes, Derivatives order,
                                    const std::vector<bool>& known) {
  if (nodes.dynamics.size() != static_cast<std::size_t>(nodes.states)) {
    throw std::invalid_argument(message({"make_nonlinear_model: ", nodes.states, " states and ",
                                         nodes.dynamics.size(), " formulas for them"}));
  }
  if (!known.empty() && known.size() != static_cast<std::size_t>(nodes.parameters)) {
    throw std::invalid_argument(
        message({"make_nonlinear_model: ", nodes.parameters, " parameters, ", known.size(),
                 " of them said to be known or not"}));
  }
  FormulaGraph& graph = nodes.graph;
  const std::vector<Id>&f = nodes.dynamics, &h = nodes.outputs;
  NonlinearModel out;
  std::vector<int> by = symbol_range(0, nodes.states);
  const auto occurs = [&](int symbol) {
    const auto holds = [&](Id root) { return !graph.is_free_of(root, {&symbol, 1}); };
    return std::any_of(f.begin(), f.end(), holds) || std::any_of(h.begin(), h.end(), holds) ||
           std::any_of(nodes.doses.begin(), nodes.doses.end(), holds);
  };
  for (int i = 0; i < nodes.parameters; ++i) {
    const int symbol = nodes.states + nodes.inputs + i;
    Index column = NonlinearModel::kInNoFormula;
    if (!known.empty() && known[i]) {
      column = NonlinearModel::kKnown;
    } else if (occurs(symbol)) {
      column = out.columns++;
      by.push_back(symbol);
    }
    out.column.push_back(column);
  }
  out.states = nodes.states;
  out.inputs = nodes.inputs;
  out.parameters = nodes.parameters;
  out.outputs = static_cast<Index>(h.size());
  out.continuous = nodes.continuous;
  out.order = order;
  out.rates = make_tape(graph, f);
  const std::vector<std::vector<Id>> by_f = jacobian_of(graph, f, by),
                                     by_h = jacobian_of(graph, h, by);
  const std::vector<int> moving = moving_symbols(nodes);
  const auto stays = [&](const std::vector<Id>& row) {
    return std::all_of(row.begin(), row.begin() + nodes.states,
                       [&](Id slope) { return graph.is_free_of(slope, moving); });
  };
  out.linear_in_state = std::all_of(by_f.begin(), by_f.end(), stays);
  const std::vector<int> driving(moving.begin() + nodes.states, moving.end());
  out.autonomous =
      std::all_of(f.begin(), f.end(), [&](Id rate) { return graph.is_free_of(rate, driving); });
  out.affine = out.linear_in_state && is_linear_in_inputs(graph, nodes);
  out.rate_jacobian = make_tape(graph, f, by_f);
  out.output_jacobian = make_tape(graph, h, by_h);
  if (!nodes.doses.empty()) {
    const std::vector<std::vector<Id>> by_dose = jacobian_of(graph, nodes.doses, by);
    out.doses = make_tape(graph, nodes.doses, by_dose);
    out.doses_move_with_state =
        !entries_not_zero(graph, by_dose, static_cast<std::size_t>(out.states)).empty();
  }
  const auto nx = static_cast<std::size_t>(nodes.states);
  out.rate = slopes_of(graph, f, by_f, nx, by, order);
  out.output = slopes_of(graph, h, by_h, nx, by, order);
  return out;
}

ModelMemory make_memory(const NonlinearModel& model) {
  const Index nx = model.states, columns = nx + model.columns;
  const Index second = model.order == Derivatives::second ? nx * nx : 0;
  ModelMemory out;
  out.rates = make_memory(model.rates);
  if (has_doses(model)) {
    out.doses = make_memory(model.doses);
    out.dose.setZero(nx);
    out.dose_jacobian.setZero(nx, columns);
  }
  out.rate_jacobian = make_memory(model.rate_jacobian);
  out.output_jacobian = make_memory(model.output_jacobian);
  out.rate_curvature = make_memory(model.rate.tape);
  out.output_curvature = make_memory(model.output.tape);
  for (Eigen::VectorXd* motion : {&out.begin, &out.stage, &out.rate, &out.sum}) {
    motion->setZero(MotionParts(model, model.order, 0).size());
  }
  out.J.setZero(nx, columns);
  out.H.setZero(second, columns);
  out.turned.setZero(second, columns);
  const auto size_of = [](const FormulaSlopes& of, Index values) {
    return values + static_cast<Index>(of.wrt_z.size() + of.second.size());
  };
  out.values.setZero(size_of(model.rate, nx));
  out.y_values.setZero(size_of(model.output, model.outputs));
  out.y_jacobian.setZero(model.outputs, columns);
  out.y_second.setZero(second > 0 ? model.outputs * nx : 0, columns);
  return out;
}

void set_parameters(const NonlinearModel& model, ModelMemory& memory,
                    const Eigen::Ref<const Eigen::VectorXd>& p) {
  const auto write = [&](const Tape& tape, TapeMemory& slots) {
    std::copy(p.begin(), p.end(), slots.begin() + (model.states + model.inputs));
    evaluate_held(tape, slots);
  };
  memory.repeated.clear();
  memory.affine.clear();
  write(model.rates, memory.rates);
  write(model.rate_jacobian, memory.rate_jacobian);
  write(model.output_jacobian, memory.output_jacobian);
  if (has_doses(model)) write(model.doses, memory.doses);
  if (model.order == Derivatives::first) return;
  write(model.rate.tape, memory.rate_curvature);
  write(model.output.tape, memory.output_curvature);
}

void follow_fixed_steps(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs,
                        Index k, Eigen::Ref<Eigen::VectorXd> x, Jacobian* jacobian) {
  if (jacobian != nullptr) {
    follow_motion(model, m, inputs, k, x, *jacobian, Derivatives::first, nullptr);
    return;
  }
  const auto interval = static_cast<std::size_t>(k);
  const Index first = inputs.first[interval], nx = model.states;
  auto rate = m.rate.head(nx), at_stage = m.stage.head(nx), sum = m.sum.head(nx);
  const int steps = inputs.steps[interval];
  const double h = (inputs.time[k + 1] - inputs.time[k]) / steps;
  for (int i = 0; i < steps; ++i) {
    sum = x;
    at_stage = x;
    for (const RungeKuttaStage& stage : kRungeKuttaStages) {
      if (stage.reach > 0.0) at_stage = x + (stage.reach * h) * rate;
      evaluate_rates(model, m, at_stage.data(), inputs.u.col(first + 2 * i + stage.node).data(),
                     inputs.time[k] + (i + stage.reach) * h);
      sum += (stage.weight * h) * rate;
    }
    x = sum;
  }
}

SlopesAt rates_at(const NonlinearModel& model, ModelMemory& m, Derivatives order, const double* x,
                  const double* u, double time) {
  check_order(model, order);
  if (order == Derivatives::second) {
    write_point(model, m.rate_curvature, x, u, time);
    return values_of(model.rate, m.rate_curvature, model.states, m.values);
  }
  write_point(model, m.rate_jacobian, x, u, time);
  return values_of(model.rate, model.rate_jacobian, m.rate_jacobian, m.J, m.values);
}

SlopesAt outputs_at(const NonlinearModel& model, ModelMemory& m, Derivatives order, const double* x,
                    const double* u, double time) {
  check_order(model, order);
  if (order == Derivatives::second) {
    write_point(model, m.output_curvature, x, u, time);
    return values_of(model.output, m.output_curvature, model.outputs, m.y_values);
  }
  write_point(model, m.output_jacobian, x, u, time);
  return values_of(model.output, model.output_jacobian, m.output_jacobian, m.y_jacobian,
                   m.y_values);
}

void step(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs, Index k,
          Eigen::Ref<Eigen::VectorXd> x) {
  check_step_arguments(model, inputs, k);
  if (has_doses(model)) add_doses(model, m, inputs, k, x);
  if (!model.continuous) {
    const Index first = inputs.first[static_cast<std::size_t>(k)];
    evaluate_rates(model, m, x.data(), inputs.u.col(first).data(), inputs.time[k]);
    x = m.rate.head(model.states);
    return;
  }
  if (comes_to_rest(inputs, k)) return come_to_rest(model, m, inputs, k, x, nullptr);
  if (inputs.tolerance > 0.0) return move_controlled(model, m, inputs, k, x, nullptr);
  if (!repeat_affine_motion(model, m, inputs, k, x, nullptr)) {
    follow_fixed_steps(model, m, inputs, k, x, nullptr);
  }
}

void step(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs, Index k,
          Eigen::Ref<Eigen::VectorXd> x, Jacobian& jacobian, Derivatives order,
          Gramians* gramians) {
  check_step_arguments(model, inputs, k);
  check_order(model, order);
  if (model.doses_move_with_state && (gramians != nullptr || order == Derivatives::second)) {
    throw std::invalid_argument("step: doses that move with the state have first derivatives only");
  }
  if (has_doses(model)) add_doses(model, m, inputs, k, x);
  move(model, m, inputs, k, x, jacobian, order, gramians);
  if (has_doses(model)) chain_doses(model, m, jacobian, order, gramians);
}

namespace {

void move(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs, Index k,
          Eigen::Ref<Eigen::VectorXd> x, Jacobian& jacobian, Derivatives order,
          Gramians* gramians) {
  const Index nx = model.states, np = model.columns;
  const bool noisy = gramians != nullptr;
  if (noisy && (!model.continuous || gramians->densities.rows() != nx * nx ||
                gramians->densities.cols() == 0)) {
    throw std::invalid_argument(
        message({"step: ", gramians->densities.cols(), " densities of ", gramians->densities.rows(),
                 " numbers for a model ", (model.continuous ? "" : "in discrete time "), "with ",
                 nx, " states"}));
  }
  if (!model.continuous) {
    const Index first = inputs.first[static_cast<std::size_t>(k)];
    evaluate_rates(model, m, order, x.data(), inputs.u.col(first).data(), inputs.time[k]);
    x = m.rate.head(nx);
    jacobian.wrt_x = m.J.leftCols(nx);
    jacobian.wrt_p = m.J.rightCols(np);
    if (order == Derivatives::second) jacobian.wrt_x_jacobian = m.H;
    return;
  }
  const bool rests = comes_to_rest(inputs, k);
  if (rests || inputs.tolerance > 0.0) {
    if (noisy || order == Derivatives::second) {
      throw std::invalid_argument(
          "step: controlled steps, and those to rest, have first derivatives only");
    }
    return rests ? come_to_rest(model, m, inputs, k, x, &jacobian)
                 : move_controlled(model, m, inputs, k, x, &jacobian);
  }
  if (model.linear_in_state && (noisy || order == Derivatives::second)) {
    step_linear_in_state(model, m, inputs, k, x, jacobian, order, gramians);
  } else if (noisy || order == Derivatives::second ||
             !repeat_affine_motion(model, m, inputs, k, x, &jacobian)) {
    follow_motion(model, m, inputs, k, x, jacobian, order, gramians);
  }
}

}  // namespace

void observe(const NonlinearModel& model, ModelMemory& m,
             const Eigen::Ref<const Eigen::VectorXd>& x, const Eigen::Ref<const Eigen::VectorXd>& u,
             double time, Eigen::Ref<Eigen::VectorXd> y, Jacobian& jacobian, Derivatives order) {
  check_order(model, order);
  const Index nx = model.states, np = model.columns;
  if (order == Derivatives::first) {
    write_point(model, m.output_jacobian, x.data(), u.data(), time);
    evaluate_jacobian(model.output_jacobian, m.output_jacobian, span_of(y), span_of(m.y_jacobian));
  } else {
    const SlopesAt at = outputs_at(model, m, order, x.data(), u.data(), time);
    std::copy(at.values.begin(), at.values.end(), y.data());
    spread(model.output, at, m.y_jacobian, m.y_second);
    jacobian.wrt_x_jacobian = m.y_second;
  }
  jacobian.wrt_x = m.y_jacobian.leftCols(nx);
  jacobian.wrt_p = m.y_jacobian.rightCols(np);
}

void observe(const NonlinearModel& model, ModelMemory& m,
             const Eigen::Ref<const Eigen::VectorXd>& x, const Eigen::Ref<const Eigen::VectorXd>& u,
             double time, Eigen::Ref<Eigen::VectorXd> y) {
  write_point(model, m.output_jacobian, x.data(), u.data(), time);
  evaluate_values(model.output_jacobian, m.output_jacobian, span_of(y));
}

}  // namespace identikal
