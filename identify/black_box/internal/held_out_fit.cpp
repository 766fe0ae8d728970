#include "identify/black_box/internal/held_out_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "identify/black_box/internal/predictor_memory.h"
#include "lib/subspace/innovation_form.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Of every output and row, recordings one after the other; 0 where one is missing.
MatrixXd squared_errors(const std::vector<MatrixXd>& y, const std::vector<MatrixXd>& predicted) {
  Index rows = 0, at = 0;
  for (const MatrixXd& each : y) rows += each.cols();
  MatrixXd out(y.front().rows(), rows);
  for (std::size_t k = 0; k < y.size(); at += y[k++].cols()) {
    const auto is_measured = y[k].array().isFinite();
    out.middleCols(at, y[k].cols()) =
        is_measured.select((y[k] - predicted[k]).array().square(), 0.0);
  }
  return out;
}

// Of every output about its mean.
VectorXd sums_of_squares(const std::vector<MatrixXd>& y) {
  const Index p = y.front().rows();
  VectorXd mean = VectorXd::Zero(p), count = mean;
  for (const MatrixXd& each : y) {
    const auto is_measured = each.array().isFinite();
    mean += is_measured.select(each.array(), 0.0).rowwise().sum().matrix();
    count += is_measured.cast<double>().rowwise().sum().matrix();
  }
  mean = mean.cwiseQuotient(count.cwiseMax(1.0));
  std::vector<MatrixXd> means;
  for (const MatrixXd& each : y) means.push_back(mean.replicate(1, each.cols()));
  return squared_errors(y, means).rowwise().sum().cwiseMax(1e-300);
}

// 1 - rms(e)/rms(y), mean over outputs, of all recordings together.
double mean_fit(const std::vector<MatrixXd>& y, const std::vector<MatrixXd>& predicted) {
  const VectorXd left = squared_errors(y, predicted).rowwise().sum();
  const double fit = 1.0 - left.cwiseQuotient(sums_of_squares(y)).cwiseSqrt().mean();
  return std::isfinite(fit) ? fit : -std::numeric_limits<double>::infinity();
}

// Of every recording, as the simulation of its first rows tells it.
std::vector<VectorXd> first_states(const InnovationForm& model, const ScaledRecordings& of) {
  std::vector<VectorXd> out;
  for (std::size_t k = 0; k < of.y.size(); ++k)
    out.push_back(initial_state(model, of.y[k], of.u[k], kRowsForState));
  return out;
}

std::vector<MatrixXd> simulations(const InnovationForm& model, const ScaledRecordings& to,
                                  const std::vector<VectorXd>& from) {
  std::vector<MatrixXd> out;
  for (std::size_t k = 0; k < to.y.size(); ++k)
    out.push_back(simulated_outputs(model, to.u[k], from[k]));
  return out;
}

MatrixXd squared_simulation_errors(const InnovationForm& model, const ScaledRecordings& to) {
  return squared_errors(to.y, simulations(model, to, first_states(model, to)));
}

struct Fits {
  double simulation = std::numeric_limits<double>::quiet_NaN(), prediction = 0.0;
};

// The state that the first rows tell of a predictor that remembers it through all of them.
VectorXd remembered_state(const InnovationForm& model, const MatrixXd& y, const MatrixXd& u,
                          const VectorXd& otherwise) {
  if (forgets(model, y.cols()) || !y.allFinite()) return otherwise;
  return state_before_predictions(model, y, u, kRowsForState);
}

Fits fits_of(const InnovationForm& model, const ScaledRecordings& to) {
  const std::vector<VectorXd> from = first_states(model, to);
  std::vector<MatrixXd> predicted;
  for (std::size_t k = 0; k < to.y.size(); ++k) {
    const MatrixXd &y = to.y[k], &u = to.u[k];
    predicted.push_back(one_step_predictions(model, y, u, remembered_state(model, y, u, from[k])));
  }
  Fits out;
  if (model.inputs() > 0) out.simulation = mean_fit(to.y, simulations(model, to, from));
  out.prediction = mean_fit(to.y, predicted);
  return out;
}

}  // namespace

