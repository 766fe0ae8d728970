#include "identify/vehicle/internal/state_path.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/QR>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Row = Eigen::Map<const Eigen::RowVectorXd>;
using ToRow = Eigen::Map<Eigen::RowVectorXd>;
using ToPair = Eigen::Map<Eigen::RowVector2d>;

}  // namespace

StatePath::StatePath(const VehicleProblem& problem)
    : problem_(problem), outputs_(problem.run->y.rows()), parameters_(problem.parameters()) {
  const auto add_group = [this](std::vector<Eigen::Index> blocks, Eigen::Index residuals) {
    const Eigen::Index columns = parameters_ + 2 * static_cast<Eigen::Index>(blocks.size());
    if (parameters_ > 0) blocks.insert(blocks.begin(), 0);
    sparse_.groups.push_back({std::move(blocks), residuals});
    end_.residual += residuals;
    end_.derivative += static_cast<std::size_t>(residuals * columns);
  };
  if (parameters_ > 0) sparse_.block_sizes.push_back(parameters_);
  for (std::size_t s = 0; s < problem.driven.size(); ++s) {
    const Eigen::Index rows = problem.driven[s].rows(), first = problem.run->segments[s].first;
    std::vector<Place>& places = places_.emplace_back();
    for (Eigen::Index t = 0; t < rows; ++t) {
      const auto block = static_cast<Eigen::Index>(sparse_.block_sizes.size());
      sparse_.block_sizes.push_back(2);
      Place at = end_;
      at.has_transition = t > 0;
      if (t > 0) add_group({block - 1, block}, 2);
      for (; end_.sample < problem.row.size() && problem.row[end_.sample] == first + t;
           ++end_.sample) {
        add_group({block}, 1);
        ++at.samples;
      }
      places.push_back(at);
    }
  }
  for (Eigen::Index i = 0; i < parameters_; ++i) {
    if (has_prior(i)) sparse_.groups.push_back({{0}, 1});
  }
  const auto states =
      2 * static_cast<Eigen::Index>(sparse_.block_sizes.size()) - (parameters_ > 0 ? 2 : 0);
  sparse_.lower = Eigen::VectorXd::Constant(parameters_ + states, -kInfinity);
  sparse_.upper = Eigen::VectorXd::Constant(parameters_ + states, kInfinity);
  sparse_.lower.head(parameters_) = problem.lower.head(parameters_);
  sparse_.upper.head(parameters_) = problem.upper.head(parameters_);
  sparse_.evaluate = [this](const Eigen::VectorXd& x, Eigen::VectorXd& r, std::vector<double>* J) {
    return evaluate(x, r, J);
  };
}

bool StatePath::has_prior(Eigen::Index i) const {
  const Prior::Kind kind = problem_.unknowns.prior[i].kind;
  return kind == Prior::Kind::normal || kind == Prior::Kind::log_normal;
}

Eigen::VectorXd StatePath::begin(const Eigen::VectorXd& z) const {
  Eigen::VectorXd x(sparse_.lower.size());
  x.head(parameters_) = z.head(parameters_);
  Eigen::Index at = parameters_;
  replay(problem_, z, [&](Eigen::Index, const Motion& motion, double) {
    x[at++] = motion.vy / kStateScale[0];
    x[at++] = motion.r / kStateScale[1];
  });
  return x;
}

Eigen::VectorXd StatePath::coordinates(const Eigen::VectorXd& x) const {
  Eigen::VectorXd z(problem_.coordinates());
  z.head(parameters_) = x.head(parameters_);
  Eigen::Index at = parameters_;
  for (std::size_t s = 0; s < problem_.driven.size(); ++s) {
    z.segment<2>(problem_.state_of(s)) = x.segment<2>(at);
    at += 2 * problem_.driven[s].rows();
  }
  return z.cwiseMax(problem_.lower).cwiseMin(problem_.upper);
}

std::vector<Eigen::Matrix2Xd> StatePath::states(const Eigen::VectorXd& x) const {
  std::vector<Eigen::Matrix2Xd> out;
  Eigen::Index at = parameters_;
  for (const DrivenSegment& segment : problem_.driven) {
    const Eigen::Index rows = segment.rows();
    out.push_back(kStateScale.asDiagonal() *
                  Eigen::Map<const Eigen::Matrix2Xd>(x.data() + at, 2, rows));
    at += 2 * rows;
  }
  return out;
}

