#include "identify/model/model.h"

#include <stdexcept>
#include <utility>

#include <fmt/format.h>

namespace identikal {
namespace {

// In the order of the alternatives of Model::form.
constexpr const char* kForms[] = {"a linear model", "a model made of formulas", "a vehicle",
                                  "a regression"};

template <typename Form>
bool holds(const Model& model) {
  return std::holds_alternative<Form>(model.form);
}

// Of a model or of a constant one; the default value's index finds the name of what is asked for.
template <typename Form, typename AnyModel>
auto& form_of(AnyModel& model) {
  if (auto* form = std::get_if<Form>(&model.form)) return *form;
  throw std::invalid_argument(fmt::format("{} is asked for, and the model is {}",
                                          kForms[decltype(Model::form)(Form()).index()],
                                          kForms[model.form.index()]));
}

template <typename AnyModel>
auto& noise_beside(AnyModel& model) {
  if (auto* formulas = std::get_if<FormulaModel>(&model.form)) return formulas->noise;
  if (auto* linear = std::get_if<LinearModel>(&model.form)) return *linear;
  throw std::invalid_argument(
      fmt::format("the noise of {} or of {} is asked for, and the model is {}", kForms[0],
                  kForms[1], kForms[model.form.index()]));
}

}  // namespace

bool is_linear(const Model& model) { return holds<LinearModel>(model); }
bool is_formula_model(const Model& model) { return holds<FormulaModel>(model); }
bool changes(const Model& model) { return is_formula_model(model) && as_formulas(model).linear; }
bool is_vehicle(const Model& model) { return holds<VehicleModel>(model); }
bool is_regression(const Model& model) { return holds<RegressionModel>(model); }
bool has_filter(const Model& model) { return is_linear(model) || is_formula_model(model); }

const LinearModel& as_linear(const Model& model) { return form_of<LinearModel>(model); }
LinearModel& as_linear(Model& model) { return form_of<LinearModel>(model); }
const FormulaModel& as_formulas(const Model& model) { return form_of<FormulaModel>(model); }
FormulaModel& as_formulas(Model& model) { return form_of<FormulaModel>(model); }
const VehicleModel& as_vehicle(const Model& model) { return form_of<VehicleModel>(model); }
VehicleModel& as_vehicle(Model& model) { return form_of<VehicleModel>(model); }
const RegressionModel& as_regression(const Model& model) { return form_of<RegressionModel>(model); }
RegressionModel& as_regression(Model& model) { return form_of<RegressionModel>(model); }

const LinearModel& noise_model(const Model& model) { return noise_beside(model); }
LinearModel& noise_model(Model& model) { return noise_beside(model); }

LinearModel noise_of_recording(const FormulaModel& model, std::size_t recording) {
  LinearModel out = model.noise;
  if (!model.starts.empty()) out.x0 = model.starts.at(recording);
  return out;
}

FormulaModel changing_model(LinearModel matrices, Eigen::Index inputs, std::size_t parameters) {
  FormulaModel out;
  NonlinearModel& sizes = out.equations;
  sizes.states = matrices.A.constant.rows();
  sizes.outputs = matrices.C.constant.rows();
  sizes.inputs = inputs;
  sizes.parameters = static_cast<Eigen::Index>(parameters);
  sizes.column.assign(parameters, NonlinearModel::kInNoFormula);
  sizes.continuous = matrices.continuous;
  out.inputs = matrices.hold == InputHold::linear ? InputPath::linear : InputPath::constant;
  out.irregular = matrices.irregular;
  out.linear = true;
  out.noise = std::move(matrices);
  return out;
}

const char* filter_name(const FormulaModel& model) {
  return model.linear ? "kalman" : to_string(model.filter);
}

const char* to_string(NonlinearMethod method) {
  switch (method) {
    case NonlinearMethod::extended:
      return "extended";
    case NonlinearMethod::iterated:
      return "iterated";
    case NonlinearMethod::unscented:
      return "unscented";
  }
  return "";
}

NonlinearMethod nonlinear_method(const std::string& name, const Location& at) {
  for (const NonlinearMethod method :
       {NonlinearMethod::extended, NonlinearMethod::iterated, NonlinearMethod::unscented}) {
    if (name == to_string(method)) return method;
  }
  throw InputError(at, fmt::format("unknown filter '{}'", name), "extended, iterated or unscented");
}

}  // namespace identikal
