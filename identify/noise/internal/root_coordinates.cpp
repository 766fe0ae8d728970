#include "identify/noise/internal/root_coordinates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <optional>
#include <set>

#include <Eigen/Eigenvalues>

#include "lib/model/partial_autocorrelation.h"
#include "lib/model/polynomial_factors.h"
#include "solvers/covariance.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kStable = 1.0 - 1e-6;  // where an autoregression's search ends

// Of 1 - sum phi_k z^k, as what a root's reciprocal is.
using Roots = std::vector<std::complex<double>>;

Roots roots_of(const VectorXd& phi) {
  const Index p = phi.size();
  MatrixXd companion = MatrixXd::Zero(p, p);
  companion.row(0) = phi.transpose();
  companion.diagonal(-1).setOnes();
  const Eigen::VectorXcd all = companion.eigenvalues();
  return {all.begin(), all.end()};
}

VectorXd polynomial_of(const Roots& roots) {
  Eigen::VectorXcd c = Eigen::VectorXcd::Zero(static_cast<Index>(roots.size()) + 1);
  c[0] = 1.0;
  for (std::size_t i = 0; i < roots.size(); ++i) {
    for (Index k = static_cast<Index>(i) + 1; k > 0; --k) c[k] -= roots[i] * c[k - 1];
  }
  return -c.real().tail(c.size() - 1);
}

// One or two roots that leave a real polynomial when they are taken out.
using Taken = std::vector<std::size_t>;

std::vector<Taken> that_can_go(const Roots& roots, std::size_t count) {
  constexpr double kReal = 1e-9;
  std::vector<Taken> out;
  for (std::size_t i = 0; i < roots.size(); ++i) {
    const bool real = std::abs(roots[i].imag()) < kReal;
    if (count == 1 && real) out.push_back({i});
    for (std::size_t j = i + 1; j < roots.size() && count == 2; ++j) {
      const bool both = real && std::abs(roots[j].imag()) < kReal;
      if (both || std::abs(roots[i] - std::conj(roots[j])) < kReal) out.push_back({i, j});
    }
  }
  return out;
}

Roots without(const Roots& roots, const Taken& taken) {
  Roots out;
  for (std::size_t i = 0; i < roots.size(); ++i) {
    if (std::find(taken.begin(), taken.end(), i) == taken.end()) out.push_back(roots[i]);
  }
  return out;
}

// Poles and zeros less `count` of each, those that lie nearest to each other.
std::optional<std::array<Roots, 2>> without_nearest(const Roots& poles, const Roots& zeros,
                                                    std::size_t count) {
  std::optional<std::array<Roots, 2>> out;
  double nearest = std::numeric_limits<double>::infinity();
  for (const Taken& pole : that_can_go(poles, count)) {
    for (Taken zero : that_can_go(zeros, count)) {
      double distance = std::numeric_limits<double>::infinity();
      for (std::size_t turn = 0; turn < count; ++turn) {
        std::rotate(zero.begin(), zero.begin() + 1, zero.end());
        double here = 0.0;
        for (std::size_t k = 0; k < count; ++k) here += std::abs(poles[pole[k]] - zeros[zero[k]]);
        distance = std::min(distance, here);
      }
      if (distance >= nearest) continue;
      nearest = distance;
      out = {without(poles, pole), without(zeros, zero)};
    }
  }
  return out;
}

// Partial autocorrelations of all roots together.
std::optional<VectorXd> together(Roots roots, const Roots& more) {
  roots.insert(roots.end(), more.begin(), more.end());
  return partial_autocorrelations(polynomial_of(roots));
}

// One root at frequency 0 or pi, or a pair.
Roots line(double radius, double frequency, std::size_t count) {
  if (count == 1) return {radius * std::cos(frequency)};
  return {std::polar(radius, frequency), std::polar(radius, -frequency)};
}

}  // namespace

