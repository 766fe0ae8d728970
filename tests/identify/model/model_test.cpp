// Has a model one form, and is a question for another one the caller's mistake?
#include "identify/model/model.h"

#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

namespace identikal {
namespace {

template <typename Call>
std::string logic_error_of(const Call& call) {
  try {
    call();
  } catch (const std::logic_error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST(Model, HasOneForm) {
  Model model;
  EXPECT_TRUE(is_linear(model) && has_filter(model));
  model.form = FormulaModel();
  EXPECT_TRUE(is_formula_model(model) && has_filter(model));
  EXPECT_FALSE(is_linear(model));
  model.form = VehicleModel();
  EXPECT_TRUE(is_vehicle(model));
  EXPECT_FALSE(has_filter(model));
  model.form = RegressionModel();
  EXPECT_TRUE(is_regression(model));
  EXPECT_FALSE(has_filter(model));
}

TEST(Model, NoiseIsTheLinearModelsOwnOrStandsBesideTheFormulas) {
  Model model;
  EXPECT_EQ(&noise_model(model), &as_linear(model));
  model.form = FormulaModel();
  EXPECT_EQ(&noise_model(model), &as_formulas(model).noise);
}

TEST(Model, AnotherFormIsNamedWithTheModelsOwn) {
  Model car;
  car.form = VehicleModel();
  EXPECT_EQ(logic_error_of([&] { as_linear(car); }),
            "a linear model is asked for, and the model is a vehicle");
  EXPECT_EQ(logic_error_of([&] { as_regression(car); }),
            "a regression is asked for, and the model is a vehicle");
  EXPECT_EQ(logic_error_of([&] { noise_model(car); }),
            "the noise of a linear model or of a model made of formulas is asked for, and the "
            "model is a vehicle");
  const Model linear;
  EXPECT_EQ(logic_error_of([&] { as_formulas(linear); }),
            "a model made of formulas is asked for, and the model is a linear model");
  EXPECT_EQ(logic_error_of([&] { as_vehicle(linear); }),
            "a vehicle is asked for, and the model is a linear model");
}

}  // namespace
}  // namespace identikal
