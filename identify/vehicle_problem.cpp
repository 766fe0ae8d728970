#include "identify/vehicle_problem.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "lib/dual.h"
#include "lib/error.h"
#include "lib/nearest_name.h"
#include "solvers/solve.h"

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace identikal {
namespace {

// Bounds of positive parameters that have none in the model file, in units of the typical size.
// What ends here is reported as at its bound: the data want a rigid car.
constexpr double kSmallest = 1e-3, kLargest = 20.0;
constexpr double kShortestRelaxation = 0.05;  // [m]; shorter ones take steps for nothing
constexpr double kLongestDelay = 1.0;         // [s]
constexpr double kLargestAngle = 0.3;         // [rad], of mounting and bank
constexpr double kLeastFiala = 1e-6;          // softening in typical sizes
constexpr double kRobustFrom = 1.5;           // [standard deviations]

bool is_softening(VehicleParameter p) { return p == kSofteningFront || p == kSofteningRear; }

double typical_size(VehicleParameter parameter, const VehicleParameters<double>& p) {
  switch (parameter) {
    case kYawInertia:
      return p[kMass] * p[kA] * p[kB];
    case kCf:
      return 10.0 * axle_loads(p)[0];
    case kCr:
      return 10.0 * axle_loads(p)[1];
    case kSteeringOffset:
    case kMountingAngle:
    case kBiasR:
    case kBank:
      return 0.02;
    case kSteeringDelay:
      return 0.05;
    case kBiasVy:
    case kBiasAy:
      return 0.2;
    case kRelaxationLength:
    case kCgHeight:
      return 0.5;
    case kCurveCurvature:
      return 1.0;
    case kSofteningFront:
      return 1.0 / std::pow(axle_loads(p)[0], 2);
    case kSofteningRear:
      return 1.0 / std::pow(axle_loads(p)[1], 2);
    default:
      return p[parameter] != 0.0 ? std::abs(p[parameter]) : 1.0;
  }
}

/// Calls each(residual index, simulated value) for every sample there is in stretch s.
/// @param gain  K, column by column; empty: simulation
template <typename T, typename Car, typename Each>
void predict(const VehicleProblem& problem, const Car& car, const DrivenStretch& driven,
             std::size_t s, const T& vy, const T& r, const std::vector<T>& gain,
             std::size_t& residual, Each&& each) {
  const VehicleRun& run = *problem.run;
  const Eigen::Index first = run.stretches[s].first;
  T vy_step(0.0), r_step(0.0);
  bool moved = false;
  const auto observe = [&](Eigen::Index k, const Motion<T>& motion, double vx) {
    moved = false;
    for (; residual < problem.row.size() && problem.row[residual] == first + k; ++residual) {
      const auto output = static_cast<std::size_t>(problem.output[residual]);
      const T value = measured(run.outputs[output].sensor, car, motion, vx);
      each(residual, value);
      if (gain.empty()) continue;
      const T e = problem.sample[static_cast<Eigen::Index>(residual)] - value;
      vy_step = moved ? vy_step + gain[2 * output] * e : gain[2 * output] * e;
      r_step = moved ? r_step + gain[2 * output + 1] * e : gain[2 * output + 1] * e;
      moved = true;
    }
  };
  simulate(car, driven, vy, r, observe, [&](Eigen::Index, T& vy_now, T& r_now) {
    if (!moved) return false;
    vy_now += vy_step;
    r_now += r_step;
    return true;
  });
}

// A long recording forgets its initial state: derivatives by it decay below 1e-308, where the
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

bool must_be_positive(VehicleParameter p) {
  return p == kMass || p == kA || p == kB || p == kYawInertia || p == kCf || p == kCr ||
         p == kSteeringRatio || is_softening(p) || p == kCurveShape;
}

UserValue in_user_terms(VehicleParameter parameter, double value) {
  if (!is_softening(parameter)) return {value, 1.0};
  const double force = 1.0 / std::sqrt(value);
  return {force, -0.5 * force / value};
}

double from_user_terms(VehicleParameter parameter, double value) {
  return is_softening(parameter) ? 1.0 / (value * value) : value;
}

Eigen::Index VehicleUnknowns::find(VehicleParameter parameter) const {
  const auto at = std::find(free.begin(), free.end(), parameter);
  return at == free.end() ? -1 : at - free.begin();
}

Eigen::Vector2d axle_loads(const VehicleParameters<double>& p) {
  const double weight = p[kMass] * kStandardGravity / (p[kA] + p[kB]);
  return {weight * p[kB], weight * p[kA]};
}

void set_free(VehicleUnknowns& unknowns, VehicleParameter parameter) {
  const VehicleParameters<double>& p = unknowns.value;
  const double scale = typical_size(parameter, p);
  double lower = -std::numeric_limits<double>::infinity(), upper = -lower;
  if (must_be_positive(parameter)) {
    lower = kSmallest * scale;
    upper = kLargest * scale;
  }
  if (is_softening(parameter)) {
    // Below friction 0.1 nobody drives. Fiala's curve has an infinite slope by the softening at 0.
    lower = unknowns.curve == TyreCurve::fiala ? kLeastFiala * scale : 0.0;
    upper = 100.0 * scale;
  }
  if (parameter == kSteeringDelay) {
    lower = -kLongestDelay;
    upper = kLongestDelay;
  }
  if (parameter == kMountingAngle || parameter == kBank) {
    lower = -kLargestAngle;
    upper = kLargestAngle;
  }
  if (parameter == kRelaxationLength) lower = kShortestRelaxation;
  if (parameter == kCgHeight || parameter == kLoadSensitivity) lower = 0.0;
  if (parameter == kCurveShape) {
    lower = 1.0;
    upper = 2.0;
  }
  if (parameter == kCurveCurvature) upper = 1.0;
  const auto k = static_cast<Eigen::Index>(unknowns.free.size());
  unknowns.free.push_back(parameter);
  unknowns.position.push_back(0);
  unknowns.prior.emplace_back();
  for (const auto& [vector, value] :
       {std::pair{&unknowns.lower, lower}, {&unknowns.upper, upper}, {&unknowns.scale, scale}}) {
    vector->conservativeResize(k + 1);
    (*vector)[k] = value;
  }
}

VehicleUnknowns vehicle_unknowns(const ModelFile& model) {
  const Location at{model.path, 0, 0};
  VehicleUnknowns out;
  out.value = neutral_vehicle();
  out.curve = model.vehicle.curve;
  std::vector<std::string> known;
  for (int i = 0; i < kVehicleParameters; ++i) {
    known.emplace_back(name_of(static_cast<VehicleParameter>(i)));
  }
  std::vector<std::size_t> sought;
  for (std::size_t i = 0; i < model.parameters.size(); ++i) {
    const Parameter& given = model.parameters[i];
    const auto parameter = vehicle_parameter(given.name);
    if (!parameter) {
      throw InputError(at, "parameter '" + given.name + "'", "one of the single-track vehicle's",
                       did_you_mean(given.name, known));
    }
    if (*parameter == kSteeringRatio && model.vehicle.steering_at_road_wheel) {
      if (given.fixed) continue;
      throw InputError(at,
                       "steering_ratio is to be fitted, but the angle is that of the road wheel",
                       "", "fit steering_gain instead");
    }
    if (must_be_positive(*parameter) && !(given.scalar() > 0.0)) {
      throw InputError(at, fmt::format("parameter '{}' is {:g}", given.name, given.scalar()),
                       "a positive number");
    }
    if (*parameter == kRelaxationLength && given.fixed && given.scalar() != 0.0 &&
        given.scalar() < kShortestRelaxation) {
      throw InputError(at, fmt::format("parameter '{}' is {:g} m", given.name, given.scalar()),
                       fmt::format("0 for none, or at least {:g} m", kShortestRelaxation));
    }
    out.value[*parameter] = from_user_terms(*parameter, given.scalar());
    if (!given.fixed) sought.push_back(i);
  }
  for (int i = 0; i < kVehicleParameters; ++i) {
    const auto parameter = static_cast<VehicleParameter>(i);
    if (std::isnan(out.value[parameter])) {
      throw InputError(at, fmt::format("parameter '{}' is missing", name_of(parameter)),
                       "a value or a start for it");
    }
  }
  for (const std::size_t i : sought) {
    const Parameter& given = model.parameters[i];
    const VehicleParameter parameter = *vehicle_parameter(given.name);
    set_free(out, parameter);
    out.position.back() = i;
    out.prior.back() = given.prior;
    double low = given.min, high = given.max;
    if (given.prior.kind == Prior::Kind::uniform || given.prior.kind == Prior::Kind::log_uniform) {
      low = std::max(low, given.prior.a);
      high = std::min(high, given.prior.b);
    }
    const Eigen::Index k = out.scale.size() - 1;
    if (is_softening(parameter)) {
      if (std::isfinite(high)) out.lower[k] = 1.0 / (high * high);
      if (low > 0.0) out.upper[k] = 1.0 / (low * low);
      out.upper[k] = std::max(out.upper[k], out.lower[k]);
    } else {
      out.lower[k] = std::max(out.lower[k], low);
      // What the file allows expressly is allowed.
      if (std::isfinite(high)) out.upper[k] = high;
      const bool bounded_both_ways =
          parameter == kSteeringDelay || parameter == kMountingAngle || parameter == kBank;
      if (bounded_both_ways && std::isfinite(low)) out.lower[k] = low;
    }
    double& start = out.value[parameter];
    start = std::min(std::max(start, out.lower[k]), out.upper[k]);
  }
  return out;
}

IntegrationDemand demand_of(const VehicleUnknowns& unknowns, const VehicleParameters<double>& p) {
  IntegrationDemand out;
  out.decay_rate = decay_rate_times_speed(linear_car(p));
  const Eigen::Index relaxation = unknowns.find(kRelaxationLength);
  out.relaxation_length =
      relaxation < 0 ? p[kRelaxationLength] : std::max(unknowns.lower[relaxation], 1e-3);
  return out;
}

VehicleProblem make_vehicle_problem(const VehicleRun& run, const VehicleUnknowns& unknowns,
                                    const IntegrationDemand& demand) {
  VehicleProblem problem;
  problem.run = &run;
  problem.unknowns = unknowns;
  problem.demand = demand;
  std::vector<double> samples;
  for (const VehicleRun::Stretch& s : run.stretches) {
    problem.driven.push_back(
        drive(run.time.segment(s.first, s.rows), run.steering.segment(s.first, s.rows),
              run.vx.segment(s.first, s.rows), demand, unknowns.value[kSteeringDelay]));
    for (Eigen::Index t = s.first; t < s.first + s.rows; ++t) {
      for (Eigen::Index j = 0; j < run.y.rows(); ++j) {
        if (std::isnan(run.y(j, t))) continue;
        problem.row.push_back(t);
        problem.output.push_back(j);
        samples.push_back(run.y(j, t));
      }
    }
  }
  problem.sample =
      Eigen::Map<const Eigen::VectorXd>(samples.data(), static_cast<Eigen::Index>(samples.size()));
  const Eigen::Index k = problem.parameters();
  const auto states = 2 * static_cast<Eigen::Index>(run.stretches.size());
  problem.lower.resize(k + states);
  problem.upper.resize(k + states);
  problem.lower.head(k) = unknowns.lower.cwiseQuotient(unknowns.scale);
  problem.upper.head(k) = unknowns.upper.cwiseQuotient(unknowns.scale);
  for (std::size_t s = 0; s < run.stretches.size(); ++s) {
    // Beyond 45 degrees of sideslip or 5 rad/s no single-track model holds.
    const Eigen::Index at = problem.state_of(s);
    const double fastest = run.vx[run.stretches[s].first];
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
  const double infinity = std::numeric_limits<double>::infinity();
  out.lower = widened(problem.lower, -infinity);
  out.upper = widened(problem.upper, infinity);
  z = widened(z, 0.0);
  return out;
}

VehicleUnknowns with_curve(VehicleUnknowns unknowns, TyreCurve curve) {
  unknowns.curve = curve;
  for (const VehicleParameter parameter : {kSofteningFront, kSofteningRear}) {
    const Eigen::Index at = unknowns.find(parameter);
    if (at < 0) {
      if (unknowns.value[parameter] == 0.0 && curve != TyreCurve::linear) {
        unknowns.value[parameter] = typical_size(parameter, unknowns.value);
        set_free(unknowns, parameter);
      }
    } else if (curve == TyreCurve::fiala) {
      unknowns.lower[at] = std::max(unknowns.lower[at], kLeastFiala * unknowns.scale[at]);
    }
  }
  return unknowns;
}

VehicleParameters<double> parameters_at(const VehicleProblem& problem, const Eigen::VectorXd& z) {
  VehicleParameters<double> p = problem.unknowns.value;
  for (Eigen::Index i = 0; i < problem.parameters(); ++i) {
    p[problem.unknowns.free[static_cast<std::size_t>(i)]] = z[i] * problem.unknowns.scale[i];
  }
  return p;
}

Eigen::VectorXd coordinates_of(const VehicleProblem& problem, const VehicleParameters<double>& p) {
  const VehicleRun& run = *problem.run;
  Eigen::VectorXd z = Eigen::VectorXd::Zero(problem.coordinates());
  for (Eigen::Index i = 0; i < problem.parameters(); ++i) {
    z[i] = p[problem.unknowns.free[static_cast<std::size_t>(i)]] / problem.unknowns.scale[i];
  }
  const SingleTrack<double> car = linear_car(p);
  const auto first_sample = [&](VehicleQuantity quantity, Eigen::Index row) {
    const Eigen::Index j = run.find(quantity);
    return j < 0 ? kNone : run.y(j, row);
  };
  for (std::size_t s = 0; s < run.stretches.size(); ++s) {
    const Eigen::Index row = run.stretches[s].first;
    Eigen::Vector2d x = steady_state(car, problem.driven[s].nodes.front());
    const double r = first_sample(VehicleQuantity::r, row);
    if (!std::isnan(r)) x[1] = r - p[kBiasR];
    const double vy = first_sample(VehicleQuantity::vy, row);
    const double beta = first_sample(VehicleQuantity::beta, row);
    if (!std::isnan(vy)) {
      const VehicleSensor& sensor =
          run.outputs[static_cast<std::size_t>(run.find(VehicleQuantity::vy))].sensor;
      x[0] = vy - p[kBiasVy] - x[1] * sensor.x;
    } else if (!std::isnan(beta)) {
      const VehicleSensor& sensor =
          run.outputs[static_cast<std::size_t>(run.find(VehicleQuantity::beta))].sensor;
      x[0] = std::tan(beta) * (run.vx[row] - x[1] * sensor.y) - x[1] * sensor.x;
    }
    z.segment<2>(problem.state_of(s)) = x.cwiseQuotient(kStateScale);
  }
  return z.cwiseMax(problem.lower).cwiseMin(problem.upper);
}

std::vector<DrivenStretch> moved_by_delay(const VehicleProblem& problem,
                                          const VehicleParameters<double>& p) {
  if (problem.unknowns.find(kSteeringDelay) < 0) return {};
  std::vector<DrivenStretch> moved = problem.driven;
  const VehicleRun& run = *problem.run;
  for (std::size_t s = 0; s < moved.size(); ++s) {
    const VehicleRun::Stretch& stretch = run.stretches[s];
    set_delay(moved[s], run.time.segment(stretch.first, stretch.rows),
              run.steering.segment(stretch.first, stretch.rows), p[kSteeringDelay]);
  }
  return moved;
}

bool output_error(const VehicleProblem& problem, const Eigen::VectorXd& z, Eigen::VectorXd& e,
                  LeastSquares::RowMatrix* J) {
  const FlushDenormals flush;
  const VehicleParameters<double> p = parameters_at(problem, z);
  const std::vector<DrivenStretch> moved = moved_by_delay(problem, p);
  const std::vector<DrivenStretch>& driven = moved.empty() ? problem.driven : moved;
  const TyreCurve curve = problem.unknowns.curve;
  const Eigen::Index k = problem.parameters();
  e.resize(problem.residuals());
  std::size_t residual = 0;
  const Eigen::Index gains = problem.gains();
  const auto gain_scale = [&](Eigen::Index i) {
    return kStateScale[i % 2] / problem.output_scale[i / 2];
  };
  if (J == nullptr) {
    std::vector<double> gain;
    for (Eigen::Index i = 0; i < gains; ++i) gain.push_back(z[k + i] * gain_scale(i));
    with_car(curve, p, [&](const auto& car) {
      for (std::size_t s = 0; s < problem.driven.size(); ++s) {
        const auto x = z.segment<2>(problem.state_of(s)).cwiseProduct(kStateScale);
        predict<double>(problem, car, driven[s], s, x[0], x[1], gain, residual,
                        [&](std::size_t i, double value) {
                          const auto n = static_cast<Eigen::Index>(i);
                          e[n] = value - problem.sample[n];
                        });
      }
    });
    return e.allFinite();
  }

  J->setZero(problem.residuals(), problem.coordinates());
  const Eigen::Index shared = k + gains;
  with_dual_size(shared + 2, [&](auto size) {
    constexpr int N = decltype(size)::value;
    using T = Dual<N>;
    const auto state = static_cast<std::size_t>(shared);
    std::vector<T> gain;
    for (Eigen::Index i = 0; i < gains; ++i) {
      gain.emplace_back(z[k + i] * gain_scale(i));
      gain.back().v[static_cast<std::size_t>(k + i)] = gain_scale(i);
    }
    VehicleParameters<T> q;
    for (std::size_t i = 0; i < q.size(); ++i) q[i] = T(p[i]);
    for (Eigen::Index i = 0; i < k; ++i) {
      const auto n = static_cast<std::size_t>(i);
      q[problem.unknowns.free[n]].v[n] = problem.unknowns.scale[i];
    }
    with_car(curve, q, [&](const auto& car) {
      for (std::size_t s = 0; s < problem.driven.size(); ++s) {
        const Eigen::Index at = problem.state_of(s);
        T vy(z[at] * kStateScale[0]), r(z[at + 1] * kStateScale[1]);
        vy.v[state] = kStateScale[0];
        r.v[state + 1] = kStateScale[1];
        predict<T>(
            problem, car, driven[s], s, vy, r, gain, residual, [&](std::size_t i, const T& value) {
              const auto n = static_cast<Eigen::Index>(i);
              e[n] = value.a - problem.sample[n];
              const Eigen::Map<const Eigen::RowVectorXd> derivative(value.v.data(), shared + 2);
              J->row(n).head(shared) = derivative.head(shared);
              J->row(n).segment<2>(at) = derivative.tail<2>();
            });
      }
    });
  });
  return e.allFinite() && J->allFinite();
}

NoiseCost noise_cost(bool robust, double r) {
  if (!robust) return {r * r, 1.0, 1.0};
  constexpr double k2 = kRobustFrom * kRobustFrom;
  const double s = r * r, root = std::sqrt(1.0 + s / k2);
  // 2 s / (1 + root) is 2 k^2 (root - 1) without cancellation.
  return {2.0 * s / (1.0 + root), 1.0 / root, 1.0 / (root * root * root)};
}

Eigen::VectorXd rms_per_output(const VehicleProblem& problem, const Eigen::VectorXd& e) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(problem.run->y.rows());
  Eigen::VectorXd count = sum;
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    const double value = e[static_cast<Eigen::Index>(i)];
    sum[problem.output[i]] += value * value;
    count[problem.output[i]] += 1.0;
  }
  return sum.cwiseQuotient(count).cwiseSqrt();
}

namespace {

/// sd^2 = mean of weight(e/sd) e^2, where the likelihood of the scale has its maximum.
Eigen::VectorXd most_likely_scale(const VehicleProblem& problem, const Eigen::VectorXd& e,
                                  Eigen::VectorXd sd) {
  constexpr int kRounds = 200;  // each brings the scale a third nearer at least
  for (int round = 0; round < kRounds; ++round) {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(sd.size()), count = sum;
    for (std::size_t i = 0; i < problem.output.size(); ++i) {
      const double value = e[static_cast<Eigen::Index>(i)], scale = sd[problem.output[i]];
      sum[problem.output[i]] +=
          scale > 0.0 ? noise_cost(true, value / scale).weight * value * value : 0.0;
      count[problem.output[i]] += 1.0;
    }
    const Eigen::VectorXd next = sum.cwiseQuotient(count).cwiseSqrt();
    const double change = (next - sd).cwiseAbs().maxCoeff();
    sd = next;
    if (change <= 1e-10 * sd.maxCoeff()) break;
  }
  return sd;
}

}  // namespace

Eigen::VectorXd noise_sd(const VehicleProblem& problem, const Eigen::VectorXd& e) {
  Eigen::VectorXd sd = rms_per_output(problem, e);
  Eigen::VectorXd largest = Eigen::VectorXd::Zero(sd.size());
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    double& value = largest[problem.output[i]];
    value = std::max(value, std::abs(problem.sample[static_cast<Eigen::Index>(i)]));
  }
  if (problem.robust) sd = most_likely_scale(problem, e, sd);
  for (Eigen::Index j = 0; j < sd.size(); ++j) {
    const double given = problem.run->outputs[static_cast<std::size_t>(j)].given_sd;
    sd[j] = std::isnan(given) ? std::max(sd[j], 1e-7 * largest[j]) : given;
  }
  return sd;
}

