#include "identify/shooting/internal/attempt.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFreest = 1.0, kStiffest = 1e-8;   // freedom of the states
constexpr double kTightened = 0.31622776601683794;  // from stage to stage
constexpr double kLoosened = 1e3;  // once, where steps of the integration become exact
constexpr int kStageIterations = 25, kSearchIterations = 60, kGrids = 5;
constexpr int kPolished = 1000;
constexpr double kPolishSettled = 1e-12;
constexpr double kStageSettled = 1e-3, kSearchSettled = 1e-6;  // reductions that none goes on for
constexpr double kLost = 0.9;  // of what outputs scatter by: such errors of a trajectory
constexpr double kFollows =
    1.1;  // a simulation does as well with this many times a stage's squares
constexpr double kFinest =
    1e-3;  // of what an output scatters by: errors below do not count as less
constexpr double kCoarse = 1e-3, kFine = 1e-4, kExact = 1e-9;  // integration, of a state's scale
constexpr double kSettledLoss = 0.05;
constexpr std::size_t kTried = 8;     // candidates that a short search is begun at
constexpr int kTriedIterations = 4;   // of it
constexpr double kSameErrors = 5e-3;  // relative: what integration may change
constexpr double kSamePlace = 1e-3;   // relative

VectorXd deviations(const MatrixXd& values) {
  const VectorXd mean = values.rowwise().mean();
  return ((values.colwise() - mean).rowwise().squaredNorm() / double(values.cols())).cwiseSqrt();
}

// What every output scatters by, in all recordings.
VectorXd output_deviations(const std::vector<Dataset>& recordings) {
  VectorXd out = VectorXd::Ones(recordings[0].y.rows());
  for (Index i = 0; i < out.size(); ++i) {
    double n = 0.0, mean = 0.0, squares = 0.0;
    for (const Dataset& data : recordings) {
      for (Index k = 0; k < data.size(); ++k) {
        const double y = data.y(i, k);
        if (std::isnan(y)) continue;
        const double before = y - mean;
        mean += before / ++n;
        squares += before * (y - mean);
      }
    }
    if (squares > 0.0) out[i] = std::sqrt(squares / n);
  }
  return out;
}

// By how much a sample lies off the line through its neighbours, if that is white noise.
VectorXd roughness(const std::vector<Dataset>& recordings) {
  const Index ny = recordings[0].y.rows();
  VectorXd squares = VectorXd::Zero(ny), counts = VectorXd::Zero(ny);
  for (const Dataset& data : recordings) {
    for (Index k = 1; k + 1 < data.size(); ++k) {
      for (Index i = 0; i < ny; ++i) {
        const double d = data.y(i, k - 1) - 2.0 * data.y(i, k) + data.y(i, k + 1);
        if (std::isnan(d)) continue;
        squares[i] += d * d / 6.0;
        counts[i] += 1.0;
      }
    }
  }
  return (squares.array() / counts.array().max(1.0)).sqrt();
}

// What states scatter by; of one at rest, a part of its size.
VectorXd scale_of(const MatrixXd& states) {
  const VectorXd size = states.cwiseAbs().rowwise().maxCoeff();
  const VectorXd out = deviations(states).cwiseMax(1e-3 * size);
  return (out.array() > 0.0 && out.array().isFinite()).select(out, 1.0);
}

}  // namespace

Attempt::Attempt(const Model& model, const std::vector<Dataset>& recordings,
                 const std::vector<ParameterSet>& candidates)
    : model_(model),
      recordings_(recordings),
      known_(known_output_sd(model)),
      problem_(model, recordings),
      parameters_(candidates.front()),
      deviation_(output_deviations(recordings)),
      finest_(roughness(recordings).cwiseMax(kFinest * deviation_)) {
  problem_.take_logarithms();
  for (const ParameterSet& set : candidates) candidates_.push_back(problem_.values_in(set));
  p_ = candidates_.front();
  for (const Dataset& data : recordings) {
    values_ += static_cast<double>((data.y.array() == data.y.array()).count());
  }
}

double Attempt::loss_of(const VectorXd& squares, const VectorXd& counts) const {
  const VectorXd mean = squares.array() / counts.array().max(1.0);
  const VectorXd least = (1e-8 * deviation_).array().square();
  const double out = (0.5 * counts.array() * mean.cwiseMax(least).array().log()).sum();
  return std::isnan(out) ? kInfinity : out;
}

double Attempt::worse_than(double loss) const { return std::exp((loss_ - loss) / values_); }

double Attempt::relative(const VectorXd& squares, const VectorXd& counts) const {
  return std::sqrt((squares.array() / deviation_.array().square()).sum() /
                   std::max(1.0, counts.sum()));
}

void Attempt::weigh_outputs(const VectorXd& otherwise) {
  problem_.output_sd = known_.size() > 0 ? known_ : otherwise;
}

