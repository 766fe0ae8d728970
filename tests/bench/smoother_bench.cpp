// What do a million samples cost to smooth, in time and memory, with and without missing samples?
#include <cmath>
#include <cstdio>
#include <ctime>
#include <string>

#include <sys/resource.h>

#include "lib/base/random.h"
#include "lib/filter/kalman.h"
#include "lib/filter/smoother.h"
#include "tests/support/random_model.h"

namespace {

double processor_time() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double largest_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

// Of Matisko (2013), chapter 6.
identikal::StateSpace system_7() {
  using Eigen::MatrixXd;
  identikal::StateSpace m;
  m.A = MatrixXd{{0.9, 0, 1, 1}, {0, -0.8, 0, -1}, {0, -0.1, 0.85, 1}, {-0.2, 0, 0, -0.9}};
  m.G = MatrixXd{{0, 0, 0.1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  m.C = MatrixXd{{1, 0, 0, 1}, {0, 1, 1, 0}};
  m.B.resize(4, 0);
  m.D.resize(2, 0);
  m.Q = Eigen::Vector3d(10, 3, 7).asDiagonal();
  m.R = Eigen::Vector2d(1.5, 3).asDiagonal();
  m.S = MatrixXd::Zero(3, 2);
  m.x0 = Eigen::VectorXd::Zero(4);
  m.P0 = MatrixXd::Identity(4, 4);
  return m;
}

}  // namespace

int main() {
  using namespace identikal;
  const StateSpace model = system_7();
  constexpr Eigen::Index kSamples = 1000000;
  Random random(1);
  const Eigen::MatrixXd u(0, kSamples);
  Eigen::MatrixXd y = simulate_outputs(random, model, u, kSamples);
  std::printf(
      "System 7 (4 states, 2 outputs), %.0e samples, diffuse start; states and standard\n"
      "deviations alone take %.0f MB\n",
      static_cast<double>(kSamples), 8.0 * 8.0 * kSamples / 1048576.0);
  for (const bool gaps : {false, true}) {
    for (Eigen::Index i = 0; gaps && i < y.size(); ++i) {
      if (random.uniform() < 0.1) y(i % 2, i / 2) = std::nan("");
    }
    for (const int lag : {-1, 0, 20, 100}) {
      const double begin = processor_time(), before = largest_memory();
      const SmootherResult smoothed =
          lag < 0
              ? smooth(model, InitialState::diffuse, y, u, SmootherKeep::deviations)
              : smooth_with_lag(model, InitialState::diffuse, y, u, lag, SmootherKeep::deviations);
      std::printf("%-18s %-14s %6.2f s, peak memory + %.0f MB%s\n",
                  gaps ? "10 % missing" : "gapless",
                  lag < 0 ? "whole record" : ("lag " + std::to_string(lag)).c_str(),
                  processor_time() - begin, largest_memory() - before,
                  smoothed.status == FilterStatus::ok ? "" : " FAILED");
    }
  }
}
