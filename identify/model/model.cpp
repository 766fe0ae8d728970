#include "identify/model/model.h"

#include <fmt/format.h>

namespace identikal {

const char* to_string(NonlinearMethod method) {
  switch (method) {
    case NonlinearMethod::extended:
      return "extended";
    case NonlinearMethod::iterated:
      return "iterated";
    case NonlinearMethod::unscented:
      return "unscented";
  }
  return "";
}

NonlinearMethod nonlinear_method(const std::string& name, const Location& at) {
  for (const NonlinearMethod method :
       {NonlinearMethod::extended, NonlinearMethod::iterated, NonlinearMethod::unscented}) {
    if (name == to_string(method)) return method;
  }
  throw InputError(at, fmt::format("unknown filter '{}'", name), "extended, iterated or unscented");
}

}  // namespace identikal
