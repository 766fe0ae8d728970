#include "identify/vehicle/internal/trajectory.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>

#include "lib/base/error.h"
#include "solvers/solve.h"
#include "solvers/sparse_least_squares.h"

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

/// sd of the outputs, then of the process: in this order everywhere.
using NoiseSd = Eigen::VectorXd;

/// The least squares problem over (parameters, states of all rows), all scaled.
class StatePath {
 public:
  explicit StatePath(const VehicleProblem& problem)
      : problem_(problem), outputs_(problem.run->y.rows()), parameters_(problem.parameters()) {
    if (parameters_ > 0) sparse_.block_sizes.push_back(parameters_);
    std::size_t sample = 0;
    for (std::size_t s = 0; s < problem.driven.size(); ++s) {
      const Eigen::Index rows = problem.driven[s].rows(), first = problem.run->segments[s].first;
      for (Eigen::Index t = 0; t < rows; ++t) {
        const auto block = static_cast<Eigen::Index>(sparse_.block_sizes.size());
        sparse_.block_sizes.push_back(2);
        if (t > 0) add_group({block - 1, block}, 2);
        for (; sample < problem.row.size() && problem.row[sample] == first + t; ++sample) {
          add_group({block}, 1);
        }
      }
    }
    for (Eigen::Index i = 0; i < parameters_; ++i) {
      if (has_prior(i)) sparse_.groups.push_back({{0}, 1});
    }
    const auto states =
        2 * static_cast<Eigen::Index>(sparse_.block_sizes.size()) - (parameters_ > 0 ? 2 : 0);
    const double infinity = std::numeric_limits<double>::infinity();
    sparse_.lower = Eigen::VectorXd::Constant(parameters_ + states, -infinity);
    sparse_.upper = Eigen::VectorXd::Constant(parameters_ + states, infinity);
    sparse_.lower.head(parameters_) = problem.lower.head(parameters_);
    sparse_.upper.head(parameters_) = problem.upper.head(parameters_);
    sparse_.evaluate = [this](const Eigen::VectorXd& x, Eigen::VectorXd& r,
                              std::vector<double>* J) { return evaluate(x, r, J); };
  }
  StatePath(const StatePath&) = delete;
  StatePath& operator=(const StatePath&) = delete;

  Eigen::Index parameters() const { return parameters_; }
  Eigen::Index outputs() const { return outputs_; }
  const SparseLeastSquares& sparse() const { return sparse_; }

  /// @param weight  of every sample: 1, or kLeftOut
  void set_noise(const NoiseSd& noise, const Eigen::VectorXd& weight) {
    noise_ = noise;
    weight_ = weight;
  }

  /// The simulation's motion as a path to begin at.
  Eigen::VectorXd begin(const Eigen::VectorXd& z) const {
    Eigen::VectorXd x(sparse_.lower.size());
    x.head(parameters_) = z.head(parameters_);
    Eigen::Index at = parameters_;
    replay(problem_, z, [&](Eigen::Index, const Motion& motion, double) {
      x[at++] = motion.vy / kStateScale[0];
      x[at++] = motion.r / kStateScale[1];
    });
    return x;
  }

  /// Simulation coordinates of the same parameters and first states.
  Eigen::VectorXd coordinates(const Eigen::VectorXd& x) const {
    Eigen::VectorXd z(problem_.coordinates());
    z.head(parameters_) = x.head(parameters_);
    Eigen::Index at = parameters_;
    for (std::size_t s = 0; s < problem_.driven.size(); ++s) {
      z.segment<2>(problem_.state_of(s)) = x.segment<2>(at);
      at += 2 * problem_.driven[s].rows();
    }
    return z.cwiseMax(problem_.lower).cwiseMin(problem_.upper);
  }

