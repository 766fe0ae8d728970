#include "identify/model/parameter_prior.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/data/units.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

double normal_density(double x) {
  return std::exp(-0.5 * x * x) / std::sqrt(2.0 * std::numbers::pi);
}

// Of a normal coordinate: how much of the distribution lies between low and high.
double within(const PriorCoordinate& c) {
  const double scale = c.sd * std::numbers::sqrt2;
  const double a = (c.low - c.mean) / scale, b = (c.high - c.mean) / scale;
  // From the nearer tail, which keeps its digits.
  return a > 0.0 ? 0.5 * (std::erfc(a) - std::erfc(b)) : 0.5 * (std::erfc(-b) - std::erfc(-a));
}

PriorCoordinate number(const Prior& prior, double min, double max) {
  PriorCoordinate out;
  const bool logarithm =
      prior.kind == Prior::Kind::log_uniform || prior.kind == Prior::Kind::log_normal;
  const auto scaled = [logarithm](double x) { return logarithm ? std::log(x) : x; };
  out.logarithm = logarithm;
  out.low = logarithm && min <= 0.0 ? -kInfinity : scaled(min);
  out.high = scaled(max);
  switch (prior.kind) {
    case Prior::Kind::none:
      break;
    case Prior::Kind::uniform:
    case Prior::Kind::log_uniform:
      out.low = std::max(out.low, scaled(prior.a));
      out.high = std::min(out.high, scaled(prior.b));
      break;
    case Prior::Kind::normal:
      out.kind = PriorCoordinate::Kind::normal;
      out.mean = prior.a;
      out.sd = prior.b;
      break;
    case Prior::Kind::log_normal:
      out.kind = PriorCoordinate::Kind::normal;
      out.mean = std::log(prior.a);
      out.sd = std::log(prior.b);
      break;
  }
  return out;
}

// The prior that is used where the model file gives none.
Prior prior_of(const Model& model, const Parameter& p, double start, bool variance) {
  constexpr double kDecades = 1e4;
  if (p.prior.kind != Prior::Kind::none) return p.prior;
  if (variance && start > 0.0) {
    return {Prior::Kind::log_uniform, start / kDecades, start * kDecades};
  }
  if (std::isfinite(p.min) && std::isfinite(p.max)) return {Prior::Kind::uniform, p.min, p.max};
  throw InputError({model.source, 0, 0},
                   fmt::format("parameter '{}' has no prior, and none follows from its {}", p.name,
                               variance ? "start, which is zero" : "bounds"),
                   "prior: {uniform: [LOW, HIGH]}, {normal: {mean: M, sd: S}} or, for a variance, "
                   "{log-uniform: [LOW, HIGH]}");
}

}  // namespace

double PriorCoordinate::draw(Random& random) const {
  switch (kind) {
    case Kind::uniform:
      return low + (high - low) * random.uniform();
    case Kind::normal:
      for (;;) {
        const double x = mean + sd * random.normal();
        if (low <= x && x <= high) return x;
      }
    case Kind::partial_correlation: {
      // One coordinate of a point on the sphere in 2 shape + 1 dimensions.
      const VectorXd z = random.normal(static_cast<Index>(std::lround(2.0 * shape)) + 1);
      return z[0] / z.norm();
    }
  }
  return 0.0;
}

double PriorCoordinate::log_density(double x) const {
  if (!(low <= x && x <= high)) return -kInfinity;
  switch (kind) {
    case Kind::uniform:
      return -std::log(high - low);
    case Kind::normal:
      return -0.5 * std::pow((x - mean) / sd, 2) -
             std::log(sd * std::sqrt(2.0 * std::numbers::pi)) - std::log(within(*this));
    case Kind::partial_correlation:
      return (shape - 1.0) * std::log1p(-x * x) - 0.5 * std::log(std::numbers::pi) +
             std::lgamma(shape + 0.5) - std::lgamma(shape);
  }
  return 0.0;
}

