#include "identify/vehicle/internal/structure_study.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "identify/vehicle/internal/possible_mistakes.h"
#include "identify/vehicle/internal/robust_noise.h"
#include "identify/vehicle/internal/secondary_simulation.h"

namespace identikal {
namespace {

constexpr int kMostIterations = 20;
constexpr int kReweighted = 4;        // iterations; then the weights stay, so that it converges
constexpr double kSettled = 0.03;     // of a standard deviation
constexpr double kNearEnough = 0.3;   // where derivatives by differences lead no further
constexpr double kLeastShare = 0.01;  // of a step
constexpr double kStateStep = 1e-4;   // for differences, over kStateScale
constexpr double kUncorrelated = 0.05;
constexpr double kFreedom = 3.0;  // of a prior with heavy tails
// A share of the yaw inertia over rad/(m/s^2): 0.75 % by a roll of 1 deg/g.
constexpr double kInertiaPerRoll = 4.2;
constexpr double kGross = 0.5;  // of the standard deviation of mistakes
constexpr double kWeighedAgain =
    1.0;  // standard errors: a smaller mistake leaves the noise as it is

/// The search. Differences make the derivatives: every column is a simulation.
class StructureSearch {
 public:
  StructureSearch(const VehicleProblem& problem, const VehicleOptimum& optimum)
      : problem_(problem),
        multipliers_(optimum.multipliers),
        simulation_(problem, problem.unknowns.value[kSteeringDelay]) {
    at_.p = parameters_at(problem, optimum.z);
    at_.states = optimum.z.tail(2 * static_cast<Eigen::Index>(problem.run->segments.size()));
    unknowns_ = study_unknowns(problem, at_.p);
    at_.effects[kTyreRelaxation] = at_.p[kRelaxationLength];
    wide_angle_ = wide_angle(problem, at_.p);
    for (const StudyUnknown& u : unknowns_) {
      if (u.kind == StudyUnknown::Kind::effect && u.sd < kInfinity) entry(at_, u) = u.mean;
    }
  }

  StructureStudy run() {
    StructureStudy out;
    Eigen::VectorXd e = simulation_.errors(at_);
    if (!e.allFinite()) return out;
    for (int iteration = 0; iteration < kMostIterations && !out.converged; ++iteration) {
      if (iteration < kReweighted) {
        weigh(e);
        weigh_priors();
      }
      differentiate(e);
      const double wanted = move(e);
      out.converged = wanted < (stalled_ ? kNearEnough : kSettled);
      if (stalled_) break;
    }
    weigh(e);
    weigh_priors();
    differentiate(e);
    eliminate_states(e);
    report(out);
    suspect(e, out);
    out.errors = std::move(e);
    return out;
  }

 private:
  Eigen::Index count() const { return static_cast<Eigen::Index>(unknowns_.size()); }

  /// Weights of the samples: noise of their output, its autocorrelation, and, with robust noise,
  /// how much of an outlier they are.
  void weigh(const Eigen::VectorXd& e) {
    const Eigen::VectorXd sd = noise_sd(problem_, e);
    Eigen::VectorXd factor(sd.size());
    for (Eigen::Index j = 0; j < sd.size(); ++j) factor[j] = correlated_samples(e, j);
    weight_.resize(e.size());
    for (Eigen::Index n = 0; n < e.size(); ++n) {
      const Eigen::Index j = problem_.output[n];
      const double outlier = noise_cost(problem_.robust, e[n] / sd[j]).weight;
      weight_[n] = (problem_.robust ? outlier : 1.0) / (sd[j] * sd[j] * factor[j]);
    }
  }

  /// Priors with heavy tails are normal ones with the same slope from here.
  void weigh_priors() {
    prior_sd_.resize(count());
    for (Eigen::Index i = 0; i < count(); ++i) {
      const StudyUnknown& u = unknowns_[i];
      const double z = (entry(at_, u) - u.mean) / u.sd;
      const double wider = std::sqrt((kFreedom + z * z) / (kFreedom + 1.0));
      prior_sd_[i] = u.heavy_tails ? wider * u.sd : u.sd;
    }
  }

  /// How many samples of the output tell what one independent sample would.
  double correlated_samples(const Eigen::VectorXd& e, Eigen::Index output) const {
    std::vector<double> of;
    for (Eigen::Index n = 0; n < e.size(); ++n) {
      if (problem_.output[n] == output) of.push_back(e[n]);
    }
    const Eigen::Map<const Eigen::VectorXd> x(of.data(), static_cast<Eigen::Index>(of.size()));
    const double power = x.squaredNorm();
    double factor = 1.0;
    for (Eigen::Index lag = 1; lag < x.size() / 4; ++lag) {
      const double rho = x.head(x.size() - lag).dot(x.tail(x.size() - lag)) / power;
      if (rho < kUncorrelated) break;
      factor += 2.0 * rho;
    }
    return factor;
  }

