#include "identify/filter/student_weights.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "identify/filter/changing_recordings.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/report.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/model/sampled_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostWeighings = 50;
constexpr double kWeightsAgree = 1e-6;

void refuse_correlated(const Model& model, const MatrixXd& R) {
  if (R.isDiagonal(0.0)) return;
  throw InputError({model.source, 0, 0}, "Student's t for outputs whose noises are correlated",
                   "a diagonal R: every output has a weight of its own");
}

// R_ii of every sample, without weights.
MatrixXd measurement_variances(const Model& model, const Dataset& recording) {
  const LinearModel& noise = noise_model(model);
  const Index N = recording.size();
  MatrixXd out(recording.y.rows(), N);
  if (!changes(model)) {
    const MatrixXd R = written_matrices(noise, model.parameters).R;
    refuse_correlated(model, R);
    for (Index t = 0; t < N; ++t) out.col(t) = R.diagonal();
    return out;
  }
  SampledModel sampled(noise, recording.time, recording.u);
  sampled.set_parameters(model.parameters, false);
  StateSpace now;
  for (Index t = 0; t < N; ++t) {
    sampled.at(t, now, nullptr);
    refuse_correlated(model, now.R);
    out.col(t) = now.R.diagonal();
  }
  return out;
}

// What nobody measures has the noise that the model file says.
bool is_pseudo(const Dataset& recording, Index channel) {
  const auto i = static_cast<std::size_t>(channel);
  return i < recording.outputs.size() && recording.outputs[i].is_pseudo;
}

MatrixXd without_pseudo(MatrixXd squares, const Dataset& recording) {
  for (Index i = 0; i < squares.rows(); ++i) {
    if (is_pseudo(recording, i)) squares.row(i).setConstant(kNaN);
  }
  return squares;
}

MatrixXd with_scale(MatrixXd variances, const Dataset& recording) {
  if (recording.noise_scale.size() == 0) return variances;
  return variances.cwiseProduct(recording.noise_scale.cwiseAbs2());
}

FilterResult filter_of(const Model& model, const Dataset& recording) {
  FilterResult out = run_filter(model, model.parameters, recording);
  if (out.status != FilterStatus::ok) refuse_filter(model, {recording}, out.status);
  return out;
}

// The channels of a sample that have an innovation, and what they have in it.
struct Innovation {
  std::vector<Index> present;
  VectorXd e;
  MatrixXd Sigma;
};

Innovation innovation_at(const FilterResult& filter, Index t) {
  Innovation out;
  for (Index i = 0; i < filter.e.rows(); ++i) {
    if (!std::isnan(filter.e(i, t))) out.present.push_back(i);
  }
  if (out.present.empty()) return out;
  out.e = filter.e(out.present, t);
  out.Sigma = filter.Sigma[static_cast<std::size_t>(t)](out.present, out.present);
  return out;
}

// E[v^2] / R given y up to and with the sample: with r = R Sigma^-1 e its mean, and
// R - R Sigma^-1 R its covariance.
MatrixXd squares_up_to_now(const FilterResult& filter, const MatrixXd& variances,
                           const MatrixXd& weighted) {
  MatrixXd out = MatrixXd::Constant(variances.rows(), variances.cols(), kNaN);
  for (Index t = 0; t < variances.cols(); ++t) {
    const Innovation now = innovation_at(filter, t);
    if (now.present.empty()) continue;
    const VectorXd R = weighted.col(t)(now.present);
    const MatrixXd inverse =
        now.Sigma.llt().solve(MatrixXd::Identity(now.Sigma.rows(), now.Sigma.cols()));
    const VectorXd mean = R.cwiseProduct(inverse * now.e);
    const VectorXd variance = R - R.cwiseAbs2().cwiseProduct(inverse.diagonal());
    for (std::size_t k = 0; k < now.present.size(); ++k) {
      const auto row = static_cast<Index>(k);
      const double of_one = variances(now.present[k], t);
      if (!(of_one > 0.0)) continue;
      out(now.present[k], t) = (mean[row] * mean[row] + std::max(0.0, variance[row])) / of_one;
    }
  }
  return out;
}

MatrixXd squares_given_all(const Model& normal, const Dataset& recording, const MatrixXd& variances,
                           const MatrixXd& weighted) {
  const DisturbanceResult noise = changing_disturbances(normal, normal.parameters, recording);
  if (noise.status != FilterStatus::ok) refuse_filter(normal, {recording}, noise.status);
  const MatrixXd square = noise.v.cwiseAbs2() + (weighted - noise.v_sd.cwiseAbs2()).cwiseMax(0.0);
  return (variances.array() > 0.0).select(square.cwiseQuotient(variances), kNaN);
}

// log of the integral over lambda, by the trapezoidal rule in log lambda.
class StudentDensity {
 public:
  explicit StudentDensity(double freedom) {
    constexpr double kLow = -30.0, kHigh = 4.0, kStep = 0.25, kWide = 8.0;
    const double step = kStep * std::min(1.0, std::sqrt(kWide / freedom));
    const double a = 0.5 * freedom;
    double most = -kInfinity, sum = 0.0;
    for (double z = kLow; z <= kHigh; z += step) {
      inverse_.push_back(std::exp(-z));
      weight_.push_back(a * (z - std::exp(z)));  // of the Gamma density times lambda, in logarithms
      most = std::max(most, weight_.back());
    }
    for (const double w : weight_) sum += std::exp(w - most);
    for (double& w : weight_) w -= most + std::log(sum);
  }

