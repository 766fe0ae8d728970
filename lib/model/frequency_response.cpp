#include "lib/model/frequency_response.h"

#include <complex>

#include <Eigen/LU>

#include "lib/base/message.h"

namespace identikal {

Eigen::MatrixXcd state_response(const Eigen::MatrixXd& A, double omega, const Eigen::MatrixXd& B) {
  using Complex = std::complex<double>;
  using Eigen::MatrixXcd;
  const Eigen::Index n = A.rows();
  require_argument(A.cols() == n && B.rows() == n, {"state_response: A is ", n, " x ", A.cols(),
                                                    ", B is ", B.rows(), " x ", B.cols()});
  const MatrixXcd F = A.cast<Complex>();
  const MatrixXcd sources = B.cast<Complex>();
  return (std::polar(1.0, omega) * MatrixXcd::Identity(n, n) - F).partialPivLu().solve(sources);
}

}  // namespace identikal
