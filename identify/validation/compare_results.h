// Which of several results explains the recordings best?
#pragma once

#include <vector>

#include "identify/estimate/results.h"
#include "identify/result/file.h"

namespace identikal {

/// Ranks maximum-likelihood results by AIC. tests[] holds of every result, by its file, best first,
///
///   aic, bic          less the least of all; `pass` where that is 0
///   log_likelihood    at its maximum
///   held_out          log-likelihood per held-out row of a filter; only where a result has one
///   held_out_fit      else the simulation's fit, mean over the channels [%]
///
/// and for every pair whose smaller model has the larger one's free parameters but for some, which
/// it knows (or has not, a zero covariance), all else alike
/// (identify/validation/internal/nested_structure.h; where that cannot be seen, the names of the
/// parameters decide, and the note says so),
///
///   likelihood_ratio  2 (L_large - L_small), channel "SMALL in LARGE", the p-value of the smaller
///                     one, and the interval [0, critical value] at 5 %
///
/// With d more free parameters the statistic is chi-square with d degrees of freedom where the
/// smaller model is true. Where b of them are known at a bound (a variance of 0), it is a mixture:
/// 1/2 chi2(d-1) + 1/2 chi2(d) for b = 1. For b > 1 the weights depend on the information; p and
/// critical value are then the largest possible, 1/2 chi2(d-1) + 1/2 chi2(d) for any of them. For
/// a variance that drives a level without a pull (A has an eigenvalue of 1), the statistic is 0 in
/// about two of three cases, not one of two, and p is somewhat too large (Shephard & Harvey 1990).
/// Lines in notes say the same in tables. Status ok, untrusted when the best result is, and
/// not_converged where any is.
///
/// Example:
///
///     std::vector<StoredResult> results;
///     for (auto folder : {"linear", "tanh"}) results.push_back(read_stored_result(folder));
///     const auto ranking = compare_results(results);
///
/// @throws InputError for fewer than two results, and, as no likelihoods compare there: results
///   that maximise none; of other recordings, rows or channels; of other methods of fit; that start
///   with the state known otherwise
/// Sources: Self & Liang (1987), case 5 and 6; Perlman (1969) for the largest mixture.
Comparison compare_results(const std::vector<StoredResult>& results);

/// P(statistic > value) of the above for `extra` parameters, `at_bound` of them at a bound.
double likelihood_ratio_p(double value, int extra, int at_bound);

}  // namespace identikal
