#include "identify/noise/estimate.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/outliers.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/report.h"
#include "lib/filter/information.h"

namespace identikal {

using Eigen::Index;

InteriorParameters interior_parameters(Estimate& estimate, const std::vector<bool>& at_boundary) {
  InteriorParameters out;
  std::size_t i = 0;
  for (EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    if (at_boundary[i]) {
      p.verdict = Verdict::at_bound;
    } else {
      out.entries.push_back(static_cast<Index>(i));
      out.reported.push_back(&p);
    }
    ++i;
  }
  const auto k = static_cast<Index>(out.entries.size());
  if (k == 0) estimate.covariance_kind = "none: every estimate lies on a boundary";
  out.unit.resize(k);
  for (Index j = 0; j < k; ++j) {
    out.unit[j] = unit_scale(out.reported[j]->unit);
  }
  return out;
}

void withdraw_errors(Estimate& estimate) {
  for (EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    p.se = p.se_sandwich = p.crb_se = kNone;
    p.ci95 = {kNone, kNone};
    if (p.verdict == Verdict::ok) p.verdict = Verdict::poorly_determined;
  }
  estimate.covariance_kind = "none: the search did not converge";
}

Findings check_search(const Estimate& estimate, const SolverSummary& summary,
                      const std::string& more) {
  Findings out;
  const Identifiability& id = estimate.identifiability;
  const bool converged = summary.usable();
  if (id.rank < id.of) {
    const std::vector<std::string> open = not_determined(estimate);
    out.push_back(
        make_finding(FindingCode::not_identifiable, open,
                     fmt::format("the data determine {} of {} unknowns; not determined: {}{}{}",
                                 id.rank, id.of, fmt::join(open, ", "),
                                 converged ? "" : "; the search did not converge", more)));
  }
  if (!converged) out.push_back(make_finding(FindingCode::not_converged, {}, summary.message));
  return out;
}

ExcessMeanSquareError excess_error(const Estimate& estimate, const Model& model,
                                   const ParameterSet& at) {
  ExcessMeanSquareError loss;
  if (is_formula_model(model)) {
    loss.reason = "a nonlinear model has no steady filter";
    return loss;
  }
  const std::vector<StateSpace> derivatives = model_derivatives(as_linear(model), at);
  if (!std::all_of(derivatives.begin(), derivatives.end(), changes_only_noise)) {
    loss.reason = "parameters other than noise are free";
    return loss;
  }
  std::vector<StateSpace> known;
  std::vector<double> se;
  std::vector<Index> rows;  // of the correlation
  std::size_t i = 0, judged = 0;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    const bool has_row =
        judged < estimate.correlation_names.size() && estimate.correlation_names[judged] == p.name;
    if (p.verdict == Verdict::at_bound && p.value == 0.0) {
      loss.without.push_back(p.name);
    } else if (p.verdict == Verdict::at_bound) {
      loss.reason = fmt::format("{} lies at a boundary, and its error is not known", p.name);
      return loss;
    } else if (p.verdict == Verdict::not_identifiable || p.verdict == Verdict::unexcited) {
      loss.reason = fmt::format("the data do not determine {}", p.name);
      return loss;
    } else if (!has_row || !std::isfinite(p.se)) {
      loss.reason = fmt::format("the error of {} is not known", p.name);
      return loss;
    } else {
      known.push_back(derivatives[i]);
      se.push_back(p.se * unit_scale(p.unit));
      rows.push_back(static_cast<Index>(judged));
    }
    judged += has_row;
    ++i;
  }
  if (known.empty()) {
    loss.reason = "every estimate is zero";
    return loss;
  }
  const StateSpace system = instantiate(as_linear(model), at);
  const auto gain = steady_gain_sensitivity(system, known);
  if (!gain) {
    loss.reason = "there is no steady filter";
    return loss;
  }
  const auto sd = Eigen::Map<const Eigen::VectorXd>(se.data(), static_cast<Index>(se.size()));
  const auto relative = expected_filter_loss(
      system, *gain, sd.asDiagonal() * estimate.correlation(rows, rows) * sd.asDiagonal());
  if (relative) {
    loss.relative = *relative;
  } else {
    loss.reason = "the states are known without error";
  }
  return loss;
}

void report_noise_estimate(NoiseEstimate& estimate, const Model& model, const ParameterSet& end,
                           const std::vector<Dataset>& recordings) {
  const ReportedEntries entries = reported_entries(end);
  for (std::size_t i = 0; i < estimate.parameters.size(); ++i) {
    double& low = estimate.parameters[i].ci95[0];
    if (entries.variance[i] && low < 0.0) low = 0.0;
  }
  estimate.excess_mean_square_error = excess_error(estimate, model, end);
  const std::vector<FilterResult> filters = report_filter(estimate, model, end, recordings);
  append(estimate.findings, check_outliers_and_offset(model, end, recordings, filters));
  Objective& objective = estimate.objective;
  const double k = static_cast<double>(free_entries(end).size());
  objective.samples = static_cast<long>(samples_present(recordings));
  if (static_cast<double>(objective.samples) < 5.0 * k) {  // the likelihood is no parabola yet
    estimate.findings.push_back(make_finding(
        FindingCode::few_samples, {},
        fmt::format("{} samples for {} unknowns: the errors are those of long recordings, and "
                    "here too small",
                    objective.samples, k),
        "record more, or fix parameters that are known"));
  }
  objective.aic = 2.0 * k - 2.0 * objective.log_likelihood;
  objective.bic =
      k * std::log(static_cast<double>(objective.samples)) - 2.0 * objective.log_likelihood;
  append(estimate.findings, check_innovations(estimate));
}

Findings check_innovations(const FilterEstimate& estimate) {
  Findings out;
  const bool shapes = estimate.objective.filter.empty();  // it takes linear models
  const bool errors =
      std::any_of(estimate.parameters.begin(), estimate.parameters.end(),
                  [](const EstimatedParameter& p) { return !p.fixed && std::isfinite(p.se); });
  for (const TestResult& test : estimate.tests) {
    if (!test.pass && test.id == "input_correlation") {
      out.push_back(make_finding(
          FindingCode::input_in_innovations, {test.channel},
          fmt::format("the innovations of '{}' follow earlier inputs (p = {:.2g}): what the inputs "
                      "do is not all in the model",
                      test.channel, test.p),
          "a missing mode, a delay, a wrong gain or sign of an input; the page shows at which "
          "lag"));
    }
    if (test.pass || test.id != "ljung_box") continue;
    out.push_back(make_finding(
        FindingCode::coloured_innovations, {test.channel},
        fmt::format(
            "the innovations of '{}' are not white (Ljung-Box p = {:.2g}): the model misses "
            "dynamics or coloured noise{}",
            test.channel, test.p, errors ? ", and the errors above are too small" : ""),
        shapes ? "'identikal shape' looks for a shaping filter; else extend the "
                 "model: a filter tuned on a wrong model is not optimal"
               : "extend the model, by states of coloured noise if need be: a filter tuned on "
                 "a wrong model is not optimal"));
  }
  return out;
}

}  // namespace identikal
