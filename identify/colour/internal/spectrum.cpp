#include "identify/colour/internal/spectrum.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <memory>
#include <numbers>
#include <utility>

#include <Eigen/Cholesky>

#include "lib/base/error.h"
#include "lib/filter/kalman.h"
#include "lib/filter/steady_state.h"
#include "lib/model/frequency_response.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

namespace {

// Where the coordinates of spectral_problem() stand, and the likelihood of them.
class SpectralFit {
 public:
  SpectralFit(const InnovationSpectrum& spectrum, ShapingStructure structure)
      : data_(spectrum), structure_(std::move(structure)) {
    nw_ = data_.Q.rows();
    ny_ = data_.R.rows();
  }

  Index filter_begin(std::size_t c) const {
    return nw_ + ny_ + static_cast<Index>(c) * structure_.unknowns();
  }
  Index poles_begin(std::size_t c) const {
    return filter_begin(c) + (structure_.own_variance() ? 1 : 0);
  }
  Index unknowns() const { return filter_begin(structure_.channels.size()); }

  ShapingFilter filter(const VectorXd& x, std::size_t c, MatrixXd* Ja, MatrixXd* Jb) const {
    const Index at = poles_begin(c);
    return {stable_polynomial(x.segment(at, structure_.order), Ja),
            stable_polynomial(x.segment(at + structure_.order, structure_.zeros()), Jb)};
  }

  // Whittle's log-likelihood, its gradient and Fisher information. Of the spectrum S = L L* only
  // L^-1 dS L^-* has a part in both, as ny^2 real numbers: rows of J.
  bool evaluate(const VectorXd& x, double& L, VectorXd* gradient, MatrixXd* information) const {
    const Index bins = data_.measured.omega.size(), entries = ny_ * ny_;
    const bool derivatives = gradient != nullptr;
    const Coefficients at = coefficients(x);
    MatrixXd J(derivatives ? bins * entries : 0, unknowns());
    VectorXd misfit(J.rows());
    AtFrequency model;
    L = 0.0;
    for (Index f = 0; f < bins; ++f) {
      set_spectrum(at, f, derivatives, model);
      model.factor.compute(model.S);
      if (model.factor.info() != Eigen::Success || !model.S.allFinite()) return false;
      whiten_misfit(f, model);
      const double weight = data_.measured.weight[f];
      double log_det = 0.0;
      for (Index i = 0; i < ny_; ++i) {
        log_det += 2.0 * std::log(model.factor.matrixLLT()(i, i).real());
      }
      L -= weight * (log_det + static_cast<double>(ny_) - model.misfit.trace().real());
      if (!derivatives) continue;
      pack(model.misfit, std::sqrt(weight), misfit.segment(f * entries, entries));
      set_derivatives(at, f, std::sqrt(weight), model, J.middleRows(f * entries, entries));
    }
    if (derivatives) *gradient = -J.transpose() * misfit;
    if (derivatives && information != nullptr) *information = J.transpose() * J;
    return std::isfinite(L);
  }

 private:
  // What the coordinates stand for.
  struct Coefficients {
    MatrixXd Q, R, S;
    std::vector<ShapingFilter> filters;
    std::vector<MatrixXd> Ja, Jb;  // of their polynomials, differentiated by zeta
    VectorXd own_variance;         // of each filter; empty: none has one
  };

  // The model's spectrum of the innovations, and what it is made of.
  struct AtFrequency {
    VectorXcd H;                // of each filter
    std::vector<VectorXcd> dH;  // by its polynomials
    MatrixXcd W, WQ, VR;        // W: what w, each with its filter, does to the innovations
    MatrixXcd S;
    Eigen::LLT<MatrixXcd> factor;  // S = L L*
    MatrixXcd misfit;              // I - L^-1 measured L^-*
  };

