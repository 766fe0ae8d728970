#include "lib/model/sampled_model.h"

#include <cmath>
#include <map>
#include <stdexcept>

#include "lib/base/message.h"
#include "lib/model/internal/formula_values.h"
#include "lib/model/partly_diffuse.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// What an interval makes of A, B and noise at the parameters that are set.
struct Interval {
  bool is_set = false;
  StateSpace model;
  std::vector<StateSpace> derivatives;
};

// What it makes of them where A, B and G are numbers: the covariance is a sum of multiples of these,
// by the entries of Q.
struct KnownMotion {
  StateSpace model;
  std::vector<MatrixXd> covariance;
};

struct Entry {
  Index row, col;
};

// The entries of a covariance's lower triangle that may differ from zero.
std::vector<Entry> entries_of(const ParametrisedMatrix& matrix, Index size) {
  std::vector<Entry> out;
  const auto holds = [](const auto& all, Index i, Index j) {
    for (const auto& e : all) {
      if (e.row == i && e.col == j) return true;
    }
    return false;
  };
  for (Index i = 0; i < size; ++i) {
    for (Index j = 0; j <= i; ++j) {
      if (matrix.block >= 0 || matrix.constant(i, j) != 0.0 || holds(matrix.entries, i, j) ||
          holds(matrix.formulas, i, j)) {
        out.push_back({i, j});
      }
    }
  }
  return out;
}

bool is_number(const ParametrisedMatrix& matrix, const ParameterSet& parameters) {
  return is_known(matrix, parameters) && !moves(matrix);
}

MatrixXd covariance_of(const KnownMotion& motion, const std::vector<Entry>& entries,
                       const MatrixXd& Q) {
  MatrixXd out = MatrixXd::Zero(motion.model.A.rows(), motion.model.A.cols());
  for (std::size_t k = 0; k < entries.size(); ++k) {
    out += Q(entries[k].row, entries[k].col) * motion.covariance[k];
  }
  return out;
}

}  // namespace

struct SampledModel::Parts {
  Parts(const LinearModel& linear, const VectorXd& stamps, const MatrixXd& inputs)
      : model(linear), time(stamps), u(inputs) {
    if (u.rows() > 0 && u.cols() != time.size()) {
      throw std::invalid_argument(
          message({"sampled model: ", u.cols(), " samples of inputs and ", time.size(), " times"}));
    }
    find_intervals();
    any_moves = holds_moving(model);
    motion_moves = moves(model.A) || moves(model.B) || moves(model.G) || moves(model.Q);
  }

  const LinearModel& model;
  VectorXd time;
  MatrixXd u;
  std::vector<double> steps;             // distinct intervals
  std::vector<std::size_t> interval_of;  // per sample: which of them comes behind it
  bool any_moves = false;                // some matrix holds inputs or time
  bool motion_moves = false;             // A, B, G or Q does

  ParameterSet parameters;
  std::vector<EntryDerivative> by;
  bool with_derivatives = false;
  std::unique_ptr<FormulaValues> formulas;
  StateSpace written;  // at the sample last written
  std::vector<StateSpace> written_derivatives;
  std::vector<Interval> intervals;
  bool motion_is_sought = true;
  std::vector<KnownMotion> known_motion;  // per interval; empty where it does not apply
  std::vector<Entry> Q_entries;

  // Stamps that were written with 12 digits make equal intervals equal.
  void find_intervals() {
    constexpr double kEqual = 1e-11;  // of an interval
    std::map<long long, std::size_t> known;
    for (Index t = 0; t < time.size(); ++t) {
      const bool last = t + 1 == time.size();
      if (last && t > 0) {
        interval_of.push_back(interval_of.back());
        break;
      }
      const double step = model.irregular && !last ? time[t + 1] - time[t] : model.dt;
      if (!(step > 0.0)) {
        throw std::invalid_argument(
            message({"sampled model: sample ", t + 1, " is followed after ", step, " s"}));
      }
      const auto key = std::llround(std::log(step) / kEqual);
      const auto [place, is_new] = known.try_emplace(key, steps.size());
      if (is_new) steps.push_back(step);
      interval_of.push_back(place->second);
    }
  }

  void set(const ParameterSet& to, bool derivatives) {
    parameters = to;
    with_derivatives = derivatives;
    by = derivatives ? entry_derivatives(parameters) : std::vector<EntryDerivative>{};
    if (!formulas) {
      formulas = std::make_unique<FormulaValues>(model, parameters, derivatives);
    } else {
      formulas->set_parameters(parameters, derivatives);
    }
    intervals.assign(steps.size(), {});
    write();
    if (motion_is_sought) find_known_motion();
    motion_is_sought = false;
  }

  void write() {
    set_written(model, parameters, *formulas, written);
    written_derivatives.resize(by.size());
    for (std::size_t i = 0; i < by.size(); ++i) {
      set_written_derivative(model, parameters, *formulas, by[i], written_derivatives[i]);
    }
  }

