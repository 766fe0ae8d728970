#include "identify/handling/internal/steady_turns.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kSecond = 1.0;
constexpr double kChange = 0.3;            // of vx r [m/s^3]
constexpr double kSpeedChange = 1.0;       // [m/s^2]
constexpr std::size_t kFewestSeconds = 8;  // seconds
constexpr double kLeastRange = 1.0;        // of vx r [m/s^2]

/// Means of both halves of a segment of rows.
struct Halves {
  double first = kNone, second = kNone;
  double mean() const { return 0.5 * (first + second); }
  double change() const { return second - first; }
};

double mean_of(const VectorXd& x, Index from, Index to) {
  double sum = 0.0, n = 0.0;
  for (Index t = from; t < to; ++t) {
    if (std::isnan(x[t])) continue;
    sum += x[t];
    n += 1.0;
  }
  return sum / n;
}

Halves halves_of(const VectorXd& x, Index first, Index rows) {
  const Index middle = first + rows / 2;
  return {mean_of(x, first, middle), mean_of(x, middle, first + rows)};
}

double rms(const VectorXd& x) {
  double squares = 0.0, n = 0.0;
  for (const double each : x) {
    if (std::isnan(each)) continue;
    squares += each * each;
    n += 1.0;
  }
  return std::sqrt(squares / n);
}

/// Of the mean of rows about a line through them.
double se_of_mean(const VectorXd& x, Index first, Index rows, const Halves& halves) {
  double squares = 0.0, n = 0.0;
  for (Index t = 0; t < rows; ++t) {
    if (std::isnan(x[first + t])) continue;
    const double share = (static_cast<double>(t) + 0.5) / static_cast<double>(rows) - 0.5;
    const double e = x[first + t] - halves.mean() - 2.0 * halves.change() * share;
    squares += e * e;
    n += 1.0;
  }
  return n > 2.0 ? std::sqrt(squares / (n * (n - 2.0))) : kNone;
}

SteadyLine line_of(const std::vector<SteadySecond>& seconds,
                   double (*y)(const SteadySecond&, double), double length) {
  constexpr double kOneSpeed = 1.2;
  const auto n = static_cast<Index>(seconds.size());
  VectorXd ay(n), values(n), slowness(n);
  for (Index i = 0; i < n; ++i) {
    ay[i] = seconds[i].ay();
    values[i] = y(seconds[i], length);
    slowness[i] = 1.0 / seconds[i].vx;
  }
  const bool one_speed = slowness.maxCoeff() < kOneSpeed * slowness.minCoeff();
  return steady_line(ay, values, one_speed ? VectorXd() : slowness);
}

/// f of the residuals, one after the other.
double integrated_autocorrelation(const VectorXd& e) {
  const Index n = e.size();
  const double squares = e.squaredNorm();
  double f = 1.0;
  if (!(squares > 0.0)) return f;
  for (Index lag = 1; lag < n / 3; ++lag) {
    const double rho = e.head(n - lag).dot(e.tail(n - lag)) / squares;
    // White residuals have some positive lag by chance.
    if (rho <= 1.0 / std::sqrt(static_cast<double>(n))) break;
    f += 2.0 * rho;
  }
  return f;
}

}  // namespace

std::vector<SteadySecond> steady_seconds(const DriveSignals& s, const SingleTrack<>& car) {
  std::vector<SteadySecond> out;
  const VectorXd ay = s.vx.cwiseProduct(s.r);
  const VectorXd angle = s.steering.array() + car.steering_offset;
  // What the steering may change: as much of its size as vx r of its own.
  const double angle_per_ay = rms(angle) / rms(ay);
  const Index rows = std::max<Index>(4, std::lround(kSecond / s.step));
  const double halfway = 0.5 * static_cast<double>(rows) * s.step;
  for (const VehicleRun::Segment& segment : s.segments) {
    for (Index first = segment.first; first + rows <= segment.first + segment.rows; first += rows) {
      const Halves a = halves_of(ay, first, rows), delta = halves_of(angle, first, rows),
                   vx = halves_of(s.vx, first, rows), r = halves_of(s.r, first, rows);
      if (!(std::abs(a.change()) <= kChange * halfway) ||
          !(std::abs(delta.change()) <= kChange * halfway * angle_per_ay) ||
          !(std::abs(vx.change()) <= kSpeedChange * halfway)) {
        continue;
      }
      SteadySecond second{};
      second.steering = delta.mean();
      second.angle = car.steering_gain * delta.mean() / car.steering_ratio;
      second.vx = vx.mean();
      second.r = r.mean();
      second.beta = halves_of(s.beta, first, rows).mean();
      second.ay_se = se_of_mean(ay, first, rows, a);
      out.push_back(second);
    }
  }
  return out;
}

SteadyLine steady_line(const VectorXd& x, const VectorXd& y, const VectorXd& aside) {
  const Index terms = aside.size() > 0 ? 3 : 2;
  const auto n = static_cast<double>(x.size());
  SteadyLine out;
  if (x.size() <= terms || x.maxCoeff() == x.minCoeff()) return out;
  Eigen::MatrixXd X(x.size(), terms);
  X.col(0).setOnes();
  X.col(1) = x;
  if (terms > 2) X.col(2) = (aside.array() - aside.mean()) / (aside.maxCoeff() - aside.minCoeff());
  const Eigen::MatrixXd inverse =
      (X.transpose() * X).ldlt().solve(Eigen::MatrixXd::Identity(terms, terms));
  const VectorXd theta = inverse * (X.transpose() * y);
  out.offset = theta[0];
  out.slope = theta[1];
  const VectorXd e = y - X * theta;
  out.correlation = integrated_autocorrelation(e);
  out.freedom = std::max(1.0, n / out.correlation - static_cast<double>(terms));
  out.sd = std::sqrt(e.squaredNorm() / (n - static_cast<double>(terms)));
  out.slope_se = std::sqrt(e.squaredNorm() / out.freedom * inverse(1, 1));
  return out;
}

std::string too_little_turning(const std::vector<SteadySecond>& seconds) {
  if (seconds.size() < kFewestSeconds) {
    return "The log holds less than eight seconds of quasi-steady driving up to 4 m/s^2.";
  }
  double low = kInfinity, high = -kInfinity;
  for (const SteadySecond& second : seconds) {
    low = std::min(low, second.ay());
    high = std::max(high, second.ay());
  }
  if (high - low >= kLeastRange) return "";
  return "The quasi-steady part of the log spans less than 1 m/s^2 of lateral acceleration.";
}

std::vector<SteadySecond> linear_seconds(const std::vector<SteadySecond>& seconds) {
  std::vector<SteadySecond> out;
  for (const SteadySecond& second : seconds) {
    if (std::abs(second.ay()) <= kLinearAcceleration) out.push_back(second);
  }
  return out;
}

SteadyLine understeer_line(const std::vector<SteadySecond>& seconds, double wheelbase) {
  return line_of(
      seconds, [](const SteadySecond& s, double L) { return s.angle - L * s.r / s.vx; }, wheelbase);
}

SteadyLine sideslip_line(const std::vector<SteadySecond>& seconds, double b) {
  return line_of(
      seconds, [](const SteadySecond& s, double l) { return s.beta - l * s.r / s.vx; }, b);
}

}  // namespace identikal
