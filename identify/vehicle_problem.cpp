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

double typical_size(VehicleParameter parameter, const VehicleParameters<double>& p) {
  switch (parameter) {
    case kYawInertia:
      return p[kMass] * p[kA] * p[kB];
    case kCf:
      return 10.0 * axle_loads(p)[0];
    case kCr:
      return 10.0 * axle_loads(p)[1];
    case kSteeringOffset:
    case kBiasR:
    case kBank:
      return 0.02;
    case kBiasVy:
    case kBiasAy:
      return 0.2;
    case kSofteningFront:
      return 1.0 / std::pow(axle_loads(p)[0], 2);
    case kSofteningRear:
      return 1.0 / std::pow(axle_loads(p)[1], 2);
    default:
      return p[parameter] != 0.0 ? std::abs(p[parameter]) : 1.0;
  }
}

/// The axles are chosen by type, so that linear cars do not pay for a saturating tyre.
template <typename T, typename Visit>
void with_car(const VehicleProblem& problem, const VehicleParameters<T>& p, Visit&& visit) {
  if (problem.softening) {
    visit(softening_car(p));
  } else {
    visit(linear_car(p));
  }
}

/// Calls each(residual index, simulated value) for every sample there is in stretch s.
template <typename T, typename Car, typename Each>
void predict(const VehicleProblem& problem, const Car& car, std::size_t s, const T& vy, const T& r,
             std::size_t& residual, Each&& each) {
  const VehicleRun& run = *problem.run;
  const Eigen::Index first = run.stretches[s].first;
  simulate(car, problem.driven[s], vy, r, [&](Eigen::Index k, const Motion<T>& motion, double vx) {
    for (; residual < problem.row.size() && problem.row[residual] == first + k; ++residual) {
      const auto output = static_cast<std::size_t>(problem.output[residual]);
      each(residual, measured(run.outputs[output].sensor, car, motion, vx));
    }
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
         p == kSteeringRatio;
}

Eigen::Vector2d axle_loads(const VehicleParameters<double>& p) {
  const double weight = p[kMass] * kStandardGravity / (p[kA] + p[kB]);
  return {weight * p[kB], weight * p[kA]};
}

VehicleUnknowns vehicle_unknowns(const ModelFile& model) {
  const Location at{model.path, 0, 0};
  VehicleUnknowns out;
  out.value = neutral_vehicle();
  std::vector<std::string> known;
  for (int i = 0; i < kSofteningFront; ++i) {
    known.emplace_back(name_of(static_cast<VehicleParameter>(i)));
  }
  for (std::size_t i = 0; i < model.parameters.size(); ++i) {
    const Parameter& given = model.parameters[i];
    const auto parameter = vehicle_parameter(given.name);
    if (!parameter || *parameter >= kSofteningFront) {
      throw InputError(at, "parameter '" + given.name + "'", "one of the single-track vehicle's",
                       did_you_mean(given.name, known));
    }
    if (*parameter == kSteeringRatio && model.vehicle.steering_at_road_wheel) {
      if (given.fixed) continue;
      throw InputError(at,
                       "steering_ratio is to be fitted, but the angle is that of the road wheel",
                       "", "fit steering_gain instead");
    }
    out.value[*parameter] = given.scalar();
    if (given.fixed) continue;
    out.free.push_back(*parameter);
    out.position.push_back(i);
  }
  for (int i = 0; i < kSofteningFront; ++i) {
    const auto parameter = static_cast<VehicleParameter>(i);
    const std::string name(name_of(parameter));
    if (std::isnan(out.value[parameter])) {
      throw InputError(at, "parameter '" + name + "' is missing", "a value or a start for it");
    }
    if (must_be_positive(parameter) && !(out.value[parameter] > 0.0)) {
      throw InputError(at, fmt::format("parameter '{}' is {:g}", name, out.value[parameter]),
                       "a positive number");
    }
  }
  const auto k = static_cast<Eigen::Index>(out.free.size());
  out.lower.resize(k);
  out.upper.resize(k);
  out.scale.resize(k);
  for (Eigen::Index i = 0; i < k; ++i) {
    const auto n = static_cast<std::size_t>(i);
    const Parameter& given = model.parameters[out.position[n]];
    out.scale[i] = typical_size(out.free[n], out.value);
    out.lower[i] = given.min;
    out.upper[i] = given.max;
    if (must_be_positive(out.free[n])) {
      out.lower[i] = std::max(given.min, kSmallest * out.scale[i]);
      if (std::isinf(given.max)) out.upper[i] = kLargest * out.scale[i];
    }
  }
  return out;
}

VehicleProblem make_vehicle_problem(const VehicleRun& run, const VehicleUnknowns& unknowns,
                                    bool softening, double decay_rate) {
  VehicleProblem problem;
  problem.run = &run;
  problem.unknowns = unknowns;
  problem.softening = softening;
  problem.decay_rate = decay_rate;
  std::vector<double> samples;
  for (const VehicleRun::Stretch& s : run.stretches) {
    problem.driven.push_back(drive(run.time.segment(s.first, s.rows),
                                   run.steering.segment(s.first, s.rows),
                                   run.vx.segment(s.first, s.rows), decay_rate));
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
    const Eigen::Index at = k + 2 * static_cast<Eigen::Index>(s);
    const double fastest = run.vx[run.stretches[s].first];
    problem.upper.segment<2>(at) = Eigen::Vector2d(fastest, 5.0).cwiseQuotient(kStateScale);
    problem.lower.segment<2>(at) = -problem.upper.segment<2>(at);
  }
  return problem;
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
  Eigen::VectorXd z(problem.coordinates());
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
    z.segment<2>(problem.parameters() + 2 * static_cast<Eigen::Index>(s)) =
        x.cwiseQuotient(kStateScale);
  }
  return z.cwiseMax(problem.lower).cwiseMin(problem.upper);
}

bool output_error(const VehicleProblem& problem, const Eigen::VectorXd& z, Eigen::VectorXd& e,
                  LeastSquares::RowMatrix* J) {
  const FlushDenormals flush;
  const VehicleParameters<double> p = parameters_at(problem, z);
  const Eigen::Index k = problem.parameters();
  e.resize(problem.residuals());
  std::size_t residual = 0;
  if (J == nullptr) {
    with_car(problem, p, [&](const auto& car) {
      for (std::size_t s = 0; s < problem.driven.size(); ++s) {
        const auto x = z.segment<2>(k + 2 * static_cast<Eigen::Index>(s)).cwiseProduct(kStateScale);
        predict<double>(problem, car, s, x[0], x[1], residual, [&](std::size_t i, double value) {
          const auto n = static_cast<Eigen::Index>(i);
          e[n] = value - problem.sample[n];
        });
      }
    });
    return e.allFinite();
  }

  J->setZero(problem.residuals(), problem.coordinates());
  with_dual_size(k + 2, [&](auto size) {
    constexpr int N = decltype(size)::value;
    using T = Dual<N>;
    const auto state = static_cast<std::size_t>(k);
    VehicleParameters<T> q;
    for (std::size_t i = 0; i < q.size(); ++i) q[i] = T(p[i]);
    for (Eigen::Index i = 0; i < k; ++i) {
      const auto n = static_cast<std::size_t>(i);
      q[problem.unknowns.free[n]].v[n] = problem.unknowns.scale[i];
    }
    with_car(problem, q, [&](const auto& car) {
      for (std::size_t s = 0; s < problem.driven.size(); ++s) {
        const Eigen::Index at = k + 2 * static_cast<Eigen::Index>(s);
        T vy(z[at] * kStateScale[0]), r(z[at + 1] * kStateScale[1]);
        vy.v[state] = kStateScale[0];
        r.v[state + 1] = kStateScale[1];
        predict<T>(problem, car, s, vy, r, residual, [&](std::size_t i, const T& value) {
          const auto n = static_cast<Eigen::Index>(i);
          e[n] = value.a - problem.sample[n];
          const Eigen::Map<const Eigen::RowVectorXd> derivative(value.v.data(), k + 2);
          J->row(n).head(k) = derivative.head(k);
          J->row(n).segment<2>(at) = derivative.tail<2>();
        });
      }
    });
  });
  return e.allFinite() && J->allFinite();
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

Eigen::VectorXd noise_sd(const VehicleProblem& problem, const Eigen::VectorXd& e) {
  Eigen::VectorXd sd = rms_per_output(problem, e);
  Eigen::VectorXd largest = Eigen::VectorXd::Zero(sd.size());
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    double& value = largest[problem.output[i]];
    value = std::max(value, std::abs(problem.sample[static_cast<Eigen::Index>(i)]));
  }
  for (Eigen::Index j = 0; j < sd.size(); ++j) {
    const double given = problem.run->outputs[static_cast<std::size_t>(j)].given_sd;
    sd[j] = std::isnan(given) ? std::max(sd[j], 1e-7 * largest[j]) : given;
  }
  return sd;
}

double log_likelihood(const VehicleProblem& problem, const Eigen::VectorXd& e,
                      const Eigen::VectorXd& sd) {
  const Eigen::VectorXd rms = rms_per_output(problem, e);
  double sum = 0.0;
  for (Eigen::Index j = 0; j < sd.size(); ++j) {
    const auto n = static_cast<double>(problem.run->outputs[static_cast<std::size_t>(j)].samples);
    const double ratio = rms[j] / sd[j];
    sum -= 0.5 * n * (std::log(2.0 * std::numbers::pi * sd[j] * sd[j]) + ratio * ratio);
  }
  return sum;
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
    LeastSquares weighted;
    weighted.residuals = problem.residuals();
    weighted.lower = problem.lower;
    weighted.upper = problem.upper;
    weighted.evaluate = [&](const Eigen::VectorXd& z, Eigen::VectorXd& r,
                            LeastSquares::RowMatrix* J) {
      if (!output_error(problem, z, r, J)) return false;
      r.array() *= weight.array();
      if (J != nullptr) J->array().colwise() *= weight.array();
      return true;
    };
    const Solution solution = solve(weighted, out.z, exact ? options : coarse);
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
    exact = exact || change < kNearlySettled;
  }
  out.log_likelihood = log_likelihood(problem, e, out.sd);
  return out;
}

}  // namespace identikal
