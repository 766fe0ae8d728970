#include "tests/campaigns/random_model_file.h"

#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <fmt/format.h>

#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model_file.h"
#include "lib/base/random.h"
#include "lib/data/csv.h"
#include "lib/data/dataset.h"
#include "lib/data/units.h"
#include "tests/support/joint_density.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

enum class Start { stationary, given, diffuse };

struct Channel {
  const char* unit;
  double scale = 1.0, offset = 0.0;  // of the model file: value = scale * recorded + offset

  double recorded(double si) const {
    return (unit_or_dimensionless(unit).from_si(si) - offset) / scale;
  }
  std::string text(const std::string& name, const std::string& equals) const {
    std::string out = fmt::format("{{name: {}, column: {}", name, name);
    if (*unit != '\0') out += fmt::format(", unit: {}", unit);
    if (scale != 1.0) out += fmt::format(", scale: {}", scale);
    if (offset != 0.0) out += fmt::format(", offset: {}", offset);
    if (!equals.empty()) out += fmt::format(", equals: \"{}\"", equals);
    return out + "}";
  }
};

struct Drawn {
  bool continuous, formulas, straight;  // inputs: straight between samples, else held
  Start start;
  StateSpace model;  // SI; in continuous time A, B, G of dx/dt and Q the density
  double step;
  std::vector<Channel> outputs, inputs;
};

// e^M by Taylor's series of M / 2^k, squared k times.
MatrixXd exponential(const MatrixXd& M) {
  const int squarings =
      std::max(0, static_cast<int>(std::ceil(std::log2(std::max(1e-9, M.norm())))) + 4);
  const MatrixXd small = M / std::pow(2.0, squarings);
  MatrixXd term = MatrixXd::Identity(M.rows(), M.cols()), out = term;
  for (int k = 1; k < 20; ++k) {
    term = (term * small / k).eval();
    out += term;
  }
  for (int k = 0; k < squarings; ++k) out = (out * out).eval();
  return out;
}

// From sample to sample, with inputs [u(t); u(t+1)]; the integrals by the exponentials of block
// matrices (van Loan 1978).
StateSpace sampled(const Drawn& drawn) {
  StateSpace m = drawn.model;
  const Index n = m.states(), nu = m.inputs();
  const double h = drawn.step;
  MatrixXd B0 = m.B, B1 = MatrixXd::Zero(n, nu);
  if (drawn.continuous) {
    MatrixXd of_inputs = MatrixXd::Zero(n + 2 * nu, n + 2 * nu);
    of_inputs.topLeftCorner(n, n) = m.A * h;
    of_inputs.block(0, n, n, nu) = m.B * h;
    of_inputs.block(n, n + nu, nu, nu).setIdentity();
    const MatrixXd E = exponential(of_inputs);
    const MatrixXd held = E.block(0, n, n, nu), ramp = E.block(0, n + nu, n, nu);
    B0 = drawn.straight ? MatrixXd(held - ramp) : held;
    if (drawn.straight) B1 = ramp;
    MatrixXd of_noise = MatrixXd::Zero(2 * n, 2 * n);
    of_noise << -m.A * h, m.G * m.Q * m.G.transpose() * h, MatrixXd::Zero(n, n),
        m.A.transpose() * h;
    const MatrixXd V = exponential(of_noise);
    m.A = V.bottomRightCorner(n, n).transpose();
    m.Q = m.A * V.topRightCorner(n, n);
    m.Q = (0.5 * (m.Q + m.Q.transpose())).eval();
    m.G = MatrixXd::Identity(n, n);
    m.S = MatrixXd::Zero(n, m.outputs());
  }
  MatrixXd B(n, 2 * nu), D(m.outputs(), 2 * nu);
  B << B0, B1;
  D << m.D, MatrixXd::Zero(m.outputs(), nu);
  m.B = B;
  m.D = D;
  return m;
}

