#include "identify/result/export.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/result/estimated_model.h"
#include "identify/result/internal/export_code.h"
#include "identify/result/internal/export_comments.h"
#include "identify/result/internal/export_contents.h"
#include "identify/result/internal/export_json.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

struct FormatNames {
  ExportFormat format;
  const char *name, *title, *comment;
};
constexpr FormatNames kFormats[] = {
    {ExportFormat::cpp, "cpp", "C++ (header)", "//"},
    {ExportFormat::c, "c", "C (header)", "//"},
    {ExportFormat::matlab, "matlab", "MATLAB, Octave", "%"},
    {ExportFormat::python, "python", "Python", "#"},
    {ExportFormat::yaml, "yaml", "Model file (YAML)", "#"},
    {ExportFormat::json, "json", "JSON", ""},
};

const FormatNames& names_of(ExportFormat format) {
  return *std::find_if(std::begin(kFormats), std::end(kFormats),
                       [&](const FormatNames& f) { return f.format == format; });
}

}  // namespace

const std::vector<std::string>& export_formats() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> out;
    for (const FormatNames& each : kFormats) out.emplace_back(each.name);
    return out;
  }();
  return names;
}

std::string export_format_list() {
  const std::vector<std::string>& names = export_formats();
  return fmt::format("{} or {}", fmt::join(names.begin(), names.end() - 1, ", "), names.back());
}

std::optional<ExportFormat> export_format(std::string_view name) {
  for (const FormatNames& each : kFormats) {
    if (name == each.name) return each.format;
  }
  return std::nullopt;
}

std::string_view describe(ExportFormat format) { return names_of(format).title; }

std::string export_text(const StoredResult& result, ExportFormat format, const std::string& date) {
  const StoredEstimate& e = result.estimate;
  const ExportContents contents = export_contents(result);
  if (contents.differs_by_recording && format != ExportFormat::yaml) {
    throw InputError({result.path, 0, 0},
                     "parameters with values of their own in each recording, which no filter has",
                     "a result about one recording, with its numbers in the model file",
                     "--to yaml prints the model file");
  }
  const FormatNames& names = names_of(format);
  std::vector<std::string> lines = origin_lines(result, date);
  const std::vector<std::string> more =
      format != ExportFormat::yaml ? contents.lines
                                   : parameter_lines(e, export_kind(e) == ExportKind::filter);
  lines.insert(lines.end(), more.begin(), more.end());
  const std::string comments = commented(lines, names.comment);
  switch (format) {
    case ExportFormat::cpp:
    case ExportFormat::c:
      return c_header(contents, e.model_name, comments, format == ExportFormat::cpp);
    case ExportFormat::matlab:
      return comments + matlab_script(contents);
    case ExportFormat::python:
      return comments + python_script(contents);
    case ExportFormat::json:
      return export_json(result, contents, date);
    case ExportFormat::yaml:
      break;
  }
  const std::optional<std::string> model = estimated_model_text(e, result.path);
  if (!model) {
    throw InputError(
        {e.model_file->path, 0, 0}, "the estimates cannot be put in the place of its values",
        "every value on one line of the model file itself, none in an included one", "--to json");
  }
  return comments + *model;
}

}  // namespace identikal
