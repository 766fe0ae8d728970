#include "identify/colour/shaped_model.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "lib/data/units.h"
#include "lib/filter/steady_state.h"
#include "lib/model/discretise.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// The matrix inside a larger one of zeros, its entries moved along.
ParametrisedMatrix placed(const ParametrisedMatrix& matrix, Index rows, Index cols, Index row,
                          Index col) {
  ParametrisedMatrix out;
  out.constant = MatrixXd::Zero(rows, cols);
  out.constant.block(row, col, matrix.constant.rows(), matrix.constant.cols()) = matrix.constant;
  out.entries = matrix.entries;
  for (ParametrisedMatrix::Entry& e : out.entries) {
    e.row += static_cast<int>(row);
    e.col += static_cast<int>(col);
  }
  return out;
}

std::string unused_name(const ParameterSet& parameters, std::string name) {
  while (find_parameter(parameters, name) >= 0) name += "_";
  return name;
}

int add_scalar(ParameterSet& parameters, const std::string& name, double value, bool variance) {
  Parameter p;
  p.name = unused_name(parameters, name);
  p.value = MatrixXd::Constant(1, 1, value);
  if (variance) p.min = 0.0;
  parameters.push_back(p);
  return static_cast<int>(parameters.size()) - 1;
}

bool is_full(const ParametrisedMatrix& matrix, const ParameterSet& parameters) {
  return matrix.block >= 0 && !parameters[matrix.block].fixed &&
         parameters[matrix.block].domain == Domain::positive_definite &&
         parameters[matrix.block].value.rows() > 1;
}

// A matrix-valued parameter without correlations as entries of scalar ones; the block goes.
void split_block(Model& model, ParametrisedMatrix& matrix, const std::string& letter) {
  if (matrix.block < 0) return;
  const auto at = static_cast<std::size_t>(matrix.block);
  const Parameter block = model.parameters[at];
  const Index n = block.value.rows();
  matrix.block = -1;
  matrix.constant = block.fixed ? block.value : MatrixXd::Zero(n, n);
  if (!block.fixed) {
    int one = -1;
    for (Index i = 0; i < n; ++i) {
      if (one < 0 || block.domain == Domain::diagonal) {
        one = add_scalar(model.parameters, fmt::format("{}{}", letter, i + 1), block.value(i, i),
                         true);
        model.parameters.back().unit = block.unit;
        model.parameters.back().prior = block.prior;
      }
      matrix.entries.push_back({static_cast<int>(i), static_cast<int>(i), one, 1.0});
    }
  }
  // The parameters behind it move up.
  model.parameters.erase(model.parameters.begin() + static_cast<long>(at));
  LinearModel& m = as_linear(model);
  for (ParametrisedMatrix* each : {&m.A, &m.B, &m.C, &m.D, &m.G, &m.Q, &m.R, &m.S, &m.x0, &m.P0}) {
    if (each->block > static_cast<int>(at)) --each->block;
    for (ParametrisedMatrix::Entry& e : each->entries)
      e.parameter -= e.parameter > static_cast<int>(at);
  }
}

// Has the sampled model the same parameters, and are its matrices linear in them?
bool keeps_parameters_when_sampled(const LinearModel& m, const ParameterSet& parameters) {
  if (m.hold != InputHold::constant && m.B.constant.cols() > 0) return false;
  if (!is_known(m.A, parameters) || !is_known(m.B, parameters)) return false;
  return m.noise == ProcessNoise::per_sample ||
         (is_known(m.G, parameters) && !is_full(m.Q, parameters));
}

// Q of the sampled model, from the density of a model whose matrices are `written`.
ParametrisedMatrix sampled_density(const StateSpace& written, const ParametrisedMatrix& density,
                                   double step) {
  const auto integral = [&](const MatrixXd& of) {
    StateSpace m = written;
    m.Q = of;
    return discretise(m, ProcessNoise::density, step).Q;
  };
  ParametrisedMatrix out = constant_matrix(integral(density.constant));
  for (const int p : parameters_in(density)) {
    MatrixXd by = MatrixXd::Zero(density.constant.rows(), density.constant.cols());
    for (const ParametrisedMatrix::Entry& e : density.entries) {
      if (e.parameter == p) by(e.row, e.col) += e.factor;
    }
    const MatrixXd sampled = integral(by);
    for (Index j = 0; j < sampled.cols(); ++j) {
      for (Index i = 0; i < sampled.rows(); ++i) {
        if (sampled(i, j) == 0.0) continue;
        out.entries.push_back({static_cast<int>(i), static_cast<int>(j), p, sampled(i, j)});
      }
    }
  }
  return out;
}

}  // namespace

