#include "identify/vehicle/covariance.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include "identify/estimate/distribution.h"
#include "identify/estimate/test_result.h"
#include "identify/vehicle/internal/initial_states.h"
#include "identify/vehicle/internal/robust_noise.h"
#include "lib/base/random.h"
#include "lib/statistics/long_run_covariance.h"
#include "lib/statistics/whiteness.h"

namespace identikal {
namespace {

constexpr double kColouredLevel = 0.01;
constexpr Eigen::Index kFewestBlocks = 8, kMostBlocks = 200;

/// Orthonormal basis of the columns of A.
Eigen::MatrixXd range_of(const Eigen::MatrixXd& A) {
  if (A.cols() == 0) return Eigen::MatrixXd(A.rows(), 0);
  Eigen::MatrixXd scaled = A;
  for (Eigen::Index i = 0; i < A.cols(); ++i) {
    const double norm = A.col(i).norm();
    if (norm > 0.0) scaled.col(i) /= norm;
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(scaled);
  qr.setThreshold(1e-9);
  return qr.householderQ() * Eigen::MatrixXd::Identity(A.rows(), qr.rank());
}

/// Residuals of one output on the recording's rows, NaN elsewhere.
Eigen::VectorXd on_rows(const VehicleProblem& problem, Eigen::Index output,
                        const Eigen::VectorXd& residuals) {
  Eigen::VectorXd out = Eigen::VectorXd::Constant(problem.run->time.size(), kNone);
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    if (problem.output[i] == output) {
      out[problem.row[i]] = residuals[i];
    }
  }
  return out;
}

/// Ljung-Box of every output, judged together.
void test_whiteness(const VehicleProblem& problem, VehicleCovariance& out) {
  const auto& outputs = problem.run->outputs;
  const double level = kColouredLevel / static_cast<double>(outputs.size());
  for (std::size_t j = 0; j < outputs.size(); ++j) {
    const Eigen::VectorXd e = on_rows(problem, static_cast<Eigen::Index>(j), out.residuals);
    const int lags = default_lags(outputs[j].samples);
    const ChiSquareStatistic statistic = ljung_box(e, lags);
    if (!std::isfinite(statistic.value)) continue;
    const TestResult test = ljung_box_test(outputs[j].name, statistic, level);
    out.coloured = out.coloured || !test.pass;
    out.whiteness.push_back(test);
  }
}

}  // namespace

Eigen::MatrixXd orthogonal_part(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  const Eigen::MatrixXd Q = range_of(A);
  return B - Q * (Q.transpose() * B);
}

Eigen::MatrixXd summed_by_row(const VehicleProblem& problem, const Eigen::MatrixXd& X,
                              const Eigen::VectorXd& weight) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(X.cols(), problem.run->used);
  Eigen::Index column = -1, previous = -1;
  for (std::size_t i = 0; i < problem.row.size(); ++i) {
    const auto n = static_cast<Eigen::Index>(i);
    if (problem.row[i] != previous) ++column;
    previous = problem.row[i];
    out.col(column) += weight[n] * X.row(n).transpose();
  }
  return out.leftCols(column + 1);
}

namespace {

/// The rows of the linearised problem, in the optimiser's coordinates.
struct WeightedRows {
  Eigen::MatrixXd X;        ///< (m + priors) x inner: a row per residual, over its sd
  Eigen::MatrixXd gains;    ///< m x gains: the same
  Eigen::MatrixX2d states;  ///< m x 2: by the initial state of the row's segment
  Eigen::VectorXd e;        ///< m: residuals over their sd
};

WeightedRows weigh(const VehicleProblem& problem, const VehicleOptimum& optimum,
                   const std::vector<Eigen::Index>& inner) {
  WeightedRows out;
  LeastSquares::RowMatrix J;
  output_error(problem, optimum.z, out.e, &J);
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    J.row(i) /= optimum.sd[problem.output[i]];
    out.e[i] /= optimum.sd[problem.output[i]];
  }
  out.X.resize(J.rows(), static_cast<Eigen::Index>(inner.size()));
  for (std::size_t i = 0; i < inner.size(); ++i) out.X.col(i) = J.col(inner[i]);
  out.gains = J.middleCols(problem.parameters(), problem.gains());
  out.states = J.rightCols<2>();
  return out;
}

