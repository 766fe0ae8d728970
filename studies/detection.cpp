#include "studies/detection.h"

#include <cmath>
#include <complex>
#include <numbers>
#include <string>

#include <Eigen/LU>
#include <fmt/format.h>

#include "identify/colour/shaped_model.h"
#include "identify/estimate/distribution.h"
#include "lib/filter/kalman.h"
#include "lib/filter/steady_state.h"
#include "lib/statistics/autocorrelation.h"
#include "lib/statistics/autocovariance_realisation.h"
#include "lib/statistics/spectrum.h"
#include "lib/statistics/whiteness.h"
#include "studies/published_systems.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kRecorded = 8200;

// One recording; Q and R, which the source does not give, are 1.
struct DetectionExperiment {
  PublishedSystem system = oscillating_system();
  ModelFile truth;
  Dataset data;
};
DetectionExperiment experiment(bool coloured, const StudyOptions& options) {
  DetectionExperiment out;
  out.truth = model_of(out.system, 1.0, 1.0);
  if (coloured) {
    out.truth = with_shaping_filters(out.truth, NoiseSource::process,
                                     {{0, oscillating_noise_filter(), 1.0}});
  }
  Random random(options.seed);
  out.data = recording(out.truth, kRecorded, random);
  return out;
}

const char* noise_name(bool coloured) {
  return coloured ? "process noise through (5.21)" : "white noise";
}

// Innovations of x+ = A x + K e, y = C x + e from a state of zero.
MatrixXd innovations(const PublishedSystem& system, const MatrixXd& K, const MatrixXd& y) {
  VectorXd x = VectorXd::Zero(system.A.rows());
  MatrixXd e(y.rows(), y.cols());
  for (Index t = 0; t < y.cols(); ++t) {
    e.col(t) = y.col(t) - system.C * x;
    x = (system.A * x + K * e.col(t)).eval();
  }
  return e;
}

// Figures 7 and 8.
StudyReport autocorrelation_figure(bool coloured, const StudyOptions& options) {
  constexpr Index kLags = 100;
  constexpr int kTestLags = 20;
  const DetectionExperiment made = experiment(coloured, options);
  const Autocovariances Y = sample_autocovariances(made.data.y, kLags + 1, Divisor::samples);
  const AutocovarianceFit fit = fit_autocovariances(made.system.A, made.system.C, Y);
  StudyReport out;
  out.text = fmt::format(
      "matisko-figure-{}: (5.17) with {}, {} samples: autocorrelation of the output, and the "
      "nearest one\n"
      "that the system's own modes make, (5.13) over {} lags\n"
      "published: {}\n"
      "ours: {:.2f} % of the sum of squares is left; ",
      coloured ? 8 : 7, noise_name(coloured), kRecorded, kLags,
      coloured ? "\"cannot be formed by the modes of system (5.17)\""
               : "the curves agree; k = 0.84, 0.50, R_eps = 1.05 (its noise is not given)",
      100.0 * fit.left);
  if (fit.innovation) {
    const auto& [K, Sigma] = *fit.innovation;
    out.text += fmt::format("k = {:.3f}, {:.3f}, R_eps = {:.3f}", K(0), K(1), Sigma(0));
    if (!coloured) {
      const auto steady = *steady_state(instantiate(made.truth.linear, made.truth.parameters));
      out.text +=
          fmt::format(" (true: {:.3f}, {:.3f}, {:.3f})", steady.K(0), steady.K(1), steady.Sigma(0));
    }
    const ChiSquareStatistic test =
        portmanteau(innovations(made.system, K, made.data.y), kTestLags);
    out.text += fmt::format(
        ";\nwhat this k leaves of the recording is {}white: chi-square {:.0f} of {:.0f} degrees of "
        "freedom, p {:.2g}\n",
        chi_square_upper_tail(test.value, test.dof) < 0.05 ? "not " : "", test.value, test.dof,
        chi_square_upper_tail(test.value, test.dof));
  } else {
    out.text += "no k and R_eps make it (not positive real)\n";
  }
  out.text +=
      "In E x(t+1) y(t), through which k and R_eps enter, this is linear least squares with one "
      "minimum; the\nsource calls it non-convex. The residues are correlated even when the noise "
      "is "
      "white: their whiteness,\nwhich the source asks for, decides nothing. That of the "
      "innovations "
      "does.\n";
  const VectorXd lag = VectorXd::LinSpaced(kLags + 1, 0.0, static_cast<double>(kLags));
  VectorXd seen(kLags + 1), fitted = seen;
  out.csv = "lag,measured,fitted\n";
  for (Index l = 0; l <= kLags; ++l) {
    seen[l] = Y[static_cast<std::size_t>(l)](0, 0);
    fitted[l] = fit.fitted[static_cast<std::size_t>(l)](0, 0);
    out.csv += fmt::format("{},{:.6g},{:.6g}\n", l, seen[l], fitted[l]);
  }
  Panel panel;
  panel.title = std::string("Autocorrelation of the output, ") + noise_name(coloured);
  panel.x = {"lag in samples", 0.0, static_cast<double>(kLags), false};
  panel.y = {"autocovariance", 1.2 * seen.minCoeff(), 1.1 * seen.maxCoeff(), false};
  panel.curves = {{"measured", lag, seen, Curve::Form::solid},
                  {"of the system's modes", lag, fitted, Curve::Form::dashed}};
  out.figure = Figure{{panel}};
  return out;
}

