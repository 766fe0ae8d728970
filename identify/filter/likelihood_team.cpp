#include "identify/filter/likelihood_team.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "lib/base/error.h"

namespace identikal {
namespace {

using Eigen::Index;

enum class AnswerKind : char { likelihood, undefined, failure };

void put(std::string& to, const double* numbers, Index count) {
  to.append(reinterpret_cast<const char*>(numbers),
            static_cast<std::size_t>(count) * sizeof(double));
}

std::vector<double> numbers_from(const std::string& bytes, std::size_t begin) {
  if (bytes.size() < begin || (bytes.size() - begin) % sizeof(double) != 0) {
    throw std::runtime_error("a message between processes is cut short");
  }
  std::vector<double> out((bytes.size() - begin) / sizeof(double));
  if (!out.empty()) std::memcpy(out.data(), bytes.data() + begin, bytes.size() - begin);
  return out;
}

}  // namespace

std::vector<std::size_t> share_of(const LikelihoodTeam& team,
                                  const std::vector<Dataset>& recordings) {
  std::vector<Index> load(static_cast<std::size_t>(team.size), 0);
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    const auto least = std::min_element(load.begin(), load.end());
    if (least - load.begin() == team.rank) out.push_back(i);
    *least += recordings[i].size();
  }
  return out;
}

TeamRequest request_at(TeamRequest::Kind kind, const ParameterSet& at, bool with_gradient) {
  TeamRequest out{kind, with_gradient, {}};
  for (const Parameter& p : at) {
    out.values.insert(out.values.end(), p.value.data(), p.value.data() + p.value.size());
  }
  return out;
}

ParameterSet parameters_in(const TeamRequest& request, ParameterSet parameters) {
  std::size_t used = 0;
  for (Parameter& p : parameters) {
    const auto count = static_cast<std::size_t>(p.value.size());
    if (used + count > request.values.size()) break;
    std::copy_n(request.values.begin() + static_cast<std::ptrdiff_t>(used), count, p.value.data());
    used += count;
  }
  if (used != request.values.size()) {
    throw std::runtime_error("processes of one likelihood have different parameters");
  }
  return parameters;
}

std::string bytes_of(const TeamRequest& request) {
  std::string out{static_cast<char>(request.kind), static_cast<char>(request.with_gradient)};
  put(out, request.values.data(), static_cast<Index>(request.values.size()));
  return out;
}

TeamRequest request_in(const std::string& bytes) {
  TeamRequest out;
  out.values = numbers_from(bytes, 2);
  out.kind = static_cast<TeamRequest::Kind>(bytes[0]);
  out.with_gradient = bytes[1] != 0;
  return out;
}

std::string bytes_of(const Likelihood& likelihood) {
  if (likelihood.status != FilterStatus::ok) {
    return std::string(1, static_cast<char>(AnswerKind::undefined));
  }
  std::string out(1, static_cast<char>(AnswerKind::likelihood));
  put(out, &likelihood.value, 1);
  put(out, likelihood.gradient.data(), likelihood.gradient.size());
  put(out, likelihood.information.data(), likelihood.information.size());
  return out;
}

std::string bytes_of_failure(const std::string& message) {
  return static_cast<char>(AnswerKind::failure) + message;
}

void add_answer(const std::string& bytes, Likelihood& sum) {
  const AnswerKind kind =
      bytes.empty() ? AnswerKind::failure : static_cast<AnswerKind>(bytes.front());
  if (kind == AnswerKind::failure) {
    throw OutputError(bytes.empty() ? "a process of the joint fit has ended"
                                    : "a process of the joint fit: " + bytes.substr(1));
  }
  if (kind == AnswerKind::undefined) {
    sum.status = FilterStatus::indefinite;
    return;
  }
  const std::vector<double> numbers = numbers_from(bytes, 1);
  const auto k = static_cast<std::size_t>(sum.gradient.size());
  if (numbers.size() != 1 + k + k * k) {
    throw std::runtime_error("processes of one likelihood have different parameters");
  }
  sum.value += numbers[0];
  const auto n = static_cast<Index>(k);
  sum.gradient += Eigen::Map<const Eigen::VectorXd>(numbers.data() + 1, n);
  sum.information += Eigen::Map<const Eigen::MatrixXd>(numbers.data() + 1 + k, n, n);
}

}  // namespace identikal
