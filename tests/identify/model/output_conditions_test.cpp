// Outputs count where their conditions hold, whatever the recording comes from.
#include "identify/model/output_conditions.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "lib/base/constants.h"

namespace identikal {
namespace {

Model standstill() {
  return parse_model_file(
      "identikal: 1\nname: standstill\ntime: {step: 1 s}\nparameters: {r: {value: 1, min: 0}}\n"
      "inputs: {a: {column: a}}\nflags: {still: {column: still}}\n"
      "A: [[1]]\nB: [[1]]\nC: [[1], [1]]\nQ: [[0.1]]\nR: [[r]]\n"
      "outputs: {y: {column: y, when: \"y < 5 and t >= 1\"},\n"
      "          stop: {value: 0 m/s, sd: 1 cm/s, when: \"still == 1 or a > 10\"}}\n"
      "initial: diffuse\n",
      "standstill.yaml");
}

TEST(OutputConditions, OfSamplesInMemoryAreThoseOfTheFile) {
  const Model model = standstill();
  EXPECT_NEAR(noise_model(model).R.constant(1, 1), 1e-4, 1e-18);
  const Eigen::RowVectorXd y{{1.0, 2.0, 9.0, 3.0, 4.0}}, a{{0.0, 0.0, 0.0, 11.0, 0.0}};
  const Eigen::RowVectorXd still{{1.0, kNaN, 0.0, kNaN, kNaN}};
  const Dataset data = recording(model, {{"y", y}, {"a", a}, {"still", still}}, 1.0);
  const Eigen::MatrixXd expected{{kNaN, 2.0, kNaN, 3.0, 4.0}, {0.0, 0.0, kNaN, 0.0, kNaN}};
  for (Eigen::Index t = 0; t < 5; ++t) {
    for (Eigen::Index i = 0; i < 2; ++i) {
      EXPECT_TRUE(data.y(i, t) == expected(i, t) ||
                  (std::isnan(data.y(i, t)) && std::isnan(expected(i, t))))
          << i << " " << t;
    }
  }
  EXPECT_TRUE(data.outputs[1].is_pseudo);
  ASSERT_EQ(data.notes.size(), 2U);
  EXPECT_EQ(data.notes[0], "y counts in 3 of 5 rows of recording, where y < 5 and t >= 1");
  EXPECT_THROW(recording(model, y, 1.0, a), std::invalid_argument);
  EXPECT_THROW(recording(model, {{"y", y}, {"a", a}}, 1.0), std::invalid_argument);
}

TEST(OutputConditions, AreSaidInAWordEach) {
  const std::vector<std::string> said = describe_conditions(standstill());
  ASSERT_EQ(said.size(), 2U);
  EXPECT_EQ(said[0], "output y counts where y < 5 and t >= 1");
  EXPECT_EQ(said[1],
            "output stop, the pseudo-measurement 0 m/s, counts where still == 1 or a > 10");
}

}  // namespace
}  // namespace identikal