// P = A P A' + G Q G', as a system of n^2 equations.
MatrixXd stationary_covariance(const StateSpace& m) {
  const Index n = m.states();
  MatrixXd system = MatrixXd::Identity(n * n, n * n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) system.block(i * n, j * n, n, n) -= m.A(i, j) * m.A;
  }
  const MatrixXd W = m.G * m.Q * m.G.transpose();
  return system.partialPivLu().solve(W.reshaped()).reshaped(n, n);
}

std::string number(double x) { return fmt::format("{:.17g}", x); }

// Entries of the file, some of them named parameters with values in units of their own.
class Writer {
 public:
  explicit Writer(Random& random) : random_(random) {}

  // A coefficient: a number, or now and then a parameter, or a formula of one.
  std::string entry(double value, const std::string& unit = "") {
    const double kind = random_.uniform();
    if (value == 0.0 || (unit.empty() && kind < 0.6)) return number(value);
    const std::string name = fmt::format("p{}", ++count_);
    if (unit.empty() && kind < 0.8) {
      parameters_ += fmt::format("  {}: {{value: {}}}\n", name, number(value));
      return name;
    }
    if (unit.empty()) {
      parameters_ += fmt::format("  {}: {}\n", name, number(0.5 * (value - 0.25)));
      return fmt::format("0.25 + 2*{}", name);
    }
    parameters_ +=
        fmt::format("  {}: {} {}\n", name, number(value / unit_or_dimensionless(unit).scale), unit);
    return name;
  }
  std::string matrix(const MatrixXd& M) {
    std::string out = "[";
    for (Index i = 0; i < M.rows(); ++i) {
      out += i == 0 ? "[" : ", [";
      for (Index j = 0; j < M.cols(); ++j) {
        out += fmt::format("{}\"{}\"", j == 0 ? "" : ", ", entry(M(i, j)));
      }
      out += "]";
    }
    return out + "]";
  }
  // Symmetric, of numbers alone.
  static std::string covariance(const MatrixXd& M) {
    std::string out = "[";
    for (Index i = 0; i < M.rows(); ++i) {
      out += i == 0 ? "[" : ", [";
      for (Index j = 0; j < M.cols(); ++j) out += (j == 0 ? "" : ", ") + number(M(i, j));
      out += "]";
    }
    return out + "]";
  }
  const std::string& parameters() const { return parameters_; }
  double uniform() { return random_.uniform(); }

 private:
  Random& random_;
  std::string parameters_;
  int count_ = 0;
};

std::string vector_text(const VectorXd& x) {
  std::string out = "[";
  for (Index i = 0; i < x.size(); ++i) out += (i == 0 ? "" : ", ") + number(x[i]);
  return out + "]";
}

std::string channels_text(const char* list, const char* name, const std::vector<Channel>& channels,
                          const std::vector<std::string>& equals) {
  if (channels.empty()) return "";
  std::string out = fmt::format("{}:\n", list);
  for (std::size_t i = 0; i < channels.size(); ++i) {
    out += fmt::format("  - {}\n", channels[i].text(fmt::format("{}{}", name, i + 1),
                                                    equals.empty() ? "" : equals[i]));
  }
  return out;
}

std::string initial_text(const Drawn& drawn) {
  if (drawn.start == Start::stationary) return "initial: stationary\n";
  if (drawn.start == Start::diffuse) return "initial: diffuse\n";
  return fmt::format("initial: {{mean: {}, covariance: {}}}\n", vector_text(drawn.model.x0),
                     Writer::covariance(drawn.model.P0));
}

std::string matrices_text(const Drawn& drawn, Writer& writer) {
  const StateSpace& m = drawn.model;
  std::string out =
      fmt::format("A: {}\nC: {}\nG: {}\nQ: {}\nR: {}\n", writer.matrix(m.A), writer.matrix(m.C),
                  writer.matrix(m.G), Writer::covariance(m.Q), Writer::covariance(m.R));
  if (m.inputs() > 0) {
    out += fmt::format("B: {}\nD: {}\n", writer.matrix(m.B), writer.matrix(m.D));
  }
  if (!m.S.isZero(0.0)) {
    std::string S = "[";
    for (Index i = 0; i < m.S.rows(); ++i) S += (i == 0 ? "" : ", ") + vector_text(m.S.row(i));
    out += fmt::format("S: {}]\n", S);
  }
  if (drawn.continuous) out += "noise: {process: density}\n";
  return out;
}

