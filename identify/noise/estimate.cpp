#include "identify/noise/estimate.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "identify/filter/leading_samples.h"
#include "identify/filter/outliers.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/report.h"
#include "identify/model/own_parameters.h"
#include "identify/model/parameter_prior.h"
#include "identify/model/row_order.h"
#include "identify/noise/internal/outlier_effect.h"
#include "identify/noise/internal/sampling_test.h"
#include "lib/base/median.h"
#include "lib/filter/information.h"
#include "lib/statistics/autoregression.h"
#include "lib/statistics/normality.h"
#include "lib/statistics/whiteness.h"

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
  if (rows_have_no_order(model, at)) return loss;  // no state to be wrong about
  if (changes(model)) {
    loss.reason = "a model that changes from sample to sample has no steady filter";
    return loss;
  }
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

Findings check_length(long samples, double unknowns, double freedom) {
  const double share = static_cast<double>(samples) / unknowns;
  if (!(share < 5.0)) return {};
  if (std::isfinite(freedom)) {
    return {make_finding(
        FindingCode::few_samples, {},
        fmt::format("{} samples for {} unknowns: errors with {:.0f} degrees of freedom allow for "
                    "that where the model is near to linear in its parameters",
                    samples, unknowns, freedom),
        "record more, or fix parameters that are known")};
  }
  Finding few = make_finding(
      FindingCode::few_samples, {},
      fmt::format("{} samples for {} unknowns: the errors are those of long recordings, and "
                  "here too small",
                  samples, unknowns),
      "record more, or fix parameters that are known");
  if (share < 3.0) few.severity = Severity::serious;
  return {few};
}

namespace {

// Of one channel's innovations.
struct Tails {
  bool heavy = false;
  double kurtosis = kNone;
  double excess = kNone;  // of their variance over that of their bulk, as a share
};

// Without what counts as an outlier: that is judged by what it does.
Tails tails_of(Eigen::VectorXd standardised) {
  constexpr double kStandardErrors = 5.0, kShare = 0.1, kChanges = 1e-3, kOutlier = 6.0;
  constexpr std::size_t kFewest = 100;
  std::vector<double> squares;
  for (const double e : standardised) {
    if (!std::isnan(e)) squares.push_back(e * e);
  }
  if (squares.size() < kFewest) return {};
  const double limit = std::pow(kOutlier * kDeviationPerMedian, 2) * median(squares);
  std::erase_if(squares, [&](double square) { return square > limit; });
  standardised = (standardised.array().square() > limit).select(kNone, standardised);
  const Eigen::Map<const Eigen::ArrayXd> size(squares.data(), static_cast<Index>(squares.size()));
  Tails out;
  out.kurtosis = moments(standardised).kurtosis;
  const double scale = kDeviationPerMedian * kDeviationPerMedian;
  out.excess = size.mean() / (scale * median(squares)) - 1.0;
  // Large for a while at a time is a noise that changes its size, and whose mean is right.
  const ChiSquareStatistic changes = mcleod_li(standardised, default_lags(size.size()));
  const double error = std::sqrt(24.0 / static_cast<double>(size.size()));
  out.heavy = out.kurtosis - 3.0 > kStandardErrors * error && out.excess > kShare &&
              !(chi_square_upper_tail(changes.value, changes.dof) < kChanges);
  return out;
}

// The noise of most samples is smaller than the estimate.
Findings check_tails(const FilterEstimate& estimate) {
  Findings out;
  const auto says_so = [](const Finding& f) {
    return f.code == FindingCode::outliers && f.severity == Severity::serious;
  };
  if (std::any_of(estimate.findings.begin(), estimate.findings.end(), says_so)) return out;
  for (std::size_t c = 0; c < estimate.series.channels.size(); ++c) {
    const std::string& channel = estimate.series.channels[c];
    const Tails tails = tails_of(estimate.series.standardised.row(static_cast<Index>(c)));
    if (!tails.heavy) continue;
    out.push_back(make_finding(
        FindingCode::heavy_tails, {channel},
        fmt::format("the innovations of '{}' have heavy tails (kurtosis {:.3g}, a Gaussian's is "
                    "3): their variance is {:.2g} % above that of most samples",
                    channel, tails.kurtosis, 100.0 * tails.excess),
        "look for disturbed samples, and empty their cells: missing samples are exact; or take "
        "them "
        "for Student's t: tune --noise student"));
  }
  return out;
}

// The free parameters at zero that the noise of output i comes from, which is zero with them.
std::vector<const EstimatedParameter*> vanished_noise(const Estimate& estimate, const Model& model,
                                                      const ParameterSet& end, Index i) {
  const Eigen::VectorXd z = free_entries(end);
  const auto noise_at = [&](const Eigen::VectorXd& entries) {
    return instantiate(noise_model(model), with_entries(end, entries)).R(i, i);
  };
  std::vector<const EstimatedParameter*> out;
  if (noise_at(z) != 0.0) return out;
  Index e = -1;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    ++e;
    if (p.value == 0.0 && noise_at(z + Eigen::VectorXd::Unit(z.size(), e)) != 0.0) {
      out.push_back(&p);
    }
  }
  return out;
}

