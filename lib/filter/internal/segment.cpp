#include "lib/filter/internal/segment.h"

namespace identikal {

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