/// Residuals, and their derivatives where requested, at one point.
struct StatePath::Evaluation {
  Evaluation(const StatePath& of, const SingleTrack<>& car, Eigen::VectorXd& residuals,
             std::vector<double>* derivatives)
      : path(of),
        problem(of.problem_),
        n(of.parameters_),
        r(residuals),
        J(derivatives),
        sensors(readings(*of.problem_.run, car)),
        scale(n + 2),
        slope(derivatives != nullptr ? n + 2 : 0) {
    scale << problem.unknowns.scale.transpose(), kStateScale.transpose();
    if (J == nullptr) return;
    columns.columns = n + 2;
    for (Eigen::Index i = 0; i < n; ++i) columns.parameter[problem.unknowns.free[i]] = i;
    columns.vy = n;
    columns.r = n + 1;
  }

  /// The state less what the interval before makes of the state before.
  void transition(const Place& at, const Eigen::Vector2d& state, double dt, const Motion& motion,
                  const MotionJacobian& jacobian) {
    const Eigen::Vector2d weight = (path.noise_.tail<2>() * std::sqrt(dt)).cwiseInverse();
    r.segment<2>(at.residual) = (state - Eigen::Vector2d(motion.vy, motion.r)).cwiseProduct(weight);
    if (J == nullptr) return;
    double* to = J->data() + at.derivative;
    const Eigen::RowVectorXd* rows[] = {&jacobian.vy, &jacobian.r};
    for (Eigen::Index i = 0; i < 2; ++i) {
      const Eigen::RowVectorXd by = -weight[i] * rows[i]->cwiseProduct(scale);
      ToRow(to + i * n, n) = by.head(n);
      ToPair(to + 2 * n + 2 * i) = by.tail<2>();
      ToPair(to + 2 * n + 4 + 2 * i) = weight[i] * kStateScale[i] * Eigen::RowVector2d::Unit(i);
    }
  }

  void samples(const Place& at, const Motion& motion, const MotionJacobian& jacobian, double vx) {
    Eigen::Index residual = at.residual + (at.has_transition ? 2 : 0);
    std::size_t derivative = at.derivative + (at.has_transition ? 2 * n + 8 : 0);
    for (std::size_t sample = at.sample; sample < at.sample + at.samples; ++sample) {
      const Eigen::Index j = problem.output[sample];
      const double weight = std::sqrt(path.weight_[sample]) / path.noise_[j];
      r[residual++] = (sensors[j].value(motion, vx) - problem.sample[sample]) * weight;
      if (J == nullptr) continue;
      sensors[j].jacobian(motion, vx, columns, jacobian, slope);
      ToRow(J->data() + derivative, n + 2) = slope.cwiseProduct(scale) * weight;
      derivative += n + 2;
    }
  }

  void priors(const Eigen::VectorXd& z) {
    Eigen::Index residual = path.end_.residual;
    std::size_t derivative = path.end_.derivative;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!path.has_prior(i)) continue;
      const PriorResidual prior = prior_residual(problem, z, i);
      r[residual++] = prior.value;
      if (J == nullptr) continue;
      ToRow(J->data() + derivative, n) = prior.slope * Eigen::RowVectorXd::Unit(n, i);
      derivative += n;
    }
  }

  const StatePath& path;
  const VehicleProblem& problem;
  Eigen::Index n;
  Eigen::VectorXd& r;
  std::vector<double>* J;
  std::vector<VehicleReading> sensors;
  JacobianColumns columns;
  Eigen::RowVectorXd scale, slope;
};

