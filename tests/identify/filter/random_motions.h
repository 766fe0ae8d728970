// Systems whose motion is known in closed form, drawn at random: are likelihood and slopes the
// equation's, however stiff, fast or abruptly driven it is?

#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <string>
#include <vector>

#include <Eigen/LU>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "lib/base/random.h"

namespace identikal::random_motions {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

enum class MotionKind { stiff, oscillating, driven };

// z' = p (mu z + beta u) of every mode, a real one or a pair; x = V [Re z; Im z], from c [1; 0].
struct Modes {
  std::vector<Complex> mu, beta;
  MatrixXd V;
  VectorXd time, u;  // u is held from sample to sample
  double sd = 0.0;

  Index states() const { return V.rows(); }
  static bool is_pair(const Complex& mu) { return mu.imag() != 0.0; }
};

inline Modes random_modes(MotionKind kind, Random& random) {
  Modes out;
  const int count = 1 + static_cast<int>(3.0 * random.uniform());
  for (int i = 0; i < count; ++i) {
    const bool pair = kind == MotionKind::oscillating;
    const double decay = kind == MotionKind::stiff ? std::pow(10.0, 8.0 * random.uniform() - 2.0)
                                                   : std::pow(10.0, 2.0 * random.uniform() - 1.5);
    out.mu.emplace_back(pair ? -0.02 * decay : -decay, pair ? 30.0 * random.uniform() + 0.1 : 0.0);
    const bool driven = kind == MotionKind::driven;
    out.beta.emplace_back(driven ? decay * random.normal() : 0.0,
                          driven && pair ? random.normal() : 0.0);
  }
  const Index n = std::count_if(out.mu.begin(), out.mu.end(), Modes::is_pair) + count;
  do {
    out.V = MatrixXd::Identity(n, n) + 0.4 * MatrixXd(random.normal(n * n).reshaped(n, n));
  } while (!(out.V.fullPivLu().rcond() > 0.1));
  const Index N = 12;
  out.time = VectorXd::LinSpaced(N, 0.0, 3.0 + 3.0 * random.uniform());
  out.u = VectorXd::Zero(N);
  for (Index k = 0; kind == MotionKind::driven && k < N; ++k) {
    out.u[k] = k > 0 && random.uniform() < 0.6 ? out.u[k - 1] : random.normal();
  }
  out.sd = 0.02;
  return out;
}

// dx/dt = p (A x + B u), in real coordinates.
inline std::string equations_of(const Modes& modes) {
  const Index n = modes.states();
  MatrixXd M = MatrixXd::Zero(n, n);
  VectorXd b = VectorXd::Zero(n);
  Index at = 0;
  for (std::size_t i = 0; i < modes.mu.size(); ++i) {
    M(at, at) = modes.mu[i].real();
    b[at] = modes.beta[i].real();
    if (Modes::is_pair(modes.mu[i])) {
      M(at + 1, at + 1) = M(at, at);
      M(at + 1, at) = modes.mu[i].imag();
      M(at, at + 1) = -modes.mu[i].imag();
      b[at + 1] = modes.beta[i].imag();
      ++at;
    }
    ++at;
  }
  const MatrixXd A = modes.V * M * modes.V.inverse();
  const VectorXd B = modes.V * b;
  std::string out;
  for (Index i = 0; i < n; ++i) {
    out += fmt::format("  x{}: \"p*({:.17g}*u", i, B[i]);
    for (Index j = 0; j < n; ++j) out += fmt::format("{:+.17g}*x{}", A(i, j), j);
    out += ")\"\n";
  }
  return out;
}

inline Model model_of(const Modes& modes) {
  const Index n = modes.states();
  std::string states, means;
  VectorXd start = VectorXd::Zero(n);
  Index at = 0;
  for (const Complex& mu : modes.mu) {
    start[at] = 1.0;
    at += Modes::is_pair(mu) ? 2 : 1;
  }
  const VectorXd x0 = modes.V * start;
  for (Index i = 0; i < n; ++i) {
    states += fmt::format("{}x{}", i > 0 ? ", " : "", i);
    means += fmt::format("{}x{}: \"{:.17g}*c\"", i > 0 ? ", " : "", i, x0[i]);
  }
  return parse_model_file(
      "identikal: 1\n"
      "time: {kind: continuous, column: t, unit: s, sampling: irregular, inputs: zoh}\n"
      "parameters:\n  p: {value: 1.05, min: 0.1, max: 10}\n  c: {value: 0.97, min: 0.1, max: 10}\n"
      "  s: {value: 0.02, min: 0.001, max: 1}\n"
      "states: [" +
          states + "]\ninputs: {u: {column: u}}\ndynamics:\n" + equations_of(modes) +
          "outputs: {y: {column: y, equals: \"x0 + 0.1*x0^2\"}}\n"
          "noise: {measurement: {sd: {y: s}}}\ninitial: {mean: {" +
          means + "}}\n",
      "modes.yaml");
}

inline VectorXd outputs_of(const Modes& modes, double p, double c) {
  std::vector<Complex> z(modes.mu.size(), Complex(c, 0.0));
  VectorXd out(modes.time.size()), real(modes.states());
  for (Index k = 0; k < out.size(); ++k) {
    Index at = 0;
    for (std::size_t i = 0; i < z.size(); ++i) {
      real[at++] = z[i].real();
      if (Modes::is_pair(modes.mu[i])) real[at++] = z[i].imag();
    }
    const double x = modes.V.row(0) * real;
    out[k] = x + 0.1 * x * x;
    if (k + 1 == out.size()) break;
    const double h = p * (modes.time[k + 1] - modes.time[k]);
    for (std::size_t i = 0; i < z.size(); ++i) {
      const Complex turn = std::exp(modes.mu[i] * h);
      z[i] = turn * z[i] + (turn - 1.0) / modes.mu[i] * modes.beta[i] * modes.u[k];
    }
  }
  return out;
}

inline double exact_value(const Modes& modes, const VectorXd& y, const VectorXd& at) {
  const VectorXd e = (y - outputs_of(modes, at[0], at[1])) / at[2];
  return -0.5 * e.squaredNorm() -
         static_cast<double>(y.size()) * (std::log(at[2]) + 0.5 * std::log(2.0 * M_PI));
}

inline double exact_slope(const Modes& modes, const VectorXd& y, const VectorXd& at, Index i) {
  const double h = 1e-4 * at[i];
  const auto there = [&](double steps) {
    VectorXd moved = at;
    moved[i] += steps * h;
    return exact_value(modes, y, moved);
  };
  return (8.0 * (there(1.0) - there(-1.0)) - (there(2.0) - there(-2.0))) / (12.0 * h);
}

struct Worst {
  double value = 0.0, slope = 0.0;
  int undefined = 0;
};

inline Worst worst_of(MotionKind kind, int systems, std::uint64_t seed) {
  Random random(seed);
  Worst out;
  for (int trial = 0; trial < systems; ++trial) {
    const Modes modes = random_modes(kind, random);
    const Model model = model_of(modes);
    const VectorXd y = outputs_of(modes, 1.0, 1.0) + modes.sd * random.normal(modes.time.size());
    const std::vector<Dataset> all{
        recording(model, y.transpose(), SampleTimes(modes.time), MatrixXd(modes.u.transpose()))};
    RecordingsLikelihood likelihood(model, all);
    for (int i = 0; i < 4 && likelihood.refine(model.parameters); ++i) {
    }
    const Likelihood* at = likelihood.evaluate(model.parameters, true);
    if (at == nullptr) {
      ++out.undefined;
      continue;
    }
    const VectorXd p = coordinates(model.parameters);
    const double exact = exact_value(modes, y, p);
    out.value = std::max(out.value, std::abs(at->value - exact) / std::max(1.0, std::abs(exact)));
    for (Index i = 0; i < p.size(); ++i) {
      const double slope = exact_slope(modes, y, p, i);
      const double size = std::max({1.0, std::abs(slope), std::sqrt(at->information(i, i))});
      out.slope = std::max(out.slope, std::abs(at->gradient[i] - slope) / size);
    }
  }
  return out;
}

// Slopes, by numbers of the size of one, within 1e-5 of themselves, of one standard error or of one
// nat.
inline void expect_exact(MotionKind kind, const char* name, int systems) {
  const Worst worst = worst_of(kind, systems, 1);
  std::printf("%d %s systems: log-likelihood to %.1e, slopes to %.1e, undefined %d\n", systems,
              name, worst.value, worst.slope, worst.undefined);
  EXPECT_LT(worst.value, 1e-6) << name;
  EXPECT_LT(worst.slope, 1e-5) << name;
  EXPECT_EQ(worst.undefined, 0) << name;
}

}  // namespace identikal::random_motions