  double operator()(double e, double of_state, double R) {
    terms_.resize(weight_.size());
    double most = -kInfinity, sum = 0.0;
    for (std::size_t k = 0; k < weight_.size(); ++k) {
      const double v = of_state + R * inverse_[k];
      terms_[k] = weight_[k] - 0.5 * (e * e / v + std::log(v) + kLogTwoPi);
      most = std::max(most, terms_[k]);
    }
    for (const double term : terms_) sum += std::exp(term - most);
    return most + std::log(sum);
  }

 private:
  std::vector<double> inverse_, weight_, terms_;
};

double normal_log_density(double e, double v) {
  return -0.5 * (e * e / v + std::log(v) + kLogTwoPi);
}

// Sums over the channels of every row, each given those before it.
VectorXd log_densities(const Model& model, const Dataset& recording,
                       const std::function<double(double e, double variance, double R)>& density) {
  const FilterResult filter = filter_of(model, recording);
  const MatrixXd variances = measurement_variances(model, recording);
  const MatrixXd weighted = with_scale(variances, recording);
  VectorXd out = VectorXd::Zero(recording.size());
  for (Index t = 0; t < recording.size(); ++t) {
    const Innovation now = innovation_at(filter, t);
    if (now.present.empty()) continue;
    const MatrixXd L = now.Sigma.llt().matrixL();
    const VectorXd z = L.triangularView<Eigen::Lower>().solve(now.e);
    for (std::size_t k = 0; k < now.present.size(); ++k) {
      const auto row = static_cast<Index>(k);
      const double d = L(row, row);
      const double of_state = std::max(0.0, d * d - weighted(now.present[k], t));
      const double e = d * z[row], R = variances(now.present[k], t);
      const bool normal = is_pseudo(recording, now.present[k]);
      out[t] += normal ? normal_log_density(e, of_state + R) : density(e, of_state, R);
    }
  }
  return out;
}

}  // namespace

double degrees_of_freedom(const Model& model) {
  const StudentNoise& noise = *model.student;
  return noise.parameter < 0 ? noise.freedom
                             : model.parameters[static_cast<std::size_t>(noise.parameter)].scalar();
}

std::string student_note(const Model& model) {
  return fmt::format(
      "the measurement noise is Student's t with {:.4g} degrees of freedom: samples have weights, "
      "and the log-likelihood is that of the samples so weighted",
      degrees_of_freedom(model));
}

Model normal_model(const Model& model) {
  Model out = model;
  out.student.reset();
  if (model.student && model.student->parameter >= 0) {
    out.parameters[static_cast<std::size_t>(model.student->parameter)].fixed = true;
  }
  if (is_linear(out)) {
    const auto inputs = static_cast<Index>(model.inputs.size());
    out.form = changing_model(as_linear(model), inputs, out.parameters.size());
  }
  return out;
}

MatrixXd expected_squares(const Model& normal, const Dataset& recording) {
  const MatrixXd variances = measurement_variances(normal, recording);
  const MatrixXd weighted = with_scale(variances, recording);
  const bool correlated =
      !noise_model(normal).S.constant.isZero(0.0) || !parameters_in(noise_model(normal).S).empty();
  if (changes(normal) && !correlated) {
    return without_pseudo(squares_given_all(normal, recording, variances, weighted), recording);
  }
  return without_pseudo(squares_up_to_now(filter_of(normal, recording), variances, weighted),
                        recording);
}

MatrixXd noise_scale_of(const MatrixXd& squares, double freedom) {
  return squares.unaryExpr([freedom](double square) {
    return std::isfinite(square) ? std::sqrt((freedom + square) / (freedom + 1.0)) : 1.0;
  });
}

std::vector<Dataset> student_weighted(const Model& model, const std::vector<Dataset>& recordings) {
  const Model normal = normal_model(model);
  const double freedom = degrees_of_freedom(model);
  std::vector<Dataset> out = recordings;
  for (Dataset& recording : out) {
    const MatrixXd variances = measurement_variances(normal, recording);
    recording.noise_scale.setOnes(recording.y.rows(), recording.size());
    for (int i = 0; i < kMostWeighings; ++i) {
      const MatrixXd weighted = with_scale(variances, recording);
      const MatrixXd squares = squares_up_to_now(filter_of(normal, recording), variances, weighted);
      const MatrixXd scale = noise_scale_of(without_pseudo(squares, recording), freedom);
      const double moved = (scale - recording.noise_scale).cwiseAbs().maxCoeff();
      recording.noise_scale = scale;
      if (moved < kWeightsAgree * scale.maxCoeff()) break;
    }
  }
  return out;
}

VectorXd student_log_densities(const Model& normal, double freedom, const Dataset& recording) {
  StudentDensity student(freedom);
  return log_densities(normal, recording, [&](double e, double of_state, double R) {
    return student(e, of_state, R);
  });
}

VectorXd normal_log_densities(const Model& model, const Dataset& recording) {
  return log_densities(model, recording, [](double e, double of_state, double R) {
    return normal_log_density(e, of_state + R);
  });
}

}  // namespace identikal
