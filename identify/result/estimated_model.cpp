#include "identify/result/estimated_model.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <vector>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "identify/model/included_files.h"
#include "identify/model/model_file.h"
#include "identify/model/model_values.h"
#include "identify/model/yaml_reader.h"
#include "identify/result/file_digest.h"
#include "identify/result/values.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Texts of the files that the model file includes, as they were when the job ran.
FileTexts included_texts(const StoredEstimate& result, const std::string& path) {
  FileTexts read;
  for (const ModelSource::Included& file : result.model_file->included) {
    if (!file.text.empty()) {
      read[file.path] = file.text;
      continue;
    }
    std::error_code ignored;
    const bool there = std::filesystem::is_regular_file(file.path, ignored);
    if (there) read[file.path] = read_yaml_text(file.path);
    if (there && sha256_of_text(read[file.path]) == file.sha256) continue;
    throw InputError({path, 0, 0},
                     fmt::format("{}, which its model file includes, {}", file.path,
                                 there ? "has changed since" : "is no longer there"),
                     "the file as it was", "a result holds the text of the model file alone");
  }
  return read;
}

Model started_model(const StoredEstimate& result, const std::string& path) {
  if (!result.model_file) {
    throw InputError({path, 0, 0}, "holds no model file", "a result of tune, check or fit",
                     "run the job again with -o");
  }
  FileTexts read = included_texts(result, path);
  const ModelSource& file = *result.model_file;
  const YamlNode root = parse_with_included(file.text, file.path, read);
  if (result.objective.method != kSimulationMethod) return model_of(root, file.path);
  return simulated_in(result, model_of(root, file.path, FormulaReading::as_written));
}

// What takes the place of a part of a text, or is inserted before it.
struct Edit {
  std::size_t begin, end;
  std::string text;
};

class Editor {
 public:
  explicit Editor(const std::string& text) : text_(text) {}

  void replace(const YamlNode& node, const std::string& by) {
    if (const auto extent = extent_of(node, text_)) {
      edits_.push_back({(*extent)[0], (*extent)[1], by});
    } else {
      failed_ = true;
    }
  }
  /// Before the first key of a mapping, in the mapping's own style.
  void insert(const YamlNode& mapping, const std::string& key_and_value) {
    const auto extent = extent_of(mapping.keys.front(), text_);
    if (!extent) {
      failed_ = true;
      return;
    }
    const std::size_t begin = (*extent)[0], after_break = text_.rfind('\n', begin) + 1;
    const std::string before = text_.substr(after_break, begin - after_break);
    const bool own_line = before.find_first_not_of(' ') == std::string::npos;
    const auto previous = text_.find_last_not_of(" \t\r\n", begin == 0 ? 0 : begin - 1);
    const bool flow = previous != std::string::npos && text_[previous] == '{';
    if (!flow && !own_line) failed_ = true;
    edits_.push_back({begin, begin, key_and_value + (flow ? ", " : "\n" + before)});
  }
  std::optional<std::string> edited() {
    if (failed_) return std::nullopt;
    std::stable_sort(edits_.begin(), edits_.end(),
                     [](const Edit& a, const Edit& b) { return a.begin < b.begin; });
    std::string out;
    std::size_t at = 0;
    for (const Edit& edit : edits_) {
      if (edit.begin < at) return std::nullopt;
      out += text_.substr(at, edit.begin - at) + edit.text;
      at = edit.end;
    }
    return out + text_.substr(at);
  }

 private:
  const std::string& text_;
  std::vector<Edit> edits_;
  bool failed_ = false;
};

// The number that stands for a scalar: at a bound the one that the user wrote there, for its value
// in SI may round to either side of the bound.
std::string scalar_text(const Parameter& p, const YamlNode* node) {
  const double value = unit_or_dimensionless(p.unit).from_si(p.scalar());
  for (const char* key : {"min", "max"}) {
    if (node == nullptr || node->kind != YamlNode::Kind::mapping) break;
    const YamlNode* bound = find(*node, key);
    const auto number = bound == nullptr ? std::nullopt : plain_number(bound->text);
    if (number && std::abs(*number - value) <= 1e-12 * std::abs(value)) return bound->text;
  }
  return fmt::format("{}", value);
}

void put_scalar(const Parameter& p, const YamlNode& parameters, Editor& editor) {
  const YamlNode* node = find(parameters, p.name);
  const std::string number = scalar_text(p, node);
  if (node == nullptr) {
    editor.insert(parameters, fmt::format("{}: {{value: {}{}{}}}", p.name, number,
                                          p.unit.empty() ? "" : " ", p.unit));
    return;
  }
  const YamlNode& value = part_or_whole(*node, "value");
  const auto written = split_quantity(value.text);
  const std::string unit = written ? written->unit : "";
  editor.replace(value, number + (unit.empty() ? "" : " " + unit));
}

// The parameter whose values this one is the spread of; nullptr: it is none.
const Parameter* varying_by(const Model& model, std::size_t spread) {
  for (const RecordingTable::Own& own : model.recordings.own) {
    if (own.spread != static_cast<int>(spread)) continue;
    return &model.parameters[static_cast<std::size_t>(own.parameter)];
  }
  return nullptr;
}

