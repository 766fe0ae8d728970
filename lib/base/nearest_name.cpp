#include "lib/base/nearest_name.h"

#include <algorithm>
#include <cctype>

namespace identikal {
namespace {

// Optimal string alignment distance: one edit for an insertion, deletion, substitution or swap of
// neighbours.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> before(b.size() + 1), previous(b.size() + 1), current(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) previous[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    current[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substitution = previous[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      current[j] = std::min({previous[j] + 1, current[j - 1] + 1, substitution});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        current[j] = std::min(current[j], before[j - 2] + 1);
      }
    }
    before.swap(previous);
    previous.swap(current);
  }
  return previous[b.size()];
}

// How many of the first and the last letter agree: those are seldom mistyped.
int equal_ends(const std::string& a, const std::string& b) {
  if (a.empty() || b.empty()) return 0;
  return (a.front() == b.front() ? 1 : 0) + (a.back() == b.back() ? 1 : 0);
}

}  // namespace

std::string lower_case(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates) {
  // Names beyond this length are not typing mistakes, and the distance is quadratic.
  if (name.size() > 200) return "";
  const std::string wanted = lower_case(name);
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, name.size() / 3);
  int best_ends = -1;  // none yet
  for (const std::string& candidate : candidates) {
    if (candidate.size() > 200) continue;
    const std::string known = lower_case(candidate);
    const std::size_t distance = edit_distance(wanted, known);
    // With as many edits as letters any name comes out.
    if (distance > 0 && distance >= std::max(wanted.size(), known.size())) continue;
    const int ends = equal_ends(wanted, known);
    if (distance < best_distance || (distance == best_distance && ends > best_ends)) {
      best_distance = distance;
      best_ends = ends;
      best = candidate;
    }
  }
  return best;
}

std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates) {
  const std::string nearest = nearest_name(name, candidates);
  return nearest.empty() ? "" : "did you mean '" + nearest + "'?";
}

}  // namespace identikal