bool StatePath::evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& r,
                         std::vector<double>* J) const {
  const Eigen::VectorXd z = coordinates(x);
  const VehicleParameters<double> p = parameters_at(problem_, z);
  const std::vector<DrivenSegment> moved = moved_by_delay(problem_, p);
  const std::vector<DrivenSegment>& driven = moved.empty() ? problem_.driven : moved;
  const SingleTrack<> car = car_with(problem_.unknowns.curve, p);
  Evaluation out(*this, car, r, J);
  const double* state = x.data() + parameters_;
  for (std::size_t s = 0; s < driven.size(); ++s) {
    const double* time = problem_.run->time.data() + problem_.run->segments[s].first;
    const std::vector<Place>& places = places_[s];
    const auto state_at = [&](Eigen::Index t) {
      return Eigen::Vector2d(Eigen::Map<const Eigen::Vector2d>(state + 2 * t))
          .cwiseProduct(kStateScale)
          .eval();
    };
    // Every interval begins at the path's state and not where the one before ended.
    const auto arrive = [&](Eigen::Index t, const Motion& motion, const MotionJacobian& jacobian,
                            double) {
      if (t == 0) return;
      out.transition(places[t], state_at(t), time[t] - time[t - 1], motion, jacobian);
    };
    const auto place = [&](Eigen::Index t, double& vy, double& yaw_rate, MotionJacobian& jacobian) {
      const Eigen::Vector2d at = state_at(t);
      vy = at[0];
      yaw_rate = at[1];
      jacobian.vy.setZero();
      jacobian.r.setZero();
      if (J != nullptr) jacobian.vy[parameters_] = jacobian.r[parameters_ + 1] = 1.0;
      return true;
    };
    const auto measure = [&](Eigen::Index t, const Motion& motion, const MotionJacobian& jacobian,
                             double vx) { out.samples(places[t], motion, jacobian, vx); };
    const Eigen::Vector2d begin = state_at(0);
    simulate_with_jacobian(car, driven[s], begin[0], begin[1], out.columns, arrive, place, measure);
    state += 2 * driven[s].rows();
  }
  out.priors(z);
  return r.allFinite();
}

Eigen::VectorXd StatePath::move_of(const Eigen::VectorXd& at, const Eigen::MatrixXd& information,
                                   const Eigen::VectorXd& gradient) const {
  std::vector<Eigen::Index> inside;
  for (Eigen::Index i = 0; i < parameters_; ++i) {
    if (problem_.lower[i] < at[i] && at[i] < problem_.upper[i]) inside.push_back(i);
  }
  Eigen::VectorXd move = Eigen::VectorXd::Zero(parameters_);
  if (inside.empty()) return move;
  // Directions without information do not move.
  move(inside) =
      -information(inside, inside).completeOrthogonalDecomposition().solve(gradient(inside));
  return move;
}

StatePath::Linearisation StatePath::linearise(const Eigen::VectorXd& x) const {
  Eigen::Index priors = 0;
  for (Eigen::Index i = 0; i < parameters_; ++i) priors += has_prior(i) ? 1 : 0;
  Linearisation out;
  out.r.resize(end_.residual + priors);
  out.J.resize(end_.derivative + static_cast<std::size_t>(priors * parameters_));
  out.noise = noise_;
  out.parameters = x.head(parameters_);
  out.weight = weight_;
  evaluate(x, out.r, &out.J);
  return out;
}

/// The linearised residuals as they are at other noise.
struct StatePath::Rescaled {
  const Linearisation& about;
  const NoiseSd& noise;
  const VehicleProblem& problem;
  Eigen::Index n, outputs;
  NoiseSd scale = about.noise.cwiseQuotient(noise);

  BlockTridiagonal::Transition transition(const Place& at) const {
    BlockTridiagonal::Transition out;
    out.by.resize(2, n);
    const double* J = about.J.data() + at.derivative;
    for (Eigen::Index i = 0; i < 2; ++i) {
      const double factor = scale[outputs + i];
      out.by.row(i) = factor * Row(J + i * n, n);
      out.from.row(i) = factor * Row(J + 2 * n + 2 * i, 2);
      out.to.row(i) = factor * Row(J + 2 * n + 4 + 2 * i, 2);
      out.r[i] = factor * about.r[at.residual + i];
    }
    return out;
  }

  /// Sample i of the row, times the root of its weight.
  BlockTridiagonal::Sample sample(const Place& at, std::size_t i) const {
    BlockTridiagonal::Sample out;
    const double factor = scale[problem.output[at.sample + i]];
    const Row row(about.J.data() + at.derivative + (at.has_transition ? 2 * n + 8 : 0) +
                      i * static_cast<std::size_t>(n + 2),
                  n + 2);
    out.r = factor * about.r[at.residual + (at.has_transition ? 2 : 0) + i];
    out.by = factor * row.head(n);
    out.slope = factor * row.tail<2>().transpose();
    return out;
  }
};

BlockTridiagonal StatePath::assembled(std::size_t segment, const Rescaled& rows,
                                      MarginalQuadratic& rest) const {
  const std::vector<Place>& places = places_[segment];
  BlockTridiagonal out(static_cast<Eigen::Index>(places.size()), parameters_);
  for (std::size_t t = 0; t < places.size(); ++t) {
    const auto row = static_cast<Eigen::Index>(t);
    if (t > 0) out.add(row, rows.transition(places[t]), rest);
    for (std::size_t i = 0; i < places[t].samples; ++i) {
      out.add(row, rows.sample(places[t], i), rest);
    }
  }
  return out;
}

