// Times what is a filter's own covariance the size of its errors?
#pragma once

namespace identikal {

/// Derived values of this name, and of what contradicts the covariance P: "held-out rows", a
/// reference, "a likelier model". Times P is the size of the errors.
inline constexpr const char* kCovarianceFactor = "covariance factor by ";

}  // namespace identikal
