#include "identify/noise/estimate.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "identify/filter/outliers.h"
#include "identify/filter/report.h"
#include "lib/data/units.h"
#include "lib/filter/information.h"

namespace identikal {

using Eigen::Index;

Index samples_present(const std::vector<Dataset>& recordings) {
  Index samples = 0;
  for (const Dataset& data : recordings) {
    samples += static_cast<Index>((data.y.array() == data.y.array()).count());
  }
  return samples;
}

void check_recordings(const ModelFile& model, const std::vector<Dataset>& recordings) {
  const Index unknowns = coordinates(model.parameters).size();
  if (unknowns == 0) {
    throw InputError({model.path, 0, 0}, "nothing is free to be estimated",
                     "at least one parameter with {value: ...} or a structured Q or R",
                     "use 'check' to test a filter whose noise is given");
  }
  if (recordings.empty()) throw std::invalid_argument("there is no recording");
  const Index samples = samples_present(recordings);
  if (samples <= unknowns) {
    throw InputError({recordings[0].name, 0, 0},
                     fmt::format("{} samples for {} unknowns", samples, unknowns),
                     "more samples than unknowns", "use a longer recording or fix parameters");
  }
  check_channels(recordings);
}

void check_channels(const std::vector<Dataset>& recordings) {
  check_inputs(recordings);
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
  }
}

void check_inputs(const std::vector<Dataset>& recordings) {
  if (recordings.empty()) throw std::invalid_argument("there is no recording");
  for (const Dataset& data : recordings) {
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

double unit_scale(const std::string& unit) {
  const auto parsed = parse_unit(unit);
  return parsed ? parsed->scale : 1.0;
}

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
    const Parameter& parameter = end[static_cast<std::size_t>(after.parameter[i])];
    p.fixed = parameter.fixed;
    if (parameter.domain == Domain::scalar) {
      p.bounds = {unit.from_si(parameter.min), unit.from_si(parameter.max)};
    } else if (after.variance[i]) {
      p.bounds[0] = 0.0;
    }
    estimate.parameters.push_back(std::move(p));
  }
}

void list_known_parameters(Estimate& estimate, const ParameterSet& parameters) {
  list_parameters(estimate, parameters, parameters);
  for (EstimatedParameter& p : estimate.parameters) p.fixed = true;
}

ParameterSet parameters_of(const Estimate& estimate, const ParameterSet& parameters) {
  Eigen::VectorXd entries = free_entries(parameters);
  Index i = 0;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (!p.fixed) entries[i++] = p.value * unit_scale(p.unit);
  }
  return with_entries(parameters, entries);
}

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
    out.unit[j] = unit_scale(out.reported[static_cast<std::size_t>(j)]->unit);
  }
  return out;
}

void conclude_noise_estimate(Estimate& estimate, const SolverSummary& summary) {
  const Identifiability& id = estimate.identifiability;
  const bool converged = summary.usable();
  if (!converged) {
    // The shape of the likelihood away from its maximum says nothing about errors.
    for (EstimatedParameter& p : estimate.parameters) {
      if (p.fixed) continue;
      p.se = p.se_sandwich = p.crb_se = kNone;
      p.ci95 = {kNone, kNone};
      if (p.verdict == Verdict::ok) p.verdict = Verdict::weak;
    }
    estimate.covariance_kind = "none: the search did not converge";
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
    if (!converged) estimate.message += "; the search did not converge";
    return;
  }
  if (!converged) {
    estimate.status = Status::not_converged;
    estimate.message = summary.message;
    return;
  }
  estimate.status = Status::ok;
  estimate.message = "converged";
}

