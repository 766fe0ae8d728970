#include "identify/vehicle/output_error.h"

#include <algorithm>
#include <cmath>

#include "identify/vehicle/internal/late_outputs.h"
#include "identify/vehicle/internal/profiled_states.h"
#include "identify/vehicle/internal/robust_noise.h"
#include "lib/base/constants.h"
#include "solvers/scoring.h"

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace identikal {
namespace {

// A long recording forgets its initial state: derivatives with respect to it decay below 1e-308, where the
// processor is a hundred times slower. In this scope they become zero.
class FlushDenormals {
 public:
#if defined(__SSE2__)
  FlushDenormals() : before_(_mm_getcsr()) { _mm_setcsr(before_ | 0x8040u); }
  ~FlushDenormals() { _mm_setcsr(before_); }

 private:
  unsigned before_;

 public:
#else
  FlushDenormals() = default;
#endif
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;
};

}  // namespace

std::vector<VehicleReading> readings(const VehicleRun& run, const SingleTrack<>& car) {
  std::vector<VehicleReading> out;
  for (const VehicleRun::Output& output : run.outputs) out.emplace_back(output.sensor, car);
  return out;
}

namespace {

constexpr double kFarthestReach = 0.1;  // [s], of a delay that is free

/// How far from the ends of a segment an output shows what was outside of it.
struct Reach {
  double begin = 0.0, end = 0.0;  // [s]
};

Reach reach_of(const VehicleUnknowns& unknowns, VehicleQuantity quantity) {
  const VehicleParameter delay = sensor_parameter(quantity, SensorProperty::delay);
  const Eigen::Index free = unknowns.find(delay);
  const double known = unknowns.value[delay];
  if (free < 0) return {std::max(0.0, known), std::max(0.0, -known)};
  return {std::clamp(unknowns.upper[free], 0.0, kFarthestReach),
          std::clamp(-unknowns.lower[free], 0.0, kFarthestReach)};
}

}  // namespace

bool has_late_sensor(const VehicleRun& run, const VehicleUnknowns& unknowns) {
  return std::any_of(run.outputs.begin(), run.outputs.end(), [&](const VehicleRun::Output& output) {
    const auto is_late = [&](SensorProperty property) {
      const VehicleParameter p = sensor_parameter(output.sensor.quantity, property);
      return unknowns.find(p) >= 0 || unknowns.value[p] != 0.0;
    };
    return is_late(SensorProperty::delay) || is_late(SensorProperty::lag);
  });
}

VehicleProblem make_vehicle_problem(const VehicleRun& run, const VehicleUnknowns& unknowns,
                                    const IntegrationDemand& demand) {
  VehicleProblem problem;
  problem.run = &run;
  problem.unknowns = unknowns;
  problem.demand = demand;
  problem.late_sensors = has_late_sensor(run, unknowns);
  std::vector<Reach> reach;
  for (const VehicleRun::Output& output : run.outputs) {
    reach.push_back(reach_of(unknowns, output.sensor.quantity));
  }
  std::vector<double> samples;
  for (const VehicleRun::Segment& s : run.segments) {
    problem.driven.push_back(drive(run.time.segment(s.first, s.rows),
                                   run.steering.segment(s.first, s.rows),
                                   run.vx.segment(s.first, s.rows), demand,
                                   unknowns.value[kSteeringDelay], unknowns.value[kLagOfSteering]));
    if (run.roll.size() > 0) {
      set_roll(problem.driven.back(), run.time.segment(s.first, s.rows),
               run.roll.segment(s.first, s.rows));
    }
    const double begin = run.time[s.first] - 1e-9, end = run.time[s.first + s.rows - 1] + 1e-9;
    for (Eigen::Index t = s.first; t < s.first + s.rows; ++t) {
      for (Eigen::Index j = 0; j < run.y.rows(); ++j) {
        if (std::isnan(run.y(j, t))) continue;
        if (run.time[t] < begin + reach[j].begin || run.time[t] > end - reach[j].end) continue;
        problem.row.push_back(t);
        problem.output.push_back(j);
        samples.push_back(run.y(j, t));
      }
    }
  }
  problem.sample =
      Eigen::Map<const Eigen::VectorXd>(samples.data(), static_cast<Eigen::Index>(samples.size()));
  const Eigen::Index k = problem.parameters();
  const auto states = 2 * static_cast<Eigen::Index>(run.segments.size());
  problem.lower.resize(k + states);
  problem.upper.resize(k + states);
  problem.lower.head(k) = unknowns.lower.cwiseQuotient(unknowns.scale);
  problem.upper.head(k) = unknowns.upper.cwiseQuotient(unknowns.scale);
  for (std::size_t s = 0; s < run.segments.size(); ++s) {
    // Beyond 45 degrees of sideslip or 5 rad/s no single-track model holds.
    const Eigen::Index at = problem.state_of(s);
    const double fastest = run.vx[run.segments[s].first];
    problem.upper.segment<2>(at) = Eigen::Vector2d(fastest, 5.0).cwiseQuotient(kStateScale);
    problem.lower.segment<2>(at) = -problem.upper.segment<2>(at);
  }
  return problem;
}

VehicleProblem predicting(const VehicleProblem& problem, const Eigen::VectorXd& sd,
                          Eigen::VectorXd& z) {
  VehicleProblem out = problem;
  out.prediction = true;
  out.output_scale = sd;
  const Eigen::Index k = problem.parameters(), gains = out.gains();
  const auto widened = [&](const Eigen::VectorXd& of, double gain) {
    Eigen::VectorXd wide(of.size() + gains);
    wide << of.head(k), Eigen::VectorXd::Constant(gains, gain), of.tail(of.size() - k);
    return wide;
  };
  out.lower = widened(problem.lower, -kInfinity);
  out.upper = widened(problem.upper, kInfinity);
  z = widened(z, 0.0);
  return out;
}

bool is_at_bound(const VehicleProblem& problem, const Eigen::VectorXd& z, Eigen::Index parameter) {
  const double at = z[parameter], near = 1e-8 * std::max(1.0, std::abs(at));
  return at - problem.lower[parameter] <= near || problem.upper[parameter] - at <= near;
}

VehicleParameters<double> parameters_at(const VehicleProblem& problem, const Eigen::VectorXd& z) {
  VehicleParameters<double> p = problem.unknowns.value;
  for (Eigen::Index i = 0; i < problem.parameters(); ++i) {
    p[problem.unknowns.free[i]] = z[i] * problem.unknowns.scale[i];
  }
  return p;
}

Eigen::VectorXd coordinates_of(const VehicleProblem& problem, const VehicleParameters<double>& p) {
  const VehicleRun& run = *problem.run;
  Eigen::VectorXd z = Eigen::VectorXd::Zero(problem.coordinates());
  for (Eigen::Index i = 0; i < problem.parameters(); ++i) {
    z[i] = p[problem.unknowns.free[i]] / problem.unknowns.scale[i];
  }
  const SingleTrack<> car = linear_car(p);
  const std::vector<VehicleReading> sensors = readings(run, car);
  const auto first_sample = [&](VehicleQuantity quantity, Eigen::Index row) {
    const Eigen::Index j = run.find(quantity);
    return j < 0 ? kNone : run.y(j, row);
  };
  for (std::size_t s = 0; s < run.segments.size(); ++s) {
    const Eigen::Index row = run.segments[s].first;
    Eigen::Vector2d x = steady_state(car, problem.driven[s].nodes.front());
    const double r = first_sample(VehicleQuantity::r, row);
    if (!std::isnan(r)) x[1] = r - p[kBiasR];
    const double vy = first_sample(VehicleQuantity::vy, row);
    const double beta = first_sample(VehicleQuantity::beta, row);
    const bool has_vy = !std::isnan(vy);
    if (has_vy || !std::isnan(beta)) {
      const Eigen::Index j = run.find(has_vy ? VehicleQuantity::vy : VehicleQuantity::beta);
      x[0] = sensors[j].lateral_velocity(has_vy ? vy : beta, run.vx[row], x[1]);
    }
    z.segment<2>(problem.state_of(s)) = x.cwiseQuotient(kStateScale);
  }
  return z.cwiseMax(problem.lower).cwiseMin(problem.upper);
}

std::vector<DrivenSegment> moved_by_delay(const VehicleProblem& problem,
                                          const VehicleParameters<double>& p) {
  if (problem.unknowns.find(kSteeringDelay) < 0 && problem.unknowns.find(kLagOfSteering) < 0) {
    return {};
  }
  std::vector<DrivenSegment> moved = problem.driven;
  const VehicleRun& run = *problem.run;
  for (std::size_t s = 0; s < moved.size(); ++s) {
    const VehicleRun::Segment& segment = run.segments[s];
    set_delay(moved[s], run.time.segment(segment.first, segment.rows),
              run.steering.segment(segment.first, segment.rows), p[kSteeringDelay],
              p[kLagOfSteering]);
  }
  return moved;
}

namespace {

/// Output error of one segment: what its simulation, or prediction, gives less the samples.
class SegmentErrors {
 public:
  SegmentErrors(const VehicleProblem& problem, const SingleTrack<>& car, const Eigen::VectorXd& z,
                std::size_t s, std::size_t& residual, Eigen::VectorXd& e)
      : problem_(problem),
        car_(car),
        readings_(readings(*problem.run, car)),
        first_(problem.run->segments[s].first),
        x_(z.segment<2>(problem.state_of(s)).cwiseProduct(kStateScale)),
        residual_(residual),
        e_(e) {
    for (Eigen::Index i = 0; i < problem.gains(); ++i) {
      gain_.push_back(z[problem.parameters() + i] * gain_scale(i));
    }
  }

  void run(const DrivenSegment& driven) {
    const auto observe = [&](Eigen::Index k, const Motion& motion, double vx) {
      step_.setZero();
      moved_ = false;
      for_each_sample(k, motion, vx, [](std::size_t, std::size_t) {});
    };
    simulate(car_, driven, x_[0], x_[1], observe, [&](Eigen::Index, double& vy, double& r) {
      vy += step_[0];
      r += step_[1];
      return moved_;
    });
  }

  void run(const DrivenSegment& driven, LeastSquares::RowMatrix& J) {
    const Eigen::Index k = problem_.parameters(), gains = problem_.gains(), shared = k + gains;
    JacobianColumns columns;
    columns.columns = shared + 2;
    Eigen::RowVectorXd scale(columns.columns), slope(columns.columns);
    for (Eigen::Index i = 0; i < k; ++i) {
      columns.parameter[problem_.unknowns.free[i]] = i;
    }
    columns.vy = shared;
    columns.r = shared + 1;
    scale << problem_.unknowns.scale.transpose(), Eigen::RowVectorXd::Ones(gains),
        kStateScale.transpose();
    Eigen::Matrix<double, 2, Eigen::Dynamic> step_jacobian(2, columns.columns);
    const auto observe = [&](Eigen::Index row, const Motion& motion, const MotionJacobian& jacobian,
                             double vx) {
      step_.setZero();
      moved_ = false;
      step_jacobian.setZero();
      for_each_sample(row, motion, vx, [&](std::size_t residual, std::size_t output) {
        readings_[output].jacobian(motion, vx, columns, jacobian, slope);
        const auto n = static_cast<Eigen::Index>(residual);
        J.row(n).head(shared) = slope.head(shared).cwiseProduct(scale.head(shared));
        J.row(n).tail<2>() = slope.tail<2>().cwiseProduct(scale.tail<2>());
        if (gain_.empty()) return;
        for (Eigen::Index i = 0; i < 2; ++i) {
          const Eigen::Index at = 2 * static_cast<Eigen::Index>(output) + i;
          step_jacobian.row(i) -= gain_[at] * slope;
          step_jacobian(i, k + at) -= gain_scale(at) * e_[n];
        }
      });
    };
    simulate_with_jacobian(car_, driven, x_[0], x_[1], columns, observe,
                           [&](Eigen::Index, double& vy, double& r, MotionJacobian& jacobian) {
                             if (!moved_) return false;
                             vy += step_[0];
                             r += step_[1];
                             jacobian.vy += step_jacobian.row(0);
                             jacobian.r += step_jacobian.row(1);
                             return true;
                           });
  }

 private:
  double gain_scale(Eigen::Index i) const {
    return kStateScale[i % 2] / problem_.output_scale[i / 2];
  }

  /// Writes the errors of row k of the segment and the correction of the state that follows from
  /// them, and calls also(residual, output).
  template <typename Also>
  void for_each_sample(Eigen::Index k, const Motion& motion, double vx, Also&& also) {
    for (; residual_ < problem_.row.size() && problem_.row[residual_] == first_ + k; ++residual_) {
      const auto output = static_cast<std::size_t>(problem_.output[residual_]);
      const auto n = static_cast<Eigen::Index>(residual_);
      e_[n] = readings_[output].value(motion, vx) - problem_.sample[n];
      if (!gain_.empty()) {
        step_ -= Eigen::Map<const Eigen::Vector2d>(gain_.data() + 2 * output) * e_[n];
        moved_ = true;
      }
      also(residual_, output);
    }
  }

  const VehicleProblem& problem_;
  const SingleTrack<>& car_;
  std::vector<VehicleReading> readings_;
  Eigen::Index first_;
  Eigen::Vector2d x_;
  std::size_t& residual_;
  Eigen::VectorXd& e_;
  std::vector<double> gain_;  // K, column by column; empty: simulation
  Eigen::Vector2d step_ = Eigen::Vector2d::Zero();
  bool moved_ = false;
};

}  // namespace

bool output_error(const VehicleProblem& problem, const Eigen::VectorXd& z, Eigen::VectorXd& e,
                  LeastSquares::RowMatrix* J) {
  const FlushDenormals flush;
  const VehicleParameters<double> p = parameters_at(problem, z);
  const std::vector<DrivenSegment> moved = moved_by_delay(problem, p);
  const std::vector<DrivenSegment>& driven = moved.empty() ? problem.driven : moved;
  const SingleTrack<> car = car_with(problem.unknowns.curve, p);
  e.resize(problem.residuals());
  if (J != nullptr) {
    J->resize(problem.residuals(), problem.parameters() + problem.gains() + 2);
  }
  std::size_t residual = 0;
  for (std::size_t s = 0; s < driven.size(); ++s) {
    if (problem.late_sensors) {
      late_segment_errors(problem, car, driven[s], z, s, residual, e, J);
      continue;
    }
    SegmentErrors errors(problem, car, z, s, residual, e);
    if (J == nullptr) {
      errors.run(driven[s]);
    } else {
      errors.run(driven[s], *J);
    }
  }
  return e.allFinite();
}

namespace {

std::vector<Eigen::VectorXd> errors_per_output(const VehicleProblem& problem,
                                               const Eigen::VectorXd& e) {
  std::vector<std::vector<double>> all(problem.run->outputs.size());
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    all[problem.output[i]].push_back(e[i]);
  }
  std::vector<Eigen::VectorXd> out;
  for (const std::vector<double>& each : all) {
    out.emplace_back(
        Eigen::Map<const Eigen::VectorXd>(each.data(), static_cast<Eigen::Index>(each.size())));
  }
  return out;
}

}  // namespace