double PriorCoordinate::deviation() const {
  switch (kind) {
    case Kind::uniform:
      return (high - low) / std::sqrt(12.0);
    case Kind::normal: {
      const double a = (low - mean) / sd, b = (high - mean) / sd, share = within(*this);
      const double shift = (normal_density(a) - normal_density(b)) / share;
      const double ends = (std::isfinite(a) ? a * normal_density(a) : 0.0) -
                          (std::isfinite(b) ? b * normal_density(b) : 0.0);
      return sd * std::sqrt(std::max(0.0, 1.0 + ends / share - shift * shift));
    }
    case Kind::partial_correlation:
      return 1.0 / std::sqrt(2.0 * shape + 1.0);
  }
  return 0.0;
}

double ParameterPrior::log_density(const VectorXd& x) const {
  double out = 0.0;
  for (std::size_t i = 0; i < coordinates.size(); ++i) {
    out += coordinates[i].log_density(x[i]);
  }
  return out;
}

VectorXd ParameterPrior::draw(Random& random) const {
  VectorXd out(static_cast<Index>(coordinates.size()));
  for (Index i = 0; i < out.size(); ++i) {
    out[i] = coordinates[i].draw(random);
  }
  return out;
}

ParameterPrior parameter_prior(const Model& model) {
  ParameterPrior out;
  const ReportedEntries all = reported_entries(model.parameters);
  for (std::size_t e = 0; e < all.names.size(); ++e) {
    const Parameter& p = model.parameters[all.parameter[e]];
    if (p.fixed) continue;
    const double value = all.value[e];
    if (p.domain == Domain::positive_definite && !all.variance[e]) {
      PriorCoordinate partial;
      partial.kind = PriorCoordinate::Kind::partial_correlation;
      partial.low = -1.0;
      partial.high = 1.0;
      partial.words = "uniform over correlation matrices";
      out.coordinates.push_back(partial);
      continue;
    }
    const bool scalar = p.domain == Domain::scalar;
    const Prior prior = prior_of(model, p, value, all.variance[e]);
    out.coordinates.push_back(number(prior, scalar ? p.min : 0.0, scalar ? p.max : kInfinity));
    out.coordinates.back().words = in_words(prior, p.unit);
  }
  // Of a full matrix, column by column: the variance, then the partial correlations below it.
  std::size_t at = 0;
  for (const Parameter& p : model.parameters) {
    if (p.fixed) continue;
    const Index n = p.value.rows();
    if (p.domain != Domain::positive_definite) {
      at += static_cast<std::size_t>(free_entries({p}).size());
      continue;
    }
    for (Index j = 0; j < n; ++j) {
      for (Index i = j; i < n; ++i, ++at) {
        if (i > j) out.coordinates[at].shape = 1.0 + 0.5 * static_cast<double>(n - 2 - j);
      }
    }
  }
  return out;
}

VectorXd entries_at(const ParameterPrior& prior, const ParameterSet& parameters,
                    const VectorXd& x) {
  VectorXd out = x;
  for (Index i = 0; i < x.size(); ++i) {
    if (prior.coordinates[i].logarithm) out[i] = std::exp(x[i]);
  }
  Index at = 0;
  for (const Parameter& p : parameters) {
    if (p.fixed) continue;
    const Index n = p.value.rows();
    if (p.domain != Domain::positive_definite) {
      at += free_entries({p}).size();
      continue;
    }
    // Factor of the correlation matrix, row by row from partial correlations.
    MatrixXd L = MatrixXd::Zero(n, n);
    VectorXd sd(n), rest = VectorXd::Ones(n);
    const Index first = at;
    for (Index j = 0; j < n; ++j) {
      sd[j] = std::sqrt(out[at++]);
      L(j, j) = std::sqrt(rest[j]);
      for (Index i = j + 1; i < n; ++i) {
        L(i, j) = out[at++] * std::sqrt(rest[i]);
        rest[i] -= L(i, j) * L(i, j);
      }
    }
    const MatrixXd V = sd.asDiagonal() * L * L.transpose() * sd.asDiagonal();
    out.segment(first, at - first) = lower_triangle(V);
  }
  return out;
}

