#include "lib/statistics/transfer_function.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/QR>
#include <unsupported/Eigen/FFT>

namespace identikal {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

constexpr Index kTerms = 3,
                kOwnTerms = 2;     // of the response; of what a record begins and ends with
constexpr Index kFewestLines = 5;  // of a record

/// A record's lines, the k-th at k / seconds.
struct Lines {
  std::vector<Complex> input, output;
  double seconds;
};

Lines lines_of(const MatrixXd& record, double step) {
  const Index N = record.cols();
  Eigen::FFT<double> fft;
  Lines out;
  out.seconds = static_cast<double>(N) * step;
  std::vector<double> x(static_cast<std::size_t>(N));
  for (const Index row : {0, 1}) {
    const double mean = record.row(row).mean();
    for (Index t = 0; t < N; ++t) x[t] = record(row, t) - mean;
    fft.fwd(row == 0 ? out.input : out.output, x);
    // Lines of records of different lengths have noise of one size.
    for (Complex& line : row == 0 ? out.input : out.output)
      line /= std::sqrt(static_cast<double>(N));
  }
  return out;
}

struct Band {
  double frequency, half_width;
};

/// The lines of a record within a band: first, and how many; the mean's own is none.
std::pair<Index, Index> lines_within(const Lines& lines, const Band& band) {
  const auto half = static_cast<Index>((lines.input.size() - 1) / 2);
  const auto first = std::max<Index>(
      1, static_cast<Index>(std::ceil((band.frequency - band.half_width) * lines.seconds - 1e-9)));
  const auto last = std::min<Index>(
      half,
      static_cast<Index>(std::floor((band.frequency + band.half_width) * lines.seconds + 1e-9)));
  const Index count = last - first + 1;
  return {first, count >= kFewestLines ? count : 0};
}

TransferFunction at_frequency(const std::vector<Lines>& records, const Band& band) {
  Index rows = 0, used = 0;
  for (const Lines& lines : records) {
    const Index count = lines_within(lines, band).second;
    rows += count;
    if (count > 0) ++used;
  }
  const Index unknowns = kTerms + kOwnTerms * used;
  TransferFunction out;
  out.value = Complex(out.relative_se, out.relative_se);
  if (rows <= unknowns) return out;
  MatrixXcd X = MatrixXcd::Zero(rows, unknowns);
  VectorXcd Y(rows);
  Index row = 0, own = kTerms;  // own: where the record's transient stands
  for (const Lines& lines : records) {
    const auto [first, count] = lines_within(lines, band);
    if (count == 0) continue;
    for (Index k = first; k < first + count; ++k, ++row) {
      const double x = (static_cast<double>(k) / lines.seconds - band.frequency) / band.half_width;
      double power = 1.0;
      for (Index term = 0; term < kTerms; ++term, power *= x) {
        X(row, term) = power * lines.input[k];
        if (term < kOwnTerms) X(row, own + term) = power;
      }
      Y[row] = lines.output[k];
      out.input_power += std::norm(lines.input[k]) / static_cast<double>(rows);
    }
    own += kOwnTerms;
  }
  const VectorXd scale = X.colwise().norm();
  if (!(scale.minCoeff() > 0.0)) return out;
  X = X * scale.cwiseInverse().asDiagonal();
  const Eigen::ColPivHouseholderQR<MatrixXcd> qr(X);
  if (qr.rank() < unknowns) return out;
  const VectorXcd theta = qr.solve(Y);
  const double left = (Y - X * theta).squaredNorm();
  const double explained = (X.leftCols(kTerms) * theta.head(kTerms)).squaredNorm();
  const MatrixXcd inverse = qr.solve(MatrixXcd::Identity(rows, rows)).topRows(1);
  out.value = theta[0] / scale[0];
  out.coherence = explained / (explained + left);
  out.freedom = 2.0 * static_cast<double>(rows - unknowns);
  // Half of a complex error is the gain's, the other half the phase's.
  const double variance = inverse.squaredNorm() * left / out.freedom;
  out.relative_se = std::sqrt(variance) / std::abs(theta[0]);
  return out;
}

}  // namespace

std::vector<TransferFunction> transfer_function(const std::vector<MatrixXd>& records, double step,
                                                const VectorXd& frequencies, double half_width) {
  std::vector<Lines> lines;
  double longest = 0.0;
  for (const MatrixXd& record : records) {
    if (record.rows() != 2 || record.cols() < 16) {
      throw std::invalid_argument("transfer_function: a record is input and output, 16 samples");
    }
    lines.push_back(lines_of(record, step));
    longest = std::max(longest, lines.back().seconds);
  }
  std::vector<TransferFunction> out;
  for (const double frequency : frequencies) {
    out.push_back(at_frequency(lines, {frequency, std::max(half_width, 6.0 / longest)}));
  }
  return out;
}

}  // namespace identikal
