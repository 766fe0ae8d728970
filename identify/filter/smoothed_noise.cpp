#include "identify/filter/smoothed_noise.h"

#include <ostream>

#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/internal/csv_lines.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/report.h"
#include "lib/base/error.h"
#include "lib/model/linear_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Names and units of the process noises.
std::vector<NamedState> process_noises(const Model& model) {
  const MatrixXd G = written_matrices(noise_model(model), model.parameters).G;
  const std::vector<NamedState> states = named_states(model);
  if (G.rows() == G.cols() && G.isIdentity(0.0)) return states;
  std::vector<NamedState> out;
  for (Index i = 0; i < G.cols(); ++i) out.push_back({fmt::format("w{}", i + 1), "", Unit{}});
  return out;
}

void write_rows(const VectorXd& stamps, const DisturbanceResult& noise,
                const std::vector<NamedState>& process, const std::vector<Channel>& outputs,
                std::size_t recording, CsvLines& lines) {
  for (Index t = 0; t < stamps.size(); ++t) {
    lines.begin_line(recording, stamps[t]);
    for (std::size_t i = 0; i < process.size(); ++i) {
      lines.cell(noise.w(static_cast<Index>(i), t) / process[i].si.scale);
      lines.cell(noise.w_sd(static_cast<Index>(i), t) / process[i].si.scale);
    }
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      const double scale = unit_scale(outputs[i].unit);
      lines.cell(noise.v(static_cast<Index>(i), t) / scale);
      lines.cell(noise.v_sd(static_cast<Index>(i), t) / scale);
    }
    for (Index i = 0; i < noise.state_t.rows(); ++i) lines.cell(noise.state_t(i, t));
    for (Index i = 0; i < noise.output_t.rows(); ++i) lines.cell(noise.output_t(i, t));
  }
}

}  // namespace

void write_disturbances_csv(std::ostream& out, const Model& model,
                            const std::vector<Dataset>& recordings) {
  const std::vector<NamedState> process = process_noises(model), states = named_states(model);
  const std::vector<Channel>& outputs = recordings[0].outputs;
  CsvLines lines(out, recordings.size() > 1);
  for (const NamedState& each : process) {
    lines.head(each.name + "_noise", each.unit);
    lines.head(each.name + "_noise_sd", each.unit);
  }
  for (const Channel& each : outputs) {
    lines.head(each.name + "_error", each.unit);
    lines.head(each.name + "_error_sd", each.unit);
  }
  for (const NamedState& each : states) lines.head(each.name + "_jump_t", "");
  for (const Channel& each : outputs) lines.head(each.name + "_error_t", "");
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    const DisturbanceResult noise =
        run_disturbance_smoother(model, model.parameters, recordings[r]);
    if (noise.status != FilterStatus::ok) refuse_filter(model, recordings, noise.status);
    write_rows(stamps_of(recordings[r]), noise, process, outputs, r, lines);
  }
  lines.end();
}

void write_trajectories_csv(std::ostream& out, const Model& model,
                            const std::vector<Dataset>& recordings, int count, std::uint64_t seed) {
  if (!is_linear(model) && !changes(model)) {
    throw InputError({model.source, 0, 0}, "trajectories of the states of a nonlinear model",
                     "a model that is linear in its states");
  }
  const std::vector<NamedState> states = named_states(model);
  out << "trajectory,";
  CsvLines lines(out, recordings.size() > 1);
  for (const NamedState& each : states) lines.head(each.name, each.unit);
  Random random(seed);
  for (int number = 1; number <= count; ++number) {
    for (std::size_t r = 0; r < recordings.size(); ++r) {
      const SimulatedPath drawn =
          run_simulated_path(model, model.parameters, recordings[r], random);
      if (drawn.status != FilterStatus::ok) refuse_filter(model, recordings, drawn.status);
      const VectorXd& stamps = stamps_of(recordings[r]);
      for (Index t = 0; t < stamps.size(); ++t) {
        lines.begin_line(r, stamps[t], number);
        for (std::size_t i = 0; i < states.size(); ++i) {
          lines.cell(states[i].si.from_si(drawn.x(static_cast<Index>(i), t)));
        }
      }
    }
  }
  lines.end();
}

}  // namespace identikal
