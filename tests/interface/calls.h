// ik_run() as tests call it.
#pragma once

#include <string>
#include <vector>

#include "interface/identikal.h"

namespace identikal {

inline const char* const kLevel = R"(
identikal: 1
time: {kind: discrete, step: 1 s}
outputs: {y: {}}
parameters:
  q: {value: 1, min: 0, max: 1e6}
  r: {value: 1, min: 0, max: 1e6}
A: [[1]]
C: [[1]]
Q: [[q]]
R: [[r]]
initial: diffuse
)";

inline std::vector<double> walk(std::size_t rows) {
  std::vector<double> y(rows);
  double level = 0.0;
  unsigned state = 7;
  const auto noise = [&] {
    state = 1664525u * state + 1013904223u;
    return static_cast<double>(state >> 8) / (1u << 24) - 0.5;
  };
  for (double& value : y) {
    level += noise();
    value = level + 2.0 * noise();
  }
  return y;
}

inline ik_recording recording_of(const std::vector<double>& y) {
  ik_recording out{};
  out.y = y.data();
  out.rows = y.size();
  out.ny = 1;
  return out;
}

struct Result {
  ik_result* handle = nullptr;
  int code = -1;
  Result(const Result&) = delete;
  Result& operator=(const Result&) = delete;
  Result(const char* verb, const char* model, const std::vector<ik_recording>& recordings,
         const char* options = nullptr, const std::vector<const ik_result*>& previous = {}) {
    code = ik_run(verb, model, recordings.data(), recordings.size(), previous.data(),
                  previous.size(), options, nullptr, &handle);
  }
  ~Result() { ik_result_free(handle); }
  // Rows of a series, one after the other.
  std::vector<double> series(const char* name) const {
    std::size_t rows = 0, cols = 0;
    const double* values = ik_result_series(handle, name, &rows, &cols);
    return {values, values + rows * cols};
  }
  std::string json() const { return ik_result_json(handle); }
  std::string message() const { return ik_result_message(handle); }
};

}  // namespace identikal