  std::vector<Eigen::Matrix2Xd> states(const Eigen::VectorXd& x) const {
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

  bool evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& r, std::vector<double>* J) const {
    const Eigen::VectorXd z = coordinates(x);
    const VehicleParameters<double> p = parameters_at(problem_, z);
    const std::vector<DrivenSegment> moved = moved_by_delay(problem_, p);
    const std::vector<DrivenSegment>& driven = moved.empty() ? problem_.driven : moved;
    const SingleTrack<> car = car_with(problem_.unknowns.curve, p);
    const std::vector<VehicleReading> sensors = readings(*problem_.run, car);
    JacobianColumns columns;
    Eigen::RowVectorXd scale(parameters_ + 2), slope(parameters_ + 2);
    scale << problem_.unknowns.scale.transpose(), kStateScale.transpose();
    if (J != nullptr) {
      columns.columns = parameters_ + 2;
      for (Eigen::Index i = 0; i < parameters_; ++i) {
        columns.parameter[problem_.unknowns.free[static_cast<std::size_t>(i)]] = i;
      }
      columns.vy = parameters_;
      columns.r = parameters_ + 1;
    } else {
      slope.resize(0);
    }
    Eigen::Index residual = 0;
    std::size_t derivative = 0, sample = 0;
    const double* state = x.data() + parameters_;
    for (std::size_t s = 0; s < driven.size(); ++s) {
      const Eigen::Index first = problem_.run->segments[s].first;
      const Eigen::VectorXd& time = problem_.run->time;
      const auto at_row = [&](Eigen::Index t) {
        return Eigen::Vector2d(Eigen::Map<const Eigen::Vector2d>(state + 2 * t))
            .cwiseProduct(kStateScale)
            .eval();
      };
      const auto arrive = [&](Eigen::Index t, const Motion& motion, const MotionJacobian& jacobian,
                              double) {
        if (t == 0) return;
        const double root = std::sqrt(time[first + t] - time[first + t - 1]);
        const Eigen::Vector2d weight = (noise_.tail<2>() * root).cwiseInverse();
        r.segment<2>(residual) =
            (at_row(t) - Eigen::Vector2d(motion.vy, motion.r)).cwiseProduct(weight);
        residual += 2;
        if (J == nullptr) return;
        double* to = J->data() + derivative;
        const Eigen::RowVectorXd* rows[] = {&jacobian.vy, &jacobian.r};
        for (Eigen::Index i = 0; i < 2; ++i) {
          const Eigen::RowVectorXd by = -weight[i] * rows[i]->cwiseProduct(scale);
          Eigen::Map<Eigen::RowVectorXd>(to + i * parameters_, parameters_) = by.head(parameters_);
          Eigen::Map<Eigen::RowVector2d>(to + 2 * parameters_ + 2 * i) = by.tail<2>();
          Eigen::Map<Eigen::RowVector2d>(to + 2 * parameters_ + 4 + 2 * i) =
              weight[i] * kStateScale[i] * Eigen::RowVector2d::Unit(i);
        }
        derivative += static_cast<std::size_t>(2 * parameters_ + 8);
      };
      const auto place = [&](Eigen::Index t, double& vy, double& yaw, MotionJacobian& jacobian) {
        const Eigen::Vector2d at = at_row(t);
        vy = at[0];
        yaw = at[1];
        jacobian.vy.setZero();
        jacobian.r.setZero();
        if (J != nullptr) jacobian.vy[parameters_] = jacobian.r[parameters_ + 1] = 1.0;
        return true;
      };
      const auto measure = [&](Eigen::Index t, const Motion& motion, const MotionJacobian& jacobian,
                               double vx) {
        for (; sample < problem_.row.size() && problem_.row[sample] == first + t; ++sample) {
          const auto n = static_cast<Eigen::Index>(sample);
          const Eigen::Index j = problem_.output[sample];
          const VehicleReading& sensor = sensors[static_cast<std::size_t>(j)];
          const double weight = std::sqrt(weight_[n]) / noise_[j];
          r[residual++] = (sensor.value(motion, vx) - problem_.sample[n]) * weight;
          if (J == nullptr) continue;
          sensor.jacobian(motion, vx, columns, jacobian, slope);
          Eigen::Map<Eigen::RowVectorXd>(J->data() + derivative, parameters_ + 2) =
              slope.cwiseProduct(scale) * weight;
          derivative += static_cast<std::size_t>(parameters_ + 2);
        }
      };
      const Eigen::Vector2d begin = at_row(0);
      simulate_with_jacobian(car, driven[s], begin[0], begin[1], columns, arrive, place, measure);
      state += 2 * driven[s].rows();
    }
    for (Eigen::Index i = 0; i < parameters_; ++i) {
      if (!has_prior(i)) continue;
      const PriorResidual prior = prior_residual(problem_, z, i);
      r[residual++] = prior.value;
      if (J == nullptr) continue;
      Eigen::Map<Eigen::RowVectorXd>(J->data() + derivative, parameters_) =
          prior.slope * Eigen::RowVectorXd::Unit(parameters_, i);
      derivative += static_cast<std::size_t>(parameters_);
    }
    return r.allFinite();
  }

