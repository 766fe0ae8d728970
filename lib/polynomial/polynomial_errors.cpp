#include "lib/polynomial/polynomial_errors.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/QR>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;

namespace {

// The last values of a signal and their slopes: before(1) is that of the row before.
class Past {
 public:
  Past(Index rows, Index unknowns, bool with_slopes)
      : values_(VectorXd::Zero(rows)),
        slopes_(MatrixXd::Zero(with_slopes ? unknowns : 0, with_slopes ? rows : 0)) {}
  double before(Index k) const { return values_[place(k)]; }
  auto slope_before(Index k) const { return slopes_.col(place(k)); }
  void set_before(Index k, double value) { values_[place(k)] = value; }
  auto slope_before(Index k) { return slopes_.col(place(k)); }
  // The oldest gives way.
  void push(double value, const VectorXd& slope) {
    if (values_.size() == 0) return;
    newest_ = newest_ + 1 == values_.size() ? 0 : newest_ + 1;
    values_[newest_] = value;
    if (slopes_.cols() > 0) slopes_.col(newest_) = slope;
  }

 private:
  Index place(Index k) const {
    const Index at = newest_ - k + 1;
    return at < 0 ? at + values_.size() : at;
  }
  VectorXd values_;
  MatrixXd slopes_;
  Index newest_ = 0;
};

// Where each polynomial's coefficients begin among the unknowns.
struct Places {
  explicit Places(const PolynomialModel& model) {
    Index at = model.A.size();
    for (const VectorXd& each : model.B) B.push_back(at), at += each.size();
    C = at;
    D = C + model.C.size();
    at = D + model.D.size();
    for (const VectorXd& each : model.F) F.push_back(at), at += each.size();
    first = at;
  }
  std::vector<Index> B, F;
  Index C = 0, D = 0, first = 0;  // first: of the values before the recordings
};

Index before_each(const PolynomialModel& model) {
  Index count = 0;
  for (const VectorXd& each : model.F) count += each.size();
  return count;
}

// The recursion of one recording.
class Recursion {
 public:
  Recursion(const PolynomialModel& model, const VectorXd& unknowns, Index recording, bool slopes)
      : model_(model),
        places_(model),
        slopes_(slopes),
        y_(model.A.size(), unknowns.size(), slopes),
        v_(model.D.size(), unknowns.size(), slopes),
        e_(model.C.size(), unknowns.size(), slopes),
        slope_(VectorXd::Zero(unknowns.size())),
        of_w_(slope_),
        of_sum_(slope_),
        of_own_(slope_),
        of_noise_(slope_) {
    Index at = places_.first + recording * before_each(model);
    for (const VectorXd& F : model.F) {
      w_.emplace_back(F.size(), unknowns.size(), slopes);
      for (Index k = 1; k <= F.size(); ++k, ++at) {
        w_.back().set_before(k, unknowns[at]);
        if (slopes) w_.back().slope_before(k)[at] = 1.0;
      }
    }
  }
  void begin_after(double y) { y_.push(y, VectorXd::Zero(slope_.size())); }
  // @return what is left; not a number where the output is missing
  double step(const RowVectorXd& y, const MatrixXd& u, Index t) {
    const double driven = transfer(u, t), own = autoregression(), noise = coloured();
    if (slopes_) slope_ = of_sum_ + of_noise_ - of_own_;
    const double predicted = driven + noise - own, measured = y[t];
    const bool missing = !std::isfinite(measured);
    const double e = missing ? 0.0 : measured - predicted;
    if (slopes_ && missing) {
      y_.push(predicted, slope_);
      v_.push(noise, of_noise_);
      e_.push(0.0, of_w_.setZero());
    } else {
      slope_ = -slope_;
      y_.push(missing ? predicted : measured, of_w_.setZero());
      if (slopes_) of_own_ -= of_sum_;
      v_.push(e + noise, of_own_);
      e_.push(e, slope_);
    }
    return missing ? std::numeric_limits<double>::quiet_NaN() : e;
  }
  const VectorXd& slope() const { return slope_; }  // of what is left

 private:
  // The sum of w_j = B_j/F_j u_j.
  double transfer(const MatrixXd& u, Index t) {
    double sum = 0.0;
    if (slopes_) of_sum_.setZero();
    for (std::size_t j = 0; j < w_.size(); ++j) {
      const VectorXd &B = model_.B[j], &F = model_.F[j];
      const auto row = static_cast<Index>(j);
      double w = 0.0;
      if (slopes_) of_w_.setZero();
      for (Index k = 0; k < B.size(); ++k) {
        const double now = u(row, t - model_.delay[j] - k);
        w += B[k] * now;
        if (slopes_) of_w_[places_.B[j] + k] = now;
      }
      for (Index k = 1; k <= F.size(); ++k) {
        w -= F[k - 1] * w_[j].before(k);
        if (!slopes_) continue;
        of_w_ -= F[k - 1] * w_[j].slope_before(k);
        of_w_[places_.F[j] + k - 1] -= w_[j].before(k);
      }
      w_[j].push(w, of_w_);
      sum += w;
      if (slopes_) of_sum_ += of_w_;
    }
    return sum;
  }
  // a_1 y(t-1) + ...
  double autoregression() {
    double sum = 0.0;
    if (slopes_) of_own_.setZero();
    for (Index k = 1; k <= model_.A.size(); ++k) {
      sum += model_.A[k - 1] * y_.before(k);
      if (!slopes_) continue;
      of_own_ += model_.A[k - 1] * y_.slope_before(k);
      of_own_[k - 1] += y_.before(k);
    }
    return sum;
  }
  // What C/D e is expected to be.
  double coloured() {
    double sum = 0.0;
    if (slopes_) of_noise_.setZero();
    for (Index k = 1; k <= model_.C.size(); ++k) {
      sum += model_.C[k - 1] * e_.before(k);
      if (!slopes_) continue;
      of_noise_ += model_.C[k - 1] * e_.slope_before(k);
      of_noise_[places_.C + k - 1] += e_.before(k);
    }
    for (Index k = 1; k <= model_.D.size(); ++k) {
      sum -= model_.D[k - 1] * v_.before(k);
      if (!slopes_) continue;
      of_noise_ -= model_.D[k - 1] * v_.slope_before(k);
      of_noise_[places_.D + k - 1] -= v_.before(k);
    }
    return sum;
  }

