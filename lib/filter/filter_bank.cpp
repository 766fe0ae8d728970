#include "lib/filter/filter_bank.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "lib/filter/internal/bank_kernel.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Calls visit(element, row, column) for the lower triangle by columns.
template <class Visit>
void for_lower(Index n, const Visit& visit) {
  std::size_t element = 0;
  for (Index j = 0; j < n; ++j) {
    for (Index i = j; i < n; ++i) visit(element++, i, j);
  }
}

std::size_t triangle(Index n) { return static_cast<std::size_t>(n * (n + 1) / 2); }

}  // namespace

FilterBank filter_bank(const StateSpace& shared, Index members) {
  if (members < 1) throw std::invalid_argument("filter_bank: no member");
  FilterBank bank;
  bank.A = shared.A;
  bank.B = shared.B;
  bank.C = shared.C;
  bank.D = shared.D;
  bank.members = members;
  const std::size_t width = simd::bank_width();
  bank.lanes = (static_cast<std::size_t>(members) + width - 1) / width * width;
  const auto n = static_cast<std::size_t>(bank.states());
  const auto r = static_cast<std::size_t>(bank.outputs());
  bank.x.assign(n * bank.lanes, 0.0);
  bank.P.assign(triangle(bank.states()) * bank.lanes, 0.0);
  bank.GQG.assign(bank.P.size(), 0.0);
  bank.GS.assign(n * r * bank.lanes, 0.0);
  // Lanes without a member compute something finite.
  bank.R.assign(triangle(bank.outputs()) * bank.lanes, 0.0);
  for_lower(bank.outputs(), [&](std::size_t e, Index i, Index j) {
    if (i == j) std::fill_n(bank.R.begin() + static_cast<long>(e * bank.lanes), bank.lanes, 1.0);
  });
  bank.rest.resize(r);
  bank.C_present.resize(r * n);
  bank.drive.resize(n);
  bank.present.reserve(r);
  bank.log_density.assign(bank.lanes, 0.0);
  bank.scratch.assign(simd::bank_scratch(static_cast<int>(n), static_cast<int>(r)), 0.0);
  return bank;
}

void set_noise(FilterBank& bank, Index member, const StateSpace& noise) {
  const MatrixXd GQG = noise.G * noise.Q * noise.G.transpose(), GS = noise.G * noise.S;
  const auto lane = static_cast<std::size_t>(member);
  for_lower(bank.states(),
            [&](std::size_t e, Index i, Index j) { bank.GQG[e * bank.lanes + lane] = GQG(i, j); });
  for_lower(bank.outputs(), [&](std::size_t e, Index i, Index j) {
    bank.R[e * bank.lanes + lane] = noise.R(i, j);
  });
  for (Index e = 0; e < GS.size(); ++e) {
    bank.GS[static_cast<std::size_t>(e) * bank.lanes + lane] = GS.reshaped()[e];
  }
}

void set_state(FilterBank& bank, Index member, const Eigen::Ref<const VectorXd>& x,
               const Eigen::Ref<const MatrixXd>& P) {
  const auto lane = static_cast<std::size_t>(member);
  for (Index i = 0; i < x.size(); ++i)
    bank.x[static_cast<std::size_t>(i) * bank.lanes + lane] = x[i];
  for_lower(bank.states(),
            [&](std::size_t e, Index i, Index j) { bank.P[e * bank.lanes + lane] = P(i, j); });
}

void copy_member(const FilterBank& source, Index from, FilterBank& target, Index to) {
  const auto copy = [&](const FilterBank::Lanes& a, FilterBank::Lanes& b) {
    for (std::size_t e = 0; e < a.size() / source.lanes; ++e) {
      b[e * target.lanes + static_cast<std::size_t>(to)] =
          a[e * source.lanes + static_cast<std::size_t>(from)];
    }
  };
  copy(source.x, target.x);
  copy(source.P, target.P);
  copy(source.GQG, target.GQG);
  copy(source.GS, target.GS);
  copy(source.R, target.R);
}

void step(FilterBank& bank, const Eigen::Ref<const VectorXd>& y,
          const Eigen::Ref<const VectorXd>& u, Eigen::Ref<VectorXd> log_density) {
  const Index n = bank.states();
  bank.present.clear();
  for (Index j = 0; j < bank.outputs(); ++j) {
    if (!std::isnan(y[j])) bank.present.push_back(static_cast<int>(j));
  }
  const std::size_t r = bank.present.size();
  for (std::size_t a = 0; a < r; ++a) {
    const Index j = bank.present[a];
    bank.rest[a] = y[j] - (bank.D.cols() > 0 ? bank.D.row(j).dot(u) : 0.0);
    for (Index k = 0; k < n; ++k) {
      bank.C_present[static_cast<std::size_t>(k) * r + a] = bank.C(j, k);
    }
  }
  for (Index i = 0; i < n; ++i) {
    bank.drive[i] = bank.B.cols() > 0 ? bank.B.row(i).dot(u) : 0.0;
  }
  simd::BankStep one;
  one.states = static_cast<int>(n);
  one.outputs = static_cast<int>(bank.outputs());
  one.present = static_cast<int>(r);
  one.channel = bank.present.data();
  one.A = bank.A.data();
  one.C = bank.C_present.data();
  one.y = bank.rest.data();
  one.drive = bank.drive.data();
  one.lanes = bank.lanes;
  one.x = bank.x.data();
  one.P = bank.P.data();
  one.GQG = bank.GQG.data();
  one.GS = bank.GS.data();
  one.R = bank.R.data();
  one.log_density = bank.log_density.data();
  one.scratch = bank.scratch.data();
  simd::step_bank(one);
  log_density = Eigen::Map<const VectorXd>(bank.log_density.data(), bank.members);
}

void mixture(const FilterBank& bank, const Eigen::Ref<const VectorXd>& weight, Mixture& out) {
  const Index n = bank.states(), r = bank.outputs();
  out.x.setZero(n);
  out.P.setZero(n, n);
  out.R.setZero(r, r);
  out.away.resize(n);
  const auto element = [&bank](const FilterBank::Lanes& m, std::size_t e, Index i) {
    return m[e * bank.lanes + static_cast<std::size_t>(i)];
  };
  for (Index i = 0; i < bank.members; ++i) {
    if (weight[i] == 0.0) continue;
    for (Index k = 0; k < n; ++k) {
      out.x[k] += weight[i] * element(bank.x, static_cast<std::size_t>(k), i);
    }
  }
  for (Index i = 0; i < bank.members; ++i) {
    const double w = weight[i];
    if (w == 0.0) continue;
    for (Index k = 0; k < n; ++k) {
      out.away[k] = element(bank.x, static_cast<std::size_t>(k), i) - out.x[k];
    }
    for_lower(n, [&](std::size_t e, Index row, Index column) {
      out.P(row, column) += w * (element(bank.P, e, i) + out.away[row] * out.away[column]);
    });
    for_lower(r, [&](std::size_t e, Index row, Index column) {
      out.R(row, column) += w * element(bank.R, e, i);
    });
  }
  const auto mirror = [](MatrixXd& M) {
    return [&M](std::size_t, Index row, Index column) { M(column, row) = M(row, column); };
  };
  for_lower(n, mirror(out.P));
  for_lower(r, mirror(out.R));
}

Mixture mixture(const FilterBank& bank, const Eigen::Ref<const VectorXd>& weight) {
  Mixture out;
  mixture(bank, weight, out);
  return out;
}

}  // namespace identikal