/// What initial states and gain can explain carries no information about the parameters.
/// @return orthonormal bases of it: by segments, then of the gain
Eigen::MatrixXd project_out_nuisance(const VehicleProblem& problem, WeightedRows& rows) {
  const Eigen::Index inner = rows.X.cols();
  Eigen::MatrixXd others(rows.X.rows(), inner + rows.gains.cols());
  others << rows.X, rows.gains;
  const Eigen::MatrixX2d states = project_out_states(problem, rows.states, others);
  const Eigen::MatrixXd gains = range_of(others.rightCols(rows.gains.cols()));
  rows.X = others.leftCols(inner);
  rows.X -= gains * (gains.transpose() * rows.X);
  Eigen::MatrixXd out(states.rows(), 2 + gains.cols());
  out << states, gains;
  return out;
}

/// Every free parameter adds one more row, the information of its prior, and so does every constraint.
void add_priors(const VehicleProblem& problem, const VehicleOptimum& optimum,
                const std::vector<Eigen::Index>& inner, Eigen::MatrixXd& X) {
  const Eigen::Index m = X.rows(), k = problem.parameters();
  const Eigen::MatrixXd constraints =
      constraint_rows(problem, optimum.multipliers, optimum.z).slopes;
  X.conservativeResize(m + k + constraints.rows(), X.cols());
  X.bottomRows(k + constraints.rows()).setZero();
  for (std::size_t i = 0; i < inner.size(); ++i) {
    X(m + inner[i], i) = prior_residual(problem, optimum.z, inner[i]).slope;
  }
  X.bottomRows(constraints.rows()) = constraints(Eigen::all, inner);
}

/// Directions of the coordinates, by the eigenvectors of the information scaled to unit diagonal.
struct Directions {
  Eigen::MatrixXd determined;    ///< X determined is orthonormal
  Eigen::MatrixXd undetermined;  ///< along which no output changes

  Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& information) const {
    return determined * (determined.transpose() * information * determined).inverse() *
           determined.transpose();
  }
};

Directions directions_of(const Eigen::MatrixXd& X) {
  const Eigen::Index inner = X.cols();
  Directions out{Eigen::MatrixXd(inner, 0), Eigen::MatrixXd(inner, 0)};
  if (inner == 0) return out;
  Eigen::VectorXd size = X.colwise().norm().transpose();
  for (double& each : size) {
    if (!(each > 0.0)) each = 1.0;
  }
  const Eigen::MatrixXd unit = X * size.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(unit.transpose() * unit);
  const double least = kFlat * eigen.eigenvalues().maxCoeff();
  const Eigen::Index flat = (eigen.eigenvalues().array() <= least).count();
  const Eigen::Index determined = inner - flat;
  out.undetermined = size.cwiseInverse().asDiagonal() * eigen.eigenvectors().leftCols(flat);
  out.determined = size.cwiseInverse().asDiagonal() * eigen.eigenvectors().rightCols(determined) *
                   eigen.eigenvalues().tail(determined).cwiseSqrt().cwiseInverse().asDiagonal();
  return out;
}

/// An output loses as many degrees of freedom as the fit has leverage on its samples.
/// @param nuisance, influence  orthonormal bases of what initial states and gain explain, and the parameters
Eigen::VectorXd unbiased_sd(const VehicleProblem& problem, const Eigen::VectorXd& sd,
                            const Eigen::MatrixXd& nuisance, const Eigen::MatrixXd& influence) {
  Eigen::VectorXd lost = Eigen::VectorXd::Zero(sd.size()), samples = lost, out = sd;
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    lost[problem.output[i]] += nuisance.row(i).squaredNorm() + influence.row(i).squaredNorm();
    samples[problem.output[i]] += 1.0;
  }
  for (Eigen::Index j = 0; j < sd.size(); ++j) {
    const bool given = !std::isnan(problem.run->outputs[j].given_sd);
    if (!given) out[j] *= std::sqrt(samples[j] / std::max(samples[j] - lost[j], 1.0));
  }
  return out;
}