  const PolynomialModel& model_;
  const Places places_;
  const bool slopes_;
  std::vector<Past> w_;
  Past y_, v_, e_;
  VectorXd slope_, of_w_, of_sum_, of_own_, of_noise_;
};

// The first row with a known past: -1 for none.
Index first_row(const PolynomialModel& model, const RowVectorXd& y) {
  const Index own = model.A.size();
  for (Index t = model.rows_back(); t < y.size(); ++t) {
    if (y.segment(t - own, own).allFinite()) return t;
  }
  return -1;
}

// Rows below each other, with an upper triangle in place of those that came before.
class Triangle {
 public:
  explicit Triangle(Index columns) : rows_(MatrixXd::Zero(columns + kBlock, columns)) {}
  void take(const VectorXd& slope, double e) {
    const Index row = rows_.cols() + filled_;
    rows_.row(row).head(slope.size()) = slope.transpose();
    rows_(row, slope.size()) = e;
    if (++filled_ == kBlock) fold();
  }
  MatrixXd result() {
    if (filled_ > 0) fold();
    return rows_.topRows(rows_.cols());
  }

 private:
  void fold() {
    qr_.compute(rows_);
    const Index n = rows_.cols();
    rows_.setZero();
    rows_.topRows(n).triangularView<Eigen::Upper>() = qr_.matrixQR().topRows(n);
    filled_ = 0;
  }
  static constexpr Index kBlock = 256;
  MatrixXd rows_;
  Eigen::HouseholderQR<MatrixXd> qr_;
  Index filled_ = 0;
};

}  // namespace

PolynomialErrors::PolynomialErrors(std::vector<RowVectorXd> y, std::vector<MatrixXd> u)
    : y_(std::move(y)), u_(std::move(u)) {
  if (y_.empty() || y_.size() != u_.size())
    throw std::invalid_argument("PolynomialErrors: as many recordings of y as of u, at least one");
  for (std::size_t k = 0; k < y_.size(); ++k) {
    if (y_[k].size() != u_[k].cols() || u_[k].rows() != u_[0].rows())
      throw std::invalid_argument("PolynomialErrors: y and u of a recording have the same rows");
  }
}

VectorXd PolynomialErrors::start(const PolynomialModel& model) const {
  const VectorXd theta = coefficients(model);
  VectorXd out = VectorXd::Zero(theta.size() + static_cast<Index>(y_.size()) * before_each(model));
  out.head(theta.size()) = theta;
  return out;
}

Index PolynomialErrors::rows(const PolynomialModel& model) const {
  Index count = 0;
  for (const RowVectorXd& y : y_) {
    const Index first = first_row(model, y);
    if (first >= 0) count += y.tail(y.size() - first).array().isFinite().count();
  }
  return count;
}

// take(slopes of what is left, what is left) of every measured row.
template <typename Take>
bool PolynomialErrors::run(const PolynomialModel& model, const VectorXd& unknowns, bool with_slopes,
                           const Take& take) const {
  const PolynomialModel here = with_coefficients(model, unknowns.head(model.parameters()));
  for (std::size_t k = 0; k < y_.size(); ++k) {
    const Index first = first_row(here, y_[k]);
    if (first < 0) continue;
    Recursion recursion(here, unknowns, static_cast<Index>(k), with_slopes);
    for (Index t = first - here.A.size(); t < first; ++t) recursion.begin_after(y_[k][t]);
    for (Index t = first; t < y_[k].size(); ++t) {
      const double e = recursion.step(y_[k], u_[k], t);
      if (std::isnan(e) && std::isfinite(y_[k][t])) return false;
      constexpr double kOverflow = 1e100;
      if (std::isnan(e)) continue;
      if (!(std::abs(e) < kOverflow)) return false;
      take(recursion.slope(), e);
    }
  }
  return true;
}

double PolynomialErrors::sum_of_squares(const PolynomialModel& model,
                                        const VectorXd& unknowns) const {
  double sum = 0.0;
  const bool finite = run(model, unknowns, false, [&](const VectorXd&, double e) { sum += e * e; });
  return finite ? sum : std::numeric_limits<double>::infinity();
}

bool PolynomialErrors::evaluate(const PolynomialModel& model, const VectorXd& unknowns,
                                MatrixXd& R) const {
  Triangle triangle(unknowns.size() + 1);
  if (!run(model, unknowns, true,
           [&](const VectorXd& slope, double e) { triangle.take(slope, e); }))
    return false;
  R = triangle.result();
  return R.allFinite();
}

PolynomialErrors::Rows PolynomialErrors::in_rows(const PolynomialModel& model,
                                                 const VectorXd& unknowns) const {
  Rows out;
  const Index count = rows(model), p = model.parameters();
  out.e.resize(count);
  out.slopes.resize(count, p);
  Index at = 0;
  run(model, unknowns, true, [&](const VectorXd& slope, double e) {
    out.e[at] = e;
    out.slopes.row(at++) = slope.head(p).transpose();
  });
  out.e.conservativeResize(at);
  out.slopes.conservativeResize(at, p);
  return out;
}

}  // namespace identikal
