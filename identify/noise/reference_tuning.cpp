#include "identify/noise/reference_tuning.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <Eigen/QR>
#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/reference_errors.h"
#include "identify/filter/report.h"
#include "identify/model/check.h"
#include "identify/model/parameter_prior.h"
#include "identify/noise/estimate.h"
#include "identify/noise/internal/scattered_start.h"
#include "identify/noise/ml.h"
#include "lib/statistics/long_run_covariance.h"
#include "solvers/covariance.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kBandWeight = 0.01;  // of (log nu)^2
// Searches with the rows that count for the last one's filter; where those turn back and forth,
// the later ones are taken.
constexpr int kMostAnew = 10, kTurns = 4;
constexpr int kUsualStarts = 5, kSureStarts = 3;

// What an optimiser moves: logarithms of what cannot be negative, all else as it is.
class LogCoordinates {
 public:
  explicit LogCoordinates(const ParameterSet& parameters)
      : parameters_(parameters), box_(coordinate_box(parameters)) {
    constexpr double kRange = 25.0;  // to either side, of the natural logarithm
    const VectorXd start = coordinates(parameters);
    lower = box_.lower;
    upper = box_.upper;
    for (Index i = 0; i < start.size(); ++i) {
      if (!is_logarithm(i)) continue;
      const double middle = start[i] > 0.0 ? std::log(start[i]) : 0.0;
      lower[i] = std::max(middle - kRange, std::log(std::max(box_.lower[i], 1e-300)));
      upper[i] = std::min(middle + kRange, std::log(box_.upper[i]));
    }
  }
  VectorXd of(const ParameterSet& at) const {
    VectorXd x = coordinates(at);
    for (Index i = 0; i < x.size(); ++i) {
      if (is_logarithm(i)) x[i] = std::log(std::max(x[i], 1e-300));
    }
    return x.cwiseMax(lower).cwiseMin(upper);
  }
  ParameterSet parameters(const VectorXd& x) const {
    return with_coordinates(parameters_, without_logarithms(x));
  }
  // d entries / d x
  MatrixXd jacobian(const VectorXd& x) const {
    const VectorXd c = without_logarithms(x);
    MatrixXd out = entry_jacobian(parameters_, c);
    for (Index i = 0; i < c.size(); ++i) {
      if (is_logarithm(i)) out.col(i) *= c[i];
    }
    return out;
  }

  VectorXd lower, upper;

 private:
  bool is_logarithm(Index i) const { return box_.lower[i] >= 0.0; }
  VectorXd without_logarithms(VectorXd x) const {
    for (Index i = 0; i < x.size(); ++i) {
      if (!is_logarithm(i)) continue;
      x[i] = std::clamp(std::exp(x[i]), box_.lower[i], box_.upper[i]);
    }
    return x;
  }

  const ParameterSet& parameters_;
  Box box_;
};

// Of one reference, over all rows.
struct Sums {
  double rows = 0.0, squares = 0.0, ratios = 0.0;  // e^2, e^2 / v
  VectorXd by_squares, by_ratios;                  // half their derivatives
  MatrixXd products;                               // de de'
};

class Criterion {
 public:
  // Counts the rows where the filter with the values `begin` has settled.
  Criterion(const Model& model, const ParameterSet& begin, const std::vector<Dataset>& recordings)
      : model_(model),
        recordings_(recordings),
        filters_(model, recordings),
        settled(first_settled_rows(model, begin, recordings, filters_)),
        coordinates(model.parameters) {}

  // False: they are those already. @param as_late_as_before  no row that did not count counts now
  bool begin_where_settled(const ParameterSet& at, bool as_late_as_before) {
    SettledRows now = first_settled_rows(model_, at, recordings_, filters_);
    for (std::size_t r = 0; as_late_as_before && r < std::min(now.size(), settled.size()); ++r) {
      for (std::size_t i = 0; i < now[r].size(); ++i) {
        now[r][i] = std::max(now[r][i], settled[r][i]);
      }
    }
    const bool moved = now != settled;
    settled = std::move(now);
    return moved;
  }

