// What is taken of recorded values before they are compared with a model's?
#pragma once

namespace identikal {

/// Of values in SI.
enum class Transform { none, logarithm, common_logarithm };

/// z of the value y that was recorded; y > 0 where it has a logarithm.
///
/// Example:
///
///     const double z = transformed(Transform::common_logarithm, 100.0);  // 2
double transformed(Transform transform, double y);

/// The value y whose z this is.
///
/// Example:
///
///     const double y = before_transform(Transform::common_logarithm, 2.0);  // 100
double before_transform(Transform transform, double z);

/// log |dz/dy|, by which the log-density of y is above that of z.
///
/// Example:
///
///     const double above = log_slope(Transform::logarithm, 3.0);  // -3: dz/dy = 1/y
double log_slope(Transform transform, double z);

}  // namespace identikal
