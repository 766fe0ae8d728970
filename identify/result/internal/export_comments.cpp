#include "identify/result/internal/export_comments.h"

#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/result/schema.h"

namespace identikal {
namespace {

std::string unit_text(const std::string& unit) { return unit.empty() ? "" : " " + unit; }

std::string status_line(const StoredEstimate& e) {
  switch (e.status) {
    case Status::untrusted:
      return "NOT TO BE TRUSTED: " + e.message;
    case Status::not_converged:
      return "NOT CONVERGED, the best so far: " + e.message;
    case Status::rejected:
      return "REJECTED: " + e.message;
    case Status::ok:
      break;
  }
  return "status ok: " + e.message;
}

}  // namespace

bool is_straight(const EstimatedParameter& p) { return std::isinf(p.value); }

std::string remark_of(const EstimatedParameter& p) {
  if (p.fixed) return "known";
  std::string out = std::isfinite(p.se) ? fmt::format("se {:.3g}{}", p.se, unit_text(p.unit))
                                        : std::string("no standard error");
  std::string with;
  for (const std::string& name : p.with) with += " " + name;
  switch (p.verdict) {
    case Verdict::at_bound:
      if (is_straight(p)) return "beyond what the recording showed: this axle stays straight";
      return "AT ITS BOUND, no standard error" +
             (p.value == 0.0 && std::isfinite(p.ci95[1])
                  ? fmt::format(", below {:.4g}{} (95 %)", p.ci95[1], unit_text(p.unit))
                  : std::string());
    case Verdict::not_identifiable:
    case Verdict::unexcited:
      return "NOT DETERMINED by the data" + (with.empty() ? "" : ", only with" + with);
    case Verdict::unfitted:
      return "NOT FITTED: where the search would have started";
    case Verdict::untrusted:
      return out + ", NOT TO BE TRUSTED";
    case Verdict::ok:
    case Verdict::poorly_determined:
    case Verdict::correlated:
      break;
  }
  return out + ", " + in_words(to_string(p.verdict)) + (with.empty() ? "" : " with" + with);
}

std::vector<std::string> origin_lines(const StoredResult& result, const std::string& date) {
  const StoredEstimate& e = result.estimate;
  std::vector<std::string> out;
  const std::string& method = e.objective.method;
  out.push_back(fmt::format("{}: identikal {}{}, version {}{}", e.model_name, e.verb,
                            method.empty() || method == e.verb ? "" : " (" + method + ")",
                            result.version, date.empty() ? "" : ", result written " + date));
  out.push_back(status_line(e));
  for (const Finding& w : printed(e.findings)) {
    if (w.code == FindingCode::data_treated) out.push_back("recorded: " + w.text);
    if (w.severity == Severity::note) continue;
    out.push_back((w.severity == Severity::serious ? "SERIOUS: " : "warning: ") + w.text);
  }
  if (e.model_file) {
    out.push_back(fmt::format("model {}, sha256 {}", e.model_file->path, e.model_file->sha256));
  }
  for (const InputRecord& input : e.inputs) {
    out.push_back(fmt::format("data {}, {} of {} rows used, sha256 {}", input.path, input.used,
                              input.rows, input.sha256));
  }
  if (!result.command.empty()) out.push_back("command: " + result.command);
  return out;
}

std::vector<std::string> parameter_lines(const StoredEstimate& e, bool with_known) {
  std::vector<std::string> out;
  for (const EstimatedParameter& p : e.parameters) {
    if (p.fixed && !with_known) continue;
    out.push_back(
        fmt::format("{} = {:.6g}{}, {}", p.name, p.value, unit_text(p.unit), remark_of(p)));
  }
  if (!e.covariance_kind.empty()) out.push_back("se from " + e.covariance_kind);
  return out;
}

std::vector<std::string> vehicle_lines(const StoredEstimate& e) {
  std::vector<std::string> out{
      "single-track model, ISO 8855: x forward, y and angles positive to the left; C of an axle is "
      "Cf or Cr",
      "m (vy' + vx r) = Ff + Fr - m g sin(bank), Iz r' = a Ff - b Fr",
      "delta(t) = steering_gain (angle(t - steering_delay) + steering_offset) / steering_ratio",
      "slip alpha_f = (vy + a r)/vx - delta, alpha_r = (vy - b r)/vx; linear force L = -C alpha"};
  if (e.tyre_curve == "linear") out.emplace_back("tyre curve linear: F = L");
  if (e.tyre_curve == "tanh") {
    out.emplace_back("tyre curve tanh: F = D tanh(L/D), D = Ff_max or Fr_max");
  }
  if (e.tyre_curve == "fiala") {
    out.emplace_back(
        "tyre curve fiala: x = |L|/D, F = L (1 - x/3 + x^2/27) up to x = 3, then D sign(L); D = "
        "Ff_max or Fr_max");
  }
  if (e.tyre_curve == "magic-formula") {
    out.emplace_back(
        "tyre curve magic-formula: F = D sin(c atan(y - e (y - atan(y)))), y = L/(c D), D = Ff_max "
        "or Fr_max, c = curve_shape, e = curve_curvature");
  }
  for (const EstimatedParameter& p : e.parameters) {
    if (!is_straight(p)) continue;
    out.push_back(
        fmt::format("F = L for the {} axle, so there is no {}: it stays straight as far "
                    "as the recording goes",
                    p.name == "Ff_max" ? "front" : "rear", p.name));
  }
  if (!e.driven.empty()) {
    std::vector<std::string> ranges;
    for (const DrivenRange& range : e.driven) ranges.push_back(in_words(range));
    out.push_back(fmt::format("fitted to {}; beyond, nothing is known", fmt::join(ranges, ", ")));
  }
  return out;
}

std::string channel_list(const std::vector<SteadyFilter::Channel>& channels, const char* unit_is) {
  std::string out;
  for (const SteadyFilter::Channel& c : channels) {
    out += fmt::format("{}{}{}", out.empty() ? "" : ", ", c.name,
                       c.unit.empty() ? "" : fmt::format(" ({}{})", unit_is, c.unit));
  }
  return out;
}

std::vector<std::string> filter_lines(const StoredEstimate& e) {
  const SteadyFilter& f = *e.filter;
  std::vector<std::string> out;
  out.emplace_back(
      "x(t+1) = A x + B u + G w, y = C x + D u + v, cov[w; v] = [Q S; S' R], discrete time, SI");
  if (!f.states.empty()) out.push_back("states x: " + channel_list(f.states, ""));
  out.push_back("outputs y: " + channel_list(f.outputs));
  if (!f.inputs.empty()) out.push_back("inputs u: " + channel_list(f.inputs));
  out.emplace_back("innovation e = y - C x_pred - D u");
  if (f.K.size() == 0) {
    out.emplace_back("this model has no steady filter, and so no K and L");
    return out;
  }
  out.emplace_back(
      "predictor form, one gain: x_pred(t+1) = A x_pred(t) + B u(t) + K_predictor e(t)");
  const bool crossed = !f.model.S.isZero(0.0);
  out.push_back(
      std::string("filter form, two steps: x_filt(t) = x_pred(t) + L_filter e(t), x_pred(t+1) = A "
                  "x_filt(t) + B u(t)") +
      (crossed ? " + G S Sigma^-1 e(t)" : ""));
  out.emplace_back("both gains hold once the filter has settled, where no sample is missing");
  return out;
}

std::string commented(const std::vector<std::string>& lines, const std::string& mark) {
  std::string out;
  for (const std::string& line : lines) {
    std::string text = line;
    for (char& c : text) {
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
    }
    while (!text.empty() && text.back() == ' ') text.pop_back();
    if (text.ends_with('\\') || text.ends_with("?"
                                               "?/"))
      text += " .";
    out += text.empty() ? mark + "\n" : mark + " " + text + "\n";
  }
  return out;
}

}  // namespace identikal