  // -J; by x where requested. False: the filter does not run, or some variance is zero.
  bool evaluate(const VectorXd& x, double& value, VectorXd* gradient, MatrixXd* information) {
    const auto sums = summed(coordinates.parameters(x), gradient != nullptr);
    const auto has_rows = [](const Sums& s) { return s.rows > 0.0; };
    if (!sums || std::none_of(sums->begin(), sums->end(), has_rows)) return false;
    value = 0.0;
    VectorXd g;
    MatrixXd J;
    for (const Sums& s : *sums) {
      if (s.rows == 0.0) continue;
      const double log_ratio = std::log(s.ratios / s.rows);
      value -=
          s.rows * (0.5 * std::log(s.squares / s.rows) + 0.5 * kBandWeight * log_ratio * log_ratio);
      if (gradient == nullptr) continue;
      const VectorXd band = 2.0 * s.by_ratios / s.ratios;  // d log nu
      if (g.size() == 0) g.setZero(band.size()), J.setZero(band.size(), band.size());
      g -= s.rows * (s.by_squares / s.squares + kBandWeight * log_ratio * band);
      J += s.rows * (s.products / s.squares + kBandWeight * band * band.transpose());
    }
    if (gradient == nullptr) return std::isfinite(value);
    const MatrixXd chain = coordinates.jacobian(x);
    *gradient = chain.transpose() * g;
    if (information != nullptr) *information = chain.transpose() * J * chain;
    return std::isfinite(value) && gradient->allFinite();
  }

  LikelihoodProblem problem() {
    return {[this](const VectorXd& x, double& value, VectorXd* gradient, MatrixXd* information) {
              return evaluate(x, value, gradient, information);
            },
            coordinates.lower, coordinates.upper};
  }

  // Covariance of the estimate x: H^-1 S H^-1 with the observed H, and S that of the gradient as
  // the rows make it up. Nothing where x is no maximum.
  std::optional<MatrixXd> covariance(const VectorXd& x) {
    double value = 0.0;
    VectorXd gradient;
    MatrixXd information;
    if (!evaluate(x, value, &gradient, &information)) return std::nullopt;
    const auto expected = scaled_inverse(information, 1e-10);
    if (!expected) return std::nullopt;
    const VectorXd step = 1e-2 * expected->diagonal().cwiseSqrt().cwiseMin(1.0);
    const auto gradient_at = [this](const VectorXd& at, VectorXd& g) {
      double unused = 0.0;
      return evaluate(at, unused, &g, nullptr);
    };
    const auto observed = observed_information(gradient_at, x, step);
    const auto inverse = observed ? scaled_inverse(*observed, 1e-10) : std::nullopt;
    const MatrixXd& H = inverse ? *inverse : *expected;
    const MatrixXd terms = rows_of_gradient(x);
    const Index bandwidth = andrews_bandwidth(terms, std::max<Index>(1, terms.cols() / 8));
    return MatrixXd(H * long_run_covariance(terms, bandwidth) * H);
  }

 private:
  std::optional<std::vector<Sums>> summed(const ParameterSet& at, bool with_derivatives) {
    std::vector<Sums> sums(model_.references.channels.size());
    bool defined = true;
    const auto add = [&](const ReferenceError& row) {
      if (!counts(row)) return;
      if (!std::isfinite(row.e)) defined = false;
      Sums& s = sums[static_cast<std::size_t>(row.reference)];
      const double ratio = row.e / row.v;
      if (with_derivatives && s.rows == 0.0) {
        const Index k = row.de.size();
        s.by_squares.setZero(k);
        s.by_ratios.setZero(k);
        s.products.setZero(k, k);
      }
      s.rows += 1.0;
      s.squares += row.e * row.e;
      s.ratios += row.e * ratio;
      if (!with_derivatives) return;
      s.by_squares += row.e * row.de;
      s.by_ratios += ratio * row.de - 0.5 * ratio * ratio * row.dv;
      s.products += row.de * row.de.transpose();
    };
    const FilterStatus status =
        for_each_reference(model_, at, recordings_, filters_, with_derivatives, add);
    if (status != FilterStatus::ok || !defined) return std::nullopt;
    return sums;
  }

