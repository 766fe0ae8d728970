// What do states and their slopes by the parameters of stiff equations cost beside CVODES? The same
// formulas, by the same tape, through both; the same tolerance; forward sensitivities, staggered.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <cvodes/cvodes.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "lib/formula/expression.h"
#include "lib/model/internal/rates.h"
#include "lib/model/nonlinear_model.h"

namespace {

using namespace identikal;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Problem {
  const char* name;
  std::vector<std::string> states, parameters, rates;
  VectorXd p, x0, time;
};

VectorXd decades(double first, double last, Index count) {
  VectorXd out(count + 1);
  out[0] = 0.0;
  for (Index i = 0; i < count; ++i) {
    out[i + 1] = first * std::pow(last / first, static_cast<double>(i) / double(count - 1));
  }
  return out;
}

// Robertson (1966); van der Pol's oscillator, mu = 1000; the chemistry HIRES; a reaction whose fast
// part has died out before the first sample: all but the last as in Hairer & Wanner (1996), IV.10.
std::vector<Problem> problems() {
  return {
      {"robertson",
       {"a", "b", "c"},
       {"k1", "k2", "k3"},
       {"-k1*a + k3*b*c", "k1*a - k3*b*c - k2*b^2", "k2*b^2"},
       VectorXd{{0.04, 3e7, 1e4}},
       VectorXd{{1.0, 0.0, 0.0}},
       decades(0.4, 4e6, 8)},
      {"van der pol",
       {"x", "v"},
       {"mu"},
       {"v", "mu*(1 - x^2)*v - x"},
       VectorXd{{1e3}},
       VectorXd{{2.0, 0.0}},
       VectorXd::LinSpaced(21, 0.0, 2000.0)},
      {"hires",
       {"y1", "y2", "y3", "y4", "y5", "y6", "y7", "y8"},
       {"k1", "k2", "k3", "k4", "k5", "k6"},
       {"-k1*y1 + 0.43*y2 + 8.32*y3 + 0.0007", "k1*y1 - k2*y2", "-10.03*y3 + 0.43*y4 + 0.035*y5",
        "8.32*y2 + k1*y3 - 1.12*y4", "-k3*y5 + 0.43*y6 + 0.43*y7",
        "-k4*y6*y8 + 0.69*y4 + k1*y5 - 0.43*y6 + 0.69*y7", "k4*y6*y8 - k5*y7", "-k4*y6*y8 + k6*y7"},
       VectorXd{{1.71, 8.75, 1.745, 280.0, 1.81, 1.81}},
       VectorXd{{1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057}},
       VectorXd::LinSpaced(33, 0.0, 321.8122)},
      {"two time scales",
       {"x", "y"},
       {"fast", "slow"},
       {"-fast*(x - cos(y))", "slow*(x - y)"},
       VectorXd{{1e6, 0.5}},
       VectorXd{{0.0, 0.0}},
       VectorXd::LinSpaced(21, 0.0, 10.0)}};
}

NonlinearModel model_of(const Problem& problem) {
  std::vector<std::string> names = problem.states;
  names.insert(names.end(), problem.parameters.begin(), problem.parameters.end());
  names.emplace_back("t");
  ModelFormulas formulas;
  formulas.states = static_cast<int>(problem.states.size());
  formulas.parameters = static_cast<int>(problem.parameters.size());
  for (const std::string& rate : problem.rates) {
    formulas.dynamics.push_back(parse_expression(rate, names));
  }
  formulas.outputs.push_back(parse_expression(problem.states[0], names));
  return make_nonlinear_model(formulas);
}

struct Path {
  MatrixXd x;                   // nx x N
  std::vector<MatrixXd> slope;  // of each sample, nx x parameters
};

Path ours(const NonlinearModel& model, const Problem& problem, double tolerance) {
  ModelMemory memory = make_memory(model);
  set_parameters(model, memory, problem.p);
  const InputNodes nodes = controlled_nodes(problem.time, MatrixXd(0, problem.time.size()),
                                            InputPath::constant, tolerance);
  Path out{MatrixXd(model.states, problem.time.size()), {}};
  VectorXd x = problem.x0;
  MatrixXd by = MatrixXd::Zero(model.states, model.columns);
  out.x.col(0) = x;
  out.slope.push_back(by);
  Jacobian motion;
  for (Index k = 0; k + 1 < problem.time.size(); ++k) {
    step(model, memory, nodes, k, x, motion);
    by = (motion.wrt_x * by + motion.wrt_p).eval();
    out.x.col(k + 1) = x;
    out.slope.push_back(by);
  }
  return out;
}

struct Context {
  const NonlinearModel& model;
  ModelMemory memory;
};

int rates_of(double t, N_Vector y, N_Vector rate, void* given) {
  auto& context = *static_cast<Context*>(given);
  evaluate_rates(context.model, context.memory, N_VGetArrayPointer(y), nullptr, t);
  std::copy_n(context.memory.rate.data(), context.model.states, N_VGetArrayPointer(rate));
  return 0;
}

int slopes_of(double t, N_Vector y, N_Vector, SUNMatrix out, void* given, N_Vector, N_Vector,
              N_Vector) {
  auto& context = *static_cast<Context*>(given);
  evaluate_rate_slopes(context.model, context.memory, N_VGetArrayPointer(y), nullptr, t);
  for (Index j = 0; j < context.model.states; ++j) {
    for (Index i = 0; i < context.model.states; ++i) {
      SM_ELEMENT_D(out, i, j) = context.memory.J(i, j);
    }
  }
  return 0;
}

int sensitivities_of(int count, double t, N_Vector y, N_Vector, N_Vector* s, N_Vector* rate,
                     void* given, N_Vector, N_Vector) {
  auto& context = *static_cast<Context*>(given);
  evaluate_rate_slopes(context.model, context.memory, N_VGetArrayPointer(y), nullptr, t);
  const Index nx = context.model.states;
  for (int i = 0; i < count; ++i) {
    Eigen::Map<VectorXd>(N_VGetArrayPointer(rate[i]), nx) =
        context.memory.J.leftCols(nx) * Eigen::Map<VectorXd>(N_VGetArrayPointer(s[i]), nx) +
        context.memory.J.col(nx + i);
  }
  return 0;
}

// @param size  nx: the largest that each state has been, a thousandth of which counts as in ours
Path by_cvodes(const NonlinearModel& model, const Problem& problem, double tolerance,
               const VectorXd& size) {
  Context context{model, make_memory(model)};
  set_parameters(model, context.memory, problem.p);
  SUNContext sun = nullptr;
  SUNContext_Create(nullptr, &sun);
  const Index nx = model.states;
  N_Vector y = N_VNew_Serial(nx, sun), absolute = N_VNew_Serial(nx, sun);
  std::copy_n(problem.x0.data(), nx, N_VGetArrayPointer(y));
  for (Index i = 0; i < nx; ++i) {
    N_VGetArrayPointer(absolute)[i] = tolerance * 1e-3 * size[i];
  }
  void* solver = CVodeCreate(CV_BDF, sun);
  CVodeInit(solver, rates_of, 0.0, y);
  CVodeSVtolerances(solver, tolerance, absolute);
  CVodeSetUserData(solver, &context);
  CVodeSetMaxNumSteps(solver, 1000000);
  SUNMatrix A = SUNDenseMatrix(nx, nx, sun);
  SUNLinearSolver linear = SUNLinSol_Dense(y, A, sun);
  CVodeSetLinearSolver(solver, linear, A);
  CVodeSetJacFn(solver, slopes_of);
  const auto count = static_cast<int>(model.columns);
  N_Vector* s = N_VCloneVectorArray(count, y);
  for (int i = 0; i < count; ++i) N_VConst(0.0, s[i]);
  VectorXd sizes = problem.p;
  CVodeSensInit(solver, count, CV_STAGGERED, sensitivities_of, s);
  CVodeSetSensParams(solver, nullptr, sizes.data(), nullptr);
  CVodeSensEEtolerances(solver);
  CVodeSetSensErrCon(solver, SUNTRUE);
  Path out{MatrixXd(nx, problem.time.size()), {MatrixXd::Zero(nx, count)}};
  out.x.col(0) = problem.x0;
  for (Index k = 1; k < problem.time.size(); ++k) {
    double t = 0.0;
    CVode(solver, problem.time[k], y, &t, CV_NORMAL);
    CVodeGetSens(solver, &t, s);
    out.x.col(k) = Eigen::Map<VectorXd>(N_VGetArrayPointer(y), nx);
    out.slope.emplace_back(nx, count);
    for (int i = 0; i < count; ++i) {
      out.slope.back().col(i) = Eigen::Map<VectorXd>(N_VGetArrayPointer(s[i]), nx);
    }
  }
  N_VDestroyVectorArray(s, count);
  CVodeFree(&solver);
  SUNLinSolFree(linear);
  SUNMatDestroy(A);
  N_VDestroy(y);
  N_VDestroy(absolute);
  SUNContext_Free(&sun);
  return out;
}

// The largest errors, over the largest of each state and of each slope.
std::pair<double, double> errors_of(const Path& path, const Path& exact) {
  double states = 0.0, slopes = 0.0;
  for (Index i = 0; i < path.x.rows(); ++i) {
    const double size = exact.x.row(i).cwiseAbs().maxCoeff();
    states = std::max(states, (path.x.row(i) - exact.x.row(i)).cwiseAbs().maxCoeff() / size);
    for (Index j = 0; j < exact.slope[0].cols(); ++j) {
      double largest = 0.0, off = 0.0;
      for (std::size_t k = 0; k < exact.slope.size(); ++k) {
        largest = std::max(largest, std::abs(exact.slope[k](i, j)));
        off = std::max(off, std::abs(path.slope[k](i, j) - exact.slope[k](i, j)));
      }
      if (largest > 0.0) slopes = std::max(slopes, off / largest);
    }
  }
  return {states, slopes};
}

template <class Follow>
double least_milliseconds(const Follow& follow) {
  double least = HUGE_VAL;
  for (int i = 0; i < 15; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    follow();
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
    least = std::min(least, took.count());
  }
  return least;
}

}  // namespace

int main() {
  std::printf(
      "states and slopes      tolerance    ours ms  error (slopes)     CVODES ms  error "
      "(slopes)      ratio\n");
  for (const Problem& problem : problems()) {
    const NonlinearModel model = model_of(problem);
    const Path exact = ours(model, problem, 1e-11);
    const VectorXd size = exact.x.cwiseAbs().rowwise().maxCoeff();
    for (const double tolerance : {1e-6, 1e-9}) {
      const double here = least_milliseconds([&] { ours(model, problem, tolerance); });
      const double there = least_milliseconds([&] { by_cvodes(model, problem, tolerance, size); });
      const auto [own, own_slopes] = errors_of(ours(model, problem, tolerance), exact);
      const auto [other, other_slopes] =
          errors_of(by_cvodes(model, problem, tolerance, size), exact);
      std::printf("%-22s %9.0e %10.3f  %.1e (%.1e) %10.3f  %.1e (%.1e) %8.2f\n", problem.name,
                  tolerance, here, own, own_slopes, there, other, other_slopes, here / there);
    }
  }
}
