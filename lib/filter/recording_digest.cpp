#include "lib/filter/recording_digest.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <utility>

#include "lib/filter/internal/digest_segment.h"
#include "lib/filter/internal/nominal_innovations.h"
#include "lib/filter/internal/segment.h"
#include "lib/filter/internal/steady_filter.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Gains of trial values forget later than that of the model's own.
constexpr Index kSpare = 4;

// First and last samples, and the sums, as they are kept.
void take_sums(const SegmentAutocovariances& sums, Index lags, RecordingDigest& out) {
  const Index channels = sums.channels(), N = sums.samples();
  out.head.resize(channels, lags);
  out.tail.resize(channels, lags);
  for (Index c = 0; c < channels; ++c) {
    for (Index t = 0; t < lags; ++t) {
      out.head(c, t) = sums.sample(c, t);
      out.tail(c, t) = sums.sample(c, N - lags + t);
    }
  }
  out.sums.assign(sums.at(0).data(), sums.at(0).data() + lags * channels * channels);
}

void check_recording(const MatrixXd& y, const MatrixXd& u, const StateSpace& model) {
  if (y.rows() != model.outputs() || u.rows() != model.inputs() ||
      (u.rows() > 0 && u.cols() != y.cols())) {
    throw std::invalid_argument("digest: recording and model differ in their channels");
  }
  if (!y.allFinite() || !u.allFinite()) {
    throw std::invalid_argument(
        "digest: a sample is missing; only recordings without gaps have one");
  }
}

constexpr std::uint64_t kMostNumbers = 1ULL << 27;

void put(std::string& to, std::uint64_t value) {
  static_assert(std::endian::native == std::endian::little);
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  to.append(bytes, sizeof value);
}

void put(std::string& to, const double* values, Index rows, Index cols) {
  put(to, static_cast<std::uint64_t>(rows));
  put(to, static_cast<std::uint64_t>(cols));
  to.append(reinterpret_cast<const char*>(values),
            static_cast<std::size_t>(rows * cols) * sizeof(double));
}

void put(std::string& to, const MatrixXd& M) { put(to, M.data(), M.rows(), M.cols()); }

std::uint64_t take_count(std::string_view& from) {
  std::uint64_t value = 0;
  if (from.size() < sizeof value) throw std::invalid_argument("digest: it ends too early");
  std::memcpy(&value, from.data(), sizeof value);
  from.remove_prefix(sizeof value);
  return value;
}

std::pair<std::uint64_t, std::uint64_t> take_size(std::string_view& from) {
  const std::uint64_t rows = take_count(from), cols = take_count(from);
  const bool possible =
      rows <= kMostNumbers && cols <= kMostNumbers && rows * cols <= from.size() / sizeof(double);
  if (!possible) throw std::invalid_argument("digest: it ends too early");
  return {rows, cols};
}

void take_numbers(std::string_view& from, double* to, std::uint64_t count) {
  std::memcpy(to, from.data(), count * sizeof(double));
  from.remove_prefix(count * sizeof(double));
  if (!Eigen::Map<const VectorXd>(to, static_cast<Index>(count)).allFinite()) {
    throw std::invalid_argument("digest: a number that is not finite");
  }
}

MatrixXd take_matrix(std::string_view& from) {
  const auto [rows, cols] = take_size(from);
  MatrixXd out(static_cast<Index>(rows), static_cast<Index>(cols));
  if (out.size() > 0) take_numbers(from, out.data(), rows * cols);
  return out;
}

void require(bool holds) {
  if (!holds) throw std::invalid_argument("digest: its parts do not fit together");
}

// The segment's z are y and u, or what a nominal filter has left of y.
void check_parts(const RecordingDigest& d) {
  const Index channels = d.head.rows(), lags = d.lags();
  require(d.outputs >= 1 && d.inputs >= 0 && d.outputs + d.inputs < kMaxChannels && lags >= 1);
  require(d.tail.rows() == channels && d.tail.cols() == lags && d.samples > 2 * lags);
  require(d.sums.size() == static_cast<std::size_t>(lags * channels * channels));
  require(d.mean.size() == 0 || d.mean.size() == d.outputs + d.inputs);
  if (!d.nominal) {
    require(channels == d.outputs + d.inputs + (d.mean.size() > 0 ? 1 : 0));
    return;
  }
  const RecordingDigest::Nominal& of = *d.nominal;
  const Index n = of.A.rows();
  require(channels == d.outputs && d.mean.size() == 0 && n >= 1 && of.A.cols() == n);
  require(of.B.rows() == n && of.B.cols() == d.inputs && of.C.rows() == d.outputs);
  require(of.C.cols() == n && of.D.rows() == d.outputs && of.D.cols() == d.inputs);
  require(of.K.rows() == n && of.K.cols() == d.outputs && of.start.size() == n);
  require(of.end.size() == n);
}

}  // namespace

