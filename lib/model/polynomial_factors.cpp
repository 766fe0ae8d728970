#include "lib/model/polynomial_factors.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <map>
#include <numeric>
#include <optional>

#include <Eigen/Eigenvalues>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSame = 1e-8;  // coefficients closer than this are the same

// A parameter and what it may move.
struct Candidate {
  int parameter;
  bool moves_poles;  // else the numerator
};

std::vector<Index> stationary_states(const LinearModel& model) {
  if (model.initial != InitialState::stationary) return model.stationary;
  std::vector<Index> out(static_cast<std::size_t>(model.A.constant.rows()));
  std::iota(out.begin(), out.end(), Index{0});
  return out;
}

// Do the states start in their steady state whose rows of A or G, or columns of C, the parameter
// stands in? It may also say how they move another one.
bool starts_stationary(const LinearModel& model, int parameter) {
  const std::vector<Index> states = stationary_states(model);
  const auto is_stationary = [&](Index state) {
    return std::find(states.begin(), states.end(), state) != states.end();
  };
  for (const ParametrisedMatrix* M : {&model.A, &model.G, &model.C}) {
    const auto is_outside = [&](const auto& e) {
      return !(M != &model.C && is_stationary(e.row)) && !(M != &model.G && is_stationary(e.col));
    };
    for (const ParametrisedMatrix::Entry& e : M->entries) {
      if (e.parameter == parameter && is_outside(e)) return false;
    }
    for (const ParametrisedMatrix::Formula& f : M->formulas) {
      const auto end = f.parameters.end();
      if (std::find(f.parameters.begin(), end, parameter) != end && is_outside(f)) return false;
    }
  }
  return true;
}

// Does the parameter stand in a row of A whose state starts stationary?
bool moves_stationary(const LinearModel& model, int parameter) {
  const std::vector<Index> states = stationary_states(model);
  const auto here = [&](const auto& e) {
    return std::find(states.begin(), states.end(), Index{e.row}) != states.end();
  };
  const auto& entries = model.A.entries;
  const auto& formulas = model.A.formulas;
  return std::any_of(entries.begin(), entries.end(),
                     [&](const auto& e) { return e.parameter == parameter && here(e); }) ||
         std::any_of(formulas.begin(), formulas.end(), [&](const auto& f) {
           const auto end = f.parameters.end();
           return std::find(f.parameters.begin(), end, parameter) != end && here(f);
         });
}

std::vector<Candidate> candidates(const LinearModel& model, const ParameterSet& parameters) {
  const auto holds = [](const ParametrisedMatrix& M, int p) {
    const std::vector<int> in = parameters_in(M);
    return std::find(in.begin(), in.end(), p) != in.end();
  };
  std::vector<Candidate> out;
  for (int p = 0; p < static_cast<int>(parameters.size()); ++p) {
    const Parameter& of = parameters[static_cast<std::size_t>(p)];
    if (of.fixed || of.domain != Domain::scalar || of.prior.kind != Prior::Kind::none) continue;
    if (std::isfinite(of.min) || std::isfinite(of.max)) continue;
    const bool in_A = moves_stationary(model, p),
               in_output = holds(model.C, p) || holds(model.G, p);
    if (in_A == in_output) continue;
    bool elsewhere = false;
    for (const ParametrisedMatrix* M :
         {&model.B, &model.D, &model.Q, &model.R, &model.S, &model.x0, &model.P0}) {
      elsewhere = elsewhere || holds(*M, p);
    }
    if (!elsewhere && starts_stationary(model, p)) out.push_back({p, in_A});
  }
  return out;
}

// A model at values of the candidates, the other parameters being what they are.
class Values {
 public:
  Values(const LinearModel& model, const ParameterSet& parameters,
         const std::vector<Candidate>& candidates)
      : model_(model), parameters_(parameters), candidates_(candidates) {}

  // @param of  one for each candidate
  StateSpace at(const VectorXd& of) const {
    ParameterSet moved = parameters_;
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      moved[static_cast<std::size_t>(candidates_[i].parameter)].value(0, 0) =
          of[static_cast<Index>(i)];
    }
    return written_matrices(model_, moved);
  }

 private:
  const LinearModel& model_;
  const ParameterSet& parameters_;
  const std::vector<Candidate>& candidates_;
};

