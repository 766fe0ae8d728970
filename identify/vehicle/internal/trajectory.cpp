#include "identify/vehicle/internal/trajectory.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include "identify/vehicle/internal/state_path.h"
#include "lib/base/error.h"
#include "lib/base/median.h"
#include "solvers/solve.h"

namespace identikal {
namespace {

constexpr double kFixedPath = 1e-9;     // function tolerance of the path at given noise
constexpr double kSettledNoise = 1e-3;  // relative change of every noise in a round
constexpr double kFarthest = 1.5;       // change of a noise's logarithm in a round
constexpr double kLeastNoise = 1e-4;    // of the first guess: none
constexpr int kMostRounds = 40;
constexpr double kFarOff = 4.0;            // [standard deviations]; 1 of 16000 normal samples
constexpr int kReadmitted = 5;             // rounds in which samples may come back
constexpr double kLeftOut = 1e-12;         // weight
constexpr double kStillIdentified = 1e-9;  // of the scaled information's largest eigenvalue

/// Noise to begin with: the outputs' by the differences of neighbouring errors of the simulation,
/// the process so that it makes up for those errors within a second.
NoiseSd first_noise(const VehicleProblem& problem, const VehicleOptimum& start) {
  const Eigen::Index outputs = problem.run->y.rows();
  Eigen::VectorXd e;
  output_error(problem, start.z, e, nullptr);
  Eigen::VectorXd previous = Eigen::VectorXd::Constant(outputs, kNone);
  std::vector<std::vector<double>> change(static_cast<std::size_t>(outputs));
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    const Eigen::Index j = problem.output[i];
    const double now = e[i];
    if (!std::isnan(previous[j])) {
      change[j].push_back(std::abs(now - previous[j]));
    }
    previous[j] = now;
  }
  NoiseSd out(outputs + 2);
  for (Eigen::Index j = 0; j < outputs; ++j) {
    const double given = problem.run->outputs[j].given_sd;
    double sd = 0.5 * start.sd[j];
    if (!change[j].empty()) {
      // The median of |N(0, 2 sd^2)| is .954 sd.
      sd = std::clamp(median(change[j]) / 0.954, 0.02 * start.sd[j], start.sd[j]);
    }
    out[j] = std::isnan(given) ? sd : given;
  }
  const auto error_of = [&](VehicleQuantity quantity, double otherwise) {
    const Eigen::Index j = problem.run->find(quantity);
    return j < 0 ? otherwise : start.sd[j];
  };
  out[outputs] = error_of(VehicleQuantity::vy, 0.1);
  out[outputs + 1] = error_of(VehicleQuantity::r, 0.02);
  return out;
}

/// Robust: samples that leap away from the median of five neighbours' errors are left out at first.
Eigen::VectorXd first_weights(const VehicleProblem& problem, const VehicleOptimum& start) {
  Eigen::VectorXd weight = Eigen::VectorXd::Ones(problem.residuals());
  if (!problem.robust) return weight;
  Eigen::VectorXd e;
  output_error(problem, start.z, e, nullptr);
  for (Eigen::Index j = 0; j < problem.run->y.rows(); ++j) {
    std::vector<Eigen::Index> samples;
    for (std::size_t i = 0; i < problem.output.size(); ++i) {
      if (problem.output[i] == j) samples.push_back(static_cast<Eigen::Index>(i));
    }
    if (samples.size() < 5) continue;
    std::vector<double> leap;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const std::size_t from = std::min(i < 2 ? 0 : i - 2, samples.size() - 5);
      std::vector<double> near;
      for (std::size_t k = from; k < from + 5; ++k) near.push_back(e[samples[k]]);
      leap.push_back(std::abs(e[samples[i]] - median(near)));
    }
    // 1.48 times the median of |N(0, 1)| is 1.
    const double usual = 1.48 * median(leap);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (leap[i] > 1.5 * kFarOff * usual) weight[samples[i]] = kLeftOut;
    }
  }
  return weight;
}

