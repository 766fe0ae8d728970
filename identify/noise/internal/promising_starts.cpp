#include "identify/noise/internal/promising_starts.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace identikal {
namespace {

using Eigen::VectorXd;

constexpr int kSteps = 6;
constexpr double kApart = 0.1;  // places nearer than this lead to the same one

struct ScatteredStart {
  VectorXd z;
  double L;
};

ScatteredStart at_best_scale(const LikelihoodProblem& inside, const CommonScale& scale,
                             VectorXd z) {
  z = z.cwiseMax(inside.lower).cwiseMin(inside.upper);
  const double L = scale.rescale(inside, z);
  return {std::move(z), L};
}

// Those not lower than either neighbour.
std::vector<ScatteredStart> peaks(const std::vector<ScatteredStart>& places) {
  std::vector<ScatteredStart> out;
  for (std::size_t k = 0; k < places.size(); ++k) {
    const bool below = (k > 0 && places[k - 1].L > places[k].L) ||
                       (k + 1 < places.size() && places[k + 1].L > places[k].L);
    if (!below) out.push_back(places[k]);
  }
  return out;
}

void sort_by_likelihood(std::vector<ScatteredStart>& places) {
  std::stable_sort(places.begin(), places.end(),
                   [](const ScatteredStart& a, const ScatteredStart& b) { return a.L > b.L; });
}

void keep_likeliest(std::vector<ScatteredStart>& places, int count) {
  std::erase_if(places, [](const ScatteredStart& place) { return !std::isfinite(place.L); });
  sort_by_likelihood(places);
  places.resize(std::min(places.size(), static_cast<std::size_t>(count)));
}

// A few steps on from each, the likeliest first. @return evaluations
int follow(const LikelihoodProblem& inside, std::vector<ScatteredStart>& places) {
  SolverOptions few;
  few.max_iterations = kSteps;
  int out = 0;
  for (ScatteredStart& place : places) {
    const Solution end = maximise(inside, place.z, few);
    out += end.summary.evaluations;
    place = {end.x, end.summary.objective};
  }
  sort_by_likelihood(places);
  return out;
}

}  // namespace

PromisingStarts promising_starts(const LikelihoodProblem& inside, const RootCoordinates& roots,
                                 const CommonScale& scale, const VectorXd& z, int count,
                                 std::uint64_t seed) {
  const int scattered = 20 * count, followed = 2 * count;
  PromisingStarts out;
  Random random(seed);
  std::vector<ScatteredStart> places, lines;
  for (int k = 0; k < scattered; ++k) {
    places.push_back(at_best_scale(inside, scale, roots.scattered(z, random)));
  }
  out.evaluations = scattered;
  for (std::vector<VectorXd>& kind : roots.with_lines(z)) {
    std::vector<ScatteredStart> of_kind;
    for (VectorXd& line : kind) of_kind.push_back(at_best_scale(inside, scale, std::move(line)));
    out.evaluations += static_cast<int>(of_kind.size());
    const std::vector<ScatteredStart> highest = peaks(of_kind);
    lines.insert(lines.end(), highest.begin(), highest.end());
  }
  for (std::vector<ScatteredStart>* kind : {&lines, &places}) {
    keep_likeliest(*kind, followed);
    out.evaluations += follow(inside, *kind);
  }
  // By turns: near the unit circle a search takes more steps until it is the likelier one.
  std::vector<VectorXd> taken = {z};
  for (std::size_t k = 0; k < std::max(lines.size(), places.size()); ++k) {
    for (const std::vector<ScatteredStart>* kind : {&lines, &places}) {
      if (k >= kind->size() || static_cast<int>(out.z.size()) == count) continue;
      const VectorXd& here = (*kind)[k].z;
      const bool apart = std::all_of(taken.begin(), taken.end(), [&](const VectorXd& other) {
        return roots.distance(here, other) > kApart;
      });
      if (!apart) continue;
      taken.push_back(here);
      out.z.push_back(here);
    }
  }
  return out;
}

}  // namespace identikal
