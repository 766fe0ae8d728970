#include "lib/model/parameter.h"

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "lib/model/linear_model.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Parameter scalar(const std::string& name, double value) {
  Parameter p;
  p.name = name;
  p.value = MatrixXd::Constant(1, 1, value);
  return p;
}

Parameter covariance(const std::string& name, Domain domain, const MatrixXd& value) {
  Parameter p = scalar(name, 0.0);
  p.domain = domain;
  p.value = value;
  return p;
}

ParameterSet one_of_each() {
  MatrixXd full(3, 3);
  full << 4, 1, 0.5, 1, 3, -0.2, 0.5, -0.2, 2;
  ParameterSet set{scalar("a", -0.4), covariance("Q", Domain::positive_definite, full),
                   covariance("D", Domain::diagonal, Eigen::Vector2d(2, 3).asDiagonal()),
                   scalar("known", 9.0),
                   covariance("I", Domain::scaled_identity, 5.0 * MatrixXd::Identity(2, 2))};
  set[3].fixed = true;
  return set;
}

TEST(Parameter, CoordinatesRoundTrip) {
  const ParameterSet set = one_of_each();
  const VectorXd x = coordinates(set);
  ASSERT_EQ(x.size(), 1 + 6 + 2 + 1);
  const ParameterSet back = with_coordinates(set, x);
  for (std::size_t i = 0; i < set.size(); ++i)
    EXPECT_TRUE(back[i].value.isApprox(set[i].value, 1e-14));
  EXPECT_THROW(with_coordinates(set, x.head(3)), std::invalid_argument);
}

TEST(Parameter, SingularCovarianceHasCoordinatesToo) {
  const Eigen::Vector3d v(1, -2, 0.5);
  const ParameterSet set{covariance("Q", Domain::positive_definite, v * v.transpose())};
  EXPECT_TRUE(with_coordinates(set, coordinates(set))[0].value.isApprox(set[0].value, 1e-12));
}

TEST(Parameter, VarianceBoxReachesZero) {
  const Box box = coordinate_box(one_of_each());
  EXPECT_EQ(box.lower.tail(3), VectorXd::Zero(3));
  EXPECT_TRUE((box.lower.head(7).array() < -1e300).all());
}

TEST(Parameter, EntriesAreLinearInTheValues) {
  const ParameterSet set = one_of_each();
  const VectorXd entries = free_entries(set);
  const auto derivatives = entry_derivatives(set);
  for (std::size_t p = 0; p < set.size(); ++p) {
    if (set[p].fixed) continue;
    MatrixXd sum = MatrixXd::Zero(set[p].value.rows(), set[p].value.cols());
    for (std::size_t e = 0; e < derivatives.size(); ++e) {
      if (derivatives[e].parameter == static_cast<int>(p)) {
        sum += entries[static_cast<Eigen::Index>(e)] * derivatives[e].value;
      }
    }
    EXPECT_TRUE(sum.isApprox(set[p].value, 1e-14)) << set[p].name;
    EXPECT_TRUE(with_entries(set, entries)[p].value.isApprox(set[p].value, 1e-14));
  }
  EXPECT_THROW(with_entries(set, entries.head(3)), std::invalid_argument);
}

// Also where a diagonal of the factor is negative: an optimiser may go there.
TEST(Parameter, CoordinateDerivativesMatchDifferences) {
  const ParameterSet set = one_of_each();
  VectorXd x = coordinates(set);
  for (const double sign : {1.0, -1.0}) {
    x[1] *= sign;
    const auto entries = [&](const VectorXd& at) {
      return free_entries(with_coordinates(set, at));
    };
    const MatrixXd J = entry_jacobian(set, x);
    const Eigen::Index k = x.size();
    VectorXd g = VectorXd::LinSpaced(k, -2.0, -1.0);  // the boundary is where it wants to go
    MatrixXd second = MatrixXd::Zero(k, k);
    const double h = 1e-5;
    for (Eigen::Index i = 0; i < k; ++i) {
      const VectorXd di = h * VectorXd::Unit(k, i);
      EXPECT_TRUE(((entries(x + di) - entries(x - di)) / (2 * h)).isApprox(J.col(i), 1e-8));
      second.col(i) =
          -(entry_jacobian(set, x + di) - entry_jacobian(set, x - di)).transpose() * g / (2 * h);
    }
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(second);
    const MatrixXd positive = eigen.eigenvectors() *
                              eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
                              eigen.eigenvectors().transpose();
    EXPECT_TRUE(coordinate_curvature(set, g).isApprox(positive, 1e-6));
  }
}

TEST(Parameter, ReportedEntriesAreNamedByRowAndColumn) {
  const ReportedEntries entries = reported_entries(one_of_each());
  const std::vector<std::string> names{"a",      "Q(1,1)", "Q(2,1)", "Q(3,1)", "Q(2,2)", "Q(3,2)",
                                       "Q(3,3)", "D(1,1)", "D(2,2)", "known",  "I"};
  EXPECT_EQ(entries.names, names);
}

TEST(LinearModel, DerivativesMatchDifferences) {
  // A = [a, 1; 0, -2 a], Q = block, R = [r].
  MatrixXd Q(2, 2);
  Q << 2, 0.3, 0.3, 1;
  ParameterSet set{scalar("a", 0.3), covariance("Q", Domain::positive_definite, Q),
                   scalar("r", 2.0)};
  LinearModel model;
  model.A.constant = (MatrixXd(2, 2) << 0, 1, 0, 0).finished();
  model.A.entries = {{0, 0, 0, 1.0}, {1, 1, 0, -2.0}};
  model.B.constant.resize(2, 0);
  model.C.constant = Eigen::RowVector2d(1, 0);
  model.D.constant.resize(1, 0);
  model.G.constant = MatrixXd::Identity(2, 2);
  model.Q.block = 1;
  model.R.constant = MatrixXd::Zero(1, 1);
  model.R.entries = {{0, 0, 2, 1.0}};
  model.S.constant = MatrixXd::Zero(2, 1);
  const VectorXd z = free_entries(set);
  const auto exact = model_derivatives(model, set);
  ASSERT_EQ(exact.size(), static_cast<std::size_t>(z.size()));
  for (Eigen::Index k = 0; k < z.size(); ++k) {
    const VectorXd unit = VectorXd::Unit(z.size(), k);
    const StateSpace above = instantiate(model, with_entries(set, z + unit));
    const StateSpace below = instantiate(model, with_entries(set, z - unit));
    const StateSpace& d = exact[static_cast<std::size_t>(k)];
    EXPECT_LT(((above.A - below.A) / 2.0 - d.A).norm(), 1e-12);
    EXPECT_LT(((above.Q - below.Q) / 2.0 - d.Q).norm(), 1e-12);
    EXPECT_LT(((above.R - below.R) / 2.0 - d.R).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace identikal
