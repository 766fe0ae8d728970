// How does the Kalman filter move from sample to sample? One step after the other, and by the
// shorter ways that gapless segments and a settled gain allow. Internal to the filter.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "lib/filter/filter_result.h"
#include "lib/filter/internal/diffuse_start.h"
#include "lib/filter/internal/segment.h"
#include "lib/filter/internal/sensitivity.h"
#include "lib/filter/internal/steady_run.h"
#include "lib/model/linear_model.h"
#include "lib/model/state_space.h"

namespace identikal {

struct RecursionOptions {
  bool constant_gain = true;        ///< once settled
  SegmentKernel* kernel = nullptr;  ///< prepared for this model and its derivatives; or none
  std::vector<Segment>* segments = nullptr;  ///< of this recording, in time order
  Eigen::Index jumped = 0;                   ///< out: samples that the kernel served
  bool cancelled = false;                    ///< out: a segment was rejected by the kernel
  bool late = false;                         ///< out: a diffuse start came after its first sample
};

/// check_shapes() of the model and its derivatives, x0 and P0 included where the start is given.
void check_shapes(const StateSpace& model, InitialState initial,
                  const std::vector<StateSpace>& derivatives);

/// @throws std::invalid_argument for outputs and inputs that are not the model's, or of other lengths
void check_sizes(const StateSpace& model, const Eigen::Ref<const Eigen::MatrixXd>& y,
                 const Eigen::Ref<const Eigen::MatrixXd>& u);

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

/// The filter of one recording, at some sample. Keeps references to what it is made of.
class Recursion {
 public:
  /// Arguments and exceptions of log_likelihood() in lib/filter/kalman.h.
  Recursion(const StateSpace& model, InitialState initial,
            const Eigen::Ref<const Eigen::MatrixXd>& y, const Eigen::Ref<const Eigen::MatrixXd>& u,
            const std::vector<StateSpace>& derivatives);

  /// Calls `next` before every sample but the first: it changes the model and the derivatives that
  /// the recursion was made with.
  void set_model_change(std::function<void(Eigen::Index)> next,
                        const std::vector<StateSpace>& derivatives);

  /// The whole recording, gapless segments that are longer than the filter's memory by the kernel.
  /// @param store  null, or what receives innovations, and states where P_pred has room for them
  Likelihood run(RecursionOptions& options, FilterResult* store = nullptr);

  /// Samples from .. to - 1, each shown before the recursion moves on. delta stays apart until
  /// nothing of it is left in the state, or the recording ends. finish() comes after the last one.
  void watch(Eigen::Index from, Eigen::Index to, Likelihood& out, const FilterWatcher& see);
  void finish(Likelihood& out);

  FilterStatus status() const { return status_; }

 private:
  // Where run() stands among the segments.
  struct Place {
    std::size_t next = 0;        // segment to come
    Segment* segment = nullptr;  // begun last
    bool direct_tried = false;   // in it
  };

  void take_model(const std::vector<StateSpace>& derivatives);
  void start_given(const std::vector<StateSpace>& derivatives);
  bool start_stationary();
  void start_diffuse(InitialState initial, const std::vector<StateSpace>& derivatives);

  void find_present(Eigen::Index t);
  void innovate(Eigen::Index t, bool keep_gain);
  void find_gain();
  void innovate_derivatives(Eigen::Index t);
  void add_terms(Likelihood& out);
  void advance(Eigen::Index t, bool keep_gain);
  void advance_derivatives(Eigen::Index t);
  void advance_unmeasured(Eigen::Index t);
  bool has_settled(const Eigen::MatrixXd& before, const Eigen::MatrixXd& after,
                   double tolerance) const;
  bool fold_in(Likelihood& out);

  void step(Eigen::Index t, Likelihood& out, FilterResult* store);
  Eigen::Index skip_segment(Eigen::Index t, Place& place, bool storing, RecursionOptions& options,
                            Likelihood& out);
  bool run_by_kernel(const Segment& segment, RecursionOptions& options, Likelihood& out);
  Eigen::Index run_by_direct_code(Eigen::Index t, const Segment& segment, bool stop_when_settled,
                                  Likelihood& out);
  Eigen::Index run_with_constant_gain(Eigen::Index t, Segment* segment, Likelihood& out,
                                      FilterResult* store);

  Eigen::VectorXd innovation_sd() const;
  Eigen::MatrixXd filter_gain() const;
  Eigen::MatrixXd filtered_covariance(const Eigen::MatrixXd& Kf) const;
  void store_innovation(FilterResult& store, Eigen::Index t) const;
  void store_states(FilterResult& store, Eigen::Index t) const;
  void show(Eigen::Index t, bool same_gain, const FilterWatcher& see);

  const StateSpace& model_;
  std::function<void(Eigen::Index)> change_model_;  // empty: it stays as it is
  const Eigen::Ref<const Eigen::MatrixXd>&y_, &u_;
  Measurement full_, now_;  // all channels; those present
  Eigen::MatrixXd W_;       // G Q G'
  std::vector<Sensitivity> sensitivities_;
  FilterStatus status_ = FilterStatus::ok;

  Eigen::MatrixXd P_, Z_;                // covariance; [x, X]: the state and its responses to delta
  std::optional<DiffuseStart> diffuse_;  // while delta stays apart
  Eigen::Index folded_ = 0, samples_ = 0;  // states of a diffuse start folded in; numbers measured
  bool settled_ = false;                   // gain and its derivatives are constant from here on

  // Of the sample at hand.
  std::vector<Eigen::Index> present_, selected_{-1};  // channels; those that now_ is made for
  Eigen::MatrixXd E_, PC_, Sigma_, M_, K_, F_, SiE_;  // E = [e, responses], M = A P C' + G S
  Eigen::LLT<Eigen::MatrixXd> llt_;
  Eigen::MatrixXd Kf_;
  FilterStep step_;
};

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

}  // namespace identikal
