#include "lib/filter/internal/segment.h"

#include "lib/filter/internal/compressed_kernel.h"

namespace identikal {

std::unique_ptr<SegmentKernel> make_segment_kernel(Eigen::Index states) {
  switch (states) {
    case 1:
      return std::make_unique<CompressedKernel<1>>();
    case 2:
      return std::make_unique<CompressedKernel<2>>();
    case 3:
      return std::make_unique<CompressedKernel<3>>();
    case 4:
      return std::make_unique<CompressedKernel<4>>();
    case 5:
      return std::make_unique<CompressedKernel<5>>();
    case 6:
      return std::make_unique<CompressedKernel<6>>();
    default:
      return std::make_unique<CompressedKernel<Eigen::Dynamic>>();
  }
}

}  // namespace identikal
