#include "identify/vehicle/internal/possible_mistakes.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace identikal {
namespace {

constexpr double kPart = 1e-3;  // of a size, for differences
// Numbers of the model file: these mistakes are common, and what is known of them is the recording's.
constexpr double kOfTheModelFile = 0.5;

class Mistakes {
 public:
  Mistakes(const VehicleProblem& problem, SecondarySimulation& simulation, const StudyPoint& at,
           const std::vector<StudyUnknown>& unknowns, const Eigen::VectorXd& errors,
           const Eigen::MatrixXd& by_unknown)
      : problem_(problem),
        simulation_(simulation),
        at_(at),
        unknowns_(unknowns),
        errors_(errors),
        by_unknown_(by_unknown) {
    add_changes();
    add_exchanged_axles();
    add_speed();
    add_place_of_vy();
    for (std::size_t j = 0; j < problem.run->outputs.size(); ++j) add_sensor(j);
  }

  std::vector<PossibleMistake> all;

 private:
  Eigen::Index column(StudyUnknown::Kind kind, int index) const {
    for (std::size_t i = 0; i < unknowns_.size(); ++i) {
      if (unknowns_[i].kind == kind && unknowns_[i].index == index) {
        return static_cast<Eigen::Index>(i);
      }
    }
    return -1;
  }

  void add_lag(SecondaryEffect effect) {
    const Eigen::Index i = column(StudyUnknown::Kind::effect, effect);
    if (i < 0) return;
    const StudyUnknown& unknown = unknowns_[static_cast<std::size_t>(i)];
    all.push_back({.name = name_of(unknown),
                   .unit = unknown.unit,
                   .usual = 0.0,
                   .sd = 0.05,
                   .positive = true,
                   .separated_by = unknown.separated_by,
                   .by = by_unknown_.col(i)});
  }

  /// Tyres, or load, which is a change of both stiffnesses the other way round.
  void add_changes() {
    const Eigen::VectorXd front = change(kCf), rear = change(kCr);
    if (front.size() > 0) add_change("Cf", front);
    if (rear.size() > 0) add_change("Cr", rear);
    if (front.size() > 0 && rear.size() > 0) add_change("Cf and Cr", front + rear);
  }

  /// Derivative by how much stiffer it is in the later half than in the earlier, relative; empty
  /// where it is not free. What goes on across the middle is little.
  Eigen::VectorXd change(VehicleParameter stiffness) const {
    const Eigen::Index i = column(StudyUnknown::Kind::free, stiffness);
    if (i < 0) return {};
    const Eigen::Index half = row_in_the_middle();
    Eigen::VectorXd by = 0.5 * at_.p[stiffness] * by_unknown_.col(i);
    for (Eigen::Index n = 0; n < by.size(); ++n) {
      if (problem_.row[static_cast<std::size_t>(n)] < half) by[n] = -by[n];
    }
    return by;
  }

  void add_change(const char* of, const Eigen::VectorXd& by) {
    all.push_back({.name = fmt::format("change of {}", of),
                   .unit = "",
                   .usual = 0.02,
                   .sd = 0.2,
                   .code = FindingCode::car_changes,
                   .separated_by = "fitting the halves of the recording one by one",
                   .by = by});
  }

  /// The centre of gravity just where the other axle distance puts it.
  void add_exchanged_axles() {
    if (problem_.unknowns.find(kA) >= 0 || problem_.unknowns.find(kB) >= 0) return;
    const double wheelbase = at_.p[kA] + at_.p[kB], step = kPart * wheelbase;
    const double behind = at_.p[kB] - at_.p[kA], sd = 0.005 * wheelbase;
    if (std::abs(behind) < 2.0 * sd) return;  // as good as the right ones
    StudyPoint other = at_;
    other.p[kA] += step;
    other.p[kB] -= step;
    all.push_back({.name = "centre of gravity, as if a and b were exchanged, off by",
                   .unit = "m",
                   .usual = sd,
                   .sd = sd,
                   .mean = behind,
                   .odds = kOfTheModelFile,
                   .code = FindingCode::structure_dependent,
                   .separated_by = "weighing the axles",
                   .by = (simulation_.errors(other) - errors_) / step});
  }

