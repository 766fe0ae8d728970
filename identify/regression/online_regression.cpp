#include "identify/regression/online_regression.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "identify/regression/track.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"

namespace identikal {

using Eigen::Index;
using Eigen::VectorXd;

RegressionSettings regression_settings(const Model& model) {
  const RegressionModel& written = as_regression(model);
  const auto refuse_open = [&](const char* key, bool given) {
    if (given) return;
    throw InputError({model.source, 0, 0},
                     fmt::format("'{}' of the regression is left to a recording", key),
                     "a number, or the result of 'track', which has chosen it");
  };
  refuse_open("inputs", written.inputs.has_value());
  refuse_open("feedback", written.feedback.has_value());
  refuse_open("forgetting", written.forgetting.has_value() || written.memory > 0.0);
  refuse_open("delta", written.delta.has_value());
  RegressionSettings out;
  out.order = {*written.inputs, *written.feedback};
  out.delta = *written.delta;
  out.forgetting = forgetting_of(written, 1.0);
  for (const ChannelSource& input : model.inputs) out.input_units.push_back(input.unit);
  out.output_unit = model.outputs.at(0).unit;
  return out;
}

OnlineRegression start_online_regression(const RegressionSettings& settings) {
  OnlineRegression out;
  for (const std::string& unit : settings.input_units) {
    out.input_units.push_back(unit_or_dimensionless(unit));
  }
  out.output_unit = unit_or_dimensionless(settings.output_unit);
  const auto m = static_cast<Index>(out.input_units.size());
  out.window = start_lag_window(m, settings.order);
  const Index d = out.window.phi.size();
  out.least_squares = start_online_least_squares(d, settings.delta, settings.forgetting);
  out.coefficients = out.sd = VectorXd::Constant(d, kNaN);
  out.inputs = VectorXd::Zero(m);
  out.innovation = kNaN;
  return out;
}

bool step(OnlineRegression& online, double y, const Eigen::Ref<const VectorXd>& u) {
  if (u.size() != online.inputs.size()) {
    throw std::invalid_argument(
        fmt::format("a sample has {} inputs; expected {}", u.size(), online.inputs.size()));
  }
  if (std::isinf(y) || u.array().isInf().any()) return false;
  for (Index i = 0; i < u.size(); ++i) {
    online.inputs[i] = online.input_units[static_cast<std::size_t>(i)].from_si(u[i]);
  }
  const double output = online.output_unit.from_si(y);
  online.innovation = kNaN;
  if (!take(online.window, online.inputs, output)) return true;
  step(online.least_squares, online.window.phi, output);
  online.coefficients = online.least_squares.rls.theta.col(0);
  online.sd = online.least_squares.sd;
  online.innovation = online.output_unit.scale * online.least_squares.prior_error;
  return true;
}

}  // namespace identikal
