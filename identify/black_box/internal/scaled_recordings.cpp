#include "identify/black_box/internal/scaled_recordings.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>

#include "lib/base/error.h"
#include "lib/statistics/long_run_covariance.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct ChannelScale {
  double mean = 0.0, sd = 0.0, mean_se = 0.0;
};

// Of one channel, through all recordings; missing samples do not count.
ChannelScale channel_scale(const std::vector<Dataset>& recordings, const MatrixXd Dataset::*of,
                           Index channel) {
  std::vector<double> values;
  for (const Dataset& each : recordings) {
    for (const double x : (each.*of).row(channel)) {
      if (std::isfinite(x)) values.push_back(x);
    }
  }
  const auto count = static_cast<Index>(values.size());
  if (count < 2) return {};
  Eigen::RowVectorXd deviation = Eigen::Map<const Eigen::RowVectorXd>(values.data(), count);
  ChannelScale out;
  out.mean = deviation.mean();
  deviation.array() -= out.mean;
  out.sd = std::sqrt(deviation.squaredNorm() / static_cast<double>(count));
  constexpr Index kWidest = 1000;
  const Index bandwidth = andrews_bandwidth(deviation, std::clamp<Index>(count / 8, 1, kWidest));
  out.mean_se =
      std::sqrt(long_run_covariance(deviation, bandwidth)(0, 0)) / static_cast<double>(count);
  return out;
}

// Is every channel within two standard errors of zero?
bool are_deviations(const std::vector<ChannelScale>& channels) {
  for (const ChannelScale& each : channels) {
    if (std::abs(each.mean) > 2.0 * each.mean_se) return false;
  }
  return true;
}

std::vector<ChannelScale> channel_scales(const std::vector<Dataset>& recordings,
                                         const MatrixXd Dataset::*of,
                                         const std::vector<Channel>& channels) {
  std::vector<ChannelScale> out;
  for (std::size_t c = 0; c < channels.size(); ++c) {
    out.push_back(channel_scale(recordings, of, static_cast<Index>(c)));
    const ChannelScale& last = out.back();
    if (!(last.sd > 1e-12 * std::abs(last.mean))) {
      throw InputError({recordings.front().name, 0, 0},
                       fmt::format("'{}' never changes", channels[c].name), "a channel that moves",
                       "leave it out: nothing can be learnt from it");
    }
  }
  return out;
}

}  // namespace

Index ScaledRecordings::rows() const {
  Index sum = 0;
  for (const MatrixXd& each : y) sum += each.cols();
  return sum;
}

ScaledRecordings scaled(const std::vector<Dataset>& recordings) {
  const Dataset& first = recordings.front();
  for (const Dataset& each : recordings) {
    if (each.u.allFinite()) continue;
    throw InputError({each.name, 0, 0}, "an input has missing samples", "a value in every row",
                     "fill the gaps: what an input was meanwhile moves the outputs later");
  }
  const std::vector<ChannelScale> of_y = channel_scales(recordings, &Dataset::y, first.outputs);
  const std::vector<ChannelScale> of_u = channel_scales(recordings, &Dataset::u, first.inputs);
  const bool centred = are_deviations(of_y) && are_deviations(of_u);
  ScaledRecordings out;
  const auto fill = [&](const std::vector<ChannelScale>& channels, VectorXd& at, VectorXd& sd) {
    at.setZero(static_cast<Index>(channels.size()));
    sd.resize(at.size());
    for (Index c = 0; c < at.size(); ++c) {
      const ChannelScale& each = channels[static_cast<std::size_t>(c)];
      if (!centred) at[c] = each.mean;
      sd[c] = each.sd;
    }
  };
  fill(of_y, out.point.y, out.point.y_sd);
  fill(of_u, out.point.u, out.point.u_sd);
  for (const Dataset& each : recordings) {
    out.y.push_back(out.point.y_sd.cwiseInverse().asDiagonal() * (each.y.colwise() - out.point.y));
    out.u.push_back(out.point.u_sd.cwiseInverse().asDiagonal() * (each.u.colwise() - out.point.u));
  }
  return out;
}

SplitRecordings split(const ScaledRecordings& all, double share) {
  SplitRecordings out;
  out.first.point = out.rest.point = all.point;
  for (std::size_t k = 0; k < all.y.size(); ++k) {
    const Index rows = all.y[k].cols();
    const auto before = static_cast<Index>(share * static_cast<double>(rows));
    out.first.y.push_back(all.y[k].leftCols(before));
    out.first.u.push_back(all.u[k].leftCols(before));
    out.rest.y.push_back(all.y[k].rightCols(rows - before));
    out.rest.u.push_back(all.u[k].rightCols(rows - before));
  }
  return out;
}

ScaledRecordings first_rows(const ScaledRecordings& all, Index rows) {
  if (all.rows() <= rows) return all;
  ScaledRecordings out;
  out.point = all.point;
  for (std::size_t k = 0; k < all.y.size() && rows > 0; ++k) {
    const Index taken = std::min(rows, all.y[k].cols());
    out.y.push_back(all.y[k].leftCols(taken));
    out.u.push_back(all.u[k].leftCols(taken));
    rows -= taken;
  }
  return out;
}

InnovationForm in_units(InnovationForm model, const OperatingPoint& point) {
  const auto y = point.y_sd.asDiagonal();
  const auto per_y = point.y_sd.cwiseInverse().asDiagonal();
  const auto per_u = point.u_sd.cwiseInverse().asDiagonal();
  model.B = model.B * per_u;
  model.C = y * model.C;
  model.D = y * model.D * per_u;
  model.K = model.K * per_y;
  model.sigma = y * model.sigma * y;
  return model;
}

}  // namespace identikal