  /// The problem about x, at the noise that is set.
  struct Linearisation {
    Eigen::VectorXd r;
    std::vector<double> J;
    NoiseSd noise;
    Eigen::VectorXd parameters, weight;
  };
  Linearisation linearise(const Eigen::VectorXd& x) const;

  /// What is left of the linearised problem at other noise when parameters and path have moved to
  /// their optimum and the path is integrated out.
  struct Marginal {
    double log_likelihood = -std::numeric_limits<double>::infinity();
    NoiseSd moved;                ///< squares expected of each standardised noise, summed
    NoiseSd counts;               ///< and how many there are
    Eigen::MatrixXd information;  ///< of the parameters' coordinates
    Eigen::VectorXd residuals;    ///< of the samples over their sd, as the problem orders them
    Eigen::VectorXd deviation;    ///< of each from what all others foretell, over its sd
  };
  Marginal marginal(const Linearisation& about, const NoiseSd& noise) const;

 private:
  /// The parameters' move, which leaves alone what the optimiser has at a bound.
  Eigen::VectorXd move_of(const Eigen::VectorXd& at, const Eigen::MatrixXd& information,
                          const Eigen::VectorXd& gradient) const;

  bool has_prior(Eigen::Index i) const {
    const Prior::Kind kind = problem_.unknowns.prior[static_cast<std::size_t>(i)].kind;
    return kind == Prior::Kind::normal || kind == Prior::Kind::log_normal;
  }

  void add_group(std::vector<Eigen::Index> blocks, Eigen::Index residuals) {
    if (parameters_ > 0) blocks.insert(blocks.begin(), 0);
    sparse_.groups.push_back({std::move(blocks), residuals});
  }

  const VehicleProblem& problem_;
  Eigen::Index outputs_, parameters_;
  SparseLeastSquares sparse_;
  NoiseSd noise_;
  Eigen::VectorXd weight_;
};

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
  Eigen::Index residuals = 0, derivatives = 0;
  for (const SparseLeastSquares::Group& group : sparse_.groups) {
    Eigen::Index columns = 0;
    for (const Eigen::Index b : group.blocks) {
      columns += sparse_.block_sizes[static_cast<std::size_t>(b)];
    }
    residuals += group.residuals;
    derivatives += group.residuals * columns;
  }
  Linearisation out;
  out.r.resize(residuals);
  out.J.resize(static_cast<std::size_t>(derivatives));
  out.noise = noise_;
  out.parameters = x.head(parameters_);
  out.weight = weight_;
  evaluate(x, out.r, &out.J);
  return out;
}

