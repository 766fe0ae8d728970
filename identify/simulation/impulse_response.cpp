#include "identify/simulation/impulse_response.h"

#include <algorithm>
#include <cmath>
#include <ostream>

#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "identify/result/csv.h"
#include "lib/base/error.h"
#include "lib/base/nearest_name.h"
#include "lib/data/units.h"
#include "lib/model/linear_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// What the impulse is of: a column of B and D, or a direction of the state.
struct Impulse {
  Index input = -1, state = -1;
  double unit = 1.0;
};

Impulse impulse_of(const Model& model, const std::string& name, Index states) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < model.inputs.size(); ++i) {
    names.push_back(model.inputs[i].name);
    if (names.back() == name) {
      return {static_cast<Index>(i), -1, unit_scale(model.inputs[i].unit)};
    }
  }
  for (Index i = 0; i < states; ++i) {
    const StateName* named = model.states.empty() ? nullptr : &model.states[i];
    names.push_back(named == nullptr ? fmt::format("x{}", i + 1) : named->name);
    if (names.back() == name) return {-1, i, named == nullptr ? 1.0 : unit_scale(named->unit)};
  }
  throw InputError({model.source, 0, 0}, fmt::format("no input or state '{}'", name),
                   "one of " + fmt::format("{}", fmt::join(names, ", ")),
                   did_you_mean(name, names));
}

// The state behind the impulse, and the output with it.
VectorXd first_state(const StateSpace& m, const Impulse& of, bool derivative) {
  if (of.input >= 0) return m.B.col(of.input);
  if (derivative) return VectorXd::Zero(m.states());
  return VectorXd::Unit(m.states(), of.state);
}
VectorXd first_output(const StateSpace& m, const Impulse& of) {
  return of.input >= 0 ? VectorXd(m.D.col(of.input)) : VectorXd::Zero(m.outputs());
}

// Column k of the result is the response k samples behind the impulse.
MatrixXd responses(const StateSpace& m, const Impulse& of, Index rows) {
  MatrixXd out(m.outputs(), rows);
  VectorXd x = first_state(m, of, false);
  out.col(0) = first_output(m, of);
  for (Index k = 1; k < rows; ++k, x = (m.A * x).eval()) out.col(k) = m.C * x;
  return out;
}

// d(responses) along a derivative of the model.
MatrixXd slopes(const StateSpace& m, const StateSpace& d, const Impulse& of, Index rows) {
  MatrixXd out(m.outputs(), rows);
  VectorXd x = first_state(m, of, false), dx = first_state(d, of, true);
  out.col(0) = first_output(d, of);
  for (Index k = 1; k < rows; ++k) {
    out.col(k) = d.C * x + m.C * dx;
    dx = (d.A * x + m.A * dx).eval();
    x = (m.A * x).eval();
  }
  return out;
}

MatrixXd errors_of(const Model& model, const StateSpace& at, const Impulse& of, Index rows,
                   const ParameterErrors& errors) {
  const std::vector<StateSpace> by = model_derivatives(as_linear(model), model.parameters);
  const auto k = static_cast<Index>(errors.entries.size());
  MatrixXd all(at.outputs() * rows, k);
  for (Index i = 0; i < k; ++i) {
    const Index entry = errors.entries[static_cast<std::size_t>(i)];
    all.col(i) = slopes(at, by[static_cast<std::size_t>(entry)], of, rows).reshaped();
  }
  const VectorXd variance = (all * errors.covariance).cwiseProduct(all).rowwise().sum();
  return variance.cwiseMax(0.0).cwiseSqrt().reshaped(at.outputs(), rows);
}

}  // namespace

ParameterErrors parameter_errors(const StoredEstimate& result, const Model& model) {
  const ReportedEntries entries = reported_entries(model.parameters);
  std::vector<std::string> free, reported;
  for (std::size_t e = 0; e < entries.names.size(); ++e) {
    if (!model.parameters[entries.parameter[e]].fixed) free.push_back(entries.names[e]);
  }
  ParameterErrors out;
  std::vector<double> se;
  std::vector<Index> rows;  // of the correlation
  for (const EstimatedParameter& p : result.parameters) {
    if (p.fixed) continue;
    reported.push_back(p.name);
    const auto row =
        std::find(result.correlation_names.begin(), result.correlation_names.end(), p.name);
    if (!std::isfinite(p.se) || row == result.correlation_names.end()) continue;
    out.entries.push_back(static_cast<Index>(reported.size()) - 1);
    se.push_back(p.se * unit_scale(p.unit));
    rows.push_back(row - result.correlation_names.begin());
  }
  if (reported != free) return {};
  const VectorXd scale = Eigen::Map<const VectorXd>(se.data(), static_cast<Index>(se.size()));
  out.covariance =
      scale.asDiagonal() * MatrixXd(result.correlation(rows, rows)) * scale.asDiagonal();
  return out;
}

ImpulseResponse impulse_response(const Model& model, const std::string& impulse, Index rows,
                                 const ParameterErrors& errors) {
  if (!is_linear(model)) {
    throw InputError({model.source, 0, 0}, "an impulse response of a model that is not linear",
                     "one that is linear and the same at every sample",
                     "simulate drives any other");
  }
  if (!(as_linear(model).dt > 0.0) || !(model.time.step > 0.0)) {
    throw InputError(model.time.at, "the sampling period is not known", "time: {step: 0.1 s}");
  }
  if (as_linear(model).continuous && as_linear(model).hold == InputHold::linear) {
    throw InputError(model.time.at, "an impulse of an input that is held linearly", "inputs: zoh",
                     "between samples it would be a ramp up and one down");
  }
  const StateSpace at = instantiate(as_linear(model), model.parameters);
  const Impulse of = impulse_of(model, impulse, at.states());
  ImpulseResponse out;
  out.time = at.dt * VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1));
  out.mean = responses(at, of, rows) * of.unit;
  if (!errors.entries.empty()) out.sd = errors_of(model, at, of, rows, errors) * of.unit;
  for (const ChannelSource& output : model.outputs) {
    const auto row = static_cast<Index>(out.names.size());
    out.names.push_back(output.name);
    out.units.push_back(output.unit);
    out.mean.row(row) /= unit_scale(output.unit);
    if (out.sd.size() > 0) out.sd.row(row) /= unit_scale(output.unit);
  }
  return out;
}

void write_impulse_csv(std::ostream& out, const ImpulseResponse& response) {
  const double wide = normal_quantile(0.975);
  const bool with_errors = response.sd.size() > 0;
  out << "time [s]";
  for (std::size_t i = 0; i < response.names.size(); ++i) {
    out << ',' << csv_heading(response.names[i], response.units[i]);
    for (const char* what : {"_se", "_low", "_high"}) {
      if (with_errors) out << ',' << csv_heading(response.names[i] + what, response.units[i]);
    }
  }
  out << '\n';
  for (Index k = 0; k < response.time.size(); ++k) {
    out << fmt::format("{:.15g}", response.time[k]);
    for (Index i = 0; i < response.mean.rows(); ++i) {
      const double mean = response.mean(i, k);
      out << fmt::format(",{}", mean);
      if (!with_errors) continue;
      const double se = response.sd(i, k);
      out << fmt::format(",{},{},{}", se, mean - wide * se, mean + wide * se);
    }
    out << '\n';
  }
}

}  // namespace identikal
