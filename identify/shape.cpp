#include "identify/shape.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <fmt/format.h>

#include "identify/distribution.h"
#include "identify/noise_estimate.h"
#include "identify/noise_ml.h"
#include "identify/recordings_likelihood.h"
#include "lib/error.h"
#include "lib/kalman.h"
#include "lib/matrix_equations.h"
#include "lib/spectrum.h"
#include "lib/units.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

constexpr double kLevel = 0.05;    // of all tests of colour together
constexpr double kFarthest = 8.0;  // of zeta: a pole within 1e-7 of the unit circle

// The free parameters' values that a result holds.
ParameterSet parameters_of(const Estimate& estimate, const ParameterSet& parameters) {
  VectorXd entries = free_entries(parameters);
  Index i = 0;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (!p.fixed) entries[i++] = p.value * unit_scale(p.unit);
  }
  return with_entries(parameters, entries);
}

double bic_of(double log_likelihood, Index unknowns, Index samples) {
  return -2.0 * log_likelihood +
         static_cast<double>(unknowns) * std::log(static_cast<double>(samples));
}

// The innovations of the white model, as a spectrum and as what noise does to them.
struct InnovationSpectrum {
  Spectrum measured;
  std::vector<MatrixXcd> T_G, T_V;
  MatrixXd Q, R, S;
};

InnovationSpectrum innovation_spectrum(const ModelFile& white, const Dataset& data) {
  constexpr Index kBins = 250;
  constexpr int kTapers = 3;
  const StateSpace m = instantiate(white.linear, white.parameters);
  const auto steady = steady_state(m);
  if (!steady) {
    throw InputError({white.path, 0, 0}, "the filter of the tuned model has no steady state",
                     "a model whose unstable states the outputs show and the noise moves");
  }
  const FilterResult filter =
      kalman_filter(m, white.linear.initial, data.y, data.u, Keep::innovations);
  InnovationSpectrum out;
  out.measured =
      binned(multitaper(filter.e.rightCols(filter.e.cols() - filter.first_proper), kTapers), kBins);
  out.Q = m.Q;
  out.R = m.R;
  out.S = m.S;
  const Index n = m.states(), ny = m.outputs();
  const MatrixXcd F = (m.A - steady->K * m.C).cast<std::complex<double>>();
  MatrixXcd sources(n, m.G.cols() + ny);
  sources << m.G.cast<std::complex<double>>(), steady->K.cast<std::complex<double>>();
  for (Index k = 0; k < out.measured.omega.size(); ++k) {
    const std::complex<double> z = std::polar(1.0, out.measured.omega[k]);
    const MatrixXcd x = (z * MatrixXcd::Identity(n, n) - F).partialPivLu().solve(sources);
    const MatrixXcd y = m.C.cast<std::complex<double>>() * x;
    out.T_G.push_back(y.leftCols(m.G.cols()));
    out.T_V.push_back(MatrixXcd::Identity(ny, ny) - y.rightCols(ny));
  }
  return out;
}