void StatePath::add_expected_noise(std::size_t segment, const BlockTridiagonal& path,
                                   const Rescaled& rows, const Eigen::VectorXd& p,
                                   Marginal& out) const {
  const double normal = 0.5 * kLogTwoPi;
  const double* time = problem_.run->time.data() + problem_.run->segments[segment].first;
  const std::vector<Place>& places = places_[segment];
  const NoiseSd& noise = rows.noise;
  path.substitute(p, [&](Eigen::Index t, const BlockTridiagonal::State& now) {
    if (now.next != nullptr) {
      const BlockTridiagonal::Transition step = rows.transition(places[t + 1]);
      const Eigen::Matrix2d variance = step.from * now.P * step.from.transpose() +
                                       step.from * now.across * step.to.transpose() +
                                       step.to * now.across.transpose() * step.from.transpose() +
                                       step.to * now.next->P * step.to.transpose();
      const Eigen::Vector2d r = step.r + step.by * p + step.from * now.x + step.to * now.next->x;
      out.moved.tail<2>() += variance.diagonal() + r.cwiseAbs2();
      out.counts.tail<2>().array() += 1.0;
      out.log_likelihood -= 0.5 * r.squaredNorm() + 2.0 * normal +
                            noise.tail<2>().array().log().sum() + std::log(time[t + 1] - time[t]);
    }
    for (std::size_t i = 0; i < places[t].samples; ++i) {
      const BlockTridiagonal::Sample at = rows.sample(places[t], i);
      const std::size_t k = places[t].sample + i;
      const Eigen::Index j = problem_.output[k];
      const double weight = rows.about.weight[k];
      const bool kept = weight == 1.0;
      const double r = (at.r + at.by.dot(p) + at.slope.dot(now.x)) / std::sqrt(weight);
      const double variance = at.slope.dot(now.P * at.slope) / weight;
      out.residuals[k] = r;
      out.deviation[k] =
          std::abs(r) / std::sqrt(kept ? std::max(1.0 - variance, 1e-6) : 1.0 + variance);
      if (!kept) continue;
      out.moved[j] += r * r + variance;
      out.counts[j] += 1.0;
      out.log_likelihood -= 0.5 * r * r + std::log(noise[j]) + normal;
    }
  });
}

StatePath::Marginal StatePath::marginal(const Linearisation& about, const NoiseSd& noise) const {
  const Eigen::Index n = parameters_;
  const Rescaled rows{about, noise, problem_, n, outputs_};
  Marginal out;
  out.counts = Eigen::VectorXd::Zero(outputs_ + 2);
  out.moved = out.counts;
  out.residuals.resize(problem_.residuals());
  out.deviation.resize(problem_.residuals());
  out.information = Eigen::MatrixXd::Zero(n, n);

  MarginalQuadratic rest{out.information, Eigen::VectorXd::Zero(n)};
  std::vector<BlockTridiagonal> paths;
  for (std::size_t s = 0; s < places_.size(); ++s) {
    paths.push_back(assembled(s, rows, rest));
    if (!paths.back().eliminate(kStateScale, rest)) return out;
  }
  const Eigen::Index priors = about.r.size() - end_.residual;
  const auto prior = [&](Eigen::Index i) {
    return Row(about.J.data() + end_.derivative + i * n, n);
  };
  for (Eigen::Index i = 0; i < priors; ++i) {
    rest.information += prior(i).transpose() * prior(i);
    rest.gradient += about.r[end_.residual + i] * prior(i).transpose();
  }

  const Eigen::VectorXd p =
      n == 0 ? rest.gradient : move_of(about.parameters, rest.information, rest.gradient);
  out.information = std::move(rest.information);
  out.log_likelihood = rest.log_likelihood;
  for (Eigen::Index i = 0; i < priors; ++i) {
    out.log_likelihood -= 0.5 * std::pow(about.r[end_.residual + i] + prior(i).dot(p), 2);
  }
  for (std::size_t s = places_.size(); s-- > 0;) add_expected_noise(s, paths[s], rows, p, out);
  return out;
}

}  // namespace identikal