RecordingDigest digest_of(const MatrixXd& y, const MatrixXd& u, const StateSpace& model,
                          Index lags) {
  check_recording(y, u, model);
  const std::unique_ptr<SegmentKernel> kernel = make_segment_kernel(model.states());
  if (!kernel->prepare(model, {}, y.cols())) {
    throw std::invalid_argument(
        "digest: the model's filter has no steady gain that forgets within "
        "the recording");
  }
  const Index needed = kernel->memory();
  Index kept = 64;
  while (kept < std::max(lags, kSpare * needed) && 4 * kept < y.cols()) kept *= 2;
  if (kept < needed || y.cols() <= 2 * kept) {
    throw std::invalid_argument(
        "digest: the recording is not longer than twice what the filter "
        "remembers, and 128 samples");
  }
  RecordingDigest out;
  out.outputs = y.rows();
  out.inputs = u.rows();
  out.samples = y.cols();
  if (drifts(model)) {
    NominalInnovations nominal =
        nominal_innovations(model, kernel->gain(), needed, y, u, 0, y.cols());
    nominal.sums.extend_to(kept);
    take_sums(nominal.sums, kept, out);
    out.nominal = {model.A, model.B, model.C, model.D, nominal.gain, nominal.start, nominal.end};
    return out;
  }
  Segment segment = make_segment(y, u, 0, y.cols());
  segment.sums.extend_to(kept);
  take_sums(segment.sums, kept, out);
  out.mean = segment.mean;
  return out;
}

Segment segment_of(const RecordingDigest& digest) {
  check_parts(digest);
  SegmentAutocovariances sums(digest.head, digest.tail, digest.samples, digest.sums);
  if (!digest.nominal) return {0, digest.mean, std::move(sums), {}, {}};
  const RecordingDigest::Nominal& of = *digest.nominal;
  StateSpace ran;
  ran.A = of.A, ran.B = of.B, ran.C = of.C, ran.D = of.D;
  const MatrixXd none(digest.outputs + digest.inputs, 0);
  return {0,
          VectorXd(),
          SegmentAutocovariances(none, none, digest.samples, {}),
          {},
          NominalInnovations{std::move(ran), of.K, of.start, of.end, std::move(sums)}};
}

std::string bytes_of(const RecordingDigest& digest) {
  std::string out;
  add_bytes(digest, out);
  return out;
}

void add_bytes(const RecordingDigest& d, std::string& out) {
  for (const Index count : {d.outputs, d.inputs, d.samples}) {
    put(out, static_cast<std::uint64_t>(count));
  }
  put(out, MatrixXd(d.mean));
  put(out, d.head);
  put(out, d.tail);
  put(out, d.sums.data(), static_cast<Index>(d.sums.size()), 1);
  put(out, static_cast<std::uint64_t>(d.nominal ? 1 : 0));
  if (d.nominal) {
    const RecordingDigest::Nominal& of = *d.nominal;
    for (const MatrixXd* M : {&of.A, &of.B, &of.C, &of.D, &of.K}) put(out, *M);
    put(out, MatrixXd(of.start));
    put(out, MatrixXd(of.end));
  }
}

RecordingDigest digest_in(std::string_view& bytes) {
  RecordingDigest out;
  for (Index* count : {&out.outputs, &out.inputs, &out.samples}) {
    const std::uint64_t value = take_count(bytes);
    require(value < (1ULL << 60));
    *count = static_cast<Index>(value);
  }
  out.mean = take_matrix(bytes).reshaped();
  out.head = take_matrix(bytes);
  out.tail = take_matrix(bytes);
  const auto [numbers, one] = take_size(bytes);
  out.sums.resize(numbers * one);
  if (!out.sums.empty()) take_numbers(bytes, out.sums.data(), numbers * one);
  if (take_count(bytes) != 0) {
    RecordingDigest::Nominal of;
    for (MatrixXd* M : {&of.A, &of.B, &of.C, &of.D, &of.K}) *M = take_matrix(bytes);
    of.start = take_matrix(bytes).reshaped();
    of.end = take_matrix(bytes).reshaped();
    out.nominal = std::move(of);
  }
  check_parts(out);
  return out;
}

}  // namespace identikal
