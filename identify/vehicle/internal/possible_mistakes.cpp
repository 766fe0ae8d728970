#include "identify/vehicle/internal/possible_mistakes.h"

#include <algorithm>

#include <fmt/format.h>

namespace identikal {
namespace {

class Mistakes {
 public:
  Mistakes(const VehicleProblem& problem, const StudyPoint& at,
           const std::vector<StudyUnknown>& unknowns, const Eigen::VectorXd& errors,
           const Eigen::MatrixXd& by_unknown)
      : problem_(problem), at_(at), unknowns_(unknowns), errors_(errors), by_unknown_(by_unknown) {
    add_change(kCf);
    add_change(kCr);
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

  /// Stiffer in the later half than in the earlier. What goes on across the middle is little.
  void add_change(VehicleParameter stiffness) {
    const Eigen::Index i = column(StudyUnknown::Kind::free, stiffness);
    if (i < 0) return;
    const Eigen::Index half = row_in_the_middle();
    Eigen::VectorXd by = 0.5 * at_.p[stiffness] * by_unknown_.col(i);
    for (Eigen::Index n = 0; n < by.size(); ++n) {
      if (problem_.row[static_cast<std::size_t>(n)] < half) by[n] = -by[n];
    }
    all.push_back({.name = fmt::format("change of {}", name_of(stiffness)),
                   .unit = "",
                   .usual = 0.02,
                   .sd = 0.2,
                   .of_car = true,
                   .separated_by = "fitting the halves of the recording one by one",
                   .by = std::move(by)});
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
  const StudyPoint& at_;
  const std::vector<StudyUnknown>& unknowns_;
  const Eigen::VectorXd& errors_;
  const Eigen::MatrixXd& by_unknown_;
};

}  // namespace

std::vector<PossibleMistake> possible_mistakes(const VehicleProblem& problem, const StudyPoint& at,
                                               const std::vector<StudyUnknown>& unknowns,
                                               const Eigen::VectorXd& errors,
                                               const Eigen::MatrixXd& by_unknown) {
  return Mistakes(problem, at, unknowns, errors, by_unknown).all;
}

}  // namespace identikal
