// What do recordings say of a model in an engineer's terms, and how surely: poles, gains, delays?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/estimate/details.h"
#include "lib/polynomial/polynomial_model.h"
#include "lib/subspace/innovation_form.h"
#include "lib/subspace/lagged_products.h"

namespace identikal {

/// How A, B, C, D change along one of independent directions by one standard deviation: the variance of a quantity is the sum of
/// its squared changes along all of them.
struct Move {
  Eigen::MatrixXd A, B, C, D;
};

/// From the information of the predictor's matrices, without the n^2 directions that are a change of basis.
/// @return empty where the information has less than the rank of a model of that order
std::vector<Move> independent_moves(const InnovationForm& model, const LaggedProducts& sums);
/// Of innovation_form(models).
/// @param covariances  of the coefficients of each; empty ones: no move at all
std::vector<Move> independent_moves(const std::vector<PolynomialModel>& models,
                                    const std::vector<Eigen::MatrixXd>& covariances);

/// Poles by rising frequency, with standard errors where there are moves.
std::vector<BlackBox::Pole> poles_with_errors(const InnovationForm& model,
                                              const std::vector<Move>& moves, double dt);
/// Those of A, F and D, without what delays put at zero.
std::vector<BlackBox::Pole> poles_with_errors(const std::vector<PolynomialModel>& models,
                                              const std::vector<Eigen::MatrixXd>& covariances,
                                              double dt);

/// Gain of the steady state, C (I - A)^-1 B + D, and its standard errors; kNone for an integrator.
struct SteadyGain {
  Eigen::MatrixXd value, se;  ///< p x m
};
SteadyGain steady_gain(const InnovationForm& model, const std::vector<Move>& moves);

/// Rows after which each input is first seen: the largest number of leading responses to it that are all zero
/// for Wald's test at 1 %, by the regression on all lags. `before`: what these tell apart from zero.
/// @return of every input, without its name; empty of recordings too short
std::vector<BlackBox::Delay> input_delays(const LaggedProducts& sums);

}  // namespace identikal