// |c (zI - A)^-1|^2 of each state, the base functions; states x frequencies.
MatrixXd base_functions(const MatrixXd& A, const Eigen::RowVectorXd& c, const VectorXd& omega) {
  const Index n = A.rows();
  MatrixXd out(n, omega.size());
  for (Index k = 0; k < omega.size(); ++k) {
    const MatrixXcd resolvent =
        (std::polar(1.0, omega[k]) * MatrixXcd::Identity(n, n) - A.cast<std::complex<double>>())
            .inverse();
    out.col(k) = (c.cast<std::complex<double>>() * resolvent).cwiseAbs2().transpose();
  }
  return out;
}

// Highest where it is higher than both neighbours, above `from` [rad].
double peak_above(const VectorXd& omega, const VectorXd& level, double from) {
  Index best = -1;
  for (Index k = 1; k + 1 < omega.size(); ++k) {
    if (omega[k] < from || level[k] < level[k - 1] || level[k] < level[k + 1]) continue;
    if (best < 0 || level[k] > level[best]) best = k;
  }
  return best < 0 ? std::nan("") : omega[best];
}

// Figures 9, 10 and 11.
StudyReport spectrum_figure(int number, const StudyOptions& options) {
  constexpr int kTapers = 9;
  constexpr double kSecond = 0.9;  // rad: the system's own peak is below, that of (5.21) above
  const bool coloured = number != 9;
  const DetectionExperiment made = experiment(coloured, options);
  const Spectrum measured = multitaper(made.data.y, kTapers);
  const Index count = measured.omega.size();
  VectorXd level(count), expected(count);
  const StateSpace m = instantiate(made.truth.linear, made.truth.parameters);
  const Index n = m.states();
  for (Index k = 0; k < count; ++k) {
    level[k] = measured.S[static_cast<std::size_t>(k)](0, 0).real();
    const MatrixXcd T = (std::polar(1.0, measured.omega[k]) * MatrixXcd::Identity(n, n) -
                         m.A.cast<std::complex<double>>())
                            .inverse() *
                        m.G.cast<std::complex<double>>();
    expected[k] = std::norm((m.C.cast<std::complex<double>>() * T)(0, 0)) * m.Q(0, 0) + m.R(0, 0);
  }
  // Neighbours share tapers: a narrow mean tells the peak better than one frequency.
  constexpr Index kAverage = 20;
  VectorXd smooth = level;
  for (Index k = kAverage; k + kAverage < count; ++k) {
    smooth[k] = level.segment(k - kAverage, 2 * kAverage + 1).mean();
  }
  const MatrixXd base = base_functions(made.system.A, made.system.C, measured.omega);
  const ShapingState filter = shaping_state(oscillating_noise_filter());
  const MatrixXd filter_base = base_functions(filter.A, filter.c, measured.omega);
  const double dof = 2.0 * kTapers;
  const double low = dof / chi_square_quantile(0.975, dof),
               high = dof / chi_square_quantile(0.025, dof);
  StudyReport out;
  out.text = fmt::format(
      "matisko-figure-{}: (5.17) with {}, {} samples: spectrum of the output ({} tapers) and base "
      "functions\n",
      number, noise_name(coloured), kRecorded, kTapers);
  const auto peaks = [&](const std::string& what, const VectorXd& values) {
    const double first = peak_above(measured.omega, values, 0.0),
                 second = peak_above(measured.omega, values, kSecond);
    out.text += fmt::format("  {:<40} {:>7.3f} rad/s", what, first);
    out.text += std::isnan(second) || second == first
                    ? "\n"
                    : fmt::format(", {:.3f} rad/s ({:.3f} Hz)\n", second,
                                  second / (2.0 * std::numbers::pi));
  };
  out.text += coloured ? "published: an additional mode around 1.19 rad/s (0.19 Hz)\n"
                       : "published: the spectrum can be formed by combining the base functions\n";
  out.text += "ours, highest peaks:\n";
  if (coloured) peaks("measured", smooth);
  peaks("of the true model", expected);
  peaks("base function F1", base.row(0).transpose());
  peaks("base function F2", base.row(1).transpose());
  if (number == 11) {
    peaks("filter's base function F3", filter_base.row(0).transpose());
    peaks("filter's base function F4", filter_base.row(1).transpose());
  }
  const double inside =
      ((expected.array() > low * level.array()) && (expected.array() < high * level.array()))
          .cast<double>()
          .mean();
  out.text += fmt::format(
      "the true spectrum lies within the 95 % band of the measured one at {:.1f} % of "
      "frequencies\n",
      100.0 * inside);
  out.csv = "omega_rad_s,measured,band_low,band_high,true,F1,F2,F3,F4\n";
  for (Index k = 0; k < count; ++k) {
    out.csv +=
        fmt::format("{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n",
                    measured.omega[k], level[k], low * level[k], high * level[k], expected[k],
                    base(0, k), base(1, k), filter_base(0, k), filter_base(1, k));
  }
  Figure figure;
  Panel a;
  a.title = std::string("Spectrum of the output, ") + noise_name(coloured);
  a.x = {"rad/s", 0.0, 3.15, false};
  a.y = {"power", 0.3 * level.minCoeff(), 3.0 * level.maxCoeff(), true};
  a.curves = {{"measured", measured.omega, level, Curve::Form::solid},
              {"true", measured.omega, expected, Curve::Form::dashed}};
  Panel b;
  b.title = "Base functions";
  b.x = a.x;
  const double highest = std::max(base.maxCoeff(), number == 11 ? filter_base.maxCoeff() : 0.0);
  b.y = {"squared magnitude", 1e-4 * highest, 3.0 * highest, true};
  b.curves = {{"F1", measured.omega, base.row(0).transpose(), Curve::Form::solid},
              {"F2", measured.omega, base.row(1).transpose(), Curve::Form::dashed}};
  if (number == 11) {
    b.curves.push_back({"F3", measured.omega, filter_base.row(0).transpose(), Curve::Form::solid});
    b.curves.push_back({"F4", measured.omega, filter_base.row(1).transpose(), Curve::Form::dashed});
  }
  figure.panels = {a, b};
  out.figure = figure;
  return out;
}

}  // namespace

std::vector<Study> detection_studies() {
  std::vector<Study> out;
  for (const int number : {7, 8}) {
    out.push_back(
        {fmt::format("matisko-figure-{}", number), 0, [number](const StudyOptions& options) {
           return autocorrelation_figure(number == 8, options);
         }});
  }
  for (const int number : {9, 10, 11}) {
    out.push_back(
        {fmt::format("matisko-figure-{}", number), 0,
         [number](const StudyOptions& options) { return spectrum_figure(number, options); }});
  }
  return out;
}

}  // namespace identikal
