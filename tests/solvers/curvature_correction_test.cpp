#include "solvers/curvature_correction.h"

#include <gtest/gtest.h>

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(CurvatureCorrection, LearnsTheCurvatureOfAQuadratic) {
  const MatrixXd H{{3.0, 0.5}, {0.5, 2.0}}, J{{2.0, 0.2}, {0.2, 2.5}};
  CurvatureCorrection correction(MatrixXd::Zero(2, 2));
  for (const VectorXd& s : {VectorXd{{0.3, 0.1}}, VectorXd{{-0.2, 0.4}}}) {
    correction.learn(s, H * s, J);
  }
  const auto learnt = correction.apply(J, {0, 1});
  ASSERT_TRUE(learnt);
  EXPECT_TRUE(learnt->isApprox(H, 1e-12));
  correction.forget();
  EXPECT_TRUE(correction.apply(J, {0, 1})->isApprox(J));
}

TEST(CurvatureCorrection, GrowsWithInformation) {
  const MatrixXd J{{2.0, 0.0}, {0.0, 1.0}};
  CurvatureCorrection correction(MatrixXd{{1.0, 0.25}, {0.25, 0.5}});
  correction.scale(VectorXd{{2.0, 3.0}});
  const MatrixXd grown{{8.0, 0.0}, {0.0, 9.0}};
  EXPECT_TRUE(correction.apply(grown, {0, 1})->isApprox(MatrixXd{{12.0, 1.5}, {1.5, 13.5}}));
}

TEST(CurvatureCorrection, IsNotTrustedWhereStepsWouldGrowTooLong) {
  const MatrixXd J = MatrixXd::Identity(2, 2);
  EXPECT_FALSE(CurvatureCorrection(MatrixXd{{-0.95, 0.0}, {0.0, 0.0}}).apply(J, {0, 1}));
  EXPECT_FALSE(CurvatureCorrection(MatrixXd{{2000.0, 0.0}, {0.0, 0.0}}).apply(J, {0, 1}));
  // Of what is held nothing is asked.
  EXPECT_TRUE(CurvatureCorrection(MatrixXd{{-0.95, 0.0}, {0.0, 0.0}}).apply(J, {1}));
}

}  // namespace
}  // namespace identikal