// The model with variances raised that the white model was tuned to next to nothing: a factor of
// zero would keep them there. @param spectrum  receives the raised Q and R too
ModelFile with_raised_variances(ModelFile model, InnovationSpectrum& spectrum) {
  constexpr double kNothing = 1e-3, kRaised = 0.1;  // of the innovations' variance
  const Index nw = spectrum.Q.rows(), ny = spectrum.R.rows();
  VectorXd power = VectorXd::Zero(ny), gain = VectorXd::Zero(nw);  // means over frequency
  double weight = 0.0;
  for (Index k = 0; k < spectrum.measured.omega.size(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    const double w = spectrum.measured.weight[k];
    power += w * spectrum.measured.S[at].diagonal().real();
    gain += w * spectrum.T_G[at].colwise().squaredNorm().transpose();
    weight += w;
  }
  power /= weight;
  gain /= weight;
  const auto raise = [&](const ParametrisedMatrix& matrix, const VectorXd& whole) {
    if (matrix.block >= 0) {
      Parameter& p = model.parameters[static_cast<std::size_t>(matrix.block)];
      for (Index i = 0; !p.fixed && i < whole.size(); ++i) {
        if (p.value(i, i) < kNothing * whole[i]) p.value(i, i) += kRaised * whole[i];
      }
      if (!p.fixed && p.domain == Domain::scaled_identity) {
        p.value = p.value.diagonal().mean() * MatrixXd::Identity(whole.size(), whole.size());
      }
    }
    for (const ParametrisedMatrix::Entry& e : matrix.entries) {
      Parameter& p = model.parameters[static_cast<std::size_t>(e.parameter)];
      if (p.fixed || e.row != e.col || !(e.factor > 0.0)) continue;
      const double most = whole[e.row] / e.factor;
      if (p.scalar() >= kNothing * most) continue;
      p.value(0, 0) = std::clamp(kRaised * most, p.min, p.max);
    }
  };
  raise(model.linear.R, power);
  raise(model.linear.Q, VectorXd::Constant(nw, power.sum()).cwiseQuotient(gain));
  const StateSpace m = instantiate(model.linear, model.parameters);
  spectrum.Q = m.Q;
  spectrum.R = m.R;
  return model;
}

// A shaping structure: where, on which channels, of which order.
struct Structure {
  NoisePlace place = NoisePlace::process;
  std::vector<Index> channels;
  Index order = 1;
  bool with_zeros = false;  // order - 1 of them, or none
  Index zeros() const { return with_zeros ? order - 1 : 0; }
};

// Unknowns of the spectral fit: logarithms of the factors of Q and R, channel by channel, then of
// every filter the logarithm of its variance (measurement only), zeta of its poles, of its zeros.
class SpectralFit {
 public:
  SpectralFit(const InnovationSpectrum& spectrum, Structure structure)
      : data_(spectrum), structure_(std::move(structure)) {
    nw_ = data_.Q.rows();
    ny_ = data_.R.rows();
  }

  Index filter_begin(std::size_t c) const {
    return nw_ + ny_ + static_cast<Index>(c) * per_filter();
  }
  Index per_filter() const { return own() + structure_.order + structure_.zeros(); }
  Index own() const { return structure_.place == NoisePlace::measurement ? 1 : 0; }
  Index unknowns() const { return filter_begin(structure_.channels.size()); }

  ShapingFilter filter(const VectorXd& x, std::size_t c, MatrixXd* Ja, MatrixXd* Jb) const {
    const Index at = filter_begin(c) + own();
    return {stable_polynomial(x.segment(at, structure_.order), Ja),
            stable_polynomial(x.segment(at + structure_.order, structure_.zeros()), Jb)};
  }

  // Whittle's log-likelihood, its gradient and Fisher information.
  bool evaluate(const VectorXd& x, double& L, VectorXd* gradient, MatrixXd* information) const {
    const bool derivatives = gradient != nullptr;
    const Index k = unknowns(), channels = static_cast<Index>(structure_.channels.size());
    const VectorXd fq = (0.5 * x.head(nw_)).array().exp(),
                   fr = (0.5 * x.segment(nw_, ny_)).array().exp();
    const MatrixXd Q = fq.asDiagonal() * data_.Q * fq.asDiagonal();
    const MatrixXd R = fr.asDiagonal() * data_.R * fr.asDiagonal();
    const MatrixXd S = fq.asDiagonal() * data_.S * fr.asDiagonal();
    std::vector<ShapingFilter> filters;
    std::vector<MatrixXd> Ja(structure_.channels.size()), Jb(structure_.channels.size());
    for (std::size_t c = 0; c < structure_.channels.size(); ++c) {
      filters.push_back(filter(x, c, &Ja[c], &Jb[c]));
    }
    L = 0.0;
    if (gradient != nullptr) gradient->setZero(k);
    if (information != nullptr) information->setZero(k, k);
    std::vector<MatrixXcd> dS(static_cast<std::size_t>(k));
    VectorXcd H(channels), dH;
    std::vector<VectorXcd> dHs(structure_.channels.size());
    for (Index f = 0; f < data_.measured.omega.size(); ++f) {
      const auto at = static_cast<std::size_t>(f);
      for (std::size_t c = 0; c < filters.size(); ++c) {
        H[static_cast<Index>(c)] =
            response(filters[c], data_.measured.omega[f], derivatives ? &dHs[c] : nullptr);
      }
      const bool process = structure_.place == NoisePlace::process;
      // Columns: what w and v, each with its filter, do to the innovations.
      MatrixXcd W = data_.T_G[at];
      const MatrixXcd& V = data_.T_V[at];
      if (process) {
        for (Index c = 0; c < channels; ++c)
          W.col(structure_.channels[static_cast<std::size_t>(c)]) *= H[c];
      }
      const MatrixXcd WQ = W * Q + V * S.transpose(), VR = V * R + W * S;
      MatrixXcd model = WQ * W.adjoint() + VR * V.adjoint();
      if (!process) {
        for (Index c = 0; c < channels; ++c) {
          const VectorXcd v = V.col(structure_.channels[static_cast<std::size_t>(c)]);
          const double q = std::exp(x[filter_begin(static_cast<std::size_t>(c))]);
          model += q * std::norm(H[c]) * v * v.adjoint();
        }
      }
      const Eigen::LLT<MatrixXcd> factor(model);
      if (factor.info() != Eigen::Success || !model.allFinite()) return false;
      const double weight = data_.measured.weight[f];
      const MatrixXcd inverse = factor.solve(MatrixXcd::Identity(ny_, ny_));
      const MatrixXcd whitened = inverse * data_.measured.S[at];
      double log_det = 0.0;
      for (Index i = 0; i < ny_; ++i) log_det += 2.0 * std::log(factor.matrixLLT()(i, i).real());
      L -= weight * (log_det + whitened.trace().real());
      if (!derivatives) continue;
      const auto twice = [](const MatrixXcd& half) { return MatrixXcd(half + half.adjoint()); };
      for (Index i = 0; i < nw_; ++i) {
        dS[static_cast<std::size_t>(i)] = twice(0.5 * WQ.col(i) * W.col(i).adjoint());
      }
      for (Index i = 0; i < ny_; ++i) {
        dS[static_cast<std::size_t>(nw_ + i)] = twice(0.5 * VR.col(i) * V.col(i).adjoint());
      }
      for (std::size_t c = 0; c < filters.size(); ++c) {
        const Index channel = structure_.channels[c], begin = filter_begin(c);
        const Index order = structure_.order, zeros = structure_.zeros();
        VectorXcd dzeta(order + zeros);
        dzeta.head(order) = Ja[c].transpose().cast<std::complex<double>>() * dHs[c].head(order);
        dzeta.tail(zeros) = Jb[c].transpose().cast<std::complex<double>>() * dHs[c].tail(zeros);
        const std::complex<double> h = H[static_cast<Index>(c)];
        MatrixXcd base;
        if (process) {
          // WQ already holds this channel's H; what changes is its column of W.
          base = WQ.col(channel) * data_.T_G[at].col(channel).adjoint();
          for (Index i = 0; i < order + zeros; ++i) {
            dS[static_cast<std::size_t>(begin + i)] = twice(std::conj(dzeta[i]) * base);
          }
          continue;
        }
        const VectorXcd v = V.col(channel);
        base = std::exp(x[begin]) * v * v.adjoint();
        dS[static_cast<std::size_t>(begin)] = std::norm(h) * base;
        for (Index i = 0; i < order + zeros; ++i) {
          dS[static_cast<std::size_t>(begin + 1 + i)] =
              2.0 * (std::conj(h) * dzeta[i]).real() * base;
        }
      }
      const MatrixXcd left = MatrixXcd::Identity(ny_, ny_) - whitened;
      std::vector<MatrixXcd> solved;
      for (Index i = 0; i < k; ++i) {
        solved.push_back(inverse * dS[static_cast<std::size_t>(i)]);
        (*gradient)[i] -= weight * (solved.back() * left).trace().real();
      }
      for (Index i = 0; i < k && information != nullptr; ++i) {
        for (Index j = 0; j <= i; ++j) {
          (*information)(i, j) += weight * (solved[static_cast<std::size_t>(i)]
                                                .transpose()
                                                .cwiseProduct(solved[static_cast<std::size_t>(j)])
                                                .sum()
                                                .real());
        }
      }
    }
    if (information != nullptr) {
      *information = MatrixXd(information->selfadjointView<Eigen::Lower>());
    }
    return std::isfinite(L);
  }

  LikelihoodProblem problem() const {
    LikelihoodProblem out;
    out.evaluate = [this](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
      return evaluate(x, L, g, J);
    };
    out.lower = VectorXd::Constant(unknowns(), -kFarthest);
    out.upper = VectorXd::Constant(unknowns(), kFarthest);
    // Variances relative to the white model's.
    out.lower.head(nw_ + ny_).setConstant(-30.0);
    out.upper.head(nw_ + ny_).setConstant(10.0);
    for (std::size_t c = 0; own() == 1 && c < structure_.channels.size(); ++c) {
      out.lower[filter_begin(c)] = -100.0;
      out.upper[filter_begin(c)] = 100.0;
    }
    return out;
  }

  const Structure& structure() const { return structure_; }

 private:
  const InnovationSpectrum& data_;
  Structure structure_;
  Index nw_ = 0, ny_ = 0;
};

// Frequencies where the innovations have most power, apart from one another.
std::vector<double> peaks(const Spectrum& measured, int most) {
  VectorXd height(measured.omega.size());
  for (Index k = 0; k < height.size(); ++k) {
    height[k] = measured.S[static_cast<std::size_t>(k)].real().trace();
  }
  // One frequency alone may be high by chance.
  VectorXd smooth = height;
  for (Index k = 1; k + 1 < height.size(); ++k) smooth[k] = height.segment(k - 1, 3).mean();
  std::vector<double> out;
  constexpr double kApart = 0.15;
  for (int p = 0; p < most; ++p) {
    Index at = 0;
    if (!(smooth.maxCoeff(&at) > 0.0)) break;
    out.push_back(measured.omega[at]);
    for (Index k = 0; k < smooth.size(); ++k) {
      if (std::abs(measured.omega[k] - measured.omega[at]) < kApart) smooth[k] = 0.0;
    }
  }
  return out;
}

VectorXd polynomial_product(const VectorXd& p, const VectorXd& q) {
  VectorXd a(p.size() + 1), b(q.size() + 1);
  a << 1.0, p;
  b << 1.0, q;
  VectorXd out = VectorXd::Zero(a.size() + b.size() - 1);
  for (Index i = 0; i < a.size(); ++i) out.segment(i, b.size()) += a[i] * b;
  return out.tail(out.size() - 1);
}

// Where the poles might be: pairs at the peaks, real poles, or what a lower order has found and a
// pole that does nothing yet.
std::vector<VectorXd> pole_starts(Index order, const std::vector<double>& peak,
                                  const std::vector<VectorXd>& lower) {
  std::vector<VectorXd> pairs, out;
  for (const double omega : peak) {
    for (const double radius : {0.8, 0.98}) {
      pairs.push_back(Eigen::Vector2d(-2.0 * radius * std::cos(omega), radius * radius));
    }
  }
  const auto real = [](double pole) { return VectorXd::Constant(1, -pole); };
  if (order == 1) {
    for (const double pole : {0.95, 0.5, -0.6}) out.push_back(real(pole));
    return out;
  }
  if (order == 2) out = pairs;
  for (const VectorXd& a : lower) {
    out.push_back(polynomial_product(a, real(0.3)));
    out.push_back(polynomial_product(a, real(-0.3)));
  }
  if (order == 4 && pairs.size() >= 4) out.push_back(polynomial_product(pairs[1], pairs[3]));
  return out;
}

struct SpectralSolution {
  Structure structure;
  VectorXd x;
  double log_likelihood = -std::numeric_limits<double>::infinity();
};

SpectralSolution fit_spectrum(const InnovationSpectrum& spectrum, const Structure& structure,
                              const std::vector<double>& peak, const SpectralSolution* lower) {
  const SpectralFit fit(spectrum, structure);
  const LikelihoodProblem problem = fit.problem();
  std::vector<VectorXd> known;
  if (lower != nullptr) {
    const SpectralFit before(spectrum, lower->structure);
    for (std::size_t c = 0; c < structure.channels.size(); ++c) {
      known.push_back(before.filter(lower->x, c, nullptr, nullptr).a);
    }
  }
  SpectralSolution out;
  out.structure = structure;
  SolverOptions solver;
  solver.max_iterations = 40;
  solver.decrement_tolerance = 1e-4;
  for (const VectorXd& poles : pole_starts(structure.order, peak, known)) {
    const VectorXd zeta = stable_coordinates(poles);
    if (!zeta.allFinite()) continue;
    VectorXd x = VectorXd::Zero(fit.unknowns());
    // The power that the filter adds is taken from the variance in front of it.
    double gain = 0.0;
    for (Index k = 0; k < spectrum.measured.omega.size(); ++k) {
      gain += spectrum.measured.weight[k] *
              std::norm(response({poles, VectorXd(0)}, spectrum.measured.omega[k]));
    }
    gain /= spectrum.measured.weight.sum();
    for (std::size_t c = 0; c < structure.channels.size(); ++c) {
      const Index channel = structure.channels[c];
      const Index at = fit.filter_begin(c);
      x.segment(at + fit.own(), structure.order) =
          zeta.cwiseMax(1.0 - kFarthest).cwiseMin(kFarthest - 1.0);
      if (structure.place == NoisePlace::process) {
        x[channel] = std::max(-std::log(gain), -20.0);
      } else {
        double power = spectrum.R(channel, channel);
        if (!(power > 0.0)) power = spectrum.measured.S[0].real().trace();
        x[at] = std::log(0.3 * power / gain);
      }
    }
    const Solution solution = maximise(problem, x, solver);
    if (!(solution.summary.objective > out.log_likelihood)) continue;
    out.x = solution.x;
    out.log_likelihood = solution.summary.objective;
  }
  return out;
}

// A structure with its maximum likelihood.
struct Candidate {
  Structure structure;
  ModelFile model;  // its parameters are at the maximum
  bool found = false;
  double log_likelihood = -std::numeric_limits<double>::infinity();
  double bic = std::numeric_limits<double>::infinity();
};

// The likelihood of a shaped model with zeta in place of the filters' coefficients.
Solution maximise_stable(const ModelFile& shaped, const std::vector<Dataset>& recordings,
                         Index first_own, const Structure& structure) {
  RecordingsLikelihood likelihood(shaped, recordings);
  const LikelihoodProblem plain = likelihood.problem();
  const Index own = structure.place == NoisePlace::measurement ? 1 : 0;
  std::vector<std::pair<Index, Index>> polynomials;  // begin, length
  Index at = first_own;
  for (std::size_t c = 0; c < structure.channels.size(); ++c) {
    polynomials.emplace_back(at + own, structure.order);
    polynomials.emplace_back(at + own + structure.order, structure.zeros());
    at += own + structure.order + structure.zeros();
  }
  LikelihoodProblem problem = plain;
  for (const auto& [begin, length] : polynomials) {
    problem.lower.segment(begin, length).setConstant(-kFarthest);
    problem.upper.segment(begin, length).setConstant(kFarthest);
  }
  problem.evaluate = [&](const VectorXd& z, double& L, VectorXd* g, MatrixXd* J) {
    VectorXd x = z;
    MatrixXd M = MatrixXd::Identity(z.size(), z.size()), block;
    for (const auto& [begin, length] : polynomials) {
      x.segment(begin, length) = stable_polynomial(z.segment(begin, length), &block);
      M.block(begin, begin, length, length) = block;
    }
    if (!plain.evaluate(x, L, g, J)) return false;
    if (g != nullptr) *g = M.transpose() * *g;
    if (J != nullptr) *J = M.transpose() * *J * M;
    return true;
  };
  VectorXd z = coordinates(shaped.parameters);
  for (const auto& [begin, length] : polynomials) {
    const VectorXd zeta = stable_coordinates(z.segment(begin, length));
    if (!zeta.allFinite()) return {};
    z.segment(begin, length) = zeta.cwiseMax(-kFarthest).cwiseMin(kFarthest);
  }
  // Filters with a pole or zero too many have a ridge for a maximum: its height is known early.
  SolverOptions solver;
  solver.max_iterations = 40;
  solver.decrement_tolerance = 1e-5;
  Solution solution = maximise(problem, z, solver);
  for (const auto& [begin, length] : polynomials) {
    solution.x.segment(begin, length) = stable_polynomial(solution.x.segment(begin, length));
  }
  return solution;
}

Candidate maximum_likelihood(const ModelFile& base, const std::vector<Dataset>& recordings,
                             const InnovationSpectrum& spectrum, const SpectralSolution& start) {
  const SpectralFit fit(spectrum, start.structure);
  // The spectral fit's factors of the variances, where those are free.
  ModelFile scaled = base;
  const auto scale = [&](int block, const VectorXd& factor) {
    if (block < 0) return;
    Parameter& p = scaled.parameters[static_cast<std::size_t>(block)];
    if (p.fixed) return;
    if (p.domain == Domain::scaled_identity) {
      p.value *= factor.squaredNorm() / static_cast<double>(factor.size());
    } else {
      p.value = factor.asDiagonal() * p.value * factor.asDiagonal();
    }
  };
  const Index nw = spectrum.Q.rows(), ny = spectrum.R.rows();
  const VectorXd fq = (0.5 * start.x.head(nw)).array().exp();
  const VectorXd fr = (0.5 * start.x.segment(nw, ny)).array().exp();
  scale(scaled.linear.Q.block, fq);
  scale(scaled.linear.R.block, fr);
  const auto scale_entries = [&](const ParametrisedMatrix& matrix, const VectorXd& factor) {
    std::vector<bool> done(scaled.parameters.size(), false);
    for (const ParametrisedMatrix::Entry& e : matrix.entries) {
      Parameter& p = scaled.parameters[static_cast<std::size_t>(e.parameter)];
      if (p.fixed || e.row != e.col || done[static_cast<std::size_t>(e.parameter)]) continue;
      done[static_cast<std::size_t>(e.parameter)] = true;
      p.value(0, 0) = std::clamp(p.scalar() * factor[e.row] * factor[e.row], p.min, p.max);
    }
  };
  scale_entries(scaled.linear.Q, fq);
  scale_entries(scaled.linear.R, fr);
  std::vector<ShapedChannel> channels;
  for (std::size_t c = 0; c < start.structure.channels.size(); ++c) {
    ShapedChannel one;
    one.channel = start.structure.channels[c];
    one.filter = fit.filter(start.x, c, nullptr, nullptr);
    if (fit.own() == 1) one.variance = std::exp(start.x[fit.filter_begin(c)]);
    channels.push_back(one);
  }
  Candidate out;
  out.structure = start.structure;
  out.model = with_shaping_filters(scaled, start.structure.place, channels);
  const Index own = static_cast<Index>(channels.size()) * fit.per_filter();
  const Index first = coordinates(out.model.parameters).size() - own;
  const Solution solution = maximise_stable(out.model, recordings, first, start.structure);
  if (!std::isfinite(solution.summary.objective)) return out;
  out.model.parameters = with_coordinates(out.model.parameters, solution.x);
  out.found = true;
  return out;
}

std::vector<Structure> structures(const ModelFile& model, const ShapeOptions& options) {
  std::vector<Structure> out;
  const auto place = [&](NoisePlace where, Index channels) {
    if (options.place && *options.place != where) return;
    if (!shaping_fault(model, where).empty()) return;
    std::vector<std::vector<Index>> sets;
    for (Index c = 0; c < channels; ++c) sets.push_back({c});
    if (channels > 1) {
      sets.emplace_back();
      for (Index c = 0; c < channels; ++c) sets.back().push_back(c);
    }
    for (const std::vector<Index>& set : sets) out.push_back({where, set, 1});
  };
  place(NoisePlace::process, model.linear.G.constant.cols());
  place(NoisePlace::measurement, model.linear.C.constant.rows());
  return out;
}

// Root mean square errors of predictions several steps ahead, in SI: rows outputs, columns
// horizons, over the samples of each recording from a share on.
MatrixXd prediction_errors(const ModelFile& model, const std::vector<Dataset>& recordings,
                           const std::vector<int>& horizons, double from) {
  const StateSpace m = instantiate(model.linear, model.parameters);
  const Index ny = m.outputs();
  MatrixXd squares = MatrixXd::Zero(ny, static_cast<Index>(horizons.size())), count = squares;
  for (const Dataset& data : recordings) {
    const FilterResult filter = kalman_filter(m, model.linear.initial, data.y, data.u);
    const Index N = data.size();
    const Index begin =
        std::max(filter.first_proper, static_cast<Index>(from * static_cast<double>(N)));
    for (Index t = begin; t < N && filter.status == FilterStatus::ok; ++t) {
      VectorXd x = filter.x_pred.col(t);
      int ahead = 1;
      for (std::size_t h = 0; h < horizons.size(); ++h) {
        for (; ahead < horizons[h] && t + ahead - 1 < N; ++ahead) {
          x = (m.A * x + m.B * data.u.col(t + ahead - 1)).eval();
        }
        const Index at = t + horizons[h] - 1;
        if (at >= N) break;
        const VectorXd e = data.y.col(at) - m.C * x - m.D * data.u.col(at);
        for (Index i = 0; i < ny; ++i) {
          if (std::isnan(e[i])) continue;
          squares(i, static_cast<Index>(h)) += e[i] * e[i];
          count(i, static_cast<Index>(h)) += 1.0;
        }
      }
    }
  }
  return squares.cwiseQuotient(count).cwiseSqrt();
}

double log_likelihood_of(const ModelFile& model, const std::vector<Dataset>& recordings) {
  const StateSpace m = instantiate(model.linear, model.parameters);
  double out = 0.0;
  for (const Dataset& data : recordings) {
    const Likelihood one = log_likelihood(m, model.linear.initial, data.y, data.u);
    if (one.status != FilterStatus::ok) return kNone;
    out += one.value;
  }
  return out;
}

// The log-likelihood behind the first samples. With a diffuse start a model with more states leaves
// out more samples, and what it leaves out has a unit: without the same beginning taken from both,
// likelihoods of two models could not be compared.
double comparable_log_likelihood(const ModelFile& model, const std::vector<Dataset>& recordings,
                                 Index beginning) {
  if (beginning == 0) return log_likelihood_of(model, recordings);
  std::vector<Dataset> first = recordings;
  for (Dataset& data : first) {
    const Index keep = std::min(beginning, data.size());
    data.y = data.y.leftCols(keep).eval();
    data.u = data.u.leftCols(keep).eval();
    data.time = data.time.head(keep).eval();
  }
  return log_likelihood_of(model, recordings) - log_likelihood_of(model, first);
}

std::vector<Dataset> first_parts(const std::vector<Dataset>& recordings, double share) {
  std::vector<Dataset> out = recordings;
  for (Dataset& data : out) {
    const auto keep =
        std::max<Index>(1, static_cast<Index>(share * static_cast<double>(data.size())));
    data.y = data.y.leftCols(keep).eval();
    data.u = data.u.leftCols(keep).eval();
    data.time = data.time.head(keep).eval();
  }
  return out;
}

// Is anything but white noise in the innovations?
struct Colour {
  double p = 1.0;       // of all tests together (Bonferroni)
  double peak = kNone;  // rad per sample
  double peak_p = 1.0;
};

constexpr int kBandTapers = 5;

// Of standardised innovations, behind a diffuse start.
MatrixXd without_lead(const MatrixXd& e) {
  Index first = 0;
  while (first < e.cols() && e.col(first).array().isNaN().all()) ++first;
  return e.rightCols(e.cols() - first);
}

// channels x frequencies
MatrixXd channel_spectra(const Spectrum& s) {
  MatrixXd out(s.S[0].rows(), s.omega.size());
  for (Index k = 0; k < out.cols(); ++k) {
    out.col(k) = s.S[static_cast<std::size_t>(k)].diagonal().real();
  }
  return out;
}

Colour colour_of(const Estimate& white) {
  Colour out;
  for (const TestResult& test : white.tests) {
    if (test.id == "ljung_box" && !std::isnan(test.p)) out.p = std::min(out.p, test.p);
  }
  const double channels = static_cast<double>(white.series.standardised.rows());
  out.p = std::min(1.0, 2.0 * channels * out.p);
  const MatrixXd e = without_lead(white.series.standardised);
  if (e.cols() < 64) return out;
  const Spectrum s = multitaper(e, kBandTapers);
  const VectorXd level = channel_spectra(s).colwise().sum();
  Index at = 0;
  const double highest = level.maxCoeff(&at) / level.mean();
  const double dof = 2.0 * kBandTapers * channels;
  out.peak = s.omega[at];
  // Overlapping estimates: no more independent ones than frequencies.
  out.peak_p =
      std::min(1.0, static_cast<double>(level.size()) * chi_square_upper_tail(dof * highest, dof));
  out.p = std::min(out.p, 2.0 * out.peak_p);
  return out;
}

// Where the outputs' spectrum has the peak that belongs to the slowest of the filters' poles
// [rad/s]; kNone where there is none.
double output_peak(const ModelFile& model, const std::vector<Shaping::Pole>& poles, double dt) {
  if (poles.empty()) return kNone;
  const StateSpace m = instantiate(model.linear, model.parameters);
  const Index n = m.states();
  const MatrixXcd A = m.A.cast<std::complex<double>>(), C = m.C.cast<std::complex<double>>();
  const MatrixXcd noise = (m.G * m.Q * m.G.transpose()).cast<std::complex<double>>();
  const auto level = [&](double omega) {
    const MatrixXcd T = C * (std::polar(1.0, omega) * MatrixXcd::Identity(n, n) - A)
                                .partialPivLu()
                                .solve(MatrixXcd::Identity(n, n));
    return (T * noise * T.adjoint()).trace().real();
  };
  const auto slowest = std::max_element(
      poles.begin(), poles.end(), [](const auto& a, const auto& b) { return a.radius < b.radius; });
  if (slowest->frequency <= 0.0) return kNone;
  // Uphill from the pole, in steps of a tenth of its width.
  const double step = std::max(0.1 * (1.0 - slowest->radius), 1e-5);
  double omega = slowest->frequency * dt, here = level(omega);
  for (const double sign : {1.0, -1.0}) {
    for (int k = 0; k < 20000; ++k) {
      const double next = omega + sign * step;
      if (!(next > 0.0 && next < std::numbers::pi)) return kNone;
      const double there = level(next);
      if (!(there > here)) break;
      omega = next;
      here = there;
    }
  }
  return omega / dt;
}

// The filters' coefficients: the last parameters, in the order of with_shaping_filters().
std::vector<ShapingFilter> filters_of(const ParameterSet& parameters, const Structure& structure) {
  const Index own = structure.place == NoisePlace::measurement ? 1 : 0;
  const Index each = own + structure.order + structure.zeros();
  auto at =
      static_cast<Index>(parameters.size()) - each * static_cast<Index>(structure.channels.size());
  std::vector<ShapingFilter> out;
  for (std::size_t c = 0; c < structure.channels.size(); ++c) {
    ShapingFilter filter{VectorXd(structure.order), VectorXd(structure.zeros())};
    at += own;
    for (double& a : filter.a) a = parameters[static_cast<std::size_t>(at++)].scalar();
    for (double& b : filter.b) b = parameters[static_cast<std::size_t>(at++)].scalar();
    out.push_back(filter);
  }
  return out;
}

std::string channel_names(const ModelFile& model, const Structure& structure) {
  std::string out;
  for (const Index c : structure.channels) {
    if (!out.empty()) out += ", ";
    out += structure.place == NoisePlace::process ? fmt::format("w{}", c + 1)
                                                  : model.outputs[static_cast<std::size_t>(c)].name;
  }
  return out;
}

}  // namespace

