#include "lib/filter/likelihood.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "lib/base/constants.h"
#include "lib/filter/internal/common_factor.h"
#include "lib/filter/internal/digest_segment.h"
#include "lib/filter/internal/direct_kernel.h"
#include "lib/filter/internal/independent_parts.h"
#include "lib/filter/internal/nominal_innovations.h"
#include "lib/filter/internal/recursion.h"
#include "lib/filter/internal/segment.h"
#include "lib/filter/internal/steady_filter.h"
#include "lib/filter/internal/tangent_filter.h"
#include "lib/internal/lane_count.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Shorter segments are left to the recursion.
constexpr Index kShortest = 32;
// Beyond, computing the sums costs as much as ten evaluations with constant gain.
constexpr Index kMostLags = 4096;
// Of more states than these, shorter segments than so many samples per state are filtered directly.
constexpr Index kFewStates = 6, kPerState = 40;

struct Recording {
  const MatrixXd* y;  // nullptr of a digest
  const MatrixXd* u;
  std::vector<Segment> segments;
  Presence presence;
  Index samples = 0;
  Index outputs = 0, inputs = 0, rows = 0;

  bool is_digest() const { return y == nullptr; }
  bool gapless() const { return segments.size() == 1 && segments[0].sums.samples() == rows; }
};

Recording prepare(const MatrixXd& y, const MatrixXd& u) {
  Recording out{&y, &u, {}, find_presence(y), 0, y.rows(), u.rows(), y.cols()};
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

/// Whether a given start says so little beside the noise that its first updates cancel digits, of
/// which the full recursion keeps more.
bool is_vague(const StateSpace& model, InitialState initial) {
  if (initial != InitialState::given) return false;
  constexpr double kVague = 1e6;
  const MatrixXd process = model.G * model.Q * model.G.transpose();
  const double noise = std::max(process.diagonal().maxCoeff(), model.R.diagonal().maxCoeff());
  return model.P0.diagonal().maxCoeff() > kVague * noise;
}

}  // namespace

struct LikelihoodEngine::Recordings {
  // An independent part of the model, with its outputs of every recording.
  struct Part {
    IndependentPart of;
    std::vector<MatrixXd> y;
    LikelihoodEngine engine;
    StateSpace model;
    std::vector<StateSpace> derivatives;
    std::vector<Index> parameters;  // that the derivatives are by
  };
  IndependentParts linked;
  std::vector<std::unique_ptr<Part>> parts;

  bool falls_apart(const StateSpace& model, InitialState initial,
                   const std::vector<StateSpace>& derivatives);
  std::unique_ptr<Part> make_part(const IndependentPart& of) const;
  FilterStatus add_part(Part& part, const StateSpace& whole, InitialState initial,
                        const std::vector<StateSpace>& derivatives, EvaluationMethod method);
  void add_parts(const StateSpace& model, InitialState initial,
                 const std::vector<StateSpace>& derivatives, EvaluationMethod method);
  void add_all(const StateSpace& model, InitialState initial,
               const std::vector<StateSpace>& derivatives, EvaluationMethod method);

  std::vector<Recording> all;
  std::unique_ptr<SegmentKernel> kernel;
  Index kernel_states = -1;
  TangentFilter tangents;
  // Where one parameter's derivatives follow from the others': theirs.
  std::optional<CommonFactor> factor;
  std::vector<StateSpace> others;
  Likelihood of_others;
  Likelihood result;
  EvaluationTaken taken;

  FallbackReason prepare_kernel(const StateSpace& model, InitialState initial,
                                const std::vector<StateSpace>& derivatives, bool asked);
  void prepare_sums(Recording& recording, const StateSpace& model);
  void make_nominal(const Recording& recording, Segment& segment, const StateSpace& model);
  bool add_gapless(Recording& recording, const StateSpace& model, InitialState initial);
  void prepare_tangents(const StateSpace& model, InitialState initial,
                        const std::vector<StateSpace>& derivatives, bool by_kernel);
  FilterStatus add_by_tangents(const Recording& recording, InitialState initial, bool by_kernel);
  FilterStatus add_by_recursion(Recording& recording, const StateSpace& model, InitialState initial,
                                const std::vector<StateSpace>& derivatives, bool by_kernel,
                                bool constant_gain);
  FallbackReason fallback_of(bool late, bool rejected) const;
  bool digest_serves(const Segment& segment, const StateSpace& model) const;

