#include "identify/vehicle/steering_noise.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <string>

#include <Eigen/Cholesky>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/vehicle/internal/initial_states.h"
#include "identify/vehicle/output_error.h"
#include "identify/vehicle/steering_steps.h"
#include "lib/base/constants.h"
#include "lib/base/median.h"
#include "lib/base/random.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMatrix = LeastSquares::RowMatrix;

constexpr int kHighestDifference = 6;
constexpr Index kLeastBlock = 32;
constexpr double kFlat = 0.85;         // of one difference's noise over that of the lower one's
constexpr double kMostHeld = 0.25;     // of the samples
constexpr double kLeastOfStep = 0.35;  // below it what is read are the steps
constexpr double kLeastOfMotion = 0.002;
constexpr double kSlowest = 3.0;  // [Hz]: slower angles are no noise
constexpr double kToldApart = 0.25, kMostShare = 1.5;
constexpr int kDraws = 4, kMostNewtonSteps = 8;
constexpr double kSettledShift = 0.002, kMostPerIteration = 0.5;
constexpr double kGrave = 0.05, kNoticeable = 0.02;

VectorXd difference(const VectorXd& x) { return x.tail(x.size() - 1) - x.head(x.size() - 1); }

/// The median of chi-square over its degrees of freedom (Wilson & Hilferty 1931).
double median_of_chi_square(double freedom) { return std::pow(1.0 - 2.0 / (9.0 * freedom), 3); }

/// How many samples of differences of white noise tell what one independent sample would of their
/// variance: 1 + 2 sum of squared autocorrelations.
double repeated(int order) {
  double rho = 1.0, out = 1.0;
  for (int lag = 1; lag <= order; ++lag) {
    rho *= (order - lag + 1.0) / (order + lag);
    out += 2.0 * rho * rho;
  }
  return out;
}

/// Mean square of white noise whose blocks have this median of the mean square of differences.
double typical_square(const std::vector<VectorXd>& parts, Index block, int order) {
  std::vector<double> squares;
  for (const VectorXd& x : parts) {
    for (Index at = 0; at + block <= x.size(); at += block) {
      squares.push_back(x.segment(at, block).squaredNorm() / static_cast<double>(block));
    }
  }
  if (squares.empty()) return 0.0;
  const double freedom = static_cast<double>(block) / repeated(order);
  return median(std::move(squares)) / median_of_chi_square(freedom);
}

struct Level {
  double sd = 0.0;
  bool flat = false;  // white, as far as it can be told
};

bool is_held(const std::vector<VectorXd>& parts) {
  double held = 0.0, all = 0.0;
  for (const VectorXd& x : parts) {
    const VectorXd d = difference(x);
    held += static_cast<double>((d.array() == 0.0).count());
    all += static_cast<double>(d.size());
  }
  return held > kMostHeld * all;
}

Level high_level(std::vector<VectorXd> parts, double step) {
  const auto block = std::max(kLeastBlock, static_cast<Index>(std::lround(0.5 / step)));
  std::erase_if(parts, [](const VectorXd& x) { return x.size() <= kHighestDifference + 1; });
  if (parts.empty()) return {};
  double binomial = 1.0, before = 0.0;
  Level out;
  for (int p = 1; p <= kHighestDifference; ++p) {
    for (VectorXd& x : parts) x = difference(x);
    binomial *= 2.0 * (2.0 * p - 1.0) / p;
    before = out.sd;
    out.sd = std::sqrt(typical_square(parts, block, p) / binomial);
  }
  out.flat = out.sd > kFlat * before;
  return out;
}

/// What is slower than kSlowest, by binomial weights.
VectorXd slow_part(const VectorXd& x, double step) {
  const double half = std::cos(std::min(0.4, kSlowest * step) * std::numbers::pi);
  const int passes =
      std::max(1, static_cast<int>(std::lround(0.5 * std::log(0.5) / std::log(half))));
  VectorXd out = x, next = x;
  const Index N = x.size();
  for (int i = 0; i < passes && N > 2; ++i) {
    next.segment(1, N - 2) =
        0.25 * out.head(N - 2) + 0.5 * out.segment(1, N - 2) + 0.25 * out.tail(N - 2);
    next[0] = 0.5 * (out[0] + out[1]);
    next[N - 1] = 0.5 * (out[N - 1] + out[N - 2]);
    out.swap(next);
  }
  return out;
}

