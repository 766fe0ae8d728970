#include "lib/nonlinear_model.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "lib/constants.h"
#include "lib/interpolation.h"

namespace identikal {
namespace {

using Eigen::Index;
using Id = FormulaGraph::Id;

constexpr double kMaxSteps = 1e6;  // between two samples

std::vector<int> consecutive(int first, int count) {
  std::vector<int> out(static_cast<std::size_t>(count));
  std::iota(out.begin(), out.end(), first);
  return out;
}

std::vector<int> joined(std::vector<int> a, const std::vector<int>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

std::vector<std::vector<Id>> jacobian_of(FormulaGraph& graph, const std::vector<Id>& values,
                                         const std::vector<int>& by) {
  std::vector<std::vector<Id>> out;
  for (const Id value : values) out.push_back(graph.gradient(value, by));
  return out;
}

// Where the symbols of ModelFormulas stand.
struct SymbolPlaces {
  explicit SymbolPlaces(const ModelFormulas& m)
      : x(consecutive(0, m.states)),
        u(consecutive(m.states, m.inputs)),
        p(consecutive(m.states + m.inputs, m.parameters)),
        time(m.states + m.inputs + m.parameters) {}
  std::vector<int> x, u, p;
  int time;
};

// A, [B c], C, [D d], or nothing when the model is not linear.
void find_linear_form(FormulaGraph& graph, const SymbolPlaces& at, const std::vector<Id>& f,
                      const std::vector<Id>& h, NonlinearModel& out) {
  const std::vector<int> moving = joined(at.x, at.u), time{at.time};
  for (const std::vector<Id>* part : {&f, &h}) {
    for (const Id id : *part) {
      if (!graph.is_free_of(id, time) || !graph.is_affine(id, moving)) return;
    }
  }
  std::vector<double> rest(graph.symbols(), kNaN);
  for (const int symbol : moving) rest[static_cast<std::size_t>(symbol)] = 0.0;
  std::vector<Id> offsets;
  for (const std::vector<Id>* part : {&f, &h}) {
    for (const Id id : *part) {
      offsets.push_back(graph.substitute(id, rest));
      out.offset = out.offset || !graph.is_number(offsets.back(), 0.0);
    }
  }
  std::vector<Id> entries;
  auto offset = offsets.begin();
  for (const std::vector<Id>* part : {&f, &h}) {
    const std::vector<std::vector<Id>> by_x = jacobian_of(graph, *part, at.x),
                                       by_u = jacobian_of(graph, *part, at.u);
    for (const std::vector<Id>& row : by_x) entries.insert(entries.end(), row.begin(), row.end());
    for (const std::vector<Id>& row : by_u) {
      entries.insert(entries.end(), row.begin(), row.end());
      if (out.offset) entries.push_back(*offset);
      ++offset;
    }
  }
  out.matrices = make_tape(graph, entries, jacobian_of(graph, entries, at.p));
  out.linear = true;
}

void check_step_arguments(const NonlinearModel& model, const InputNodes& inputs, Index k) {
  if (inputs.u.rows() == model.inputs && k >= 0 && k + 1 < inputs.time.size()) return;
  std::ostringstream text;
  text << "step: from sample " << k << " of " << inputs.time.size() << " with " << inputs.u.rows()
       << " inputs; the model has " << model.inputs;
  throw std::invalid_argument(text.str());
}

void write_point(const NonlinearModel& model, TapeMemory& memory, const double* x, const double* u,
                 double time) {
  double* at = memory.data();
  for (Index i = 0; i < model.states; ++i) *at++ = x[i];
  for (Index i = 0; i < model.inputs; ++i) *at++ = u[i];
  at[model.parameters] = time;
}

std::span<double> span_of(Eigen::VectorXd& v) {
  return {v.data(), static_cast<std::size_t>(v.size())};
}
std::span<double> span_of(ModelMemory::Rows& M) {
  return {M.data(), static_cast<std::size_t>(M.size())};
}

// The classical method's stages: how far into the step, and their weights.
struct Stage {
  double reach, weight;
  Index node;
};
constexpr Stage kStages[] = {
    {0.0, 1.0 / 6.0, 0}, {0.5, 1.0 / 3.0, 1}, {0.5, 1.0 / 3.0, 1}, {1.0, 1.0 / 6.0, 2}};

}  // namespace

NonlinearModel make_nonlinear_model(const ModelFormulas& formulas) {
  if (formulas.dynamics.size() != static_cast<std::size_t>(formulas.states)) {
    std::ostringstream text;
    text << "make_nonlinear_model: " << formulas.states << " states and "
         << formulas.dynamics.size() << " formulas for them";
    throw std::invalid_argument(text.str());
  }
  const SymbolPlaces at(formulas);
  std::vector<bool> held(static_cast<std::size_t>(at.time) + 1, false);
  for (const int p : at.p) held[static_cast<std::size_t>(p)] = true;
  FormulaGraph graph(held);
  std::vector<Id> symbols;
  for (int i = 0; i <= at.time; ++i) symbols.push_back(graph.symbol(i));
  for (const Expression& definition : formulas.definitions) {
    symbols.push_back(graph.insert(definition, symbols));
  }
  std::vector<Id> f, h;
  for (const Expression& formula : formulas.dynamics) f.push_back(graph.insert(formula, symbols));
  for (const Expression& formula : formulas.outputs) h.push_back(graph.insert(formula, symbols));

  NonlinearModel out;
  out.states = formulas.states;
  out.inputs = formulas.inputs;
  out.parameters = formulas.parameters;
  out.outputs = static_cast<Index>(h.size());
  out.continuous = formulas.continuous;
  const std::vector<int> by = joined(at.x, at.p);
  out.rates = make_tape(graph, f);
  out.rate_slopes = make_tape(graph, f, jacobian_of(graph, f, by));
  out.output_slopes = make_tape(graph, h, jacobian_of(graph, h, by));
  find_linear_form(graph, at, f, h, out);
  return out;
}

LinearForm linear_form(const NonlinearModel& model, const Eigen::Ref<const Eigen::VectorXd>& p) {
  if (!model.linear) throw std::invalid_argument("linear_form: the model is not linear");
  TapeMemory memory = make_memory(model.matrices);
  std::copy(p.begin(), p.end(), memory.begin() + (model.states + model.inputs));
  const Index nx = model.states, nu = model.inputs + (model.offset ? 1 : 0), ny = model.outputs;
  Eigen::VectorXd values(nx * nx + nx * nu + ny * nx + ny * nu);
  ModelMemory::Rows slopes(values.size(), model.parameters);
  evaluate_held(model.matrices, memory);
  evaluate_jacobian(model.matrices, memory, span_of(values), span_of(slopes));
  const auto matrices = [&](const Eigen::VectorXd& entries) {
    LinearFormMatrices out;
    const double* at = entries.data();
    const auto take = [&at](Index rows, Index cols) {
      Eigen::MatrixXd M = Eigen::Map<const ModelMemory::Rows>(at, rows, cols);
      at += rows * cols;
      return M;
    };
    out.A = take(nx, nx);
    out.B = take(nx, nu);
    out.C = take(ny, nx);
    out.D = take(ny, nu);
    return out;
  };
  LinearForm out;
  out.value = matrices(values);
  for (Index i = 0; i < model.parameters; ++i) out.by_parameter.push_back(matrices(slopes.col(i)));
  return out;
}

InputNodes input_nodes(const Eigen::VectorXd& time, const Eigen::MatrixXd& u, InputPath path,
                       double longest_step) {
  const Index N = time.size();
  if (u.cols() != N || !(longest_step > 0.0)) {
    std::ostringstream text;
    text << "input_nodes: " << N << " times, " << u.cols() << " samples, longest step "
         << longest_step;
    throw std::invalid_argument(text.str());
  }
  InputNodes out;
  out.time = time;
  Index columns = 0;
  for (Index k = 0; k + 1 < N; ++k) {
    const double h = time[k + 1] - time[k];
    // A sampling period that is the longest step up to rounding takes one step.
    const double steps = std::max(1.0, std::ceil(h / longest_step * (1.0 - 1e-9)));
    if (!(h > 0.0) || !(steps <= kMaxSteps)) {
      std::ostringstream text;
      text << "input_nodes: from " << time[k] << " to " << time[k + 1] << " s in steps of "
           << longest_step << " s";
      throw std::invalid_argument(text.str());
    }
    out.steps.push_back(static_cast<int>(steps));
    out.first.push_back(columns);
    columns += 2 * out.steps.back() + 1;
  }
  out.u.resize(u.rows(), columns);
  for (Index i = 0; i < u.rows(); ++i) {
    std::optional<Pchip> curve;
    if (path == InputPath::pchip) curve.emplace(time, u.row(i).transpose());
    for (Index k = 0; k + 1 < N; ++k) {
      const auto interval = static_cast<std::size_t>(k);
      const Index last = 2 * out.steps[interval];
      for (Index j = 0; j <= last; ++j) {
        const double share = static_cast<double>(j) / static_cast<double>(last);
        double value = u(i, k);
        if (path == InputPath::linear) value += share * (u(i, k + 1) - u(i, k));
        if (curve) {
          value = curve->in_interval(k, time[k] + share * (time[k + 1] - time[k]));
        }
        out.u(i, out.first[interval] + j) = value;
      }
    }
  }
  return out;
}

ModelMemory make_memory(const NonlinearModel& model) {
  const Index nx = model.states, columns = nx + model.parameters;
  ModelMemory out;
  out.rates = make_memory(model.rates);
  out.rate_slopes = make_memory(model.rate_slopes);
  out.output_slopes = make_memory(model.output_slopes);
  for (Eigen::VectorXd* v : {&out.x, &out.f, &out.sum}) v->setZero(nx);
  for (ModelMemory::Rows* M : {&out.J, &out.S, &out.K, &out.slope_sum, &out.stage}) {
    M->setZero(nx, columns);
  }
  out.y.setZero(model.outputs);
  out.y_slopes.setZero(model.outputs, columns);
  return out;
}

void set_parameters(const NonlinearModel& model, ModelMemory& memory,
                    const Eigen::Ref<const Eigen::VectorXd>& p) {
  const auto write = [&](const Tape& tape, TapeMemory& slots) {
    std::copy(p.begin(), p.end(), slots.begin() + (model.states + model.inputs));
    evaluate_held(tape, slots);
  };
  write(model.rates, memory.rates);
  write(model.rate_slopes, memory.rate_slopes);
  write(model.output_slopes, memory.output_slopes);
}

void step(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs, Index k,
          Eigen::Ref<Eigen::VectorXd> x) {
  check_step_arguments(model, inputs, k);
  const auto interval = static_cast<std::size_t>(k);
  const Index first = inputs.first[interval];
  if (!model.continuous) {
    write_point(model, m.rates, x.data(), inputs.u.col(first).data(), inputs.time[k]);
    evaluate_values(model.rates, m.rates, span_of(m.f));
    x = m.f;
    return;
  }
  const int steps = inputs.steps[interval];
  const double h = (inputs.time[k + 1] - inputs.time[k]) / steps;
  for (int i = 0; i < steps; ++i) {
    m.sum.setZero();
    for (const Stage& stage : kStages) {
      m.x = x;
      if (stage.reach > 0.0) m.x += stage.reach * h * m.f;
      write_point(model, m.rates, m.x.data(), inputs.u.col(first + 2 * i + stage.node).data(),
                  inputs.time[k] + (i + stage.reach) * h);
      evaluate_values(model.rates, m.rates, span_of(m.f));
      m.sum += stage.weight * m.f;
    }
    x += h * m.sum;
  }
}

void step(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs, Index k,
          Eigen::Ref<Eigen::VectorXd> x, Eigen::Ref<Eigen::MatrixXd> by_x,
          Eigen::Ref<Eigen::MatrixXd> by_p) {
  check_step_arguments(model, inputs, k);
  const Index nx = model.states, np = model.parameters;
  const auto interval = static_cast<std::size_t>(k);
  const Index first = inputs.first[interval];
  if (!model.continuous) {
    write_point(model, m.rate_slopes, x.data(), inputs.u.col(first).data(), inputs.time[k]);
    evaluate_jacobian(model.rate_slopes, m.rate_slopes, span_of(m.f), span_of(m.S));
    x = m.f;
  } else {
    const int steps = inputs.steps[interval];
    const double h = (inputs.time[k + 1] - inputs.time[k]) / steps;
    m.S.setZero();
    m.S.leftCols(nx).diagonal().setOnes();
    for (int i = 0; i < steps; ++i) {
      m.sum.setZero();
      m.slope_sum.setZero();
      for (const Stage& stage : kStages) {
        m.x = x;
        m.stage = m.S;
        if (stage.reach > 0.0) {
          m.x += stage.reach * h * m.f;
          m.stage += stage.reach * h * m.K;
        }
        write_point(model, m.rate_slopes, m.x.data(),
                    inputs.u.col(first + 2 * i + stage.node).data(),
                    inputs.time[k] + (i + stage.reach) * h);
        evaluate_jacobian(model.rate_slopes, m.rate_slopes, span_of(m.f), span_of(m.J));
        // K = f_x stage + [0 f_p], row by row: the matrices are small and wide.
        m.K.leftCols(nx).setZero();
        m.K.rightCols(np) = m.J.rightCols(np);
        for (Index row = 0; row < nx; ++row) {
          for (Index j = 0; j < nx; ++j) m.K.row(row) += m.J(row, j) * m.stage.row(j);
        }
        m.sum += stage.weight * m.f;
        m.slope_sum += stage.weight * m.K;
      }
      x += h * m.sum;
      m.S += h * m.slope_sum;
    }
  }
  by_x = m.S.leftCols(nx);
  by_p = m.S.rightCols(np);
}

void observe(const NonlinearModel& model, ModelMemory& m,
             const Eigen::Ref<const Eigen::VectorXd>& x, const Eigen::Ref<const Eigen::VectorXd>& u,
             double time, Eigen::Ref<Eigen::VectorXd> y, Eigen::Ref<Eigen::MatrixXd> by_x,
             Eigen::Ref<Eigen::MatrixXd> by_p) {
  write_point(model, m.output_slopes, x.data(), u.data(), time);
  evaluate_jacobian(model.output_slopes, m.output_slopes, span_of(m.y), span_of(m.y_slopes));
  y = m.y;
  by_x = m.y_slopes.leftCols(model.states);
  by_p = m.y_slopes.rightCols(model.parameters);
}

}  // namespace identikal