void reweigh(const VehicleProblem& problem, const Eigen::VectorXd& from, const Eigen::VectorXd& to,
             WeightedRows& rows) {
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    const double correction = from[problem.output[i]] / to[problem.output[i]];
    rows.X.row(i) *= correction;
    rows.e[i] *= correction;
  }
}

/// Rows by the expected information of a sample of robust noise, errors so that rows times errors
/// are the scores.
void bound_scores(WeightedRows& rows) {
  const double root = std::sqrt(noise_information(true));
  for (Eigen::Index n = 0; n < rows.e.size(); ++n) {
    const NoiseCost cost = noise_cost(true, rows.e[n]);
    rows.X.row(n) *= root;
    rows.e[n] *= cost.weight / root;
  }
}

/// Replaces the covariance by (X'X)^-1 S (X'X)^-1, S the long-run covariance of the scores.
/// @param inverse  (X'X)^-1; @param scale  from optimiser coordinates to SI
void sandwich(const VehicleProblem& problem, const WeightedRows& rows,
              const Eigen::MatrixXd& inverse, const Eigen::VectorXd& scale,
              VehicleCovariance& out) {
  const Eigen::Index m = rows.e.size(), known = rows.X.rows() - m;
  Eigen::MatrixXd scores = summed_by_row(problem, rows.X.topRows(m) * inverse, rows.e);
  // At the optimum the scores of the data balance those of the priors: without their mean they
  // scatter about zero.
  scores.colwise() -= Eigen::VectorXd(scores.rowwise().mean());
  const Eigen::MatrixXd spread = out.coloured
                                     ? widest_long_run_covariance(scores, inverse, out.bandwidth)
                                     : long_run_covariance(scores, out.bandwidth);
  const double correction = static_cast<double>(m) / out.freedom;
  // The error of a prior is independent of those of the data.
  const Eigen::MatrixXd priors = rows.X.bottomRows(known).transpose() * rows.X.bottomRows(known);
  out.covariance =
      scale.asDiagonal() * (correction * spread + inverse * priors * inverse) * scale.asDiagonal();
  if (out.coloured) {
    // An estimate below the errors of white residuals is an accident of its own scatter.
    const Eigen::VectorXd widened =
        (out.white.diagonal().array() / out.covariance.diagonal().array()).max(1.0).sqrt();
    out.covariance = widened.asDiagonal() * out.covariance * widened.asDiagonal();
  }
  // Rows without a sample have no score.
  out.memory = static_cast<double>(out.bandwidth) * problem.run->step *
               static_cast<double>(problem.run->used) / static_cast<double>(scores.cols());
  // The spread is itself an estimate: with these degrees of freedom Student's t has the critical
  // values of Kiefer & Vogelsang (2005, table 1) for Bartlett's window at this share of the record,
  // within 2 %.
  out.freedom =
      std::max(1.0, 0.9 * static_cast<double>(scores.cols()) / static_cast<double>(out.bandwidth));
}

