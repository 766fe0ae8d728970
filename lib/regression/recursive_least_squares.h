// What are the coefficients of a linear regression by now, asked again with every new sample?
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lib/regression/error_growth.h"

namespace identikal {

/// Recursive least squares with forgetting, in square-root form: a triangular factor of the
/// information takes every row by rotations, so that P = (L L')^-1 is symmetric and positive
/// definite whatever the data. The recursion of P itself, (6.13), promises neither: in the order of
/// products of the source's m-file, what rounding leaves unsymmetric grows by 1 / lambda with every
/// sample and is 1 % of P after 1200 with lambda = .98. Several outputs on the same regressors
/// share the factor.
///
/// Read theta, the two errors, conversion and samples; the rest is the state and workspace.
struct RecursiveLeastSquares {
  Eigen::MatrixXd theta;            ///< d x ny
  Eigen::VectorXd prior_error;      ///< ny: xi(t) = y(t) - phi(t)' theta(t-1), (6.18)
  Eigen::VectorXd posterior_error;  ///< ny: eps(t) = y(t) - phi(t)' theta(t)
  double conversion = 1.0;          ///< eps / xi = lambda / (lambda + phi' P(t-1) phi), in [0, 1]
  Eigen::Index samples = 0;

  Eigen::MatrixXd L;        ///< d x d, lower triangle, diagonal >= 0: L L' = R_phi(t), (6.5)
  Eigen::MatrixXd z;        ///< ny x d: L' theta = z'
  Eigen::VectorXd squares;  ///< ny: the criterion's minimum, (6.2) and the soft constraint
  double weight = 0.0, squared_weight = 0.0;  ///< sums of beta(t, i) and of its square
  double prior = 0.0;                         ///< delta times all factors so far
  Eigen::VectorXd largest;                    ///< d: what ||L.row(i)|| has been at the most
  Eigen::VectorXd row, sample;                ///< d, ny
};

/// theta(0) = 0. delta > 0: soft constraint, P(0) = I / delta, a sample of theta = 0 that is
/// forgotten like the others. delta = 0: the first rows build up the factor (the block start of
/// the source); a coefficient that they do not determine yet stays 0.
/// @param regressors  d >= 1
/// @param outputs     ny >= 1
/// @param delta       in squared units of the regressors
/// @throws std::invalid_argument for values out of range
/// Source: Sladká (2010), 6.1.2: (6.19) sets P(0) = I / delta; its m-file takes delta I.
RecursiveLeastSquares start_recursive_least_squares(Eigen::Index regressors, Eigen::Index outputs,
                                                    double delta);

/// Takes a row: the minimum over theta of
///   sum_i beta(t, i) (y(i) - phi(i)' theta)^2 + delta beta(t, 0) ||theta||^2,
/// beta(t, i) = lambda(i+1) .. lambda(t), is theta(t) to rounding, for every t. Allocates nothing.
///
/// Wind-up: what the regressors do not excite is forgotten all the same, and P grows there by
/// 1 / lambda with every sample, theta staying as it was; the first rows that excite it again then
/// settle it alone. Forgetting ends, coefficient by coefficient, where the information left is
/// 1e-14 of the most that its regressor has ever carried: less would be rounding.
///
/// Example:
///
///     RecursiveLeastSquares rls = start_recursive_least_squares(u.rows(), y.rows(), 1e-3);
///     for (Eigen::Index t = 0; t < y.cols(); ++t) update(rls, u.col(t), y.col(t), 0.99);
///     const Eigen::MatrixXd theta_now = rls.theta, sd = standard_errors(rls);
///
/// @param phi     d
/// @param y       ny
/// @param lambda  0 < lambda <= 1: the weight of all that was before
/// @return false, and nothing has changed, when an entry is not finite (a missing sample)
/// @throws std::invalid_argument for a lambda out of range
/// Source: Sladká (2010), (6.2) to (6.18). Rotations: Gentleman (1973), J. Inst. Maths Applics 12.
bool update(RecursiveLeastSquares& rls, const Eigen::Ref<const Eigen::VectorXd>& phi,
            const Eigen::Ref<const Eigen::VectorXd>& y, double lambda);

/// phi' P phi; infinite where phi moves a coefficient that is not determined. Allocates nothing.
double leverage(RecursiveLeastSquares& rls, const Eigen::Ref<const Eigen::VectorXd>& phi);

/// Has every coefficient been determined? So from the begin on with delta > 0.
bool determined(const RecursiveLeastSquares& rls);

/// g(t) = P(t) phi(t), (6.14), for the row taken last; and P(t), (6.11). Infinite where not
/// determined.
Eigen::VectorXd gain(const RecursiveLeastSquares& rls,
                     const Eigen::Ref<const Eigen::VectorXd>& phi);
Eigen::MatrixXd inverse_correlation(const RecursiveLeastSquares& rls);

/// d x d: R_phi(t) without what is left of the soft constraint, that is what the rows have told;
/// zero in row and column of a coefficient of which they told 1e-9 of its information or less.
Eigen::MatrixXd information_of_rows(const RecursiveLeastSquares& rls);

/// ny: squares of the residuals over w - d w2 / w, w and w2 the sums of the weights and of their
/// squares: n - d without forgetting. NaN until that is positive. Without bias for constant
/// coefficients, regressors without feedback and lambda = 1; else as good as that.
Eigen::VectorXd noise_variance(const RecursiveLeastSquares& rls);
/// Of one output; allocates nothing.
double noise_variance(const RecursiveLeastSquares& rls, Eigen::Index output);

/// d x ny: square roots of noise_variance times the diagonal of P; NaN where not determined. With
/// lambda < 1 they allow for coefficients that drift; for constant ones they are too large by
/// about sqrt(1 + lambda).
Eigen::MatrixXd standard_errors(const RecursiveLeastSquares& rls);
/// Of the coefficients of one output, d; allocates nothing.
void find_standard_errors(RecursiveLeastSquares& rls, Eigen::Index output,
                          Eigen::Ref<Eigen::VectorXd> out);

/// How the past loses its weight.
struct Forgetting {
  double factor = 1.0;  ///< lambda, 0 < lambda <= 1; not used when memory > 0
  /// > 0: variable lambda that holds the weighted sum of squares where `memory` samples of noise
  /// have it. > 1 then.
  double memory = 0.0;
  bool reset = false;  ///< lambda drops for one sample when a change is found
  bool watch = false;  ///< look for changes although nothing is reset
  double samples_per_false_alarm = 1e4;
};

/// Where coefficients changed.
struct RegressionChange {
  Eigen::Index since, found;  ///< rows: where it began, as far as one knows; where it was found
};

/// Recursive least squares of one output that forgets as it should. Read rls.theta and what
/// belongs to the row taken last; the rest is what it remembers.
///
/// Between two rows:
///
///     OnlineLeastSquares online = start_online_least_squares(2, 0.01, {.factor = 0.99});
///     step(online, Eigen::Vector2d(1.0, 0.3), 0.7);  // phi and y of a row, and so on
///     const Eigen::VectorXd theta = online.rls.theta, sd = online.sd;
struct OnlineLeastSquares {
  Eigen::VectorXd sd;        ///< d: standard_errors(); NaN while not determined
  double prior_error = 0.0;  ///< xi
  double posterior_error = 0.0;
  double standardised = 0.0;               ///< xi over its standard deviation; NaN while not known
  double lambda = 1.0;                     ///< as the row was taken
  double log_alarm = 0.0;                  ///< of the test for changes; NaN without
  std::optional<RegressionChange> change;  ///< that this row has shown

