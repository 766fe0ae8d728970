#include "lib/filter/kalman.h"

#include "lib/filter/internal/recursion.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

FilterResult run(Recursion& recursion, Index n, const Eigen::Ref<const MatrixXd>& y, Keep keep) {
  FilterResult out = empty_filter_result(n, y.rows(), y.cols(), keep);
  RecursionOptions options;
  const Likelihood likelihood = recursion.run(options, &out);
  out.status = likelihood.status;
  out.log_likelihood = likelihood.value;
  return out;
}

}  // namespace

FilterResult kalman_filter(const StateSpace& model, InitialState initial,
                           const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                           Keep keep) {
  Recursion recursion(model, initial, y, u, {});
  return run(recursion, model.states(), y, keep);
}

FilterResult kalman_filter(const ModelAt& model, InitialState initial,
                           const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                           Keep keep) {
  StateSpace now;
  const std::vector<StateSpace> none;
  model(0, now, nullptr);
  Recursion recursion(now, initial, y, u, none);
  recursion.set_model_change([&](Index t) { model(t, now, nullptr); }, none);
  return run(recursion, now.states(), y, keep);
}

Likelihood log_likelihood(const ModelAt& model, InitialState initial,
                          const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                          bool with_derivatives) {
  StateSpace now;
  std::vector<StateSpace> derivatives;
  std::vector<StateSpace>* const wanted = with_derivatives ? &derivatives : nullptr;
  model(0, now, wanted);
  Recursion recursion(now, initial, y, u, derivatives);
  recursion.set_model_change([&](Index t) { model(t, now, wanted); }, derivatives);
  RecursionOptions options;
  return recursion.run(options);
}

Likelihood log_likelihood(const StateSpace& model, InitialState initial,
                          const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                          const std::vector<StateSpace>& derivatives) {
  RecursionOptions options;
  return Recursion(model, initial, y, u, derivatives).run(options);
}

Likelihood watch_filtered_states(const StateSpace& model, InitialState initial,
                                 const Eigen::Ref<const MatrixXd>& y,
                                 const Eigen::Ref<const MatrixXd>& u,
                                 const std::vector<StateSpace>& derivatives,
                                 const FilteredStateWatcher& see) {
  RecursionOptions options;
  options.watcher = &see;
  return Recursion(model, initial, y, u, derivatives).run(options);
}

MatrixXd score_products(const StateSpace& model, InitialState initial,
                        const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                        const std::vector<StateSpace>& derivatives) {
  MatrixXd out;
  RecursionOptions options;
  options.score_products = &out;
  const Likelihood l = Recursion(model, initial, y, u, derivatives).run(options);
  return l.status == FilterStatus::ok ? out : MatrixXd();
}

}  // namespace identikal