void describe_filter_loss(Estimate& estimate, const ModelFile& model, const ParameterSet& at) {
  ExcessMeanSquareError& loss = estimate.excess_mean_square_error.emplace();
  if (model.form == ModelFile::Form::nonlinear) {
    loss.reason = "a nonlinear model has no steady filter";
    return;
  }
  const std::vector<StateSpace> derivatives = model_derivatives(model.linear, at);
  if (!std::all_of(derivatives.begin(), derivatives.end(), changes_only_noise)) {
    loss.reason = "parameters other than noise are free";
    return;
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
      return;
    } else if (p.verdict == Verdict::flat || p.verdict == Verdict::unexcited) {
      loss.reason = fmt::format("the data do not determine {}", p.name);
      return;
    } else if (!has_row || !std::isfinite(p.se)) {
      loss.reason = fmt::format("the error of {} is not known", p.name);
      return;
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
    return;
  }
  const StateSpace system = instantiate(model.linear, at);
  const auto gain = steady_gain_sensitivity(system, known);
  if (!gain) {
    loss.reason = "there is no steady filter";
    return;
  }
  const auto sd = Eigen::Map<const Eigen::VectorXd>(se.data(), static_cast<Index>(se.size()));
  const auto relative = expected_filter_loss(
      system, *gain, sd.asDiagonal() * estimate.correlation(rows, rows) * sd.asDiagonal());
  if (relative) {
    loss.relative = *relative;
  } else {
    loss.reason = "the states are known without error";
  }
}

void describe_noise_estimate(Estimate& estimate, const ModelFile& model, const ParameterSet& end,
                             const std::vector<Dataset>& recordings) {
  const ReportedEntries entries = reported_entries(end);
  for (std::size_t i = 0; i < estimate.parameters.size(); ++i) {
    double& low = estimate.parameters[i].ci95[0];
    if (entries.variance[i] && low < 0.0) low = 0.0;
  }
  describe_filter_loss(estimate, model, end);
  const std::vector<FilterResult> filters = describe_filter(estimate, model, end, recordings);
  warn_of_outliers_and_offset(estimate, model, end, recordings, filters);
  distrust_serious_warnings(estimate);
  Objective& objective = estimate.objective;
  const double k = static_cast<double>(free_entries(end).size());
  objective.samples = static_cast<long>(samples_present(recordings));
  if (static_cast<double>(objective.samples) < 5.0 * k) {  // the likelihood is no parabola yet
    estimate.warnings.push_back(
        {"few_samples",
         "warning",
         {},
         fmt::format("{} samples for {} unknowns: the errors are those of long recordings, and "
                     "here too small",
                     objective.samples, k),
         "record more, or fix parameters that are known"});
  }
  objective.aic = 2.0 * k - 2.0 * objective.log_likelihood;
  objective.bic =
      k * std::log(static_cast<double>(objective.samples)) - 2.0 * objective.log_likelihood;
  warn_of_coloured_innovations(estimate);
}

void distrust_serious_warnings(Estimate& estimate) {
  const bool serious = std::any_of(estimate.warnings.begin(), estimate.warnings.end(),
                                   [](const Warning& w) { return w.severity == "serious"; });
  if (!serious || estimate.status != Status::ok) return;
  estimate.status = Status::untrusted;
  estimate.message += ", but the data do not fit the model: see the warnings";
}

void warn_of_coloured_innovations(Estimate& estimate) {
  const bool shapes = estimate.objective.filter.empty();  // it takes linear models
  const bool errors =
      std::any_of(estimate.parameters.begin(), estimate.parameters.end(),
                  [](const EstimatedParameter& p) { return !p.fixed && std::isfinite(p.se); });
  for (const TestResult& test : estimate.tests) {
    if (!test.pass && test.id == "input_correlation") {
      estimate.warnings.push_back(
          {"input_in_innovations",
           "warning",
           {test.channel},
           fmt::format(
               "the innovations of '{}' follow earlier inputs (p = {:.2g}): what the inputs "
               "do is not all in the model",
               test.channel, test.p),
           "a missing mode, a delay, a wrong gain or sign of an input; the page shows at which "
           "lag"});
    }
    if (test.pass || test.id != "ljung_box") continue;
    estimate.warnings.push_back(
        {"coloured_innovations",
         "warning",
         {test.channel},
         fmt::format(
             "the innovations of '{}' are not white (Ljung-Box p = {:.2g}): the model misses "
             "dynamics or coloured noise{}",
             test.channel, test.p, errors ? ", and the errors above are too small" : ""),
         shapes ? "'identikal shape' looks for a filter that colours the noise; else extend the "
                  "model: a filter tuned on a wrong model is not optimal"
                : "extend the model, by states that colour the noise if need be: a filter tuned on "
                  "a wrong model is not optimal"});
  }
}

}  // namespace identikal
