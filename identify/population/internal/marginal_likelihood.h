// How likely are recordings of units that are drawn from a population?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/population/mixed_effects.h"
#include "solvers/problem.h"

namespace identikal {

/// The likelihood of the data by shared coordinates and effects in the scale that they are normal in.
struct DataDerivatives {
  double value = 0.0;
  Eigen::VectorXd by_shared;             // p
  Eigen::MatrixXd by_effects;            // q x U
  Eigen::MatrixXd shared;                // p x p, Fisher information
  std::vector<Eigen::MatrixXd> effects;  // U of q x q
  std::vector<Eigen::MatrixXd>
      crossed;  // U, a row for each shared coordinate that concerns the unit
};

class DataOfUnits {
 public:
  explicit DataOfUnits(const MixedEffectsProblem& problem);

  /// The shared coordinates that concern a unit: those of all, and its own.
  const std::vector<Eigen::Index>& shared_of(Eigen::Index unit) const {
    return shared_by_unit_[static_cast<std::size_t>(unit)];
  }
  Eigen::VectorXd coordinates(const Eigen::VectorXd& theta, const Eigen::MatrixXd& B) const;
  /// @return false where it is undefined
  bool at(const Eigen::VectorXd& theta, const Eigen::MatrixXd& B, DataDerivatives& out);

 private:
  bool is_log(Eigen::Index j) const { return of_.logarithmic[static_cast<std::size_t>(j)]; }

  const MixedEffectsProblem& of_;
  std::vector<std::vector<Eigen::Index>> shared_by_unit_;
  Eigen::VectorXd gradient_;
  Eigen::MatrixXd information_;
};

/// How Omega is moved: by its variances, or by the entries of its root.
class SpreadCoordinates {
 public:
  SpreadCoordinates(const Eigen::VectorXd& start, bool correlated);

  Eigen::Index size() const { return correlated_ ? q_ * (q_ + 1) / 2 : q_; }
  Eigen::VectorXd start(const Eigen::VectorXd& sd) const;
  Eigen::VectorXd lower() const;
  Eigen::MatrixXd root(const Eigen::VectorXd& c) const;
  /// d root / d c
  std::vector<Eigen::MatrixXd> root_slopes(const Eigen::VectorXd& c) const;
  bool at_zero(const Eigen::VectorXd& c, Eigen::Index j) const;

 private:
  Eigen::Index q_;
  bool correlated_;
  Eigen::VectorXd smallest_;
};

/// The marginal likelihood by psi: theta, mu and what Omega is moved by (mixed_effects.h).
class MarginalLikelihood {
 public:
  /// @param problem  outlives it
  MarginalLikelihood(const MixedEffectsProblem& problem, const MixedEffectsStart& start);

  Eigen::Index size() const { return p_ + q_ + spread_.size(); }
  const SpreadCoordinates& spread() const { return spread_; }
  int evaluations() const { return evaluations_; }
  Eigen::VectorXd start(const MixedEffectsStart& from) const;
  /// Refers to this object.
  LikelihoodProblem problem();
  bool evaluate(const Eigen::VectorXd& psi, double& M, Eigen::VectorXd* gradient,
                Eigen::MatrixXd* information);

  /// After evaluate() with a gradient, the most probable effects and how they move with psi.
  Eigen::MatrixXd effects() const { return effects_at(Z_); }
  const Eigen::MatrixXd& standardised() const { return Z_; }
  const std::vector<Eigen::MatrixXd>& H() const { return H_; }
  /// By the coordinates that concern a unit, q x as many.
  const Eigen::MatrixXd& moves(Eigen::Index unit) const {
    return moves_[static_cast<std::size_t>(unit)];
  }
  std::vector<Eigen::Index> concerning(Eigen::Index unit) const;
  /// Of each shared coordinate; -1: of all.
  const std::vector<Eigen::Index>& unit_of_shared() const { return unit_of_shared_; }
  Eigen::MatrixXd conditional_covariance(Eigen::Index unit) const;
  Eigen::VectorXd coordinates(const Eigen::VectorXd& psi) const {
    return data_.coordinates(psi.head(p_), effects());
  }

 private:
  // What the data's derivatives become along one direction, of all units at once: per unit the slope
  // of the gradient by its effects, and that of the information on them.
  struct Along {
    Eigen::MatrixXd gradient;                  // q x U
    std::vector<Eigen::MatrixXd> information;  // U of q x q
  };

  Eigen::MatrixXd effects_at(const Eigen::MatrixXd& Z) const { return (L_ * Z).colwise() + mu_; }
  bool data_at(const Eigen::VectorXd& theta, const Eigen::MatrixXd& B, DataDerivatives& out) {
    ++evaluations_;
    return data_.at(theta, B, out);
  }
  bool find_effects(const Eigen::VectorXd& psi);
  Eigen::MatrixXd curvature(const DataDerivatives& at, Eigen::Index unit) const;
  Eigen::MatrixXd expected_information() const;
  bool along(const Eigen::VectorXd& theta_above, const Eigen::VectorXd& theta_below,
             const Eigen::MatrixXd& above, const Eigen::MatrixXd& below,
             const Eigen::VectorXd& width, Along& out);
  bool along_shared(const std::vector<Eigen::Index>& turn, Along& out);
  bool along_effect(Eigen::Index j, Along& out);
  bool take_gradient(Eigen::VectorXd& out);
  void add_unit(Eigen::Index i, const std::vector<const Along*>& by_shared,
                const std::vector<Along>& by_effect, const std::vector<Eigen::MatrixXd>& slopes,
                Eigen::VectorXd& out);

  DataOfUnits data_;
  Eigen::VectorXd lower_, upper_;
  Eigen::Index p_, q_, U_;
  SpreadCoordinates spread_;
  std::vector<Eigen::Index> unit_of_shared_;
  Eigen::MatrixXd Z_;  // of the last point: where the next search begins
  Eigen::VectorXd theta_, mu_, c_;
  Eigen::MatrixXd L_;
  DataDerivatives here_;
  double value_ = 0.0;
  std::vector<Eigen::MatrixXd> H_, moves_;
  int evaluations_ = 0;
};

}  // namespace identikal
