#include "lib/filter/internal/segment.h"

#include <algorithm>

#include "lib/internal/powers.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The sums are computed for this many lags, then for twice as many, ...
constexpr Index kFirstLags = 64;
// A mean this many standard deviations from zero is taken out before products are summed.
constexpr double kFarFromZero = 2.0;

}  // namespace

Segment make_segment(const MatrixXd& y, const MatrixXd& u, Index begin, Index length) {
  const Index ny = y.rows(), nu = u.rows();
  MatrixXd z(ny + nu, length);
  z.topRows(ny) = y.middleCols(begin, length);
  if (nu > 0) z.bottomRows(nu) = u.middleCols(begin, length);
  const VectorXd mean = z.rowwise().mean();
  bool far = false;
  for (Index i = 0; i < z.rows(); ++i) {
    const double variance = (z.row(i).array() - mean[i]).square().mean();
    far = far || mean[i] * mean[i] > kFarFromZero * kFarFromZero * variance;
  }
  if (!far) return {begin, VectorXd(), SegmentAutocovariances(z), {}, {}};
  z.colwise() -= mean;
  z.conservativeResize(z.rows() + 1, Eigen::NoChange);
  z.bottomRows(1).setOnes();
  return {begin, mean, SegmentAutocovariances(z), {}, {}};
}

// Enough sample autocovariances for a filter that forgets after `memory` samples.
void extend_sums(SegmentAutocovariances& sums, Index memory) {
  Index lags = kFirstLags;
  while (lags < memory) lags *= 2;
  sums.extend_to(lags);
}

// Do outputs of this model drift away?
bool drifts(const StateSpace& model) {
  Powers<Eigen::Dynamic> powers;
  return !powers.compute(model.A);
}

namespace compressed {
// One source each, made from lib/filter/internal/compressed_kernel.cpp.in: they are most of what there
// is to compile in lib.
std::unique_ptr<SegmentKernel> make_1();
std::unique_ptr<SegmentKernel> make_2();
std::unique_ptr<SegmentKernel> make_3();
std::unique_ptr<SegmentKernel> make_4();
std::unique_ptr<SegmentKernel> make_5();
std::unique_ptr<SegmentKernel> make_6();
std::unique_ptr<SegmentKernel> make_Dynamic();
}  // namespace compressed

std::unique_ptr<SegmentKernel> make_segment_kernel(Eigen::Index states) {
  switch (states) {
    case 1:
      return compressed::make_1();
    case 2:
      return compressed::make_2();
    case 3:
      return compressed::make_3();
    case 4:
      return compressed::make_4();
    case 5:
      return compressed::make_5();
    case 6:
      return compressed::make_6();
    default:
      return compressed::make_Dynamic();
  }
}

}  // namespace identikal
