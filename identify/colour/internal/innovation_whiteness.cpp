#include "identify/colour/internal/innovation_whiteness.h"

#include <algorithm>
#include <cmath>

#include "identify/estimate/distribution.h"
#include "lib/statistics/spectrum.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int kTapers = 5;
constexpr Index kFewest = 64;  // samples that make a spectrum

}  // namespace

Index first_innovation(const MatrixXd& standardised) {
  Index first = 0;
  while (first < standardised.cols() && standardised.col(first).array().isNaN().all()) ++first;
  return first;
}

InnovationSpectra innovation_spectra(const MatrixXd& standardised, Index first) {
  const MatrixXd e = standardised.rightCols(standardised.cols() - first);
  InnovationSpectra out;
  if (e.cols() < kFewest) return out;
  const Spectrum s = multitaper(e, kTapers);
  out.omega = s.omega;
  out.level.resize(e.rows(), s.omega.size());
  for (Index k = 0; k < out.level.cols(); ++k) {
    out.level.col(k) = s.S[k].diagonal().real();
  }
  const double dof = 2.0 * kTapers;
  out.band = {chi_square_quantile(0.025, dof) / dof, chi_square_quantile(0.975, dof) / dof};
  return out;
}

InnovationWhiteness innovation_whiteness(const FilterEstimate& estimate) {
  InnovationWhiteness out;
  for (const TestResult& test : estimate.tests) {
    if (test.id == "ljung_box" && !std::isnan(test.p)) out.p = std::min(out.p, test.p);
  }
  const MatrixXd& e = estimate.series.standardised;
  const auto channels = static_cast<double>(e.rows());
  out.p = std::min(1.0, 2.0 * channels * out.p);
  const InnovationSpectra spectra = innovation_spectra(e, first_innovation(e));
  if (spectra.omega.size() == 0) return out;
  const VectorXd level = spectra.level.colwise().sum();
  Index at = 0;
  const double highest = level.maxCoeff(&at) / level.mean();
  const double dof = 2.0 * kTapers * channels;
  out.peak = spectra.omega[at];
  // Overlapping estimates: no more independent ones than frequencies.
  out.peak_p =
      std::min(1.0, static_cast<double>(level.size()) * chi_square_upper_tail(dof * highest, dof));
  out.p = std::min(out.p, 2.0 * out.peak_p);
  return out;
}

}  // namespace identikal
