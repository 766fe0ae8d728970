#include "identify/noise/als.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/recordings_check.h"
#include "identify/model/check.h"
#include "identify/model/parameter_prior.h"
#include "identify/noise/estimate.h"
#include "identify/noise/internal/minimum_rank.h"
#include "lib/filter/information.h"
#include "lib/filter/steady_state.h"
#include "lib/statistics/autocovariance.h"
#include "solvers/covariance.h"
#include "solvers/psd_least_squares.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Of an initial error, and of what autocovariances say about the noise, this much is let go.
constexpr double kForgotten = 1e-3;
constexpr double kUninformative = 0.02;
constexpr Index kFewestLags = 5, kMostLags = 200;
// Rows of the least-squares problem: its weight is a dense matrix of that size. The first where the
// lags are ours to choose, the second, 0.3 GB, where they are requested.
constexpr Index kMostRows = 3000, kMostRowsAsked = 6000;

// Smallest k with |F^k| <= tolerance; `most` when it is not reached before.
Index memory(const MatrixXd& F, double tolerance, Index most) {
  MatrixXd power = MatrixXd::Identity(F.rows(), F.cols());
  for (Index k = 0; k < most; ++k) {
    if (power.norm() <= tolerance) return k;
    power = (F * power).eval();
  }
  return most;
}

// x(0) that explains the first innovations best: what is left of the true one then fades from a
// smaller size.
VectorXd likely_start(const StateSpace& model, const MatrixXd& L, const MatrixXd& y,
                      const MatrixXd& u, Index window) {
  const Index ny = model.outputs(), n = model.states();
  const Index N = std::min(y.cols(), window + n);
  const MatrixXd e = constant_gain_innovations(model, L, VectorXd::Zero(n), y.leftCols(N),
                                               u.leftCols(u.rows() > 0 ? N : 0));
  MatrixXd response = MatrixXd::Zero(N * ny, n), power = MatrixXd::Identity(n, n);
  VectorXd seen = VectorXd::Zero(N * ny);
  for (Index t = 0; t < N; ++t) {
    const MatrixXd now = model.C * power;
    for (Index i = 0; i < ny; ++i) {
      if (std::isnan(e(i, t))) continue;
      response.row(t * ny + i) = now.row(i);
      seen[t * ny + i] = e(i, t);
    }
    power = ((model.A - L * model.C) * power).eval();
  }
  return response.completeOrthogonalDecomposition().solve(seen);
}

struct Recording {
  const MatrixXd& y;
  MatrixXd u;
};

// The least-squares problem under one gain: sample = constant + design theta + error.
struct Regression {
  Index lags = 0;
  MatrixXd design;
  VectorXd constant, sample, pairs;
  VectorXd times;  // how often each row counts where there are no other weights
};

// In the full matrix of autocovariances, its blocks Y_(i-j) with i, j < lags, lag k stands on
// 2 (lags - k) places, above and below the diagonal, and so does each covariance of lag 0, whose
// variances stand on it. Everything else about the form is the single column's, so it is a weight:
// long lags, which are the noisier ones, count less.
VectorXd times_in_full_matrix(Index lags, Index ny) {
  Autocovariances out;
  for (Index k = 0; k < lags; ++k) {
    out.emplace_back(MatrixXd::Constant(ny, ny, 2.0 * static_cast<double>(lags - k)));
  }
  out[0].diagonal().setConstant(static_cast<double>(lags));
  return stacked(out);
}

// min and max of the free entries, as far as there are any.
std::vector<PsdBlock> bounds_of(const ParameterSet& parameters) {
  std::vector<PsdBlock> out;
  Index e = 0;
  for (const Parameter& p : parameters) {
    if (p.fixed) continue;
    if (p.domain == Domain::scalar && std::isfinite(p.min)) {
      out.push_back(lower_bound_block(e, p.min));
    }
    if (p.domain == Domain::scalar && std::isfinite(p.max)) {
      out.push_back(upper_bound_block(e, p.max));
    }
    e += free_entries({p}).size();
  }
  return out;
}

