#include "identify/black_box/internal/responses.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include <Eigen/LU>

#include "identify/black_box/internal/likeliest_prior.h"
#include "lib/statistics/spectral_analysis.h"
#include "lib/subspace/impulse_regression.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Complex = std::complex<double>;

const char* name_of(Kernel kernel) {
  if (kernel == Kernel::diagonal_correlated) return "DC";
  return kernel == Kernel::stable_spline ? "SS" : "TC";
}

// Of an output to an input, from deviations in units of their scatter to SI.
double to_si(const OperatingPoint& point, Index output, Index input) {
  return point.y_sd[output] / point.u_sd[input];
}

template <typename Response>
Response named(const Dataset& channels, Index output, Index input) {
  Response out;
  out.input = channels.inputs[static_cast<std::size_t>(input)].name;
  out.output = channels.outputs[static_cast<std::size_t>(output)].name;
  return out;
}

// Frequencies from four periods within the longest recording to half the sampling rate, in rad per row.
VectorXd frequencies(const ScaledRecordings& recordings) {
  constexpr Index kCount = 60;
  Index longest = 0;
  for (const MatrixXd& each : recordings.y) longest = std::max(longest, each.cols());
  const double periods = 4.0, rows = static_cast<double>(std::clamp<Index>(longest, 80, 8000));
  const double low = 2.0 * std::numbers::pi * periods / rows;
  VectorXd out = VectorXd::LinSpaced(kCount, std::log(low), std::log(std::numbers::pi));
  out = out.array().exp();
  return out.cwiseMin(std::numbers::pi);
}

// G = C X + D, X = (z I - A)^-1 B, and its moves.
struct ResponseAt {
  MatrixXcd value;
  std::vector<MatrixXcd> moves;
};

ResponseAt response_at(const InnovationForm& model, const std::vector<Move>& moves, double omega) {
  const Index n = model.states();
  MatrixXcd M = -model.A.cast<Complex>();
  M.diagonal().array() += std::polar(1.0, omega);
  const Eigen::PartialPivLU<MatrixXcd> lu(M);
  const MatrixXcd X = lu.solve(model.B.cast<Complex>());
  const MatrixXcd C = model.C.cast<Complex>();
  ResponseAt out{C * X + model.D.cast<Complex>(), {}};
  const MatrixXcd left = C * lu.solve(MatrixXcd::Identity(n, n));
  for (const Move& d : moves) {
    out.moves.push_back(d.C.cast<Complex>() * X + d.D.cast<Complex>() +
                        left * (d.A.cast<Complex>() * X + d.B.cast<Complex>()));
  }
  return out;
}

constexpr double kDegree = std::numbers::pi / 180.0;

void add_model(const ResponseAt& at, Index i, Index j, double scale, Index k,
               BlackBox::FrequencyResponse& out) {
  const Complex G = at.value(i, j);
  const double size = std::abs(G);
  double gain = 0.0, phase = 0.0;
  for (const MatrixXcd& move : at.moves) {
    const Complex d = move(i, j) * std::conj(G) / std::max(size, 1e-300);
    gain += d.real() * d.real();
    phase += d.imag() * d.imag();
  }
  out.gain[k] = scale * size;
  out.phase[k] = std::arg(G) / kDegree;
  if (at.moves.empty()) return;
  out.gain_se[k] = scale * std::sqrt(gain);
  out.phase_se[k] = std::sqrt(phase) / std::max(size, 1e-300) / kDegree;
}

void add_spectral(const SpectralResponse& spectral, Index i, Index j, double scale, Index k,
                  BlackBox::FrequencyResponse& out) {
  const auto at = static_cast<std::size_t>(k);
  const Complex G = spectral.G[at](i, j);
  out.coherence[k] = spectral.coherence[at][i];
  if (!std::isfinite(G.real())) return;
  out.spectral_gain[k] = scale * std::abs(G);
  out.spectral_phase[k] = std::arg(G) / kDegree;
  out.spectral_gain_se[k] = scale * spectral.se[at](i, j);
  out.spectral_phase_se[k] = spectral.se[at](i, j) / std::max(std::abs(G), 1e-300) / kDegree;
}