Model sampled_model(const Model& model) {
  const LinearModel& given = as_linear(model);
  if (!given.continuous || !keeps_parameters_when_sampled(given, model.parameters)) return model;
  Model out = model;
  const bool density = given.noise == ProcessNoise::density;
  if (density) split_block(out, as_linear(out).Q, "q");
  LinearModel& m = as_linear(out);
  const StateSpace written = written_matrices(m, out.parameters);
  const StateSpace sampled = discretise(written, m.noise, m.dt);
  m.continuous = false;
  m.A = constant_matrix(sampled.A);
  m.B = constant_matrix(sampled.B);
  if (!density) return out;
  m.Q = sampled_density(written, m.Q, m.dt);
  m.G = constant_matrix(sampled.G);
  m.S = constant_matrix(sampled.S);
  return out;
}

std::string shaping_fault(const Model& model, NoiseSource source) {
  const LinearModel& m = as_linear(model);
  if (m.continuous) {
    return "the model is in continuous time, and its dynamics hold free parameters, Q is a full "
           "matrix or inputs are held linearly; shaping filters are sampled";
  }
  if (m.initial == InitialState::given) {
    return "the initial state is given; say 'stationary' or 'diffuse'";
  }
  if (source == NoiseSource::measurement && is_full(m.Q, model.parameters)) {
    return "Q is a full matrix; coloured measurement noise needs one without correlations";
  }
  return "";
}

namespace {

// The states of the filters, which come first, start in their steady state, the others as they did.
void shift_start(LinearModel& model, Index filters) {
  if (model.initial != InitialState::partly_diffuse) return;
  std::vector<Index> stationary;
  for (Index i = 0; i < filters; ++i) stationary.push_back(i);
  for (const Index state : model.stationary) stationary.push_back(state + filters);
  model.stationary = stationary;
  for (LinearModel::StartOfState& each : model.known) each.state += filters;
}

}  // namespace

Model with_shaping_filters(const Model& model, NoiseSource source,
                           const std::vector<ShapedChannel>& channels) {
  if (const std::string fault = shaping_fault(model, source); !fault.empty()) {
    throw std::invalid_argument("with_shaping_filters: " + fault);
  }
  const bool process = source == NoiseSource::process;
  Model out = model;
  if (!process) split_block(out, as_linear(out).Q, "q");
  const LinearModel base = as_linear(out);
  LinearModel& m = as_linear(out);
  Index nf = 0;
  for (const ShapedChannel& c : channels) nf += c.filter.order();
  const auto extra = process ? Index{0} : static_cast<Index>(channels.size());
  const Index n = base.A.constant.rows(), nu = base.B.constant.cols(), ny = base.C.constant.rows();
  const Index nw = base.G.constant.cols();
  m.A = placed(base.A, nf + n, nf + n, nf, nf);
  m.B = placed(base.B, nf + n, nu, nf, 0);
  m.C = placed(base.C, ny, nf + n, 0, nf);
  m.G = placed(base.G, nf + n, nw + extra, nf, 0);
  if (!process) {
    m.Q = placed(base.Q, nw + extra, nw + extra, 0, 0);
    m.S = placed(base.S, nw + extra, ny, 0, 0);
  }
  shift_start(m, nf);
  Index f = 0;  // first state of the filter
  for (std::size_t c = 0; c < channels.size(); ++c) {
    const ShapedChannel& shaped = channels[c];
    const Index order = shaped.filter.order();
    const Index noise = process ? shaped.channel : nw + static_cast<Index>(c);
    const std::string prefix = fmt::format("{}{}_", process ? "w" : "v", shaped.channel + 1);
    if (process) {
      // G w becomes G (c f + w) with c = [1 0 ... 0].
      m.A.constant.block(nf, f, n, 1) = base.G.constant.col(noise);
      for (const ParametrisedMatrix::Entry& e : base.G.entries) {
        if (e.col != noise) continue;
        m.A.entries.push_back(
            {e.row + static_cast<int>(nf), static_cast<int>(f), e.parameter, e.factor});
      }
    } else {
      m.C.constant(shaped.channel, f) = 1.0;
      m.G.constant(f, noise) = 1.0;
      const int variance = add_scalar(out.parameters, prefix + "q", shaped.variance, true);
      m.Q.entries.push_back({static_cast<int>(noise), static_cast<int>(noise), variance, 1.0});
    }
    for (Index i = 0; i + 1 < order; ++i) m.A.constant(f + i, f + i + 1) = 1.0;
    const auto at = [&](Index i) { return static_cast<int>(f + i); };
    for (Index i = 0; i < order; ++i) {
      const int a = add_scalar(out.parameters, fmt::format("{}a{}", prefix, i + 1),
                               shaped.filter.a[i], false);
      m.A.entries.push_back({at(i), static_cast<int>(f), a, -1.0});
      // Observer form: g = b - a with a path from w to v around it, or [1; b] and a delay.
      if (process) m.G.entries.push_back({at(i), static_cast<int>(noise), a, -1.0});
    }
    for (Index i = 0; i < shaped.filter.b.size(); ++i) {
      const int b = add_scalar(out.parameters, fmt::format("{}b{}", prefix, i + 1),
                               shaped.filter.b[i], false);
      m.G.entries.push_back({at(process ? i : i + 1), static_cast<int>(noise), b, 1.0});
    }
    f += order;
  }
  return out;
}