class Als {
 public:
  Als(const Model& model, const std::vector<Dataset>& recordings)
      : linear_(as_linear(model)),
        parameters_(model.parameters),
        basis_(model_derivatives(linear_, model.parameters)) {
    const VectorXd zero = VectorXd::Zero(static_cast<Index>(basis_.size()));
    fixed_ = instantiate(linear_, with_entries(parameters_, zero));
    // As they are written: what becomes of a density over one sample is positive definite for some
    // that are negative.
    joint_fixed_ = joint_covariance(written(zero));
    for (Index e = 0; e < zero.size(); ++e) {
      const StateSpace here = written(VectorXd::Unit(zero.size(), e));
      joint_basis_.push_back(joint_covariance(here) - joint_fixed_);
    }
    blocks_ = independent_blocks(joint_fixed_, joint_basis_);
    limits_ = bounds_of(parameters_);
    for (const Dataset& data : recordings) {
      recordings_.push_back({data.y, model_inputs(linear_, data.u)});
      gaps_ = gaps_ || data.y.hasNaN();
    }
  }

  StateSpace at(const VectorXd& theta) const {
    return instantiate(linear_, with_entries(parameters_, theta));
  }
  const std::vector<StateSpace>& basis() const { return basis_; }
  const std::vector<PsdBlock>& blocks() const { return blocks_; }
  const std::vector<PsdBlock>& limits() const { return limits_; }
  const MatrixXd& joint_fixed() const { return joint_fixed_; }
  const std::vector<MatrixXd>& joint_basis() const { return joint_basis_; }
  Index process_noises() const { return written(free_entries(parameters_)).Q.rows(); }

  // Nothing when the recordings are no longer than the filter's memory.
  std::optional<Regression> regression(const MatrixXd& L, Index lags, bool full_matrix) const {
    const MatrixXd F = fixed_.A - L * fixed_.C;
    const Index ny = fixed_.outputs();
    Index longest = 0;
    for (const Recording& r : recordings_) longest = std::max(longest, r.y.cols());
    const Index first = memory(F, kForgotten, longest);
    Regression out;
    out.lags = lags;
    if (lags == 0) {
      const Index most = std::min({kMostLags, longest / 5, kMostRows / (ny * ny)});
      out.lags = std::clamp(memory(F, kUninformative, kMostLags) + 1, kFewestLags,
                            std::max(most, kFewestLags));
    }
    if (first + 2 * out.lags > longest) return std::nullopt;

    const auto count = static_cast<std::size_t>(out.lags);
    const MatrixXd nothing = MatrixXd::Zero(ny, ny);
    Autocovariances sum(count, nothing), pairs = sum, constant = sum;
    std::vector<Autocovariances> columns(basis_.size(), sum);
    std::vector<StateSpace> noises{fixed_};
    for (const StateSpace& noise : basis_) noises.push_back(with_noise(noise));
    std::vector<Autocovariances> without_gaps;
    if (!gaps_) without_gaps = innovation_autocovariances(fixed_, noises, L, out.lags);
    for (const Recording& r : recordings_) {
      if (r.y.cols() < first + out.lags) continue;
      const VectorXd x0 = likely_start(fixed_, L, r.y, r.u, first);
      const MatrixXd e = constant_gain_innovations(fixed_, L, x0, r.y, r.u);
      const SampleAutocovariances sample =
          sample_autocovariances(e.rightCols(e.cols() - first), out.lags);
      std::vector<Autocovariances> expected = without_gaps;
      for (std::size_t i = 0; gaps_ && i < noises.size(); ++i) {
        expected.push_back(innovation_autocovariances(noises[i], L, e, first, out.lags));
      }
      // Entries without a pair are NaN, with weight zero.
      const auto add = [&](Autocovariances& to, const Autocovariances& from) {
        for (std::size_t k = 0; k < count; ++k) {
          to[k] += (sample.pairs[k].array() > 0.0)
                       .select(from[k].cwiseProduct(sample.pairs[k]), nothing);
        }
      };
      add(sum, sample.value);
      add(constant, expected[0]);
      for (std::size_t i = 0; i < basis_.size(); ++i) add(columns[i], expected[i + 1]);
      for (std::size_t k = 0; k < count; ++k) pairs[k] += sample.pairs[k];
    }
    out.times = full_matrix ? times_in_full_matrix(out.lags, ny)
                            : VectorXd(VectorXd::Ones(stacked(pairs).size()));
    out.pairs = stacked(pairs);
    const VectorXd share = (out.pairs.array() > 0.0).select(out.pairs.cwiseInverse(), 0.0);
    out.sample = stacked(sum).cwiseProduct(share);
    out.constant = stacked(constant).cwiseProduct(share);
    out.design.resize(out.sample.size(), static_cast<Index>(basis_.size()));
    for (std::size_t e = 0; e < basis_.size(); ++e) {
      out.design.col(static_cast<Index>(e)) = stacked(columns[e]).cwiseProduct(share);
    }
    return out;
  }