  // What every row adds to the gradient by x, all references of a row together.
  MatrixXd rows_of_gradient(const VectorXd& x) {
    const ParameterSet at = coordinates.parameters(x);
    const auto sums = summed(at, true);
    std::vector<VectorXd> terms;
    const auto add = [&](const ReferenceError& row) {
      if (!counts(row)) return;
      const Sums& s = (*sums)[static_cast<std::size_t>(row.reference)];
      const double nu = s.ratios / s.rows;
      const VectorXd band = 2.0 * s.by_ratios / s.ratios;
      terms.push_back(-(s.rows * row.e / s.squares * row.de +
                        kBandWeight * (row.e * row.e / row.v / nu - 1.0 + std::log(nu)) * band));
    };
    for_each_reference(model_, at, recordings_, filters_, true, add);
    MatrixXd out(x.size(), static_cast<Index>(terms.size()));
    const MatrixXd chain = coordinates.jacobian(x).transpose();
    for (std::size_t i = 0; i < terms.size(); ++i) {
      out.col(static_cast<Index>(i)) = chain * terms[i];
    }
    return out.colwise() - out.rowwise().mean();
  }

  bool counts(const ReferenceError& row) const {
    return row.v > 0.0 && !settled.empty() &&
           row.row >= settled[row.recording][static_cast<std::size_t>(row.reference)];
  }

  const Model& model_;
  const std::vector<Dataset>& recordings_;
  RecordingsLikelihood filters_;

 public:
  SettledRows settled;  // rows that count
  LogCoordinates coordinates;
};

struct BestOfStarts {
  Solution best;
  int tried = 0, agree = 0, iterations = 0, evaluations = 0;
};

// Where no number of starts is asked for, until enough have ended at one optimum and none elsewhere.
BestOfStarts closest_of(Criterion& criterion, const std::vector<ParameterSet>& starts,
                        const ReferenceTuningOptions& options) {
  constexpr double kSame = 1e-4;
  const LikelihoodProblem problem = criterion.problem();
  BestOfStarts out;
  std::vector<double> ends;
  bool stopped = false;
  for (const ParameterSet& start : starts) {
    SolverOptions solver;
    solver.decrement_tolerance = 1e-7;
    solver.progress = [&](int iteration, double value) {
      stopped = options.progress && !options.progress(out.tried + 1, iteration, -value);
      return !stopped;
    };
    const Solution end = maximise(problem, criterion.coordinates.of(start), solver);
    if (end.summary.termination == Termination::start_undefined) continue;
    ++out.tried;
    out.iterations += end.summary.iterations;
    out.evaluations += end.summary.evaluations;
    ends.push_back(end.summary.objective);
    if (std::isnan(out.best.summary.objective) ||
        end.summary.objective > out.best.summary.objective) {
      out.best = end;
    }
    const auto is_best = [&](double of) { return out.best.summary.objective - of < kSame; };
    out.agree = static_cast<int>(std::count_if(ends.begin(), ends.end(), is_best));
    const bool sure = out.tried >= kSureStarts && out.agree == out.tried;
    if (stopped || (options.starts == 0 && sure)) break;
  }
  if (stopped) {
    out.best.summary.termination = Termination::stopped;
    out.best.summary.message = "stopped by the caller";
  }
  return out;
}

// Filters with a smaller and with a larger gain: what matters most, and where other optima lie.
std::vector<ParameterSet> slower_and_faster(const Model& model, const ParameterSet& at) {
  constexpr double kFactor = 300.0;
  const LinearModel& noise = noise_model(model);
  std::vector<ParameterSet> out;
  for (const ParametrisedMatrix* matrix : {&noise.R, &noise.Q}) {
    ParameterSet start = at;
    for (const int i : parameters_in(*matrix)) {
      Parameter& p = start[static_cast<std::size_t>(i)];
      if (!p.fixed && p.min >= 0.0) p.value *= kFactor;
      if (p.domain == Domain::scalar) p.value(0, 0) = std::clamp(p.scalar(), p.min, p.max);
    }
    out.push_back(std::move(start));
  }
  return out;
}

