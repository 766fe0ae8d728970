#include "identify/black_box/internal/nonlinearity.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "identify/black_box/internal/candidates.h"
#include "identify/black_box/internal/predictor_memory.h"
#include "identify/estimate/distribution.h"
#include "lib/statistics/long_run_covariance.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kMostRows = 20000;  // more tell nothing of a curve that matters
constexpr Index kParts = 40;
constexpr Index kMostPairs = 9;
constexpr double kSignificant = 1e-3;

struct Shape {
  const char* name;
  double (*of)(double);
};
constexpr std::array<Shape, 3> kShapes{{{"square", [](double x) { return x * x; }},
                                        {"cube", [](double x) { return x * x * x; }},
                                        {"absolute value", [](double x) { return std::abs(x); }}}};

constexpr Shape kLine{"line", [](double x) { return x; }};

enum class Place { input, output, feedback };
constexpr std::array<const char*, 3> kPlaces{"input", "output", "feedback"};

// A curve: of which signal, and where its values act.
struct Curve {
  Place place;
  Index input, output;  // -1: none
  const Shape* shape;
};

// One in every place; of many channels the pairs of them are too many.
std::vector<Curve> curves_of(const Shape& shape, Index inputs, Index outputs) {
  std::vector<Curve> out;
  for (Index j = 0; j < inputs; ++j) out.push_back({Place::input, j, -1, &shape});
  for (Index i = 0; i < outputs; ++i) {
    out.push_back({Place::output, -1, i, &shape});
    const bool pairs = inputs * outputs <= kMostPairs;
    for (Index j = 0; pairs && j < inputs; ++j) out.push_back({Place::feedback, j, i, &shape});
  }
  return out;
}

// The system from where the curve acts to the outputs, its innovations' filter H^-1 behind it or
// not.
InnovationForm system_of(const Curve& curve, const InnovationForm& model, bool to_innovations) {
  InnovationForm out = model;
  if (to_innovations) out.A = model.A - model.K * model.C;
  if (curve.place == Place::output) {
    const VectorXd here = VectorXd::Unit(model.outputs(), curve.output);
    out.B = to_innovations ? VectorXd(model.K.col(curve.output)) : VectorXd::Zero(model.states());
    out.C = to_innovations ? MatrixXd(-model.C) : model.C;
    out.D = here;
    return out;
  }
  const VectorXd direct = model.D.col(curve.input);
  out.B = model.B.col(curve.input);
  if (to_innovations) out.B -= model.K * direct;
  out.D = direct;
  return out;
}

// Of every recording, p values a row.
using Values = std::vector<VectorXd>;

// What the outputs, or the innovations, have of a curve. @param y  what stands for the outputs in
// it
Values responses(const Curve& curve, const InnovationForm& model, bool of_innovations,
                 const ScaledRecordings& recordings, const std::vector<MatrixXd>& y) {
  const InnovationForm system = system_of(curve, model, of_innovations);
  Values out;
  for (std::size_t k = 0; k < y.size(); ++k) {
    const Eigen::RowVectorXd signal =
        curve.place == Place::input ? recordings.u[k].row(curve.input) : y[k].row(curve.output);
    const MatrixXd s = simulated_outputs(system, signal.unaryExpr(curve.shape->of),
                                         VectorXd::Zero(system.states()));
    out.emplace_back(s.reshaped());
  }
  return out;
}

// Rows of all recordings one below the other.
struct Regression {
  MatrixXd Z;                    // what is linear in channels of the rows before, and 1
  Eigen::LDLT<MatrixXd> factor;  // of Z' Z
  std::vector<Index> recording, row;

  // Those of the regression's rows, so many rows before.
  MatrixXd rows_of(const Values& values, Index p, Index lag = 0) const {
    MatrixXd out(Z.rows(), p);
    for (Index k = 0; k < Z.rows(); ++k) {
      const auto at = static_cast<std::size_t>(k);
      out.row(k) = values[static_cast<std::size_t>(recording[at])].segment((row[at] - lag) * p, p);
    }
    return out;
  }
  // Without what Z explains.
  MatrixXd left_of(const Values& values, Index p) const {
    MatrixXd out = rows_of(values, p);
    out -= Z * factor.solve(Z.transpose() * out).eval();
    return out;
  }
};

// The responses to straight lines in place of curves: they span how the model's own parameters move
// the outputs.
// @param y  as responses() takes them
void add_lines(const InnovationForm& model, const ScaledRecordings& recordings,
               const std::vector<MatrixXd>& y, bool of_innovations, Regression& out) {
  constexpr Index kMost = 60;  // columns
  const Index p = model.outputs();
  const std::vector<Curve> lines = curves_of(kLine, model.inputs(), p);
  const auto each = static_cast<Index>(lines.size()) * p;
  const Index lags = std::clamp<Index>(kMost / each, 1, model.states() + 1);
  Index column = out.Z.cols();
  out.Z.conservativeResize(Eigen::NoChange, column + each * lags);
  for (const Curve& line : lines) {
    const Values values = responses(line, model, of_innovations, recordings, y);
    for (Index lag = 0; lag < lags; ++lag, column += p)
      out.Z.middleCols(column, p) = out.rows_of(values, p, lag);
  }
  out.factor.compute(out.Z.transpose() * out.Z);
}

