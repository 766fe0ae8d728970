// What do the inputs do between samples?
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "lib/base/message.h"
#include "lib/model/nonlinear_model.h"

namespace identikal {

using Eigen::Index;

InputNodes input_nodes(const Eigen::VectorXd& time, const Eigen::MatrixXd& u, InputPath path,
                       double longest_step) {
  if (!(longest_step > 0.0)) {
    throw std::invalid_argument(message({"input_nodes: longest step ", longest_step}));
  }
  std::vector<int> counts;
  for (Index k = 0; k + 1 < time.size(); ++k) {
    const double h = time[k + 1] - time[k];
    // A sampling period that is the longest step up to rounding takes one step.
    const double steps = std::max(1.0, std::ceil(h / longest_step * (1.0 - 1e-9)));
    if (!(h > 0.0) || !(steps <= kMostSteps)) {
      throw std::invalid_argument(message({"input_nodes: from ", time[k], " to ", time[k + 1],
                                           " s in steps of ", longest_step, " s"}));
    }
    counts.push_back(static_cast<int>(steps));
  }
  return input_nodes(time, u, path, counts);
}

InputNodes input_nodes(const Eigen::VectorXd& time, const Eigen::MatrixXd& u, InputPath path,
                       const std::vector<int>& steps) {
  const Index N = time.size();
  if (u.cols() != N || static_cast<Index>(steps.size()) != std::max<Index>(N - 1, 0)) {
    throw std::invalid_argument(message({"input_nodes: ", N, " times, ", u.cols(),
                                         " samples, steps for ", steps.size(), " intervals"}));
  }
  InputNodes out;
  out.time = time;
  out.at_sample = u;
  out.steps = steps;
  out.straight = path != InputPath::pchip;
  Index columns = 0;
  for (Index k = 0; k + 1 < N; ++k) {
    const int count = steps[k];
    if (!(time[k + 1] > time[k]) || count < 1 || count > kMostSteps) {
      throw std::invalid_argument(
          message({"input_nodes: from ", time[k], " to ", time[k + 1], " s in ", count, " steps"}));
    }
    out.first.push_back(columns);
    columns += 2 * count + 1;
  }
  out.u.resize(u.rows(), columns);
  for (Index i = 0; i < u.rows(); ++i) {
    std::optional<Pchip> curve;
    if (path == InputPath::pchip) curve.emplace(time, u.row(i).transpose());
    for (Index k = 0; k + 1 < N; ++k) {
      const auto interval = static_cast<std::size_t>(k);
      const Index last = 2 * out.steps[interval];
      for (Index j = 0; j <= last; ++j) {
        const double share = static_cast<double>(j) / static_cast<double>(last);
        double value = u(i, k);
        if (path == InputPath::linear) value += share * (u(i, k + 1) - u(i, k));
        if (curve) {
          value = curve->in_interval(k, time[k] + share * (time[k + 1] - time[k]));
        }
        out.u(i, out.first[interval] + j) = value;
      }
    }
  }
  return out;
}

InputNodes controlled_nodes(const Eigen::VectorXd& time, const Eigen::MatrixXd& u, InputPath path,
                            double tolerance) {
  if (!(tolerance >= 1e-13 && tolerance <= 1e-2)) {
    throw std::invalid_argument(message({"controlled_nodes: tolerance ", tolerance}));
  }
  const auto intervals = static_cast<std::size_t>(std::max<Index>(time.size() - 1, 0));
  InputNodes out = input_nodes(time, u, path, std::vector<int>(intervals, 1));
  out.tolerance = tolerance;
  for (Index i = 0; path == InputPath::pchip && i < u.rows(); ++i) {
    out.curves.emplace_back(time, u.row(i).transpose());
  }
  return out;
}

}  // namespace identikal