// The same as sums of products: states in metres where time is continuous, so that units are
// checked; rates in 1/min.
std::string formulas_text(const Drawn& drawn, Writer& writer, std::vector<std::string>& equals) {
  const StateSpace& m = drawn.model;
  const auto sum = [&](const MatrixXd& of_states, const MatrixXd& of_inputs, Index row,
                       const std::string& unit) {
    std::string out;
    const auto add = [&](const MatrixXd& M, const char* name) {
      for (Index j = 0; j < M.cols(); ++j) {
        if (M(row, j) == 0.0) continue;
        out += fmt::format("{}({})*{}{}", out.empty() ? "" : " + ", writer.entry(M(row, j), unit),
                           name, j + 1);
      }
    };
    add(of_states, "x");
    add(of_inputs, "u");
    return out.empty() ? std::string("0") : out;
  };
  std::string states, dynamics;
  for (Index i = 0; i < m.states(); ++i) {
    states += fmt::format("{}x{}{}", i == 0 ? "" : ", ", i + 1, drawn.continuous ? ": m" : "");
    dynamics +=
        fmt::format("  x{}: \"{}\"\n", i + 1, sum(m.A, m.B, i, drawn.continuous ? "1/min" : ""));
  }
  for (Index i = 0; i < m.outputs(); ++i) equals.push_back(sum(m.C, m.D, i, ""));
  return fmt::format("states: {}{}{}\ndynamics:\n{}G: {}\nQ: {}\nR: {}\n",
                     drawn.continuous ? "{" : "[", states, drawn.continuous ? "}" : "]", dynamics,
                     Writer::covariance(m.G), Writer::covariance(m.Q), Writer::covariance(m.R)) +
         (drawn.continuous ? "noise: {process: density}\n" : "");
}

Channel draw_channel(Random& random, bool metres) {
  constexpr const char* kAny[] = {"", "deg", "km/h", "degC", "g", "mm", "kg m^2"};
  constexpr const char* kMetres[] = {"m", "mm", "km", "cm"};
  Channel out{metres ? kMetres[static_cast<int>(random.uniform() * 4)]
                     : kAny[static_cast<int>(random.uniform() * 7)]};
  if (random.uniform() < 0.3) out.scale = -2.5;
  if (random.uniform() < 0.3) out.offset = 0.75;
  return out;
}

Drawn draw(Random& random) {
  const auto pick = [&](int from, int to) {
    return static_cast<Index>(from + static_cast<int>(random.uniform() * (to - from + 1)));
  };
  Drawn out;
  out.continuous = random.uniform() < 0.5;
  out.formulas = random.uniform() < 0.4;
  out.straight = out.continuous && random.uniform() < 0.5;
  out.start = static_cast<Start>(pick(0, 2));
  const Index n = pick(1, 4), nu = pick(0, 2), ny = pick(1, 2), nw = pick(1, static_cast<int>(n));
  out.model = random_model(random, n, nu, ny, nw);
  out.step = out.continuous ? 0.05 + 0.2 * random.uniform() : 1.0;
  if (out.continuous) {
    // Poles with time constants of the order of a second.
    out.model.A -= 1.5 * MatrixXd::Identity(n, n);
  }
  if (out.continuous || out.formulas || random.uniform() < 0.5) out.model.S.setZero();
  const bool metres = out.continuous && out.formulas;
  for (Index i = 0; i < ny; ++i) out.outputs.push_back(draw_channel(random, metres));
  for (Index i = 0; i < nu; ++i) out.inputs.push_back(draw_channel(random, metres));
  return out;
}

MatrixXd with_next(const MatrixXd& u) {
  MatrixXd out(2 * u.rows(), u.cols());
  out.topRows(u.rows()) = u;
  out.bottomRows(u.rows()).leftCols(u.cols() - 1) = u.rightCols(u.cols() - 1);
  out.bottomRows(u.rows()).rightCols(1) = u.rightCols(1);
  return out;
}

