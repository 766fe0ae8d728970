// What are the rates of a model's state at a point, and their derivatives?
#pragma once

#include <algorithm>
#include <span>

#include "lib/model/nonlinear_model.h"

namespace identikal {

inline void write_point(const NonlinearModel& model, TapeMemory& memory, const double* x,
                        const double* u, double time) {
  double* at = memory.data();
  for (Eigen::Index i = 0; i < model.states; ++i) *at++ = x[i];
  for (Eigen::Index i = 0; i < model.inputs; ++i) *at++ = u[i];
  at[model.parameters] = time;
}

template <class Matrix>
std::span<double> span_of(Matrix& M) {
  return {M.data(), static_cast<std::size_t>(M.size())};
}

/// f, into the first numbers of m.rate.
inline void evaluate_rates(const NonlinearModel& model, ModelMemory& m, const double* x,
                           const double* u, double time) {
  write_point(model, m.rates, x, u, time);
  evaluate_values(model.rates, m.rates, {m.rate.data(), static_cast<std::size_t>(model.states)});
}

/// f and its derivatives by [x; p], into the first numbers of m.rate and into m.J.
inline void evaluate_rate_slopes(const NonlinearModel& model, ModelMemory& m, const double* x,
                                 const double* u, double time) {
  write_point(model, m.rate_jacobian, x, u, time);
  evaluate_jacobian(model.rate_jacobian, m.rate_jacobian,
                    {m.rate.data(), static_cast<std::size_t>(model.states)}, span_of(m.J));
}

}  // namespace identikal