/// What is faster, with little of what is slower: three times what is left of the slow part.
VectorXd fast_part(const VehicleRun& run, const VectorXd& x) {
  VectorXd out = x;
  for (const VehicleRun::Segment& s : run.segments) {
    for (int i = 0; i < 3; ++i) {
      out.segment(s.first, s.rows) -= slow_part(VectorXd(out.segment(s.first, s.rows)), run.step);
    }
  }
  return out;
}

std::vector<VectorXd> parts_of(const VehicleRun& run) {
  std::vector<VectorXd> out;
  for (const VehicleRun::Segment& s : run.segments) {
    out.push_back(run.steering.segment(s.first, s.rows));
  }
  return out;
}

double sd_of_motion(const VehicleRun& run) {
  double sum = 0.0, squares = 0.0, count = 0.0;
  for (const VectorXd& x : parts_of(run)) {
    sum += x.sum();
    squares += x.squaredNorm();
    count += static_cast<double>(x.size());
  }
  return std::sqrt(std::max(0.0, squares / count - std::pow(sum / count, 2)));
}

/// The problem with other angles.
class Steered {
 public:
  Steered(const VehicleProblem& problem, const VectorXd& steering) : run_(*problem.run) {
    run_.steering = steering;
    problem_ = make_vehicle_problem(run_, problem.unknowns, problem.demand);
  }
  Steered(const Steered&) = delete;
  Steered& operator=(const Steered&) = delete;

  bool errors(const VectorXd& z, VectorXd& e, RowMatrix* J) const {
    return output_error(problem_, z, e, J) && e.allFinite();
  }

 private:
  VehicleRun run_;
  VehicleProblem problem_;
};

bool is_of_interest(VehicleParameter p) { return p == kCf || p == kCr || p == kYawInertia; }

class Attenuation {
 public:
  Attenuation(const VehicleProblem& problem, const VehicleOptimum& optimum, const Level& level)
      : problem_(problem), optimum_(optimum), level_(level), root_(problem.residuals()) {
    for (Index n = 0; n < root_.size(); ++n) root_[n] = 1.0 / optimum.sd[problem.output[n]];
    Random random(20240229);
    for (int i = 0; i < kDraws; ++i)
      noise_.push_back(level.sd * random.normal(problem.run->time.size()));
  }

  /// @param known  the level is that of the noise
  SteeringNoise run(bool known) {
    const double share = known ? 1.0 : share_of_noise();
    if (!(share > 0.0)) return {};
    for (VectorXd& noise : noise_) noise *= std::sqrt(share);
    SteeringNoise out;
    out.sd = level_.sd * std::sqrt(share);
    out.of_motion = out.sd / sd_of_motion(*problem_.run);
    out.shift = (optimum_.z - corrected())
                    .head(problem_.parameters())
                    .cwiseProduct(problem_.unknowns.scale);
    return out;
  }

 private:
  VectorXd weighted_errors(const VectorXd& steering) const {
    VectorXd e;
    if (!Steered(problem_, steering).errors(optimum_.z, e, nullptr)) return {};
    return e.cwiseProduct(root_);
  }

  /// How much of the level's variance is noise, as the outputs say: what the simulation does by fast
  /// angles that a driver steered the outputs show, and what it does by noise they do not.
  double share_of_noise() const {
    const VehicleRun& run = *problem_.run;
    const VectorXd& u = run.steering;
    VectorXd e;
    if (!output_error(problem_, optimum_.z, e, nullptr)) return 0.0;
    e = e.cwiseProduct(root_);
    const VectorXd slow = weighted_errors(u - fast_part(run, u));
    const VectorXd all = weighted_errors(u + noise_[0]),
                   fast = weighted_errors(u + fast_part(run, noise_[0]));
    if (slow.size() == 0 || all.size() == 0 || fast.size() == 0) return 0.0;
    const VectorXd by_fast = e - slow;
    const double expected = (all - e).dot(fast - e);
    if (!(expected > 0.0)) return 0.0;
    const double share = e.dot(by_fast) / expected, se = by_fast.norm() / expected;
    if (se < kToldApart) return std::clamp(share, 0.0, kMostShare);
    return level_.flat ? 1.0 : 0.0;
  }