Eigen::VectorXd rms_per_output(const VehicleProblem& problem, const Eigen::VectorXd& e) {
  const std::vector<Eigen::VectorXd> errors = errors_per_output(problem, e);
  Eigen::VectorXd out(static_cast<Eigen::Index>(errors.size()));
  for (std::size_t j = 0; j < errors.size(); ++j) {
    const Eigen::VectorXd weight = error_weights(problem.robust, errors[j]);
    out[j] = std::sqrt(weight.dot(errors[j].cwiseAbs2()) / weight.sum());
  }
  return out;
}

Eigen::VectorXd noise_sd(const VehicleProblem& problem, const Eigen::VectorXd& e) {
  const Eigen::Index outputs = problem.run->y.rows();
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(outputs), count = squares, largest = squares;
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    const Eigen::Index j = problem.output[i], n = static_cast<Eigen::Index>(i);
    squares[j] += e[n] * e[n];
    count[j] += 1.0;
    largest[j] = std::max(largest[j], std::abs(problem.sample[n]));
  }
  Eigen::VectorXd sd = squares.cwiseQuotient(count).cwiseSqrt();
  if (problem.robust) {
    const std::vector<Eigen::VectorXd> errors = errors_per_output(problem, e);
    for (std::size_t j = 0; j < errors.size(); ++j) {
      sd[j] = most_likely_scale(errors[j]);
    }
  }
  for (Eigen::Index j = 0; j < outputs; ++j) {
    const double given = problem.run->outputs[j].given_sd;
    sd[j] = std::isnan(given) ? std::max(sd[j], 1e-7 * largest[j]) : given;
  }
  return sd;
}