  RecursiveLeastSquares rls;
  Forgetting forgetting;
  ErrorGrowth growth;
  Eigen::Index settle = 0;          ///< rows at the start that tell nothing of the noise
  double noise = 0.0, known = 0.0;  ///< s^2, and how many rows it is the mean of
};

/// @param regressors  d >= 1  @param delta  as start_recursive_least_squares() has it
/// @throws std::invalid_argument for values out of range
OnlineLeastSquares start_online_least_squares(Eigen::Index regressors, double delta,
                                              const Forgetting& forgetting);

/// Takes a row. Allocates nothing.
///
/// Variable forgetting: the lambda(t) that keeps the minimum V of the criterion where it is,
///   V(t) = lambda V(t-1) + xi^2 lambda / (lambda + zeta) = V(t-1) = memory s^2,
///   lambda = (c + sqrt(c^2 + 4 zeta)) / 2,  c = 1 - zeta - q,  q = xi^2 / (memory s^2),
/// zeta = phi' P(t-1) phi, and lambda no less than 0.1; s^2, the mean of xi^2 / (1 + zeta) over ten
/// memories, stands for the variance of the noise. 1 - q / (1 + zeta) to first order: Fortescue,
/// Kershenbaum & Ydstie (1981), Automatica 17, who discount after the sample and not before it.
/// Errors the size of the noise give 1 - 1 / memory in the mean. lambda is 1 for the first 2 d + 10 rows.
///
/// Changes: error_growth.h on xi / sqrt(1 + zeta). With reset lambda is such, at the row that gives
/// the alarm, that all before counts as much as one row: Sladká (2010), 6.1.3. 2 d + 10 rows at the
/// start and after an alarm are not tested.
/// @param phi  d  @param y  in the output's unit
/// @return false, and nothing has changed, when an entry is not finite (a missing sample)
/// @throws std::invalid_argument for another size, or a forgetting factor out of range
bool step(OnlineLeastSquares& online, const Eigen::Ref<const Eigen::VectorXd>& phi, double y);

/// Estimates after every row.
struct RegressionHistory {
  Eigen::MatrixXd theta, sd;    ///< d x n
  Eigen::VectorXd prior_error;  ///< n: xi
  Eigen::VectorXd posterior_error;
  Eigen::VectorXd standardised;  ///< n: xi over its standard deviation; NaN while not known
  Eigen::VectorXd lambda;        ///< n
  Eigen::VectorXd log_alarm;     ///< n: of the test for changes; NaN without, -infinity at rest
  using Change = RegressionChange;
  std::vector<Change> changes;
  RecursiveLeastSquares end;
};

/// Runs over the rows of one output: step() of OnlineLeastSquares, row by row.
/// @param phi  d x n, finite
/// @param y    n, finite
/// @throws std::invalid_argument when shapes disagree or an option is out of range
RegressionHistory run_recursive_least_squares(const Eigen::Ref<const Eigen::MatrixXd>& phi,
                                              const Eigen::Ref<const Eigen::VectorXd>& y,
                                              double delta, const Forgetting& forgetting);

/// sum of xi(t)^2 over the rows from `lead` on, constant lambda: the predictive least squares
/// criterion of Rissanen (1986), IMA J. Math. Control Inform. 3. Every error is made before its
/// sample is known, so that coefficients too many cost what they spoil, and no penalty is chosen.
/// Rows and delta as above.
double predictive_squares(const Eigen::Ref<const Eigen::MatrixXd>& phi,
                          const Eigen::Ref<const Eigen::VectorXd>& y, double delta, double lambda,
                          Eigen::Index lead);

}  // namespace identikal
