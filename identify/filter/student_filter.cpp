#include "identify/filter/student_filter.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "identify/estimate/distribution.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/nonlinear_recordings.h"
#include "identify/filter/student_weights.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/base/nearest_turn.h"
#include "lib/model/sampled_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeastFreedomOfVariance = 2.5;

// Expectations over lambda, by the trapezoidal rule in log lambda.
class ScaleMixture {
 public:
  explicit ScaleMixture(double freedom) {
    constexpr double kLow = -30.0, kHigh = 4.0, kStep = 0.25, kWide = 8.0;
    const double step = kStep * std::min(1.0, std::sqrt(kWide / freedom));
    const double a = 0.5 * freedom;
    double most = -kInfinity, sum = 0.0;
    for (double z = kLow; z <= kHigh; z += step) {
      lambda_.push_back(std::exp(z));
      weight_.push_back(a * (z - std::exp(z)));  // the Gamma density times lambda, in logarithms
      most = std::max(most, weight_.back());
    }
    // What has no weight takes no time.
    constexpr double kNothing = -80.0;
    std::size_t first = 0;
    while (weight_[first] - most < kNothing) ++first;
    lambda_.erase(lambda_.begin(), lambda_.begin() + static_cast<std::ptrdiff_t>(first));
    weight_.erase(weight_.begin(), weight_.begin() + static_cast<std::ptrdiff_t>(first));
    for (const double w : weight_) sum += std::exp(w - most);
    for (double& w : weight_) w -= most + std::log(sum);
    term_.resize(weight_.size());
  }

  struct Update {
    double log_density = 0.0, g = 0.0, G = 0.0, weight = 1.0, quantile = 0.0;
  };

  Update of(double e, double of_state, double R) {
    double most = -kInfinity;
    for (std::size_t k = 0; k < weight_.size(); ++k) {
      const double v = of_state + R / lambda_[k];
      term_[k] = weight_[k] - 0.5 * (e * e / v + std::log(v));
      most = std::max(most, term_[k]);
    }
    double sum = 0.0, a = 0.0, b = 0.0, lambda = 0.0, below = 0.0, above = 0.0;
    for (std::size_t k = 0; k < weight_.size(); ++k) {
      const double p = std::exp(term_[k] - most), v = of_state + R / lambda_[k];
      sum += p;
      a += p / v;
      b += p / (v * v);
      lambda += p * lambda_[k];
      const double z = e / std::sqrt(2.0 * v), w = 0.5 * std::exp(weight_[k]);
      below += w * std::erfc(-z);
      above += w * std::erfc(z);
    }
    a /= sum;
    b /= sum;
    Update out;
    out.log_density = most + std::log(sum) - 0.5 * kLogTwoPi;
    out.g = a * e;
    out.G = a - e * e * (b - a * a);
    out.weight = lambda / sum;
    out.quantile = quantile_of(below, above);
    return out;
  }

  static Update normal(double e, double v) {
    return {-0.5 * (e * e / v + std::log(v) + kLogTwoPi), e / v, 1.0 / v, 1.0, e / std::sqrt(v)};
  }

 private:
  static double quantile_of(double below, double above) {
    constexpr double kLeast = 1e-300;
    return below < above ? normal_quantile(std::max(below, kLeast))
                         : -normal_quantile(std::max(above, kLeast));
  }

  std::vector<double> lambda_, weight_, term_;
};

// The model at a sample: y = predicted + C (x - the state that it is straight at) + v.
struct Seen {
  MatrixXd C;
  VectorXd predicted, R;
};

bool is_pseudo_output(const Dataset& recording, Index channel) {
  const auto i = static_cast<std::size_t>(channel);
  return i < recording.outputs.size() && recording.outputs[i].is_pseudo;
}

}  // namespace

double degrees_of_freedom(const Model& model, const ParameterSet& at) {
  const StudentNoise& noise = *model.student;
  return noise.parameter < 0 ? noise.freedom
                             : at[static_cast<std::size_t>(noise.parameter)].scalar();
}

