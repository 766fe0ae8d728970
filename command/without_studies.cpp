// What the verb study answers in a program that was built with -DIDENTIKAL_BUILD_STUDIES=OFF.
#include "lib/base/error.h"
#include "studies/study.h"

namespace identikal {

std::vector<std::string> study_names() { return {}; }

std::string study_ranges() { return "none: this program was built without the studies"; }

StudyReport study(const std::string&, const StudyOptions&) {
  throw InputError({}, "this program was built without the studies", "",
                   "configure with -DIDENTIKAL_BUILD_STUDIES=ON and build it again");
}

std::string svg(const Figure&) { return ""; }

}  // namespace identikal
