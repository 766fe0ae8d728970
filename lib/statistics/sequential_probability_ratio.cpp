#include "lib/statistics/sequential_probability_ratio.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// Share of the variance that the prior expects the past to predict, spread over the coefficients.
constexpr double kExpectedShare = 0.1;
// Of the regressions that only measure: as good as no prior.
constexpr double kNoPrior = 1e4;

Index highest_order(const SequentialProbabilityRatioOptions& options) {
  return *std::max_element(options.orders.begin(), options.orders.end());
}

Index scale_samples(Index outputs) { return 5 * (outputs + 1); }

RecursiveRegression regression(Index regressors) {
  RecursiveRegression out;
  out.P.resize(regressors, regressors);
  out.theta.resize(regressors);
  out.gain.resize(regressors);
  return out;
}

// The first `lagged` coefficients have one prior, those of the channels before it another.
void begin(RecursiveRegression& r, Index lagged, double prior_lagged, double prior_channels,
           double squares) {
  r.P.setZero();
  for (Index i = 0; i < r.P.rows(); ++i) r.P(i, i) = i < lagged ? prior_lagged : prior_channels;
  r.start_trace = r.P.trace();
  r.theta.setZero();
  r.squares = squares;
}

// Takes one sample. @return zeta = phi' P phi: the prediction's variance is 1 + zeta times the
// noise's.
double absorb(RecursiveRegression& r, const double* regressors, double y, double forgetting = 1.0) {
  if (r.theta.size() == 0) {  // nothing to regress on: Eigen's products want at least one entry
    r.squares += y * y;
    return 0.0;
  }
  const Eigen::Map<const VectorXd> phi(regressors, r.theta.size());
  if (forgetting < 1.0 && r.P.trace() < r.start_trace) {
    r.P.triangularView<Eigen::Lower>() *= 1.0 / forgetting;
  }
  r.gain.noalias() = r.P.selfadjointView<Eigen::Lower>() * phi;
  const double zeta = phi.dot(r.gain), error = y - phi.dot(r.theta);
  r.theta += r.gain * (error / (1.0 + zeta));
  r.P.selfadjointView<Eigen::Lower>().rankUpdate(r.gain, -1.0 / (1.0 + zeta));
  r.squares += error * error / (1.0 + zeta);
  return zeta;
}

// Log of the predictive density of the sample that led from `before` to `after` squares, Student's
// t, without the factor that depends on its degrees of freedom alone.
double log_density(double before, double after, double zeta, double dof) {
  return 0.5 * (dof * std::log(before) - (dof + 1.0) * std::log(after) - std::log1p(zeta));
}

// Cholesky factor of the first samples' covariance. False while that is singular.
bool factorise(SequentialProbabilityRatio& test) {
  const auto n = static_cast<double>(test.samples);
  for (Index j = 0; j < test.outputs; ++j) {
    for (Index i = j; i < test.outputs; ++i) {
      const double sum =
          test.products(i, j) / n - test.scale.row(i).head(j).dot(test.scale.row(j).head(j));
      if (i > j) {
        test.scale(i, j) = sum / test.scale(j, j);
      } else if (sum > 1e-12 * test.products(j, j) / n) {
        test.scale(j, j) = std::sqrt(sum);
      } else {
        return false;
      }
    }
  }
  return true;
}

// From here on everything is in units of that covariance.
void begin_run(SequentialProbabilityRatio& test) {
  const Index ny = test.outputs, top = highest_order(test.options);
  const auto n = static_cast<double>(test.samples);
  const auto L = test.scale.triangularView<Eigen::Lower>();
  for (Index k = 0; k <= top; ++k) {
    auto lag = test.window.segment(k * ny, ny);
    L.solveInPlace(lag);
  }
  for (Index i = 0; i < ny; ++i) {
    const auto c = static_cast<std::size_t>(i);
    begin(test.null[c], 0, 0.0, 1.0 / n, n);
    for (std::size_t m = 0; m < test.options.orders.size(); ++m) {
      const Index lagged = ny * test.options.orders[m];
      begin(test.model[m][c], lagged, kExpectedShare / static_cast<double>(lagged), 1.0 / n, n);
    }
    begin(test.white_null[c], 0, 0.0, kNoPrior, 0.0);
    begin(test.white_full[c], ny * top, kNoPrior, kNoPrior, 0.0);
  }
  test.scaled = true;
}

// Log of the mean of the ratios.
double log_mean(const VectorXd& log_ratio) {
  const double largest = log_ratio.maxCoeff();
  double sum = 0.0;
  for (const double l : log_ratio) sum += std::exp(l - largest);
  return largest + std::log(sum / static_cast<double>(log_ratio.size()));
}

// How much less likely than white noise the likeliest sequence of the stated colour is.
double log_white(const SequentialProbabilityRatio& test) {
  double share = 0.0;
  for (std::size_t i = 0; i < test.white_full.size(); ++i) {
    const double white = test.white_null[i].squares;
    if (!(white > 0.0)) return 0.0;
    share += std::max(0.0, 1.0 - test.white_full[i].squares / white);
  }
  const double R = std::sqrt(share), d = std::max(test.options.smallest, R);
  const auto dof = static_cast<double>(test.white_samples - test.outputs + 1);
  const double growth = d * d - 2.0 * d * R;
  return dof > 0.0 && growth > -1.0 ? 0.5 * dof * std::log1p(growth) : 0.0;
}