  Index jumped = 0;  // samples of the last recording that the kernel served
  bool noise_alone = false, drifting = false;  // of the model and derivatives at hand
  MatrixXd drifts_of;                          // the A that outputs_drift is known for
  bool outputs_drift = false;
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
      return "gapless segments are shorter than the filter's memory, or too short to save anything";
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
  if (!all.empty() && (all[0].outputs != y.rows() || all[0].inputs != u.rows())) {
    throw std::invalid_argument("likelihood: recordings differ in their channels");
  }
  recordings_->all.push_back(prepare(y, u));
  recordings_->linked = {};
}

void LikelihoodEngine::add_digest(const RecordingDigest& digest) {
  const std::vector<Recording>& all = recordings_->all;
  if (!all.empty() && (all[0].outputs != digest.outputs || all[0].inputs != digest.inputs)) {
    throw std::invalid_argument("likelihood: recordings differ in their channels");
  }
  Recording out{
      nullptr,       nullptr,       {}, {}, digest.samples * digest.outputs, digest.outputs,
      digest.inputs, digest.samples};
  out.segments.push_back(segment_of(digest));
  recordings_->all.push_back(std::move(out));
  recordings_->linked = {};
}

MatrixXd LikelihoodEngine::score_products(const StateSpace& model, InitialState initial,
                                          const std::vector<StateSpace>& derivatives) const {
  const auto k = static_cast<Index>(derivatives.size());
  MatrixXd sum = MatrixXd::Zero(k, k);
  for (const Recording& recording : recordings_->all) {
    if (recording.is_digest()) return {};
    const MatrixXd one =
        identikal::score_products(model, initial, *recording.y, *recording.u, derivatives);
    if (one.size() == 0) return {};
    sum += one;
  }
  return sum;
}

const EvaluationTaken& LikelihoodEngine::evaluation_taken() const { return recordings_->taken; }

// The kernel for this model, or why gapless segments cannot go through one.
// @param asked  for sums, whatever they save
FallbackReason LikelihoodEngine::Recordings::prepare_kernel(
    const StateSpace& model, InitialState initial, const std::vector<StateSpace>& derivatives,
    bool asked) {
  if (model.outputs() + model.inputs() >= kMaxChannels) return FallbackReason::too_many_channels;
  // Of a partly diffuse start it goes on behind a gap only.
  const auto gapless = [](const Recording& recording) { return recording.gapless(); };
  if (initial == InitialState::partly_diffuse && std::all_of(all.begin(), all.end(), gapless)) {
    return FallbackReason::known_start;
  }
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
  Index longest = 0;
  bool made = false;
  for (const Recording& recording : all) {
    for (const Segment& segment : recording.segments) {
      longest = std::max(longest, segment.samples());
      made = made || segment.nominal.has_value();
    }
  }
  if (longest == 0) return FallbackReason::short_segment;
  // To filter so few samples takes no longer than to find the gain of many states.
  if (!asked && model.states() > kFewStates && longest < kPerState * model.states()) {
    return FallbackReason::short_segment;
  }
  noise_alone = std::none_of(derivatives.begin(), derivatives.end(), changes_dynamics);
  // A stationary start is followed at little cost sample by sample (tangent_stationary.h), and what
  // the kernel does for each lag is dearer where dynamics are unknown.
  constexpr Index kPerLag = 8;
  if (!asked && !noise_alone && initial == InitialState::stationary) longest /= kPerLag;
  if (!kernel->prepare(model, derivatives, longest)) {
    return kernel->slow() ? FallbackReason::short_segment : FallbackReason::no_steady_state;
  }
  if (kernel->memory() > longest) return FallbackReason::short_segment;
  if (noise_alone && (drifts_of.size() == 0 || drifts_of != model.A)) {
    drifts_of = model.A;
    outputs_drift = drifts(model);
  }
  drifting = noise_alone && (made || outputs_drift);
  taken.pole = kernel->pole();
  return kernel->memory() > kMostLags ? FallbackReason::long_memory : FallbackReason::none;
}