struct StudentFilter::Parts {
  const Model& model;
  const Dataset& recording;
  Model normal;  // of the start, and of matrices
  std::optional<NonlinearSteps> curved;
  std::optional<SampledModel> sampled;
  MatrixXd inputs;
  StateSpace now;

  Parts(const Model& of, const Dataset& data)
      : model(of), recording(data), normal(normal_model(of)) {
    const LinearModel& noise = noise_model(normal);
    const Location here{model.source, 0, 0};
    if (!noise.S.constant.isZero(0.0) || !parameters_in(noise.S).empty()) {
      throw InputError(here, "Student's t, and process and measurement noise are correlated",
                       "no S");
    }
    if (changes(normal)) {
      sampled.emplace(noise, recording.time, recording.u);
      inputs = model_inputs(noise, recording.u);
      return;
    }
    if (as_formulas(model).filter != NonlinearMethod::extended) {
      throw InputError(here, "Student's t through another filter than the extended one",
                       "--filter extended");
    }
    curved.emplace(model, recording);
  }

  // State and covariance before the first row that counts, and which that is; -1: none.
  Index start(const ParameterSet& at, VectorXd& x, MatrixXd& P) {
    if (curved) {
      curved->start(x, P);
      return 0;
    }
    constexpr Index kRows = 50;
    for (const Index rows : {std::min(kRows, recording.size()), recording.size()}) {
      const FilterResult first = run_filter(normal, at, first_samples(recording, rows));
      if (first.status != FilterStatus::ok || first.first_proper >= rows) continue;
      x = first.x_pred.col(first.first_proper);
      P = first.P_pred[static_cast<std::size_t>(first.first_proper)];
      return first.first_proper;
    }
    return -1;
  }

  void set(const ParameterSet& at) {
    if (curved) {
      curved->set(at);
    } else {
      sampled->set_parameters(at, false);
    }
  }

  void see(Index t, const VectorXd& x, Seen& out) {
    if (curved) {
      curved->see(t, x, out.C, out.predicted, out.R);
      return;
    }
    sampled->at(t, now, nullptr);
    if (!now.R.isDiagonal(0.0)) {
      throw InputError({model.source, 0, 0}, "Student's t for outputs whose noises are correlated",
                       "a diagonal R: every output has a noise of its own");
    }
    out.C = now.C;
    out.predicted = now.C * x;
    if (inputs.rows() > 0) out.predicted += now.D * inputs.col(t);
    out.R = now.R.diagonal();
  }

  // To the next sample; see() of this one came before.
  void move(Index t, VectorXd& x, MatrixXd& P) {
    if (curved) {
      curved->move(t, x, P);
      return;
    }
    x = (now.A * x).eval();
    if (inputs.rows() > 0) x += now.B * inputs.col(t);
    P = (now.A * P * now.A.transpose() + now.G * now.Q * now.G.transpose()).eval();
  }

  bool wraps(Index channel) const {
    if (!curved) return false;
    const std::vector<bool>& all = as_formulas(model).wraps;
    return static_cast<std::size_t>(channel) < all.size() && all[static_cast<std::size_t>(channel)];
  }
};

StudentFilter::StudentFilter(const Model& model, const Dataset& recording)
    : parts_(std::make_unique<Parts>(model, recording)) {}
StudentFilter::~StudentFilter() = default;
StudentFilter::StudentFilter(StudentFilter&&) noexcept = default;

namespace {

// What a row of outputs makes of the state.
struct RowUpdate {
  ScaleMixture mixture;
  double of_variance;  // R times that is the noise's variance
  Seen seen;

  explicit RowUpdate(double freedom)
      : mixture(freedom),
        of_variance(1.0 / (1.0 - 2.0 / std::max(freedom, kLeastFreedomOfVariance))) {}

