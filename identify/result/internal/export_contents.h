// What is there to export, whatever the language?
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "identify/result/file.h"

namespace identikal {

enum class ExportKind { nothing, filter, vehicle, formulas };

ExportKind export_kind(const StoredEstimate& estimate);

struct NamedMatrix {
  std::string name;
  Eigen::MatrixXd value;
  std::string remark;
};

struct StructMember {
  std::string name, unit;
  double value, se;
  std::string remark, verdict;
};

struct ExportContents {
  bool differs_by_recording = false;  // some parameters do: there is no filter for another
  std::string suffix;                 // of the name that all stands under
  std::string group;                  // of the members, where a language has none of its own
  std::vector<StructMember> members;
  std::optional<double> dt;
  std::vector<NamedMatrix> matrices;
  std::string tyre_curve;
  std::string Q_kind;  // where no remark of a matrix tells a program
  std::vector<SteadyFilter::Channel> states, outputs, inputs;
  std::vector<std::string> lines;   // what a reader has to know
  std::optional<Model> program;     // whose filter is exported as functions
  double integration_step = kNone;  // [s]; not finite: one step from sample to sample
  // Times P is what the states' errors are, where something contradicts P.
  std::optional<double> covariance_factor;
};

/// @throws InputError when the result holds nothing to export, or lacks a number of it
ExportContents export_contents(const StoredResult& result);

}  // namespace identikal