// Those of the states that A connects with each other, at values where nothing is zero by chance.
std::vector<std::vector<Index>> connected_states(const MatrixXd& A,
                                                 const std::vector<Index>& states) {
  std::vector<Index> group(static_cast<std::size_t>(A.rows()));
  std::iota(group.begin(), group.end(), Index{0});
  for (const Index i : states) {
    for (const Index j : states) {
      if (A(i, j) == 0.0 || group[i] == group[j]) continue;
      std::replace(group.begin(), group.end(), Index{group[j]}, Index{group[i]});
    }
  }
  std::map<Index, std::vector<Index>> by_group;
  for (const Index i : states) by_group[group[i]].push_back(i);
  std::vector<std::vector<Index>> out;
  for (auto& [unused, states] : by_group) out.push_back(std::move(states));
  return out;
}

// det(I - z A), powers 0 .. n.
VectorXd characteristic(const MatrixXd& A) {
  const Index n = A.rows();
  Eigen::VectorXcd c = Eigen::VectorXcd::Zero(n + 1);
  c[0] = 1.0;
  const Eigen::VectorXcd roots = A.eigenvalues();
  for (Index i = 0; i < n; ++i) {
    for (Index k = i + 1; k > 0; --k) c[k] -= roots[i] * c[k - 1];
  }
  return c.real();
}

// Polynomials of z of a group of states.
struct Polynomials {
  VectorXd denominator;
  std::optional<VectorXd> numerator;  // from the only noise to the only output that there are
};

struct Group {
  std::vector<Index> states;
  Index output = -1, noise = -1;  // the only ones, or -1
};

// The only column of M with anything in the rows, or -1.
Index only_column(const MatrixXd& M, const std::vector<Index>& rows) {
  Index out = -1;
  for (Index j = 0; j < M.cols(); ++j) {
    const bool there =
        std::any_of(rows.begin(), rows.end(), [&](Index i) { return M(i, j) != 0.0; });
    if (there && out >= 0) return -1;
    if (there) out = j;
  }
  return out;
}

// G without the noise that Q says is none.
MatrixXd noise_gains(const LinearModel& model, const MatrixXd& G) {
  MatrixXd out = G;
  const ParametrisedMatrix& Q = model.Q;
  for (Index j = 0; j < out.cols(); ++j) {
    const auto here = [j](const auto& e) { return e.row == j && e.col == j; };
    const bool any = Q.block >= 0 || Q.constant(j, j) != 0.0 ||
                     std::any_of(Q.entries.begin(), Q.entries.end(), here) ||
                     std::any_of(Q.formulas.begin(), Q.formulas.end(), here);
    if (!any) out.col(j).setZero();
  }
  return out;
}

// Do other states see of the group what its only output does, but for a factor?
bool is_seen_alike(const StateSpace& m, const Group& group) {
  if (group.output < 0) return false;
  const Eigen::RowVectorXd seen = m.C(group.output, group.states);
  for (Index i = 0; i < m.states(); ++i) {
    if (std::find(group.states.begin(), group.states.end(), i) != group.states.end()) continue;
    const Eigen::RowVectorXd row = m.A(i, group.states);
    const double share = row.dot(seen) / seen.squaredNorm();
    if ((row - share * seen).cwiseAbs().maxCoeff() > kSame) return false;
  }
  return true;
}

Polynomials polynomials_of(const StateSpace& m, const Group& group) {
  const MatrixXd A = m.A(group.states, group.states);
  Polynomials out{characteristic(A), std::nullopt};
  if (group.output < 0 || group.noise < 0) return out;
  const Index n = A.rows();
  VectorXd response(n), x = m.G(group.states, group.noise);
  const VectorXd c = m.C(group.output, group.states).transpose();
  for (Index k = 0; k < n; ++k, x = (A * x).eval()) response[k] = c.dot(x);
  VectorXd numerator = VectorXd::Zero(n);
  for (Index k = 0; k < n; ++k) {
    for (Index j = 0; j <= k; ++j) numerator[k] += out.denominator[j] * response[k - j];
  }
  out.numerator = numerator;
  return out;
}

// a / b as a series of z, with as many terms; nothing where b begins with zero.
std::optional<VectorXd> ratio(const VectorXd& a, const VectorXd& b) {
  if (b.size() == 0 || std::abs(b[0]) < kSame) return std::nullopt;
  VectorXd out(a.size());
  for (Index k = 0; k < a.size(); ++k) {
    double sum = a[k];
    for (Index j = 1; j <= k; ++j) sum -= b[j] * out[k - j];
    out[k] = sum / b[0];
  }
  return out;
}