  double cost(const StudyPoint& point, const Eigen::VectorXd& e) const {
    double sum = weight_.dot(e.cwiseAbs2());
    for (Eigen::Index i = 0; i < count(); ++i) {
      sum += std::pow((entry(point, unknowns_[i]) - unknowns_[i].mean) / prior_sd_[i], 2);
    }
    const Eigen::VectorXd z = coordinates(point);
    for (Eigen::Index i = 0; i < problem_.parameters(); ++i) {
      sum += std::pow(prior_residual(problem_, z, i).value, 2);
    }
    sum += constraint_rows(problem_, multipliers_, z).r.squaredNorm();
    return sum;
  }

  /// Of the problem's free parameters, which come first among the unknowns.
  Eigen::VectorXd coordinates(const StudyPoint& point) const {
    Eigen::VectorXd z(problem_.parameters());
    for (Eigen::Index i = 0; i < z.size(); ++i) {
      z[i] = entry(point, unknowns_[i]) / problem_.unknowns.scale[i];
    }
    return z;
  }

  void differentiate(const Eigen::VectorXd& e) {
    by_unknown_.resize(e.size(), count());
    // Sensors first, which take the motion that was simulated last.
    for (const bool of_sensor : {true, false}) {
      for (Eigen::Index i = 0; i < count(); ++i) {
        if (is_of_sensor(unknowns_[i]) == of_sensor) differentiate(e, i);
      }
    }
    by_state_.resize(e.size(), 2);
    for (Eigen::Index i = 0; i < 2; ++i) {
      StudyPoint other = at_;
      for (Eigen::Index s = i; s < other.states.size(); s += 2) other.states[s] += kStateStep;
      by_state_.col(i) = (simulation_.errors(other) - e) / kStateStep;
    }
  }

  void differentiate(const Eigen::VectorXd& e, Eigen::Index i) {
    const StudyUnknown& u = unknowns_[i];
    StudyPoint other = at_;
    double& x = entry(other, u);
    const double by = x + u.step > u.upper ? -u.step : u.step;
    x += by;
    by_unknown_.col(i) = (simulation_.errors(other) - e) / by;
  }

  /// Of a segment, what its initial state takes part in.
  struct StateBlock {
    using Cross = Eigen::Matrix<double, 2, Eigen::Dynamic>;
    Eigen::Matrix2d inverse;
    Cross cross;
    Eigen::Vector2d gradient;
  };

  /// Of the errors, linear about here, with respect to the unknowns and what follows them, the states
  /// eliminated, priors included.
  struct NormalEquations {
    Eigen::MatrixXd precision;
    Eigen::VectorXd gradient;
    std::vector<StateBlock> blocks;  // of the segments
  };

  /// @param by  derivatives of the errors: of the unknowns, then of others
  NormalEquations normal_equations(const Eigen::MatrixXd& by, const Eigen::VectorXd& e) const {
    constexpr Eigen::Index kBlock = 256;  // rows that stay in the processor's cache
    const Eigen::Index columns = by.cols();
    NormalEquations out{
        Eigen::MatrixXd::Zero(columns, columns), Eigen::VectorXd::Zero(columns), {}};
    Eigen::MatrixXd A;
    Eigen::Index at = 0;
    for (const VehicleRun::Segment& segment : problem_.run->segments) {
      // A state that nothing shows stays.
      Eigen::Matrix2d S = 1e-6 * Eigen::Matrix2d::Identity();
      StateBlock block{{}, StateBlock::Cross::Zero(2, columns), Eigen::Vector2d::Zero()};
      for (const Eigen::Index end = end_of(segment, at); at < end;) {
        const Eigen::Index rows = std::min(kBlock, end - at);
        const Eigen::VectorXd root = weight_.segment(at, rows).cwiseSqrt();
        const Eigen::MatrixX2d B = root.asDiagonal() * by_state_.middleRows(at, rows);
        const Eigen::VectorXd c = root.cwiseProduct(e.segment(at, rows));
        A = root.asDiagonal() * by.middleRows(at, rows);
        S.noalias() += B.transpose() * B;
        block.cross.noalias() += B.transpose() * A;
        block.gradient.noalias() += B.transpose() * c;
        out.precision.selfadjointView<Eigen::Lower>().rankUpdate(A.transpose());
        out.gradient.noalias() += A.transpose() * c;
        at += rows;
      }
      block.inverse = S.inverse();
      out.precision -= block.cross.transpose() * block.inverse * block.cross;
      out.gradient -= block.cross.transpose() * block.inverse * block.gradient;
      out.blocks.push_back(block);
    }
    out.precision.triangularView<Eigen::StrictlyUpper>() = out.precision.transpose();
    add_priors(out);
    return out;
  }

