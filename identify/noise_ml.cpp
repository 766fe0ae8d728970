#include "identify/noise_ml.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <fmt/format.h>

#include "identify/distribution.h"
#include "identify/filter_report.h"
#include "lib/likelihood.h"
#include "lib/random.h"
#include "lib/units.h"
#include "solvers/covariance.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Log-likelihoods closer than this are the same maximum.
constexpr double kSameMaximum = 1e-4;

// Is M positive semidefinite, to rounding?
bool semidefinite(const MatrixXd& M) {
  if (M.size() == 0) return true;
  if (!M.allFinite()) return false;
  if (Eigen::LLT<MatrixXd>(M).info() == Eigen::Success) return true;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(M, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().minCoeff() >= -1e-12 * eigen.eigenvalues().cwiseAbs().maxCoeff();
}

bool admissible(const StateSpace& model) {
  if (model.S.isZero(0.0)) return semidefinite(model.Q) && semidefinite(model.R);
  const Index nw = model.Q.rows(), ny = model.R.rows();
  MatrixXd joint(nw + ny, nw + ny);
  joint << model.Q, model.S, model.S.transpose(), model.R;
  return semidefinite(joint);
}

// The likelihood of all recordings as a function of the optimiser's coordinates.
class RecordingsLikelihood {
 public:
  RecordingsLikelihood(const ModelFile& model, const std::vector<Dataset>& recordings, Path path)
      : model_(model), path_(path) {
    for (const Dataset& data : recordings) engine_.add_recording(data.y, data.u);
  }

  LikelihoodProblem problem() {
    LikelihoodProblem out;
    const Box box = coordinate_box(model_.parameters);
    out.lower = box.lower;
    out.upper = box.upper;
    out.evaluate = [this](const VectorXd& x, double& L, VectorXd* gradient, MatrixXd* information) {
      const ParameterSet at = with_coordinates(model_.parameters, x);
      instantiate(model_.linear, at, system_);
      if (!admissible(system_)) return false;
      if (gradient != nullptr) instantiate_derivatives(model_.linear, at, derivatives_);
      static const std::vector<StateSpace> none;
      const Likelihood& result = engine_.evaluate(system_, model_.linear.initial,
                                                  gradient != nullptr ? derivatives_ : none, path_);
      if (result.status != FilterStatus::ok) return false;
      L = result.value;
      if (gradient != nullptr) *gradient = result.gradient;
      if (information != nullptr) *information = result.information;
      return true;
    };
    return out;
  }

  const PathTaken& path_taken() const { return engine_.path_taken(); }

 private:
  const ModelFile& model_;
  Path path_;
  LikelihoodEngine engine_;
  StateSpace system_;
  std::vector<StateSpace> derivatives_;
};

Index samples_present(const std::vector<Dataset>& recordings) {
  Index samples = 0;
  for (const Dataset& data : recordings) {
    samples += static_cast<Index>((data.y.array() == data.y.array()).count());
  }
  return samples;
}

void check_usable(const ModelFile& model, const std::vector<Dataset>& recordings, Index unknowns) {
  if (unknowns == 0) {
    throw InputError({model.path, 0, 0}, "nothing is free to be estimated",
                     "at least one parameter with {value: ...} or a structured Q or R",
                     "use 'check' to test a filter whose noise is given");
  }
  const Index samples = samples_present(recordings);
  if (samples <= unknowns) {
    throw InputError({recordings[0].name, 0, 0},
                     fmt::format("{} samples for {} unknowns", samples, unknowns),
                     "more samples than unknowns", "use a longer recording or fix parameters");
  }
  for (const Dataset& data : recordings) {
    for (Index i = 0; i < data.y.rows(); ++i) {
      double low = HUGE_VAL, high = -HUGE_VAL;
      for (Index t = 0; t < data.y.cols(); ++t) {
        if (std::isnan(data.y(i, t))) continue;
        low = std::min(low, data.y(i, t));
        high = std::max(high, data.y(i, t));
      }
      if (low >= high) {
        throw InputError({data.name, 0, 0},
                         fmt::format("output '{}' never changes (it is {:.6g} throughout)",
                                     data.outputs[static_cast<std::size_t>(i)].name, low),
                         "a channel with noise", "remove it from the model's outputs");
      }
    }
    for (Index i = 0; i < data.u.rows(); ++i) {
      for (Index t = 0; t < data.u.cols(); ++t) {
        if (std::isfinite(data.u(i, t))) continue;
        throw InputError({data.name, 0, 0},
                         fmt::format("input '{}' is missing at {:.6g} s",
                                     data.inputs[static_cast<std::size_t>(i)].name, data.time[t]),
                         "a value in every row", "select rows with --range, or fill the gap");
      }
    }
  }
}

// Variances move by up to two decades either way; other numbers by up to 30 % of themselves, or
// anywhere between two finite bounds.
VectorXd scattered_start(const ParameterSet& parameters, Random& random) {
  ParameterSet start = parameters;
  for (Parameter& p : start) {
    if (p.fixed) continue;
    if (p.domain != Domain::scalar || p.min >= 0.0) {
      p.value *= std::pow(10.0, 4.0 * random.uniform() - 2.0);
    } else if (std::isfinite(p.min) && std::isfinite(p.max)) {
      p.value(0, 0) = p.min + (p.max - p.min) * random.uniform();
    } else {
      p.value(0, 0) *= 1.0 + 0.6 * (random.uniform() - 0.5);
    }
    if (p.domain == Domain::scalar) p.value(0, 0) = std::clamp(p.scalar(), p.min, p.max);
  }
  return coordinates(start);
}

struct Search {
  Solution best;
  double start_value = kNone;
  int iterations = 0, evaluations = 0, tried = 0, agree = 0;
};

Search search(const LikelihoodProblem& problem, const ParameterSet& parameters,
              const NoiseMlOptions& options) {
  Search out;
  Random random(options.seed);
  std::vector<double> ends;
  for (int s = 0; s < std::max(1, options.starts); ++s) {
    const VectorXd start = s == 0 ? coordinates(parameters) : scattered_start(parameters, random);
    SolverOptions solver;
    solver.decrement_tolerance = 1e-15;
    if (options.progress) {
      solver.progress = [&options, s](int iteration, double L) {
        options.progress(s + 1, iteration, L);
        return true;
      };
    }
    const Solution solution = maximise(problem, start, solver);
    if (s == 0) out.start_value = solution.summary.initial_objective;
    ++out.tried;
    out.iterations += solution.summary.iterations;
    out.evaluations += solution.summary.evaluations;
    ends.push_back(solution.summary.objective);
    // A converged end beats an unconverged one unless that one is really higher.
    const double lead = solution.summary.objective - out.best.summary.objective;
    const bool first = std::isnan(out.best.summary.objective);
    if (first || lead > kSameMaximum ||
        (lead > -kSameMaximum && solution.summary.usable() &&
         (!out.best.summary.usable() || lead > 0.0))) {
      if (!std::isnan(solution.summary.objective) || first) out.best = solution;
    }
  }
  out.agree = static_cast<int>(std::count_if(ends.begin(), ends.end(), [&out](double L) {
    return std::abs(L - out.best.summary.objective) < kSameMaximum;
  }));
  return out;
}

// Largest value of coordinate i whose profile likelihood lies within the one-sided 95 % limit.
std::optional<double> profile_upper_limit(const LikelihoodProblem& problem, const VectorXd& optimum,
                                          double maximum, Index i, double guess) {
  const double drop = 0.5 * chi_square_quantile(0.9, 1.0);
  LikelihoodProblem held = problem;
  VectorXd x = optimum;
  const auto profile = [&](double value) {
    held.lower[i] = held.upper[i] = value;
    x[i] = value;
    const Solution solution = maximise(held, x);
    x = solution.x;
    return solution.summary.objective - maximum + drop;
  };
  double low = optimum[i], high = std::max(guess, 1e-12);
  for (int k = 0; profile(high) > 0.0; ++k) {
    low = high;
    high *= 2.0;
    if (k == 100) return std::nullopt;
  }
  while (high - low > 1e-4 * high) {
    const double middle = 0.5 * (low + high);
    (profile(middle) > 0.0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

MatrixXd select(const MatrixXd& M, const std::vector<Index>& keep) {
  const auto k = static_cast<Index>(keep.size());
  MatrixXd out(k, k);
  for (Index i = 0; i < k; ++i) {
    for (Index j = 0; j < k; ++j) {
      out(i, j) = M(keep[static_cast<std::size_t>(i)], keep[static_cast<std::size_t>(j)]);
    }
  }
  return out;
}

double unit_scale(const std::string& unit) {
  const auto parsed = parse_unit(unit);
  return parsed ? parsed->scale : 1.0;
}

// Values of all reported entries in the user's units.
void list_parameters(Estimate& estimate, const ParameterSet& start, const ParameterSet& end) {
  const ReportedEntries before = reported_entries(start), after = reported_entries(end);
  for (std::size_t i = 0; i < after.names.size(); ++i) {
    const auto at = static_cast<Index>(i);
    EstimatedParameter p;
    p.name = after.names[i];
    p.unit = after.units[i];
    const Unit unit = parse_unit(p.unit).value_or(Unit{});
    p.value = unit.from_si(after.value[at]);
    p.start = unit.from_si(before.value[at]);
    p.fixed = end[static_cast<std::size_t>(after.parameter[i])].fixed;
    estimate.parameters.push_back(std::move(p));
  }
}

// Errors of everything that was estimated, from the information at the maximum.
void judge(Estimate& estimate, const LikelihoodProblem& problem, const ParameterSet& end,
           const Solution& best) {
  const VectorXd& x = best.x;
  double L = 0.0;
  VectorXd gradient;
  MatrixXd expected;
  if (!problem.evaluate(x, L, &gradient, &expected)) return;

  // Coordinates at a bound leave the problem: they have no two-sided error.
  std::vector<Index> inside;
  for (Index i = 0; i < x.size(); ++i) {
    if (x[i] > problem.lower[i] && x[i] < problem.upper[i]) inside.push_back(i);
  }
  const ReportedEntries entries = reported_entries(end);
  std::vector<Index> free_entries;
  for (Index e = 0; e < entries.value.size(); ++e) {
    EstimatedParameter& p = estimate.parameters[static_cast<std::size_t>(e)];
    if (p.fixed) continue;
    double reach = 0.0;
    for (const Index i : inside) reach = std::max(reach, std::abs(entries.J(e, i)));
    if (reach > 0.0) {
      free_entries.push_back(e);
    } else {
      p.verdict = Verdict::at_bound;
    }
  }
  MatrixXd J(static_cast<Index>(free_entries.size()), static_cast<Index>(inside.size()));
  for (Index r = 0; r < J.rows(); ++r) {
    const Index e = free_entries[static_cast<std::size_t>(r)];
    const double unit = unit_scale(entries.units[static_cast<std::size_t>(e)]);
    for (Index c = 0; c < J.cols(); ++c) {
      J(r, c) = entries.J(e, inside[static_cast<std::size_t>(c)]) / unit;
    }
  }

  // A singular covariance matrix estimate (rank-deficient L) makes entries depend on each other.
  const Eigen::FullPivLU<MatrixXd> lu(J);
  if (J.rows() != J.cols() || lu.rank() < J.rows()) {
    estimate.covariance_kind = "none: a covariance matrix lies on the boundary of definiteness";
    for (const Index e : free_entries) {
      EstimatedParameter& p = estimate.parameters[static_cast<std::size_t>(e)];
      if (end[static_cast<std::size_t>(entries.parameter[static_cast<std::size_t>(e)])].domain ==
          Domain::positive_definite) {
        p.verdict = Verdict::at_bound;
      }
    }
    return;
  }
  const MatrixXd J_inverse = lu.inverse();
  const MatrixXd information = select(expected, inside);
  const MatrixXd entry_information = J_inverse.transpose() * information * J_inverse;

  const auto k = static_cast<Index>(inside.size());
  MatrixXd covariance = MatrixXd::Zero(k, k);
  const std::optional<MatrixXd> bound = scaled_inverse(entry_information, 1e-9);
  if (bound) {
    VectorXd step(x.size());
    const MatrixXd inverse = J_inverse * *bound * J_inverse.transpose();
    VectorXd inside_x(k);
    for (Index i = 0; i < k; ++i) {
      const Index at = inside[static_cast<std::size_t>(i)];
      inside_x[i] = x[at];
      // Small against the error, but never across a bound.
      const double room = std::min(x[at] - problem.lower[at], problem.upper[at] - x[at]);
      step[i] = std::min(1e-3 * std::sqrt(inverse(i, i)), 0.5 * room);
    }
    const auto gradient_at = [&](const VectorXd& z, VectorXd& g) {
      VectorXd full = x, full_gradient;
      for (Index i = 0; i < k; ++i) full[inside[static_cast<std::size_t>(i)]] = z[i];
      double value = 0.0;
      if (!problem.evaluate(full, value, &full_gradient, nullptr)) return false;
      g.resize(k);
      for (Index i = 0; i < k; ++i) g[i] = full_gradient[inside[static_cast<std::size_t>(i)]];
      return true;
    };
    const auto observed = observed_information(gradient_at, inside_x, step.head(k));
    const auto inverse_observed =
        observed ? scaled_inverse(J_inverse.transpose() * *observed * J_inverse) : std::nullopt;
    covariance = inverse_observed ? *inverse_observed : *bound;
    estimate.covariance_kind = inverse_observed ? "observed information"
                                                : "expected information (the observed one is not "
                                                  "positive definite)";
  } else {
    estimate.covariance_kind = "partial: some directions carry no information";
    // Entries outside the flat directions keep an error: the pseudo-inverse holds it.
    covariance = entry_information.completeOrthogonalDecomposition().pseudoInverse();
  }
  judge_parameters(estimate, entry_information, covariance);
  for (Index r = 0; r < k && bound; ++r) {
    const auto e = static_cast<std::size_t>(free_entries[static_cast<std::size_t>(r)]);
    estimate.parameters[e].crb_se = std::sqrt((*bound)(r, r));
  }
}

// A variance that ended at zero: how large could it be?
void limit_boundary(Estimate& estimate, const LikelihoodProblem& problem, const ParameterSet& end,
                    const Solution& best) {
  const ReportedEntries entries = reported_entries(end);
  double L = 0.0;
  VectorXd gradient;
  MatrixXd information;
  if (!problem.evaluate(best.x, L, &gradient, &information)) return;
  for (Index i = 0; i < best.x.size(); ++i) {
    const bool lower = best.x[i] <= problem.lower[i], upper = best.x[i] >= problem.upper[i];
    if (!lower && !upper) continue;
    for (Index e = 0; e < entries.value.size(); ++e) {
      EstimatedParameter& p = estimate.parameters[static_cast<std::size_t>(e)];
      if (p.verdict != Verdict::at_bound || entries.J(e, i) == 0.0) continue;
      Warning warning{"at_bound", "note", {p.name}, "", ""};
      if (lower && problem.lower[i] == 0.0) {
        const double guess = information(i, i) > 0.0 ? 0.1 / std::sqrt(information(i, i))
                                                     : best.x.cwiseAbs().maxCoeff();
        const auto limit = profile_upper_limit(problem, best.x, L, i, guess);
        if (limit) {
          p.ci95 = {0.0, *limit * entries.J(e, i) / unit_scale(p.unit)};
          warning.text = fmt::format("{} is not distinguishable from 0, upper bound {:.4g} (95 %)",
                                     p.name, p.ci95[1]);
        } else {
          warning.text =
              fmt::format("{} is not distinguishable from 0, and has no upper bound", p.name);
        }
      } else {
        warning.severity = "warning";
        warning.text = fmt::format("{} ended at its {} bound {:.6g}", p.name,
                                   lower ? "lower" : "upper", p.value);
        warning.todo = "widen the bound in the model file if it is not physical";
      }
      estimate.warnings.push_back(std::move(warning));
    }
  }
}

// Which path served the evaluation at the maximum, and what a person should know about it.
void report_path(Estimate& estimate, const PathTaken& taken, Path asked) {
  estimate.objective.path = to_string(taken.path);
  if (taken.detour == Detour::none || taken.detour == Detour::not_asked) return;
  estimate.objective.path_reason = describe(taken.detour);
  if (taken.detour == Detour::long_memory) {
    estimate.objective.path_reason += fmt::format(" (its pole is {:.6f})", taken.pole);
  }
  if (asked != Path::compressed || taken.path == Path::compressed) return;
  estimate.warnings.push_back({"path",
                               "warning",
                               {},
                               fmt::format("the {} path ran instead of the compressed one: {}",
                                           estimate.objective.path, estimate.objective.path_reason),
                               "the result is the same, only slower"});
}

void conclude(Estimate& estimate, const Search& found) {
  const Identifiability& id = estimate.identifiability;
  if (std::isnan(found.best.summary.objective)) {
    estimate.status = Status::not_converged;
    estimate.message = "the likelihood is undefined at every start: " + found.best.summary.message;
    return;
  }
  if (id.rank < id.of) {
    estimate.status = Status::answer_no;
    std::string names;
    for (const EstimatedParameter& p : estimate.parameters) {
      if (p.verdict != Verdict::flat && p.verdict != Verdict::unexcited) continue;
      names += (names.empty() ? "" : ", ") + p.name;
    }
    estimate.message = fmt::format("the data determine {} of {} unknowns; not determined: {}",
                                   id.rank, id.of, names);
    return;
  }
  if (!found.best.summary.usable()) {
    estimate.status = Status::not_converged;
    estimate.message = found.best.summary.message;
    return;
  }
  estimate.status = Status::ok;
  estimate.message = "converged";
}

}  // namespace

Estimate tune_ml(const ModelFile& model, const std::vector<Dataset>& recordings,
                 const NoiseMlOptions& options) {
  const ParameterSet& parameters = model.parameters;
  Estimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "ml";
  check_usable(model, recordings, coordinates(parameters).size());

  RecordingsLikelihood likelihood(model, recordings, options.path);
  const LikelihoodProblem problem = likelihood.problem();
  const Search found = search(problem, parameters, options);
  const ParameterSet end = with_coordinates(parameters, found.best.x);
  list_parameters(estimate, parameters, end);
  Objective& objective = estimate.objective;
  objective.log_likelihood_start = found.start_value;
  objective.iterations = found.iterations;
  objective.evaluations = found.evaluations;
  objective.starts = found.tried;
  objective.starts_agree = found.agree;
  if (!std::isnan(found.best.summary.objective)) {
    judge(estimate, problem, end, found.best);
    report_path(estimate, likelihood.path_taken(), options.path);
    limit_boundary(estimate, problem, end, found.best);
    const ReportedEntries entries = reported_entries(end);
    for (std::size_t i = 0; i < estimate.parameters.size(); ++i) {
      // A variance's interval does not reach below zero.
      const Parameter& from = end[static_cast<std::size_t>(entries.parameter[i])];
      const bool variance = from.domain == Domain::diagonal ||
                            from.domain == Domain::scaled_identity || from.min == 0.0;
      double& low = estimate.parameters[i].ci95[0];
      if (variance && low < 0.0) low = 0.0;
    }
  }
  conclude(estimate, found);
  if (estimate.status == Status::not_converged && std::isnan(found.best.summary.objective)) {
    return estimate;
  }
  describe_filter(estimate, model, end, recordings);
  const double k = static_cast<double>(coordinates(parameters).size());
  objective.aic = 2.0 * k - 2.0 * objective.log_likelihood;
  objective.bic = k * std::log(static_cast<double>(samples_present(recordings))) -
                  2.0 * objective.log_likelihood;
  if (found.agree < found.tried) {
    estimate.warnings.push_back(
        {"several_maxima",
         "warning",
         {},
         fmt::format("{} of {} starts ended at the best value", found.agree, found.tried),
         "raise --starts; if they still disagree, the likelihood has several maxima"});
  }
  for (const TestResult& test : estimate.tests) {
    if (test.pass || test.id != "ljung_box") continue;
    estimate.warnings.push_back(
        {"coloured_innovations",
         "warning",
         {test.channel},
         fmt::format(
             "the innovations of '{}' are not white (Ljung-Box p = {:.2g}): the model misses "
             "dynamics or coloured noise, and the errors above are too small",
             test.channel, test.p),
         "extend the model; a filter tuned on a wrong model is not optimal"});
  }
  return estimate;
}

}  // namespace identikal