  // Factor of the covariance of the sample autocovariances, if theta were true.
  Eigen::LLT<MatrixXd> error_factor(const Regression& r, const MatrixXd& L,
                                    const VectorXd& theta) const {
    const MatrixXd F = fixed_.A - L * fixed_.C;
    const Index reach = r.lags + memory(F, 1e-6, 2000);
    const Autocovariances Y = innovation_autocovariances(at(theta), L, reach);
    MatrixXd V = covariance_of_autocovariances(Y, r.lags);
    const VectorXd scale = r.pairs.cwiseMax(1.0).cwiseSqrt().cwiseInverse();
    V.array().colwise() *= scale.array();
    V.array().rowwise() *= scale.transpose().array();
    // Noise-free outputs leave it singular.
    const double largest = V.diagonal().maxCoeff();
    V.diagonal() += 1e-10 * (V.diagonal().array() + largest).matrix();
    return Eigen::LLT<MatrixXd>(V);
  }

 private:
  // The system with the noise of `noise`, which may be a derivative.
  StateSpace with_noise(const StateSpace& noise) const {
    StateSpace out = fixed_;
    out.Q = noise.Q;
    out.R = noise.R;
    out.S = noise.S;
    return out;
  }

  StateSpace written(const VectorXd& theta) const {
    return written_matrices(linear_, with_entries(parameters_, theta));
  }

  const LinearModel& linear_;
  const ParameterSet& parameters_;
  std::vector<StateSpace> basis_;
  MatrixXd joint_fixed_;  // [Q S; S' R] with every free entry at zero
  std::vector<MatrixXd> joint_basis_;
  StateSpace fixed_;  // with every free entry at zero
  std::vector<PsdBlock> blocks_, limits_;
  std::vector<Recording> recordings_;
  bool gaps_ = false;
};

PsdSolution solve(const MatrixXd& design, const VectorXd& target, const Als& als) {
  return minimise(
      {design.transpose() * design, design.transpose() * target, als.blocks(), als.limits()});
}

struct Fit {
  Regression regression;
  MatrixXd L;
  PsdSolution solution;
  std::optional<Eigen::LLT<MatrixXd>> weight;  // inverse of it; none = regression.times
  int passes = 0;

  // Rows such that least squares of them is what the method minimises.
  MatrixXd weighed(const MatrixXd& rows) const {
    if (weight) return weight->matrixL().solve(rows);
    return regression.times.cwiseSqrt().asDiagonal() * rows;
  }
};