  /// Behind the last residual of a segment.
  Eigen::Index end_of(const VehicleRun::Segment& segment, Eigen::Index from) const {
    const auto behind = std::lower_bound(problem_.row.begin() + from, problem_.row.end(),
                                         segment.first + segment.rows);
    return behind - problem_.row.begin();
  }

  /// Fills precision, gradient and covariance of the unknowns, the states eliminated.
  void eliminate_states(const Eigen::VectorXd& e) {
    NormalEquations equations = normal_equations(by_unknown_, e);
    precision_ = std::move(equations.precision);
    gradient_ = std::move(equations.gradient);
    blocks_ = std::move(equations.blocks);
    // What no sample and no prior says anything of has no precision.
    scale_ = precision_.diagonal().cwiseMax(1e-30).cwiseSqrt().cwiseInverse();
    precision_ = scale_.asDiagonal() * precision_ * scale_.asDiagonal();
    precision_.diagonal().array() += 1e-9;
    covariance_ = scale_.asDiagonal() * precision_.inverse() * scale_.asDiagonal();
  }

  void add_priors(NormalEquations& to) const {
    const Eigen::VectorXd z = coordinates(at_);
    for (Eigen::Index i = 0; i < count(); ++i) {
      const StudyUnknown& u = unknowns_[i];
      const double precision = 1.0 / (prior_sd_[i] * prior_sd_[i]);
      to.precision(i, i) += precision;
      to.gradient[i] += (entry(at_, u) - u.mean) * precision;
      if (i >= z.size()) continue;
      const PriorResidual prior = prior_residual(problem_, z, i);
      const double slope = prior.slope / problem_.unknowns.scale[i];
      to.precision(i, i) += slope * slope;
      to.gradient[i] += slope * prior.value;
    }
    const ConstraintResiduals held = constraint_rows(problem_, multipliers_, z);
    const Eigen::MatrixXd slopes =
        held.slopes * problem_.unknowns.scale.cwiseInverse().asDiagonal();
    to.gradient.head(z.size()) += slopes.transpose() * held.r;
    to.precision.topLeftCorner(z.size(), z.size()) += slopes.transpose() * slopes;
  }

  /// A Gauss-Newton step within the bounds: what would leave them goes to the bound and stays.
  Eigen::VectorXd bounded_step() const {
    Eigen::VectorXd step = Eigen::VectorXd::Zero(count());
    std::vector<Eigen::Index> open(count());
    for (Eigen::Index i = 0; i < count(); ++i) open[i] = i;
    for (bool again = true; again && !open.empty();) {
      again = false;
      const Eigen::VectorXd held = precision_ * step.cwiseQuotient(scale_);
      const Eigen::VectorXd rhs = -gradient_.cwiseProduct(scale_) - held;
      const Eigen::VectorXd x = precision_(open, open).ldlt().solve(Eigen::VectorXd(rhs(open)));
      std::vector<Eigen::Index> within;
      for (std::size_t n = 0; n < open.size(); ++n) {
        const StudyUnknown& u = unknowns_[open[n]];
        const double by = scale_[open[n]] * x[static_cast<Eigen::Index>(n)];
        const double to = std::clamp(entry(at_, u) + by, u.lower, u.upper);
        if (to == entry(at_, u) + by) {
          within.push_back(open[n]);
        } else {
          step[open[n]] = to - entry(at_, u);
          again = true;
        }
      }
      if (!again) {
        for (std::size_t n = 0; n < open.size(); ++n) {
          step[open[n]] = scale_[open[n]] * x[static_cast<Eigen::Index>(n)];
        }
      }
      open = within;
    }
    return step;
  }