  Coefficients coefficients(const VectorXd& x) const {
    const VectorXd fq = (0.5 * x.head(nw_)).array().exp(),
                   fr = (0.5 * x.segment(nw_, ny_)).array().exp();
    Coefficients out;
    out.Q = fq.asDiagonal() * data_.Q * fq.asDiagonal();
    out.R = fr.asDiagonal() * data_.R * fr.asDiagonal();
    out.S = fq.asDiagonal() * data_.S * fr.asDiagonal();
    const std::size_t channels = structure_.channels.size();
    out.Ja.resize(channels);
    out.Jb.resize(channels);
    if (structure_.own_variance()) out.own_variance.resize(static_cast<Index>(channels));
    for (std::size_t c = 0; c < channels; ++c) {
      out.filters.push_back(filter(x, c, &out.Ja[c], &out.Jb[c]));
      if (structure_.own_variance()) {
        out.own_variance[c] = std::exp(x[filter_begin(c)]);
      }
    }
    return out;
  }

  void set_spectrum(const Coefficients& at, Index f, bool derivatives, AtFrequency& out) const {
    const auto channels = static_cast<Index>(structure_.channels.size());
    out.H.resize(channels);
    out.dH.resize(structure_.channels.size());
    for (std::size_t c = 0; c < at.filters.size(); ++c) {
      out.H[static_cast<Index>(c)] =
          response(at.filters[c], data_.measured.omega[f], derivatives ? &out.dH[c] : nullptr);
    }
    const bool process = structure_.source == NoiseSource::process;
    out.W = data_.T_G[f];
    const MatrixXcd& V = data_.T_V[f];
    for (Index c = 0; process && c < channels; ++c) {
      out.W.col(structure_.channels[c]) *= out.H[c];
    }
    out.WQ = out.W.lazyProduct(at.Q);
    out.VR = V.lazyProduct(at.R);
    if (!at.S.isZero(0.0)) {
      out.WQ += V.lazyProduct(at.S.transpose());
      out.VR += out.W.lazyProduct(at.S);
    }
    out.S = out.WQ.lazyProduct(out.W.adjoint());
    out.S += out.VR.lazyProduct(V.adjoint());
    for (Index c = 0; !process && c < channels; ++c) {
      const auto v = V.col(structure_.channels[c]);
      out.S += (at.own_variance[c] * std::norm(out.H[c]) * v).lazyProduct(v.adjoint());
    }
  }

  // x <- L^-1 x
  template <typename Vectors>
  void whiten(const AtFrequency& model, Vectors&& x) const {
    const MatrixXcd& L = model.factor.matrixLLT();
    for (Index i = 0; i < ny_; ++i) {
      for (Index j = 0; j < i; ++j) x.row(i) -= L(i, j) * x.row(j);
      x.row(i) /= L(i, i).real();
    }
  }

  void whiten_misfit(Index f, AtFrequency& out) const {
    out.misfit = data_.measured.S[f];
    whiten(out, out.misfit);
    out.misfit.adjointInPlace();
    whiten(out, out.misfit);
    out.misfit = MatrixXcd::Identity(ny_, ny_) - out.misfit;
  }

  // Of a Hermitian matrix: real numbers whose scalar product is the trace of the product.
  template <typename Out>
  void pack(const MatrixXcd& M, double factor, Out&& to) const {
    Index n = 0;
    for (Index j = 0; j < ny_; ++j) {
      to[n++] = factor * M(j, j).real();
      for (Index i = j + 1; i < ny_; ++i) {
        to[n++] = factor * std::numbers::sqrt2 * M(i, j).real();
        to[n++] = factor * std::numbers::sqrt2 * M(i, j).imag();
      }
    }
  }

  // Of the spectrum by every coordinate. Overwrites what the model's spectrum is made of.
  void set_derivatives(const Coefficients& at, Index f, double factor, AtFrequency& model,
                       Eigen::Ref<MatrixXd> to) const {
    MatrixXcd V = data_.T_V[f], T_G = data_.T_G[f], M(ny_, ny_);
    for (MatrixXcd* vectors : {&model.W, &model.WQ, &model.VR, &V, &T_G}) whiten(model, *vectors);
    Index column = 0;
    const auto add_symmetric = [&](const auto& u, const auto& v, double scale) {
      M = u.lazyProduct(v.adjoint());
      M = (M + M.adjoint()).eval();
      pack(M, 0.5 * scale, to.col(column++));
    };
    for (Index i = 0; i < nw_; ++i) add_symmetric(model.WQ.col(i), model.W.col(i), factor);
    for (Index i = 0; i < ny_; ++i) add_symmetric(model.VR.col(i), V.col(i), factor);
    for (std::size_t c = 0; c < at.filters.size(); ++c) {
      const Index channel = structure_.channels[c];
      const VectorXcd dzeta = response_derivatives(at, model, c);
      if (structure_.source == NoiseSource::process) {
        // WQ already holds this channel's H; what changes is its column of W: d* base + d base*.
        const MatrixXcd base = model.WQ.col(channel).lazyProduct(T_G.col(channel).adjoint());
        for (const std::complex<double>& d : dzeta) {
          M = std::conj(d) * base + d * base.adjoint();
          pack(M, factor, to.col(column++));
        }
        continue;
      }
      const std::complex<double> h = model.H[static_cast<Index>(c)];
      M = V.col(channel).lazyProduct(V.col(channel).adjoint());
      const double scale = factor * at.own_variance[static_cast<Index>(c)];
      pack(M, scale * std::norm(h), to.col(column++));
      for (const std::complex<double>& d : dzeta) {
        pack(M, scale * 2.0 * (std::conj(h) * d).real(), to.col(column++));
      }
    }
  }