// Of one that has, as further parts give it, an error that lasts: its white noise may be none.
bool has_lasting_error(const Model& model, const std::string& output) {
  return std::any_of(model.states.begin(), model.states.end(),
                     [&](const StateName& state) { return state.name == "error_" + output; });
}

// No sensor is without noise, and the likelihood says so only within its limits.
Findings check_measurement_noise(const Estimate& estimate, const Model& model,
                                 const ParameterSet& end, const std::vector<Channel>& outputs) {
  Findings out;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const auto vanished = vanished_noise(estimate, model, end, static_cast<Index>(i));
    if (vanished.empty() || has_lasting_error(model, outputs[i].name)) continue;
    const EstimatedParameter& p = *vanished.front();
    const auto same = std::find_if(out.begin(), out.end(),
                                   [&](const Finding& f) { return f.about.front() == p.name; });
    if (same != out.end()) {  // one number is the noise of several
      same->about.push_back(outputs[i].name);
      continue;
    }
    std::string text = fmt::format(
        "the measurement noise of '{}' was estimated as zero ({} = 0): no sensor is without, and a "
        "filter made with it takes every sample for the truth",
        outputs[i].name, p.name);
    std::string remedy =
        "state what the data sheet says, as prior: {sd: ..., factor: 2} of " + p.name;
    if (std::isfinite(p.ci95[1])) {
      const std::string limit =
          fmt::format("{:.4g}{}{}", p.ci95[1], p.unit.empty() ? "" : " ", p.unit);
      text += fmt::format("; the recording allows up to {} = {} (95 %)", p.name, limit);
      remedy = fmt::format("fix it at that limit, {}: {} under parameters, or {}", p.name, limit,
                           remedy);
    }
    out.push_back(
        make_finding(FindingCode::no_measurement_noise, {p.name, outputs[i].name}, text, remedy));
  }
  return out;
}

void end_intervals_at_zero(Estimate& estimate, const ParameterSet& end) {
  const ReportedEntries entries = reported_entries(end);
  for (std::size_t i = 0; i < estimate.parameters.size(); ++i) {
    double& low = estimate.parameters[i].ci95[0];
    if (entries.variance[i] && low < 0.0) low = 0.0;
  }
}

// Of a regression, whose rows follow one another in no time. Nothing is tested by their order; but in
// a file that is sorted it shows where a curve runs past the data.
Findings check_residuals(const FilterEstimate& estimate) {
  Findings out;
  for (const TestResult& test : estimate.tests) {
    if (test.pass || test.id != "ljung_box") continue;
    out.push_back({FindingCode::coloured_innovations,
                   Severity::note,
                   {test.channel},
                   fmt::format("the residuals of '{}' follow one another from row to row (p = "
                               "{:.2g}): where rows are sorted by an input, the curve may have "
                               "another shape; standard errors take rows as independent",
                               test.channel, test.p),
                   "look at the residuals against the inputs"});
  }
  return out;
}

// AIC and BIC of what comes behind a diffuse start.
void report_criteria(Objective& objective, double unknowns, const Model& model,
                     const ParameterSet& end, const std::vector<Dataset>& recordings) {
  const LeadingSamples leading = leading_samples(model, end, recordings);
  objective.diffuse_samples = static_cast<long>(leading.diffuse);
  objective.leading = leading.log_likelihood;
  std::vector<Dataset> first;
  for (const Dataset& data : recordings) first.push_back(first_samples(data, leading.diffuse));
  const auto values = static_cast<double>(samples_present(recordings) - samples_present(first));
  objective.rows = static_cast<long>(rows_present(recordings));
  const auto rows = static_cast<double>(objective.rows - rows_present(first));
  const double L = log_likelihood_behind(objective, leading.diffuse);
  objective.aic = 2.0 * unknowns - 2.0 * L;
  objective.bic = unknowns * std::log(rows) - 2.0 * L;
  objective.bic_values = unknowns * std::log(values) - 2.0 * L;
}

