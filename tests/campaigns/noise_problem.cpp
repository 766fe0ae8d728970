#include "tests/campaigns/noise_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "identify/model/builder.h"
#include "identify/model/recording.h"
#include "lib/base/random.h"
#include "lib/filter/steady_state.h"
#include "lib/model/discretise.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kStep = 0.1;  // s

// Evenly in its logarithm.
double draw(Random& random, double low, double high) {
  return low * std::pow(high / low, random.uniform());
}

double draw_evenly(Random& random, double low, double high) {
  return low + (high - low) * random.uniform();
}

int draw_one_of(Random& random, int count) {
  return std::min(count - 1, static_cast<int>(random.uniform() * count));
}

// dx/dt = A x + G w, y = C x + v: the system without any fault.
struct TrueSystem {
  std::string name;
  MatrixXd A, G, C;
  bool integrates;
  VectorXd q, r;  // densities of w, variances of v
};

TrueSystem draw_dynamics(Random& random) {
  const double lag = draw(random, 3.0, 50.0) * kStep;
  const double omega = 2.0 * std::numbers::pi / (draw(random, 8.0, 80.0) * kStep);
  const double damping = draw(random, 0.03, 0.7);
  MatrixXd one = MatrixXd::Ones(1, 1);
  MatrixXd force = MatrixXd::Zero(2, 1), position = MatrixXd::Zero(1, 2);
  force(1, 0) = position(0, 0) = 1.0;
  switch (draw_one_of(random, 6)) {
    case 0:
      return {"level", 0.0 * one, one, one, true, {}, {}};
    case 1:
      return {"tracker", MatrixXd{{0, 1}, {0, 0}}, force, position, true, {}, {}};
    case 2:
      return {"lag", -one / lag, one, one, false, {}, {}};
    case 3:
      return {"oscillator",
              MatrixXd{{0, 1}, {-omega * omega, -2.0 * damping * omega}},
              force,
              position,
              false,
              {},
              {}};
    case 4:
      return {"damped tracker", MatrixXd{{0, 1}, {0, -1.0 / lag}}, force, position, true, {}, {}};
    default: {
      const double second = draw(random, 3.0, 50.0) * kStep;
      MatrixXd A{{-1.0 / lag, 0.5 / lag}, {0, -1.0 / second}};
      return {"two outputs", A, MatrixXd::Identity(2, 2), MatrixXd::Identity(2, 2), false, {}, {}};
    }
  }
}

StateSpace sampled(const TrueSystem& of, double step) {
  StateSpace m;
  const Index n = of.A.rows(), ny = of.C.rows(), nw = of.G.cols();
  m.A = of.A, m.G = of.G, m.C = of.C;
  m.B = MatrixXd(n, 0), m.D = MatrixXd(ny, 0);
  m.Q = of.q.asDiagonal(), m.R = of.r.asDiagonal();
  m.S = MatrixXd::Zero(nw, ny);
  m.x0 = VectorXd::Zero(n), m.P0 = MatrixXd::Identity(n, n);
  return discretise(m, ProcessNoise::density, step);
}

// The variances of v, and q so that the process makes a given part of the innovations.
void draw_noise(TrueSystem& system, Random& random) {
  const double part = draw(random, 0.1, 3.0);
  system.r = VectorXd::NullaryExpr(system.C.rows(), [&] { return draw(random, 0.3, 3.0); });
  const auto found = [&](double q) {
    system.q = VectorXd::Constant(system.G.cols(), q);
    const auto steady = steady_state(sampled(system, kStep));
    return steady ? steady->Sigma.trace() / system.r.sum() - 1.0 : 0.0;
  };
  double low = 1e-12, high = 1e12;
  while (high / low > 1.001) {
    const double middle = std::sqrt(low * high);
    (found(middle) < part ? low : high) = middle;
  }
  found(high);
}

Model given_model(const TrueSystem& believed) {
  std::vector<std::pair<std::string, double>> q, r;
  for (Index i = 0; i < believed.q.size(); ++i) q.emplace_back(fmt::format("q{}", i + 1), 1.0);
  for (Index i = 0; i < believed.r.size(); ++i) r.emplace_back(fmt::format("r{}", i + 1), 1.0);
  LinearModelBuilder model = linear_model().A(believed.A).G(believed.G).C(believed.C);
  model.process_noise(variances(q))
      .measurement_noise(variances(r))
      .continuous()
      .step(kStep)
      .name(believed.name);
  if (believed.integrates) model.diffuse();
  return model;
}

// What the recording is made with.
struct Making {
  TrueSystem system;         // with states that faults added
  double step = kStep;       // of the recording
  bool stamped = false;      // it says so itself
  double colour_time = 0.0;  // of w, in s
  VectorXd colour;           // of v: v(t+1) = colour v(t) + ..., one per output
  double outlier_share = 0.0, outlier_size = 0.0;
  double R_factor = 1.0, R_from = 1.0, R_to = 1.0;  // grows between these parts of the recording
};