std::string csv_text(const Drawn& drawn, const MatrixXd& y, const MatrixXd& u) {
  std::string out = "t";
  for (std::size_t i = 0; i < drawn.outputs.size(); ++i) out += fmt::format(",y{}", i + 1);
  for (std::size_t i = 0; i < drawn.inputs.size(); ++i) out += fmt::format(",u{}", i + 1);
  for (Index t = 0; t < y.cols(); ++t) {
    out += "\n" + number(static_cast<double>(t) * drawn.step);
    const auto add = [&](const std::vector<Channel>& channels, const MatrixXd& values) {
      for (Index i = 0; i < values.rows(); ++i) {
        const double value = values(i, t);
        out += "," + (std::isnan(value) ? "" : number(channels[i].recorded(value)));
      }
    };
    add(drawn.outputs, y);
    add(drawn.inputs, u);
  }
  return out + "\n";
}

}  // namespace

double log_likelihood_of(const RandomModelFile& drawn) {
  const Model model = parse_model_file(drawn.yaml, "drawn.yaml");
  const std::vector<Dataset> recordings{
      make_dataset(parse_csv(drawn.csv, "drawn.csv"), model.time, model.inputs, model.outputs)};
  RecordingsLikelihood likelihood(model, recordings);
  const Likelihood* const at = likelihood.evaluate(model.parameters, false);
  return at == nullptr ? std::numeric_limits<double>::quiet_NaN() : at->value;
}

RandomModelFile draw_model_file(std::uint64_t seed) {
  Random random(seed);
  const Drawn drawn = draw(random);
  const StateSpace& m = drawn.model;
  const StateSpace discrete = sampled(drawn);
  const auto N = static_cast<Index>(12 + 12 * random.uniform());
  const MatrixXd u = random_matrix(random, m.inputs(), N), both = with_next(u);
  MatrixXd y = random_matrix(random, m.outputs(), N) * 2.0;
  for (double& sample : y.reshaped()) {
    if (random.uniform() < 0.1) sample = std::numeric_limits<double>::quiet_NaN();
  }

  RandomModelFile out;
  const VectorXd zero = VectorXd::Zero(m.states());
  const MatrixXd exact = MatrixXd::Zero(m.states(), m.states());
  switch (drawn.start) {
    case Start::given:
      out.log_likelihood = joint_log_density(stack(discrete, both, N, m.x0, m.P0), y);
      break;
    case Start::stationary:
      out.log_likelihood =
          joint_log_density(stack(discrete, both, N, zero, stationary_covariance(discrete)), y);
      break;
    case Start::diffuse:
      out.log_likelihood = diffuse_log_density(stack(discrete, both, N, zero, exact), y);
  }

  Writer writer(random);
  std::vector<std::string> equals;
  const std::string body =
      drawn.formulas ? formulas_text(drawn, writer, equals) : matrices_text(drawn, writer);
  out.yaml =
      fmt::format("identikal: 1\ntime: {{kind: {}, column: t, unit: s, step: {} s{}}}\n",
                  drawn.continuous ? "continuous" : "discrete", number(drawn.step),
                  drawn.continuous ? drawn.straight ? ", inputs: foh" : ", inputs: zoh" : "");
  if (!writer.parameters().empty()) out.yaml += "parameters:\n" + writer.parameters();
  out.yaml += channels_text("outputs", "y", drawn.outputs, equals) +
              channels_text("inputs", "u", drawn.inputs, {}) + body + initial_text(drawn);
  out.csv = csv_text(drawn, y, u);
  constexpr const char* kStarts[] = {"stationary", "given", "diffuse"};
  out.words = fmt::format(
      "seed {}: {}, {}, {}, {} states, {} outputs, {} inputs", seed,
      drawn.continuous ? "continuous" : "discrete", drawn.formulas ? "formulas" : "matrices",
      kStarts[static_cast<int>(drawn.start)], m.states(), m.outputs(), m.inputs());
  return out;
}

}  // namespace identikal
