// Polynomial models against their state-space form, dense linear algebra and finite differences.
#include <cmath>
#include <complex>
#include <limits>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/polynomial/polynomial_errors.h"
#include "lib/polynomial/polynomial_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;

PolynomialModel with_all_polynomials(Random& random) {
  PolynomialModel out = polynomial_model({.na = 2, .nb = 2, .nc = 2, .nd = 1, .nf = 2}, {1, 0});
  VectorXd theta(out.parameters());
  for (double& each : theta) each = 0.2 * random.normal();
  return with_coefficients(out, theta);
}

MatrixXd normals(Index rows, Index columns, Random& random) {
  MatrixXd out(rows, columns);
  for (double& each : out.reshaped()) each = random.normal();
  return out;
}

RowVectorXd outputs(const InnovationForm& model, const MatrixXd& u, const RowVectorXd& e) {
  RowVectorXd y(u.cols());
  VectorXd x = VectorXd::Zero(model.states());
  for (Index t = 0; t < u.cols(); ++t) {
    y[t] = (model.C * x + model.D * u.col(t))[0] + e[t];
    x = (model.A * x + model.B * u.col(t) + model.K * e[t]).eval();
  }
  return y;
}

TEST(PolynomialModel, IsItsInnovationForm) {
  Random random(1);
  const PolynomialModel model = with_all_polynomials(random);
  MatrixXd u = normals(2, 200, random);
  RowVectorXd e = normals(1, 200, random);
  u.leftCols(10).setZero();
  e.head(10).setZero();
  const InnovationForm form = innovation_form({model}, MatrixXd::Identity(1, 1));
  const RowVectorXd y = outputs(form, u, e);
  const PolynomialErrors errors({y}, {u});
  const VectorXd left = errors.in_rows(model, errors.start(model)).e;
  ASSERT_EQ(left.size(), 198);  // two rows are the past of the first one
  EXPECT_LT((left - e.tail(198).transpose()).cwiseAbs().maxCoeff(), 1e-13);
  const InnovationForm least = observable_part(form);
  EXPECT_LT(least.states(), form.states());
  EXPECT_LT((outputs(least, u, e) - y).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(PolynomialModel, OfSeveralOutputsHasABlockOfEach) {
  Random random(2);
  const PolynomialModel a = with_all_polynomials(random), b = with_all_polynomials(random);
  const InnovationForm both = innovation_form({a, b}, MatrixXd::Identity(2, 2)),
                       alone = innovation_form({b}, MatrixXd::Identity(1, 1));
  const MatrixXd u = normals(2, 50, random);
  const MatrixXd y = simulated_outputs(both, u, VectorXd::Zero(both.states()));
  const MatrixXd second = simulated_outputs(alone, u, VectorXd::Zero(alone.states()));
  EXPECT_LT((y.row(1) - second).cwiseAbs().maxCoeff(), 1e-13);
}

TEST(PolynomialModel, HasTheZerosItIsMadeFrom) {
  const VectorXd a{{-1.5, 0.7, 0.2}};
  const Eigen::VectorXcd zeros = zeros_of(a);
  for (const std::complex<double> z : zeros)
    EXPECT_LT(std::abs(z * z * z + a[0] * z * z + a[1] * z + a[2]), 1e-13);
  EXPECT_LT((with_zeros(zeros) - a).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_EQ(zeros_of(VectorXd()).size(), 0);
}

TEST(PolynomialErrors, SlopesAreThoseOfFiniteDifferencesAcrossGapsAndRecordings) {
  Random random(3);
  const PolynomialModel model = with_all_polynomials(random);
  const MatrixXd u = normals(2, 60, random);
  RowVectorXd first = normals(1, 60, random), second = normals(1, 60, random);
  first[20] = first[21] = second[40] = std::numeric_limits<double>::quiet_NaN();
  const PolynomialErrors errors({first, second}, {u, u});
  VectorXd x = errors.start(model);
  ASSERT_EQ(x.size(), model.parameters() + 8);  // two values before each recording for each input
  x.tail(8).setConstant(0.3);
  MatrixXd R;
  ASSERT_TRUE(errors.evaluate(model, x, R));
  const Index n = x.size();
  EXPECT_NEAR(R.col(n).squaredNorm(), errors.sum_of_squares(model, x), 1e-11 * R.squaredNorm());
  const VectorXd gradient = R.leftCols(n).transpose() * R.col(n);
  for (Index i = 0; i < n; ++i) {
    VectorXd high = x, low = x;
    high[i] += 1e-5;
    low[i] -= 1e-5;
    const double slope =
        (errors.sum_of_squares(model, high) - errors.sum_of_squares(model, low)) / 4e-5;
    EXPECT_NEAR(gradient[i], slope, 1e-8 * gradient.norm()) << i;
  }
  const PolynomialErrors::Rows rows = errors.in_rows(model, x);
  EXPECT_EQ(rows.e.size(), errors.rows(model));
  EXPECT_EQ(rows.e.size(), 2 * 58 - 3);
  EXPECT_LT(
      (rows.slopes.transpose() * rows.e - gradient.head(model.parameters())).cwiseAbs().maxCoeff(),
      1e-10 * gradient.norm());
}

TEST(PolynomialErrors, OfAnUnstablePredictorAreInfinite) {
  PolynomialModel model = polynomial_model({.nc = 1}, {});
  model.C[0] = -3.0;
  const PolynomialErrors errors({RowVectorXd::Ones(500)}, {MatrixXd(0, 500)});
  EXPECT_EQ(errors.sum_of_squares(model, errors.start(model)),
            std::numeric_limits<double>::infinity());
  MatrixXd R;
  EXPECT_FALSE(errors.evaluate(model, errors.start(model), R));
}

TEST(PolynomialErrors, RefuseWhatDoesNotFit) {
  EXPECT_THROW(polynomial_model({}, {}), std::invalid_argument);
  EXPECT_THROW(polynomial_model({.nb = 1}, {-1}), std::invalid_argument);
  EXPECT_THROW(with_coefficients(polynomial_model({.na = 2}, {}), VectorXd(3)),
               std::invalid_argument);
  EXPECT_THROW(PolynomialErrors({RowVectorXd(3)}, {MatrixXd(1, 4)}), std::invalid_argument);
  EXPECT_THROW(innovation_form({}, MatrixXd()), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