double log_likelihood(const VehicleProblem& problem, const Eigen::VectorXd& z,
                      const Eigen::VectorXd& e, const Eigen::VectorXd& sd) {
  const double norm = log_norm_of_noise(problem.robust);
  double sum = 0.0;
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    const double scale = sd[problem.output[i]];
    const double r = e[i] / scale;
    sum -= norm + std::log(scale) + 0.5 * noise_cost(problem.robust, r).rho;
  }
  for (Eigen::Index i = 0; i < problem.parameters(); ++i) {
    sum -= 0.5 * std::pow(prior_residual(problem, z, i).value, 2);
  }
  return sum;
}

PriorResidual prior_residual(const VehicleProblem& problem, const Eigen::VectorXd& z,
                             Eigen::Index i) {
  const auto n = static_cast<std::size_t>(i);
  const Prior& prior = problem.unknowns.prior[n];
  const double scale = problem.unknowns.scale[i];
  const UserValue user = in_user_terms(problem.unknowns.free[n], z[i] * scale);
  if (prior.kind == Prior::Kind::normal) {
    return {(user.value - prior.a) / prior.b, user.slope * scale / prior.b};
  }
  if (prior.kind == Prior::Kind::log_normal) {
    const double spread = std::log(prior.b);
    return {std::log(user.value / prior.a) / spread, user.slope * scale / (user.value * spread)};
  }
  return {};
}

