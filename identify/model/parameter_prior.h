// What is known of a model's free parameters before the data, in coordinates that are independent?
#pragma once

#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/base/random.h"

namespace identikal {

/// One coordinate of a prior: uniform on [low, high], normal within them, or a partial correlation,
/// whose density is (1 - x^2)^(shape - 1) on (-1, 1).
struct PriorCoordinate {
  enum class Kind { uniform, normal, partial_correlation };
  Kind kind = Kind::uniform;
  bool logarithm = false;  ///< the coordinate is the number's logarithm
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  double mean = 0.0, sd = 0.0;  ///< normal
  double shape = 1.0;           ///< partial correlation
  std::string words;            ///< the prior as a person would say it

  double draw(Random& random) const;
  /// Of the distribution between low and high; -infinity outside.
  double log_density(double x) const;
  double deviation() const;  ///< of the same distribution
};

/// The prior of all free parameters. Coordinates are numbers, their logarithms where the prior is
/// one of the logarithm, and for a full covariance matrix the logarithms of its variances and its
/// partial correlations, whose prior makes every correlation matrix equally probable
/// (Lewandowski, Kurowicka & Joe 2009). Without a Parameter::prior: log-uniform over four decades
/// either way of the start for a variance, uniform between its bounds for another number.
struct ParameterPrior {
  std::vector<PriorCoordinate> coordinates;  ///< one per free entry (lib/model/parameter.h)

  double log_density(const Eigen::VectorXd& x) const;
  Eigen::VectorXd draw(Random& random) const;
};

/// @throws InputError when a number that is no variance has neither prior nor two finite bounds
///
/// Example:
///
///     const ParameterPrior prior = parameter_prior(model);
///     Random random(1);
///     const Eigen::VectorXd x = prior.draw(random);
///     const Eigen::VectorXd entries = entries_at(prior, model.parameters, x);
ParameterPrior parameter_prior(const Model& model);

/// The free entries (lib/model/parameter.h) that coordinates `x` stand for. @param parameters  of
/// the model whose prior it is
Eigen::VectorXd entries_at(const ParameterPrior& prior, const ParameterSet& parameters,
                           const Eigen::VectorXd& x);

}  // namespace identikal
