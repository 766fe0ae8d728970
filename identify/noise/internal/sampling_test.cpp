#include "identify/noise/internal/sampling_test.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/filter/recordings_likelihood.h"
#include "lib/data/units.h"
#include "lib/filter/likelihood.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd beside(const MatrixXd& left, const MatrixXd& right) {
  MatrixXd out(left.rows(), left.cols() + right.cols());
  out << left, right;
  return out;
}

MatrixXd diagonal_blocks(const MatrixXd& first, const MatrixXd& second) {
  MatrixXd out = MatrixXd::Zero(first.rows() + second.rows(), first.cols() + second.cols());
  out.topLeftCorner(first.rows(), first.cols()) = first;
  out.bottomRightCorner(second.rows(), second.cols()) = second;
  return out;
}

// `so_far` steps over some samples, `one` over one more; y is that of the first.
StateSpace one_more(const StateSpace& so_far, const StateSpace& one) {
  StateSpace out = so_far;
  out.A = one.A * so_far.A;
  out.B = beside(one.A * so_far.B, one.B);
  out.G = beside(one.A * so_far.G, one.G);
  out.D = beside(so_far.D, MatrixXd::Zero(one.D.rows(), one.D.cols()));
  out.Q = diagonal_blocks(so_far.Q, one.Q);
  out.S = MatrixXd::Zero(so_far.S.rows() + one.S.rows(), one.S.cols());
  out.S.topRows(so_far.S.rows()) = so_far.S;
  out.dt = so_far.dt + one.dt;
  return out;
}

// The derivative of one_more().
StateSpace one_more(const StateSpace& so_far, const StateSpace& d_so_far, const StateSpace& one,
                    const StateSpace& d_one) {
  StateSpace out = one_more(d_so_far, d_one);
  out.A = d_one.A * so_far.A + one.A * d_so_far.A;
  out.B = beside(d_one.A * so_far.B + one.A * d_so_far.B, d_one.B);
  out.G = beside(d_one.A * so_far.G + one.A * d_so_far.G, d_one.G);
  return out;
}

struct Thinned {
  std::vector<MatrixXd> y, u;
};

// Every m-th sample, and the inputs of all that follow it until the next.
Thinned every_mth(const Model& model, const std::vector<Dataset>& recordings, Index every) {
  Thinned out;
  for (const Dataset& data : recordings) {
    const MatrixXd u = model_inputs(as_linear(model), data.u);
    const Index count = (data.size() + every - 1) / every;
    MatrixXd y(data.y.rows(), count), all = MatrixXd::Zero(u.rows() * every, count);
    for (Index t = 0; t < count; ++t) {
      y.col(t) = data.y.col(t * every);
      for (Index k = 0; k < every; ++k) {
        const Index at = std::min(t * every + k, data.size() - 1);
        all.block(k * u.rows(), t, u.rows(), 1) = u.col(at);
      }
    }
    out.y.push_back(y);
    out.u.push_back(all);
  }
  return out;
}

struct Score {
  VectorXd gradient;
  MatrixXd information;
};

std::optional<Score> score_of(const Likelihood* at, const std::vector<Index>& entries) {
  if (at == nullptr || at->status != FilterStatus::ok) return std::nullopt;
  Score out{at->gradient(entries), at->information(entries, entries)};
  if (!out.gradient.allFinite() || !out.information.allFinite()) return std::nullopt;
  return out;
}

// Does every state move the outputs that follow it? Of a season, fewer of its samples may not tell.
bool is_observable(const StateSpace& model) {
  constexpr double kRank = 1e-12;
  const Index n = model.states(), ny = model.outputs();
  MatrixXd seen(n * ny, n);
  MatrixXd response = model.C;
  for (Index t = 0; t < n; ++t) {
    seen.middleRows(t * ny, ny) = response;
    response = (response * model.A).eval();
  }
  const VectorXd size = seen.colwise().norm();
  if (!seen.allFinite() || !(size.minCoeff() > 0.0)) return false;
  Eigen::ColPivHouseholderQR<MatrixXd> qr(seen * size.cwiseInverse().asDiagonal());
  qr.setThreshold(kRank);
  return qr.rank() == n;
}

std::optional<Score> thinned_score(const Model& model, const ParameterSet& at,
                                   const std::vector<Dataset>& recordings,
                                   const std::vector<Index>& entries, int every) {
  const LinearModel& linear = as_linear(model);
  const StateSpace one = instantiate(linear, at);
  const std::vector<StateSpace> by_one = model_derivatives(linear, at);
  StateSpace system = one;
  std::vector<StateSpace> by = by_one;
  for (int m = 1; m < every; ++m) {
    for (std::size_t i = 0; i < by.size(); ++i) by[i] = one_more(system, by[i], one, by_one[i]);
    system = one_more(system, one);
  }
  if (linear.initial == InitialState::diffuse && !is_observable(system)) return std::nullopt;
  const Thinned data = every_mth(model, recordings, every);
  LikelihoodEngine engine;
  for (std::size_t r = 0; r < data.y.size(); ++r) engine.add_recording(data.y[r], data.u[r]);
  return score_of(&engine.evaluate(system, linear.initial, by), entries);
}

struct Interval {
  int every;
  const char* name;
};
constexpr Interval kIntervals[] = {{2, "second"}, {3, "third"}, {5, "fifth"}};

// What one interval says against an estimate.
struct Contradiction {
  const char* interval = "";
  double p = 1.0;
  double share = 0.0;    // by which the value of an entry would change
  double instead = 0.0;  // what it would be
  Index entry = 0;
};