  /// The normal equations at z, and what the draws add to them.
  bool equations(const VectorXd& z, const std::vector<std::unique_ptr<Steered>>& noisy,
                 SegmentedEquations& plain, SegmentedEquations& by_noise) const {
    VectorXd e;
    RowMatrix J;
    if (!output_error(problem_, z, e, &J)) return false;
    add_rows(problem_, J, e, root_, 1.0, plain);
    for (const auto& steered : noisy) {
      VectorXd noisy_e;
      RowMatrix noisy_J;
      if (!steered->errors(z, noisy_e, &noisy_J)) return false;
      add_rows(problem_, noisy_J - J, noisy_e - e, root_, 1.0 / static_cast<double>(noisy.size()),
               by_noise);
    }
    for (Index i = 0; i < problem_.parameters(); ++i) {
      const PriorResidual prior = prior_residual(problem_, z, i);
      plain.gradient[i] += prior.slope * prior.value;
      plain.information(i, i) += prior.slope * prior.slope;
    }
    const ConstraintResiduals held = constraint_rows(problem_, optimum_.multipliers, z);
    const Index k = problem_.parameters();
    plain.gradient.head(k) += held.slopes.transpose() * held.r;
    plain.information.topLeftCorner(k, k) += held.slopes.transpose() * held.slopes;
    return true;
  }

  VectorXd corrected() const {
    std::vector<std::unique_ptr<Steered>> noisy;
    for (const VectorXd& noise : noise_) {
      noisy.push_back(std::make_unique<Steered>(problem_, problem_.run->steering + noise));
    }
    VectorXd z = optimum_.z;
    std::optional<SegmentedEquations> at_optimum;
    for (int iteration = 0; iteration < kMostNewtonSteps; ++iteration) {
      SegmentedEquations plain(problem_), by_noise(problem_);
      if (!equations(z, noisy, plain, by_noise)) break;
      if (!at_optimum) at_optimum = plain;
      const VectorXd step = step_of(corrected_equations(plain, *at_optimum, by_noise), z);
      z += step;
      if (step.head(problem_.parameters()).cwiseAbs().maxCoeff() < kSettledShift) break;
    }
    return z;
  }

  /// Off gradient and curvature of the sum of squares is taken what the noise adds, and off the
  /// gradient what it was at the optimum.
  static SegmentedEquations corrected_equations(SegmentedEquations of,
                                                const SegmentedEquations& at_optimum,
                                                const SegmentedEquations& by_noise) {
    of.information -= by_noise.information;
    of.gradient -= at_optimum.gradient + by_noise.gradient;
    for (std::size_t s = 0; s < of.segments.size(); ++s) {
      SegmentedEquations::Segment& segment = of.segments[s];
      segment.information -= by_noise.segments[s].information;
      segment.cross -= by_noise.segments[s].cross;
      segment.gradient -= at_optimum.segments[s].gradient + by_noise.segments[s].gradient;
    }
    return of;
  }

