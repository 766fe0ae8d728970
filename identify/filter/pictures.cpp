#include "identify/filter/pictures.h"

#include <algorithm>
#include <cmath>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/report.h"
#include "identify/filter/simulated_fit.h"
#include "lib/data/units.h"
#include "lib/filter/kalman.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Rows, and numbers of all state covariances, that a forecast may hold at a time.
constexpr double kMostForecastRows = 1e5, kMostNumbers = 4e6;

// Runs on from row `from` of the recording without its outputs; columns from `at` of the pictures.
void forecast(const StateSpace& system, InitialState initial, const LinearModel& model,
              const Dataset& data, Index at, Pictures& out) {
  const Index N = data.size();
  const auto from = static_cast<Index>(kForecastFrom * static_cast<double>(N));
  const Index states = std::max<Index>(1, system.states());
  const auto window = static_cast<Index>(
      std::min(kMostForecastRows, kMostNumbers / static_cast<double>(states * states)));
  const Index end = std::min(N, from + window / 2);
  const Index first = std::max<Index>(0, from - window / 2);
  if (end - from < 2 || from - first < 2) return;
  MatrixXd y = data.y.middleCols(first, end - first);
  y.rightCols(end - from).setConstant(kNone);
  const MatrixXd u = model_inputs(model, data.u).middleCols(first, end - first);
  const FilterResult filter = kalman_filter(system, initial, y, u);
  if (filter.status != FilterStatus::ok || filter.first_proper > from - first) return;
  for (Index t = from; t < end; ++t) {
    const Index k = t - first;
    const Eigen::VectorXd mean = system.C * filter.x_pred.col(k) + system.D * u.col(k);
    const MatrixXd Sigma = system.C * filter.P_pred[k] * system.C.transpose() + system.R;
    for (Index i = 0; i < mean.size(); ++i) {
      const Unit unit = unit_or_dimensionless(data.outputs[i].unit);
      out.simulation(i, at + t) = unit.from_si(mean[i]);
      out.simulation_sd(i, at + t) = std::sqrt(std::max(0.0, Sigma(i, i))) / unit.scale;
    }
  }
}

// The model on its own; columns from `at` of the pictures.
void simulate(const Model& model, const ParameterSet& parameters, const Dataset& data, Index at,
              Pictures& out) {
  const MatrixXd y = simulated_outputs(model, parameters, data);
  for (Index i = 0; i < y.rows(); ++i) {
    const Unit unit = unit_or_dimensionless(data.outputs[i].unit);
    for (Index t = 0; t < y.cols(); ++t) {
      out.simulation(i, at + t) = std::isfinite(y(i, t)) ? unit.from_si(y(i, t)) : kNone;
    }
  }
}

}  // namespace

void picture_filter(const Model& model, const std::vector<Dataset>& recordings,
                    FilterEstimate& estimate) {
  Pictures& out = estimate.pictures;
  const Series& series = estimate.series;
  out.one_step = series.predicted;
  Index rows = 0;
  for (const Dataset& data : recordings) rows += data.size();
  if (rows != series.measured.cols()) return;
  const ParameterSet end = parameters_of(estimate, model.parameters);
  out.simulation = MatrixXd::Constant(series.measured.rows(), rows, kNone);
  out.simulation_sd = out.simulation;
  Index at = 0;
  const bool simulates = !estimate.simulation.empty();
  for (const Dataset& data : recordings) {
    if (is_formula_model(model)) {
      if (simulates) simulate(model, end, data, at, out);
    } else {
      const LinearModel& linear = as_linear(model);
      forecast(instantiate(linear, end), linear.initial, linear, data, at, out);
    }
    at += data.size();
  }
  if (free_entries(end).isApprox(free_entries(model.parameters), 1e-9)) return;
  std::vector<FilterResult> filters;
  for (const Dataset& data : recordings) {
    filters.push_back(run_filter(model, model.parameters, data, Keep::innovations));
    if (filters.back().status != FilterStatus::ok) return;
  }
  out.standardised_before = side_by_side(filters, 0);
}

}  // namespace identikal
