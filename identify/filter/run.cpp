#include "identify/filter/run.h"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/internal/csv_lines.h"
#include "identify/filter/leading_samples.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/report.h"
#include "identify/filter/student_weights.h"
#include "identify/model/check.h"
#include "lib/base/error.h"
#include "lib/base/median.h"
#include "lib/data/units.h"
#include "lib/model/linear_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// What the end of the last recording says of a state, and how well it is known in the median.
std::string state_line(const NamedState& state, const MatrixXd& x, const MatrixXd& sd, Index i) {
  std::vector<double> known;
  for (Index t = 0; t < sd.cols(); ++t) {
    if (std::isfinite(sd(i, t))) known.push_back(sd(i, t));
  }
  if (known.empty()) return fmt::format("state  {:<12} is never determined", state.name);
  const Index last = sd.cols() - 1;
  return fmt::format("state  {:<12} {:>11.6g} +- {:<9.3g} at the end, sd {:.3g}{}{} in the median",
                     state.name, state.si.from_si(x(i, last)), sd(i, last) / state.si.scale,
                     median(std::move(known)) / state.si.scale, state.unit.empty() ? "" : " ",
                     state.unit);
}

// Adds what is said of every row of a recording.
void add_rows(const Model& model, const Dataset& data, const FilterResult& innovations,
              StateEstimate& estimate) {
  const bool complete = data.y.rows() == 1 && !data.y.hasNaN();
  const FilterResult all =
      complete ? innovations : run_filter(model, model.parameters, data, Keep::everything);
  estimate.log_likelihood_by_row.push_back(model.student ? VectorXd::Constant(data.size(), kNone)
                                                         : log_likelihood_by_row(all, data));
  estimate.predictions.push_back(predicted_outputs(model, model.parameters, data, all));
}

// The log-likelihood behind the first samples of every recording.
void leave_out_first(StateEstimate& estimate, Index count) {
  double sum = 0.0;
  for (const VectorXd& rows : estimate.log_likelihood_by_row) {
    if (count >= rows.size() || std::isnan(rows[count])) {
      throw InputError({}, fmt::format("nothing is predicted behind the first {} rows", count),
                       "fewer of them, at least those that determine a diffuse start, and normal "
                       "noise",
                       "another --skip-first");
    }
    sum += rows.tail(rows.size() - count).sum();
  }
  estimate.objective.log_likelihood = sum;
  estimate.notes.push_back(fmt::format(
      "the log-likelihood is that of what comes behind the first {} rows, given them", count));
}

std::string what_was_done(const FilterRunOptions& options) {
  if (!options.lag) return "states smoothed, given the whole recording";
  if (*options.lag == 0) return "states filtered, given what was recorded up to then";
  return fmt::format("states smoothed, given what was recorded up to {} samples later",
                     *options.lag);
}

}  // namespace

StateEstimate filter_recordings(const Model& given, const std::vector<Dataset>& recordings,
                                const FilterRunOptions& options) {
  const Model model = checked(given, recordings);
  if (!has_filter(model)) {
    throw std::invalid_argument("filter_recordings: " + model.source + " is no filter");
  }
  check_inputs(recordings);
  StateEstimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = "filter";
  list_known_parameters(estimate, model.parameters);
  estimate.innovations = report_filter(estimate, model, model.parameters, recordings);
  const auto of_references = [](const Finding& f) { return f.code == FindingCode::reference_band; };
  for (Finding& each : estimate.findings) {
    if (of_references(each))
      each.severity = Severity::warning;  // what runs a filter does not judge it
  }
  if (model.student) estimate.notes.push_back(student_note(model));
  Index rows = 0;
  for (const Dataset& data : recordings) {
    estimate.states.push_back(run_smoother(model, model.parameters, data, options.lag));
    if (estimate.states.back().status != FilterStatus::ok) {
      refuse_filter(model, recordings, estimate.states.back().status);
    }
    rows += data.size();
  }
  if (options.by_row || options.skip_first > 0) {
    for (std::size_t r = 0; r < recordings.size(); ++r) {
      add_rows(model, recordings[r], estimate.innovations[r], estimate);
    }
  }
  if (options.skip_first > 0) leave_out_first(estimate, options.skip_first);
  if (options.lag != Index{0} && !estimate.references.empty()) {
    estimate.references.clear();  // of filtered states, which are not what is written
    std::erase_if(estimate.findings, of_references);
    estimate.notes.emplace_back("references are compared with filtered states alone");
  }
  const std::vector<NamedState> states = named_states(model);
  constexpr std::size_t kShown = 12;
  for (std::size_t i = 0; i < std::min(states.size(), kShown); ++i) {
    estimate.notes.push_back(state_line(states[i], estimate.states.back().x,
                                        estimate.states.back().sd, static_cast<Index>(i)));
  }
  if (states.size() > kShown) {
    estimate.notes.push_back(fmt::format("and {} more states", states.size() - kShown));
  }
  conclude(estimate, fmt::format("{} rows, {}", rows, what_was_done(options)), Basis::tests);
  return estimate;
}