namespace {

std::string number_text(double value) { return fmt::format("{:.12g}", value); }

// As a YAML string.
std::string in_quotes(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

// As the value of the key `prior`, in the parameter's unit; empty without one.
std::string prior_text(const Parameter& p) {
  const Unit unit = unit_or_dimensionless(p.unit);
  const std::string a = number_text(unit.from_si(p.prior.a));
  const std::string b = number_text(unit.from_si(p.prior.b));
  switch (p.prior.kind) {
    case Prior::Kind::none:
      return "";
    case Prior::Kind::uniform:
      return fmt::format(", prior: {{uniform: [{}, {}]}}", a, b);
    case Prior::Kind::log_uniform:
      return fmt::format(", prior: {{log-uniform: [{}, {}]}}", a, b);
    case Prior::Kind::normal:
      return fmt::format(", prior: {{normal: {{mean: {}, sd: {}}}}}", a,
                         number_text(p.prior.b / unit.scale));
    case Prior::Kind::log_normal:
      return fmt::format(", prior: {{log-normal: {{median: {}, factor: {}}}}}", a,
                         number_text(p.prior.b));
  }
  return "";
}

// An entry as a sum of parameters and a constant.
std::string entry_text(const ParametrisedMatrix& matrix, const ParameterSet& parameters, Index i,
                       Index j) {
  std::string out;
  const double constant = matrix.constant(i, j);
  for (const ParametrisedMatrix::Entry& e : matrix.entries) {
    if (e.row != i || e.col != j) continue;
    const std::string& name = parameters[e.parameter].name;
    const double size = std::abs(e.factor);
    const std::string term = size == 1.0 ? name : number_text(size) + "*" + name;
    if (out.empty()) {
      out = (e.factor < 0.0 ? "-" : "") + term;
    } else {
      out += (e.factor < 0.0 ? " - " : " + ") + term;
    }
  }
  if (out.empty()) return number_text(constant);
  if (constant != 0.0) {
    out += fmt::format(" {} {}", constant < 0.0 ? "-" : "+", number_text(std::abs(constant)));
  }
  return out;
}

std::string matrix_text(const std::string& name, const ParametrisedMatrix& matrix,
                        const ParameterSet& parameters) {
  if (matrix.block >= 0) {
    const Parameter& p = parameters[matrix.block];
    const char* structure = p.domain == Domain::diagonal          ? "diagonal"
                            : p.domain == Domain::scaled_identity ? "scaled-identity"
                                                                  : "full";
    std::string out = fmt::format("{}: {{structure: {}, start: [", name, structure);
    for (Index i = 0; i < p.value.rows(); ++i) {
      out += i > 0 ? ", [" : "[";
      for (Index j = 0; j < p.value.cols(); ++j) {
        out += (j > 0 ? ", " : "") + number_text(p.value(i, j));
      }
      out += "]";
    }
    return out + fmt::format("]{}{}}}\n", p.fixed ? ", fixed: true" : "", prior_text(p));
  }
  std::string out = name + ":\n";
  for (Index i = 0; i < matrix.constant.rows(); ++i) {
    out += "  - [";
    for (Index j = 0; j < matrix.constant.cols(); ++j) {
      out += (j > 0 ? ", " : "") + entry_text(matrix, parameters, i, j);
    }
    out += "]\n";
  }
  return out;
}

// States have no names here: x1, x2, ...
std::string initial_text(const LinearModel& model) {
  if (model.initial == InitialState::diffuse) return "initial: diffuse\n";
  if (model.initial != InitialState::partly_diffuse) return "initial: stationary\n";
  std::vector<std::string> starts(static_cast<std::size_t>(model.A.constant.rows()), "diffuse");
  for (const Index state : model.stationary) {
    starts[static_cast<std::size_t>(state)] = "stationary";
  }
  for (const LinearModel::StartOfState& each : model.known) {
    starts[static_cast<std::size_t>(each.state)] =
        fmt::format("{{mean: {}, sd: {}}}", number_text(each.mean), number_text(each.sd));
  }
  std::string out;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    out += fmt::format("{}x{}: {}", i > 0 ? ", " : "", i + 1, starts[i]);
  }
  return "initial: {" + out + "}\n";
}

std::string channels_text(const char* key, const std::vector<ChannelSource>& channels) {
  if (channels.empty()) return "";
  std::string out = fmt::format("{}: [", key);
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const ChannelSource& c = channels[i];
    out += fmt::format("{}{{name: {}, column: {}{}", i > 0 ? ", " : "", in_quotes(c.name),
                       in_quotes(c.column), c.unit.empty() ? "" : ", unit: " + in_quotes(c.unit));
    if (c.scale != 1.0) out += ", scale: " + number_text(c.scale);
    if (c.offset != 0.0) out += ", offset: " + number_text(c.offset);
    if (c.delay != 0.0) out += ", delay: " + number_text(c.delay) + " s";
    out += "}";
  }
  return out + "]\n";
}

}  // namespace