void Attempt::solve_and_count(const ChainedLeastSquares& problem, ChainedSolution& at,
                              int iterations, double tolerance) {
  SolverOptions options;
  options.max_iterations = iterations;
  options.function_tolerance = tolerance;
  at = solve(problem, at.states, at.shared, options);
  iterations_ += at.summary.iterations;
  evaluations_ += at.summary.evaluations;
}

// As the motion from the first candidate needs them, where it has one.
MatrixXd Attempt::choose_first_steps() {
  const VectorXd& p = candidates_.front();
  MatrixXd states;
  if (!problem_.simulate(p, states)) {
    states = problem_.states_at_start(p);
    const VectorXd size = states.col(0).cwiseAbs();
    problem_.choose_steps(p, states, (size.array() > 0.0).select(size, 1.0), kCoarse);
  }
  if (problem_.simulate(p, states)) {
    problem_.choose_steps(p, states, scale_of(states), kCoarse);
  } else {
    states = problem_.states_at_start(p);
  }
  return states;
}

void Attempt::search_from_candidates() {
  choose_first_steps();
  std::vector<std::pair<double, const VectorXd*>> by_error;
  MatrixXd states;
  VectorXd squares, counts;
  for (const VectorXd& p : candidates_) {
    ++evaluations_;
    if (!problem_.simulate(p, states)) continue;
    problem_.output_errors(p, states, squares, counts);
    by_error.emplace_back(relative(squares, counts), &p);
  }
  std::stable_sort(by_error.begin(), by_error.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  if (by_error.size() > kTried) by_error.resize(kTried);
  std::vector<SimulatedEnd> ends;
  for (const auto& [error, p] : by_error) ends.push_back({*p, error, false, {}});
  SimulatedEnd lowest = best_of(std::move(ends));
  if (lowest.p.size() > 0) {
    weigh_outputs(deviation_);
    lowest = search_simulation(lowest.p, kCoarse, kSearchIterations);
  }
  take(lowest, {});
}

// A few steps from each, again and again from the better half, until one is left.
Attempt::SimulatedEnd Attempt::best_of(std::vector<SimulatedEnd> ends) {
  while (ends.size() > 1) {
    for (SimulatedEnd& end : ends) {
      weigh_outputs(deviation_);
      end = search_simulation(end.p, kCoarse, kTriedIterations);
    }
    std::stable_sort(ends.begin(), ends.end(),
                     [](const auto& a, const auto& b) { return a.loss < b.loss; });
    ends.resize((ends.size() + 1) / 2);
    std::erase_if(ends, [](const SimulatedEnd& end) { return end.p.size() == 0; });
  }
  return ends.empty() ? SimulatedEnd{} : std::move(ends.front());
}

// Least squares on the grid that its start needs.
Attempt::SimulatedEnd Attempt::search_simulation(const VectorXd& start, double tolerance,
                                                 int iterations) {
  SimulatedEnd out;
  MatrixXd states;
  if (!problem_.simulate(start, states)) return out;
  problem_.choose_steps(start, states, scale_of(states), tolerance);
  ChainedSolution at;
  at.states.resize(0, problem_.recordings());
  at.shared = start;
  solve_and_count(problem_.simulation_problem(), at, iterations, kSearchSettled);
  if (at.summary.termination == Termination::start_undefined) return out;
  if (!problem_.simulate(at.shared, states)) return out;
  VectorXd squares, counts;
  problem_.output_errors(at.shared, states, squares, counts);
  const double loss = known_.size() > 0 ? at.summary.objective : loss_of(squares, counts);
  out = {at.shared, loss, at.summary.termination != Termination::iteration_limit,
         at.root_information};
  weigh_outputs((squares.array() / counts.array().max(1.0)).sqrt().max(1e-6 * deviation_.array()));
  return out;
}

void Attempt::refine() {
  if (refined_) return;
  for (int grid = 0; grid < kGrids && std::isfinite(loss_); ++grid) {
    const double before = loss_;
    const SimulatedEnd found = search_simulation(p_, kFine, kSearchIterations);
    if (!std::isfinite(found.loss)) return;
    // On a finer grid the same place may be worth less.
    loss_ = kInfinity;
    take(found, std::move(stages_));
    if (converged_ && std::abs(before - loss_) < kSettledLoss) break;
  }
  if (known_.size() > 0 && std::isfinite(loss_)) polish();
  refined_ = true;
}

// By the numbers themselves, on exact steps: the last of a valley that leads to a bound, which is
// no end by logarithms.
void Attempt::polish() {
  TrajectoryProblem plain(model_, recordings_);
  plain.output_sd = known_;
  VectorXd p = plain.values_in(problem_.with_values(parameters_, p_));
  MatrixXd states;
  if (!plain.simulate(p, states)) return;
  plain.choose_steps(p, states, scale_of(states), kExact);
  ChainedSolution at;
  at.states.resize(0, plain.recordings());
  at.shared = p;
  solve_and_count(plain.simulation_problem(), at, kPolished, kPolishSettled);
  if (at.summary.termination == Termination::start_undefined) return;
  if (!(at.summary.objective < loss_)) return;
  p_ = problem_.values_in(plain.with_values(parameters_, at.shared));
  loss_ = at.summary.objective;
  converged_ = at.summary.termination != Termination::iteration_limit;
}

void Attempt::take(const SimulatedEnd& found, std::vector<ShootingStage> stages) {
  if (!(found.loss < loss_)) return;
  p_ = found.p;
  loss_ = found.loss;
  converged_ = found.converged;
  root_information_ = found.root_information;
  stages_ = std::move(stages);
  refined_ = false;
}

void Attempt::begin_path() {
  const VectorXd& p = candidates_.front();
  MatrixXd states = choose_first_steps();
  scale_ = scale_of(states);
  freedom_ = kFreest;
  tolerance_ = kCoarse;
  problem_.output_sd = finest_;
  // The filter's states, once their range is known.
  for (int pass = 0; pass < 2; ++pass) {
    problem_.step_sd = freedom_ / std::sqrt(double(problem_.samples())) * scale_;
    states = problem_.filtered_states(p, scale_);
    scale_ = scale_of(states);
    problem_.choose_steps(p, states, scale_, kCoarse);
  }
  trajectory_.states = states;
  trajectory_.shared = p;
  path_.clear();
}

bool Attempt::next_stage() {
  problem_.step_sd = freedom_ / std::sqrt(double(problem_.samples())) * scale_;
  solve_and_count(problem_.problem(), trajectory_, kStageIterations, kStageSettled);
  if (trajectory_.summary.termination == Termination::start_undefined) return false;
  const VectorXd& p = trajectory_.shared;
  VectorXd squares, counts;
  problem_.output_errors(p, trajectory_.states, squares, counts);
  path_.push_back({freedom_, relative(squares, counts), kInfinity});
  const double allowed = kFollows * 2.0 * trajectory_.summary.objective;
  if (simulation_follows(allowed)) {
    if (tolerance_ == kExact) return false;
    // Where errors of the integration grow along the recording, the path goes on without them.
    tolerance_ = kExact;
    problem_.choose_steps(p, trajectory_.states, scale_, tolerance_);
    if (simulation_follows(allowed)) return false;
    freedom_ *= kLoosened;
  }
  problem_.output_sd = (squares.array() / counts.array().max(1.0)).sqrt().max(finest_.array());
  scale_ = scale_of(trajectory_.states);
  problem_.choose_steps(p, trajectory_.states, scale_, tolerance_);
  freedom_ *= kTightened;
  // A trajectory that no longer follows what was measured leads nowhere.
  return freedom_ > kStiffest && path_.back().rms < kLost;
}

// Does a simulation with these parameters do as well as the stage?
bool Attempt::simulation_follows(double allowed) {
  MatrixXd simulated;
  if (!problem_.simulate(trajectory_.shared, simulated)) return false;
  VectorXd errors, counts;
  problem_.output_errors(trajectory_.shared, simulated, errors, counts);
  path_.back().simulated = relative(errors, counts);
  return (errors.array() / problem_.output_sd.array().square()).sum() <= allowed;
}

void Attempt::search_from_path() {
  if (path_.empty()) return;
  weigh_outputs(deviation_);
  const double before = loss_;
  const SimulatedEnd found = search_simulation(trajectory_.shared, tolerance_, kSearchIterations);
  confirmed_ = std::abs(found.loss - before) < kSettledLoss;
  take(found, path_);
  if (loss_ < before) refined_ = tolerance_ == kExact;
}

bool Attempt::is_below(const Attempt& other) const { return loss_ < other.loss_ - kSettledLoss; }

bool Attempt::meets(const Attempt& other) const {
  if (!std::isfinite(loss_) || !std::isfinite(other.loss_)) return false;
  const VectorXd d = p_ - other.p_;
  VectorXd size = p_.cwiseAbs() + other.p_.cwiseAbs();
  for (std::size_t i = 0; i < problem_.logarithms().size(); ++i) {
    if (problem_.logarithms()[i]) size[static_cast<Index>(i)] = 2.0;
  }
  if ((d.array().abs() <= kSamePlace * size.array()).all()) return true;
  const double worse = std::abs(std::log(worse_than(other.loss_)));
  return worse < kSameErrors && (root_information_ * d).squaredNorm() < 1.0;
}

ShootingEnd Attempt::end() const {
  ShootingEnd out;
  out.parameters = problem_.with_values(parameters_, p_);
  out.loss = loss_;
  out.converged = converged_;
  out.stages = stages_;
  out.iterations = iterations_;
  out.evaluations = evaluations_;
  return out;
}

}  // namespace identikal