// p values that are fitted to n rows alone leave correlations of about -p/n between neighbouring
// residuals where what they do changes slowly; among many short recordings a test sees that. As a share
// of the variance, of as many lags as the test has.
double colour_of_own_values(const Model& model, const std::vector<Dataset>& recordings) {
  constexpr double kLags = 20.0;
  double values = 0.0, rows = 0.0;
  for (const Dataset& recording : recordings) {
    rows += static_cast<double>(recording.size());
    for (const OwnParameter& own : recording.own) {
      const bool drawn = is_drawn(model, own.parameter);
      if (drawn || !model.parameters[static_cast<std::size_t>(own.source)].fixed) values += 1.0;
    }
  }
  const double share = rows > 0.0 ? values / rows : 0.0;
  return kLags * share * share;
}

// Cliffs of a likelihood are why a search ends short of its maximum.
void blame_cliffs(Findings& findings) {
  const bool short_of = std::any_of(findings.begin(), findings.end(), [](const Finding& finding) {
    return finding.code == FindingCode::not_converged;
  });
  for (Finding& finding : findings) {
    if (short_of && finding.code == FindingCode::turn) finding.severity = Severity::serious;
  }
}

}  // namespace

void report_noise_estimate(NoiseEstimate& estimate, const Model& model, const ParameterSet& end,
                           const std::vector<Dataset>& recordings) {
  end_intervals_at_zero(estimate, end);
  estimate.excess_mean_square_error = excess_error(estimate, model, end);
  const std::vector<FilterResult> filters = report_filter(estimate, model, end, recordings);
  const auto without_outliers = [&](const std::vector<Dataset>& cleaned) {
    return outlier_effect(estimate, model, end, cleaned);
  };
  // Errors of a simulation may be coloured, and then look like outliers and tails that are none.
  const bool white = estimate.objective.method != kSimulationMethod;
  if (white) {
    append(estimate.findings,
           check_outliers_and_offset(model, end, recordings, filters, without_outliers));
    blame_cliffs(estimate.findings);
  }
  Objective& objective = estimate.objective;
  const double k = static_cast<double>(free_entries(end).size() - model.constraints.equalities());
  objective.samples = static_cast<long>(samples_present(recordings));
  append(estimate.findings, check_length(objective.samples, k, estimate.covariance_freedom));
  report_criteria(objective, k, model, end, recordings);
  const bool ordered = !rows_have_no_order(model, end);
  append(estimate.findings,
         ordered ? check_innovations(estimate, colour_of_own_values(model, recordings))
                 : check_residuals(estimate));
  if (white) append(estimate.findings, check_tails(estimate));
  if (white && ordered) {
    append(estimate.findings, check_sampling(estimate, model, end, recordings));
  }
  append(estimate.findings, check_measurement_noise(estimate, model, end, recordings[0].outputs));
}

void report_digest_estimate(NoiseEstimate& estimate, const Model& model, const ParameterSet& end,
                            RecordingsLikelihood& likelihood) {
  end_intervals_at_zero(estimate, end);
  estimate.excess_mean_square_error = excess_error(estimate, model, end);
  static_cast<FilterMatrices&>(estimate) = filter_matrices(model, end);
  Objective& objective = estimate.objective;
  const Likelihood* const there = likelihood.evaluate(end, false);
  if (there != nullptr)
    objective.log_likelihood = there->value - likelihood.log_density_beside_data(end);
  objective.samples = static_cast<long>(likelihood.samples());
  objective.rows = objective.samples / static_cast<long>(as_linear(model).C.constant.rows());
  estimate.findings.push_back(make_finding(FindingCode::insufficient_power, {},
                                           "a digest has no samples: innovations are not tested, "
                                           "and would not show a model that is wrong",
                                           "'check' a recording with these values"));
  // A diffuse start is not counted, and its first samples are no longer there to be left out.
  if (as_linear(model).initial == InitialState::diffuse) return;
  const double k = static_cast<double>(free_entries(end).size() - model.constraints.equalities());
  objective.aic = 2.0 * k - 2.0 * objective.log_likelihood;
  objective.bic =
      k * std::log(static_cast<double>(objective.rows)) - 2.0 * objective.log_likelihood;
  objective.bic_values =
      k * std::log(static_cast<double>(objective.samples)) - 2.0 * objective.log_likelihood;
}