std::string model_text(const Model& model, const std::vector<std::string>& comment) {
  std::string out;
  for (const std::string& line : comment) out += "# " + line + "\n";
  out += fmt::format("identikal: 1\nname: {}\n", in_quotes(model.name));
  std::string time = "kind: discrete";
  if (!model.time.column.empty()) {
    time += fmt::format(", column: {}{}", in_quotes(model.time.column),
                        model.time.unit.empty() ? "" : ", unit: " + in_quotes(model.time.unit));
  }
  if (model.time.step > 0.0) time += fmt::format(", step: {} s", number_text(model.time.step));
  out += "time: {" + time + "}\n";
  std::string parameters;
  const LinearModel& m = as_linear(model);
  const auto is_block = [&m](int p) {
    for (const ParametrisedMatrix* each : {&m.Q, &m.R, &m.S, &m.P0}) {
      if (each->block == p) return true;
    }
    return false;
  };
  for (std::size_t i = 0; i < model.parameters.size(); ++i) {
    const Parameter& p = model.parameters[i];
    if (is_block(static_cast<int>(i))) continue;
    const Unit unit = unit_or_dimensionless(p.unit);
    std::string line =
        fmt::format("  {}: {{value: {}", p.name, number_text(unit.from_si(p.scalar())));
    if (std::isfinite(p.min)) line += fmt::format(", min: {}", number_text(unit.from_si(p.min)));
    if (std::isfinite(p.max)) line += fmt::format(", max: {}", number_text(unit.from_si(p.max)));
    if (!p.unit.empty()) line += ", unit: " + in_quotes(p.unit);
    if (p.fixed) line += ", fixed: true";
    parameters += line + prior_text(p) + "}\n";
  }
  if (!parameters.empty()) out += "parameters:\n" + parameters;
  out += matrix_text("A", m.A, model.parameters);
  if (m.B.constant.cols() > 0) out += matrix_text("B", m.B, model.parameters);
  out += matrix_text("C", m.C, model.parameters);
  if (m.D.constant.cols() > 0) out += matrix_text("D", m.D, model.parameters);
  out += matrix_text("G", m.G, model.parameters);
  out += matrix_text("Q", m.Q, model.parameters) + matrix_text("R", m.R, model.parameters);
  if (!m.S.constant.isZero(0.0) || !m.S.entries.empty()) {
    out += matrix_text("S", m.S, model.parameters);
  }
  out += initial_text(m);
  out += channels_text("inputs", model.inputs) + channels_text("outputs", model.outputs);
  return out;
}

}  // namespace identikal