// Under one gain. With weights: those of the last estimate, until they change nothing.
Fit fit_under_gain(const Als& als, Regression regression, const MatrixXd& L, bool weighted,
                   const std::optional<VectorXd>& start) {
  constexpr int kMostPasses = 30;
  constexpr double kSettled = 1e-3;  // of a standard error
  Fit out{std::move(regression), L, {}, {}, 0};
  const Regression& r = out.regression;
  const VectorXd target = r.sample - r.constant;
  if (!weighted || !start) {
    out.solution = solve(out.weighed(r.design), out.weighed(target), als);
    out.passes = 1;
    if (!weighted || !out.solution.summary.usable()) return out;
  }
  VectorXd theta = start ? *start : out.solution.x;
  for (bool settled = false; !settled && out.passes < kMostPasses; ++out.passes) {
    out.weight = als.error_factor(r, L, theta);
    const MatrixXd design = out.weighed(r.design);
    out.solution = solve(design, out.weighed(target), als);
    if (!out.solution.summary.usable()) return out;
    // Weighted residuals have unit variance, and so has theta by design' design.
    settled = (design * (out.solution.x - theta)).norm() <= kSettled;
    theta = out.solution.x;
    if (!settled && out.passes + 1 == kMostPasses) {
      out.solution.summary.termination = Termination::no_progress;
      out.solution.summary.message =
          fmt::format("the weights have not settled in {} passes", kMostPasses);
    }
  }
  return out;
}

[[noreturn]] void refuse_gain(const Model& model) {
  throw InputError({model.source, 0, 0}, "the model's Q and R give no stable filter",
                   "a start from which every state is seen by the outputs or decays",
                   "give Q and R a positive start");
}

[[noreturn]] void refuse_short(const std::vector<Dataset>& recordings) {
  throw InputError(
      {recordings[0].name, 0, 0},
      fmt::format("{} samples are no longer than the filter's memory", recordings[0].size()),
      "a longer recording, fewer --lags, or a faster start of Q and R");
}

Fit fit(const Model& model, const Als& als, const std::vector<Dataset>& recordings,
        const NoiseAlsOptions& options) {
  constexpr int kMostGains = 20;
  const auto steady = steady_state(als.at(free_entries(model.parameters)));
  if (!steady) refuse_gain(model);
  MatrixXd L = steady->K;
  const auto regression = [&](const MatrixXd& gain) {
    auto out = als.regression(gain, options.lags, options.full_matrix);
    if (!out) refuse_short(recordings);
    return *out;
  };
  Fit out = fit_under_gain(als, regression(L), L, options.weighted, {});
  for (int pass = 0; options.iterate && pass < kMostGains && out.solution.summary.usable();
       ++pass) {
    const auto next = steady_state(als.at(out.solution.x));
    if (!next) break;  // the present gain stays
    const bool settled = (next->K - L).norm() <= 1e-3 * L.norm();
    if (settled) break;
    L = next->K;
    const int passes = out.passes;
    out = fit_under_gain(als, regression(L), L, options.weighted,
                         options.weighted ? std::optional(out.solution.x) : std::nullopt);
    out.passes += passes;
  }
  return out;
}

// Entries of a block or a bound that the constraint holds at its boundary.
std::vector<bool> at_boundary(const Fit& fit, const Als& als) {
  std::vector<PsdBlock> blocks = als.blocks();
  blocks.insert(blocks.end(), als.limits().begin(), als.limits().end());
  std::vector<bool> out(static_cast<std::size_t>(fit.solution.x.size()), false);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    if (fit.solution.blocks[b].zero_eigenvalues == 0) continue;
    for (const PsdBlock::Entry& e : blocks[b].entries) {
      out[e.unknown] = true;
    }
  }
  return out;
}

// S with theta - truth = S n, n of unit covariance, for the columns of `design`; error: factor of
// the sample autocovariances' covariance.
MatrixXd map_of_errors(const Fit& fit, const Eigen::LLT<MatrixXd>& error, const MatrixXd& design) {
  const MatrixXd map = fit.weighed(design).completeOrthogonalDecomposition().pseudoInverse();
  const MatrixXd of_sample =
      fit.weight ? MatrixXd(fit.weight->matrixU().solve(map.transpose()).transpose())
                 : MatrixXd(map * fit.regression.times.cwiseSqrt().asDiagonal());
  return of_sample * error.matrixL();
}

