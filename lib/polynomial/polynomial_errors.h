// How far are a polynomial model's one-step predictions from recordings, and how does that change with its coefficients?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/polynomial/polynomial_model.h"

namespace identikal {

/// What the model leaves of one output, e(t) = D/C (A y - sum of B_j/F_j u_j), row after row from the first whose past is
/// known (Ljung 1999, section 10.3 for the slopes). A missing output is its own prediction there. What was before: e and
/// C/D e are zero; the outputs of B_j/F_j are unknowns beside the coefficients, for every recording its own.
///
/// Example:
///
///     const PolynomialErrors errors({y}, {u});  // 1 x N and m x N
///     const PolynomialModel model = polynomial_model({.na = 2, .nb = 2}, {1});
///     Eigen::VectorXd unknowns = errors.start(model);
///     std::printf("%g\n", errors.sum_of_squares(model, unknowns));
class PolynomialErrors {
 public:
  /// @param y  of every recording 1 x N, NaN = missing
  /// @param u  of every recording m x N, nothing missing
  /// @throws std::invalid_argument for other numbers of recordings or rows
  PolynomialErrors(std::vector<Eigen::RowVectorXd> y, std::vector<Eigen::MatrixXd> u);

  /// The model's coefficients, and behind them zeros for what was before the recordings.
  Eigen::VectorXd start(const PolynomialModel& model) const;
  /// Measured rows that count for a model of these orders.
  Eigen::Index rows(const PolynomialModel& model) const;
  /// @param unknowns  of the size of start(); infinite where the predictor is unstable and overflows
  double sum_of_squares(const PolynomialModel& model, const Eigen::VectorXd& unknowns) const;
  /// The same and its slopes, by orthogonal transformations brought to as many rows as there are unknowns and one:
  /// R = [J r] with r'r the sum of squares, J'J and J'r as those of all rows.
  /// @return false where the predictor overflows
  bool evaluate(const PolynomialModel& model, const Eigen::VectorXd& unknowns,
                Eigen::MatrixXd& R) const;
  /// What is left in every measured row that counts, and its slopes along the coefficients, rows x parameters().
  struct Rows {
    Eigen::VectorXd e;
    Eigen::MatrixXd slopes;
  };
  Rows in_rows(const PolynomialModel& model, const Eigen::VectorXd& unknowns) const;

 private:
  template <typename Take>
  bool run(const PolynomialModel& model, const Eigen::VectorXd& unknowns, bool with_slopes,
           const Take& take) const;

  std::vector<Eigen::RowVectorXd> y_;
  std::vector<Eigen::MatrixXd> u_;
};

}  // namespace identikal
