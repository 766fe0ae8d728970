#include "lib/filter/likelihood.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "lib/base/constants.h"
#include "lib/filter/internal/recursion.h"
#include "lib/filter/internal/segment.h"
#include "lib/filter/internal/steady_filter.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Shorter segments are left to the recursion.
constexpr Index kShortest = 32;
// Beyond, computing the sums costs as much as ten evaluations with constant gain.
constexpr Index kMostLags = 1024;
// The sums are computed for this many lags, then for twice as many, ...
constexpr Index kFirstLags = 64;
// A mean this many standard deviations from zero is taken out before products are summed.
constexpr double kFarFromZero = 2.0;

Segment make_segment(const MatrixXd& y, const MatrixXd& u, Index begin, Index length) {
  const Index ny = y.rows(), nu = u.rows();
  MatrixXd z(ny + nu, length);
  z.topRows(ny) = y.middleCols(begin, length);
  if (nu > 0) z.bottomRows(nu) = u.middleCols(begin, length);
  const VectorXd mean = z.rowwise().mean();
  bool far = false;
  for (Index i = 0; i < z.rows(); ++i) {
    const double variance = (z.row(i).array() - mean[i]).square().mean();
    far = far || mean[i] * mean[i] > kFarFromZero * kFarFromZero * variance;
  }
  if (!far) return {begin, VectorXd(), SegmentAutocovariances(z), {}};
  z.colwise() -= mean;
  z.conservativeResize(z.rows() + 1, Eigen::NoChange);
  z.bottomRows(1).setOnes();
  return {begin, mean, SegmentAutocovariances(z), {}};
}

struct Recording {
  const MatrixXd* y;
  const MatrixXd* u;
  std::vector<Segment> segments;
  Index samples = 0;

  bool gapless() const { return segments.size() == 1 && segments[0].sums.samples() == y->cols(); }
};

Recording prepare(const MatrixXd& y, const MatrixXd& u) {
  Recording out{&y, &u, {}, 0};
  Index begin = 0;
  for (Index t = 0; t <= y.cols(); ++t) {
    bool complete = false;
    if (t < y.cols()) {
      const Index missing = static_cast<Index>(y.col(t).array().isNaN().count());
      out.samples += y.rows() - missing;
      complete = missing == 0 && (u.rows() == 0 || u.col(t).allFinite());
    }
    if (complete) continue;
    if (t - begin >= kShortest && y.rows() + u.rows() < kMaxChannels) {
      out.segments.push_back(make_segment(y, u, begin, t - begin));
    }
    begin = t + 1;
  }
  return out;
}

// Sample autocovariances for a filter that forgets after `memory` samples, in the segments that are
// longer.
void extend_sums(Recording& recording, Index memory) {
  Index lags = kFirstLags;
  while (lags < memory) lags *= 2;
  for (Segment& segment : recording.segments) {
    if (segment.sums.samples() > memory) segment.sums.extend_to(lags);
  }
}

}  // namespace

struct LikelihoodEngine::Recordings {
  std::vector<Recording> all;
  std::unique_ptr<SegmentKernel> kernel;
  Index kernel_states = -1;
  Likelihood result;
  EvaluationTaken taken;

  FallbackReason prepare_kernel(const StateSpace& model, InitialState initial,
                                const std::vector<StateSpace>& derivatives);
  bool add_gapless(const Recording& recording, const StateSpace& model, InitialState initial);
  FallbackReason fallback_of(const RecursionOptions& options) const;
};

const char* to_string(EvaluationMethod method) {
  switch (method) {
    case EvaluationMethod::automatic:
      return "automatic";
    case EvaluationMethod::time_varying:
      return "time-varying";
    case EvaluationMethod::steady_state:
      return "steady-state";
    case EvaluationMethod::autocovariances:
      return "autocovariances";
  }
  return "";
}

const char* describe(FallbackReason fallback) {
  switch (fallback) {
    case FallbackReason::none:
      return "";
    case FallbackReason::not_requested:
      return "another evaluation method was requested";
    case FallbackReason::short_segment:
      return "gapless segments are shorter than the filter's memory";
    case FallbackReason::long_memory:
      return "the filter forgets so slowly that sample autocovariances would cost more than "
             "they save";
    case FallbackReason::no_steady_state:
      return "the gain does not converge to a stable filter";
    case FallbackReason::cancellation:
      return "the innovations are so much smaller than the signal that sample autocovariances "
             "lose digits";
    case FallbackReason::too_many_channels:
      return "more than 15 outputs and inputs";
    case FallbackReason::unknown_start:
      return "the start of the state is estimated";
    case FallbackReason::known_start:
      return "the start of the state is known too well, or not at the first sample";
  }
  return "";
}

LikelihoodEngine::LikelihoodEngine() : recordings_(std::make_unique<Recordings>()) {}
LikelihoodEngine::~LikelihoodEngine() = default;
LikelihoodEngine::LikelihoodEngine(LikelihoodEngine&&) noexcept = default;
LikelihoodEngine& LikelihoodEngine::operator=(LikelihoodEngine&&) noexcept = default;

void LikelihoodEngine::add_recording(const MatrixXd& y, const MatrixXd& u) {
  const std::vector<Recording>& all = recordings_->all;
  if (u.rows() > 0 && u.cols() != y.cols()) {
    throw std::invalid_argument("likelihood: y and u differ in length");
  }
  if (!all.empty() && (all[0].y->rows() != y.rows() || all[0].u->rows() != u.rows())) {
    throw std::invalid_argument("likelihood: recordings differ in their channels");
  }
  recordings_->all.push_back(prepare(y, u));
}