// @param of_outputs  are outputs of rows before among the regressors?
Regression regression(const ScaledRecordings& recordings, Index lags, Index skip, bool of_outputs) {
  Regression out;
  const Index p = recordings.y.front().rows(), m = recordings.u.front().rows();
  for (std::size_t k = 0; k < recordings.y.size(); ++k) {
    Index complete = 0;  // rows
    for (Index t = 0; t < recordings.y[k].cols(); ++t) {
      complete = recordings.y[k].col(t).allFinite() ? complete + 1 : 0;
      if (t < skip || complete <= lags) continue;
      out.recording.push_back(static_cast<Index>(k));
      out.row.push_back(t);
    }
  }
  const auto rows = static_cast<Index>(out.row.size());
  out.Z.setOnes(rows, 1 + m * (lags + 1) + (of_outputs ? p * lags : 0));
  for (Index i = 0; i < rows; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const MatrixXd& u = recordings.u[static_cast<std::size_t>(out.recording[at])];
    const MatrixXd& y = recordings.y[static_cast<std::size_t>(out.recording[at])];
    Index column = 1;
    for (Index lag = 0; lag <= lags; ++lag, column += m)
      out.Z.row(i).segment(column, m) = u.col(out.row[at] - lag);
    for (Index lag = 1; of_outputs && lag <= lags; ++lag, column += p)
      out.Z.row(i).segment(column, p) = y.col(out.row[at] - lag);
  }
  return out;
}

// How much of e goes with w, and how surely.
struct Score {
  double p = 1.0, share = 0.0;
};

// P of a sum as large whose variance is known by so many degrees of freedom.
double two_sided(double sum, double variance, double freedom) {
  return f_upper_tail(sum * sum / variance, 1.0, freedom);
}

// The scores' sum against their scatter: by parts of the recording, and where that is significant
// by their autocovariances too, for colour that outlasts a part.
// @param regressors  that e and w are without
Score score(const MatrixXd& e, const MatrixXd& w, Index regressors) {
  const double weight = w.squaredNorm();
  const double gain = e.cwiseProduct(w).sum() / weight;
  Score out;
  if (!std::isfinite(gain)) return out;
  out.share = gain * gain * weight / e.squaredNorm();
  const Eigen::RowVectorXd off = (e - gain * w).cwiseProduct(w).rowwise().sum().transpose();
  const Index rows = off.size();
  double of_parts = 0.0;
  for (Index part = 0; part < kParts; ++part) {
    const Index from = part * rows / kParts, to = (part + 1) * rows / kParts;
    of_parts += std::pow(off.segment(from, to - from).sum(), 2);
  }
  const double sum = gain * weight;
  const double lost = static_cast<double>(rows) / static_cast<double>(rows - regressors);
  out.p = two_sided(sum, lost * of_parts, static_cast<double>(kParts - 1));
  if (!(out.p < kSignificant)) return out;
  Index bandwidth = 1;
  const MatrixXd white = off * off.transpose();
  const double variance = widest_long_run_covariance(off, white, bandwidth)(0, 0);
  // Kiefer and Vogelsang (2005): those of Bartlett's window.
  const double freedom = 1.5 * static_cast<double>(rows) / static_cast<double>(bandwidth);
  out.p = std::max(out.p, two_sided(sum, lost * variance, freedom));
  return out;
}

// Rows after which little is left of a state.
Index memory_of(const MatrixXd& A) {
  constexpr double kLittle = 0.05;
  const double radius = std::min(spectral_radius(A), 0.999);
  return radius > 0.0 ? static_cast<Index>(std::log(kLittle) / std::log(radius)) : 0;
}

// What tests of all curves need of model and recordings.
struct Tests {
  Regression of_innovations, of_simulations;
  std::vector<MatrixXd> predicted, simulated;
  MatrixXd e, simulation_error, whitening;
};

Values differences(const std::vector<MatrixXd>& from, const std::vector<MatrixXd>& what) {
  Values out;
  for (std::size_t k = 0; k < from.size(); ++k) out.emplace_back((from[k] - what[k]).reshaped());
  return out;
}

Tests prepared(const InnovationForm& model, const ScaledRecordings& recordings, Index lags,
               Index skip) {
  Tests out;
  const Index p = model.outputs();
  for (std::size_t k = 0; k < recordings.y.size(); ++k) {
    const MatrixXd &y = recordings.y[k], &u = recordings.u[k];
    const VectorXd x0 = initial_state(model, y, u, kRowsForState);
    out.predicted.push_back(one_step_predictions(model, y, u, x0));
    out.simulated.push_back(simulated_outputs(model, u, x0));
  }
  out.of_innovations = regression(recordings, lags, skip, true);
  out.of_simulations = regression(recordings, lags, skip, false);
  add_lines(model, recordings, out.predicted, true, out.of_innovations);
  add_lines(model, recordings, out.simulated, false, out.of_simulations);
  out.e = out.of_innovations.left_of(differences(recordings.y, out.predicted), p);
  out.simulation_error = out.of_simulations.left_of(differences(recordings.y, out.simulated), p);
  const MatrixXd sigma = out.e.transpose() * out.e / static_cast<double>(out.e.rows());
  out.whitening = sigma.llt().matrixU().solve(MatrixXd::Identity(p, p));
  out.e = (out.e * out.whitening).eval();
  return out;
}

}  // namespace

