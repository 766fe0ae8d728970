#include "identify/noise/internal/log_coordinates.h"

#include <algorithm>
#include <cmath>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd LogCoordinates::from(VectorXd x) const {
  for (const Index i : entries) x[i] = std::log(x[i]);
  return x;
}

VectorXd LogCoordinates::to(VectorXd z) const {
  for (const Index i : entries) z[i] = std::exp(z[i]);
  return z;
}

LikelihoodProblem LogCoordinates::problem(const LikelihoodProblem& by_x) const {
  LikelihoodProblem out;
  out.lower = from(by_x.lower);
  out.upper = from(by_x.upper);
  out.evaluate = [this, &by_x](const VectorXd& z, double& L, VectorXd* gradient,
                               MatrixXd* information) {
    // Rounding of a logarithm is no step across a bound.
    const VectorXd x = to(z).cwiseMax(by_x.lower).cwiseMin(by_x.upper);
    if (!by_x.evaluate(x, L, gradient, information)) return false;
    for (const Index i : entries) {
      if (gradient != nullptr) (*gradient)[i] *= x[i];
      if (information == nullptr) continue;
      information->row(i) *= x[i];
      information->col(i) *= x[i];
    }
    return true;
  };
  return out;
}

LogCoordinates logarithmic_coordinates(const Model& model, const std::vector<Index>& besides) {
  const bool equations = is_formula_model(model) && !as_formulas(model).linear;
  LogCoordinates out;
  Index at = 0;
  for (const Parameter& p : model.parameters) {
    if (p.fixed) continue;
    const bool stays = std::count(besides.begin(), besides.end(), at) > 0;
    const bool by_logarithm =
        p.scale == SearchScale::logarithm || (equations && moves_by_logarithm(p));
    if (by_logarithm && !stays) out.entries.push_back(at);
    at += coordinates({p}).size();
  }
  return out;
}

}  // namespace identikal
