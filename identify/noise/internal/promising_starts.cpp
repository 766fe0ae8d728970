#include "identify/noise/internal/promising_starts.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace identikal {
namespace {

using Eigen::VectorXd;

constexpr int kSteps = 6;
constexpr double kApart = 0.05;  // partial autocorrelations nearer than this lead to the same place

struct Place {
  VectorXd z;
  double L;
};

Place at_best_scale(const LikelihoodProblem& inside, const CommonScale& scale, VectorXd z) {
  z = z.cwiseMax(inside.lower).cwiseMin(inside.upper);
  const double L = scale.rescale(inside, z);
  return {std::move(z), L};
}

// Those not lower than either neighbour.
std::vector<Place> peaks(const std::vector<Place>& places) {
  std::vector<Place> out;
  for (std::size_t k = 0; k < places.size(); ++k) {
    const bool below = (k > 0 && places[k - 1].L > places[k].L) ||
                       (k + 1 < places.size() && places[k + 1].L > places[k].L);
    if (!below) out.push_back(places[k]);
  }
  return out;
}

void sort_by_likelihood(std::vector<Place>& places) {
  std::stable_sort(places.begin(), places.end(),
                   [](const Place& a, const Place& b) { return a.L > b.L; });
}

void keep_likeliest(std::vector<Place>& places, int count) {
  std::erase_if(places, [](const Place& place) { return !std::isfinite(place.L); });
  sort_by_likelihood(places);
  places.resize(std::min(places.size(), static_cast<std::size_t>(count)));
}

}  // namespace

PromisingStarts promising_starts(const LikelihoodProblem& inside, const RootCoordinates& roots,
                                 const CommonScale& scale, const VectorXd& z, int count,
                                 std::uint64_t seed) {
  const int scattered = 20 * count, followed = 2 * count;
  PromisingStarts out;
  Random random(seed);
  std::vector<Place> places;
  for (int k = 0; k < scattered; ++k) {
    places.push_back(at_best_scale(inside, scale, roots.scattered(z, random)));
  }
  out.evaluations = scattered;
  keep_likeliest(places, followed);
  std::vector<Place> lines;
  for (std::vector<VectorXd>& kind : roots.with_lines(z)) {
    std::vector<Place> of_kind;
    for (VectorXd& line : kind) of_kind.push_back(at_best_scale(inside, scale, std::move(line)));
    out.evaluations += static_cast<int>(of_kind.size());
    const std::vector<Place> highest = peaks(of_kind);
    lines.insert(lines.end(), highest.begin(), highest.end());
  }
  keep_likeliest(lines, followed);
  places.insert(places.end(), lines.begin(), lines.end());
  SolverOptions few;
  few.max_iterations = kSteps;
  for (Place& place : places) {
    const Solution end = maximise(inside, place.z, few);
    out.evaluations += end.summary.evaluations;
    place = {end.x, end.summary.objective};
  }
  sort_by_likelihood(places);
  out.z.push_back(z);
  for (const Place& place : places) {
    if (static_cast<int>(out.z.size()) > count) break;
    const bool apart = std::all_of(out.z.begin(), out.z.end(), [&](const VectorXd& other) {
      return roots.distance(place.z, other) > kApart;
    });
    if (apart) out.z.push_back(place.z);
  }
  out.z.erase(out.z.begin());
  return out;
}

}  // namespace identikal