// The sums that the kernel needs, in the segments that are longer than its memory. Innovations of a
// nominal filter take the place of outputs that drift, as long as nothing but noise is unknown.
void LikelihoodEngine::Recordings::prepare_sums(Recording& recording, const StateSpace& model) {
  for (Segment& segment : recording.segments) {
    if (segment.samples() <= kernel->memory()) continue;
    if (recording.is_digest()) continue;  // there is what there is
    if (segment.nominal && !serves(*segment.nominal, model)) segment.nominal.reset();
    if (drifting && !segment.nominal) make_nominal(recording, segment, model);
    extend_sums(noise_alone && segment.nominal ? segment.nominal->sums : segment.sums,
                kernel->memory());
  }
}

void LikelihoodEngine::Recordings::make_nominal(const Recording& recording, Segment& segment,
                                                const StateSpace& model) {
  segment.nominal = nominal_innovations(model, kernel->gain(), kernel->memory(), *recording.y,
                                        *recording.u, segment.begin, segment.samples());
  extend_sums(segment.nominal->sums, kernel->memory());
}

// All of a recording without gaps by the kernel; false where that will not do.
bool LikelihoodEngine::Recordings::add_gapless(Recording& recording, const StateSpace& model,
                                               InitialState initial) {
  if (!recording.gapless() || initial == InitialState::partly_diffuse) return false;
  Segment& segment = recording.segments[0];
  if (segment.samples() <= kernel->memory()) return false;
  if (recording.is_digest() && !digest_serves(segment, model)) return false;
  bool added = kernel->add_from_model(segment, initial, result);
  if (!added && noise_alone && !segment.nominal && !recording.is_digest() &&
      kernel->reject_reason() == RejectReason::cancellation) {
    make_nominal(recording, segment, model);
    added = kernel->add_from_model(segment, initial, result);
  }
  if (!added) return false;
  const Index diffuse = initial == InitialState::diffuse ? model.states() : 0;
  result.value -= 0.5 * kLogTwoPi * static_cast<double>(recording.samples - diffuse);
  return true;
}

// Has a digest what the filter at hand asks for: sums of as many lags as it remembers, and nominal
// innovations of this model where it needs some?
bool LikelihoodEngine::Recordings::digest_serves(const Segment& segment,
                                                 const StateSpace& model) const {
  if (segment.nominal) {
    return noise_alone && serves(*segment.nominal, model) &&
           segment.nominal->sums.lags() >= kernel->memory();
  }
  return !drifting && segment.sums.lags() >= kernel->memory();
}

// Why the kernel did not serve all of a recording.
FallbackReason LikelihoodEngine::Recordings::fallback_of(bool late, bool rejected) const {
  if (late || (rejected && kernel->reject_reason() == RejectReason::known_start)) {
    return FallbackReason::known_start;
  }
  return rejected ? FallbackReason::cancellation : FallbackReason::short_segment;
}

// One parameter is left out where that spares the filter a block of lanes, or half of one.
void LikelihoodEngine::Recordings::prepare_tangents(const StateSpace& model, InitialState initial,
                                                    const std::vector<StateSpace>& derivatives,
                                                    bool by_kernel) {
  const auto lanes = [](std::size_t k) {
    const auto in_block = static_cast<std::size_t>(simd::lane_count(static_cast<int>(k)));
    return in_block * (k / in_block + 1);
  };
  const std::size_t k = derivatives.size();
  factor.reset();
  if (k > 1 && lanes(k - 1) < lanes(k) && initial == InitialState::diffuse && !by_kernel) {
    factor = common_factor(model, derivatives);
  }
  if (!factor) {
    tangents.prepare(model, derivatives);
    return;
  }
  others.resize(k - 1);
  for (std::size_t i = 0, to = 0; i < k; ++i) {
    if (i != factor->left_out) others[to++] = derivatives[i];
  }
  tangents.prepare(model, others);
}