std::vector<BlackBox::Nonlinearity> nonlinearities(const InnovationForm& model,
                                                   const ScaledRecordings& all,
                                                   const std::vector<std::string>& inputs,
                                                   const std::vector<std::string>& outputs,
                                                   Index skip) {
  constexpr Index kMostRegressors = 100, kLeastRows = 5;  // of a part
  const ScaledRecordings recordings = first_rows(all, kMostRows);
  const Index p = model.outputs(), m = model.inputs();
  const Index most = std::max<Index>(4, kMostRegressors / (p + m));
  const Index lags = std::clamp(std::max(2 * model.states(), memory_of(model.A)), Index{4}, most);
  const Tests tests = prepared(model, recordings, lags, std::max(skip, lags));
  const Index regressors = tests.of_innovations.Z.cols();
  if (tests.e.rows() < std::max(kLeastRows * kParts, 3 * regressors)) return {};
  const bool simulates = m > 0 && spectral_radius(model.A) < 1.0;
  std::vector<Curve> curves;
  for (const Shape& shape : kShapes) {
    const std::vector<Curve> more = curves_of(shape, m, p);
    curves.insert(curves.end(), more.begin(), more.end());
  }
  std::vector<BlackBox::Nonlinearity> out;
  for (const Curve& curve : curves) {
    const Values in_innovations = responses(curve, model, true, recordings, tests.predicted);
    const MatrixXd w = tests.of_innovations.left_of(in_innovations, p) * tests.whitening;
    const Score found = score(tests.e, w, regressors);
    if (!(found.p * static_cast<double>(curves.size()) < kSignificant)) continue;
    BlackBox::Nonlinearity each;
    each.place = kPlaces[static_cast<std::size_t>(curve.place)];
    each.shape = curve.shape->name;
    if (curve.input >= 0) each.input = inputs[static_cast<std::size_t>(curve.input)];
    if (curve.output >= 0) each.output = outputs[static_cast<std::size_t>(curve.output)];
    each.p = found.p;
    each.of_innovations = found.share;
    if (simulates) {
      const Values simulated = responses(curve, model, false, recordings, tests.simulated);
      const MatrixXd s = tests.of_simulations.left_of(simulated, p);
      each.of_simulation = score(tests.simulation_error, s, regressors).share;
    }
    out.push_back(std::move(each));
  }
  std::stable_sort(out.begin(), out.end(), [](const auto& a, const auto& b) {
    return a.of_innovations > b.of_innovations;
  });
  return out;
}

namespace {

// A curve in words: "the square of 'u', in its place".
std::string in_words(const BlackBox::Nonlinearity& curve) {
  const std::string of = fmt::format("the {} of '{}'", curve.shape,
                                     curve.place == "input" ? curve.input : curve.output);
  if (curve.place == "input") return of + " in its place";
  if (curve.place == "output") return of + " where it is measured";
  return fmt::format("{} acting like '{}'", of, curve.input);
}

}  // namespace

Findings check_linearity(const std::vector<BlackBox::Nonlinearity>& found) {
  constexpr double kNoticed = 0.01, kMatters = 0.1;  // of the squares that the model leaves
  constexpr double kAlike = 0.8;                     // of what the best explains
  if (found.empty()) return {};
  const BlackBox::Nonlinearity& best = found.front();
  const double of_simulation = std::isnan(best.of_simulation) ? 0.0 : best.of_simulation;
  if (!(std::max(best.of_innovations, of_simulation) > kNoticed)) return {};
  std::string text = fmt::format("{} explains {:.1f} % of the innovations' squares", in_words(best),
                                 100.0 * best.of_innovations);
  if (of_simulation > 0.0)
    text += fmt::format(" and {:.2g} % of those of the simulation's errors", 100.0 * of_simulation);
  int alike = 0;
  for (const BlackBox::Nonlinearity& other : found) {
    const bool same =
        other.place == best.place && other.input == best.input && other.output == best.output;
    if (same || other.of_innovations < kAlike * best.of_innovations) continue;
    text += fmt::format("{}{}", alike++ == 0 ? "; nearly as much do " : ", ", in_words(other));
    if (alike == 3) break;
  }
  Finding out =
      make_finding(FindingCode::nonlinear, {best.place == "input" ? best.input : best.output}, text,
                   "a model of formulas with a curve there, spline(...), or recordings "
                   "of smaller moves about the point that matters");
  if (std::max(best.of_innovations, of_simulation) > kMatters) out.severity = Severity::serious;
  return {out};
}

}  // namespace identikal