double log_likelihood(const VehicleProblem& problem, const Eigen::VectorXd& z,
                      const Eigen::VectorXd& e, const Eigen::VectorXd& sd) {
  constexpr double k2 = kRobustFrom * kRobustFrom;
  const double norm = problem.robust
                          ? std::log(2.0 * kRobustFrom) + k2 + std::log(std::cyl_bessel_k(1.0, k2))
                          : 0.5 * std::log(2.0 * std::numbers::pi);
  double sum = 0.0;
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    const double scale = sd[problem.output[i]];
    const double r = e[static_cast<Eigen::Index>(i)] / scale;
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

VehicleOptimum maximise_likelihood(const VehicleProblem& problem, const Eigen::VectorXd& start,
                                   const SolverOptions& options) {
  constexpr int kMostRounds = 50;
  constexpr double kNearlySettled = 1e-3, kSettled = 1e-5;  // relative change of every noise sd
  VehicleOptimum out;
  out.z = start;
  Eigen::VectorXd e;
  if (!output_error(problem, start, e, nullptr)) {
    out.message = "the car runs away at the start";
    return out;
  }
  out.sd = noise_sd(problem, e);
  // While the weights still move there is no point in an exact minimum.
  SolverOptions coarse = options;
  coarse.function_tolerance = std::max(options.function_tolerance, 1e-5);
  bool exact = false;
  for (int round = 0; round < kMostRounds; ++round) {
    Eigen::VectorXd weight(problem.residuals());
    for (std::size_t i = 0; i < problem.output.size(); ++i) {
      weight[static_cast<Eigen::Index>(i)] = 1.0 / out.sd[problem.output[i]];
    }
    const Eigen::Index m = problem.residuals(), k = problem.parameters();
    LeastSquares weighted;
    weighted.residuals = m + k;
    weighted.lower = problem.lower;
    weighted.upper = problem.upper;
    weighted.evaluate = [&](const Eigen::VectorXd& z, Eigen::VectorXd& r,
                            LeastSquares::RowMatrix* J) {
      Eigen::VectorXd errors;
      LeastSquares::RowMatrix slopes;
      if (!output_error(problem, z, errors, J == nullptr ? nullptr : &slopes)) return false;
      errors.array() *= weight.array();
      Eigen::VectorXd factor = weight;
      if (problem.robust) {
        // Least squares in sign(r) sqrt(rho) is the minimum of rho.
        for (Eigen::Index i = 0; i < m; ++i) {
          const NoiseCost cost = noise_cost(true, errors[i]);
          const double share = errors[i] == 0.0 ? 1.0 : std::sqrt(cost.rho) / std::abs(errors[i]);
          errors[i] *= share;
          factor[i] *= cost.weight / share;
        }
      }
      r.head(m) = errors;
      if (J != nullptr) {
        J->topRows(m) = factor.asDiagonal() * slopes;
        J->bottomRows(k).setZero();
      }
      for (Eigen::Index i = 0; i < k; ++i) {
        const PriorResidual prior = prior_residual(problem, z, i);
        r[m + i] = prior.value;
        if (J != nullptr) (*J)(m + i, i) = prior.slope;
      }
      return true;
    };
    SolverOptions left = exact ? options : coarse;
    left.max_iterations = options.max_iterations - out.iterations;
    const Solution solution = solve(weighted, out.z, left);
    out.z = solution.x;
    out.iterations += solution.summary.iterations;
    out.evaluations += solution.summary.evaluations;
    out.message = solution.summary.message;
    if (!output_error(problem, out.z, e, nullptr)) return out;
    const Eigen::VectorXd sd = noise_sd(problem, e);
    const double change = (sd.cwiseQuotient(out.sd).array() - 1.0).abs().maxCoeff();
    out.sd = sd;
    const bool solved = solution.summary.termination == Termination::converged;
    out.converged = solved && exact && change < kSettled;
    if (!solved || out.converged) break;
    if (out.iterations >= options.max_iterations) {
      out.message = fmt::format("not settled after {} iterations", out.iterations);
      break;
    }
    exact = exact || change < kNearlySettled;
  }
  out.log_likelihood = log_likelihood(problem, out.z, e, out.sd);
  return out;
}

}  // namespace identikal