  /// Moves to a point that is no worse, if there is one along the step, else it has stalled.
  /// @return by how many standard deviations it moved, or wanted to
  double move(Eigen::VectorXd& e) {
    eliminate_states(e);
    const Eigen::VectorXd step = bounded_step();
    Eigen::VectorXd states(at_.states.size());
    for (std::size_t s = 0; s < blocks_.size(); ++s) {
      states.segment<2>(2 * static_cast<Eigen::Index>(s)) =
          -blocks_[s].inverse * (blocks_[s].gradient + blocks_[s].cross * step);
    }
    const double before = cost(at_, e);
    for (double share = 1.0; share > kLeastShare; share *= 0.4) {
      StudyPoint next = at_;
      for (Eigen::Index i = 0; i < count(); ++i) entry(next, unknowns_[i]) += share * step[i];
      next.states += share * states;
      Eigen::VectorXd there = simulation_.errors(next);
      if (!there.allFinite() || cost(next, there) > before * (1.0 + 1e-12)) continue;
      at_ = next;
      e = std::move(there);
      return share * step.cwiseQuotient(covariance_.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff();
    }
    stalled_ = true;
    return step.cwiseQuotient(covariance_.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff();
  }

  /// What the recording says of a mistake, linear about here, and by how much it moves the unknowns.
  struct Suspicion {
    double size, variance;  ///< without a prior
    Eigen::VectorXd moved;  ///< unknowns by size
    Eigen::VectorXd step;   ///< of the unknowns and of it, others zero, to the optimum
  };

  /// The noise is that which would be left with the mistake: one that is there colours the errors.
  Suspicion suspicion(const Suspicion& before, const Eigen::MatrixXd& by, Eigen::Index mistake,
                      const std::vector<StateBlock>& blocks, const Eigen::VectorXd& e) {
    Eigen::MatrixXd of(e.size(), count() + 1);
    of << by_unknown_, by.col(mistake);
    weigh(linear_errors(by, blocks, before.step, e));
    return with_one_more(normal_equations(of, e), count());
  }

  Suspicion with_one_more(const NormalEquations& equations, Eigen::Index last) const {
    std::vector<Eigen::Index> open;
    for (Eigen::Index i = 0; i < count(); ++i) {
      const double at = entry(at_, unknowns_[i]);
      if (at > unknowns_[i].lower && at < unknowns_[i].upper) open.push_back(i);
    }
    const Eigen::VectorXd scale =
        equations.precision.diagonal().cwiseMax(1e-30).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = scale.asDiagonal() * equations.precision * scale.asDiagonal();
    Eigen::MatrixXd of_open = scaled(open, open);
    of_open.diagonal().array() += 1e-9;
    const Eigen::LDLT<Eigen::MatrixXd> solver(of_open);
    const Eigen::VectorXd gradient = equations.gradient.cwiseProduct(scale);
    const Eigen::VectorXd cross = scaled.col(last)(open);
    const Eigen::VectorXd moved = -solver.solve(cross),
                          at_once = -solver.solve(Eigen::VectorXd(gradient(open)));
    const double precision = std::max(1e-12, 1.0 + cross.dot(moved));
    const double size = -(gradient[last] + cross.dot(at_once)) / precision;
    Suspicion out{size * scale[last], scale[last] * scale[last] / precision,
                  Eigen::VectorXd::Zero(count()), Eigen::VectorXd::Zero(scale.size())};
    for (std::size_t k = 0; k < open.size(); ++k) {
      const auto n = static_cast<Eigen::Index>(k);
      out.moved[open[k]] = scale[open[k]] * moved[n] / scale[last];
      out.step[open[k]] = scale[open[k]] * (at_once[n] + size * moved[n]);
    }
    out.step[last] = out.size;
    return out;
  }

  Eigen::VectorXd linear_errors(const Eigen::MatrixXd& by, const std::vector<StateBlock>& blocks,
                                const Eigen::VectorXd& step, const Eigen::VectorXd& e) const {
    Eigen::VectorXd out = e + by * step;
    Eigen::Index to = 0;
    for (std::size_t s = 0; s < blocks.size(); ++s) {
      const VehicleRun::Segment& segment = problem_.run->segments[s];
      const Eigen::Index from = to;
      to = end_of(segment, from);
      const Eigen::Vector2d state =
          -blocks[s].inverse * (blocks[s].gradient + blocks[s].cross * step);
      out.segment(from, to - from) += by_state_.middleRows(from, to - from) * state;
    }
    return out;
  }

  /// Of every mistake: how probable it is beside that nobody made any. The covariance grows by the
  /// second moments of what it would change, as far as the recording makes it more probable.
  void suspect(const Eigen::VectorXd& e, StructureStudy& out) {
    const std::vector<PossibleMistake> mistakes =
        possible_mistakes(problem_, simulation_, at_, unknowns_, e, by_unknown_);
    Eigen::MatrixXd by(e.size(), count() + static_cast<Eigen::Index>(mistakes.size()));
    by.leftCols(count()) = by_unknown_;
    for (Eigen::Index i = count(); i < by.cols(); ++i) by.col(i) = mistakes[i - count()].by;
    const NormalEquations first = normal_equations(by, e);
    const Eigen::VectorXd weight = weight_;
    std::vector<Eigen::VectorXd> moved;
    double all = 1.0, all_before = 1.0;
    for (const PossibleMistake& mistake : mistakes) {
      const Eigen::Index at = count() + static_cast<Eigen::Index>(moved.size());
      Suspicion said = with_one_more(first, at);
      if (std::abs(said.size) > kWeighedAgain * std::sqrt(said.variance)) {
        said = suspicion(said, by, at, first.blocks, e);
        weight_ = weight;
      }
      const auto density = [&](double mean, double sd) {
        const double variance = said.variance + sd * sd;
        return std::exp(-0.5 * std::pow(said.size - mean, 2) / variance) / std::sqrt(variance);
      };
      const double none = std::max(1e-300, density(0.0, mistake.usual));
      double any = density(mistake.mean, mistake.sd);
      if (mistake.positive) any *= said.size > 0.0 ? 2.0 : 0.0;
      SuspectedMistake found{.name = mistake.name,
                             .unit = mistake.unit,
                             .size = said.size,
                             .sd = std::sqrt(said.variance),
                             .gross = kGross * std::max(mistake.sd, std::abs(mistake.mean)),
                             .evidence = any / none,
                             .probability = mistake.odds * any / none,
                             .may_be_a_car = mistake.may_be_a_car,
                             .code = mistake.code,
                             .separated_by = mistake.separated_by};
      all += found.probability;
      all_before += mistake.odds;
      const double variance = mistake.sd * mistake.sd;
      const double shrunk = 1.0 / (1.0 / said.variance + 1.0 / variance);
      const double mean = shrunk * (said.size / said.variance + mistake.mean / variance);
      moved.push_back(std::sqrt(mean * mean + shrunk) * said.moved.head(problem_.parameters()));
      out.mistakes.push_back(std::move(found));
    }
    for (std::size_t i = 0; i < moved.size(); ++i) {
      const double after = out.mistakes[i].probability /= all,
                   before = mistakes[i].odds / all_before;
      out.covariance += std::max(0.0, after - before) * moved[i] * moved[i].transpose();
    }
  }

  /// The yaw inertia of a body that rolls, which is not all that the effects have of it.
  void allow_for_rolling(StructureStudy& out) const {
    const int at = problem_.unknowns.find(kYawInertia);
    if (at < 0) return;
    const double roll = std::max(at_.effects[kRollGradient], at_.p[kRollPerAcceleration]);
    out.covariance(at, at) += std::pow(kInertiaPerRoll * roll * out.value[at], 2);
  }

  void report(StructureStudy& out) const {
    const Eigen::Index free = problem_.parameters(), causes = count() - free;
    out.value = coordinates(at_).cwiseProduct(problem_.unknowns.scale);
    out.covariance = covariance_.topLeftCorner(free, free);
    out.wide_angle = wide_angle_;
    allow_for_rolling(out);
    const Eigen::VectorXd sd = covariance_.diagonal().cwiseSqrt();
    out.with_causes = sd.head(free).cwiseInverse().asDiagonal() *
                      covariance_.topRightCorner(free, causes) *
                      sd.tail(causes).cwiseInverse().asDiagonal();
    for (Eigen::Index i = free; i < count(); ++i) {
      const StudyUnknown& u = unknowns_[i];
      const bool effect = u.kind == StudyUnknown::Kind::effect;
      out.causes.push_back({.name = name_of(u),
                            .unit = u.unit,
                            .as_written = effect ? 0.0 : u.mean,
                            .prior_mean = u.mean,
                            .prior_sd = u.sd,
                            .value = entry(at_, u),
                            .sd = sd[i],
                            .separated_by = u.separated_by,
                            .heavy_tails = u.heavy_tails});
    }
  }

  const VehicleProblem& problem_;
  const Multipliers multipliers_;
  SecondarySimulation simulation_;
  std::vector<StudyUnknown> unknowns_;
  StudyPoint at_;
  std::optional<double> wide_angle_;
  Eigen::VectorXd weight_, prior_sd_;
  Eigen::MatrixXd by_unknown_;
  Eigen::MatrixX2d by_state_;
  std::vector<StateBlock> blocks_;
  Eigen::MatrixXd precision_, covariance_;  // the former over scale_ on both sides
  Eigen::VectorXd gradient_, scale_;
  bool stalled_ = false;
};

}  // namespace

StructureStudy study_structure(const VehicleProblem& problem, const VehicleOptimum& optimum) {
  return StructureSearch(problem, optimum).run();
}

}  // namespace identikal