namespace {

// Of the user's values p there, with slopes by these and by the k coordinates of the free ones.
struct ConstraintsThere {
  Eigen::VectorXd p;
  ConstraintValues by_values;
  Eigen::MatrixXd slopes;  // a row each, k
};

ConstraintsThere constraints_at(const VehicleProblem& problem, const Eigen::VectorXd& z) {
  const VehicleUnknowns& unknowns = problem.unknowns;
  const Eigen::Index k = problem.parameters();
  ConstraintsThere out;
  out.p = unknowns.stated;
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(k);
  for (Eigen::Index i = 0; i < k; ++i) {
    const UserValue user = in_user_terms(unknowns.free[i], z[i] * unknowns.scale[i]);
    if (!unknowns.is_stated[i]) continue;
    out.p[static_cast<Eigen::Index>(unknowns.position[i])] = user.value;
    slope[i] = user.slope * unknowns.scale[i];
  }
  out.by_values = constraint_values(unknowns.constraints, out.p);
  out.slopes = Eigen::MatrixXd::Zero(out.by_values.g.size(), k);
  for (Eigen::Index i = 0; i < k; ++i) {
    if (!unknowns.is_stated[i]) continue;
    out.slopes.col(i) =
        slope[i] * out.by_values.slopes.col(static_cast<Eigen::Index>(unknowns.position[i]));
  }
  return out;
}

// The likelihood in the parameters and gains, with initial states and noise at their best for them.
class ProfiledLikelihood {
 public:
  ProfiledLikelihood(const VehicleProblem& problem, const Eigen::VectorXd& start)
      : problem_(problem), profile_(problem, start) {}