namespace {

bool is_uniform(const Prior& prior) {
  return prior.kind == Prior::Kind::uniform || prior.kind == Prior::Kind::log_uniform;
}

// Of a log-normal one: 20 standard deviations below its median.
double lowest_of(const Prior& prior) { return prior.a * std::pow(prior.b, -20.0); }

// Calls visit(parameter, free entry, value) for every number that a stated prior is about.
template <typename Visit>
void for_each_stated(const ParameterSet& parameters, Visit&& visit) {
  const ReportedEntries all = reported_entries(parameters);
  Index entry = 0;
  for (std::size_t e = 0; e < all.names.size(); ++e) {
    const Parameter& p = parameters[all.parameter[e]];
    if (p.fixed) continue;
    const bool covariance = p.domain == Domain::positive_definite && !all.variance[e];
    if (p.prior.kind != Prior::Kind::none && !covariance) {
      visit(p, entry, all.value[static_cast<Index>(e)]);
    }
    ++entry;
  }
}

}  // namespace

PriorTerms stated_priors_at(const ParameterSet& parameters) {
  const Index k = free_entries(parameters).size();
  PriorTerms out{0.0, VectorXd::Zero(k), VectorXd::Zero(k)};
  for_each_stated(parameters, [&](const Parameter& p, Index e, double x) {
    if (is_uniform(p.prior)) return;
    double residual = (x - p.prior.a) / p.prior.b, slope = 1.0 / p.prior.b;
    if (p.prior.kind == Prior::Kind::log_normal) {
      if (!(x > 0.0)) {
        out.value = -kInfinity;
        return;
      }
      residual = std::log(x / p.prior.a) / std::log(p.prior.b);
      slope = 1.0 / (x * std::log(p.prior.b));
    }
    out.value -= 0.5 * residual * residual;
    out.gradient[e] = -residual * slope;
    out.information[e] = slope * slope;
  });
  return out;
}

Box prior_box(const Model& model) {
  Box out = coordinate_box(model.parameters);
  for_each_stated(model.parameters, [&](const Parameter& p, Index e, double) {
    const bool full = p.domain == Domain::positive_definite;
    if (full && is_uniform(p.prior)) {
      throw InputError(
          {model.source, 0, 0},
          fmt::format("the variances of {} have a prior with limits, and a full matrix "
                      "is not searched by its variances",
                      p.name),
          "log-normal: {median: M, factor: F}", "or --method bayes");
    }
    if (is_uniform(p.prior)) {
      out.lower[e] = std::max(out.lower[e], p.prior.a);
      out.upper[e] = std::min(out.upper[e], p.prior.b);
    }
    if (!full && p.prior.kind == Prior::Kind::log_normal) {
      out.lower[e] = std::max(out.lower[e], lowest_of(p.prior));
    }
  });
  return out;
}

ParameterSet started_within_priors(ParameterSet parameters) {
  for (Parameter& p : parameters) {
    if (p.fixed || p.prior.kind == Prior::Kind::none || p.prior.kind == Prior::Kind::normal)
      continue;
    const bool scalar = p.domain == Domain::scalar;
    for (Index i = 0; i < p.value.rows(); ++i) {
      double& x = p.value(i, i);
      if (p.prior.kind == Prior::Kind::log_normal && !(x > lowest_of(p.prior))) x = p.prior.a;
      if (is_uniform(p.prior)) x = std::min(std::max(x, p.prior.a), p.prior.b);
      if (scalar) x = std::min(std::max(x, p.min), p.max);
    }
  }
  return parameters;
}

std::vector<std::string> names_with_priors(const ParameterSet& parameters) {
  std::vector<std::string> out;
  for (const Parameter& p : parameters) {
    if (!p.fixed && p.prior.kind != Prior::Kind::none) out.push_back(p.name);
  }
  return out;
}

std::string in_words(const Prior& prior, const std::string& unit_name) {
  const Unit unit = unit_or_dimensionless(unit_name);
  const double a = unit.from_si(prior.a), b = unit.from_si(prior.b);
  switch (prior.kind) {
    case Prior::Kind::none:
      return "";
    case Prior::Kind::uniform:
      return fmt::format("uniform {:.4g} .. {:.4g}", a, b);
    case Prior::Kind::log_uniform:
      return fmt::format("log-uniform {:.4g} .. {:.4g}", a, b);
    case Prior::Kind::normal:
      return fmt::format("normal {:.4g} +- {:.4g}", a, prior.b / unit.scale);
    case Prior::Kind::log_normal:
      return fmt::format("log-normal {:.4g} within a factor of {:.4g}", a, prior.b);
  }
  return "";
}

}  // namespace identikal