  // Of another sample: matrices that hold neither inputs nor time have been written.
  void write_moving() {
    set_moving(model, parameters, *formulas, written);
    for (std::size_t i = 0; i < by.size(); ++i) {
      set_moving_derivative(model, parameters, *formulas, by[i], written_derivatives[i]);
    }
  }

  // Worth it where a density is estimated and the motion is not: nothing but sums is left.
  void find_known_motion() {
    constexpr double kMostNumbers = 2e7;
    if (!model.continuous || model.noise != ProcessNoise::density) return;
    if (!is_number(model.A, parameters) || !is_number(model.B, parameters) ||
        !is_number(model.G, parameters)) {
      return;
    }
    Q_entries = entries_of(model.Q, written.Q.rows());
    const auto numbers = static_cast<double>(steps.size() * Q_entries.size()) *
                         static_cast<double>(written.A.size());
    if (numbers > kMostNumbers) return;
    StateSpace unit = written;
    for (const double step : steps) {
      KnownMotion motion;
      unit.Q.setZero();
      motion.model = discretise(unit, model.noise, step, model.hold);
      for (const Entry& entry : Q_entries) {
        unit.Q(entry.row, entry.col) = unit.Q(entry.col, entry.row) = 1.0;
        motion.covariance.push_back(discretise(unit, model.noise, step, model.hold).Q);
        unit.Q.setZero();
      }
      known_motion.push_back(std::move(motion));
    }
  }

  void at(Index t, StateSpace& out, std::vector<StateSpace>* derivatives) {
    if (derivatives != nullptr && !with_derivatives) {
      throw std::invalid_argument("sampled model: derivatives were not asked for");
    }
    if (any_moves) {
      MovingValues here;
      if (u.rows() > 0) here.inputs = u.col(t);
      here.time = time[t];
      formulas->move_to(here);
      write_moving();
    }
    if (!model.continuous) {
      out = written;
      if (derivatives != nullptr) *derivatives = written_derivatives;
      return;
    }
    const std::size_t interval = interval_of[static_cast<std::size_t>(t)];
    if (!known_motion.empty()) {
      take_known_motion(known_motion[interval], out, derivatives);
    } else {
      take_interval(interval, out, derivatives);
    }
  }

  void take_known_motion(const KnownMotion& motion, StateSpace& out,
                         std::vector<StateSpace>* derivatives) const {
    out = motion.model;
    out.Q = covariance_of(motion, Q_entries, written.Q);
    set_measurement(written, out);
    if (derivatives == nullptr) return;
    derivatives->resize(by.size());
    for (std::size_t i = 0; i < by.size(); ++i) {
      StateSpace& d = (*derivatives)[i];
      d = motion.model;
      for (MatrixXd* fixed : {&d.A, &d.B, &d.G}) fixed->setZero();
      d.Q = covariance_of(motion, Q_entries, written_derivatives[i].Q);
      set_measurement(written_derivatives[i], d);
    }
  }

  void take_interval(std::size_t interval, StateSpace& out, std::vector<StateSpace>* derivatives) {
    Interval& known = intervals[interval];
    if (motion_moves || !known.is_set) {
      discretise(written, written_derivatives, model.noise, steps[interval], model.hold,
                 known.model, known.derivatives);
      known.is_set = true;
    }
    out = known.model;
    set_measurement(written, out);
    if (derivatives == nullptr) return;
    *derivatives = known.derivatives;
    for (std::size_t i = 0; i < by.size(); ++i) {
      set_measurement(written_derivatives[i], (*derivatives)[i]);
    }
  }

  // What no interval changes: C, D, R, the start, and S beside noise per sample.
  void set_measurement(const StateSpace& from, StateSpace& out) const {
    out.C = from.C;
    out.D.leftCols(from.D.cols()) = from.D;
    out.R = from.R;
    out.x0 = from.x0;
    out.P0 = from.P0;
    if (model.noise == ProcessNoise::per_sample) out.S = from.S;
  }
};

SampledModel::SampledModel(const LinearModel& model, const VectorXd& time, const MatrixXd& u)
    : parts_(std::make_unique<Parts>(model, time, u)) {}
SampledModel::~SampledModel() = default;
SampledModel::SampledModel(SampledModel&&) noexcept = default;

void SampledModel::set_parameters(const ParameterSet& parameters, bool with_derivatives) {
  parts_->set(parameters, with_derivatives);
}

bool SampledModel::motion_changes() const {
  return parts_->motion_moves || moves(parts_->model.S) || parts_->steps.size() > 1;
}

void SampledModel::at(Index t, StateSpace& out, std::vector<StateSpace>* derivatives) {
  parts_->at(t, out, derivatives);
  if (t == 0 && parts_->model.initial == InitialState::partly_diffuse) {
    set_partly_diffuse_start(parts_->model, out, derivatives);
  }
}

}  // namespace identikal