void write_states_csv(std::ostream& out, const Model& model, const std::vector<Dataset>& recordings,
                      const StateEstimate& run) {
  const std::vector<NamedState> states = named_states(model);
  CsvLines lines(out, recordings.size() > 1);
  for (const NamedState& state : states) {
    lines.head(state.name, state.unit);
    lines.head(state.name + "_sd", state.unit);
  }
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    const VectorXd& stamps = stamps_of(recordings[r]);
    const SmootherResult& smoothed = run.states[r];
    for (Index t = 0; t < stamps.size(); ++t) {
      lines.begin_line(r, stamps[t]);
      for (std::size_t i = 0; i < states.size(); ++i) {
        const auto row = static_cast<Index>(i);
        lines.cell(states[i].si.from_si(smoothed.x(row, t)));
        lines.cell(smoothed.sd(row, t) / states[i].si.scale);
      }
    }
  }
  lines.end();
}

void write_innovations_csv(std::ostream& out, const std::vector<Dataset>& recordings,
                           const StateEstimate& run) {
  const std::vector<Channel>& outputs = recordings[0].outputs;
  CsvLines lines(out, recordings.size() > 1);
  std::vector<double> scale;
  for (const Channel& channel : outputs) {
    scale.push_back(unit_scale(channel.unit));
    lines.head(channel.name + "_innovation", channel.unit);
    lines.head(channel.name + "_sd", channel.unit);
    lines.head(channel.name + "_standardised", "");
  }
  const bool by_row = !run.log_likelihood_by_row.empty();
  if (by_row) lines.head("log_likelihood", "");
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    const VectorXd& stamps = stamps_of(recordings[r]);
    const FilterResult& filter = run.innovations[r];
    for (Index t = 0; t < stamps.size(); ++t) {
      lines.begin_line(r, stamps[t]);
      for (std::size_t i = 0; i < outputs.size(); ++i) {
        const auto row = static_cast<Index>(i);
        lines.cell(filter.e(row, t) / scale[i]);
        lines.cell(filter.e_sd(row, t) / scale[i]);
        lines.cell(filter.standardised(row, t));
      }
      if (by_row) lines.cell(run.log_likelihood_by_row[r][t]);
    }
  }
  lines.end();
}

namespace {

void write_correlations(const MatrixXd& covariance, CsvLines& lines) {
  for (Index i = 0; i < covariance.rows(); ++i) {
    for (Index j = i + 1; j < covariance.rows(); ++j) {
      lines.cell(covariance(i, j) / std::sqrt(covariance(i, i) * covariance(j, j)));
    }
  }
}

}  // namespace

void write_predictions_csv(std::ostream& out, const std::vector<Dataset>& recordings,
                           const StateEstimate& run) {
  const std::vector<Channel>& outputs = recordings[0].outputs;
  CsvLines lines(out, recordings.size() > 1);
  std::vector<Unit> units;
  for (const Channel& channel : outputs) {
    units.push_back(unit_or_dimensionless(channel.unit));
    lines.head(channel.name, channel.unit);
    lines.head(channel.name + "_sd", channel.unit);
  }
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    for (std::size_t j = i + 1; j < outputs.size(); ++j) {
      lines.head(fmt::format("{}_{}_correlation", outputs[i].name, outputs[j].name), "");
    }
  }
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    const VectorXd& stamps = stamps_of(recordings[r]);
    const OutputPredictions& expected = run.predictions[r];
    for (Index t = 0; t < stamps.size(); ++t) {
      lines.begin_line(r, stamps[t]);
      for (std::size_t i = 0; i < outputs.size(); ++i) {
        const auto row = static_cast<Index>(i);
        lines.cell(units[i].from_si(expected.mean(row, t)));
        lines.cell(expected.sd(row, t) / units[i].scale);
      }
      if (!expected.covariance.empty()) {
        write_correlations(expected.covariance[static_cast<std::size_t>(t)], lines);
      }
    }
  }
  lines.end();
}

}  // namespace identikal
