#include "studies/detection.h"

#include <cmath>
#include <complex>
#include <numbers>
#include <string>

#include <fmt/format.h>

#include "identify/colour/shaped_model.h"
#include "identify/estimate/distribution.h"
#include "lib/filter/kalman.h"
#include "lib/filter/steady_state.h"
#include "lib/model/frequency_response.h"
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
  Model truth;
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
      const auto steady = *steady_state(instantiate(as_linear(made.truth), made.truth.parameters));
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
      "is white: their whiteness,\nwhich the source asks for, decides nothing. That of the "
      "innovations does.\n";
  const VectorXd lag = VectorXd::LinSpaced(kLags + 1, 0.0, static_cast<double>(kLags));
  VectorXd seen(kLags + 1), fitted = seen;
  out.csv = "lag,measured,fitted\n";
  for (Index l = 0; l <= kLags; ++l) {
    seen[l] = Y[l](0, 0);
    fitted[l] = fit.fitted[l](0, 0);
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
    const MatrixXcd resolvent = state_response(A, omega[k], MatrixXd::Identity(n, n));
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

// The output's spectrum as measured, as the true model has it, and what it may be composed of.
struct SpectrumOfOutput {
  VectorXd omega, level, expected;  // [rad]; measured and true power
  MatrixXd base, filter_base;       // base functions of the system and of (5.21)
  double low = 0.0, high = 0.0;     // 95 % band of the measured one, as factors
};

constexpr int kTapers = 9;

VectorXd true_spectrum(const StateSpace& m, const VectorXd& omega) {
  const Index n = m.states();
  VectorXd out(omega.size());
  for (Index k = 0; k < omega.size(); ++k) {
    const MatrixXcd T =
        state_response(m.A, omega[k], MatrixXd::Identity(n, n)) * m.G.cast<std::complex<double>>();
    out[k] = std::norm((m.C.cast<std::complex<double>>() * T)(0, 0)) * m.Q(0, 0) + m.R(0, 0);
  }
  return out;
}

SpectrumOfOutput spectrum_of_output(const DetectionExperiment& made) {
  const Spectrum measured = multitaper(made.data.y, kTapers);
  SpectrumOfOutput out;
  out.omega = measured.omega;
  out.level.resize(out.omega.size());
  for (Index k = 0; k < out.omega.size(); ++k) {
    out.level[k] = measured.S[k](0, 0).real();
  }
  out.expected =
      true_spectrum(instantiate(as_linear(made.truth), made.truth.parameters), out.omega);
  out.base = base_functions(made.system.A, made.system.C, out.omega);
  const ShapingState filter = shaping_state(oscillating_noise_filter());
  out.filter_base = base_functions(filter.A, filter.c, out.omega);
  const double dof = 2.0 * kTapers;
  out.low = dof / chi_square_quantile(0.975, dof);
  out.high = dof / chi_square_quantile(0.025, dof);
  return out;
}

// Neighbours share tapers: a narrow mean tells the peak better than one frequency.
VectorXd smoothed(const VectorXd& level) {
  constexpr Index kAverage = 20;
  VectorXd out = level;
  for (Index k = kAverage; k + kAverage < level.size(); ++k) {
    out[k] = level.segment(k - kAverage, 2 * kAverage + 1).mean();
  }
  return out;
}

std::string line_of_peaks(const std::string& what, const VectorXd& omega, const VectorXd& values) {
  constexpr double kSecond = 0.9;  // rad: the system's own peak is below, that of (5.21) above
  const double first = peak_above(omega, values, 0.0), second = peak_above(omega, values, kSecond);
  const std::string out = fmt::format("  {:<40} {:>7.3f} rad/s", what, first);
  if (std::isnan(second) || second == first) return out + "\n";
  return out +
         fmt::format(", {:.3f} rad/s ({:.3f} Hz)\n", second, second / (2.0 * std::numbers::pi));
}

std::string text_of_spectrum(int number, bool coloured, const SpectrumOfOutput& s) {
  std::string out = fmt::format(
      "matisko-figure-{}: (5.17) with {}, {} samples: spectrum of the output ({} tapers) and base "
      "functions\n",
      number, noise_name(coloured), kRecorded, kTapers);
  out += coloured ? "published: an additional mode around 1.19 rad/s (0.19 Hz)\n"
                  : "published: the spectrum can be formed by combining the base functions\n";
  out += "ours, highest peaks:\n";
  const auto peaks = [&](const char* what, const VectorXd& values) {
    out += line_of_peaks(what, s.omega, values);
  };
  if (coloured) peaks("measured", smoothed(s.level));
  peaks("of the true model", s.expected);
  peaks("base function F1", s.base.row(0).transpose());
  peaks("base function F2", s.base.row(1).transpose());
  if (number == 11) {
    peaks("filter's base function F3", s.filter_base.row(0).transpose());
    peaks("filter's base function F4", s.filter_base.row(1).transpose());
  }
  const double inside = ((s.expected.array() > s.low * s.level.array()) &&
                         (s.expected.array() < s.high * s.level.array()))
                            .cast<double>()
                            .mean();
  return out + fmt::format(
                   "the true spectrum lies within the 95 % band of the measured one at {:.1f} % of "
                   "frequencies\n",
                   100.0 * inside);
}

std::string csv_of_spectrum(const SpectrumOfOutput& s) {
  std::string out = "omega_rad_s,measured,band_low,band_high,true,F1,F2,F3,F4\n";
  for (Index k = 0; k < s.omega.size(); ++k) {
    out +=
        fmt::format("{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n", s.omega[k],
                    s.level[k], s.low * s.level[k], s.high * s.level[k], s.expected[k],
                    s.base(0, k), s.base(1, k), s.filter_base(0, k), s.filter_base(1, k));
  }
  return out;
}

Figure figure_of_spectrum(int number, bool coloured, const SpectrumOfOutput& s) {
  Panel a;
  a.title = std::string("Spectrum of the output, ") + noise_name(coloured);
  a.x = {"rad/s", 0.0, 3.15, false};
  a.y = {"power", 0.3 * s.level.minCoeff(), 3.0 * s.level.maxCoeff(), true};
  a.curves = {{"measured", s.omega, s.level, Curve::Form::solid},
              {"true", s.omega, s.expected, Curve::Form::dashed}};
  Panel b;
  b.title = "Base functions";
  b.x = a.x;
  const double highest = std::max(s.base.maxCoeff(), number == 11 ? s.filter_base.maxCoeff() : 0.0);
  b.y = {"squared magnitude", 1e-4 * highest, 3.0 * highest, true};
  b.curves = {{"F1", s.omega, s.base.row(0).transpose(), Curve::Form::solid},
              {"F2", s.omega, s.base.row(1).transpose(), Curve::Form::dashed}};
  if (number == 11) {
    b.curves.push_back({"F3", s.omega, s.filter_base.row(0).transpose(), Curve::Form::solid});
    b.curves.push_back({"F4", s.omega, s.filter_base.row(1).transpose(), Curve::Form::dashed});
  }
  return {{a, b}};
}

// Figures 9, 10 and 11.
StudyReport spectrum_figure(int number, const StudyOptions& options) {
  const bool coloured = number != 9;
  const SpectrumOfOutput spectrum = spectrum_of_output(experiment(coloured, options));
  StudyReport out;
  out.text = text_of_spectrum(number, coloured, spectrum);
  out.csv = csv_of_spectrum(spectrum);
  out.figure = figure_of_spectrum(number, coloured, spectrum);
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