/// vehicle_covariance() where it is given which parameters are held at their bounds.
VehicleCovariance covariance_holding(const VehicleProblem& problem, const VehicleOptimum& optimum,
                                     const std::vector<bool>& at_bound) {
  VehicleCovariance out;
  const Eigen::Index k = problem.parameters(), m = problem.residuals();
  out.at_bound = at_bound;
  out.open.assign(at_bound.size(), false);
  for (Eigen::Index i = 0; i < k; ++i) {
    if (!at_bound[i]) out.inner.push_back(i);
  }
  WeightedRows rows = weigh(problem, optimum, out.inner);
  const Eigen::MatrixXd nuisance = project_out_nuisance(problem, rows);
  add_priors(problem, optimum, out.inner, rows.X);
  const Eigen::Index known = rows.X.rows() - m;  // rows that are no sample's
  const Directions directions = directions_of(rows.X);
  out.sd = unbiased_sd(problem, optimum.sd, nuisance, rows.X * directions.determined);
  reweigh(problem, optimum.sd, out.sd, rows);
  out.residuals = rows.e;
  const Eigen::MatrixXd bound = directions.inverse_of(
      noise_information(problem.robust) * (rows.X.topRows(m).transpose() * rows.X.topRows(m)) +
      rows.X.bottomRows(known).transpose() * rows.X.bottomRows(known));
  if (problem.robust) bound_scores(rows);

  const Eigen::VectorXd scale = problem.unknowns.scale(out.inner);  // to SI
  const Eigen::MatrixXd information = rows.X.transpose() * rows.X;
  const Eigen::MatrixXd inverse = directions.inverse_of(information);
  const Eigen::MatrixXd& null = directions.undetermined;
  out.information =
      scale.cwiseInverse().asDiagonal() * information * scale.cwiseInverse().asDiagonal();
  out.null_space = null.cols() == 0
                       ? null
                       : Eigen::MatrixXd(null.householderQr().householderQ() *
                                         Eigen::MatrixXd::Identity(null.rows(), null.cols()));
  out.white = scale.asDiagonal() * bound * scale.asDiagonal();
  out.covariance = out.white;
  out.rows = rows.X.topRows(m) * scale.cwiseInverse().asDiagonal();
  out.scores = rows.e;
  test_whiteness(problem, out);
  const Eigen::Index determined = directions.determined.cols();
  // The squares of an orthonormal basis add up to its dimension.
  out.freedom =
      std::max(static_cast<double>(m - determined) - std::round(nuisance.squaredNorm()), 1.0);
  if ((out.coloured || problem.robust) && determined > 0) {
    sandwich(problem, rows, inverse, scale, out);
  }
  return out;
}

/// Whether the interval of a free parameter reaches from bound to bound.
bool is_undetermined(const VehicleProblem& problem, const Eigen::VectorXd& z,
                     const VehicleCovariance& covariance, Eigen::Index parameter) {
  const VehicleParameter which = problem.unknowns.free[parameter];
  const double si = parameters_at(problem, z)[which];
  Eigen::VectorXd along = Eigen::VectorXd::Zero(problem.parameters());
  along[parameter] = 1.0;
  const double se = standard_error(problem, covariance, along);
  if (std::isnan(se)) return true;  // a flat direction
  const double reach = normal_quantile(0.975) * se;
  const UserValue user = in_user_terms(which, si);
  if (!std::isfinite(user.value)) return false;
  if (must_be_positive(which) && user.value <= reach * std::abs(user.slope)) return true;
  return problem.unknowns.upper[parameter] - problem.unknowns.lower[parameter] <= reach;
}

}  // namespace

VehicleCovariance covariance_at_bounds(
    const VehicleProblem& problem, const Eigen::VectorXd& z, const std::vector<bool>& at_bound,
    const std::function<VehicleCovariance(const std::vector<bool>& held)>& holding) {
  const VehicleParameters<double> p = parameters_at(problem, z);
  const std::vector<VehicleParameter>& free = problem.unknowns.free;
  std::vector<bool> held(free.size(), false), open = held;
  bool any = false;
  for (std::size_t i = 0; i < free.size(); ++i) {
    // A straight axle is an answer.
    held[i] = at_bound[i] && is_straight(problem.unknowns, i, p[free[i]]);
    any = any || at_bound[i] != held[i];
  }
  if (any) {
    VehicleCovariance released = holding(held);
    // By the information alone: a misfit widens the other errors, and is another finding.
    released.covariance = released.white;
    for (std::size_t i = 0; i < free.size(); ++i) {
      open[i] = at_bound[i] && !held[i] &&
                is_undetermined(problem, z, released, static_cast<Eigen::Index>(i));
      held[i] = at_bound[i] && !open[i];
    }
  }
  VehicleCovariance out = holding(held);
  out.open = open;
  return out;
}