void weigh(SequentialProbabilityRatio& test) {
  const Index ny = test.outputs, top = highest_order(test.options);
  const double* newest = test.window.data() + ny * top;
  const bool white = test.unbroken >= top;
  for (Index i = 0; i < ny; ++i) {
    const auto c = static_cast<std::size_t>(i);
    const auto dof = static_cast<double>(test.samples - 1 - i);
    const double before = test.null[c].squares;
    const double zeta_0 = absorb(test.null[c], newest, newest[i]);
    const double q_0 = log_density(before, test.null[c].squares, zeta_0, dof);
    for (std::size_t m = 0; m < test.model.size(); ++m) {
      const Index order = test.options.orders[m];
      RecursiveRegression& model = test.model[m][c];
      if (test.unbroken < order) {
        model.squares += test.null[c].squares - before;  // so that both count as many samples
        continue;
      }
      const double was = model.squares;
      const double zeta = absorb(model, newest - ny * order, newest[i], test.options.forgetting);
      test.log_ratio[m] += log_density(was, model.squares, zeta, dof) - q_0;
    }
    if (white) {
      absorb(test.white_null[c], newest, newest[i]);
      absorb(test.white_full[c], newest - ny * top, newest[i]);
    }
  }
  if (white) ++test.white_samples;
  test.log_coloured = log_mean(test.log_ratio);
  test.log_white = log_white(test);
}

}  // namespace

SequentialProbabilityRatio start_sequential_probability_ratio(
    Index outputs, const SequentialProbabilityRatioOptions& options) {
  const auto probability = [](double p) { return p > 0.0 && p < 1.0; };
  if (outputs < 1) throw std::invalid_argument("sequential test: no outputs");
  if (options.orders.empty()) throw std::invalid_argument("sequential test: no orders");
  for (const Index order : options.orders) {
    if (order < 1) {
      throw std::invalid_argument("sequential test: order " + std::to_string(order));
    }
  }
  if (!probability(options.false_alarm) || !probability(options.miss) ||
      !probability(options.smallest)) {
    throw std::invalid_argument(
        "sequential test: false_alarm, miss and smallest lie between 0 and 1");
  }
  if (!(options.forgetting > 0.0 && options.forgetting <= 1.0)) {
    throw std::invalid_argument("sequential test: forgetting " +
                                std::to_string(options.forgetting));
  }
  const Index top = highest_order(options);
  SequentialProbabilityRatio out;
  out.options = options;
  out.outputs = outputs;
  out.products.resize(outputs, outputs);
  out.scale.resize(outputs, outputs);
  out.window.resize(outputs * (top + 1));
  out.log_ratio.resize(static_cast<Index>(options.orders.size()));
  out.model.resize(options.orders.size());
  for (Index i = 0; i < outputs; ++i) {
    out.null.push_back(regression(i));
    out.white_null.push_back(regression(i));
    out.white_full.push_back(regression(outputs * top + i));
    for (std::size_t m = 0; m < options.orders.size(); ++m) {
      out.model[m].push_back(regression(outputs * options.orders[m] + i));
    }
  }
  restart(out);
  return out;
}

void restart(SequentialProbabilityRatio& test) {
  test.decision = SequentialDecision::undecided;
  test.samples = test.unbroken = test.white_samples = 0;
  test.log_coloured = test.log_white = 0.0;
  test.scaled = false;
  test.products.setZero();
  test.scale.setZero();
  test.window.setZero();
  test.log_ratio.setZero();
}

SequentialDecision update(SequentialProbabilityRatio& test,
                          const Eigen::Ref<const VectorXd>& innovation) {
  const Index ny = test.outputs;
  if (innovation.size() != ny) {
    throw std::invalid_argument("sequential test: an innovation of " +
                                std::to_string(innovation.size()) + " channels, not " +
                                std::to_string(ny));
  }
  if (test.decision != SequentialDecision::undecided) restart(test);
  if (!innovation.allFinite()) {
    test.unbroken = 0;
    return test.decision;
  }
  ++test.samples;
  std::copy(test.window.data() + ny, test.window.data() + test.window.size(), test.window.data());
  auto newest = test.window.tail(ny);
  newest = innovation;
  if (test.scaled) {
    test.scale.triangularView<Eigen::Lower>().solveInPlace(newest);
    weigh(test);
    if (test.log_coloured >= -std::log(test.options.false_alarm)) {
      test.decision = SequentialDecision::coloured;
    } else if (test.log_white >= -std::log(test.options.miss)) {
      test.decision = SequentialDecision::white;
    }
  } else {
    test.products.selfadjointView<Eigen::Lower>().rankUpdate(innovation);
    if (test.samples >= scale_samples(ny) && factorise(test)) begin_run(test);
  }
  ++test.unbroken;
  return test.decision;
}

}  // namespace identikal
