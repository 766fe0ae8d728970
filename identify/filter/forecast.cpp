#include "identify/filter/forecast.h"

#include <cmath>
#include <ostream>

#include <fmt/format.h>

#include "identify/estimate/conclusion.h"
#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/report.h"
#include "identify/filter/simulated_fit.h"
#include "identify/model/check.h"
#include "identify/model/recorded_scale.h"
#include "identify/result/csv.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void check_future(const Model& model, const Dataset& recording, Index rows, const Dataset* future) {
  if (rows < 1) throw InputError({}, fmt::format("{} rows to forecast", rows), "1 or more");
  if (recording.u.rows() == 0) return;
  if (is_formula_model(model) && !as_formulas(model).late.empty()) {
    throw InputError({model.source, 0, 0},
                     "a forecast of a model whose inputs are late by a parameter",
                     "delay: a time, such as the one that was estimated");
  }
  if (future == nullptr) {
    throw InputError({model.source, 0, 0}, "the model has inputs", "those of the rows to come",
                     "--inputs FILE");
  }
  if (future->u.cols() < rows) {
    throw InputError({future->name, 0, 0}, fmt::format("inputs of {} rows", future->u.cols()),
                     fmt::format("of {}, as many as are forecast", rows));
  }
  for (Index t = 0; t < rows; ++t) {
    if (future->u.col(t).allFinite()) continue;
    throw InputError({future->name, 0, 0}, fmt::format("an input is missing in row {}", t + 1),
                     "every input in every row");
  }
}

// Of the rows to come: as the future's own stamps where samples are irregular and it is given, else
// a period apart.
VectorXd times_ahead(const Model& model, const Dataset& recording, Index rows,
                     const Dataset* future) {
  const bool irregular = is_formula_model(model) && as_formulas(model).irregular;
  const double last = recording.time[recording.size() - 1];
  if (irregular && future != nullptr) {
    if (future->time[0] > last) return future->time.head(rows);
    throw InputError({future->name, 0, 0}, "its rows do not come behind the recording's last one",
                     fmt::format("time stamps above {:.9g} s", last));
  }
  return last + recording.dt * VectorXd::LinSpaced(rows, 1.0, static_cast<double>(rows)).array();
}

}  // namespace

Dataset with_rows_ahead(const Model& model, const Dataset& recording, Index rows,
                        const Dataset* future) {
  check_future(model, recording, rows, future);
  Dataset out = recording;
  const Index N = recording.size();
  out.y.conservativeResize(Eigen::NoChange, N + rows);
  out.y.rightCols(rows).setConstant(kNone);
  out.u.conservativeResize(Eigen::NoChange, N + rows);
  if (recording.u.rows() > 0) out.u.rightCols(rows) = future->u.leftCols(rows);
  out.time.conservativeResize(N + rows);
  out.time.tail(rows) = times_ahead(model, recording, rows, future);
  if (out.reference.rows() > 0) {
    out.reference.conservativeResize(Eigen::NoChange, N + rows);
    out.reference.rightCols(rows).setConstant(kNone);
  }
  return out;
}

namespace {

// As the recording has its outputs.
Forecast as_recorded(const Model& model, const std::vector<Channel>& outputs, const MatrixXd& mean,
                     const MatrixXd& sd) {
  const double wide = normal_quantile(0.975);
  Forecast out;
  out.mean = mean;
  out.sd = sd;
  for (Index i = 0; i < mean.rows(); ++i) {
    const Channel& channel = outputs[static_cast<std::size_t>(i)];
    const RecordedScale to =
        recorded_scale(model.outputs[static_cast<std::size_t>(i)], channel.unit);
    out.names.push_back(channel.name);
    out.units.push_back(channel.unit);
    out.mean.row(i) = to.factor * mean.row(i).array() + to.shift;
    out.sd.row(i) *= std::abs(to.factor);
  }
  out.low = out.mean - wide * out.sd;
  out.high = out.mean + wide * out.sd;
  return out;
}

}  // namespace

OutputForecast forecast(const Model& given, const Dataset& recording, Index rows,
                        const Dataset* future) {
  const Model model = checked(given, {recording});
  check_inputs({recording});
  const Dataset all = with_rows_ahead(model, recording, rows, future);
  OutputForecast out;
  out.model_name = model.name;
  out.objective.method = "forecast";
  list_known_parameters(out, model.parameters);
  report_filter(out, model, model.parameters, {recording});
  const Index N = recording.size();
  const FilterResult filter = run_filter(model, model.parameters, all);
  if (filter.status != FilterStatus::ok) refuse_filter(model, {recording}, filter.status);
  if (filter.first_proper > N || !filter.x_pred.col(N).allFinite()) {
    refuse_filter(model, {recording}, FilterStatus::undetermined);
  }
  const MatrixXd mean =
      outputs_from(model, model.parameters, samples_from(all, N), filter.x_pred.col(N));
  out.forecast = as_recorded(model, recording.outputs, mean, filter.e_sd.rightCols(rows));
  out.forecast.time = all.time.tail(rows);
  conclude(out, fmt::format("{} rows ahead of {}", rows, recording.name), Basis::tests);
  return out;
}

void write_forecast_csv(std::ostream& out, const Forecast& forecast) {
  out << "time [s]";
  for (std::size_t i = 0; i < forecast.names.size(); ++i) {
    for (const char* what : {"", "_sd", "_low", "_high"}) {
      out << ',' << csv_heading(forecast.names[i] + what, forecast.units[i]);
    }
  }
  out << '\n';
  for (Index t = 0; t < forecast.time.size(); ++t) {
    out << fmt::format("{:.15g}", forecast.time[t]);
    for (Index i = 0; i < forecast.mean.rows(); ++i) {
      for (const MatrixXd* part : {&forecast.mean, &forecast.sd, &forecast.low, &forecast.high}) {
        out << fmt::format(",{:.10g}", (*part)(i, t));
      }
    }
    out << '\n';
  }
}

}  // namespace identikal