  // Of the data and the priors; information is kept.
  bool of_data(const Eigen::VectorXd& z, double& L, Eigen::VectorXd* gradient) {
    // The noise is at its most likely size for every z, so that its derivative does not matter.
    return profile_.evaluate(z, L, gradient != nullptr ? *gradient : unused_, information_);
  }
  // At the end of a search, of the data and the priors.
  bool settle(const Eigen::VectorXd& z, double& L) {
    return profile_.settle(z, L, unused_, information_);
  }
  bool evaluate(const Eigen::VectorXd& z, double& L, Eigen::VectorXd* gradient,
                Eigen::MatrixXd* information) {
    if (!of_data(z, L, gradient)) return false;
    if (information != nullptr) *information = information_;
    if (multipliers.w.size() == 0) return true;
    const ConstraintResiduals rows = constraint_rows(problem_, multipliers, z);
    const Eigen::Index k = problem_.parameters();
    L += rows.constant - 0.5 * rows.r.squaredNorm();
    if (gradient != nullptr) gradient->head(k) -= rows.slopes.transpose() * rows.r;
    if (information != nullptr) {
      information->topLeftCorner(k, k) += rows.slopes.transpose() * rows.slopes;
    }
    return true;
  }
  // Weighs the constraints by what the data say at z. @return does one not hold there?
  bool tighten(const Eigen::VectorXd& z) {
    double L = 0.0;
    if (!of_data(z, L, nullptr)) return false;
    const ConstraintsThere at = constraints_at(problem_, z);
    const Eigen::Index k = problem_.parameters();
    const Eigen::MatrixXd information = information_.topLeftCorner(k, k);
    const Eigen::VectorXd tolerances =
        constraint_tolerances(at.by_values, at.p, at.slopes, information);
    const bool first = multipliers.w.size() == 0;
    const bool open = !first && update_multipliers(problem_.unknowns.constraints, at.by_values.g,
                                                   tolerances, multipliers);
    multipliers.weigh(at.slopes, information);
    return first || open;
  }
  const ProfiledStates& profile() const { return profile_; }