  void add_speed() {
    VehicleRun faster = *problem_.run;
    faster.vx *= 1.0 + kPart;
    VehicleProblem of_faster = problem_;
    of_faster.run = &faster;
    SecondarySimulation simulation(of_faster, problem_.unknowns.value[kSteeringDelay]);
    all.push_back({.name = "scale of the speed off by",
                   .unit = "",
                   .usual = 0.0,
                   .sd = 0.05,
                   .odds = kOfTheModelFile,
                   .may_be_a_car = true,
                   .separated_by = "GPS",
                   .by = (simulation.errors(at_) - errors_) / kPart});
  }

  void add_place_of_vy() {
    const Eigen::Index i = column(StudyUnknown::Kind::effect, kArmOfVy);
    if (i < 0) return;
    const StudyUnknown& unknown = unknowns_[static_cast<std::size_t>(i)];
    all.push_back({.name = name_of(unknown),
                   .unit = unknown.unit,
                   .usual = 0.0,
                   .sd = 0.3 * (at_.p[kA] + at_.p[kB]),
                   .odds = kOfTheModelFile,
                   .separated_by = unknown.separated_by,
                   .by = by_unknown_.col(i)});
  }

  Eigen::Index row_in_the_middle() const {
    return problem_.row[static_cast<std::size_t>(problem_.residuals() / 2)];
  }

  void add_sensor(std::size_t j) {
    const VehicleRun::Output& output = problem_.run->outputs[j];
    const VehicleQuantity quantity = output.sensor.quantity;
    if (problem_.unknowns.find(sensor_parameter(quantity, SensorProperty::delay)) < 0) {
      all.push_back({.name = "delay of " + output.name,
                     .unit = "s",
                     .usual = 0.002,
                     .sd = 0.1,
                     .separated_by = "sensors that are stamped by one clock",
                     .by = -rate(j)});
    }
    add_lag(filter_of(quantity));
  }

  /// Derivative with respect to time of what the model says of this output, zero in the rows of others.
  Eigen::VectorXd rate(std::size_t j) const {
    Eigen::VectorXd out = Eigen::VectorXd::Zero(errors_.size());
    const VehicleRun& run = *problem_.run;
    std::size_t n = 0;
    std::vector<Eigen::Index> of;
    for (const VehicleRun::Segment& segment : run.segments) {
      of.clear();
      for (; n < problem_.row.size() && problem_.row[n] < segment.first + segment.rows; ++n) {
        if (problem_.output[n] == static_cast<Eigen::Index>(j)) {
          of.push_back(static_cast<Eigen::Index>(n));
        }
      }
      for (std::size_t k = 0; of.size() > 1 && k < of.size(); ++k) {
        const Eigen::Index from = of[k == 0 ? 0 : k - 1], to = of[std::min(k + 1, of.size() - 1)];
        const auto time = [&](Eigen::Index at) {
          return run.time[problem_.row[static_cast<std::size_t>(at)]];
        };
        out[of[k]] = (errors_[to] + problem_.sample[to] - errors_[from] - problem_.sample[from]) /
                     (time(to) - time(from));
      }
    }
    return out;
  }

  const VehicleProblem& problem_;
  SecondarySimulation& simulation_;
  const StudyPoint& at_;
  const std::vector<StudyUnknown>& unknowns_;
  const Eigen::VectorXd& errors_;
  const Eigen::MatrixXd& by_unknown_;
};

}  // namespace

std::vector<PossibleMistake> possible_mistakes(const VehicleProblem& problem,
                                               SecondarySimulation& simulation,
                                               const StudyPoint& at,
                                               const std::vector<StudyUnknown>& unknowns,
                                               const Eigen::VectorXd& errors,
                                               const Eigen::MatrixXd& by_unknown) {
  return Mistakes(problem, simulation, at, unknowns, errors, by_unknown).all;
}

}  // namespace identikal