MatrixXd LikelihoodEngine::score_products(const StateSpace& model, InitialState initial,
                                          const std::vector<StateSpace>& derivatives) const {
  const auto k = static_cast<Index>(derivatives.size());
  MatrixXd sum = MatrixXd::Zero(k, k);
  for (const Recording& recording : recordings_->all) {
    const MatrixXd one =
        identikal::score_products(model, initial, *recording.y, *recording.u, derivatives);
    if (one.size() == 0) return {};
    sum += one;
  }
  return sum;
}

const EvaluationTaken& LikelihoodEngine::evaluation_taken() const { return recordings_->taken; }

// The kernel for this model, or why gapless segments cannot go through one.
FallbackReason LikelihoodEngine::Recordings::prepare_kernel(
    const StateSpace& model, InitialState initial, const std::vector<StateSpace>& derivatives) {
  if (model.outputs() + model.inputs() >= kMaxChannels) return FallbackReason::too_many_channels;
  const auto moves_start = [](const StateSpace& d) {
    return !d.x0.isZero(0.0) || !d.P0.isZero(0.0);
  };
  if (initial == InitialState::given &&
      std::any_of(derivatives.begin(), derivatives.end(), moves_start)) {
    return FallbackReason::unknown_start;
  }
  if (kernel_states != model.states()) {
    kernel = make_segment_kernel(model.states());
    kernel_states = model.states();
  }
  if (!kernel->prepare(model, derivatives)) return FallbackReason::no_steady_state;
  taken.pole = kernel->pole();
  return kernel->memory() > kMostLags ? FallbackReason::long_memory : FallbackReason::none;
}

// All of a recording without gaps by the kernel; false where that will not do.
bool LikelihoodEngine::Recordings::add_gapless(const Recording& recording, const StateSpace& model,
                                               InitialState initial) {
  if (!recording.gapless() || recording.segments[0].sums.samples() <= kernel->memory() ||
      !kernel->add_from_model(recording.segments[0], initial, result)) {
    return false;
  }
  const Index diffuse = initial == InitialState::diffuse ? model.states() : 0;
  result.value -= 0.5 * kLogTwoPi * static_cast<double>(recording.samples - diffuse);
  return true;
}

// Why the kernel did not serve all of a recording.
FallbackReason LikelihoodEngine::Recordings::fallback_of(const RecursionOptions& options) const {
  if (options.late || (options.cancelled && kernel->reject_reason() == RejectReason::known_start)) {
    return FallbackReason::known_start;
  }
  return options.cancelled ? FallbackReason::cancellation : FallbackReason::short_segment;
}

const Likelihood& LikelihoodEngine::evaluate(const StateSpace& model, InitialState initial,
                                             const std::vector<StateSpace>& derivatives,
                                             EvaluationMethod method) {
  Recordings& r = *recordings_;
  if (r.all.empty()) throw std::invalid_argument("likelihood: there is no recording");
  check_shapes(model, initial, derivatives);
  if (r.all[0].y->rows() != model.outputs() || r.all[0].u->rows() != model.inputs()) {
    throw std::invalid_argument("likelihood: recording and model differ in their channels");
  }
  const auto k = static_cast<Index>(derivatives.size());
  Likelihood& out = r.result;
  out.status = FilterStatus::ok;
  out.value = 0.0;
  out.gradient.setZero(k);
  out.information.setZero(k, k);
  r.taken = EvaluationTaken{};

  const bool kernel_may =
      method == EvaluationMethod::automatic || method == EvaluationMethod::autocovariances;
  const FallbackReason why =
      kernel_may ? r.prepare_kernel(model, initial, derivatives) : FallbackReason::not_requested;
  const bool by_kernel = why == FallbackReason::none;
  Index total = 0, compressed = 0;
  for (Recording& recording : r.all) {
    total += recording.y->cols();
    if (by_kernel) {
      extend_sums(recording, r.kernel->memory());
      if (r.add_gapless(recording, model, initial)) {
        compressed += recording.y->cols();
        continue;
      }
    }
    RecursionOptions options;
    options.constant_gain = method != EvaluationMethod::time_varying;
    options.segments = &recording.segments;
    if (by_kernel) options.kernel = r.kernel.get();
    const Likelihood one =
        Recursion(model, initial, *recording.y, *recording.u, derivatives).run(options);
    if (one.status != FilterStatus::ok) {
      out.status = one.status;
      return out;
    }
    out.value += one.value;
    out.gradient += one.gradient;
    out.information += one.information;
    compressed += options.jumped;
    if (by_kernel && options.jumped < recording.y->cols()) {
      r.taken.fallback = r.fallback_of(options);
    }
  }
  if (!by_kernel) r.taken.fallback = why;
  if (2 * compressed > total) {
    r.taken.method = EvaluationMethod::autocovariances;
  } else {
    r.taken.method = method == EvaluationMethod::time_varying ? EvaluationMethod::time_varying
                                                              : EvaluationMethod::steady_state;
  }
  if (!(std::isfinite(out.value) && out.gradient.allFinite() && out.information.allFinite())) {
    out.status = FilterStatus::not_finite;
  }
  return out;
}

}  // namespace identikal
