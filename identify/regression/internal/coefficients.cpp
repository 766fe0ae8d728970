#include "identify/regression/internal/coefficients.h"

#include <utility>

#include <fmt/format.h>

#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::string quotient(const std::string& unit, const std::string& by) {
  const auto factor = [](const std::string& text) {
    return text.find_first_of(" */") == std::string::npos ? text : "(" + text + ")";
  };
  if (unit == by) return "";
  if (by.empty()) return unit;
  return (unit.empty() ? "1" : factor(unit)) + "/" + factor(by);
}

std::string lagged(const std::string& name, Index lag) {
  return lag == 0 ? name + "(t)" : fmt::format("{}(t-{})", name, lag);
}

}  // namespace

MatrixXd in_channel_units(const MatrixXd& si, const std::vector<Channel>& channels) {
  MatrixXd out = si;
  for (Index i = 0; i < out.rows(); ++i) {
    const auto unit = unit_or_dimensionless(channels[i].unit);
    for (Index t = 0; t < out.cols(); ++t) out(i, t) = unit.from_si(si(i, t));
  }
  return out;
}

void list_coefficients(Estimate& estimate, const Dataset& recording, const RegressionOrder& order,
                       const VectorXd& theta) {
  const Channel& output = recording.outputs[0];
  const auto add = [&](const std::string& name, const std::string& unit) {
    EstimatedParameter p;
    p.name = name;
    p.unit = unit;
    p.value = theta[estimate.parameters.size()];
    estimate.parameters.push_back(std::move(p));
  };
  for (const Channel& input : recording.inputs) {
    for (Index j = 0; j < order.inputs; ++j) {
      add(lagged(input.name, j), quotient(output.unit, input.unit));
    }
  }
  for (Index j = 1; j <= order.feedback; ++j) add(lagged(output.name, j), "");
}

double fit_percent(const VectorXd& y, const VectorXd& error) {
  const double spread = (y.array() - y.mean()).matrix().norm();
  return spread > 0.0 ? 100.0 * (1.0 - error.norm() / spread) : kNone;
}

}  // namespace identikal
