// Is the response to a sine the transform of the response to an impulse?
#include "lib/model/frequency_response.h"

#include <complex>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lib/base/random.h"

namespace identikal {
namespace {

TEST(StateResponse, IsTheTransformOfTheImpulseResponse) {
  Random random(2);
  const Eigen::MatrixXd A = 0.25 * random.normal(9).reshaped(3, 3);
  const Eigen::MatrixXd B = random.normal(6).reshaped(3, 2);
  for (const double omega : {0.0, 0.3, 2.9}) {
    Eigen::MatrixXcd sum = Eigen::MatrixXcd::Zero(3, 2);
    Eigen::MatrixXd impulse = B;
    for (int k = 1; k <= 400; ++k) {
      sum += std::polar(1.0, -omega * k) * impulse;
      impulse = (A * impulse).eval();
    }
    EXPECT_LT((state_response(A, omega, B) - sum).cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(StateResponse, NamesSizesThatDisagree) {
  EXPECT_THROW(state_response(Eigen::MatrixXd::Zero(2, 2), 0.1, Eigen::MatrixXd::Zero(3, 1)),
               std::invalid_argument);
}

}  // namespace
}  // namespace identikal
