#include "identify/result/internal/filter_code.h"

#include <numbers>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace identikal {
namespace {

/// A text with @name@ in it, and what stands there.
std::string filled(std::string text, const std::vector<std::pair<std::string, std::string>>& in) {
  for (const auto& [name, value] : in) {
    const std::string mark = "@" + name + "@";
    for (std::size_t at = text.find(mark); at != std::string::npos;
         at = text.find(mark, at + value.size())) {
      text.replace(at, mark.size(), value);
    }
  }
  return text;
}

/// "x[0]", ..., "u[0]", ..., parameters, "t": as the equations count their symbols.
std::vector<std::string> symbol_texts(const NonlinearModel& equations,
                                      const FilterCodeNames& names) {
  std::vector<std::string> out;
  for (Eigen::Index i = 0; i < equations.states; ++i) out.push_back(fmt::format("x[{}]", i));
  for (Eigen::Index i = 0; i < equations.inputs; ++i) out.push_back(fmt::format("u[{}]", i));
  out.insert(out.end(), names.parameters.begin(), names.parameters.end());
  out.emplace_back("t");
  return out;
}

const FormulaModel& formulas_of(const Model& model) { return as_formulas(model); }

bool is_density(const Model& model) {
  return formulas_of(model).noise.noise == ProcessNoise::density;
}

/// Whether inputs go straight from sample to sample, so that the next ones are needed.
bool is_between(const Model& model) {
  const FormulaModel& formulas = formulas_of(model);
  return formulas.equations.continuous && formulas.equations.inputs > 0 &&
         formulas.inputs == InputPath::linear;
}

// ------------------------------------------------------------------------------------------ C, C++

std::string statements_in_c(const TapeCode& code, const char* values, const char* jacobian,
                            std::size_t columns) {
  std::string out;
  for (const std::string& line : code.statements) out += "  const double " + line + ";\n";
  for (std::size_t i = 0; i < code.values.size(); ++i) {
    out += fmt::format("  {}[{}] = {};\n", values, i, code.values[i]);
  }
  for (std::size_t n = 0; n < code.jacobian.size(); ++n) {
    out +=
        fmt::format("  {}[{}][{}] = {};\n", jacobian, n / columns, n % columns, code.jacobian[n]);
  }
  return out;
}

constexpr const char* kEquationsInC = R"(
/* @what@, and @J@ = d@f@/dx */
@inline@ void @pre@@name@(const double* x, const double* u, double t, double* @f@,
    double (*@J@)[@nx@]) {
  (void)x, (void)u, (void)t;
@body@}
)";

constexpr const char* kDosesInC = R"(
/* what is added to x at a sample, behind its measurement */
@inline@ void @pre@doses(const double* u, double t, double* d) {
  (void)u, (void)t;
@body@}
)";

constexpr const char* kStateInC = R"(
/* mean and covariance of the state */
typedef struct {
  double x[@nx@];
  double P[@nx@][@nx@];
} @pre@state;

/* before the first sample */
@inline@ @pre@state @pre@start(void) {
  @pre@state s;
  int i, j;
  for (i = 0; i < @nx@; ++i) {
    s.x[i] = @pre@x0[i][0];
    for (j = 0; j < @nx@; ++j) s.P[i][j] = @pre@P0[i][j];
  }
  return s;
}
)";

constexpr const char* kDiscretePredictionInC = R"(
/* From the sample at time t, with its inputs, to the next: x = f(x), P = F P F' + Q. */
@inline@ void @pre@predict(@pre@state* s, const double* u, double t) {
  double x[@nx@], F[@nx@][@nx@], FP[@nx@][@nx@];
  int i, j, k;
@doses@  @pre@motion(s->x, u, t, x, F);
  for (i = 0; i < @nx@; ++i) {
    for (j = 0; j < @nx@; ++j) {
      FP[i][j] = 0.0;
      for (k = 0; k < @nx@; ++k) FP[i][j] += F[i][k] * s->P[k][j];
    }
  }
  for (i = 0; i < @nx@; ++i) {
    for (j = 0; j < @nx@; ++j) {
      s->P[i][j] = @pre@Q[i][j];
      for (k = 0; k < @nx@; ++k) s->P[i][j] += FP[i][k] * F[j][k];
    }
    s->x[i] = x[i];
  }
}
)";

