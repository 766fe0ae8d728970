#include "lib/model/constraints.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include <Eigen/Eigenvalues>

#include "lib/base/message.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A constraint's weight over the information along it: errors of what is estimated are right to its
// root, and a search is still well conditioned.
constexpr double kStiffness = 1e6;
constexpr double kMultipliersSettled = 1e-7;  // standard errors
constexpr double kRounding = 1e-13;
constexpr double kFlat = 1e-10;  // information of a direction over the largest
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// sum over coordinates j of (dg_i/dx_j)^2 / I_jj: the variance of g, were all coordinates alone.
VectorXd variances(const MatrixXd& slopes, const MatrixXd& information) {
  VectorXd out = VectorXd::Zero(slopes.rows());
  for (Index j = 0; j < slopes.cols(); ++j) {
    const double of_coordinate = information(j, j);
    if (of_coordinate > 0.0) out += slopes.col(j).array().square().matrix() / of_coordinate;
  }
  return out;
}

// The diagonal of slopes I^-1 slopes'; NaN where I does not determine all of it.
VectorXd joint_variances(const MatrixXd& slopes, const MatrixXd& information) {
  VectorXd scale = information.diagonal().cwiseMax(0.0).cwiseSqrt();
  for (double& each : scale) each = each > 0.0 ? 1.0 / each : 0.0;
  const MatrixXd unit = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(unit);
  const MatrixXd along = slopes * scale.asDiagonal() * eigen.eigenvectors();
  VectorXd out = VectorXd::Zero(slopes.rows());
  for (Index j = 0; j < slopes.cols(); ++j) {
    if (scale[j] == 0.0) out = (slopes.col(j).array() != 0.0).select(kNan, out);
  }
  for (Index j = 0; j < along.cols(); ++j) {
    const double of_direction = eigen.eigenvalues()[j];
    if (of_direction > kFlat) {
      out += along.col(j).array().square().matrix() / of_direction;
    } else {
      out = (along.col(j).array().abs() > kFlat).select(kNan, out);
    }
  }
  return out;
}

}  // namespace

Index Constraints::equalities() const { return std::count(equality.begin(), equality.end(), true); }

Constraints make_constraints(std::span<const Expression> g, std::vector<bool> equality,
                             std::vector<std::string> text, int parameters) {
  if (g.size() != equality.size() || g.size() != text.size()) {
    throw std::invalid_argument(message({"make_constraints: ", g.size(), " formulas, ",
                                         equality.size(), " kinds, ", text.size(), " texts"}));
  }
  std::vector<int> by(static_cast<std::size_t>(parameters));
  std::iota(by.begin(), by.end(), 0);
  const std::vector<bool> held(by.size(), false);
  return {compile(g, held, by), std::move(equality), std::move(text)};
}

ConstraintValues constraint_values(const Constraints& constraints, const VectorXd& p) {
  const Index m = constraints.size(), n = p.size();
  // A set of parameters may have grown by those of recordings, behind the ones that were there.
  const auto known = static_cast<Index>(constraints.functions.symbols);
  if (n < known) throw std::invalid_argument("constraint_values: too few parameters");
  ConstraintValues out{VectorXd::Zero(m), MatrixXd::Zero(m, n)};
  if (m == 0) return out;
  TapeMemory memory = make_memory(constraints.functions);
  std::copy_n(p.data(), known, memory.begin());
  evaluate_held(constraints.functions, memory);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> slopes(m, known);
  evaluate_jacobian(constraints.functions, memory, {out.g.data(), static_cast<std::size_t>(m)},
                    {slopes.data(), static_cast<std::size_t>(slopes.size())});
  out.slopes.leftCols(known) = slopes;
  return out;
}

void Multipliers::weigh(const MatrixXd& slopes, const MatrixXd& information) {
  variance = joint_variances(slopes, information);
  const VectorXd alone = variances(slopes, information);
  const Index m = slopes.rows();
  if (l.size() != m) l = VectorXd::Zero(m);
  w.resize(m);
  for (Index i = 0; i < m; ++i) w[i] = kStiffness / (alone[i] > 0.0 ? alone[i] : 1.0);
}

ConstraintResiduals constraint_residuals(const Constraints& constraints,
                                         const Multipliers& multipliers,
                                         const ConstraintValues& values) {
  ConstraintResiduals out{VectorXd::Zero(values.g.size()), values.slopes, 0.0};
  for (Index i = 0; i < values.g.size(); ++i) {
    const double l = multipliers.l[i], root = std::sqrt(multipliers.w[i]);
    const double r = l / root + root * values.g[i];
    const bool counts = constraints.equality[static_cast<std::size_t>(i)] || !(r < 0.0);
    out.r[i] = counts ? r : 0.0;
    out.slopes.row(i) *= counts ? root : 0.0;
    out.constant += 0.5 * l * l / multipliers.w[i];
  }
  return out;
}

bool update_multipliers(const Constraints& constraints, const VectorXd& g, const VectorXd& scale,
                        Multipliers& multipliers) {
  bool open = false;
  for (Index i = 0; i < g.size(); ++i) {
    const bool equality = constraints.equality[static_cast<std::size_t>(i)];
    const double before = multipliers.l[i];
    double l = before + multipliers.w[i] * g[i];
    if (!equality) l = std::max(l, 0.0);
    // An inequality that no longer holds anything back keeps no multiplier.
    const bool off = equality || l > 0.0 ? std::abs(g[i]) > scale[i] : before > 0.0;
    open = open || off;
    multipliers.l[i] = l;
  }
  return open;
}

VectorXd constraint_tolerances(const ConstraintValues& values, const VectorXd& p,
                               const MatrixXd& slopes, const MatrixXd& information) {
  if (values.slopes.cols() != p.size() || slopes.cols() != information.rows()) {
    throw std::invalid_argument("constraint_tolerances: slopes do not fit what they are by");
  }
  const VectorXd sizes = values.slopes.cwiseAbs() * p.cwiseAbs();
  return kMultipliersSettled * variances(slopes, information).cwiseSqrt() + kRounding * sizes +
         VectorXd::Constant(sizes.size(), 1e-300);
}

}  // namespace identikal