RootCoordinates::RootCoordinates(const Model& model, const FactorCoordinates& factors) {
  if (!is_linear(model)) return;
  const std::vector<Index> first = first_entries(model.parameters);
  const std::vector<PolynomialFactor> found =
      polynomial_factors(as_linear(model), model.parameters);
  for (const PolynomialFactor& each : found) {
    Factor factor{{}, {}, each.sign, each.moving_average, each.lag, each.group};
    for (const int p : each.parameters) {
      factor.entries.push_back(first[p]);
      factor.at.push_back(factors.coordinate_of(first[p]));
    }
    factors_.push_back(std::move(factor));
  }
  std::set<int> known, unknown;
  for (const PolynomialFactor& each : found) {
    known.insert(each.parameters.begin(), each.parameters.end());
  }
  const LinearModel& linear = as_linear(model);
  for (const ParametrisedMatrix* M : {&linear.A, &linear.C, &linear.G}) {
    for (const int p : parameters_in(*M)) {
      if (!model.parameters[static_cast<std::size_t>(p)].fixed) unknown.insert(p);
    }
  }
  all_dynamics_ = unknown == known;
}

VectorXd RootCoordinates::from(const VectorXd& y) const {
  constexpr double kFirst = 1e-7, kGrowth = 4.0;
  VectorXd z = y;
  for (const Factor& factor : factors_) {
    const VectorXd phi = factor.sign.cwiseProduct(y(factor.at));
    std::optional<VectorXd> partial = partial_autocorrelations(phi);
    for (double less = kFirst; !partial || partial->cwiseAbs().maxCoeff() > kStable;
         less *= kGrowth) {
      VectorXd nearer = phi;
      for (Index k = 0; k < phi.size(); ++k)
        nearer[k] *= std::pow(std::max(0.0, 1.0 - less), k + 1);
      partial = partial_autocorrelations(nearer);
    }
    z(factor.at) = *partial;
  }
  return z;
}

VectorXd RootCoordinates::to(const VectorXd& z) const {
  VectorXd y = z;
  for (const Factor& factor : factors_) {
    y(factor.at) = factor.sign.cwiseProduct(polynomial_coefficients(z(factor.at)));
  }
  return y;
}

VectorXd RootCoordinates::scattered(VectorXd z, Random& random) const {
  for (const Factor& factor : factors_) {
    const auto p = static_cast<Index>(factor.at.size());
    for (Index k = 0; k < p; ++k) {
      // Of all stable polynomials alike, the higher partial autocorrelations are the smaller ones
      // (Jones 1987, Appl. Statist. 36).
      const double r = 2.0 * random.uniform() - 1.0;
      z[factor.at[static_cast<std::size_t>(k)]] =
          0.98 * std::copysign(std::pow(std::abs(r), std::sqrt(static_cast<double>(k + 1))), r);
    }
  }
  return z;
}

void RootCoordinates::add_lines(const VectorXd& z, const Factor& poles, const Factor& zeros,
                                std::size_t count, std::vector<std::vector<VectorXd>>& out) const {
  constexpr int kFrequencies = 90;
  const auto rest = without_nearest(roots_of(polynomial_coefficients(z(poles.at))),
                                    roots_of(polynomial_coefficients(z(zeros.at))), count);
  if (!rest) return;
  // A single root is at one end of the frequencies or the other, and may be very near to the circle.
  std::vector<double> widths = {0.02, 0.004, 0.0005}, frequencies = {0.0, std::numbers::pi};
  if (count == 2) {
    widths.resize(1);
    frequencies.clear();
    for (int k = 0; k < kFrequencies; ++k) {
      frequencies.push_back(std::numbers::pi * (k + 0.5) / kFrequencies);
    }
  }
  for (const double width : widths) {
    const double nearer = 1.0 - width, farther = 1.0 - (count == 1 ? 2.0 : 3.5) * width;
    for (const bool peak : {true, false}) {
      out.emplace_back();
      for (const double frequency : frequencies) {
        const auto pole = together((*rest)[0], line(peak ? nearer : farther, frequency, count));
        const auto zero = together((*rest)[1], line(peak ? farther : nearer, frequency, count));
        if (!pole || !zero) continue;
        VectorXd there = z;
        there(poles.at) = *pole;
        there(zeros.at) = *zero;
        out.back().push_back(std::move(there));
      }
    }
  }
}

std::vector<std::vector<VectorXd>> RootCoordinates::with_lines(const VectorXd& z) const {
  std::vector<std::vector<VectorXd>> out;
  for (const Factor& poles : factors_) {
    for (const Factor& zeros : factors_) {
      const bool beside = !poles.moving_average && zeros.moving_average && poles.lag == 1 &&
                          zeros.lag == 1 && poles.group == zeros.group;
      if (!beside) continue;
      for (const std::size_t count : {1U, 2U}) add_lines(z, poles, zeros, count, out);
    }
  }
  return out;
}