// Phi, W and the state go through the same Runge-Kutta steps.
constexpr const char* kContinuousPredictionInC = R"(
/* From the sample at time t, with inputs u@between_said@, to the one dt [s] later: x by the classical
   Runge-Kutta method, P = Phi P Phi' + W with Phi = dx(t + dt)/dx(t)@W_said@. */
@inline@ void @pre@predict(@pre@state* s, const double* u@between@, double t, double dt) {
  const double reach[4] = {0.0, 0.5, 0.5, 1.0};
  const double weight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
  const int steps = (int)fmax(1.0, ceil(dt / @step@ - 1e-6));
  const double h = dt / steps;
  /* rows: the state, Phi, W */
  double now[@size@], sum[@size@], stage[@size@], rate[@size@];
  double f[@nx@], F[@nx@][@nx@]@input@;
  int i, j, k, n, step;
@doses@  for (n = 0; n < @size@; ++n) now[n] = n < @nx@ ? s->x[n] : 0.0;
  for (i = 0; i < @nx@; ++i) now[@nx@ + @nx@ * i + i] = 1.0;
  for (step = 0; step < steps; ++step) {
    for (n = 0; n < @size@; ++n) sum[n] = now[n], rate[n] = 0.0;
    for (k = 0; k < 4; ++k) {
      double *Phi = stage + @nx@, *W = stage + @nx@ + @nx@ * @nx@;
      int a;
      for (n = 0; n < @size@; ++n) stage[n] = now[n] + reach[k] * h * rate[n];
@interpolate@      @pre@motion(stage, @u@, t + (step + reach[k]) * h, f, F);
      for (i = 0; i < @nx@; ++i) {
        rate[i] = f[i];
        for (j = 0; j < @nx@; ++j) {
          double by = 0.0, w = @density@;
          for (a = 0; a < @nx@; ++a) {
            by += F[i][a] * Phi[@nx@ * a + j];
            w += F[i][a] * W[@nx@ * a + j] + W[@nx@ * i + a] * F[j][a];
          }
          rate[@nx@ + @nx@ * i + j] = by;
          rate[@nx@ + @nx@ * @nx@ + @nx@ * i + j] = w;
        }
      }
      for (n = 0; n < @size@; ++n) sum[n] += weight[k] * h * rate[n];
    }
    for (n = 0; n < @size@; ++n) now[n] = sum[n];
  }
  {
    const double *Phi = now + @nx@, *W = now + @nx@ + @nx@ * @nx@;
    double P[@nx@][@nx@];
    int a, b;
    for (i = 0; i < @nx@; ++i) {
      for (j = 0; j < @nx@; ++j) {
        P[i][j] = W[@nx@ * i + j]@per_sample@;
        for (a = 0; a < @nx@; ++a) {
          for (b = 0; b < @nx@; ++b) P[i][j] += Phi[@nx@ * i + a] * s->P[a][b] * Phi[@nx@ * j + b];
        }
      }
    }
    for (i = 0; i < @nx@; ++i) {
      s->x[i] = now[i];
      for (j = 0; j < @nx@; ++j) s->P[i][j] = 0.5 * (P[i][j] + P[j][i]);
    }
  }
}
)";

constexpr const char* kUpdateInC = R"(
/* Takes in the measurements y of the sample at time t, NaN where there is none. e, if not null: the
   innovations, 0 where nothing was measured. Returns 0, or -1 with s as it was where their covariance is
   not positive definite. */