// A variance that is held at zero has an upper limit: what its error would be without the
// constraint, one-sided 95 %.
void report_boundary(Estimate& estimate, const Fit& fit, const Eigen::LLT<MatrixXd>& error) {
  constexpr double kOneSided = 1.6448536269514722;
  VectorXd se;  // without the constraint
  Index i = -1;
  for (EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    ++i;
    if (p.verdict != Verdict::at_bound) continue;
    if (fit.solution.x[i] != 0.0) continue;
    if (se.size() == 0) {
      se = map_of_errors(fit, error, fit.regression.design).rowwise().norm();
    }
    p.ci95 = {0.0, kOneSided * se[i] / unit_scale(p.unit)};
  }
}

// Parameters at the boundary. @param estimate  with the limits of report_boundary()
Findings check_boundary(const Estimate& estimate, const Fit& fit) {
  Findings out;
  Index i = -1;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    ++i;
    if (p.verdict != Verdict::at_bound) continue;
    const bool lower = p.value == p.bounds[0], upper = p.value == p.bounds[1];
    if (fit.solution.x[i] != 0.0 && (lower || upper)) {
      out.push_back({FindingCode::at_bound,
                     Severity::warning,
                     {p.name},
                     fmt::format("{} ended at its {} bound {:.6g}", p.name,
                                 lower ? "lower" : "upper", p.value),
                     "widen the bound in the model file if it is not physical"});
      continue;
    }
    out.push_back(make_finding(
        FindingCode::at_bound, {p.name},
        fit.solution.x[i] == 0.0
            ? fmt::format("{} is not distinguishable from 0, upper bound {:.4g} (95 %)", p.name,
                          p.ci95[1])
            : p.name + " is held at the boundary of definiteness"));
  }
  return out;
}

void judge(Estimate& estimate, const Als& als, const Fit& fit, const Model& model,
           const std::vector<Dataset>& recordings) {
  const InteriorParameters inside = interior_parameters(estimate, at_boundary(fit, als));
  const Regression& r = fit.regression;
  const Eigen::LLT<MatrixXd> error = als.error_factor(r, fit.L, fit.solution.x);
  report_boundary(estimate, fit, error);
  append(estimate.findings, check_boundary(estimate, fit));
  const auto k = static_cast<Index>(inside.entries.size());
  if (k == 0) return;
  const VectorXd& unit = inside.unit;
  const MatrixXd design = r.design(Eigen::all, inside.entries) * unit.asDiagonal();
  const MatrixXd whitened = error.matrixL().solve(design);
  const MatrixXd spread = map_of_errors(fit, error, design);
  estimate.covariance_kind = "covariance of the sample autocovariances at the estimate";
  judge_parameters(estimate, whitened.transpose() * whitened, spread * spread.transpose());

  Index samples = 0;
  for (const Dataset& data : recordings) samples += data.size();
  const StateSpace system = als.at(fit.solution.x);
  std::vector<StateSpace> derivatives;
  for (const Index e : inside.entries) {
    derivatives.push_back(als.basis()[e]);
  }
  // Inputs tell nothing about noise.
  const ExpectedInformation bound =
      expected_information(system, as_linear(model).initial, samples, derivatives, MatrixXd());
  if (bound.status != FilterStatus::ok) return;
  const auto covariance = scaled_inverse(unit.asDiagonal() * bound.total * unit.asDiagonal(), 1e-9);
  for (Index j = 0; j < k && covariance; ++j) {
    inside.reported[j]->crb_se = std::sqrt((*covariance)(j, j));
  }
}

// The fewest sources of process noise instead of the minimum over all Q. They are judged under the
// weights of als-weighted whatever the method: without, nothing says what is chance.
void reduce_rank(NoiseEstimate& estimate, const Als& als, Fit& fit) {
  const Regression& r = fit.regression;
  const VectorXd target = r.sample - r.constant;
  const Eigen::LLT<MatrixXd> error = als.error_factor(r, fit.L, fit.solution.x);
  const auto W = error.matrixL();
  const MinimumRank found = minimum_rank({{fit.weighed(r.design), fit.weighed(target)},
                                          {W.solve(r.design), W.solve(target)},
                                          als.joint_fixed(),
                                          als.joint_basis(),
                                          als.process_noises(),
                                          als.limits()});
  estimate.minimum_rank = found.report;
  fit.solution.x = found.theta;
  std::vector<PsdBlock> blocks = als.blocks();
  blocks.insert(blocks.end(), als.limits().begin(), als.limits().end());
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    constexpr double kZero = 1e-9;
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(value(blocks[b], found.theta),
                                                        Eigen::EigenvaluesOnly);
    fit.solution.blocks[b].zero_eigenvalues =
        (eigen.eigenvalues().array() <= kZero * eigen.eigenvalues().maxCoeff()).count();
  }
}

}  // namespace

