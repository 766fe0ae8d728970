// A filter that takes one sample after the other.
#include <memory>
#include <optional>
#include <stdexcept>

#include "python/result.h"
#include <pybind11/stl.h>

namespace identikal {
namespace {

namespace py = pybind11;

class OnlineFilterOfPython {
 public:
  OnlineFilterOfPython(const SharedResult& result, const std::optional<std::string>& model) {
    ik_filter* opened = nullptr;
    const int code = ik_filter_open(result.get(), model ? model->c_str() : nullptr, &opened);
    filter_.reset(opened);
    if (code == 2) throw std::invalid_argument(ik_filter_message(opened));
    if (code != 0) throw std::runtime_error(ik_filter_message(opened));
  }

  py::ssize_t states() const { return static_cast<py::ssize_t>(ik_filter_states(filter_.get())); }
  py::ssize_t inputs() const { return static_cast<py::ssize_t>(ik_filter_inputs(filter_.get())); }
  py::ssize_t outputs() const { return static_cast<py::ssize_t>(ik_filter_outputs(filter_.get())); }

  // state, sd, innovation
  py::tuple step(const Doubles& y, const std::optional<Doubles>& u) {
    if (y.size() != outputs() || (u ? u->size() : 0) != inputs()) {
      throw std::invalid_argument(std::to_string(y.size()) + " outputs and " +
                                  std::to_string(u ? u->size() : 0) + " inputs; expected " +
                                  std::to_string(outputs()) + " and " + std::to_string(inputs()));
    }
    py::array_t<double> state(states()), sd(states()), innovation(outputs());
    const int code =
        ik_filter_step(filter_.get(), y.data(), u ? u->data() : nullptr, state.mutable_data(),
                       sd.mutable_data(), innovation.mutable_data());
    if (code == 1) {
      throw std::invalid_argument(
          "the sample cannot be taken; expected finite outputs (NaN where one "
          "is missing) and every input of a Kalman filter");
    }
    if (code != 0) throw std::bad_alloc();
    return py::make_tuple(state, sd, innovation);
  }

 private:
  struct Free {
    void operator()(ik_filter* filter) const { ik_filter_free(filter); }
  };
  std::unique_ptr<ik_filter, Free> filter_;
};

}  // namespace

void add_online_filter(py::module_& module) {
  py::class_<OnlineFilterOfPython>(module, "OnlineFilter")
      .def(py::init<const SharedResult&, const std::optional<std::string>&>())
      .def_property_readonly("states", &OnlineFilterOfPython::states)
      .def_property_readonly("inputs", &OnlineFilterOfPython::inputs)
      .def_property_readonly("outputs", &OnlineFilterOfPython::outputs)
      .def("step", &OnlineFilterOfPython::step);
}

}  // namespace identikal
