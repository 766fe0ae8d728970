#include "identify/estimate/status.h"

namespace identikal {

std::string to_string(Status status) {
  switch (status) {
    case Status::ok:
      return "ok";
    case Status::rejected:
      return "rejected";
    case Status::not_converged:
      return "not_converged";
    case Status::untrusted:
      return "untrusted";
  }
  return "";
}

}  // namespace identikal
