// Has the noise changed, asked again with every sample? Filters with other noise, and Shiryaev and Roberts' statistic of
// each (identify/noise/track.h). Internal to noise.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "identify/model/parameter_prior.h"
#include "lib/base/random.h"
#include "lib/filter/filter_bank.h"
#include "solvers/recursive_posterior.h"

namespace identikal {

class ChangeTest {
 public:
  /// @param threshold  log A
  /// @param start      of a filter with other noise, before the next sample
  ChangeTest(const Model& model, const ParameterPrior& prior,
             const std::function<FilterStart(const StateSpace&)>& start, double threshold,
             Random& random);

  /// The alternatives nearby go with the present noise.
  void centre_on(const ParameterSet& present, const Mixture& state);

  /// Takes sample t, whose log-density under the present noise is given. Allocates nothing.
  /// @return log S
  double observe(Eigen::Index t, const Eigen::Ref<const Eigen::VectorXd>& y,
                 const Eigen::Ref<const Eigen::VectorXd>& u, double present);

  /// When the change began: the latest begin that explains the samples about as well as any. An
  /// early one draws samples of the old noise into what is learnt of the new.
  Eigen::Index since() const;

  /// The earliest sample that since() may come to name; `next` where it can be none before that.
  Eigen::Index earliest_since(Eigen::Index next) const;

  /// Of the state's prediction under the noise that explains the change best.
  Eigen::MatrixXd state_covariance() const;

  void restart();

 private:
  LinearModel model_;
  double threshold_;
  Eigen::Index near_ = 0;
  FilterBank bank_;
  Eigen::VectorXd statistic_, sum_, log_share_, density_, weighed_;
  std::vector<Eigen::Index> since_;
};

}  // namespace identikal