// Value, gradient and information sample by sample, whatever is missing.
FilterStatus LikelihoodEngine::Recordings::add_by_tangents(const Recording& recording,
                                                           InitialState initial, bool by_kernel) {
  if (factor) {
    of_others.value = 0.0;
    const auto k = static_cast<Index>(others.size());
    of_others.gradient.setZero(k);
    of_others.information.setZero(k, k);
  }
  const FilterStatus status = tangents.run({*recording.y, *recording.u, recording.presence,
                                            recording.segments, by_kernel ? kernel.get() : nullptr},
                                           initial, factor ? of_others : result);
  if (factor && status == FilterStatus::ok) {
    add_completed(of_others, tangents.factor_sums(), *factor, result);
  }
  jumped = tangents.served_by_kernel();
  if (by_kernel && jumped < recording.rows) {
    taken.fallback = fallback_of(tangents.diffuse_start_came_late(), tangents.kernel_rejected());
  }
  return status;
}

FilterStatus LikelihoodEngine::Recordings::add_by_recursion(
    Recording& recording, const StateSpace& model, InitialState initial,
    const std::vector<StateSpace>& derivatives, bool by_kernel, bool constant_gain) {
  RecursionOptions options;
  options.constant_gain = constant_gain;
  options.segments = &recording.segments;
  if (by_kernel) options.kernel = kernel.get();
  const Likelihood one =
      Recursion(model, initial, *recording.y, *recording.u, derivatives).run(options);
  if (one.status != FilterStatus::ok) return one.status;
  result.value += one.value;
  result.gradient += one.gradient;
  result.information += one.information;
  jumped = options.jumped;
  if (by_kernel && jumped < recording.rows) {
    taken.fallback = fallback_of(options.late, options.cancelled);
  }
  return FilterStatus::ok;
}

// Does every part hold outputs of its own? Of a digest they are not to be had apart.
bool LikelihoodEngine::Recordings::falls_apart(const StateSpace& model, InitialState initial,
                                               const std::vector<StateSpace>& derivatives) {
  if (model.outputs() == 1 || initial == InitialState::partly_diffuse) return false;
  if (linked.link(model, initial, derivatives)) {
    parts.clear();
    const auto is_digest = [](const Recording& recording) { return recording.is_digest(); };
    if (linked.is_whole() || std::any_of(all.begin(), all.end(), is_digest)) return false;
    for (const IndependentPart& of : linked.parts()) parts.push_back(make_part(of));
  }
  return !parts.empty();
}

std::unique_ptr<LikelihoodEngine::Recordings::Part> LikelihoodEngine::Recordings::make_part(
    const IndependentPart& of) const {
  auto out = std::make_unique<Part>();
  out->of = of;
  for (const Recording& recording : all) {
    MatrixXd& y = out->y.emplace_back(static_cast<Index>(of.outputs.size()), recording.rows);
    for (Index i = 0; i < y.rows(); ++i) {
      y.row(i) = recording.y->row(of.outputs[static_cast<std::size_t>(i)]);
    }
  }
  for (std::size_t i = 0; i < all.size(); ++i) out->engine.add_recording(out->y[i], *all[i].u);
  return out;
}

FilterStatus LikelihoodEngine::Recordings::add_part(Part& part, const StateSpace& whole,
                                                    InitialState initial,
                                                    const std::vector<StateSpace>& derivatives,
                                                    EvaluationMethod method) {
  take_part(part.of, whole, part.model);
  part.parameters.clear();
  for (std::size_t i = 0; i < derivatives.size(); ++i) {
    if (!is_zero_in(part.of, derivatives[i])) part.parameters.push_back(static_cast<Index>(i));
  }
  const std::size_t k = part.parameters.size();
  part.derivatives.resize(k);
  for (std::size_t i = 0; i < k; ++i) {
    take_part(part.of, derivatives[static_cast<std::size_t>(part.parameters[i])],
              part.derivatives[i]);
  }
  const Likelihood& one = part.engine.evaluate(part.model, initial, part.derivatives, method);
  if (one.status != FilterStatus::ok) return one.status;
  result.value += one.value;
  for (std::size_t i = 0; i < k; ++i) {
    const auto row = static_cast<Index>(i);
    result.gradient[part.parameters[i]] += one.gradient[row];
    for (std::size_t j = 0; j < k; ++j) {
      result.information(part.parameters[i], part.parameters[j]) +=
          one.information(row, static_cast<Index>(j));
    }
  }
  return FilterStatus::ok;
}

