// Which numbers do the entries of a model's matrices stand for, and their derivatives? Internal to
// the models.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/formula/tape.h"
#include "lib/model/linear_model.h"

namespace identikal {

/// Values of all formulas of a model at some parameters and some sample and, where requested, their
/// derivatives with respect to the parameters. Keeps a reference to the model.
class FormulaValues {
 public:
  FormulaValues(const LinearModel& model, const ParameterSet& parameters, bool with_jacobian);

  void set_parameters(const ParameterSet& parameters, bool with_jacobian);
  /// The formulas of inputs and time from here on; those of parameters alone keep their values.
  void move_to(const MovingValues& sample);

  double at(const ParametrisedMatrix::Formula& f) const { return value_[f.tape][f.value]; }
  double by(const ParametrisedMatrix::Formula& f, int parameter) const;

 private:
  void evaluate(std::size_t tape);

  const LinearModel& model_;
  bool with_jacobian_ = false;
  std::vector<TapeMemory> memory_;
  std::vector<std::vector<double>> value_, slope_;  // per tape; jacobian row by row
};

/// @throws std::invalid_argument for an entry outside of the matrix or of the parameters
void set_value(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
               const FormulaValues& formulas, Eigen::MatrixXd& out);
void set_value(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
               const FormulaValues& formulas, Eigen::VectorXd& out);

/// By one free entry of the parameters.
void set_derivative(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
                    const FormulaValues& formulas, const EntryDerivative& by, Eigen::MatrixXd& out);
void set_derivative(const ParametrisedMatrix& matrix, const ParameterSet& parameters,
                    const FormulaValues& formulas, const EntryDerivative& by, Eigen::VectorXd& out);

/// All matrices as the model has them, and their derivatives.
void set_written(const LinearModel& model, const ParameterSet& parameters,
                 const FormulaValues& formulas, StateSpace& out);
void set_written_derivative(const LinearModel& model, const ParameterSet& parameters,
                            const FormulaValues& formulas, const EntryDerivative& by,
                            StateSpace& out);

/// The same of the matrices that hold inputs or time; the others stay.
void set_moving(const LinearModel& model, const ParameterSet& parameters,
                const FormulaValues& formulas, StateSpace& out);
void set_moving_derivative(const LinearModel& model, const ParameterSet& parameters,
                           const FormulaValues& formulas, const EntryDerivative& by,
                           StateSpace& out);

}  // namespace identikal