  template <typename Wraps>
  bool take(Index t, const Dataset& recording, const Wraps& wraps, VectorXd& x, MatrixXd& P,
            StudentRun& out) {
    const VectorXd before = x;
    FilterResult& kept = out.filter;
    const Index ny = recording.y.rows();
    MatrixXd Sigma = seen.C * P * seen.C.transpose();
    for (Index i = 0; i < ny; ++i) {
      Sigma(i, i) += seen.R[i] * (is_pseudo_output(recording, i) ? 1.0 : of_variance);
      kept.e_sd(i, t) = std::sqrt(Sigma(i, i));
    }
    if (!kept.Sigma.empty()) kept.Sigma[static_cast<std::size_t>(t)] = Sigma;
    for (Index i = 0; i < ny; ++i) {
      const double y = recording.y(i, t);
      if (std::isnan(y)) continue;
      double e = y - seen.predicted[i];
      if (wraps(i)) e = nearest_turn(e);
      kept.e(i, t) = e;
      e -= seen.C.row(i).dot(x - before);
      const VectorXd M = P * seen.C.row(i).transpose();
      const double s = std::max(0.0, seen.C.row(i).dot(M));
      const bool normal = is_pseudo_output(recording, i) || seen.R[i] == 0.0;
      if (!(s + seen.R[i] > 0.0)) return false;
      const ScaleMixture::Update update =
          normal ? ScaleMixture::normal(e, s + seen.R[i]) : mixture.of(e, s, seen.R[i]);
      x += update.g * M;
      P -= update.G * M * M.transpose();
      kept.standardised(i, t) = update.quantile;
      out.log_density[t] += update.log_density;
      out.weight(i, t) = update.weight;
    }
    return true;
  }
};

}  // namespace

StudentRun StudentFilter::run(const ParameterSet& at, Keep keep) {
  Parts& parts = *parts_;
  const Dataset& recording = parts.recording;
  const Index N = recording.size(), ny = recording.y.rows();
  parts.set(at);
  StudentRun out;
  out.log_density.setZero(N);
  out.weight.setOnes(ny, N);
  VectorXd x;
  MatrixXd P;
  const Index from = parts.start(at, x, P);
  FilterResult& kept = out.filter;
  if (from < 0) {
    kept.status = FilterStatus::undetermined;
    return out;
  }
  kept = empty_filter_result(x.size(), ny, N, keep);
  kept.first_proper = from;
  const bool states = keep == Keep::everything;
  const MatrixXd unknown = MatrixXd::Constant(x.size(), x.size(), kNaN);
  for (std::size_t t = 0; states && t < static_cast<std::size_t>(from); ++t) {
    kept.P_pred[t] = kept.P_filt[t] = unknown;
    kept.Sigma[t] = MatrixXd::Constant(ny, ny, kNaN);
  }
  RowUpdate row(degrees_of_freedom(parts.model, at));
  const auto wraps = [&](Index channel) { return parts.wraps(channel); };
  for (Index t = from; t < N; ++t) {
    const auto at_row = static_cast<std::size_t>(t);
    parts.see(t, x, row.seen);
    if (states) {
      kept.x_pred.col(t) = x;
      kept.P_pred[at_row] = P;
    }
    if (!x.allFinite() || !row.seen.predicted.allFinite()) kept.status = FilterStatus::not_finite;
    if (kept.status != FilterStatus::ok) return out;
    if (!row.take(t, recording, wraps, x, P, out)) {
      kept.status = FilterStatus::indefinite;
      return out;
    }
    P = (0.5 * (P + P.transpose())).eval();
    if (states) {
      kept.x_filt.col(t) = x;
      kept.P_filt[at_row] = P;
    }
    if (t + 1 < N) parts.move(t, x, P);
  }
  kept.log_likelihood = out.log_density.sum();
  if (!std::isfinite(kept.log_likelihood)) kept.status = FilterStatus::not_finite;
  return out;
}

}  // namespace identikal