bool has_references(const Model& model, const std::vector<Dataset>& recordings) {
  return !model.references.channels.empty() &&
         std::any_of(recordings.begin(), recordings.end(), [](const Dataset& data) {
           return data.reference.rows() > 0 && !data.reference.array().isNaN().all();
         });
}

void refuse_without_references(const Model& model, const std::vector<Dataset>& recordings) {
  if (has_references(model, recordings)) return;
  throw InputError({model.source, 0, 0},
                   model.references.channels.empty()
                       ? "the model names no reference of its states"
                       : "the recordings hold no value of a reference",
                   "reference: {STATE: {column: NAME}}, and recordings with that column");
}

// At the ends of the coordinates no error is known.
std::vector<bool> at_boundary(const Criterion& criterion, const VectorXd& x) {
  std::vector<bool> out;
  for (Index i = 0; i < x.size(); ++i) {
    out.push_back(x[i] <= criterion.coordinates.lower[i] || x[i] >= criterion.coordinates.upper[i]);
  }
  return out;
}

void judge(Criterion& criterion, const BestOfStarts& found, NoiseEstimate& estimate) {
  const VectorXd& x = found.best.x;
  const InteriorParameters inside = interior_parameters(estimate, at_boundary(criterion, x));
  const auto k = static_cast<Index>(inside.entries.size());
  if (k == 0) return;
  const auto covariance = criterion.covariance(x);
  if (!covariance) {
    estimate.covariance_kind = "none: the references do not determine all of these together";
    for (EstimatedParameter* p : inside.reported) p->verdict = Verdict::poorly_determined;
    return;
  }
  estimate.covariance_kind = "sandwich of the references' errors, which are correlated in time";
  const MatrixXd chain = criterion.coordinates.jacobian(x);
  const MatrixXd entries = chain * *covariance * chain.transpose();
  const VectorXd per_unit = inside.unit.cwiseInverse();
  const MatrixXd in_units = per_unit.asDiagonal() *
                            MatrixXd(entries(inside.entries, inside.entries)) *
                            per_unit.asDiagonal();
  judge_parameters(estimate, in_units.completeOrthogonalDecomposition().pseudoInverse(), in_units);
  // A variance's error is that of its logarithm: no interval reaches below zero.
  const std::vector<bool> variance = reported_entries(criterion.coordinates.parameters(x)).variance;
  for (Index i = 0; i < k; ++i) {
    EstimatedParameter& p = *inside.reported[static_cast<std::size_t>(i)];
    const auto at = static_cast<std::size_t>(&p - estimate.parameters.data());
    if (!variance[at] || !(p.value > 0.0)) continue;
    const double factor = std::exp(normal_quantile(0.975) * p.se / p.value);
    p.ci95 = {p.value / factor, p.value * factor};
  }
}

}  // namespace

