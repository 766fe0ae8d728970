// How do several processes evaluate one likelihood, each that of its own recordings?
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/likelihood.h"

namespace identikal {

/// Processes that all have the same model and know all recordings. Rank 0 searches; the others answer
/// what it asks. How bytes go from one to the other is the caller's business.
///
/// Example:
///
///     LikelihoodTeam team;
///     team.size = 4;
///     team.rank = 1;
///     for (const std::size_t i : share_of(team, recordings)) std::puts(recordings[i].name.c_str());
struct LikelihoodTeam {
  int rank = 0, size = 1;
  /// Of rank 0: to all others; and an answer of each other, in the order of their ranks.
  std::function<void(const std::string& bytes)> tell;
  std::function<std::vector<std::string>()> answers;
  /// Of the others: what rank 0 tells, nothing when there is no more to do; and the answer to it.
  std::function<std::optional<std::string>()> hear;
  std::function<void(const std::string& bytes)> answer;

  bool works_for_another() const { return rank > 0; }
};

/// Which recordings a rank evaluates: all ranks have about as many samples.
std::vector<std::size_t> share_of(const LikelihoodTeam& team,
                                  const std::vector<Dataset>& recordings);

/// What rank 0 asks of the others.
struct TeamRequest {
  enum class Kind : char { evaluate, condition_on_beginning, refine };
  Kind kind = Kind::evaluate;
  bool with_gradient = false;
  std::vector<double> values;  ///< of all parameters, entry by entry
};

TeamRequest request_at(TeamRequest::Kind kind, const ParameterSet& at, bool with_gradient = false);
/// The parameters with the request's values. @throws std::runtime_error where their number differs
ParameterSet parameters_in(const TeamRequest& request, ParameterSet parameters);

std::string bytes_of(const TeamRequest& request);
/// @throws std::runtime_error for bytes that are no request
TeamRequest request_in(const std::string& bytes);

/// Likelihood, gradient and information as bytes; and those in them added to others.
std::string bytes_of(const Likelihood& likelihood);
/// What a rank says that cannot go on.
std::string bytes_of_failure(const std::string& message);
/// A likelihood that is undefined makes the sum undefined.
/// @throws OutputError with the message of a rank that cannot go on
void add_answer(const std::string& bytes, Likelihood& sum);

}  // namespace identikal
