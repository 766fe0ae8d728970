#include "lib/model/equilibrium.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "lib/base/message.h"
#include "lib/model/internal/controlled_motion.h"
#include "lib/model/internal/rates.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFollowedTo = 1e-10;  // tolerance of the motion
constexpr double kRests = 1e-11;  // share of a state that it moves by over an interval, at rest
constexpr double kSlopesRest = 1e-9;
constexpr double kLonger = 8.0;  // an interval than the one before
constexpr int kMostIntervals = 36, kQuietIntervals = 3;

// Has no state moved by more than a share of itself, or of a millionth of the largest?
bool rests(const VectorXd& now, const VectorXd& before) {
  const double floor = 1e-6 * now.cwiseAbs().maxCoeff();
  return ((now - before).array().abs() <= kRests * now.array().abs().max(floor)).all();
}

// Has no derivative by more than a share of itself, or of what its parameter's own size makes of the
// state's?
bool slopes_rest(const Equilibrium& now, const Equilibrium& before, const VectorXd& sizes) {
  for (Index c = 0; c < now.wrt_p.cols(); ++c) {
    const double floor = 1e-6 * now.x.cwiseAbs().maxCoeff();
    for (Index i = 0; i < now.x.size(); ++i) {
      const double slope = now.wrt_p(i, c), own = std::max(std::abs(now.x[i]), floor) / sizes[c];
      if (!(std::abs(slope - before.wrt_p(i, c)) <= kSlopesRest * std::max(std::abs(slope), own))) {
        return false;
      }
    }
  }
  return true;
}

// |p_i| of the columns, as they were set; 1 where it is zero.
VectorXd parameter_sizes(const NonlinearModel& model, const ModelMemory& memory) {
  VectorXd out = VectorXd::Ones(model.columns);
  for (std::size_t i = 0; i < model.column.size(); ++i) {
    const auto slot = static_cast<std::size_t>(model.states + model.inputs) + i;
    const double size = std::abs(memory.rates[slot]);
    if (model.column[i] >= 0 && size > 0.0) out[model.column[i]] = size;
  }
  return out;
}

// In which a rate moves its state noticeably.
double first_interval(const VectorXd& x, const VectorXd& rate) {
  const double fastest = rate.cwiseAbs().maxCoeff(), size = x.cwiseAbs().maxCoeff();
  return fastest > 0.0 ? 0.1 * std::max(size, 1e-6 * fastest) / fastest : 1.0;
}

}  // namespace

Equilibrium equilibrium(const NonlinearModel& model, ModelMemory& memory,
                        const Eigen::Ref<const VectorXd>& x, const Eigen::Ref<const VectorXd>& u) {
  if (!model.continuous || x.size() != model.states || u.size() != model.inputs) {
    throw std::invalid_argument(message(
        {"equilibrium: ", x.size(), " states and ", u.size(), " inputs; the model has ",
         model.states, " and ", model.inputs, (model.continuous ? "" : ", in discrete time")}));
  }
  Equilibrium out{false, x, MatrixXd::Identity(model.states, model.states),
                  MatrixXd::Zero(model.states, model.columns)};
  evaluate_rates(model, memory, out.x.data(), u.data(), 0.0);
  double interval = first_interval(out.x, memory.rate.head(model.states));
  if (!std::isfinite(interval)) return out;  // from there it leads nowhere
  MatrixXd held(model.inputs, 2);
  held.colwise() = u;
  const VectorXd sizes = parameter_sizes(model, memory);
  Jacobian motion;
  int quiet_intervals = 0;
  for (int i = 0; i < kMostIntervals && !out.found; ++i, interval *= kLonger) {
    const InputNodes nodes =
        controlled_nodes(Eigen::Vector2d(0.0, interval), held, InputPath::constant, kFollowedTo);
    const Equilibrium before = out;
    move_controlled(model, memory, nodes, 0, out.x, &motion);
    if (!out.x.allFinite() || !motion.wrt_p.allFinite()) break;
    out.wrt_x = motion.wrt_x * before.wrt_x;
    out.wrt_p = motion.wrt_x * before.wrt_p + motion.wrt_p;
    const bool quiet = rests(out.x, before.x) && slopes_rest(out, before, sizes);
    quiet_intervals = quiet ? quiet_intervals + 1 : 0;
    out.found = quiet_intervals == kQuietIntervals;
  }
  return out;
}

}  // namespace identikal
