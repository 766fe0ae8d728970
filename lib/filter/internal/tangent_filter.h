// How does the likelihood move with every parameter, sample by sample, whatever is missing? The
// value, its exact gradient and the information in one pass without allocation, for recordings that
// a steady filter does not fit: short ones, slow poles, gaps, outputs at different rates. Internal
// to the filter.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "lib/filter/filter_result.h"
#include "lib/filter/internal/common_factor.h"
#include "lib/filter/internal/diffuse_start.h"
#include "lib/filter/internal/moved_entries.h"
#include "lib/filter/internal/presence.h"
#include "lib/filter/internal/segment.h"
#include "lib/filter/internal/tangent_filtered.h"
#include "lib/filter/internal/tangent_kernel.h"
#include "lib/internal/stationary_start.h"
#include "lib/model/state_space.h"

namespace identikal {

/// A recording as the filter runs over it; gapless segments may go through a kernel instead.
struct TangentRecording {
  const Eigen::MatrixXd& y;
  const Eigen::MatrixXd& u;
  const Presence& presence;
  const std::vector<Segment>& segments;
  SegmentKernel* kernel = nullptr;  ///< prepared for the model and its derivatives; or none
  // What every sample leaves is wanted where these are not null; there is no kernel then.
  FilterResult* store = nullptr;                  ///< receives innovations
  Eigen::MatrixXd* score_products = nullptr;      ///< k x k: receives sum_t s_t s_t'
  const FilteredStateWatcher* watcher = nullptr;  ///< is shown every sample behind a diffuse start
};

class TangentFilter {
 public:
  /// Does a gapless recording go through a recursion of as few columns as there are outputs?
  static bool is_quick_from_stationary(const StateSpace& model, InitialState initial);

  /// Keeps references to both until run() has returned.
  void prepare(const StateSpace& model, const std::vector<StateSpace>& derivatives);

  /// Adds value, gradient and information of lib/filter/filter_result.h; they are undefined unless
  /// the status is ok.
  FilterStatus run(const TangentRecording& recording, InitialState initial, Likelihood& out);

  /// A model that is another one at every sample.
  struct Changing {
    const ModelAt& model;
    bool with_derivatives = false;
    bool motion_changes = true;  ///< A, B, G, Q or S, or their derivatives
  };
  /// run() of it. `recording` has no kernel and no store.
  FilterStatus run_changing(const Changing& changing, const TangentRecording& recording,
                            InitialState initial, Likelihood& out);

  // The same in steps, for who goes back and on again.
  FilterStatus begin(InitialState initial);
  /// Samples t .. end - 1, but not beyond the end of a diffuse start; advances t.
  FilterStatus go_to(const Eigen::MatrixXd& y, const Eigen::MatrixXd& u, FilterResult& store,
                     Eigen::Index& t, Eigen::Index end);
  bool is_diffuse() const { return diffuse_; }
  /// The state before the next sample, and then its covariance, in lanes; not while the start is
  /// diffuse.
  std::vector<double> predicted() const;
  void go_back_to(const std::vector<double>& state);

  // Of the last run.
  FactorSums factor_sums() const;  ///< of a diffuse start, without a kernel
  Eigen::Index served_by_kernel() const { return jumped_; }  ///< samples
  bool kernel_rejected() const { return rejected_; }         ///< a segment
  bool diffuse_start_came_late() const { return late_; }     ///< for a segment

 private:
  // How the covariance went through some samples of one pattern last time, with the gains. Where it
  // comes back to the same beginning, as it does between outputs at different rates, they serve
  // again.
  static constexpr Eigen::Index kLongestPassage = 16;  // samples
  // So many that did not come back, and the next are not asked: to keep them takes as long as to
  // filter.
  static constexpr int kPatience = 32, kRest = 256;
  struct Passage {
    bool known = false;
    std::vector<double> begin, end;  // P and its derivatives
    std::vector<double> gains;       // of one sample after the other
  };

  // A model with the channels of one pattern.
  struct Pattern {
    bool ready = false;
    simd::TangentModel model;
    std::vector<Passage> passages;  // by number of samples
    int in_vain = 0;                // passages since one came back, or was looked for
    std::vector<int> C_row, C_column;
    std::vector<double> C;
    MovedEntries C_theta;
    Lanes R, S, D;
  };

