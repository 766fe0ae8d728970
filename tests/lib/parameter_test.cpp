#include "lib/parameter.h"

#include <gtest/gtest.h>

#include "lib/linear_model.h"

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

TEST(Parameter, DerivativesMatchDifferences) {
  const ParameterSet set = one_of_each();
  const VectorXd x = coordinates(set);
  const auto derivatives = coordinate_derivatives(set);
  const ReportedEntries entries = reported_entries(set);
  const double h = 1e-6;
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const ParameterSet above = with_coordinates(set, x + h * VectorXd::Unit(x.size(), k));
    const ParameterSet below = with_coordinates(set, x - h * VectorXd::Unit(x.size(), k));
    const CoordinateDerivative& d = derivatives[static_cast<std::size_t>(k)];
    const auto i = static_cast<std::size_t>(d.parameter);
    EXPECT_TRUE(((above[i].value - below[i].value) / (2 * h)).isApprox(d.value, 1e-8));
    const VectorXd column =
        (reported_entries(above).value - reported_entries(below).value) / (2 * h);
    EXPECT_TRUE(column.isApprox(entries.J.col(k), 1e-8));
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
  const VectorXd x = coordinates(set);
  const auto exact = instantiate_derivatives(model, set);
  ASSERT_EQ(exact.size(), static_cast<std::size_t>(x.size()));
  const double h = 1e-6;
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const StateSpace above =
        instantiate(model, with_coordinates(set, x + h * VectorXd::Unit(x.size(), k)));
    const StateSpace below =
        instantiate(model, with_coordinates(set, x - h * VectorXd::Unit(x.size(), k)));
    const StateSpace& d = exact[static_cast<std::size_t>(k)];
    EXPECT_LT(((above.A - below.A) / (2 * h) - d.A).norm(), 1e-8);
    EXPECT_LT(((above.Q - below.Q) / (2 * h) - d.Q).norm(), 1e-8);
    EXPECT_LT(((above.R - below.R) / (2 * h) - d.R).norm(), 1e-8);
  }
}

}  // namespace
}  // namespace identikal
