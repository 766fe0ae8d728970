#include "identify/black_box/internal/scaled_recordings.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>

#include "lib/base/error.h"
namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct ChannelScale {
  double mean = 0.0, sd = 0.0;
};

// Of one channel, through all recordings; missing samples do not count.
ChannelScale channel_scale(const std::vector<Dataset>& recordings, const MatrixXd Dataset::*of,
                           Index channel) {
  double count = 0.0, sum = 0.0, squares = 0.0;
  const auto for_each = [&](const auto& take) {
    for (const Dataset& each : recordings) {
      for (const double x : (each.*of).row(channel)) {
        if (std::isfinite(x)) take(x);
      }
    }
  };
  for_each([&](double x) { sum += x, count += 1.0; });
  if (count < 2.0) return {};
  const double mean = sum / count;
  for_each([&](double x) { squares += (x - mean) * (x - mean); });
  return {mean, std::sqrt(squares / count)};
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
  ScaledRecordings out;
  const auto fill = [&](const std::vector<ChannelScale>& channels, VectorXd& at, VectorXd& sd) {
    at.resize(static_cast<Index>(channels.size()));
    sd.resize(at.size());
    for (Index c = 0; c < at.size(); ++c) {
      at[c] = channels[static_cast<std::size_t>(c)].mean;
      sd[c] = channels[static_cast<std::size_t>(c)].sd;
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

double farthest_mean(const OperatingPoint& point) {
  return std::max(point.y.cwiseQuotient(point.y_sd).lpNorm<Eigen::Infinity>(),
                  point.u.cwiseQuotient(point.u_sd).lpNorm<Eigen::Infinity>());
}

ScaledRecordings from_zero(ScaledRecordings recordings) {
  OperatingPoint& point = recordings.point;
  const VectorXd y = point.y.cwiseQuotient(point.y_sd), u = point.u.cwiseQuotient(point.u_sd);
  for (MatrixXd& each : recordings.y) each.colwise() += y;
  for (MatrixXd& each : recordings.u) each.colwise() += u;
  point.y.setZero();
  point.u.setZero();
  return recordings;
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

SplitRecordings about_first_means(SplitRecordings parts) {
  const auto of_rows = [](const std::vector<MatrixXd>& recordings) {
    VectorXd sum = VectorXd::Zero(recordings.front().rows()), count = sum;
    for (const MatrixXd& each : recordings) {
      const auto there = each.array().isFinite();
      sum += there.select(each, 0.0).rowwise().sum().matrix();
      count += there.cast<double>().rowwise().sum().matrix();
    }
    return VectorXd(sum.cwiseQuotient(count.cwiseMax(1.0)));
  };
  const VectorXd y = of_rows(parts.first.y), u = of_rows(parts.first.u);
  for (ScaledRecordings* part : {&parts.first, &parts.rest}) {
    for (MatrixXd& each : part->y) each.colwise() -= y;
    for (MatrixXd& each : part->u) each.colwise() -= u;
    part->point.y += y.cwiseProduct(part->point.y_sd);
    part->point.u += u.cwiseProduct(part->point.u_sd);
  }
  return parts;
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