@inline@ int @pre@update(@pre@state* s, const double* u, const double* y, double t, double* e) {
  double h[@ny@], H[@ny@][@nx@], noise[@ny@][@ny@], M[@nx@][@ny@], L[@ny@][@ny@], K[@nx@][@ny@];
  double innovation[@ny@], A[@nx@][@nx@], AP[@nx@][@nx@];
  int i, j, k;
  @pre@measurement(s->x, u, t, h, H);
  for (i = 0; i < @ny@; ++i) {
    const int here = y[i] == y[i];
    innovation[i] = here ? y[i] - h[i] : 0.0;
@wraps@    for (j = 0; j < @nx@; ++j) H[i][j] = here ? H[i][j] : 0.0;
    for (j = 0; j < @ny@; ++j) {
      noise[i][j] = here && y[j] == y[j] ? @pre@R[i][j] : (i == j ? 1.0 : 0.0);
    }
  }
  for (i = 0; i < @nx@; ++i) {
    for (j = 0; j < @ny@; ++j) {
      M[i][j] = 0.0;
      for (k = 0; k < @nx@; ++k) M[i][j] += s->P[i][k] * H[j][k];
    }
  }
  for (i = 0; i < @ny@; ++i) { /* Sigma = H P H' + R = L L' */
    for (j = 0; j <= i; ++j) {
      double sum = noise[i][j];
      for (k = 0; k < @nx@; ++k) sum += H[i][k] * M[k][j];
      for (k = 0; k < j; ++k) sum -= L[i][k] * L[j][k];
      if (i == j && !(sum > 0.0)) return -1;
      L[i][j] = i == j ? sqrt(sum) : sum / L[j][j];
    }
  }
  for (i = 0; i < @nx@; ++i) { /* K = P H' Sigma^-1 */
    for (j = 0; j < @ny@; ++j) {
      K[i][j] = M[i][j];
      for (k = 0; k < j; ++k) K[i][j] -= L[j][k] * K[i][k];
      K[i][j] /= L[j][j];
    }
    for (j = @ny@ - 1; j >= 0; --j) {
      for (k = j + 1; k < @ny@; ++k) K[i][j] -= L[k][j] * K[i][k];
      K[i][j] /= L[j][j];
    }
  }
  for (i = 0; i < @nx@; ++i) { /* Joseph's form: P = A P A' + K R K' with A = I - K H */
    for (j = 0; j < @nx@; ++j) {
      A[i][j] = i == j ? 1.0 : 0.0;
      for (k = 0; k < @ny@; ++k) A[i][j] -= K[i][k] * H[k][j];
    }
    for (k = 0; k < @ny@; ++k) s->x[i] += K[i][k] * innovation[k];
  }
  for (i = 0; i < @nx@; ++i) {
    for (j = 0; j < @nx@; ++j) {
      AP[i][j] = 0.0;
      for (k = 0; k < @nx@; ++k) AP[i][j] += A[i][k] * s->P[k][j];
    }
  }
  for (i = 0; i < @nx@; ++i) {
    for (j = 0; j <= i; ++j) {
      double sum = 0.0;
      int a, b;
      for (k = 0; k < @nx@; ++k) sum += AP[i][k] * A[j][k];
      for (a = 0; a < @ny@; ++a) {
        for (b = 0; b < @ny@; ++b) sum += K[i][a] * noise[a][b] * K[j][b];
      }
      s->P[i][j] = s->P[j][i] = sum;
    }
  }
  for (i = 0; e && i < @ny@; ++i) e[i] = innovation[i];
  return 0;
}
)";

std::string wraps_in_c(const FormulaModel& formulas) {
  std::string out;
  for (std::size_t i = 0; i < formulas.wraps.size(); ++i) {
    if (!formulas.wraps[i]) continue;
    out += fmt::format("    if (i == {}) innovation[i] = remainder(innovation[i], {});\n", i,
                       number_code(2.0 * std::numbers::pi, CodeLanguage::c));
  }
  return out;
}

/// What stands in the place of the marks, but for the equations' own.
std::vector<std::pair<std::string, std::string>> marks_in_c(const Model& model,
                                                            const FilterCodeNames& names,
                                                            bool cpp) {
  const FormulaModel& formulas = formulas_of(model);
  const Eigen::Index nx = formulas.equations.states;
  const bool between = is_between(model), density = is_density(model);
  const std::string dose = fmt::format(
      "  {{\n    double d[{0}];\n    {1}doses(u, t, d);\n    for (i = 0; i < {0}; ++i) "
      "s->x[i] += d[i];\n  }}\n",
      nx, names.prefix);
  const std::string straight = fmt::format(
      "      for (n = 0; n < {}; ++n) {{\n        now_u[n] = u[n] + (u_next[n] - u[n]) * ((step + "
      "reach[k]) / steps);\n      }}\n",
      formulas.equations.inputs);
  return {{"pre", names.prefix},
          {"inline", cpp ? "inline" : "static inline"},
          {"nx", std::to_string(nx)},
          {"ny", std::to_string(formulas.equations.outputs)},
          {"size", std::to_string(nx + 2 * nx * nx)},
          {"step", names.prefix + "longest_step"},
          {"doses", formulas.equations.doses.values > 0 ? dose : ""},
          {"wraps", wraps_in_c(formulas)},
          {"between", between ? ", const double* u_next" : ""},
          {"between_said", between ? " and u_next of the next" : ""},
          {"W_said", density ? "\n   and W the integral of Phi Q Phi'" : " and W = Q"},
          {"input", between ? fmt::format(", now_u[{}]", formulas.equations.inputs) : ""},
          {"interpolate", between ? straight : ""},
          {"u", between ? "now_u" : "u"},
          {"density", density ? names.prefix + "Q[i][j]" : "0.0"},
          {"per_sample", density ? "" : " + " + names.prefix + "Q[i][j]"}};
}

