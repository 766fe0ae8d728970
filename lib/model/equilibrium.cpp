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

// Has no entry moved by more than that share of itself, or of a millionth of its column's largest?
bool rests(const MatrixXd& now, const MatrixXd& before, double share) {
  for (Index c = 0; c < now.cols(); ++c) {
    const double floor = 1e-6 * now.col(c).cwiseAbs().maxCoeff();
    for (Index i = 0; i < now.rows(); ++i) {
      const double size = std::max(std::abs(now(i, c)), floor);
      if (!(std::abs(now(i, c) - before(i, c)) <= share * size)) return false;
    }
  }
  return true;
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
  MatrixXd held(model.inputs, 2);
  held.colwise() = u;
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
    const bool quiet =
        rests(out.x, before.x, kRests) && rests(out.wrt_p, before.wrt_p, kSlopesRest);
    quiet_intervals = quiet ? quiet_intervals + 1 : 0;
    out.found = quiet_intervals == kQuietIntervals;
  }
  return out;
}

}  // namespace identikal
