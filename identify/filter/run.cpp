#include "identify/filter/run.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <ostream>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/leading_samples.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/report.h"
#include "identify/filter/student_weights.h"
#include "identify/model/check.h"
#include "identify/result/csv.h"
#include "lib/base/error.h"
#include "lib/base/median.h"
#include "lib/data/units.h"
#include "lib/model/linear_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct NamedState {
  std::string name, unit;
  Unit si;
};

std::vector<NamedState> named_states(const Model& model) {
  const StateSpace system = instantiate(noise_model(model), model.parameters);
  std::vector<NamedState> out;
  for (Index i = 0; i < system.states(); ++i) {
    NamedState state{fmt::format("x{}", i + 1), "", Unit{}};
    if (!model.states.empty()) {
      const StateName& named = model.states[i];
      out.push_back({named.name, named.unit, unit_or_dimensionless(named.unit)});
      continue;
    }
    for (Index j = 0; j < system.outputs(); ++j) {
      const bool shown = system.C(j, i) == 1.0 && (system.C.row(j).array() != 0.0).count() == 1 &&
                         system.D.row(j).isZero(0.0);
      if (!shown) continue;
      const ChannelSource& output = model.outputs[j];
      state = {output.name, output.unit, unit_or_dimensionless(output.unit)};
      break;
    }
    out.push_back(std::move(state));
  }
  return out;
}

// Cells of a line, in a buffer that is written out now and then.
class CsvLines {
 public:
  CsvLines(std::ostream& out, bool several) : out_(out), several_(several) {
    text_ = several ? "recording,time [s]" : "time [s]";
  }
  ~CsvLines() { flush(); }
  CsvLines(const CsvLines&) = delete;
  CsvLines& operator=(const CsvLines&) = delete;

  void head(const std::string& name, const std::string& unit) {
    text_ += "," + csv_heading(name, unit);
  }
  void begin_line(std::size_t recording, double time) {
    text_ += '\n';
    if (text_.size() > kBuffer) flush();
    if (several_) fmt::format_to(std::back_inserter(text_), "{},", recording + 1);
    fmt::format_to(std::back_inserter(text_), "{:.15g}", time);
  }
  void cell(double value) {
    text_ += ',';
    // As few digits as read back to the same number.
    if (std::isfinite(value)) fmt::format_to(std::back_inserter(text_), "{}", value);
  }
  void end() { text_ += '\n'; }

 private:
  static constexpr std::size_t kBuffer = 1 << 18;
  void flush() {
    out_.write(text_.data(), static_cast<std::streamsize>(text_.size()));
    text_.clear();
  }
  std::ostream& out_;
  bool several_;
  std::string text_;
};

const VectorXd& stamps_of(const Dataset& data) {
  return data.stamps.size() > 0 ? data.stamps : data.time;
}

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

VectorXd rows_of(const Model& model, const Dataset& data, const FilterResult& innovations) {
  if (model.student) return VectorXd::Constant(data.size(), kNone);
  if (data.y.rows() == 1) return log_likelihood_by_row(innovations);
  return log_likelihood_by_row(run_filter(model, model.parameters, data, Keep::everything));
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
      estimate.log_likelihood_by_row.push_back(
          rows_of(model, recordings[r], estimate.innovations[r]));
    }
  }
  if (options.skip_first > 0) leave_out_first(estimate, options.skip_first);
  if (options.lag != Index{0} && !estimate.references.empty()) {
    estimate.references.clear();  // of filtered states, which are not what is written
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

}  // namespace identikal