  // Of a filter's response by zeta of its poles, then of its zeros.
  VectorXcd response_derivatives(const Coefficients& at, const AtFrequency& model,
                                 std::size_t c) const {
    const Index order = structure_.order, zeros = structure_.zeros();
    VectorXcd out(order + zeros);
    out.head(order) = at.Ja[c].transpose().cast<std::complex<double>>() * model.dH[c].head(order);
    out.tail(zeros) = at.Jb[c].transpose().cast<std::complex<double>>() * model.dH[c].tail(zeros);
    return out;
  }

  const InnovationSpectrum& data_;
  ShapingStructure structure_;
  Index nw_ = 0, ny_ = 0;
};

// Frequencies where the innovations have most power, apart from one another.
std::vector<double> peaks(const Spectrum& measured) {
  VectorXd height(measured.omega.size());
  for (Index k = 0; k < height.size(); ++k) {
    height[k] = measured.S[k].real().trace();
  }
  // One frequency alone may be high by chance.
  VectorXd smooth = height;
  for (Index k = 1; k + 1 < height.size(); ++k) smooth[k] = height.segment(k - 1, 3).mean();
  std::vector<double> out;
  constexpr double kApart = 0.15;  // rad per sample
  constexpr int kMost = 2;
  for (int p = 0; p < kMost; ++p) {
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

}  // namespace

InnovationSpectrum innovation_spectrum(const Model& white, const Dataset& recording) {
  constexpr Index kBins = 250;
  constexpr int kTapers = 3;
  const LinearModel& linear = as_linear(white);
  const StateSpace m = instantiate(linear, white.parameters);
  const auto steady = steady_state(m);
  if (!steady) {
    throw InputError({white.source, 0, 0}, "the filter of the tuned model has no steady state",
                     "a model whose unstable states the outputs show and the noise moves");
  }
  const FilterResult filter =
      kalman_filter(m, linear.initial, recording.y, recording.u, Keep::innovations);
  InnovationSpectrum out;
  out.measured =
      binned(multitaper(filter.e.rightCols(filter.e.cols() - filter.first_proper), kTapers), kBins);
  out.samples = recording.y.array().isFinite().count();
  out.Q = m.Q;
  out.R = m.R;
  out.S = m.S;
  const Index n = m.states(), ny = m.outputs();
  const MatrixXd F = m.A - steady->K * m.C;
  MatrixXd sources(n, m.G.cols() + ny);
  sources << m.G, steady->K;
  for (Index k = 0; k < out.measured.omega.size(); ++k) {
    const MatrixXcd y =
        m.C.cast<std::complex<double>>() * state_response(F, out.measured.omega[k], sources);
    out.T_G.push_back(y.leftCols(m.G.cols()));
    out.T_V.push_back(MatrixXcd::Identity(ny, ny) - y.rightCols(ny));
  }
  return out;
}

Model with_raised_variances(Model white, InnovationSpectrum& spectrum) {
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
      Parameter& p = white.parameters[matrix.block];
      for (Index i = 0; !p.fixed && i < whole.size(); ++i) {
        if (std::isfinite(whole[i]) && p.value(i, i) < kNothing * whole[i])
          p.value(i, i) += kRaised * whole[i];
      }
      if (!p.fixed && p.domain == Domain::scaled_identity) {
        p.value = p.value.diagonal().mean() * MatrixXd::Identity(whole.size(), whole.size());
      }
    }
    for (const ParametrisedMatrix::Entry& e : matrix.entries) {
      Parameter& p = white.parameters[e.parameter];
      if (p.fixed || e.row != e.col || !(e.factor > 0.0)) continue;
      const double most = whole[e.row] / e.factor;
      if (!std::isfinite(most) || p.scalar() >= kNothing * most) continue;
      p.value(0, 0) = std::clamp(kRaised * most, p.min, p.max);
    }
  };
  const LinearModel& linear = as_linear(white);
  raise(linear.R, power);
  raise(linear.Q, VectorXd::Constant(nw, power.sum()).cwiseQuotient(gain));
  const StateSpace m = instantiate(linear, white.parameters);
  spectrum.Q = m.Q;
  spectrum.R = m.R;
  return white;
}