namespace {

// What is not significant is no finding; what is small does not make the values wrong, as far as
// colour that goes on for long does not: check_sampling() sees that.
constexpr double kPracticalShare = 0.02;
// Beyond doubt, less counts: noise that integrates shows little of what moves it.
constexpr double kBeyondDoubt = 1e-3, kSmallestShare = 0.005;

// @param of_own_values  what recordings' own values leave of colour, as a share
Severity severity_of(const TestResult& test, double of_own_values) {
  const double share = test.share - of_own_values;
  const bool certain = test.p < kBeyondDoubt && share > kSmallestShare;
  return share > kPracticalShare || certain ? Severity::serious : Severity::warning;
}

std::string size_of(const TestResult& test, const std::string& by) {
  if (std::isnan(test.share)) return "";
  return fmt::format(
      ", and {} explain {:.2g} % of their variance (the mean-square error one step "
      "ahead is {:.2g} % too large)",
      by, 100.0 * test.share, 100.0 * test.share / std::max(1e-3, 1.0 - test.share));
}

Finding input_finding(const TestResult& test, double of_own_values) {
  return {FindingCode::input_in_innovations,
          severity_of(test, of_own_values),
          {test.channel},
          fmt::format("the innovations of '{}' follow earlier inputs (p = {:.2g}){}: what the "
                      "inputs do is not all in the model",
                      test.channel, test.p, size_of(test, "these")),
          "a missing mode, a delay, a wrong gain or sign of an input; the page shows at which lag"};
}

// As many independent errors as standard errors of a simulation ask for.
constexpr double kEnoughErrors = 30.0;

Finding coloured_simulation(const TestResult& test, double independent) {
  if (independent < kEnoughErrors) {
    return {
        FindingCode::coloured_innovations,
        Severity::serious,
        {test.channel},
        fmt::format("the errors of the simulation of '{}' are correlated for so long that they "
                    "tell no more than {:.2g} independent ones ({:.0f} are needed): how far the "
                    "values are off cannot be told, and the standard errors are too small",
                    test.channel, independent, kEnoughErrors),
        "record for longer; or no --objective: a filter tells noise that moves the states from "
        "what the parameters do"};
  }
  return {FindingCode::coloured_innovations,
          Severity::note,
          {test.channel},
          fmt::format("the errors of the simulation of '{}' are not white{}: standard errors allow "
                      "for that",
                      test.channel, size_of(test, "their own last values")),
          "noise in the model, and no --objective, where the next sample is to be predicted"};
}

double independent_errors(const FilterEstimate& estimate, const std::string& channel) {
  const std::vector<std::string>& channels = estimate.series.channels;
  const auto at = std::find(channels.begin(), channels.end(), channel) - channels.begin();
  if (at == static_cast<Index>(channels.size())) return 0.0;
  return independent_samples(estimate.series.standardised.row(at).transpose());
}

Finding colour_finding(const TestResult& test, bool has_errors, bool can_shape,
                       double of_own_values) {
  return {FindingCode::coloured_innovations,
          severity_of(test, of_own_values),
          {test.channel},
          fmt::format("the innovations of '{}' are not white (Ljung-Box p = {:.2g}){}: the model "
                      "misses dynamics or coloured noise{}",
                      test.channel, test.p, size_of(test, "their own last values"),
                      has_errors ? ", and the errors above are too small" : ""),
          can_shape ? "'identikal shape' looks for a shaping filter; else extend the model: a "
                      "filter tuned on a wrong model is not optimal"
                    : "extend the model, by states of coloured noise if need be: a filter tuned on "
                      "a wrong model is not optimal"};
}

}  // namespace

Findings check_innovations(const FilterEstimate& estimate, double of_own_values) {
  Findings out;
  // It takes linear models.
  const bool can_shape =
      estimate.objective.filter.empty() && estimate.objective.method != kOwnFilter;
  const bool simulation = estimate.objective.method == kSimulationMethod;
  const bool has_errors =
      std::any_of(estimate.parameters.begin(), estimate.parameters.end(),
                  [](const EstimatedParameter& p) { return !p.fixed && std::isfinite(p.se); });
  for (const TestResult& test : estimate.tests) {
    if (test.pass) continue;
    if (test.id == "input_correlation") out.push_back(input_finding(test, of_own_values));
    if (test.id == "ljung_box" && simulation) {
      out.push_back(coloured_simulation(test, independent_errors(estimate, test.channel)));
    }
    if (test.id == "ljung_box" && !simulation)
      out.push_back(colour_finding(test, has_errors, can_shape, of_own_values));
  }
  return out;
}

}  // namespace identikal