// With p and x_t the moves of parameters and states, every row of the problem is r + a p + b x_t (+
// c x_t-1). The second derivative by the path is block tridiagonal, H_t with U_t beside it;
// eliminated forwards,
//   D_0 = H_0,  D_t = H_t - U_t-1' D_t-1^-1 U_t-1,  det H = prod det D_t,
// the same for gradients g_t and cross derivatives G_t; what remains of p's are information and
// gradient. Backwards x_t = -D_t^-1 (g_t + G_t p + U_t x_t+1), the variances P_t = D_t^-1 + D_t^-1
// U_t P_t+1 U_t' D_t^-1, and cov(x_t, x_t+1) = -D_t^-1 U_t P_t+1.
StatePath::Marginal StatePath::marginal(const Linearisation& about, const NoiseSd& noise) const {
  const Eigen::Index n = parameters_;
  const double normal = 0.5 * std::log(2.0 * std::numbers::pi);
  const NoiseSd scale = about.noise.cwiseQuotient(noise);
  using Row = Eigen::Map<const Eigen::RowVectorXd>;
  using Wide = Eigen::Matrix<double, 2, Eigen::Dynamic>;

  struct Block {
    Eigen::Matrix2d H = Eigen::Matrix2d::Zero(), U = Eigen::Matrix2d::Zero(), inverse;
    Eigen::Vector2d g = Eigen::Vector2d::Zero(), x;
    Wide G;
    std::size_t derivative = 0;  // where the rows of this time begin
    Eigen::Index residual = 0;
    std::size_t samples = 0;
  };
  struct Step {
    Wide by;
    Eigen::Matrix2d from, to;
    Eigen::Vector2d r;
  };
  const auto step_into = [&](const Block& at) {
    Step out;
    out.by.resize(2, n);
    const double* J = about.J.data() + at.derivative;
    for (Eigen::Index i = 0; i < 2; ++i) {
      const double factor = scale[outputs_ + i];
      out.by.row(i) = factor * Row(J + i * n, n);
      out.from.row(i) = factor * Row(J + 2 * n + 2 * i, 2);
      out.to.row(i) = factor * Row(J + 2 * n + 4 + 2 * i, 2);
      out.r[i] = factor * about.r[at.residual + i];
    }
    return out;
  };
  /// A sample: its row over its sd and times the root of its weight.
  struct Sample {
    Eigen::RowVectorXd by;
    Eigen::Vector2d slope;
    double r;
    Eigen::Index output;
  };
  const auto sample_at = [&](const Block& at, bool has_step, std::size_t i, std::size_t sample) {
    Sample out;
    const auto k = static_cast<Eigen::Index>(i);
    out.output = problem_.output[sample];
    const double factor = scale[out.output];
    const Row row(about.J.data() + at.derivative +
                      (has_step ? static_cast<std::size_t>(2 * n + 8) : 0) +
                      i * static_cast<std::size_t>(n + 2),
                  n + 2);
    out.r = factor * about.r[at.residual + (has_step ? 2 : 0) + k];
    out.by = factor * row.head(n);
    out.slope = factor * row.tail<2>().transpose();
    return out;
  };

  Marginal out;
  out.counts = Eigen::VectorXd::Zero(outputs_ + 2);
  out.moved = out.counts;
  out.residuals.resize(problem_.residuals());
  out.deviation.resize(problem_.residuals());
  out.information = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(n);
  double L = 0.0;

  std::vector<std::vector<Block>> segments;
  Eigen::Index residual = 0;
  std::size_t derivative = 0, sample = 0;
  for (std::size_t s = 0; s < problem_.driven.size(); ++s) {
    const Eigen::Index rows = problem_.driven[s].rows(), first = problem_.run->segments[s].first;
    std::vector<Block>& blocks = segments.emplace_back(static_cast<std::size_t>(rows));
    for (Eigen::Index t = 0; t < rows; ++t) {
      Block& now = blocks[static_cast<std::size_t>(t)];
      now.G.setZero(2, n);
      now.derivative = derivative;
      now.residual = residual;
      if (t > 0) {
        Block& before = blocks[static_cast<std::size_t>(t - 1)];
        const Step step = step_into(now);
        before.H += step.from.transpose() * step.from;
        before.U = step.from.transpose() * step.to;
        before.G += step.from.transpose() * step.by;
        before.g += step.from.transpose() * step.r;
        now.H += step.to.transpose() * step.to;
        now.G += step.to.transpose() * step.by;
        now.g += step.to.transpose() * step.r;
        out.information += step.by.transpose() * step.by;
        gradient += step.by.transpose() * step.r;
        residual += 2;
        derivative += static_cast<std::size_t>(2 * n + 8);
      }
      for (; sample < problem_.row.size() && problem_.row[sample] == first + t; ++sample) {
        const Sample at = sample_at(now, t > 0, now.samples++, sample);
        now.H += at.slope * at.slope.transpose();
        now.G += at.slope * at.by;
        now.g += at.r * at.slope;
        out.information += at.by.transpose() * at.by;
        gradient += at.r * at.by.transpose();
        ++residual;
        derivative += static_cast<std::size_t>(n + 2);
      }
    }
    for (Eigen::Index t = 0; t < rows; ++t) {
      Block& now = blocks[static_cast<std::size_t>(t)];
      if (t > 0) {
        const Block& before = blocks[static_cast<std::size_t>(t - 1)];
        const Eigen::Matrix2d back = before.U.transpose() * before.inverse;
        now.H -= back * before.U;
        now.G -= back * before.G;
        now.g -= back * before.g;
      }
      const double determinant = now.H.determinant();
      if (!(determinant > 0.0)) return out;  // the samples do not determine the path
      now.inverse = now.H.inverse();
      out.information -= now.G.transpose() * now.inverse * now.G;
      gradient -= now.G.transpose() * now.inverse * now.g;
      L += 2.0 * normal + kStateScale.array().log().sum() - 0.5 * std::log(determinant);
    }
  }
  const Eigen::Index priors = residual;
  const std::size_t prior_derivatives = derivative;
  for (Eigen::Index i = 0; priors + i < about.r.size(); ++i) {
    const Row by(about.J.data() + prior_derivatives + static_cast<std::size_t>(i * n), n);
    out.information += by.transpose() * by;
    gradient += about.r[priors + i] * by.transpose();
  }

  const Eigen::VectorXd p =
      n == 0 ? gradient : move_of(about.parameters, out.information, gradient);
  for (Eigen::Index i = 0; priors + i < about.r.size(); ++i) {
    const Row by(about.J.data() + prior_derivatives + static_cast<std::size_t>(i * n), n);
    L -= 0.5 * std::pow(about.r[priors + i] + by.dot(p), 2);
  }
  sample = problem_.row.size();
  for (std::size_t s = segments.size(); s-- > 0;) {
    const Eigen::Index first = problem_.run->segments[s].first;
    std::vector<Block>& blocks = segments[s];
    Eigen::Matrix2d P = Eigen::Matrix2d::Zero();
    for (std::size_t t = blocks.size(); t-- > 0;) {
      Block& now = blocks[t];
      now.x = now.g + now.G * p;
      if (t + 1 < blocks.size()) {
        Block& next = blocks[t + 1];
        now.x += now.U * next.x;
        const Step step = step_into(next);
        const Eigen::Matrix2d back = now.inverse * now.U, across = -back * P;
        const Eigen::Matrix2d here = now.inverse + back * P * back.transpose();
        now.x = (-now.inverse * now.x).eval();
        const Eigen::Matrix2d variance = step.from * here * step.from.transpose() +
                                         step.from * across * step.to.transpose() +
                                         step.to * across.transpose() * step.from.transpose() +
                                         step.to * P * step.to.transpose();
        const Eigen::Vector2d r = step.r + step.by * p + step.from * now.x + step.to * next.x;
        const auto row = first + static_cast<Eigen::Index>(t);
        const double dt = problem_.run->time[row + 1] - problem_.run->time[row];
        out.moved.tail<2>() += variance.diagonal() + r.cwiseAbs2();
        out.counts.tail<2>().array() += 1.0;
        L -= 0.5 * r.squaredNorm() + 2.0 * normal + noise.tail<2>().array().log().sum() +
             std::log(dt);
        P = here;
      } else {
        now.x = (-now.inverse * now.x).eval();
        P = now.inverse;
      }
      sample -= now.samples;
      for (std::size_t i = 0; i < now.samples; ++i) {
        const Sample at = sample_at(now, t > 0, i, sample + i);
        const auto k = static_cast<Eigen::Index>(sample + i);
        const bool kept = about.weight[k] == 1.0;
        const double root = std::sqrt(about.weight[k]);
        const double r = (at.r + at.by.dot(p) + at.slope.dot(now.x)) / root;
        const double variance = at.slope.dot(P * at.slope) / about.weight[k];
        out.residuals[k] = r;
        out.deviation[k] =
            std::abs(r) / std::sqrt(kept ? std::max(1.0 - variance, 1e-6) : 1.0 + variance);
        if (!kept) continue;
        out.moved[at.output] += r * r + variance;
        out.counts[at.output] += 1.0;
        L -= 0.5 * r * r + std::log(noise[at.output]) + normal;
      }
    }
  }
  out.log_likelihood = L;
  return out;
}

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
    const double now = e[static_cast<Eigen::Index>(i)];
    if (!std::isnan(previous[j])) {
      change[static_cast<std::size_t>(j)].push_back(std::abs(now - previous[j]));
    }
    previous[j] = now;
  }
  NoiseSd out(outputs + 2);
  for (Eigen::Index j = 0; j < outputs; ++j) {
    const double given = problem.run->outputs[static_cast<std::size_t>(j)].given_sd;
    std::vector<double>& values = change[static_cast<std::size_t>(j)];
    double sd = 0.5 * start.sd[j];
    if (!values.empty()) {
      const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
      std::nth_element(values.begin(), middle, values.end());
      // The median of |N(0, 2 sd^2)| is .954 sd.
      sd = std::clamp(*middle / 0.954, 0.02 * start.sd[j], start.sd[j]);
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
  const auto median = [](std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
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
    if (!held[static_cast<std::size_t>(i)]) out.inner.push_back(i);
  }
  const auto inner = static_cast<Eigen::Index>(out.inner.size());
  Eigen::MatrixXd information(inner, inner);
  Eigen::VectorXd size(inner), scale(inner);
  for (Eigen::Index i = 0; i < inner; ++i) {
    for (Eigen::Index j = 0; j < inner; ++j) {
      information(i, j) = marginal.information(out.inner[static_cast<std::size_t>(i)],
                                               out.inner[static_cast<std::size_t>(j)]);
    }
    size[i] = information(i, i) > 0.0 ? std::sqrt(information(i, i)) : 1.0;
    scale[i] = problem.unknowns.scale[out.inner[static_cast<std::size_t>(i)]];
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

}  // namespace

VehicleTrajectory fit_trajectory(const VehicleProblem& problem, const VehicleOptimum& start,
                                 const SolverOptions& options) {
  if (problem.unknowns.value[kRelaxationLength] > 0.0 ||
      problem.unknowns.find(kRelaxationLength) >= 0) {
    throw InputError({}, "--method trajectory does not know relaxation_length",
                     "a model file without it, or --method output-error");
  }
  StatePath path(problem);
  const Eigen::Index outputs = path.outputs();
  const NoiseSd first = first_noise(problem, start);
  NoiseSd noise = first;
  std::vector<Eigen::Index> sought;
  for (Eigen::Index i = 0; i < noise.size(); ++i) {
    const bool given =
        i < outputs && !std::isnan(problem.run->outputs[static_cast<std::size_t>(i)].given_sd);
    if (!given) sought.push_back(i);
  }
  const auto count = static_cast<Eigen::Index>(sought.size());
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
    // The noise of the problem linearised there; coordinates are changes of the logarithms.
    const StatePath::Linearisation about = path.linearise(x);
    const auto changed = [&](const Eigen::VectorXd& by) {
      NoiseSd to = noise;
      for (Eigen::Index i = 0; i < count; ++i) {
        to[sought[static_cast<std::size_t>(i)]] *= std::exp(by[i]);
      }
      return to;
    };
    Minimization most_likely;
    most_likely.lower = most_likely.upper = Eigen::VectorXd::Constant(count, kFarthest);
    for (Eigen::Index i = 0; i < count; ++i) {
      const Eigen::Index at = sought[static_cast<std::size_t>(i)];
      most_likely.lower[i] =
          std::min(0.0, std::max(-kFarthest, std::log(kLeastNoise * first[at] / noise[at])));
    }
    most_likely.evaluate = [&](const Eigen::VectorXd& by, double& f, Eigen::VectorXd* gradient) {
      const StatePath::Marginal marginal = path.marginal(about, changed(by));
      f = -marginal.log_likelihood;
      if (gradient != nullptr) {
        gradient->resize(count);
        for (Eigen::Index i = 0; i < count; ++i) {
          const Eigen::Index at = sought[static_cast<std::size_t>(i)];
          (*gradient)[i] = marginal.counts[at] - marginal.moved[at];
        }
      }
      return std::isfinite(f);
    };
    double change = 0.0;
    if (count > 0) {
      const Solution moved = solve(most_likely, Eigen::VectorXd::Zero(count), SolverOptions{});
      noise = changed(moved.x);
      change = moved.x.cwiseAbs().maxCoeff();
    }
    bool changed_mind = false;
    if (problem.robust) {
      const Eigen::VectorXd deviation = path.marginal(about, noise).deviation;
      for (Eigen::Index i = 0; i < weight.size(); ++i) {
        // Neighbours may accuse each other in turn: what is out later stays out.
        const bool out_for_good = weight[i] != 1.0 && round >= kReadmitted;
        const double now = out_for_good || deviation[i] > kFarOff ? kLeftOut : 1.0;
        changed_mind = changed_mind || now != weight[i];
        weight[i] = now;
      }
    }
    out.best.converged = change < kSettledNoise && !changed_mind;
  }
  if (out.best.converged) out.best.message = "path and noise have settled";
  const StatePath::Marginal marginal = path.marginal(path.linearise(x), noise);
  out.best.z = path.coordinates(x);
  out.best.sd = noise.head(outputs);
  out.best.log_likelihood = marginal.log_likelihood;
  out.left_out = (weight.array() != 1.0).count();
  out.process = noise.tail<2>();
  out.states = path.states(x);
  std::vector<bool> at_bound;
  for (Eigen::Index i = 0; i < problem.parameters(); ++i) {
    const double z = out.best.z[i], near = 1e-6 * std::max(1.0, std::abs(z));
    at_bound.push_back(z - problem.lower[i] <= near || problem.upper[i] - z <= near);
  }
  out.covariance =
      holding_what_is_told(problem, out.best.z, at_bound, [&](const std::vector<bool>& held) {
        return covariance_of(problem, out.best, marginal, held);
      });
  return out;
}

}  // namespace identikal