  VectorXd step_of(const SegmentedEquations& equations, const VectorXd& z) const {
    const EliminatedStates eliminated = eliminate_states(equations);
    std::vector<Index> open;
    for (Index i = 0; i < problem_.parameters(); ++i) {
      if (!is_at_bound(problem_, z, i)) open.push_back(i);
    }
    const VectorXd scale =
        eliminated.information.diagonal().cwiseAbs().cwiseMax(1e-30).cwiseSqrt().cwiseInverse();
    MatrixXd A = (scale.asDiagonal() * eliminated.information * scale.asDiagonal())(open, open);
    A.diagonal().array() += 1e-9;
    const VectorXd b = eliminated.gradient.cwiseProduct(scale)(open);
    const VectorXd x = A.ldlt().solve(b);
    VectorXd shared = VectorXd::Zero(scale.size());
    for (std::size_t k = 0; k < open.size(); ++k) {
      const double most = kMostPerIteration * std::max(std::abs(z[open[k]]), 0.1);
      shared[open[k]] = std::clamp(-scale[open[k]] * x[static_cast<Index>(k)], -most, most);
    }
    VectorXd out(z.size());
    out << shared, eliminated.states + eliminated.by_shared * shared;
    return (z + out).cwiseMax(problem_.lower).cwiseMin(problem_.upper) - z;
  }

  const VehicleProblem& problem_;
  const VehicleOptimum& optimum_;
  Level level_;
  VectorXd root_;  // of the weights
  std::vector<VectorXd> noise_;
};

}  // namespace

double white_noise_sd(const std::vector<VectorXd>& parts, double step) {
  const Level level = high_level(parts, step);
  return level.flat ? level.sd : 0.0;
}

SteeringNoise study_steering_noise(const VehicleProblem& problem, const VehicleOptimum& optimum,
                                   double given) {
  const VehicleRun& run = *problem.run;
  if (given > 0.0) return Attenuation(problem, optimum, {given, true}).run(true);
  const Level level = high_level(parts_of(run), run.step);
  const double quantum = identikal::step_of(run.steering);
  if (!(level.sd > kLeastOfMotion * sd_of_motion(run))) return {};
  if (quantum > 0.0 ? level.sd < kLeastOfStep * quantum : is_held(parts_of(run))) return {};
  return Attenuation(problem, optimum, level).run(false);
}

Findings check_steering_noise(const Model& model, const VehicleSearch& found,
                              const SteeringNoise& noise, bool allowed,
                              const VehicleEstimate& estimate) {
  if (!noise.any()) return {};
  const VehicleUnknowns& unknowns = found.problem.unknowns;
  std::vector<std::string> changes;
  bool grave = false, noticeable = false;
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    if (!is_of_interest(unknowns.free[i])) continue;
    const EstimatedParameter& p = estimate.parameters[unknowns.position[i]];
    const auto n = static_cast<Index>(i);
    const double with = found.best.z[n] * unknowns.scale[n];
    const double by = noise.shift[n] / (with - noise.shift[n]);
    changes.push_back(fmt::format("{} by {:+.1f} %", p.name, 100.0 * by));
    noticeable = noticeable || std::abs(by) > kNoticeable;
    const bool within_error = by * by < std::pow(p.se / p.value, 2) - by * by;
    grave = grave || std::abs(by) > (within_error ? kGrave : kNoticeable);
  }
  if (!noticeable) return {};
  const ChannelSource& channel = model.inputs[0];
  const std::string unit = channel.unit.empty() ? "rad" : channel.unit;
  const std::string shown =
      fmt::format("noise: {:.2g} {}",
                  noise.sd / unit_or_dimensionless(unit).scale / std::abs(channel.scale), unit);
  const std::string what = fmt::format(
      "the steering angle has white noise ({}, {:.1f} % of its motion), which changes {}", shown,
      100.0 * noise.of_motion, fmt::join(changes, ", "));
  if (noise.corrected || allowed) {
    return {{FindingCode::steering_noise,
             Severity::note,
             {"steering"},
             what + (noise.corrected ? "; it is corrected for" : "; the angle is smoothed"),
             ""}};
  }
  Finding finding{FindingCode::steering_noise,
                  grave ? Severity::serious : Severity::warning,
                  {"steering"},
                  what,
                  fmt::format("'{}' beside the column of the steering angle corrects for it; "
                              "better is a quieter sensor, or one at the steering wheel",
                              shown)};
  finding.changes = {{"", fmt::format("inputs: {{{}: {{{}}}}}", channel.name, shown)}};
  return {finding};
}

}  // namespace identikal