// The path is said of the part that takes the longest one.
void LikelihoodEngine::Recordings::add_parts(const StateSpace& model, InitialState initial,
                                             const std::vector<StateSpace>& derivatives,
                                             EvaluationMethod method) {
  taken.method = EvaluationMethod::autocovariances;
  for (const std::unique_ptr<Part>& part : parts) {
    result.status = add_part(*part, model, initial, derivatives, method);
    if (result.status != FilterStatus::ok) return;
    const EvaluationTaken& one = part->engine.evaluation_taken();
    if (taken.fallback == FallbackReason::none) taken.fallback = one.fallback;
    if (one.method != EvaluationMethod::autocovariances) taken.method = one.method;
    taken.pole = std::max(taken.pole, one.pole);
  }
}

void LikelihoodEngine::Recordings::add_all(const StateSpace& model, InitialState initial,
                                           const std::vector<StateSpace>& derivatives,
                                           EvaluationMethod method) {
  const auto k = static_cast<Index>(derivatives.size());
  const bool kernel_may =
      method == EvaluationMethod::automatic || method == EvaluationMethod::autocovariances;
  const FallbackReason why = kernel_may ? prepare_kernel(model, initial, derivatives,
                                                         method != EvaluationMethod::automatic)
                                        : FallbackReason::not_requested;
  const bool by_kernel = why == FallbackReason::none;
  Index total = 0, compressed = 0;
  bool prepared = false;
  for (Recording& recording : all) {
    total += recording.rows;
    if (by_kernel) {
      prepare_sums(recording, model);
      if (add_gapless(recording, model, initial)) {
        compressed += recording.rows;
        continue;
      }
    }
    if (recording.is_digest()) {
      taken.fallback = by_kernel ? FallbackReason::short_segment : why;
      result.status = FilterStatus::beyond_digest;
      return;
    }
    // Code made for gapless samples and few states needs no derivatives and goes faster without, but
    // for a stationary start; the full recursion stays the witness of the others.
    const bool plain = method == EvaluationMethod::time_varying ||
                       (k == 0 && recording.gapless() && model.states() <= kMostDirectStates &&
                        !TangentFilter::is_quick_from_stationary(model, initial)) ||
                       is_vague(model, initial);
    if (!plain && !prepared) {
      prepare_tangents(model, initial, derivatives, by_kernel);
      prepared = true;
    }
    const FilterStatus status =
        plain ? add_by_recursion(recording, model, initial, derivatives, by_kernel,
                                 method != EvaluationMethod::time_varying)
              : add_by_tangents(recording, initial, by_kernel);
    if (status != FilterStatus::ok) {
      result.status = status;
      return;
    }
    compressed += jumped;
  }
  if (!by_kernel) taken.fallback = why;
  if (2 * compressed > total) {
    taken.method = EvaluationMethod::autocovariances;
  } else {
    taken.method = method == EvaluationMethod::time_varying ? EvaluationMethod::time_varying
                                                            : EvaluationMethod::steady_state;
  }
}

const Likelihood& LikelihoodEngine::evaluate(const StateSpace& model, InitialState initial,
                                             const std::vector<StateSpace>& derivatives,
                                             EvaluationMethod method) {
  Recordings& r = *recordings_;
  if (r.all.empty()) throw std::invalid_argument("likelihood: there is no recording");
  check_shapes(model, initial, derivatives);
  if (r.all[0].outputs != model.outputs() || r.all[0].inputs != model.inputs()) {
    throw std::invalid_argument("likelihood: recording and model differ in their channels");
  }
  const auto k = static_cast<Index>(derivatives.size());
  Likelihood& out = r.result;
  out.status = FilterStatus::ok;
  out.value = 0.0;
  out.gradient.setZero(k);
  out.information.setZero(k, k);
  r.taken = EvaluationTaken{};
  // The full recursion stays the witness of the others.
  if (method != EvaluationMethod::time_varying && r.falls_apart(model, initial, derivatives)) {
    r.add_parts(model, initial, derivatives, method);
  } else {
    r.add_all(model, initial, derivatives, method);
  }
  if (out.status == FilterStatus::ok &&
      !(std::isfinite(out.value) && out.gradient.allFinite() && out.information.allFinite())) {
    out.status = FilterStatus::not_finite;
  }
  return out;
}

}  // namespace identikal