void put_spread(const Parameter& spread, const Parameter& of, const YamlNode& parameters,
                Editor& editor) {
  const YamlNode* node = find(parameters, of.name);
  const YamlNode* written = node == nullptr ? nullptr : find(*node, "spread");
  if (written == nullptr) return;
  const auto quantity = split_quantity(written->text);
  const std::string unit = quantity ? quantity->unit : "";
  const double scale =
      unit.empty() ? unit_or_dimensionless(of.unit).scale : parse_unit(unit)->scale;
  const double value =
      spread.unit.empty() && unit.empty() ? spread.scalar() : spread.scalar() / scale;
  editor.replace(*written, fmt::format("{}{}{}", value, unit.empty() ? "" : " ", unit));
}

void put_matrix(const Parameter& p, const YamlNode& body, Editor& editor) {
  std::string text;
  for (Index i = 0; i < p.value.rows(); ++i) {
    if (p.domain == Domain::scaled_identity) {
      text = fmt::format("{}", p.value(0, 0));
      break;
    }
    text += i > 0 ? ", " : "[";
    if (p.domain == Domain::diagonal) {
      text += fmt::format("{}", p.value(i, i));
    } else {
      for (Index j = 0; j < p.value.cols(); ++j) {
        text += fmt::format("{}{}", j > 0 ? ", " : "[", p.value(i, j));
      }
      text += "]";
    }
    if (i + 1 == p.value.rows()) text += "]";
  }
  if (const YamlNode* start = find(body, "start")) {
    editor.replace(*start, text);
  } else {
    editor.insert(body, "start: " + text);
  }
  if (p.domain != Domain::positive_definite || p.fixed) return;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(p.value, Eigen::EigenvaluesOnly);
  if (eigen.eigenvalues()[0] > 1e-12 * eigen.eigenvalues().cwiseAbs().maxCoeff()) return;
  if (const YamlNode* fixed = find(body, "fixed")) {
    editor.replace(*fixed, "true");
  } else {
    editor.insert(body, "fixed: true");
  }
}

}  // namespace

Model estimated_model(const StoredEstimate& result, const std::string& path) {
  Model model = started_model(result, path);
  set_values(model, result, path);
  if (result.filter && has_filter(model)) noise_model(model).dt = result.filter->model.dt;
  return model;
}

std::optional<std::string> estimated_model_text(const StoredEstimate& result,
                                                const std::string& path) {
  const Model started = started_model(result, path), model = estimated_model(result, path);
  const std::string& source = result.model_file->text;
  const std::string text = source.starts_with("\xEF\xBB\xBF") ? source.substr(3) : source;
  const YamlNode root = parse_yaml(text, model.source);
  const YamlNode* parameters = find(root, "parameters");
  const bool includes = find(root, "include") != nullptr;
  Editor editor(text);
  FileTexts read = included_texts(result, path);
  const auto parsed = [&](const std::string& of) {
    return model_of(parse_with_included(of, model.source, read), model.source);
  };
  // Those of the file come first.
  const std::size_t count = parsed(text).parameters.size();
  for (std::size_t i = 0; i < count; ++i) {
    const Parameter& p = model.parameters[i];
    const bool same = p.value == started.parameters[i].value;
    if (!p.value.allFinite() || (same && p.fixed)) continue;
    const Parameter* varying = varying_by(model, i);
    // None that was found is no start of another search.
    if (varying != nullptr && !(p.scalar() > 0.0)) continue;
    if (p.domain == Domain::scalar) {
      if (parameters == nullptr) return std::nullopt;
      if (varying != nullptr) {
        put_spread(p, *varying, *parameters, editor);
        continue;
      }
      // What an included file says of its bounds and role would be lost.
      if (includes && find(*parameters, p.name) == nullptr) return std::nullopt;
      put_scalar(p, *parameters, editor);
    } else {
      const YamlNode* body = find(root, p.name);
      if (body == nullptr || body->kind != YamlNode::Kind::mapping) return std::nullopt;
      put_matrix(p, *body, editor);
    }
  }
  std::optional<std::string> out = editor.edited();
  if (!out) return out;
  // What was edited has to read as what was meant.
  Model again;
  try {
    again = parsed(*out);
  } catch (const InputError&) {
    return std::nullopt;
  }
  for (std::size_t i = 0; i < count; ++i) {
    // What had no line in the file has one in front of the others now.
    const int place = find_parameter(again.parameters, model.parameters[i].name);
    if (place < 0) return std::nullopt;
    const MatrixXd &meant = model.parameters[i].value,
                   &found = again.parameters[static_cast<std::size_t>(place)].value;
    const bool same = meant == started.parameters[i].value;
    if (!meant.allFinite() || (same && model.parameters[i].fixed)) continue;
    if (varying_by(model, i) != nullptr && !(meant(0, 0) > 0.0)) continue;
    if (meant.rows() != found.rows() ||
        !(meant - found).isZero(1e-12 * meant.cwiseAbs().maxCoeff()))
      return std::nullopt;
  }
  return out;
}

}  // namespace identikal