double RootCoordinates::distance(const VectorXd& a, const VectorXd& b) const {
  const auto stretched = [](const VectorXd& partial) {
    return partial.cwiseMax(-kStable).cwiseMin(kStable).array().atanh().eval();
  };
  double out = 0.0;
  for (const Factor& factor : factors_) {
    out = std::max(out, (stretched(a(factor.at)) - stretched(b(factor.at))).abs().maxCoeff());
  }
  return out;
}

std::vector<RootsOnCircle> RootCoordinates::on_circle(const VectorXd& z) const {
  std::vector<RootsOnCircle> out;
  for (const Factor& factor : factors_) {
    const VectorXd partial = z(factor.at);
    const double border = factor.moving_average ? 1.0 : kStable;
    std::vector<bool> held;
    for (const double each : partial) held.push_back(std::abs(each) >= border);
    if (std::find(held.begin(), held.end(), true) == held.end()) continue;
    out.push_back({factor.entries, factor.sign, partial, held, factor.moving_average});
  }
  return out;
}

namespace {

// What the other coordinates inside their bounds are expected to gain, as the quadratic has it; none
// where that is more than a quadratic is good for.
double gain_of_others(const LikelihoodProblem& inside, const VectorXd& z, const VectorXd& gradient,
                      const MatrixXd& information, Index held) {
  constexpr double kNearby = 0.1, kFlat = 1e-9;
  std::vector<Index> others;
  for (Index k = 0; k < z.size(); ++k) {
    if (k != held && z[k] > inside.lower[k] && z[k] < inside.upper[k]) others.push_back(k);
  }
  if (others.empty()) return 0.0;
  const std::optional<MatrixXd> covariance = scaled_inverse(information(others, others), kFlat);
  if (!covariance) return 0.0;
  const VectorXd g = gradient(others);
  const double gain = 0.5 * g.dot(*covariance * g);
  return gain < kNearby ? gain : 0.0;
}

}  // namespace

VectorXd RootCoordinates::drawn_to_circle(const LikelihoodProblem& inside, VectorXd z) const {
  constexpr double kNear = 1e-2, kNegligible = 1e-4;
  double L = 0.0, there = 0.0;
  if (!inside.evaluate(z, L, nullptr, nullptr)) return z;
  for (const Factor& factor : factors_) {
    if (!factor.moving_average) continue;
    for (const Index i : factor.at) {
      if (1.0 - std::abs(z[i]) > kNear) continue;
      VectorXd drawn = z;
      drawn[i] = std::copysign(1.0, z[i]);
      VectorXd g;
      MatrixXd J;
      if (!inside.evaluate(drawn, there, &g, &J)) continue;
      // The others have not moved along yet.
      if (there + gain_of_others(inside, drawn, g, J, i) > L - kNegligible) z = drawn;
    }
  }
  return z;
}

LikelihoodProblem RootCoordinates::held_to_circle(LikelihoodProblem inside,
                                                  const VectorXd& z) const {
  for (const Factor& factor : factors_) {
    for (const Index i : factor.at) {
      if (z[i] <= inside.lower[i] || z[i] >= inside.upper[i]) {
        inside.lower[i] = inside.upper[i] = z[i];
      }
    }
  }
  return inside;
}

LikelihoodProblem RootCoordinates::problem(const LikelihoodProblem& by_coefficients) const {
  LikelihoodProblem out;
  out.lower = by_coefficients.lower;
  out.upper = by_coefficients.upper;
  for (const Factor& factor : factors_) {
    const double border = factor.moving_average ? 1.0 : kStable;
    out.lower(factor.at).setConstant(-border);
    out.upper(factor.at).setConstant(border);
  }
  out.evaluate = [this, &by_coefficients](const VectorXd& z, double& L, VectorXd* gradient,
                                          MatrixXd* information) {
    if (!by_coefficients.evaluate(to(z), L, gradient, information)) return false;
    if (gradient == nullptr) return true;
    MatrixXd J = MatrixXd::Identity(z.size(), z.size());
    for (const Factor& factor : factors_) {
      MatrixXd own;
      polynomial_coefficients(z(factor.at), &own);
      J(factor.at, factor.at) = factor.sign.asDiagonal() * own;
    }
    *gradient = (J.transpose() * *gradient).eval();
    if (information != nullptr) *information = (J.transpose() * *information * J).eval();
    return true;
  };
  return out;
}

}  // namespace identikal
