#include "identify/filter/student_weights.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "identify/filter/changing_recordings.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/report.h"
#include "identify/filter/student_filter.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/model/sampled_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

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

}  // namespace

std::string student_note(const Model& model) {
  return fmt::format(
      "the measurement noise is Student's t with {:.4g} degrees of freedom: what is far off "
      "moves the states little",
      degrees_of_freedom(model, model.parameters));
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

std::vector<Dataset> student_weighted(const Model& model, const ParameterSet& at,
                                      const std::vector<Dataset>& recordings) {
  std::vector<Dataset> out = recordings;
  for (Dataset& recording : out) {
    const StudentRun run = StudentFilter(model, recording).run(at);
    if (run.filter.status != FilterStatus::ok) {
      refuse_filter(model, {recording}, run.filter.status);
    }
    recording.noise_scale = run.weight.cwiseSqrt().cwiseInverse();
  }
  return out;
}

VectorXd normal_log_densities(const Model& model, const Dataset& recording) {
  const FilterResult filter = filter_of(model, recording);
  VectorXd out = VectorXd::Zero(recording.size());
  for (Index t = 0; t < recording.size(); ++t) {
    const Innovation now = innovation_at(filter, t);
    if (now.present.empty()) continue;
    const Eigen::LLT<MatrixXd> factor(now.Sigma);
    const MatrixXd L = factor.matrixL();
    out[t] = -0.5 * (now.e.dot(factor.solve(now.e)) +
                     kLogTwoPi * static_cast<double>(now.present.size())) -
             L.diagonal().array().log().sum();
  }
  return out;
}

}  // namespace identikal
