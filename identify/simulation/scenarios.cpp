#include "identify/simulation/scenarios.h"

#include <optional>
#include <ostream>

#include <fmt/format.h>

#include "identify/filter/forecast.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/report.h"
#include "identify/model/recorded_scale.h"
#include "identify/result/csv.h"
#include "identify/simulation/simulate.h"
#include "lib/base/random.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;

Scenarios simulate_scenarios(const Model& model, const Dataset& recording, Index rows, int count,
                             std::uint64_t seed, const Dataset* future) {
  const Index N = recording.size();
  const Dataset all = with_rows_ahead(model, recording, rows, future);
  const std::optional<Model> start = going_on(model, model.parameters, all, N);
  if (!start) refuse_filter(model, {recording}, FilterStatus::undetermined);
  const Dataset ahead = samples_from(all, N);
  Scenarios out;
  out.time = ahead.time;
  Random random(seed);
  for (int number = 0; number < count; ++number) {
    MatrixXd y = simulated_outputs(*start, ahead, random);
    for (Index i = 0; i < y.rows(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      const RecordedScale to = recorded_scale(model.outputs[at], recording.outputs[at].unit);
      y.row(i) = to.factor * y.row(i).array() + to.shift;
    }
    out.y.push_back(std::move(y));
  }
  for (const Channel& channel : recording.outputs) {
    out.names.push_back(channel.name);
    out.units.push_back(channel.unit);
  }
  return out;
}

void write_scenarios_csv(std::ostream& out, const Scenarios& scenarios) {
  out << "time [s]";
  for (std::size_t number = 1; number <= scenarios.y.size(); ++number) {
    for (std::size_t i = 0; i < scenarios.names.size(); ++i) {
      out << ','
          << csv_heading(fmt::format("{}_{}", scenarios.names[i], number), scenarios.units[i]);
    }
  }
  out << '\n';
  for (Index t = 0; t < scenarios.time.size(); ++t) {
    out << fmt::format("{:.15g}", scenarios.time[t]);
    for (const MatrixXd& y : scenarios.y) {
      for (Index i = 0; i < y.rows(); ++i) out << fmt::format(",{:.10g}", y(i, t));
    }
    out << '\n';
  }
}

}  // namespace identikal