  void find_structure();
  void fill_A();
  void fill_common();
  void take_sample(bool motion_changes);
  void fill_pattern(Pattern& p, const std::vector<int>& channels) const;
  simd::TangentModel common_model() const;
  void reserve();
  bool start_stationary();
  bool start_register(StationaryStart& start);
  FilterStatus start_diffuse(InitialState initial);
  FilterStatus run_stretch(const Pattern& p, const TangentRecording& recording, Eigen::Index& t,
                           Eigen::Index end, Likelihood& out);
  simd::TangentEnd step(const Pattern& p, const TangentRecording& recording, Eigen::Index& t,
                        Eigen::Index end);
  bool run_stationary(const Pattern& p, const TangentRecording& recording, Eigen::Index& t,
                      bool& settled);
  FilterStatus run_diffuse(const Pattern& p, const TangentRecording& recording, Eigen::Index& t,
                           Eigen::Index end, Likelihood& out);
  FilterStatus go_on(const TangentRecording& recording, const Presence::Part& part, Eigen::Index& t,
                     Eigen::Index end, Likelihood& out);
  void take_channels(const Presence& presence);
  std::size_t pattern_of(const Eigen::VectorXd& y);
  std::vector<Presence::Part> parts_between(const Eigen::MatrixXd& y, Eigen::Index from,
                                            Eigen::Index end);
  FilterStatus run_passage(Pattern& p, const TangentRecording& recording, Eigen::Index& t,
                           Eigen::Index end, Likelihood& out);
  bool comes_back(const Passage& passage) const;
  std::size_t gain_size(const Pattern& p) const;
  template <typename Copy>
  void copy_gain(const Pattern& p, double* gain, Copy&& copy);
  void leave_sample(const Pattern& p, const TangentRecording& recording, Eigen::Index t,
                    const Likelihood& out);
  void add_score_product(const TangentRecording& recording, const Likelihood& out);
  void find_innovation_sd();
  void show_filtered(const Pattern& p, Eigen::Index t, bool settled,
                     const FilteredStateWatcher& see);
  bool fold_in(Likelihood& out);
  bool run_by_kernel(const Segment& segment, SegmentKernel& kernel, Likelihood& out);
  void add_sums(Likelihood& out) const;

  std::size_t place(Eigen::Index elements, Eigen::Index element, std::size_t l) const;
  void take_square(const double* of, Eigen::Index size, std::size_t l, Eigen::MatrixXd& out) const;
  void take_vector(const double* of, Eigen::Index size, std::size_t l, Eigen::VectorXd& out) const;
  void take_columns(const double* of, Eigen::Index columns, std::size_t l,
                    Eigen::MatrixXd& out) const;
  Eigen::MatrixXd matrix(const double* of, std::size_t l) const;  ///< n x n
  Eigen::VectorXd vector(const double* of, Eigen::Index size, std::size_t l) const;
  void set_matrix(double* of, std::size_t l, const Eigen::MatrixXd& value) const;
  void set_vector(double* of, std::size_t l, const Eigen::VectorXd& value) const;
  void fill(Lanes& to, std::size_t l, const Eigen::MatrixXd& value) const;

  const StateSpace* model_ = nullptr;
  const std::vector<StateSpace>* derivatives_ = nullptr;
  bool changing_ = false;  // from sample to sample
  Eigen::Index n_ = 0, ny_ = 0, nu_ = 0;
  std::size_t lanes_ = 0, blocks_ = 0;
  bool dynamics_ = false, crossed_ = false, diagonal_R_ = true;
  std::vector<int> A_row_, A_column_;
  std::vector<double> A_, A_entry_;
  Lanes W_, B_;
  MovedEntries A_theta_;
  std::vector<Eigen::MatrixXd> Sw_;         // G S of the model, then of every derivative
  std::vector<std::vector<int>> channels_;  // that the patterns are of
  std::vector<Pattern> patterns_;
  Lanes memory_;
  simd::TangentRun run_;
  Eigen::VectorXd scale_;  // of the diffuse states of the start
  DiffuseStart start_;
  // As a diffuse start ends; their memory serves again.
  Eigen::MatrixXd P_, Z_;
  std::vector<Sensitivity> sensitivities_;
  Eigen::VectorXd scored_;  // the gradient up to the last sample
  Eigen::VectorXd e_sd_;    // of every channel, measured or not, at the last sample
  FilteredTangents filtered_;
  bool diffuse_ = false, rejected_ = false, late_ = false;
  bool stationary_ = false;  // all that follows goes on from a stationary start, with all outputs
  Eigen::Index samples_ = 0, folded_ = 0, jumped_ = 0;
  // Where a diffuse start ended: values until then, and the squares that it explains.
  Eigen::Index until_folded_ = 0;
  double start_squares_ = 0.0;
};

}  // namespace identikal
