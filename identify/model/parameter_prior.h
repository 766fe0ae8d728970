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

/// What the priors that a model file states add to a log-likelihood, up to a constant, and its
/// derivatives by the free entries. The density is that of the prior's own coordinates, of the
/// number or of its logarithm, so that without data a number comes out at the mean or median.
/// Uniform priors add nothing inside their limits: prior_box().
struct PriorTerms {
  double value = 0.0;           ///< -infinity where a logarithm does not exist
  Eigen::VectorXd gradient;     ///< one per free entry
  Eigen::VectorXd information;  ///< of each by itself; not negative
};
PriorTerms stated_priors_at(const ParameterSet& parameters);

/// The limits of an optimiser's coordinates that uniform priors set, inside the parameters' own; of
/// a log-normal one, what lies more than 20 of its standard deviations below the median.
/// @throws InputError for a uniform prior of the variances of a full matrix: they are no
/// coordinates
Box prior_box(const Model& model);

/// The free parameters at starts that their stated priors allow.
ParameterSet started_within_priors(ParameterSet parameters);

/// The free parameters that have a stated prior.
std::vector<std::string> names_with_priors(const ParameterSet& parameters);

/// "log-normal 0.04 within a factor of 4", in the unit; empty without one.
std::string in_words(const Prior& prior, const std::string& unit);

}  // namespace identikal
