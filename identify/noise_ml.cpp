#include "identify/noise_ml.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <fmt/format.h>

#include "identify/distribution.h"
#include "lib/kalman.h"
#include "lib/matrix_equations.h"
#include "lib/random.h"
#include "lib/units.h"
#include "lib/whiteness.h"
#include "solvers/covariance.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Log-likelihoods closer than this are the same maximum.
constexpr double kSameMaximum = 1e-4;

bool semidefinite(const MatrixXd& M) {
  if (M.size() == 0) return true;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(M, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().minCoeff() >= -1e-12 * eigen.eigenvalues().cwiseAbs().maxCoeff();
}

bool admissible(const StateSpace& model) {
  const Index nw = model.Q.rows(), ny = model.R.rows();
  MatrixXd joint(nw + ny, nw + ny);
  joint << model.Q, model.S, model.S.transpose(), model.R;
  return joint.allFinite() && semidefinite(joint);
}

LikelihoodProblem make_problem(const ModelFile& model, const ParameterSet& parameters,
                               const Dataset& data) {
  LikelihoodProblem problem;
  const Box box = coordinate_box(parameters);
  problem.lower = box.lower;
  problem.upper = box.upper;
  problem.evaluate = [&model, &parameters, &data](const VectorXd& x, double& L, VectorXd* gradient,
                                                  MatrixXd* information) {
    const ParameterSet at = with_coordinates(parameters, x);
    const StateSpace system = instantiate(model.linear, at);
    if (!admissible(system)) return false;
    std::vector<StateSpace> derivatives;
    if (gradient != nullptr) derivatives = instantiate_derivatives(model.linear, at);
    const Likelihood result =
        log_likelihood(system, model.linear.initial, data.y, data.u, derivatives);
    if (result.status != FilterStatus::ok) return false;
    L = result.value;
    if (gradient != nullptr) *gradient = result.gradient;
    if (information != nullptr) *information = result.information;
    return true;
  };
  return problem;
}

Index samples_present(const Dataset& data) {
  return static_cast<Index>((data.y.array() == data.y.array()).count());
}

void check_usable(const ModelFile& model, const Dataset& data, Index unknowns) {
  if (unknowns == 0) {
    throw InputError({model.path, 0, 0}, "nothing is free to be estimated",
                     "at least one parameter with {value: ...} or a structured Q or R",
                     "use 'check' to test a filter whose noise is given");
  }
  const Index samples = samples_present(data);
  if (samples <= unknowns) {
    throw InputError({data.name, 0, 0},
                     fmt::format("{} samples for {} unknowns", samples, unknowns),
                     "more samples than unknowns", "use a longer recording or fix parameters");
  }
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
      if (!std::isfinite(data.u(i, t))) {
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

void describe_filter(Estimate& estimate, const ModelFile& model, const ParameterSet& parameters,
                     const Dataset& data) {
  const StateSpace system = instantiate(model.linear, parameters);
  estimate.noise.Q = system.Q;
  estimate.noise.R = system.R;
  if (!system.S.isZero(0.0)) estimate.noise.S = system.S;
  estimate.noise.Q_kind = "per-sample";
  if (const auto steady = steady_state(system)) {
    estimate.noise.K_steady = steady->K;
    estimate.noise.P_steady = steady->P;
  }
  const FilterResult filter =
      kalman_filter(system, model.linear.initial, data.y, data.u, Keep::innovations);
  if (filter.status != FilterStatus::ok) {
    estimate.status = Status::not_converged;
    estimate.message = describe(filter.status);
    return;
  }
  estimate.objective.log_likelihood = filter.log_likelihood;

  const Index ny = data.y.rows();
  Series& series = estimate.series;
  series.time = data.time;
  series.measured = data.y;
  series.predicted = data.y - filter.e;
  series.standardised = filter.standardised;
  for (Index i = 0; i < ny; ++i) {
    const Channel& channel = data.outputs[static_cast<std::size_t>(i)];
    const Unit unit = parse_unit(channel.unit).value_or(Unit{});
    series.channels.push_back(channel.name);
    series.units.push_back(channel.unit);
    double sum = 0.0, count = 0.0, total = 0.0, squares = 0.0;
    for (Index t = 0; t < data.y.cols(); ++t) {
      if (std::isnan(filter.e(i, t))) continue;
      sum += data.y(i, t);
      count += 1.0;
    }
    for (Index t = 0; t < data.y.cols(); ++t) {
      if (std::isnan(filter.e(i, t))) continue;
      squares += filter.e(i, t) * filter.e(i, t);
      total += std::pow(data.y(i, t) - sum / count, 2);
    }
    ChannelFit fit{channel.name, channel.unit, kNone, kNone};
    if (count > 0.0) fit.rmse = std::sqrt(squares / count) / unit.scale;
    if (total > 0.0) fit.fit_percent = 100.0 * (1.0 - std::sqrt(squares / total));
    estimate.one_step.push_back(fit);
    series.measured.row(i) = (series.measured.row(i).array() - unit.offset) / unit.scale;
    series.predicted.row(i) = (series.predicted.row(i).array() - unit.offset) / unit.scale;
  }

  // All tests together keep a level of 5 % (Bonferroni).
  const double level = 0.05 / static_cast<double>(1 + ny);
  const ChiSquareStatistic nis = normalised_innovation_squared(filter.standardised);
  if (nis.dof > 0.0) {
    TestResult test;
    test.id = "nis";
    test.value = nis.value / nis.dof;
    test.interval = {chi_square_quantile(0.5 * level, nis.dof) / nis.dof,
                     chi_square_quantile(1.0 - 0.5 * level, nis.dof) / nis.dof};
    const double upper = chi_square_upper_tail(nis.value, nis.dof);
    test.p = std::min(1.0, 2.0 * std::min(upper, 1.0 - upper));
    test.pass = test.value >= test.interval[0] && test.value <= test.interval[1];
    estimate.tests.push_back(test);
  }
  for (Index i = 0; i < ny; ++i) {
    const ChiSquareStatistic q =
        ljung_box(filter.standardised.row(i).transpose(), default_lags(data.size()));
    TestResult test;
    test.id = "ljung_box";
    test.channel = data.outputs[static_cast<std::size_t>(i)].name;
    test.value = q.value;
    test.p = chi_square_upper_tail(q.value, q.dof);
    if (q.dof > 0.0) test.interval = {0.0, chi_square_quantile(1.0 - level, q.dof)};
    test.pass = test.p >= level;
    estimate.tests.push_back(test);
  }
}

Estimate tune_ml(const ModelFile& model, const Dataset& data, const NoiseMlOptions& options) {
  const ParameterSet& parameters = model.parameters;
  Estimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "ml";
  check_usable(model, data, coordinates(parameters).size());

  const LikelihoodProblem problem = make_problem(model, parameters, data);
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
  describe_filter(estimate, model, end, data);
  const double k = static_cast<double>(coordinates(parameters).size());
  objective.aic = 2.0 * k - 2.0 * objective.log_likelihood;
  objective.bic =
      k * std::log(static_cast<double>(samples_present(data))) - 2.0 * objective.log_likelihood;
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
