// The polynomial models of system identification, ARX to Box-Jenkins: what are they, and which innovation form is each?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/subspace/innovation_form.h"

namespace identikal {

/// A(q) y(t) = sum over inputs j of B_j(q)/F_j(q) u_j(t) + C(q)/D(q) e(t), for one output (Ljung 1999, eq (4.33)).
/// A = 1 + a_1 q^-1 + ..., and so C, D, F; B_j = q^-delay (b_0 + b_1 q^-1 + ...). The ones are not stored.
struct PolynomialModel {
  Eigen::VectorXd A, C, D;
  std::vector<Eigen::VectorXd> B, F;  ///< of every input
  std::vector<Eigen::Index> delay;    ///< of every input: rows, from 0

  Eigen::Index inputs() const { return static_cast<Eigen::Index>(B.size()); }
  Eigen::Index parameters() const;
  /// How many rows of outputs and inputs a prediction looks back.
  Eigen::Index rows_back() const;
};

/// Numbers of coefficients: ARX has na, nb; ARMAX na, nb, nc; output error nb, nf; Box-Jenkins nb, nc, nd, nf.
struct PolynomialOrders {
  Eigen::Index na = 0, nb = 0, nc = 0, nd = 0, nf = 0;
};

/// All coefficients zero.
/// @param delay  of every input: rows, from 0
/// @throws std::invalid_argument for a negative order or delay, or no coefficient at all
PolynomialModel polynomial_model(const PolynomialOrders& orders,
                                 const std::vector<Eigen::Index>& delay);

/// [A; B_1; ...; B_m; C; D; F_1; ...; F_m].
Eigen::VectorXd coefficients(const PolynomialModel& model);
/// The model of these coefficients. @throws std::invalid_argument for another number of them
PolynomialModel with_coefficients(PolynomialModel model, const Eigen::VectorXd& theta);

/// Zeros of q^n + a_1 q^(n-1) + ... + a_n: poles where it is a denominator.
Eigen::VectorXcd zeros_of(const Eigen::VectorXd& a);
/// The inverse: a_1 ... a_n. @param zeros  with the conjugate of each that is not real
Eigen::VectorXd with_zeros(const Eigen::VectorXcd& zeros);

/// x(t+1) = A x + B u + K e, y = C x + D u + e of several outputs that have the same inputs, block by block in observer form:
/// of each output first 1/A with what enters it directly, then each B_j/F_j, then C/D.
///
/// Example:
///
///     PolynomialModel oe = polynomial_model({.nb = 1, .nf = 1}, {1});
///     oe.B[0][0] = 0.5;
///     oe.F[0][0] = -0.9;  // y = 0.5 q^-1 / (1 - 0.9 q^-1) u + e
///     const InnovationForm states = innovation_form({oe}, Eigen::MatrixXd::Identity(1, 1));
///
/// @param sigma  of the innovations, outputs x outputs
/// @throws std::invalid_argument for no output, another size of sigma, or outputs with other inputs
InnovationForm innovation_form(const std::vector<PolynomialModel>& outputs,
                               const Eigen::MatrixXd& sigma);

/// The model without the states that no output shows: same outputs for any inputs and innovations.
InnovationForm observable_part(const InnovationForm& model);

}  // namespace identikal
