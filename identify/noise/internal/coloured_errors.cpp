#include "identify/noise/internal/coloured_errors.h"

#include <algorithm>
#include <cmath>

#include "identify/shooting/simulation_slopes.h"
#include "lib/statistics/long_run_covariance.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd simulation_scores(const Model& model, const std::vector<Dataset>& recordings,
                           const ParameterSet& at) {
  const SimulationSlopes along = simulation_slopes(model, recordings, at);
  if (along.errors.size() == 0) return {};
  const LinearModel& noise = noise_model(model);
  const VectorXd R = written_matrices(noise, at).R.diagonal();
  const std::vector<StateSpace> by = model_derivatives(noise, at);
  MatrixXd out = MatrixXd::Zero(static_cast<Index>(by.size()), along.errors.cols());
  for (Index j = 0; j < along.errors.rows(); ++j) {
    const MatrixXd& slopes = along.slopes[static_cast<std::size_t>(j)];
    for (Index t = 0; t < out.cols(); ++t) {
      const double e = along.errors(j, t);
      if (std::isnan(e)) continue;
      for (std::size_t i = 0; i < along.unknowns.size(); ++i) {
        out(along.unknowns[i], t) -= e / R[j] * slopes(t, static_cast<Index>(i));
      }
      for (std::size_t i = 0; i < by.size(); ++i) {
        out(static_cast<Index>(i), t) += 0.5 * (e * e / R[j] - 1.0) / R[j] * by[i].R(j, j);
      }
    }
  }
  return out;
}

ColouredCovariance coloured_covariance(const MatrixXd& white, const MatrixXd& scores) {
  ColouredCovariance out;
  MatrixXd steps = white * scores;
  // At a bound they do not sum to zero.
  steps.colwise() -= VectorXd(steps.rowwise().mean());
  out.covariance = widest_long_run_covariance(steps, white, out.bandwidth);
  const VectorXd widened = (white.diagonal().array() /
                            out.covariance.diagonal().array().max(1e-300))
                               .max(1.0)
                               .sqrt();
  out.covariance = widened.asDiagonal() * out.covariance * widened.asDiagonal();
  // Kiefer & Vogelsang (2005), as for vehicles.
  out.freedom = std::max(
      1.0, 0.9 * static_cast<double>(scores.cols()) / static_cast<double>(out.bandwidth));
  return out;
}

}  // namespace identikal
