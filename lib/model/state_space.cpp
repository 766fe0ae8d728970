#include "lib/model/state_space.h"

#include <stdexcept>

#include "lib/base/message.h"

namespace identikal {
namespace {

void check(const char* name, const Eigen::MatrixXd& M, Eigen::Index rows, Eigen::Index cols) {
  if (M.rows() == rows && M.cols() == cols) return;
  throw std::invalid_argument(message({"state space: ", name, " is ", M.rows(), " x ", M.cols(),
                                       ", expected ", rows, " x ", cols}));
}

}  // namespace

void check_shapes(const StateSpace& model) {
  const Eigen::Index n = model.A.rows(), ny = model.C.rows(), nu = model.B.cols(),
                     nw = model.G.cols();
  if (n == 0 || ny == 0) throw std::invalid_argument("a model without states or outputs");
  check("A", model.A, n, n);
  check("B", model.B, n, nu);
  check("C", model.C, ny, n);
  check("D", model.D, ny, nu);
  check("G", model.G, n, nw);
  check("Q", model.Q, nw, nw);
  check("R", model.R, ny, ny);
  check("S", model.S, nw, ny);
}

Eigen::MatrixXd joint_covariance(const StateSpace& model) {
  const Eigen::Index nw = model.Q.rows(), ny = model.R.rows();
  Eigen::MatrixXd out(nw + ny, nw + ny);
  out << model.Q, model.S, model.S.transpose(), model.R;
  return out;
}

bool changes_dynamics(const StateSpace& d) {
  return !(d.A.isZero(0.0) && d.B.isZero(0.0) && d.C.isZero(0.0) && d.D.isZero(0.0));
}

bool changes_start(const StateSpace& d) {
  return !d.x0.isZero(0.0) || (!d.P0.isZero(0.0) && d.Q.isZero(0.0));
}

bool changes_only_noise(const StateSpace& d) {
  return !changes_dynamics(d) && d.G.isZero(0.0) && !changes_start(d);
}

}  // namespace identikal
