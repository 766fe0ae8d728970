#include "identify/optimality/score_statistic.h"

#include <algorithm>
#include <set>
#include <stdexcept>

#include <Eigen/Eigenvalues>

#include "identify/estimate/estimate.h"
#include "identify/filter/recordings_likelihood.h"
#include "lib/filter/steady_state.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kFewSteps = 10;

void make_free(Model& model, ParametrisedMatrix& matrix, const char* name, const MatrixXd& value) {
  if (value.size() == 0) return;
  Parameter p;
  p.name = name;
  p.domain = Domain::positive_definite;
  p.value = value;
  matrix = {};
  matrix.block = static_cast<int>(model.parameters.size());
  model.parameters.push_back(p);
}

double predicted_loss(const StateSpace& present, const StateSpace& better) {
  const auto now = steady_state(present), best = steady_state(better);
  if (!now || !best) return kNone;
  const MatrixXd& K = now->K;
  const MatrixXd F = better.A - K * better.C, cross = better.G * better.S * K.transpose();
  const auto P =
      solve_discrete_lyapunov(F, better.G * better.Q * better.G.transpose() +
                                     K * better.R * K.transpose() - cross - cross.transpose());
  if (!P || !(best->P.trace() > 0.0)) return kNone;
  return std::max(0.0, P->trace() / best->P.trace() - 1.0);
}

}  // namespace

Model with_free_noise(const Model& model) {
  std::set<int> noise;
  const LinearModel& given = noise_model(model);
  for (const ParametrisedMatrix* matrix : {&given.Q, &given.R, &given.S}) {
    for (const int p : parameters_in(*matrix)) noise.insert(p);
  }
  Model out = model;
  bool any = false;
  for (std::size_t i = 0; i < out.parameters.size(); ++i) {
    Parameter& p = out.parameters[i];
    p.fixed = p.fixed || noise.count(static_cast<int>(i)) == 0;
    any = any || !p.fixed;
  }
  if (any) return out;
  const StateSpace written = written_matrices(given, model.parameters);
  make_free(out, noise_model(out).Q, "Q", written.Q);
  make_free(out, noise_model(out).R, "R", written.R);
  return out;
}

namespace {

ScoreStatistic score_of(const Model& model, RecordingsLikelihood& likelihood) {
  ScoreStatistic out;
  const ReportedEntries entries = reported_entries(model.parameters);
  std::vector<double> values;
  for (std::size_t i = 0; i < entries.names.size(); ++i) {
    if (model.parameters[entries.parameter[i]].fixed) continue;
    out.names.push_back(entries.names[i]);
    values.push_back(entries.value[i]);
  }
  const auto k = static_cast<Index>(values.size());
  if (k == 0) throw std::invalid_argument("score_statistic: nothing is free");
  out.value = Eigen::Map<const VectorXd>(values.data(), k);
  const Likelihood* at = likelihood.evaluate(model.parameters, true);
  if (at == nullptr) {
    out.status = likelihood.status_at_start();
    return out;
  }
  const VectorXd scale = at->information.diagonal().cwiseSqrt();
  const VectorXd inverse = (scale.array() > 0.0).select(scale.cwiseInverse(), 0.0);
  out.direction = at->gradient.cwiseProduct(inverse);
  const MatrixXd scaled = inverse.asDiagonal() * at->information * inverse.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled);
  const double least = kFlat * eigen.eigenvalues().cwiseAbs().maxCoeff();
  VectorXd step = VectorXd::Zero(k), variance = step, flat = step;
  for (Index i = 0; i < k; ++i) {
    const VectorXd v = eigen.eigenvectors().col(i);
    if (!(eigen.eigenvalues()[i] > least)) {
      flat = flat.cwiseMax(v.cwiseAbs());
      continue;
    }
    const double along = v.dot(out.direction), information = eigen.eigenvalues()[i];
    out.statistic.value += along * along / information;
    out.statistic.dof += 1.0;
    step += v * (along / information);
    variance += v.cwiseAbs2() / information;
  }
  out.step = step.cwiseProduct(inverse);
  out.step_se = (flat.array() > 1e-3).select(kNone, variance.cwiseSqrt().cwiseProduct(inverse));
  return out;
}

Retuned retuned_by(const Model& model, RecordingsLikelihood& likelihood) {
  Retuned out;
  const LikelihoodProblem problem = likelihood.problem();
  // A value outside its bounds is the file's own; scoring begins at the nearest inside.
  const VectorXd start =
      coordinates(model.parameters).cwiseMax(problem.lower).cwiseMin(problem.upper);
  SolverOptions options;
  options.max_iterations = kFewSteps;
  const Solution solution = maximise(problem, start, options);
  if (solution.summary.termination == Termination::start_undefined) {
    return {model.parameters, kNone, kNone};
  }
  out.parameters = with_coordinates(model.parameters, solution.x);
  out.gain = solution.summary.objective - solution.summary.initial_objective;
  if (is_formula_model(model)) {
    out.loss = kNone;
    return out;
  }
  out.loss = predicted_loss(instantiate(as_linear(model), model.parameters),
                            instantiate(as_linear(model), out.parameters));
  return out;
}

}  // namespace

ScoreStatistic score_statistic(const Model& model, const std::vector<Dataset>& recordings) {
  RecordingsLikelihood likelihood(model, recordings);
  return score_of(model, likelihood);
}

ScoreStatistic score_statistic(const Model& model, const std::vector<RecordingDigest>& digests) {
  RecordingsLikelihood likelihood(model, digests);
  return score_of(model, likelihood);
}

Retuned retuned(const Model& model, const std::vector<Dataset>& recordings) {
  RecordingsLikelihood likelihood(model, recordings);
  return retuned_by(model, likelihood);
}

Retuned retuned(const Model& model, const std::vector<RecordingDigest>& digests) {
  RecordingsLikelihood likelihood(model, digests);
  return retuned_by(model, likelihood);
}

}  // namespace identikal