// Whole turns off: from frequency to frequency no jump, and the estimate without a model beside the model's.
void unwrap(BlackBox::FrequencyResponse& out) {
  const auto nearest = [](double phase, double to) {
    return phase - 360.0 * std::round((phase - to) / 360.0);
  };
  for (Index k = 0; k < out.phase.size(); ++k) {
    if (k > 0) out.phase[k] = nearest(out.phase[k], out.phase[k - 1]);
    out.spectral_phase[k] = nearest(out.spectral_phase[k], out.phase[k]);
  }
}

// How far a response moves once the window is twice as wide: mean square over the variance that it has then.
double moved(const SpectralResponse& from, const SpectralResponse& to) {
  double sum = 0.0, count = 0.0;
  for (std::size_t k = 0; k < to.G.size(); ++k) {
    const MatrixXd apart = (to.G[k] - from.G[k]).cwiseAbs2();
    const double ratio = 0.5 * apart.cwiseQuotient(to.se[k].cwiseAbs2()).mean();
    if (!std::isfinite(ratio)) continue;
    sum += ratio;
    count += 1.0;
  }
  return count > 0.0 ? sum / count : 0.0;
}

// The window is opened for as long as the response moves by more than the scatter that this adds.
SpectralResponse resolved_spectra(const ScaledRecordings& recordings, const VectorXd& omega) {
  constexpr Index kFirst = 60, kWidest = 1000;
  constexpr double kMoved = 0.5, kWork = 2e8;
  Index longest = 0;
  for (const MatrixXd& each : recordings.y) longest = std::max(longest, each.cols());
  const auto channels = static_cast<double>(recordings.y[0].rows() + recordings.u[0].rows());
  const double work_of_a_lag = channels * channels * static_cast<double>(recordings.rows());
  const Index most = std::min({longest / 6, kWidest, static_cast<Index>(kWork / work_of_a_lag)});
  Index lags = std::clamp<Index>(longest / 6, 1, kFirst);
  SpectralResponse out = spectral_analysis(recordings.y, recordings.u, lags, omega);
  for (lags *= 2; lags <= most; lags *= 2) {
    SpectralResponse wider = spectral_analysis(recordings.y, recordings.u, lags, omega);
    if (!(moved(out, wider) > kMoved)) break;
    out = std::move(wider);
  }
  return out;
}

BlackBox::FrequencyResponse empty_response(const Dataset& channels, Index i, Index j,
                                           const VectorXd& omega) {
  auto out = named<BlackBox::FrequencyResponse>(channels, i, j);
  const VectorXd none = VectorXd::Constant(omega.size(), kNone);
  out.frequency = omega / channels.dt;
  for (VectorXd* each :
       {&out.gain, &out.gain_se, &out.phase, &out.phase_se, &out.spectral_gain,
        &out.spectral_gain_se, &out.spectral_phase, &out.spectral_phase_se, &out.coherence})
    *each = none;
  return out;
}

}  // namespace