void judge_on_held_out(BlackBoxCandidate& candidate, const SplitRecordings& parts) {
  constexpr double kWorse = 0.1;  // of the fit
  const InnovationForm& model = candidate.of_first = candidate.model;
  const Fits held_out = fits_of(model, parts.rest);
  candidate.prediction = held_out.prediction;
  candidate.simulation = held_out.simulation;
  const double usual = held_out.simulation - kWorse;
  candidate.lucky = held_out.prediction <= usual && fits_of(model, parts.first).simulation < usual;
}

namespace {

// Outputs that were recorded and what was predicted for them; one matrix for each row ahead.
struct Ahead {
  std::vector<MatrixXd> y, predicted;
};

void add_ahead(const InnovationForm& model, const MatrixXd& y, const MatrixXd& u, Index horizon,
               Index stride, Ahead& out) {
  const Index from = std::min(kRowsForState, y.cols() / 4);
  const Index places = (y.cols() - from - horizon) / stride + 1;
  if (y.cols() - from < horizon) return;
  const auto at = [&](Index k) { return Eigen::seqN(from + k, places, stride); };
  const MatrixXd states = predictor_states(model, y, u, initial_state(model, y, u, kRowsForState));
  MatrixXd x = states(Eigen::all, at(0));
  for (Index k = 0; k < horizon; ++k) {
    const MatrixXd here = u(Eigen::all, at(k));
    out.y.push_back(y(Eigen::all, at(k)));
    out.predicted.push_back(model.C * x + model.D * here);
    x = (model.A * x + model.B * here).eval();
  }
}

}  // namespace

void judge_for_control(BlackBoxCandidate& candidate, const ScaledRecordings& held_out,
                       Index horizon) {
  constexpr Index kPlaces = 2000;
  const Index stride = std::max<Index>(1, held_out.rows() / kPlaces);
  Ahead ahead;
  for (std::size_t k = 0; k < held_out.y.size(); ++k)
    add_ahead(candidate.of_first, held_out.y[k], held_out.u[k], horizon, stride, ahead);
  candidate.control = ahead.y.empty() ? std::numeric_limits<double>::quiet_NaN()
                                      : mean_fit(ahead.y, ahead.predicted);
}

// With L the sums of squared errors and S those of y the fits differ by sum over outputs of (L_one - L_than) /
// (p sqrt(S) (sqrt(L_one) + sqrt(L_than))): a sum over rows.
bool simulates_worse(const BlackBoxCandidate& one, const BlackBoxCandidate& than,
                     const ScaledRecordings& held_out) {
  constexpr Index kParts = 10;
  constexpr double kQuantile = 1.833;  // of Student's t with 9 degrees of freedom, 95 %
  const MatrixXd of_one = squared_simulation_errors(one.of_first, held_out);
  const MatrixXd of_other = squared_simulation_errors(than.of_first, held_out);
  if (!of_one.allFinite() || !of_other.allFinite()) return than.simulation > one.simulation;
  const VectorXd roots = of_one.rowwise().sum().cwiseSqrt() + of_other.rowwise().sum().cwiseSqrt();
  const VectorXd weights = (sums_of_squares(held_out.y).cwiseSqrt().cwiseProduct(roots))
                               .cwiseMax(1e-300)
                               .cwiseInverse() /
                           static_cast<double>(roots.size());
  const VectorXd loss = (of_one - of_other).transpose() * weights;
  VectorXd of_parts(kParts);
  for (Index k = 0; k < kParts; ++k) {
    const Index from = k * loss.size() / kParts, to = (k + 1) * loss.size() / kParts;
    of_parts[k] = loss.segment(from, to - from).sum();
  }
  const double scatter = (of_parts.array() - of_parts.mean()).square().sum();
  const double se = std::sqrt(scatter * kParts / (kParts - 1.0));
  return loss.sum() > kQuantile * se;
}

}  // namespace identikal