// Two intervals together, or one beyond doubt: the statistic's tail is longer than chi-square's.
// Chosen on simulated recordings (tests/campaigns): of faultless ones 1 % are refused by this.
// @param found  the smallest p first
bool contradicts(const std::vector<Contradiction>& found) {
  constexpr double kTogether = 0.03, kAlone = 1e-5, kOnly = 1e-4, kShare = 0.05;
  if (found.empty()) return false;
  const auto against = [&](std::size_t i, double level) {
    return i < found.size() && found[i].p < level && found[i].share > kShare;
  };
  if (found.size() == 1) return against(0, kOnly);
  return against(0, kAlone) || (against(0, kTogether) && against(1, kTogether));
}

// Else chi-square is far off: a diffuse start takes its part.
bool enough_samples(const Model& model, const std::vector<Dataset>& recordings, int every) {
  const Index fewest = 60 + 5 * as_linear(model).A.constant.rows();
  return std::all_of(recordings.begin(), recordings.end(),
                     [&](const Dataset& data) { return data.size() / every >= fewest; });
}

// Parameters that have an error, and their free entries.
struct Inside {
  std::vector<Index> entries;
  std::vector<const EstimatedParameter*> parameters;
};

Inside inside_bounds(const Estimate& estimate) {
  Inside out;
  Index i = 0;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    if (p.verdict != Verdict::at_bound && std::isfinite(p.se)) {
      out.entries.push_back(i);
      out.parameters.push_back(&p);
    }
    ++i;
  }
  return out;
}

// Of all samples.
std::optional<Score> whole_score(const Model& model, const ParameterSet& at,
                                 const std::vector<Dataset>& recordings,
                                 const std::vector<Index>& entries) {
  RecordingsLikelihood likelihood(model, recordings);
  likelihood.condition_on_beginning();
  return score_of(likelihood.evaluate(at, true), entries);
}

SamplingTest test_against(const std::optional<Score>& all, const std::optional<Score>& some) {
  constexpr double kLeft = 0.02;  // of the information: less makes no test
  constexpr double kNear = 1.0;   // squared standard errors: further off nothing is linear
  SamplingTest out;
  if (!all || !some) return out;
  const Eigen::LLT<MatrixXd> of_all(all->information), of_some(some->information);
  if (of_all.info() != Eigen::Success || of_some.info() != Eigen::Success) return out;
  if (all->gradient.dot(of_all.solve(all->gradient)) > kNear) return out;
  // In coordinates where I_m is the identity, the score's covariance is 1 - L' I^-1 L.
  const MatrixXd L = of_some.matrixL();
  const VectorXd g = some->gradient - some->information * of_all.solve(all->gradient);
  const VectorXd white = L.triangularView<Eigen::Lower>().solve(g);
  const MatrixXd lost = MatrixXd::Identity(L.rows(), L.cols()) - L.transpose() * of_all.solve(L);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(lost);
  const VectorXd along = axes.eigenvectors().transpose() * white;
  for (Index i = 0; i < along.size(); ++i) {
    if (axes.eigenvalues()[i] < kLeft) continue;
    out.value += along[i] * along[i] / axes.eigenvalues()[i];
    ++out.dof;
  }
  out.shift = of_some.solve(g);
  return out;
}

}  // namespace

SamplingTest sampling_test(const Model& model, const ParameterSet& at,
                           const std::vector<Dataset>& recordings,
                           const std::vector<Index>& entries, int every) {
  return test_against(whole_score(model, at, recordings, entries),
                      thinned_score(model, at, recordings, entries, every));
}

Findings check_sampling(const Estimate& estimate, const Model& model, const ParameterSet& end,
                        const std::vector<Dataset>& recordings) {
  // An input may answer to outputs between the samples that are taken: nothing is known of it.
  if (!is_linear(model) || !model.inputs.empty()) return {};
  const Inside inside = inside_bounds(estimate);
  if (inside.entries.empty()) return {};
  const VectorXd value = free_entries(end)(inside.entries);
  std::vector<Contradiction> found;
  std::optional<Score> all;
  for (const Interval& interval : kIntervals) {
    if (!enough_samples(model, recordings, interval.every)) continue;
    if (!all) all = whole_score(model, end, recordings, inside.entries);
    const SamplingTest test =
        test_against(all, thinned_score(model, end, recordings, inside.entries, interval.every));
    if (test.dof == 0) continue;
    Contradiction each;
    each.interval = interval.name;
    each.p = chi_square_upper_tail(test.value, test.dof);
    each.share = (test.shift.array() / value.array()).abs().maxCoeff(&each.entry);
    each.instead = value[each.entry] + test.shift[each.entry];
    found.push_back(each);
  }
  std::sort(found.begin(), found.end(),
            [](const Contradiction& a, const Contradiction& b) { return a.p < b.p; });
  if (!contradicts(found)) return {};
  const Contradiction& worst = found.front();
  const EstimatedParameter& p = *inside.parameters[static_cast<std::size_t>(worst.entry)];
  const double instead = unit_or_dimensionless(p.unit).from_si(worst.instead);
  return {make_finding(
      FindingCode::depends_on_sampling, {p.name},
      fmt::format("every {} sample alone asks for other values (p = {:.2g}), first of all for a {} "
                  "of {:.3g} instead of {:.3g}: the model does not say how the outputs move from "
                  "sample to sample",
                  worst.interval, worst.p, p.name, std::max(p.bounds[0], instead), p.value),
      "a missing state, coloured noise, a wrong pole or period: free what is known least, or let "
      "'identikal shape' look for a colour")};
}

}  // namespace identikal