// One more state, or two, behind w or in an output.
void extend(TrueSystem& system, const MatrixXd& A, const MatrixXd& from_old, const MatrixXd& to_old,
            const MatrixXd& C) {
  const Index n = system.A.rows(), more = A.rows();
  MatrixXd all = MatrixXd::Zero(n + more, n + more);
  all << system.A, to_old, from_old, A;
  system.A = all;
  MatrixXd outputs(system.C.rows(), n + more);
  outputs << system.C, C;
  system.C = outputs;
}

double sign(Random& random) { return random.uniform() < 0.5 ? -1.0 : 1.0; }

void move_pole(Making& making, Random& random, std::string& words, Index N) {
  MatrixXd& A = making.system.A;
  if (making.system.integrates) {
    const double leak = draw(random, 3.0, static_cast<double>(N)) * kStep;
    A.diagonal().array() -= 1.0 / leak;
    words += fmt::format(", leak {:.3g} s", leak);
  } else {
    const double by = std::exp(sign(random) * draw(random, 0.02, 1.0));
    A *= by;
    words += fmt::format(", poles x {:.3g}", by);
  }
}

// A stationary process of a share of r's variance, added to a random output.
void add_state(Making& making, Random& random, std::string& words) {
  TrueSystem& system = making.system;
  const Index n = system.A.rows(), nw = system.G.cols(), ny = system.C.rows();
  const Index output = draw_one_of(random, static_cast<int>(ny));
  const double variance = draw(random, 0.03, 20.0) * system.r[output];
  const bool swings = random.uniform() < 0.5;
  const double tau = draw(random, 2.0, 100.0) * kStep;
  MatrixXd A;
  double density = 0.0;
  if (swings) {
    const double omega = 2.0 * std::numbers::pi / (draw(random, 3.0, 60.0) * kStep);
    const double damping = draw(random, 0.02, 0.5);
    A = MatrixXd{{0, 1}, {-omega * omega, -2.0 * damping * omega}};
    density = 4.0 * damping * omega * omega * omega * variance;
  } else {
    A = MatrixXd::Constant(1, 1, -1.0 / tau);
    density = 2.0 * variance / tau;
  }
  const Index more = A.rows();
  MatrixXd C = MatrixXd::Zero(ny, more);
  C(output, 0) = 1.0;
  extend(system, A, MatrixXd::Zero(more, n), MatrixXd::Zero(n, more), C);
  MatrixXd G = MatrixXd::Zero(n + more, nw + 1);
  G.topLeftCorner(n, nw) = system.G;
  G(n + more - 1, nw) = 1.0;
  system.G = G;
  system.q.conservativeResize(nw + 1);
  system.q[nw] = density;
  words += fmt::format(", missing {} of {:.3g} R", swings ? "oscillation" : "lag",
                       variance / system.r[output]);
}

// Every w becomes a lag driven by w, with the same density at frequency zero.
void colour_process(Making& making, Random& random, std::string& words) {
  TrueSystem& system = making.system;
  const Index n = system.A.rows(), nw = system.G.cols(), ny = system.C.rows();
  const double tau = draw(random, 0.2, 30.0) * kStep;
  extend(system, -MatrixXd::Identity(nw, nw) / tau, MatrixXd::Zero(nw, n), system.G,
         MatrixXd::Zero(ny, nw));
  system.G = MatrixXd::Zero(n + nw, nw);
  system.G.bottomRows(nw) = MatrixXd::Identity(nw, nw) / tau;
  making.colour_time = tau;
  words += fmt::format(", process noise of {:.3g} s", tau);
}

void add_fault(Making& making, NoiseFault fault, Random& random, Index N, std::string& words) {
  switch (fault) {
    case NoiseFault::wrong_A:
      move_pole(making, random, words, N);
      break;
    case NoiseFault::missing_state:
      add_state(making, random, words);
      break;
    case NoiseFault::coloured_output: {
      const double colour =
          sign(random) > 0.0 ? draw(random, 0.03, 0.98) : -draw(random, 0.03, 0.9);
      making.colour.setConstant(colour);
      words += fmt::format(", measurement noise of colour {:.3g}", colour);
      break;
    }
    case NoiseFault::coloured_process:
      colour_process(making, random, words);
      break;
    case NoiseFault::outliers:
      making.outlier_share = draw(random, 1e-3, 0.05);
      making.outlier_size = draw(random, 4.0, 40.0);
      words += fmt::format(", {:.2g} % outliers of {:.3g} sd", 100.0 * making.outlier_share,
                           making.outlier_size);
      break;
    case NoiseFault::changing_R:
      making.R_factor = std::exp(sign(random) * draw(random, 0.1, 3.0));
      making.R_from = draw_evenly(random, 0.1, 0.9);
      making.R_to = random.uniform() < 0.5 ? making.R_from : 1.0;
      words += fmt::format(", R x {:.3g} from {:.2g} to {:.2g}", making.R_factor, making.R_from,
                           making.R_to);
      break;
    case NoiseFault::wrong_step:
      making.step = kStep * std::exp(sign(random) * draw(random, 0.01, 1.0));
      making.stamped = random.uniform() < 0.5;
      words += fmt::format(", step {:.3g} s{}", making.step, making.stamped ? ", stamped" : "");
      break;
  }
}