VehicleCovariance vehicle_covariance(const VehicleProblem& problem, const VehicleOptimum& optimum) {
  std::vector<bool> at_bound;
  for (Eigen::Index i = 0; i < problem.parameters(); ++i) {
    at_bound.push_back(is_at_bound(problem, optimum.z, i));
  }
  return covariance_at_bounds(problem, optimum.z, at_bound, [&](const std::vector<bool>& held) {
    return covariance_holding(problem, optimum, held);
  });
}

void bootstrap_errors(const VehicleProblem& problem, int draws, unsigned long long seed,
                      VehicleCovariance& covariance) {
  const Eigen::Index k = covariance.rows.cols();
  if (k == 0 || covariance.null_space.cols() > 0) return;
  Eigen::Index rows = 0;  // that hold a sample
  for (std::size_t i = 0; i < problem.row.size(); ++i) {
    if (i == 0 || problem.row[i] != problem.row[i - 1]) ++rows;
  }
  const Eigen::Index blocks = std::clamp<Eigen::Index>(
      rows / (2 * covariance.bandwidth), std::min<Eigen::Index>(kFewestBlocks, rows), kMostBlocks);
  std::vector<Eigen::MatrixXd> H(static_cast<std::size_t>(blocks), Eigen::MatrixXd::Zero(k, k));
  std::vector<Eigen::VectorXd> g(static_cast<std::size_t>(blocks), Eigen::VectorXd::Zero(k));
  Eigen::Index row = -1, previous = -1;
  for (std::size_t i = 0; i < problem.row.size(); ++i) {
    if (problem.row[i] != previous) ++row;
    previous = problem.row[i];
    const auto block = static_cast<std::size_t>(std::min(row * blocks / rows, blocks - 1));
    const auto n = static_cast<Eigen::Index>(i);
    const Eigen::VectorXd x = covariance.rows.row(n).transpose();
    H[block].noalias() += x * x.transpose();
    g[block] += covariance.scores[n] * x;
  }
  // The priors' share, whose scores balance those of the data.
  Eigen::MatrixXd prior = covariance.information;
  Eigen::VectorXd balance = Eigen::VectorXd::Zero(k);
  for (const Eigen::MatrixXd& each : H) prior -= each;
  for (const Eigen::VectorXd& each : g) balance -= each;

  Random random(seed);
  Eigen::MatrixXd moved(k, draws);
  for (int draw = 0; draw < draws; ++draw) {
    Eigen::MatrixXd information = prior;
    Eigen::VectorXd score = balance;
    for (Eigen::Index b = 0; b < blocks; ++b) {
      const auto drawn = static_cast<std::size_t>(std::min(
          blocks - 1, static_cast<Eigen::Index>(random.uniform() * static_cast<double>(blocks))));
      information += H[drawn];
      score += g[drawn];
    }
    for (Eigen::Index i = 0; i < k; ++i) {
      score[i] += std::sqrt(std::max(0.0, prior(i, i))) * random.normal();
    }
    moved.col(draw) = -information.ldlt().solve(score);
  }
  moved.colwise() -= Eigen::VectorXd(moved.rowwise().mean());
  covariance.covariance = moved * moved.transpose() / static_cast<double>(draws - 1);
  covariance.freedom = static_cast<double>(blocks - 1);
  covariance.draws = draws;
  covariance.blocks = blocks;
}

double standard_error(const VehicleProblem& problem, const VehicleCovariance& covariance,
                      const Eigen::VectorXd& gradient) {
  const auto inner = static_cast<Eigen::Index>(covariance.inner.size());
  Eigen::VectorXd g(inner), relative(inner);
  for (Eigen::Index i = 0; i < inner; ++i) {
    const Eigen::Index from = covariance.inner[i];
    g[i] = gradient[from];
    relative[i] = g[i] * problem.unknowns.scale[from];
  }
  for (std::size_t i = 0; i < covariance.at_bound.size(); ++i) {
    if (covariance.at_bound[i] && gradient[i] != 0.0) return kNone;
  }
  const double along = (covariance.null_space.transpose() * relative).norm();
  if (along > 1e-6 * relative.norm()) return kNone;
  return std::sqrt(std::max(0.0, g.dot(covariance.covariance * g)));
}

}  // namespace identikal