// What a factor is at values of its parameters.
VectorXd expanded(const PolynomialFactor& factor, const VectorXd& theta, Index terms) {
  VectorXd out = VectorXd::Zero(terms);
  out[0] = 1.0;
  for (Index k = 0; k < theta.size(); ++k) {
    const Index at = (k + 1) * factor.lag;
    if (at < terms) out[at] = -factor.sign[k] * theta[k];
  }
  return out;
}

VectorXd truncated_product(const VectorXd& a, const VectorXd& b) {
  VectorXd out = VectorXd::Zero(a.size());
  for (Index i = 0; i < out.size(); ++i) {
    for (Index j = 0; j <= i; ++j) out[i] += a[i - j] * b[j];
  }
  return out;
}

// Lags and signs of parameters that make up one polynomial.
struct Term {
  std::size_t candidate;
  Index lag;
  double sign;
};

PolynomialFactor factor_of(const std::vector<Term>& terms, int lag, bool moving_average,
                           const std::vector<Candidate>& all) {
  PolynomialFactor out;
  out.lag = lag;
  out.moving_average = moving_average;
  out.sign.resize(static_cast<Index>(terms.size()));
  for (std::size_t k = 0; k < terms.size(); ++k) {
    out.parameters.push_back(all[terms[k].candidate].parameter);
    out.sign[static_cast<Index>(k)] = terms[k].sign;
  }
  return out;
}

// Terms split into the powers 1 .. p of one step and those of a season; nothing where a power is
// missing. Of two with the same lag the first is taken for a power of one step.
std::optional<std::vector<std::vector<Term>>> split(const std::vector<Term>& terms, Index p) {
  std::vector<std::vector<Term>> out(2);
  for (const Term& term : terms) {
    const bool next =
        static_cast<Index>(out[0].size()) < p && term.lag == static_cast<Index>(out[0].size()) + 1;
    out[next ? 0 : 1].push_back(term);
  }
  if (static_cast<Index>(out[0].size()) < p) return std::nullopt;
  if (out[1].empty()) return out;
  const Index season = out[1].front().lag;
  for (std::size_t k = 0; k < out[1].size(); ++k) {
    if (season < 2 || out[1][k].lag != static_cast<Index>(k + 1) * season) return std::nullopt;
  }
  return out;
}

// Orders of the terms by lag: two of the same lag either way.
std::vector<std::vector<Term>> orders(std::vector<Term> terms) {
  std::stable_sort(terms.begin(), terms.end(),
                   [](const Term& a, const Term& b) { return a.lag < b.lag; });
  std::vector<std::vector<Term>> out = {terms};
  for (std::size_t k = 1; k < terms.size(); ++k) {
    if (terms[k].lag != terms[k - 1].lag) continue;
    const std::size_t known = out.size();
    for (std::size_t q = 0; q < known; ++q) {
      out.push_back(out[q]);
      std::swap(out.back()[k - 1], out.back()[k]);
    }
  }
  return out;
}

// What the recognition looks at: one polynomial of one group of states.
struct Recognition {
  const std::vector<Candidate>& candidates;
  const Group& group;
  bool moving_average;
  Polynomials at_zero;

  std::optional<VectorXd> ratio_at(const StateSpace& m) const {
    const Polynomials there = polynomials_of(m, group);
    if (!moving_average) return ratio(there.denominator, at_zero.denominator);
    if (!there.numerator || !at_zero.numerator) return std::nullopt;
    return ratio(*there.numerator, *at_zero.numerator);
  }
};

// The term that a parameter alone makes; nothing where it makes none, or several.
std::optional<Term> term_of(const Recognition& of, const Values& values, std::size_t candidate) {
  VectorXd alone = VectorXd::Zero(static_cast<Index>(of.candidates.size()));
  constexpr double kStep = 0.5;
  alone[static_cast<Index>(candidate)] = kStep;
  const std::optional<VectorXd> moved = of.ratio_at(values.at(alone));
  if (!moved) return std::nullopt;
  std::optional<Term> out;
  for (Index k = 1; k < moved->size(); ++k) {
    if (std::abs((*moved)[k]) < kSame) continue;
    if (out || std::abs(std::abs((*moved)[k]) - kStep) > kSame) return std::nullopt;
    out = Term{candidate, k, (*moved)[k] < 0.0 ? 1.0 : -1.0};
  }
  return out;
}

