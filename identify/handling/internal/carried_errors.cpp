#include "identify/handling/internal/carried_errors.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "identify/estimate/distribution.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Value = HandlingSheet::Value;

constexpr double kRounding = 1e-7;  // of a figure that an iteration finds

void set_interval(double freedom, Value& out) {
  if (!std::isfinite(out.se)) return;
  const double quantile =
      std::isfinite(freedom) ? student_t_quantile(0.975, freedom) : normal_quantile(0.975);
  out.ci95 = {out.value - quantile * out.se, out.value + quantile * out.se};
}

/// Figures x uncertain parameters.
MatrixXd jacobian_of(const KnownVehicle& car, const FiguresOfCar& figures, Index count) {
  const auto k = static_cast<Index>(car.uncertain.size());
  MatrixXd J(count, k);
  for (Index i = 0; i < k; ++i) {
    const VehicleParameter parameter = car.uncertain[i];
    const double step =
        std::max(0.1 * std::sqrt(car.covariance(i, i)), 1e-6 * std::abs(car.p[parameter]));
    VehicleParameters<double> more = car.p, less = car.p;
    more[parameter] += step;
    less[parameter] -= step;
    J.col(i) = (figures(more) - figures(less)) / (2.0 * step);
  }
  return J;
}

/// Which of the parameters without an error each figure depends on: a name, or empty.
std::vector<std::string> depends_on_open(const KnownVehicle& car, const FiguresOfCar& figures,
                                         const VectorXd& at) {
  std::vector<std::string> out(static_cast<std::size_t>(at.size()));
  for (const VehicleParameter parameter : car.open) {
    VehicleParameters<double> moved = car.p;
    moved[parameter] += 0.01 * (moved[parameter] != 0.0 ? std::abs(moved[parameter]) : 0.01);
    const VectorXd there = figures(moved);
    for (Index i = 0; i < at.size(); ++i) {
      if (std::abs(there[i] - at[i]) > 1e-9 * std::abs(at[i])) out[i] = name_of(parameter);
    }
  }
  return out;
}

}  // namespace

std::vector<Value> with_carried_errors(const KnownVehicle& car, const FiguresOfCar& figures) {
  const VectorXd at = figures(car.p);
  std::vector<Value> out(static_cast<std::size_t>(at.size()));
  const MatrixXd J = jacobian_of(car, figures, at.size());
  const std::vector<std::string> open = depends_on_open(car, figures, at);
  for (Index i = 0; i < at.size(); ++i) {
    Value& value = out[i];
    value.value = std::isfinite(at[i]) ? at[i] : kNone;
    if (!std::isfinite(at[i])) {
      value.why = "The model has no such figure.";
    } else if (!car.estimated) {
      value.why = "A model file's values have no errors; those of a result of fit have.";
    } else if (!open[i].empty()) {
      value.why = open[i] + " has no standard error, and the figure depends on it.";
    } else if (!J.row(i).allFinite()) {
      value.why = "Within the errors of the parameters the figure ceases to exist.";
    } else {
      value.se = std::sqrt(J.row(i).dot(car.covariance * J.row(i).transpose()));
      set_interval(car.freedom, value);
      if (value.se > kRounding * std::abs(value.value)) continue;
      value = {value.value, kNone, {kNone, kNone}, "It does not depend on what was estimated."};
    }
  }
  return out;
}

Value of_log(double value, double se, double freedom) {
  Value out;
  out.value = value;
  out.se = se;
  set_interval(freedom, out);
  return out;
}

Value blank(std::string why) {
  Value out;
  out.why = std::move(why);
  return out;
}

Value in_units(Value value, double per_si) {
  value.value *= per_si;
  value.se *= std::abs(per_si);
  for (double& end : value.ci95) end *= per_si;
  if (per_si < 0.0) std::swap(value.ci95[0], value.ci95[1]);
  return value;
}

}  // namespace identikal