// Variance of v at a part of the recording, over its first.
double relative_R(const Making& making, double part) {
  if (part < making.R_from) return 1.0;
  if (part >= making.R_to) return making.R_factor;
  return 1.0 + (making.R_factor - 1.0) * (part - making.R_from) / (making.R_to - making.R_from);
}

MatrixXd simulate(const Making& making, Random& random, Index N) {
  const TrueSystem& system = making.system;
  const StateSpace m = sampled(system, making.step);
  const MatrixXd L = semidefinite_factor(m.Q);
  const Index n = m.states(), ny = m.outputs(), before = 1000;
  VectorXd x = VectorXd::Zero(n), v = VectorXd::Zero(ny);
  MatrixXd y(ny, N);
  for (Index t = -before; t < N; ++t) {
    const double part = static_cast<double>(t) / static_cast<double>(N);
    const Eigen::ArrayXd innovation = (1.0 - making.colour.array().square()).sqrt();
    v = (making.colour.array() * v.array() + innovation * random.normal(ny).array()).matrix();
    if (t >= 0) {
      const double scale = std::sqrt(relative_R(making, part));
      y.col(t) = system.C * x + scale * system.r.cwiseSqrt().cwiseProduct(v);
      for (Index i = 0; i < ny; ++i) {
        const bool outlier = random.uniform() < making.outlier_share;
        const double off = making.outlier_size * std::sqrt(system.r[i]) * sign(random);
        if (outlier) y(i, t) += off;
      }
    }
    x = m.A * x + L * random.normal(n);
  }
  return y;
}

double mean_R(const Making& making) {
  constexpr int kParts = 10000;
  double sum = 0.0;
  for (int i = 0; i < kParts; ++i) sum += relative_R(making, (i + 0.5) / kParts);
  return sum / kParts;
}

// What a density of one means to the model that the user has.
double density_factor(const Making& making, const TrueSystem& believed) {
  double out = 1.0;
  // Without time stamps nothing tells the step: in the clock of the samples, integrating twice.
  const bool twice = believed.G.rows() == 2 && believed.G.cols() == 1;
  if (!making.stamped) out *= std::pow(making.step / kStep, twice ? 3.0 : 1.0);
  // Where the states answer: at their own frequency, or slowly.
  const double omega = believed.name == "oscillator" ? std::sqrt(-believed.A(1, 0)) : 0.0;
  return out / (1.0 + std::pow(omega * making.colour_time, 2));
}

}  // namespace

std::string to_string(NoiseFault fault) {
  switch (fault) {
    case NoiseFault::wrong_A:
      return "wrong A";
    case NoiseFault::missing_state:
      return "missing state";
    case NoiseFault::coloured_output:
      return "coloured measurement noise";
    case NoiseFault::coloured_process:
      return "coloured process noise";
    case NoiseFault::outliers:
      return "outliers";
    case NoiseFault::changing_R:
      return "changing R";
    case NoiseFault::wrong_step:
      return "wrong step";
  }
  return "";
}

NoiseProblem draw_noise_problem(std::uint64_t seed, int faults) {
  constexpr int kKinds = 7;
  Random random(seed);
  TrueSystem believed = draw_dynamics(random);
  draw_noise(believed, random);
  const auto N = static_cast<Index>(draw(random, 200.0, 5000.0));
  NoiseProblem out;
  out.words = fmt::format("{} of {} samples", believed.name, N);
  Making making;
  making.system = believed;
  making.colour = VectorXd::Zero(believed.C.rows());
  while (static_cast<int>(out.faults.size()) < faults) {
    const auto fault = static_cast<NoiseFault>(draw_one_of(random, kKinds));
    if (std::find(out.faults.begin(), out.faults.end(), fault) != out.faults.end()) continue;
    out.faults.push_back(fault);
  }
  // In the order of the list: a pole moves before states are added.
  std::sort(out.faults.begin(), out.faults.end());
  for (const NoiseFault fault : out.faults) add_fault(making, fault, random, N, out.words);
  out.model = given_model(believed);
  for (const double q : believed.q) out.truth.push_back(q * density_factor(making, believed));
  for (const double r : believed.r) out.truth.push_back(r * mean_R(making));
  Model of_any_step = out.model;
  of_any_step.time.step = 0.0;
  out.recording =
      recording(of_any_step, simulate(making, random, N), making.stamped ? making.step : kStep);
  return out;
}

}  // namespace identikal