LikelihoodProblem spectral_problem(const InnovationSpectrum& spectrum,
                                   const ShapingStructure& structure) {
  const auto fit = std::make_shared<const SpectralFit>(spectrum, structure);
  LikelihoodProblem out;
  out.evaluate = [fit](const VectorXd& x, double& L, VectorXd* gradient, MatrixXd* information) {
    return fit->evaluate(x, L, gradient, information);
  };
  out.lower = VectorXd::Constant(fit->unknowns(), -kFarthestZeta);
  out.upper = VectorXd::Constant(fit->unknowns(), kFarthestZeta);
  const Index variances = spectrum.Q.rows() + spectrum.R.rows();
  out.lower.head(variances).setConstant(-30.0);
  out.upper.head(variances).setConstant(10.0);
  for (std::size_t c = 0; structure.own_variance() && c < structure.channels.size(); ++c) {
    out.lower[fit->filter_begin(c)] = -100.0;
    out.upper[fit->filter_begin(c)] = 100.0;
  }
  return out;
}

SpectralSolution fit_spectrum(const InnovationSpectrum& spectrum, const ShapingStructure& structure,
                              const SpectralSolution* lower) {
  const SpectralFit fit(spectrum, structure);
  const LikelihoodProblem problem = spectral_problem(spectrum, structure);
  std::vector<VectorXd> known;
  if (lower != nullptr) {
    for (const ShapedChannel& channel : lower->channels) known.push_back(channel.filter.a);
  }
  SolverOptions solver;
  solver.max_iterations = 40;
  solver.decrement_tolerance = 1e-4;
  VectorXd best;
  SpectralSolution out;
  for (const VectorXd& poles : pole_starts(structure.order, peaks(spectrum.measured), known)) {
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
      x.segment(fit.poles_begin(c), structure.order) =
          zeta.cwiseMax(1.0 - kFarthestZeta).cwiseMin(kFarthestZeta - 1.0);
      if (!structure.own_variance()) {
        x[channel] = std::max(-std::log(gain), -20.0);
        continue;
      }
      double power = spectrum.R(channel, channel);
      if (!(power > 0.0)) power = spectrum.measured.S[0].real().trace();
      x[fit.filter_begin(c)] = std::log(0.3 * power / gain);
    }
    if (!x.allFinite()) continue;  // outputs that run away have no power to begin with
    x = x.cwiseMax(problem.lower).cwiseMin(problem.upper);
    const Solution solution = maximise(problem, x, solver);
    if (!(solution.summary.objective > out.log_likelihood)) continue;
    best = solution.x;
    out.log_likelihood = solution.summary.objective;
  }
  out.structure = structure;
  if (best.size() == 0) return out;
  out.bic = -2.0 * out.log_likelihood +
            static_cast<double>(fit.unknowns()) * std::log(static_cast<double>(spectrum.samples));
  const Index nw = spectrum.Q.rows(), ny = spectrum.R.rows();
  out.scale_Q = best.head(nw).array().exp();
  out.scale_R = best.segment(nw, ny).array().exp();
  for (std::size_t c = 0; c < structure.channels.size(); ++c) {
    const double variance = structure.own_variance() ? std::exp(best[fit.filter_begin(c)]) : 1.0;
    out.channels.push_back(
        {structure.channels[c], fit.filter(best, c, nullptr, nullptr), variance});
  }
  return out;
}

}  // namespace identikal