std::vector<BlackBox::ImpulseResponse> impulse_responses(const ScaledRecordings& recordings,
                                                         const Dataset& channels, Index rows) {
  const Index p = recordings.y.front().rows(), m = recordings.u.front().rows();
  if (m == 0) return {};
  constexpr Index kMostColumns = 200;
  const Index lags = std::min({rows, recordings.rows() / 4, kMostColumns / m});
  if (lags < 2) return {};
  const ScaledRecordings rows_used = first_rows(recordings, kEnoughRows);
  const ImpulseRegression regression(lagged_products(rows_used.y, rows_used.u, lags));
  // In a long recording no kernel is far from the data, and of many inputs a choice takes longer than all else.
  constexpr Index kShort = 5000, kFew = 110;
  const bool all_kernels = recordings.rows() <= kShort && m * (lags + 1) <= kFew;
  const KernelPriors priors = likeliest_kernel(regression, all_kernels);
  const MatrixXd value = regression.estimate(priors.likeliest).value;
  MatrixXd se = MatrixXd::Zero(value.rows(), value.cols());
  for (const KernelPrior& each : priors.wide) se = se.cwiseMax(regression.estimate(each).se);
  std::vector<BlackBox::ImpulseResponse> all;
  for (Index i = 0; i < p; ++i) {
    for (Index j = 0; j < m; ++j) {
      auto out = named<BlackBox::ImpulseResponse>(channels, i, j);
      const double scale = to_si(recordings.point, i, j);
      out.kernel = name_of(priors.likeliest.kernel);
      out.value = scale * value.col(i).segment(j * (lags + 1), lags + 1);
      out.se = scale * se.col(i).segment(j * (lags + 1), lags + 1);
      all.push_back(std::move(out));
    }
  }
  return all;
}

// x(t+1) = A x + B, y = C x + D, and its moves dx(t+1) = A dx + dA x + dB.
std::vector<BlackBox::StepResponse> step_responses(const InnovationForm& model,
                                                   const std::vector<Move>& moves,
                                                   const OperatingPoint& point,
                                                   const Dataset& channels, Index rows) {
  const Index n = model.states(), p = model.outputs(), m = model.inputs();
  std::vector<BlackBox::StepResponse> all;
  for (Index j = 0; j < m; ++j) {
    MatrixXd value(p, rows), variance = MatrixXd::Zero(p, rows);
    VectorXd x = VectorXd::Zero(n);
    std::vector<VectorXd> dx(moves.size(), x);
    for (Index t = 0; t < rows; ++t) {
      value.col(t) = model.C * x + model.D.col(j);
      for (std::size_t k = 0; k < moves.size(); ++k) {
        const VectorXd dy = model.C * dx[k] + moves[k].C * x + moves[k].D.col(j);
        variance.col(t) += dy.cwiseAbs2();
        dx[k] = (model.A * dx[k] + moves[k].A * x + moves[k].B.col(j)).eval();
      }
      x = (model.A * x + model.B.col(j)).eval();
    }
    for (Index i = 0; i < p; ++i) {
      auto out = named<BlackBox::StepResponse>(channels, i, j);
      const double scale = to_si(point, i, j);
      out.value = scale * value.row(i).transpose();
      out.se = scale * variance.row(i).transpose().cwiseSqrt();
      if (moves.empty()) out.se.setConstant(kNone);
      all.push_back(std::move(out));
    }
  }
  return all;
}

std::vector<BlackBox::FrequencyResponse> frequency_responses(const InnovationForm& model,
                                                             const std::vector<Move>& moves,
                                                             const ScaledRecordings& recordings,
                                                             const Dataset& channels) {
  const Index p = model.outputs(), m = model.inputs();
  if (m == 0) return {};
  const VectorXd omega = frequencies(recordings);
  const ScaledRecordings used = first_rows(recordings, kEnoughRows);
  const SpectralResponse spectral = resolved_spectra(used, omega);
  std::vector<BlackBox::FrequencyResponse> all;
  for (Index i = 0; i < p; ++i) {
    for (Index j = 0; j < m; ++j) all.push_back(empty_response(channels, i, j, omega));
  }
  for (Index k = 0; k < omega.size(); ++k) {
    const ResponseAt at = response_at(model, moves, omega[k]);
    for (Index i = 0; i < p; ++i) {
      for (Index j = 0; j < m; ++j) {
        BlackBox::FrequencyResponse& out = all[static_cast<std::size_t>(i * m + j)];
        const double scale = to_si(recordings.point, i, j);
        add_model(at, i, j, scale, k, out);
        add_spectral(spectral, i, j, scale, k, out);
      }
    }
  }
  for (BlackBox::FrequencyResponse& each : all) unwrap(each);
  return all;
}

}  // namespace identikal