ShapeResult shape(const ModelFile& model, const std::vector<Dataset>& recordings,
                  const ShapeOptions& options) {
  const auto say = [&](const std::string& what) {
    if (options.progress) options.progress(what);
  };
  if (structures(model, options).empty()) {
    const NoisePlace place = options.place.value_or(NoisePlace::process);
    throw InputError({model.path, 0, 0},
                     "no shaping filter can be put into this model: " + shaping_fault(model, place),
                     "a discrete-time model, 'initial: stationary' or 'diffuse'");
  }
  constexpr Index kFewest = 64;  // samples that make a spectrum
  const auto longest =
      std::max_element(recordings.begin(), recordings.end(),
                       [](const Dataset& a, const Dataset& b) { return a.size() < b.size(); });
  const Index fewest = kFewest + 2 * model.linear.A.constant.rows();
  if (longest->size() < fewest) {
    throw InputError(
        {longest->name, 0, 0},
        fmt::format("{} rows are too few to tell coloured noise from white", longest->size()),
        fmt::format("at least {}", fewest), "use a longer recording");
  }
  say("tuning the white model");
  NoiseMlOptions white_options;
  white_options.starts = 3;
  white_options.profiles = false;
  white_options.seed = options.seed;
  Estimate white_estimate = tune_ml(model, recordings, white_options);
  ModelFile white = model;
  white.parameters = parameters_of(white_estimate, model.parameters);
  const Index samples = samples_present(recordings);
  const Index unknowns = coordinates(model.parameters).size();
  const Colour colour = colour_of(white_estimate);

  ShapeResult out;
  Shaping report;
  report.colour_p = colour.p;
  report.peak = colour.peak / model.linear.dt;
  report.peak_p = colour.peak_p;
  const auto describe_spectrum = [&](const Estimate& estimate, MatrixXd& to) {
    const MatrixXd e = without_lead(estimate.series.standardised);
    if (e.cols() < 64) return;
    const Spectrum s = multitaper(e, kBandTapers);
    report.frequency = s.omega / model.linear.dt;
    to = channel_spectra(s);
    const double dof = 2.0 * kBandTapers;
    report.band = {chi_square_quantile(0.025, dof) / dof, chi_square_quantile(0.975, dof) / dof};
  };
  describe_spectrum(white_estimate, report.spectrum_white);
  for (const Channel& channel : recordings[0].outputs) {
    report.channels.push_back(channel.name);
    report.units.push_back(channel.unit);
  }
  // Twice the states of the largest model determine its diffuse start.
  const Index beginning = model.linear.initial == InitialState::diffuse
                              ? 2 * (model.linear.A.constant.rows() +
                                     options.most_order * std::max(model.linear.G.constant.cols(),
                                                                   model.linear.C.constant.rows()))
                              : 0;
  const double white_L = comparable_log_likelihood(white, recordings, beginning);
  const double white_bic = bic_of(white_L, unknowns, samples);
  report.candidates.push_back({"white", "", 0, 0, white_L, white_bic});
  if (!(colour.p < kLevel)) {
    out.estimate = std::move(white_estimate);
    out.estimate.status = Status::answer_no;
    out.estimate.message = fmt::format(
        "the noise is white as far as the recording tells (p {:.2g}): no filter needed", colour.p);
    out.estimate.shaping = std::move(report);
    return out;
  }

  InnovationSpectrum spectrum = innovation_spectrum(white, *longest);
  const ModelFile start = with_raised_variances(white, spectrum);
  const std::vector<double> peak = peaks(spectrum.measured, 2);
  std::vector<SpectralSolution> spectral;
  for (Structure structure : structures(model, options)) {
    SpectralSolution lower;
    for (structure.order = 1; structure.order <= options.most_order; ++structure.order) {
      say(fmt::format("spectrum: {} noise, order {}",
                      structure.place == NoisePlace::process ? "process" : "measurement",
                      structure.order));
      SpectralSolution best;
      for (const bool zeros : {false, true}) {
        if (zeros && structure.order == 1) continue;
        structure.with_zeros = zeros;
        const SpectralSolution one =
            fit_spectrum(spectrum, structure, peak, structure.order > 1 ? &lower : nullptr);
        if (!std::isfinite(one.log_likelihood)) continue;
        spectral.push_back(one);
        if (one.log_likelihood > best.log_likelihood) best = one;
      }
      if (best.x.size() == 0) break;
      lower = best;
    }
  }
  // The most promising of each place go on to the likelihood itself.
  constexpr std::size_t kEach = 3;
  constexpr double kHopeless = 15.0;  // BIC behind the best of its place
  const auto whittle_bic = [&](const SpectralSolution& s) {
    return bic_of(s.log_likelihood, s.x.size(), samples_present({*longest}));
  };
  std::sort(spectral.begin(), spectral.end(),
            [&](const SpectralSolution& a, const SpectralSolution& b) {
              return whittle_bic(a) < whittle_bic(b);
            });
  std::vector<Candidate> candidates;
  for (const NoisePlace place : {NoisePlace::process, NoisePlace::measurement}) {
    std::size_t taken = 0;
    double first = 0.0;
    for (const SpectralSolution& s : spectral) {
      if (s.structure.place != place || taken == kEach) continue;
      if (taken == 0) first = whittle_bic(s);
      if (whittle_bic(s) > first + kHopeless) continue;
      ++taken;
      say(fmt::format("likelihood: order {}", s.structure.order));
      Candidate one = maximum_likelihood(start, recordings, spectrum, s);
      if (!one.found) continue;
      one.log_likelihood = comparable_log_likelihood(one.model, recordings, beginning);
      if (!std::isfinite(one.log_likelihood)) continue;
      one.bic = bic_of(one.log_likelihood, coordinates(one.model.parameters).size(), samples);
      candidates.push_back(std::move(one));
    }
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return a.bic < b.bic; });
  for (const Candidate& c : candidates) {
    report.candidates.push_back(
        {c.structure.place == NoisePlace::process ? "process" : "measurement",
         channel_names(model, c.structure), static_cast<int>(c.structure.order),
         static_cast<int>(c.structure.zeros()), c.log_likelihood, c.bic});
  }
  // The best that the data determine and whose filters stay stable when nothing holds them.
  const Candidate* chosen = nullptr;
  Estimate shaped_estimate;
  std::vector<ShapingFilter> filters;
  for (const Candidate& c : candidates) {
    if (!(c.bic < white_bic)) break;
    NoiseMlOptions one;
    one.starts = 1;
    one.profiles = false;
    say("errors of the shaped model");
    Estimate estimate = tune_ml(c.model, recordings, one);
    const ParameterSet end = parameters_of(estimate, c.model.parameters);
    filters = filters_of(end, c.structure);
    const bool stable = std::all_of(filters.begin(), filters.end(), [](const ShapingFilter& f) {
      return modes(f.a).front().radius < 1.0;
    });
    const Identifiability& id = estimate.identifiability;
    if (!stable || id.rank < id.of || estimate.status == Status::not_converged) continue;
    chosen = &c;
    shaped_estimate = std::move(estimate);
    break;
  }
  if (chosen == nullptr) {
    out.estimate = std::move(white_estimate);
    out.estimate.status = Status::untrusted;
    out.estimate.message = fmt::format(
        "the innovations are not white (p {:.2g}), and no shaping filter explains them: the model "
        "itself is in doubt",
        colour.p);
    out.estimate.shaping = std::move(report);
    return out;
  }
  const Candidate& best = *chosen;
  out.model = best.model;
  out.model->name = model.name + ", shaped";

  // Both tuned on the first part, compared on the last.
  const std::vector<Dataset> first = first_parts(recordings, 1.0 - options.hold_out);
  say("held-out comparison");
  {
    ModelFile white_first = white, best_first = best.model;
    RecordingsLikelihood likelihood(white, first);
    const Solution refit = maximise(likelihood.problem(), coordinates(white.parameters));
    if (std::isfinite(refit.summary.objective)) {
      white_first.parameters = with_coordinates(white.parameters, refit.x);
    }
    const Index own = static_cast<Index>(best.structure.channels.size()) *
                      SpectralFit(spectrum, best.structure).per_filter();
    const Solution shaped = maximise_stable(
        best.model, first, coordinates(best.model.parameters).size() - own, best.structure);
    if (std::isfinite(shaped.summary.objective)) {
      best_first.parameters = with_coordinates(best.model.parameters, shaped.x);
    }
    report.horizons = {1, 2, 4, 8, 16};
    report.without =
        prediction_errors(white_first, recordings, report.horizons, 1.0 - options.hold_out);
    report.with =
        prediction_errors(best_first, recordings, report.horizons, 1.0 - options.hold_out);
    report.held_out_without =
        log_likelihood_of(white_first, recordings) - log_likelihood_of(white_first, first);
    report.held_out_with =
        log_likelihood_of(best_first, recordings) - log_likelihood_of(best_first, first);
    for (std::size_t i = 0; i < report.units.size(); ++i) {
      const double unit = unit_scale(report.units[i]);
      report.with.row(static_cast<Index>(i)) /= unit;
      report.without.row(static_cast<Index>(i)) /= unit;
    }
  }
  out.estimate = std::move(shaped_estimate);
  out.estimate.model_name = out.model->name;
  out.estimate.objective.method = "shape";
  out.model->parameters = parameters_of(out.estimate, out.model->parameters);
  describe_spectrum(out.estimate, report.spectrum_shaped);
  for (const ShapingFilter& filter : filters) {
    for (const Mode& mode : modes(filter.a)) {
      report.poles.push_back({mode.frequency / model.linear.dt, mode.radius});
    }
  }
  report.output_peak = output_peak(*out.model, report.poles, model.linear.dt);
  report.place = best.structure.place == NoisePlace::process ? "process" : "measurement";
  report.order = static_cast<int>(best.structure.order);
  report.zeros = static_cast<int>(best.structure.zeros());
  bool white_now = true;
  for (const TestResult& test : out.estimate.tests) {
    white_now = white_now && (test.id != "ljung_box" || test.pass);
  }
  if (out.estimate.status == Status::ok) {
    out.estimate.message = fmt::format(
        "coloured {} noise (p {:.2g}): a filter of order {} explains it{}", report.place, colour.p,
        report.order, white_now ? "" : ", but not all: the innovations are still not white");
    if (!white_now) out.estimate.status = Status::untrusted;
    if (report.held_out_with < report.held_out_without) {
      out.estimate.status = Status::untrusted;
      out.estimate.message +=
          ", but not on the part held out, where it does worse than white noise";
    }
    for (const EstimatedParameter& p : out.estimate.parameters) {
      if (p.verdict != Verdict::at_bound || p.value != 0.0) continue;
      out.estimate.warnings.push_back(
          {"noise_vanished",
           "warning",
           {p.name},
           fmt::format("{} has become zero: the filter has taken its place", p.name),
           "check the model's dynamics: a wrong A looks like coloured noise too"});
    }
    // Of the same spectrum in the other place the outputs say nothing.
    constexpr double kTells = 10.0;  // BIC apart: very strong evidence (Kass & Raftery 1995)
    for (const Candidate& other : candidates) {
      if (other.structure.place == best.structure.place) continue;
      if (other.bic < best.bic + kTells) {
        out.estimate.warnings.push_back(
            {"noise_place",
             "note",
             {},
             fmt::format("the outputs do not tell whether process or measurement noise is coloured "
                         "(BIC {:.1f} and {:.1f}); the state estimates differ",
                         best.bic, other.bic),
             "decide by what is known of the sensor, and say --noise process or measurement"});
      }
      break;
    }
  }
  out.estimate.shaping = std::move(report);
  return out;
}

}  // namespace identikal