// ------------------------------------------------------------------------------------------ Python

std::string statements_in_python(const TapeCode& code, const char* values, const char* jacobian,
                                 std::size_t columns) {
  std::string out;
  for (const std::string& line : code.statements) out += "    " + line + "\n";
  const auto listed = [](auto begin, auto end) {
    std::string list;
    for (auto at = begin; at != end; ++at) list += (at == begin ? "" : ", ") + *at;
    return "[" + list + "]";
  };
  out += fmt::format("    {} = np.array({})\n", values,
                     listed(code.values.begin(), code.values.end()));
  if (columns == 0) return out + fmt::format("    return {}\n", values);
  std::string rows;
  for (std::size_t i = 0; i < code.values.size(); ++i) {
    const auto begin = code.jacobian.begin() + static_cast<std::ptrdiff_t>(i * columns);
    rows += (i == 0 ? "" : ", ") + listed(begin, begin + static_cast<std::ptrdiff_t>(columns));
  }
  return out + fmt::format("    {} = np.array([{}])\n    return {}, {}\n", jacobian, rows, values,
                           jacobian);
}

constexpr const char* kEquationsInPython = R"(

def @name@(x, u, t):
    """@what@, and @J@ = d@f@/dx."""
@body@)";

constexpr const char* kDosesInPython = R"(

def doses(u, t):
    """What is added to x at a sample, behind its measurement."""
@body@)";

constexpr const char* kDiscretePredictionInPython = R"(

def predict(x, P, u, t):
    """From the sample at time t, with its inputs, to the next: x = f(x), P = F P F' + Q."""
@doses@    x, F = motion(x, u, t)
    return x, F @ P @ F.T + Q
)";

constexpr const char* kContinuousPredictionInPython = R"(

def predict(x, P, u@between@, t, dt):
    """From the sample at time t, with inputs u@between_said@, to the one dt [s] later: x by the classical
    Runge-Kutta method, P = Phi P Phi' + W with Phi = dx(t + dt)/dx(t)@W_said@."""
    steps = int(max(1.0, np.ceil(dt / longest_step - 1e-6)))
    h = dt / steps
@doses@    now = (x, np.eye(@nx@), np.zeros((@nx@, @nx@)))
    for step in range(steps):
        total, rates = now, (0.0, 0.0, 0.0)
        for reach, weight in ((0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6)):
            at, Phi, W = (a + reach * h * r for a, r in zip(now, rates))
@interpolate@            f, F = motion(at, @u@, t + (step + reach) * h)
            FW = F @ W
            rates = (f, F @ Phi, FW + FW.T + @density@)
            total = tuple(a + weight * h * r for a, r in zip(total, rates))
        now = total
    x, Phi, W = now
    return x, Phi @ P @ Phi.T + W@per_sample@
)";

constexpr const char* kUpdateInPython = R"(

def update(x, P, u, y, t):
    """Takes in the measurements y of the sample at time t, NaN where there is none.
    Returns x, P, the innovations, NaN where nothing was measured, and their covariance."""
    h, H = measurement(x, u, t)
    here = np.isfinite(y)
    e = np.where(here, y - h, 0.0)
@wraps@    H = H * here[:, None]
    noise = np.where(np.outer(here, here), R, np.eye(@ny@))
    Sigma = H @ P @ H.T + noise
    K = np.linalg.solve(Sigma, H @ P).T
    A = np.eye(@nx@) - K @ H
    P = A @ P @ A.T + K @ noise @ K.T
    return x + K @ e, P, np.where(here, e, np.nan), Sigma
)";

std::string wraps_in_python(const FormulaModel& formulas) {
  std::string out;
  for (std::size_t i = 0; i < formulas.wraps.size(); ++i) {
    if (formulas.wraps[i]) {
      out += fmt::format("    e[{0}] -= 2 * np.pi * np.round(e[{0}] / (2 * np.pi))\n", i);
    }
  }
  return out;
}