  Multipliers multipliers;

 private:
  const VehicleProblem& problem_;
  ProfiledStates profile_;
  Eigen::VectorXd unused_;
  Eigen::MatrixXd information_;
};

constexpr int kMostTightenings = 20;

Solution add_counts(Solution to, const Solution& before) {
  to.summary.iterations += before.summary.iterations;
  to.summary.evaluations += before.summary.evaluations;
  return to;
}

// Searches, and where constraints ask for it again with other multipliers.
Solution search_constrained(ProfiledLikelihood& likelihood, const LikelihoodProblem& problem,
                            const Eigen::VectorXd& start, const SolverOptions& options,
                            const Constraints& constraints) {
  if (constraints.empty()) return maximise(problem, start, options);
  likelihood.tighten(start);
  Solution out = maximise(problem, start, options);
  for (int i = 0; out.summary.termination == Termination::converged; ++i) {
    if (!likelihood.tighten(out.x)) return out;
    if (i == kMostTightenings) {
      out.summary.termination = Termination::no_progress;
      out.summary.message = "the constraints do not hold where the search has ended";
      break;
    }
    out = add_counts(maximise(problem, out.x, options), out);
  }
  return out;
}

}  // namespace

ConstraintResiduals constraint_rows(const VehicleProblem& problem, const Multipliers& multipliers,
                                    const Eigen::VectorXd& z) {
  if (multipliers.w.size() == 0) return {{}, Eigen::MatrixXd(0, problem.parameters()), 0.0};
  const ConstraintsThere at = constraints_at(problem, z);
  return constraint_residuals(problem.unknowns.constraints, multipliers,
                              {at.by_values.g, at.slopes});
}

VehicleOptimum maximise_likelihood(const VehicleProblem& problem, const Eigen::VectorXd& start,
                                   const SolverOptions& options) {
  const Eigen::Index shared = problem.parameters() + problem.gains();
  ProfiledLikelihood profiled(problem, start);
  LikelihoodProblem likelihood;
  likelihood.lower = problem.lower.head(shared);
  likelihood.upper = problem.upper.head(shared);
  likelihood.evaluate = [&](const Eigen::VectorXd& z, double& L, Eigen::VectorXd* gradient,
                            Eigen::MatrixXd* information) {
    return profiled.evaluate(z, L, gradient, information);
  };
  VehicleOptimum out;
  SolverOptions watched = options;
  watched.progress = [&](int iteration, double L) {
    out.path.push_back(L);
    return !options.progress || options.progress(iteration, L);
  };
  const Solution solution = search_constrained(profiled, likelihood, start.head(shared), watched,
                                               problem.unknowns.constraints);
  out.z = start;
  out.iterations = solution.summary.iterations;
  out.evaluations = solution.summary.evaluations;
  out.message = solution.summary.message;
  out.converged = solution.summary.termination == Termination::converged;
  if (solution.summary.termination == Termination::start_undefined) {
    out.message = "the simulation diverges at the start";
    return out;
  }
  Eigen::VectorXd e;
  output_error(problem, start, e, nullptr);
  out.path.insert(out.path.begin(), log_likelihood(problem, start, e, noise_sd(problem, e)));
  profiled.settle(solution.x, out.log_likelihood);
  out.z = profiled.profile().coordinates();
  out.sd = noise_sd(problem, profiled.profile().errors());
  out.multipliers = profiled.multipliers;
  return out;
}

}  // namespace identikal
