// What does the likelihood of a long recording need of it? A few thousand numbers, however long it is.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "lib/model/linear_model.h"
#include "lib/model/state_space.h"

namespace identikal {

/// Sufficient statistics of a recording without gaps, z = [y; u], for a filter with constant gain that
/// forgets within `lags` samples: its first and last samples and the sums
///
///   Gamma_m = sum_t z(t) z(t-m)',  m = 0 .. lags - 1.
///
/// From them log-likelihood, gradient and information follow as from the recording itself
/// (LikelihoodEngine::add_digest()), at a cost that does not depend on its length. Where outputs drift
/// away, z are the innovations of a nominal filter instead: then A, B, C and D cannot change.
struct RecordingDigest {
  Eigen::Index outputs = 0, inputs = 0;
  Eigen::Index samples = 0;  ///< N
  Eigen::VectorXd
      mean;  ///< outputs + inputs: taken out of z, whose last channel is 1 then; or empty
  Eigen::MatrixXd head, tail;  ///< channels x lags: the first and last samples of z
  std::vector<double> sums;    ///< lags of channels x channels, column by column

  /// Of the nominal filter x+ = A x + B u + K e, y = C x + D u + e.
  struct Nominal {
    Eigen::MatrixXd A, B, C, D, K;
    Eigen::VectorXd start, end;  ///< its states before and behind the recording
  };
  std::optional<Nominal> nominal;

  Eigen::Index lags() const { return head.cols(); }
};

/// The digest for this model, and for others with the same A, B, C and D where outputs drift.
/// @param y  ny x N, finite     @param u  nu x N, finite
/// @param lags  at least so many; the model's own filter asks for no fewer, and four times as many as
///   it needs are kept, for gains that are smaller
/// @throws std::invalid_argument for samples that are missing, another shape, a filter that has no
///   steady gain, and a recording that is not longer than twice the lags
///
/// Example:
///
///     const RecordingDigest digest = digest_of(y, u, model);
///     LikelihoodEngine engine;
///     engine.add_digest(digest);
///     const double L = engine.evaluate(model, InitialState::stationary).value;
RecordingDigest digest_of(const Eigen::MatrixXd& y, const Eigen::MatrixXd& u,
                          const StateSpace& model, Eigen::Index lags = 64);

/// The digest's bytes: numbers as little-endian doubles behind a count of each.
std::string bytes_of(const RecordingDigest& digest);
/// The same behind what is there.
void add_bytes(const RecordingDigest& digest, std::string& to);
/// Takes a digest off the begin of `bytes`. @throws std::invalid_argument for bytes that are none
RecordingDigest digest_in(std::string_view& bytes);

}  // namespace identikal