std::vector<std::pair<std::string, std::string>> marks_in_python(const Model& model) {
  const FormulaModel& formulas = formulas_of(model);
  const bool between = is_between(model), density = is_density(model);
  return {{"nx", std::to_string(formulas.equations.states)},
          {"ny", std::to_string(formulas.equations.outputs)},
          {"doses", formulas.equations.doses.values > 0 ? "    x = x + doses(u, t)\n" : ""},
          {"wraps", wraps_in_python(formulas)},
          {"between", between ? ", u_next" : ""},
          {"between_said", between ? " and u_next of the next" : ""},
          {"W_said", density ? "\n    and W the integral of Phi Q Phi'" : " and W = Q"},
          {"interpolate",
           between ? "            now_u = np.asarray(u) + (np.asarray(u_next) - np.asarray(u)) * "
                     "((step + reach) / steps)\n"
                   : ""},
          {"u", between ? "now_u" : "u"},
          {"density", density ? "Q" : "0.0"},
          {"per_sample", density ? "" : " + Q"}};
}

/// The equations as functions, by a text with marks for one and one for doses.
template <typename Statements>
std::string equations_code(const Model& model, const FilterCodeNames& names, CodeLanguage language,
                           const char* text, const char* doses, const Statements& statements) {
  const NonlinearModel& equations = formulas_of(model).equations;
  const std::vector<std::string> symbols = symbol_texts(equations, names);
  const auto nx = static_cast<std::size_t>(equations.states);
  const auto of = [&](const Tape& tape, const char* f, const char* J) {
    return statements(code_of(tape, language, symbols, nx), f, J, nx);
  };
  std::string out =
      filled(text, {{"name", "motion"},
                    {"what", equations.continuous ? "f(x, u, t), the rate of change of x"
                                                  : "f(x, u, t), the next x"},
                    {"f", "f"},
                    {"J", "F"},
                    {"body", of(equations.rate_jacobian, "f", "F")}});
  out += filled(text, {{"name", "measurement"},
                       {"what", "h(x, u, t), what sensors show of x"},
                       {"f", "h"},
                       {"J", "H"},
                       {"body", of(equations.output_jacobian, "h", "H")}});
  if (equations.doses.values == 0) return out;
  return out +
         filled(doses,
                {{"body", statements(code_of(equations.doses, language, symbols, 0), "d", "", 0)}});
}

}  // namespace

std::string why_no_filter_code(const Model& model, const std::string& method) {
  const FormulaModel& formulas = formulas_of(model);
  if (formulas.linear) return "its matrices change from sample to sample";
  if (method != "extended") return fmt::format("its filter is {}, not extended", method);
  if (formulas.noise_scales) return "the size of its measurement noise is a formula";
  if (model.student) return "its measurement noise is Student's t";
  if (formulas.noise.initial != InitialState::given || formulas.rests_at ||
      !formulas.starts.empty()) {
    return "its start depends on the recording";
  }
  if (formulas.equations.continuous && formulas.inputs == InputPath::pchip) {
    return "its inputs are smooth between samples (inputs: pchip), which needs later ones";
  }
  if (!formulas.late.empty()) return "its inputs are late by a time that was estimated";
  if (formulas.equations.doses_move_with_state) return "what its doses do depends on the state";
  if (model.time.infinite) return "rows at infinity are measured in a steady state";
  if (!model.conditions.empty()) return "its outputs count under conditions ('when')";
  return "";
}

std::string filter_in_c(const Model& model, const FilterCodeNames& names, bool cpp) {
  const bool continuous = formulas_of(model).equations.continuous;
  std::string out =
      equations_code(model, names, CodeLanguage::c, kEquationsInC, kDosesInC, statements_in_c);
  out += kStateInC;
  out += continuous ? kContinuousPredictionInC : kDiscretePredictionInC;
  out += kUpdateInC;
  return filled(out, marks_in_c(model, names, cpp));
}

std::string filter_in_python(const Model& model, const FilterCodeNames& names) {
  const bool continuous = formulas_of(model).equations.continuous;
  std::string out = equations_code(model, names, CodeLanguage::python, kEquationsInPython,
                                   kDosesInPython, statements_in_python);
  out += continuous ? kContinuousPredictionInPython : kDiscretePredictionInPython;
  out += kUpdateInPython;
  return filled(out, marks_in_python(model));
}

}  // namespace identikal
