#include "lib/filter/gated_innovations.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "lib/base/constants.h"
#include "lib/filter/internal/recursion.h"
#include "lib/filter/internal/tangent_filter.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// What an output was refused in a row, and the state before.
struct Row {
  std::vector<std::pair<Index, double>> samples;
  std::vector<double> before;
  Index open_until = 0;
};

class Gate {
 public:
  using Far = std::function<int(Index t, const FilterResult& so_far)>;

  Gate(const GatedFilter& filter, Index states, MatrixXd& y, Index most_in_a_row, const Far& far)
      : filter_(filter),
        y_(y),
        most_in_a_row_(most_in_a_row),
        far_(far),
        rows_(static_cast<std::size_t>(y.rows())),
        out_(empty_filter_result(states, y.rows(), y.cols(), Keep::innovations)) {}

  FilterResult run() {
    constexpr Index kFew = 4, kMany = 128;  // samples that are run before they are looked at
    out_.status = filter_.at_start;
    Index t = 0, length = kMany;
    while (t < y_.cols() && out_.status == FilterStatus::ok) {
      const Index from = t;
      const bool diffuse = is_diffuse();
      const std::vector<double> before = diffuse ? std::vector<double>() : filter_.state();
      out_.status = filter_.go_to(out_, t, std::min(y_.cols(), from + length));
      if (out_.status != FilterStatus::ok || diffuse) continue;
      const auto [at, channel] = first_refused(from, t);
      length = channel < 0 ? std::min(kMany, 2 * length) : kFew;
      if (channel < 0) continue;
      filter_.go_back_to(before);
      t = from;
      if (at > from) out_.status = filter_.go_to(out_, t, at);
      if (out_.status == FilterStatus::ok) t = refuse(at, channel);
    }
    if (out_.status == FilterStatus::ok && is_diffuse()) out_.status = FilterStatus::undetermined;
    return std::move(out_);
  }

 private:
  bool is_diffuse() const { return filter_.is_diffuse && filter_.is_diffuse(); }
  // The first sample of which an output is refused, and which; or -1.
  std::pair<Index, int> first_refused(Index from, Index end) const {
    for (Index t = from; t < end; ++t) {
      const int channel = far_(t, out_);
      if (channel >= 0 && t >= rows_[static_cast<std::size_t>(channel)].open_until) {
        return {t, channel};
      }
    }
    return {end, -1};
  }

  // @return where to go on: at the sample without the output, or back where the row began
  Index refuse(Index t, int channel) {
    Row& row = rows_[static_cast<std::size_t>(channel)];
    if (!row.samples.empty() && has_sample_between(channel, row.samples.back().first, t)) {
      row.samples.clear();
    }
    if (row.samples.empty()) row.before = filter_.state();
    row.samples.emplace_back(t, y_(channel, t));
    y_(channel, t) = kNaN;
    if (static_cast<Index>(row.samples.size()) <= most_in_a_row_) return t;
    const Index begin = row.samples.front().first;
    for (const auto& [sample, value] : row.samples) y_(channel, sample) = value;
    row.samples.clear();
    row.open_until = t + 1;
    filter_.go_back_to(row.before);
    return begin;
  }

  bool has_sample_between(int channel, Index after, Index before) const {
    for (Index t = after + 1; t < before; ++t) {
      if (!std::isnan(y_(channel, t))) return true;
    }
    return false;
  }

  const GatedFilter& filter_;
  MatrixXd& y_;
  Index most_in_a_row_;
  const Far& far_;
  std::vector<Row> rows_;
  FilterResult out_;
};

}  // namespace

FilterResult gated_innovations(const GatedFilter& filter, Index states, MatrixXd& y,
                               Index most_in_a_row,
                               const std::function<int(Index t, const FilterResult& so_far)>& far) {
  return Gate(filter, states, y, most_in_a_row, far).run();
}

FilterResult gated_innovations(const StateSpace& model, InitialState initial, MatrixXd& y,
                               const MatrixXd& u, Index most_in_a_row,
                               const std::function<int(Index t, const FilterResult& so_far)>& far) {
  check_shapes(model, initial, {});
  const std::vector<StateSpace> none;
  TangentFilter filter;
  filter.prepare(model, none);
  GatedFilter stepping;
  stepping.at_start = filter.begin(initial);
  stepping.go_to = [&](FilterResult& out, Index& t, Index end) {
    return filter.go_to(y, u, out, t, end);
  };
  stepping.state = [&] { return filter.predicted(); };
  stepping.go_back_to = [&](const std::vector<double>& state) { filter.go_back_to(state); };
  stepping.is_diffuse = [&] { return filter.is_diffuse(); };
  return gated_innovations(stepping, model.states(), y, most_in_a_row, far);
}

}  // namespace identikal