// Values of all candidates that nothing follows from by chance.
VectorXd arbitrary(std::size_t count, double phase) {
  VectorXd out(static_cast<Index>(count));
  for (Index i = 0; i < out.size(); ++i)
    out[i] = 0.4 * std::sin(phase + 1.7 * static_cast<double>(i));
  return out;
}

// Is the product of factors what the model has, at arbitrary values?
bool is_product(const Recognition& of, const Values& values,
                const std::vector<PolynomialFactor>& factors) {
  for (const double phase : {0.3, 2.1}) {
    const VectorXd x = arbitrary(of.candidates.size(), phase);
    const std::optional<VectorXd> there = of.ratio_at(values.at(x));
    if (!there) return false;
    VectorXd product = VectorXd::Unit(there->size(), 0);
    for (const PolynomialFactor& factor : factors) {
      VectorXd theta(factor.sign.size());
      for (Index k = 0; k < theta.size(); ++k) {
        const int parameter = factor.parameters[static_cast<std::size_t>(k)];
        for (std::size_t c = 0; c < of.candidates.size(); ++c) {
          if (of.candidates[c].parameter == parameter) theta[k] = x[static_cast<Index>(c)];
        }
      }
      product = truncated_product(product, expanded(factor, theta, product.size()));
    }
    if (!((product - *there).cwiseAbs().maxCoeff() < kSame)) return false;
  }
  return true;
}

std::vector<PolynomialFactor> factors_of(const Recognition& of, const Values& values) {
  std::vector<Term> terms;
  for (std::size_t i = 0; i < of.candidates.size(); ++i) {
    if (of.candidates[i].moves_poles == of.moving_average) continue;
    if (const auto term = term_of(of, values, i)) terms.push_back(*term);
  }
  if (terms.empty()) return {};
  for (const std::vector<Term>& order : orders(terms)) {
    for (Index p = static_cast<Index>(terms.size()); p >= 0; --p) {
      const auto parts = split(order, p);
      if (!parts) continue;
      std::vector<PolynomialFactor> factors;
      for (const std::vector<Term>& part : *parts) {
        if (part.empty()) continue;
        factors.push_back(
            factor_of(part, static_cast<int>(part.front().lag), of.moving_average, of.candidates));
      }
      if (is_product(of, values, factors)) return factors;
    }
  }
  return {};
}

// Is the variance of that process noise free by itself?
bool is_free_variance(const LinearModel& model, const ParameterSet& parameters, Index noise) {
  if (model.Q.block >= 0) return !parameters[static_cast<std::size_t>(model.Q.block)].fixed;
  for (const ParametrisedMatrix::Entry& entry : model.Q.entries) {
    if (entry.row != noise || entry.col != noise) continue;
    const Parameter& p = parameters[static_cast<std::size_t>(entry.parameter)];
    return !p.fixed && p.min <= 0.0 && std::isinf(p.max) && p.prior.kind == Prior::Kind::none;
  }
  return false;
}

}  // namespace

std::vector<PolynomialFactor> polynomial_factors(const LinearModel& model,
                                                 const ParameterSet& parameters) {
  if (model.continuous || holds_moving(model)) return {};
  const std::vector<Candidate> all = candidates(model, parameters);
  if (all.empty()) return {};
  const Values values(model, parameters, all);
  const StateSpace generic = values.at(arbitrary(all.size(), 0.3));
  const StateSpace at_zero = values.at(VectorXd::Zero(static_cast<Index>(all.size())));
  const MatrixXd gains = noise_gains(model, generic.G);
  std::vector<PolynomialFactor> out;
  int number = 0;
  for (const std::vector<Index>& states : connected_states(generic.A, stationary_states(model))) {
    Group group{states, only_column(generic.C.transpose(), states), only_column(gains, states)};
    const Polynomials none = polynomials_of(at_zero, group);
    for (const bool moving_average : {false, true}) {
      if (moving_average && (!is_seen_alike(generic, group) || group.noise < 0 ||
                             !is_free_variance(model, parameters, group.noise))) {
        continue;
      }
      for (PolynomialFactor& found : factors_of({all, group, moving_average, none}, values)) {
        found.group = number;
        out.push_back(std::move(found));
      }
    }
    ++number;
  }
  return out;
}

}  // namespace identikal
