// What do recordings say of a model in an engineer's terms, and how surely: poles, gains, delays, impulse responses?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/black_box/internal/scaled_recordings.h"
#include "identify/estimate/details.h"
#include "lib/subspace/innovation_form.h"
#include "lib/subspace/lagged_products.h"

namespace identikal {

/// Covariance of predictor_parameters(): the generalised inverse of their information, without the n^2
/// directions that are a change of basis. Quantities that no such change moves have these errors.
/// @param sigma  of the innovations
/// @return empty where the information has less than the rank of a model of that order
Eigen::MatrixXd predictor_covariance(const InnovationForm& model, const LaggedProducts& sums);

/// Poles by rising frequency, with standard errors where the covariance is not empty.
std::vector<BlackBox::Pole> poles_with_errors(const InnovationForm& model,
                                              const Eigen::MatrixXd& covariance, double dt);

/// Gain of the steady state, C (I - A)^-1 B + D, and its standard errors; kNone for an integrator.
struct SteadyGain {
  Eigen::MatrixXd value, se;  ///< p x m
};
SteadyGain steady_gain(const InnovationForm& model, const Eigen::MatrixXd& covariance);

/// Rows after which each input is first seen: the largest number of leading responses to it that are all zero
/// for Wald's test at 1 %, by the regression on all lags.
std::vector<long> input_delays(const LaggedProducts& sums);

/// Of every output to every input over up to `rows` rows, of scaled recordings, in SI.
std::vector<BlackBox::ImpulseResponse> impulse_responses(const ScaledRecordings& recordings,
                                                         const Dataset& channels,
                                                         Eigen::Index rows);

}  // namespace identikal