VehicleCovariance covariance_of(const VehicleProblem& problem, const VehicleOptimum& best,
                                const StatePath::Marginal& marginal,
                                const std::vector<bool>& held) {
  VehicleCovariance out;
  out.sd = best.sd;
  out.residuals = marginal.residuals;
  const Eigen::Index k = problem.parameters();
  out.at_bound = held;
  for (Eigen::Index i = 0; i < k; ++i) {
    if (!held[i]) out.inner.push_back(i);
  }
  const auto inner = static_cast<Eigen::Index>(out.inner.size());
  Eigen::MatrixXd information(inner, inner);
  Eigen::VectorXd size(inner), scale(inner);
  for (Eigen::Index i = 0; i < inner; ++i) {
    for (Eigen::Index j = 0; j < inner; ++j) {
      information(i, j) = marginal.information(out.inner[i], out.inner[j]);
    }
    size[i] = information(i, i) > 0.0 ? std::sqrt(information(i, i)) : 1.0;
    scale[i] = problem.unknowns.scale[out.inner[i]];
  }
  Eigen::MatrixXd inverse(inner, inner);
  out.null_space.resize(inner, 0);
  if (inner > 0) {
    const Eigen::MatrixXd over_size = size.cwiseInverse().asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(over_size * information * over_size);
    const double least = kStillIdentified * eigen.eigenvalues().maxCoeff();
    const Eigen::Index flat = (eigen.eigenvalues().array() <= least).count();
    const Eigen::MatrixXd vectors = over_size * eigen.eigenvectors();
    inverse = vectors.rightCols(inner - flat) *
              eigen.eigenvalues().tail(inner - flat).cwiseInverse().asDiagonal() *
              vectors.rightCols(inner - flat).transpose();
    if (flat > 0) {
      out.null_space = vectors.leftCols(flat).householderQr().householderQ() *
                       Eigen::MatrixXd::Identity(inner, flat);
    }
  }
  out.information =
      scale.cwiseInverse().asDiagonal() * information * scale.cwiseInverse().asDiagonal();
  out.white = scale.asDiagonal() * inverse * scale.asDiagonal();
  out.covariance = out.white;
  out.freedom = static_cast<double>(std::max<Eigen::Index>(1, problem.residuals() - k));
  return out;
}

/// The noise that is estimated: all but what the model file gives.
std::vector<Eigen::Index> free_noise(const VehicleProblem& problem, Eigen::Index size) {
  std::vector<Eigen::Index> out;
  for (Eigen::Index i = 0; i < size; ++i) {
    const bool given = i < problem.run->y.rows() && !std::isnan(problem.run->outputs[i].given_sd);
    if (!given) out.push_back(i);
  }
  return out;
}

/// Moves the free noise to where the problem linearised about a path makes the recording most
/// likely.
/// @param first  the noise that the fit began with
/// @return the largest change of a logarithm
double update_noise(const StatePath& path, const StatePath::Linearisation& about,
                    const NoiseSd& first, const std::vector<Eigen::Index>& free, NoiseSd& noise) {
  const auto count = static_cast<Eigen::Index>(free.size());
  if (count == 0) return 0.0;
  // Coordinates are changes of the logarithms.
  const auto changed = [&](const Eigen::VectorXd& by) {
    NoiseSd to = noise;
    for (Eigen::Index i = 0; i < count; ++i) to[free[i]] *= std::exp(by[i]);
    return to;
  };
  Minimization most_likely;
  most_likely.lower = most_likely.upper = Eigen::VectorXd::Constant(count, kFarthest);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Index at = free[i];
    most_likely.lower[i] =
        std::min(0.0, std::max(-kFarthest, std::log(kLeastNoise * first[at] / noise[at])));
  }
  most_likely.evaluate = [&](const Eigen::VectorXd& by, double& f, Eigen::VectorXd* gradient) {
    const StatePath::Marginal marginal = path.marginal(about, changed(by));
    f = -marginal.log_likelihood;
    if (gradient != nullptr) {
      gradient->resize(count);
      for (Eigen::Index i = 0; i < count; ++i) {
        (*gradient)[i] = marginal.counts[free[i]] - marginal.moved[free[i]];
      }
    }
    return std::isfinite(f);
  };
  const Solution moved = solve(most_likely, Eigen::VectorXd::Zero(count), SolverOptions{});
  noise = changed(moved.x);
  return moved.x.cwiseAbs().maxCoeff();
}