namespace {

void check_model_for_als(const Model& model, Index lags) {
  refuse_constraints(model, "als");
  if (const auto priors = names_with_priors(model.parameters); !priors.empty()) {
    throw InputError({model.source, 0, 0},
                     fmt::format("als has no place for the prior of '{}'", priors[0]), "no prior",
                     "--method ml or bayes, which honour it, or remove it from the model file");
  }
  if (lags < 0) throw std::invalid_argument(fmt::format("lags is {}; expected 0 or more", lags));
  if (!is_linear_in_parameters(as_linear(model), model.parameters)) {
    throw InputError({model.source, 0, 0}, "als is linear in what it seeks, and the model is not",
                     "Q, R and S that are sums of multiples of parameters",
                     "variances instead of standard deviations, or --method ml");
  }
  const std::vector<StateSpace> basis = model_derivatives(as_linear(model), model.parameters);
  if (!std::all_of(basis.begin(), basis.end(), changes_only_noise)) {
    throw InputError({model.source, 0, 0}, "als estimates noise, and other parameters are free",
                     "free entries of Q, R and S only", "fix the others, or use --method ml");
  }
  const Index ny = as_linear(model).C.constant.rows(), rows = std::max(lags, kFewestLags) * ny * ny;
  if (rows > kMostRowsAsked) {
    throw InputError({model.source, 0, 0},
                     fmt::format("{} autocovariances of {} outputs are {} numbers to weigh",
                                 std::max(lags, kFewestLags), ny, rows),
                     fmt::format("no more than {}", kMostRowsAsked),
                     "fewer --lags, or --method ml");
  }
}

}  // namespace

NoiseEstimate tune_als(const Model& given, const std::vector<Dataset>& recordings,
                       const NoiseAlsOptions& options) {
  const Model model = checked(given, recordings);
  check_recordings(model, recordings);
  check_model_for_als(model, options.lags);
  const Als als(model, recordings);
  Fit found = fit(model, als, recordings, options);
  NoiseEstimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = options.weighted ? "als-weighted" : "als";
  estimate.objective.iterations = found.passes;
  if (options.min_rank && found.solution.summary.usable()) reduce_rank(estimate, als, found);
  const ParameterSet end = with_entries(model.parameters, found.solution.x);
  list_parameters(estimate, model.parameters, end);
  judge(estimate, als, found, model, recordings);
  estimate.notes.push_back(fmt::format("{} autocovariances of the innovations under the gain of {}",
                                       found.regression.lags,
                                       options.iterate ? "the estimate" : "the start"));
  if (!found.solution.summary.usable()) withdraw_errors(estimate);
  append(estimate.findings, check_search(estimate, found.solution.summary));
  report_noise_estimate(estimate, model, end, recordings);
  conclude(estimate, "converged");
  return estimate;
}

VectorXd unconstrained_als(const Model& given, const std::vector<Dataset>& recordings, Index lags) {
  const Model model = checked(given, recordings);
  check_recordings(model, recordings);
  check_model_for_als(model, lags);
  const Als als(model, recordings);
  const auto steady = steady_state(als.at(free_entries(model.parameters)));
  if (!steady) refuse_gain(model);
  const auto regression = als.regression(steady->K, lags, false);
  if (!regression) refuse_short(recordings);
  return regression->design.completeOrthogonalDecomposition().solve(regression->sample -
                                                                    regression->constant);
}

}  // namespace identikal
