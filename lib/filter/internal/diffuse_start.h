// What do the samples so far say about a diffuse initial state? x(1) = proper part + delta with
// delta diffuse: its information and score grow until every direction of it is determined; then it
// is integrated out and the filter goes on as a proper one (de Jong 1991). Internal to the filter.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lib/filter/filter_result.h"
#include "lib/filter/internal/sensitivity.h"
#include "lib/model/linear_model.h"

namespace identikal {

/// What part of a diffuse start's uncertainty may be left, squared, for the start to count as
/// determined: less and the likelihood would lose more than 1e-9 of itself.
inline constexpr double kDetermined = 1e-8;

/// The least of what the information leaves of delta's scale, as a share: near 0, some direction of
/// delta is not determined; 1 where all are as well known as can be.
double determined_share(const Eigen::MatrixXd& information, const Eigen::VectorXd& scale);

/// Variances, n, of the proper part that a diffuse start has added to it, and which delta absorbs:
/// what n samples, with the noise that comes in meanwhile, leave unknown of a state. Larger ones
/// (the size of the data, say) cost the likelihood as many digits as they are too large. As delta
/// absorbs them, the likelihood's derivatives know nothing of them.
Eigen::VectorXd proper_scale(const StateSpace& model);

/// The start as a filter holds it: x(1) = proper part + X delta, of d states that nothing is known of.
struct ProperStart {
  Eigen::VectorXd scale;  ///< d: what proper_scale() says of them
  Eigen::MatrixXd P;      ///< n x n: covariance of the proper part
  Eigen::MatrixXd Z;      ///< n x (1 + d): its mean, and X

  Eigen::Index diffuse() const { return scale.size(); }
};

/// Of InitialState::diffuse and partly_diffuse. Nothing where P0 holds a NaN.
std::optional<ProperStart> proper_start(const StateSpace& model, InitialState initial);

struct DiffuseStart {
  Eigen::VectorXd scale;        ///< d: ProperStart::scale
  Eigen::MatrixXd information;  ///< d x d, of delta
  Eigen::VectorXd score;        ///< d
  struct Derivative {
    Eigen::MatrixXd information;
    Eigen::VectorXd score;
  };
  std::vector<Derivative> by;

  DiffuseStart() = default;
  DiffuseStart(const Eigen::VectorXd& scale_of_states, std::size_t parameters);
  /// Nothing is known yet. What an earlier start of these sizes took of memory serves again: of a
  /// short recording that is a tenth of the time.
  void begin(const Eigen::VectorXd& scale_of_states, std::size_t parameters);

  Eigen::Index states() const { return scale.size(); }
  /// A sample with innovations and responses E = [e, X_e], ny x (1 + d), and Sigma^-1 E.
  void add(const Eigen::MatrixXd& E, const Eigen::MatrixXd& SiE);
  /// What the sample adds to the derivatives with respect to parameter i.
  void add_derivative(std::size_t i, const Sensitivity& s, const Eigen::MatrixXd& SiE);
  /// Do the samples determine every direction of delta?
  /// @param last  none will follow: less will do
  bool is_determined(bool last) const;
  /// Is what delta still moves in the state lost in rounding, for all that is known of delta?
  bool is_forgotten(const Eigen::MatrixXd& P, const Eigen::MatrixXd& Z) const;
  /// Integrates delta out of the likelihood, the state and their derivatives; Z keeps one column.
  /// false: the information is not positive definite, and nothing has changed.
  bool fold_in(Eigen::MatrixXd& P, Eigen::MatrixXd& Z, std::vector<Sensitivity>& sensitivities,
               Likelihood& out) const;
};

}  // namespace identikal