/// Robust: leaves out the samples that deviate too far from what all others predict.
/// @return whether any weight changed
bool update_weights(const Eigen::VectorXd& deviation, int round, Eigen::VectorXd& weight) {
  bool changed = false;
  for (Eigen::Index i = 0; i < weight.size(); ++i) {
    // Neighbours may exclude each other in turn: what is left out late stays out.
    const bool out_for_good = weight[i] != 1.0 && round >= kReadmitted;
    const double now = out_for_good || deviation[i] > kFarOff ? kLeftOut : 1.0;
    changed = changed || now != weight[i];
    weight[i] = now;
  }
  return changed;
}

std::vector<bool> parameters_at_bound(const VehicleProblem& problem, const Eigen::VectorXd& z) {
  std::vector<bool> out;
  for (Eigen::Index i = 0; i < problem.parameters(); ++i) {
    const double near = 1e-6 * std::max(1.0, std::abs(z[i]));
    out.push_back(z[i] - problem.lower[i] <= near || problem.upper[i] - z[i] <= near);
  }
  return out;
}

}  // namespace

VehicleTrajectory fit_trajectory(const VehicleProblem& problem, const VehicleOptimum& start,
                                 const SolverOptions& options) {
  if (problem.unknowns.value[kRelaxationLength] > 0.0 ||
      problem.unknowns.find(kRelaxationLength) >= 0) {
    throw InputError({}, "--method trajectory does not apply to a car with a relaxation_length",
                     "a model file without it, or --method output-error");
  }
  StatePath path(problem);
  const NoiseSd first = first_noise(problem, start);
  const std::vector<Eigen::Index> free = free_noise(problem, first.size());
  NoiseSd noise = first;
  Eigen::VectorXd x = path.begin(start.z);
  Eigen::VectorXd weight = first_weights(problem, start);
  VehicleTrajectory out;
  out.best.message = "the noise did not settle";
  SolverOptions inner = options;
  inner.function_tolerance = kFixedPath;
  for (int round = 0; round < kMostRounds && !out.best.converged; ++round) {
    path.set_noise(noise, weight);
    const Solution solution = solve(path.sparse(), x, inner);
    x = solution.x;
    out.best.iterations += solution.summary.iterations;
    out.best.evaluations += solution.summary.evaluations;
    if (!solution.summary.usable()) {
      out.best.message = solution.summary.message;
      break;
    }
    const StatePath::Linearisation about = path.linearise(x);
    const double change = update_noise(path, about, first, free, noise);
    const bool reweighted =
        problem.robust && update_weights(path.marginal(about, noise).deviation, round, weight);
    out.best.converged = change < kSettledNoise && !reweighted;
  }
  if (out.best.converged) out.best.message = "path and noise have settled";
  const StatePath::Marginal marginal = path.marginal(path.linearise(x), noise);
  out.best.z = path.coordinates(x);
  out.best.sd = noise.head(path.outputs());
  out.best.log_likelihood = marginal.log_likelihood;
  out.left_out = (weight.array() != 1.0).count();
  out.process = noise.tail<2>();
  out.states = path.states(x);
  out.covariance =
      covariance_at_bounds(problem, out.best.z, parameters_at_bound(problem, out.best.z),
                           [&](const std::vector<bool>& held) {
                             return covariance_of(problem, out.best, marginal, held);
                           });
  return out;
}

}  // namespace identikal
