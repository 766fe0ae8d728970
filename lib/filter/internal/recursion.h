// The filter recursion with its shorter ways, and with a view of every sample.
// Internal to lib.
#pragma once

#include <functional>
#include <vector>

#include "lib/filter/filter_result.h"
#include "lib/filter/internal/segment.h"
#include "lib/model/linear_model.h"

namespace identikal {

struct RecursionOptions {
  bool constant_gain = true;        ///< once settled
  SegmentKernel* kernel = nullptr;  ///< prepared for this model and its derivatives; or none
  std::vector<Segment>* segments = nullptr;   ///< of this recording, in time order
  Eigen::Index jumped = 0;                    ///< out: samples that the kernel served
  Eigen::MatrixXd* score_products = nullptr;  ///< k x k, or none: receives sum_t s_t s_t'
  bool cancelled = false;                     ///< out: a segment was refused by the kernel
  bool late = false;                          ///< out: a diffuse start came after its first sample
};

/// check_shapes() of the model and its derivatives, x0 and P0 included where the start is given.
void check_shapes(const StateSpace& model, InitialState initial,
                  const std::vector<StateSpace>& derivatives);

/// log_likelihood() of lib/filter/kalman.h, handing gapless segments that are longer than the
/// filter's memory to the kernel.
Likelihood run_recursion(const StateSpace& model, InitialState initial,
                         const Eigen::Ref<const Eigen::MatrixXd>& y,
                         const Eigen::Ref<const Eigen::MatrixXd>& u,
                         const std::vector<StateSpace>& derivatives, RecursionOptions& options);

/// The same for a time-varying model.
Likelihood run_recursion(const ModelAt& model, InitialState initial,
                         const Eigen::Ref<const Eigen::MatrixXd>& y,
                         const Eigen::Ref<const Eigen::MatrixXd>& u, bool with_derivatives);

/// kalman_filter() of lib/filter/kalman.h.
FilterResult run_filter(const StateSpace& model, InitialState initial,
                        const Eigen::Ref<const Eigen::MatrixXd>& y,
                        const Eigen::Ref<const Eigen::MatrixXd>& u, Keep keep);
FilterResult run_filter(const ModelAt& model, InitialState initial,
                        const Eigen::Ref<const Eigen::MatrixXd>& y,
                        const Eigen::Ref<const Eigen::MatrixXd>& u, Keep keep);

/// One sample as the recursion sees it. Under a diffuse start, x(1) = proper part + delta, matrices
/// of states have 1 + n columns: the value at delta = 0 and the responses to delta; one column
/// otherwise, and as soon as nothing of delta is left in the state. Covariances are given delta.
struct FilterStep {
  Eigen::Index t = 0;
  bool same_gain = false;          ///< P_filt, M, F and information are those of the sample before
  Eigen::MatrixXd Z_filt, P_filt;  ///< state given y up to t
  Eigen::MatrixXd M;  ///< n x n: covariance of x(t) - x_filt(t) and x(t+1) - x_pred(t+1)
  Eigen::MatrixXd F;  ///< A - K C; A where nothing is measured
  Eigen::MatrixXd score, information;  ///< C' Sigma^-1 e, C' Sigma^-1 C; 0 where nothing is
  /// Of delta, from all samples up to t, as they were when the last of it left the state; empty
  /// unless the start is diffuse. Its estimate is -information^-1 score.
  Eigen::MatrixXd delta_information;
  Eigen::VectorXd delta_score, delta_scale;
};
using FilterWatcher = std::function<void(const FilterStep&)>;

/// Shows every sample, in time order, whether or not the filter runs to the end.
/// @return log_likelihood() of lib/filter/kalman.h, without gradient
Likelihood watch_filter(const StateSpace& model, InitialState initial,
                        const Eigen::Ref<const Eigen::MatrixXd>& y,
                        const Eigen::Ref<const Eigen::MatrixXd>& u, const FilterWatcher& see);
Likelihood watch_filter(const ModelAt& model, InitialState initial,
                        const Eigen::Ref<const Eigen::MatrixXd>& y,
                        const Eigen::Ref<const Eigen::MatrixXd>& u, const FilterWatcher& see);

/// Shows every sample in blocks of N^1/2, the last block first, the samples of a block in time
/// order; nothing unless the filter runs. It runs twice, so that one block at a time is all that
/// needs to be in memory.
/// @param block_ends  called after each block
Likelihood watch_backwards(const StateSpace& model, InitialState initial,
                           const Eigen::Ref<const Eigen::MatrixXd>& y,
                           const Eigen::Ref<const Eigen::MatrixXd>& u, const FilterWatcher& see,
                           const std::function<void()>& block_ends);

/// The least of what the information leaves of delta's scale, as a share: near 0, some direction of
/// delta is not determined; 1 where all are as well known as can be.
double determined_share(const Eigen::MatrixXd& information, const Eigen::VectorXd& scale);

}  // namespace identikal