NoiseEstimate tune_to_references(const Model& given, const std::vector<Dataset>& recordings,
                                 const ReferenceTuningOptions& options) {
  refuse_constraints(given, "--for estimates");
  const Model model = checked(given, recordings);
  refuse_without_references(model, recordings);
  if (const auto priors = names_with_priors(model.parameters); !priors.empty()) {
    throw InputError({model.source, 0, 0},
                     fmt::format("the references have no place for the prior of '{}'", priors[0]),
                     "no prior", "'tune' without --for takes priors");
  }
  check_recordings(model, recordings);
  const int count = options.starts > 0 ? options.starts : kUsualStarts;
  std::vector<ParameterSet> starts{model.parameters};
  if (count > 1) {
    NoiseMlOptions once;
    once.starts = 1;
    once.profiles = false;
    once.asks_references = false;
    const NoiseEstimate likeliest = tune_ml(model, recordings, once);
    starts.push_back(parameters_of(likeliest, model.parameters));
  }
  for (ParameterSet& start : slower_and_faster(model, starts.back())) {
    if (static_cast<int>(starts.size()) < count) starts.push_back(std::move(start));
  }
  Random random(options.seed);
  while (static_cast<int>(starts.size()) < count) {
    starts.push_back(scattered_start(model.parameters, random));
  }
  Criterion criterion(model, starts.size() > 1 ? starts[1] : starts[0], recordings);
  BestOfStarts found = closest_of(criterion, starts, options);
  // The rows that count are those of the filter that is found.
  for (int i = 0; i < kMostAnew && found.best.summary.usable(); ++i) {
    const ParameterSet so_far = criterion.coordinates.parameters(found.best.x);
    if (!criterion.begin_where_settled(so_far, i >= kTurns)) break;
    const BestOfStarts again = closest_of(criterion, {so_far}, options);
    if (again.tried == 0) break;
    found.best = again.best;
    found.iterations += again.iterations;
    found.evaluations += again.evaluations;
  }
  if (found.tried == 0 && !criterion.settled.empty()) {
    throw InputError(
        {model.source, 0, 0},
        "no reference has a value where the filter has settled and knows the state",
        "reference values behind the first rows, and noise that leaves the state open");
  }
  if (found.tried == 0) {
    refuse_filter(model, recordings, RecordingsLikelihood(model, recordings).status_at_start());
  }
  NoiseEstimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "references";
  const ParameterSet end = criterion.coordinates.parameters(found.best.x);
  list_parameters(estimate, model.parameters, end);
  Objective& objective = estimate.objective;
  objective.iterations = found.iterations;
  objective.evaluations = found.evaluations;
  objective.starts = found.tried;
  objective.starts_at_optimum = found.agree;
  judge(criterion, found, estimate);
  if (!found.best.summary.usable()) withdraw_errors(estimate);
  append(estimate.findings, check_search(estimate, found.best.summary));
  report_filter(estimate, model, end, recordings);
  conclude(estimate, "converged: no other noise brings the estimates closer to the references");
  return estimate;
}

Findings check_against_references(const Model& model, const ParameterSet& likeliest,
                                  const std::vector<Dataset>& recordings) {
  constexpr double kLess = 0.01, kLevel = 0.01;  // of the error; of the test
  if (!has_references(model, recordings)) return {};
  Criterion criterion(model, likeliest, recordings);
  std::vector<ParameterSet> starts = slower_and_faster(model, likeliest);
  starts.push_back(likeliest);
  const BestOfStarts found = closest_of(criterion, starts, {});
  if (found.tried == 0 || !found.best.summary.usable()) return {};
  const auto covariance = criterion.covariance(found.best.x);
  const VectorXd moved = found.best.x - criterion.coordinates.of(likeliest);
  const ParameterSet closest = criterion.coordinates.parameters(found.best.x);
  const std::vector<ReferenceFit> before =
      reference_fits(model, likeliest, recordings, criterion.settled);
  const std::vector<ReferenceFit> after =
      reference_fits(model, closest, recordings, criterion.settled);
  if (!covariance || before.size() != after.size() || before.empty()) return {};
  std::size_t most = 0;
  const auto share = [&](std::size_t i) { return after[i].rmse / before[i].rmse; };
  for (std::size_t i = 1; i < after.size(); ++i) most = share(i) < share(most) ? i : most;
  const VectorXd errors = covariance->diagonal().cwiseSqrt();
  Index far = 0;
  (moved.array() / errors.array()).abs().maxCoeff(&far);
  const auto inverse = scaled_inverse(*covariance, 1e-10);
  if (!inverse) return {};
  const double p =
      chi_square_upper_tail(moved.dot(*inverse * moved), static_cast<double>(moved.size()));
  if (!(p < kLevel) || !(share(most) < 1.0 - kLess)) return {};
  std::vector<std::string> names;
  for (const Parameter& each : model.parameters) {
    if (each.fixed) continue;
    const auto count = coordinates(ParameterSet{each}).size();
    for (Index i = 0; i < count; ++i) names.push_back(each.name);
  }
  const std::string& name = names[static_cast<std::size_t>(far)];
  return {make_finding(
      FindingCode::reference_disagrees, {before[most].name, name},
      fmt::format("with other noise {} would be {:.2g} % closer to its reference (rmse {:.4g} "
                  "against {:.4g} {}, p {:.1g}); {} differs most: the noise that it stands "
                  "for is no white one",
                  before[most].name, 100.0 * (1.0 - share(most)), after[most].rmse,
                  before[most].rmse, before[most].unit, p, name),
      "--for estimates, or extend the model where that noise enters")};
}

}  // namespace identikal
