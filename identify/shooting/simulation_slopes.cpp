#include "identify/shooting/simulation_slopes.h"

#include "identify/shooting/internal/trajectory_problem.h"
#include "lib/base/constants.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

SimulationSlopes simulation_slopes(const Model& model, const std::vector<Dataset>& recordings,
                                   const ParameterSet& at) {
  constexpr double kExact = 1e-9;
  TrajectoryProblem problem(model, recordings);
  SimulationSlopes out;
  out.unknowns = problem.unknowns();
  const VectorXd p = problem.values_in(at);
  MatrixXd states;
  if (!problem.simulate(p, states)) return out;
  const VectorXd scale = states.cwiseAbs().rowwise().maxCoeff();
  problem.choose_steps(p, states, (scale.array() > 0.0).select(scale, 1.0), kExact);
  std::vector<ChainLink> links(recordings.size());
  if (!problem.simulation_problem().evaluate(MatrixXd(0, problem.recordings()), p, true, links)) {
    return out;
  }
  const Index ny = recordings[0].y.rows(), N = problem.samples();
  const auto np = static_cast<Index>(out.unknowns.size());
  out.errors = MatrixXd::Constant(ny, N, kNaN);
  out.slopes.assign(static_cast<std::size_t>(ny), MatrixXd::Zero(N, np));
  Index column = 0;
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    Index row = 0;
    for (Index k = 0; k < recordings[r].size(); ++k, ++column) {
      for (Index i = 0; i < ny; ++i) {
        if (std::isnan(recordings[r].y(i, k))) continue;
        out.errors(i, column) = links[r].residuals[row];
        out.slopes[static_cast<std::size_t>(i)].row(column) = links[r].by_shared.row(row);
        ++row;
      }
    }
  }
  return out;
}

}  // namespace identikal
