#include "lib/filter/kalman.h"

#include "lib/filter/internal/recursion.h"

namespace identikal {

using Eigen::MatrixXd;

FilterResult kalman_filter(const StateSpace& model, InitialState initial,
                           const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                           Keep keep) {
  return run_filter(model, initial, y, u, keep);
}

FilterResult kalman_filter(const ModelAt& model, InitialState initial,
                           const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                           Keep keep) {
  return run_filter(model, initial, y, u, keep);
}

Likelihood log_likelihood(const ModelAt& model, InitialState initial,
                          const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                          bool with_derivatives) {
  return run_recursion(model, initial, y, u, with_derivatives);
}

Likelihood log_likelihood(const StateSpace& model, InitialState initial,
                          const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                          const std::vector<StateSpace>& derivatives) {
  RecursionOptions options;
  return run_recursion(model, initial, y, u, derivatives, options);
}

MatrixXd score_products(const StateSpace& model, InitialState initial,
                        const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                        const std::vector<StateSpace>& derivatives) {
  MatrixXd out;
  RecursionOptions options;
  options.score_products = &out;
  const Likelihood l = run_recursion(model, initial, y, u, derivatives, options);
  return l.status == FilterStatus::ok ? out : MatrixXd();
}

}  // namespace identikal
