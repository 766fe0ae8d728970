// How does a survey of a vehicle's recording read?
#pragma once

#include <string>

#include "identify/estimate/results.h"

namespace identikal {

/// The survey as text within 80 columns where names allow: signals, what kinematics ties together,
/// excitation, what could be identified, findings, and the mapping proposed.
///
/// Example:
///
///     const VehicleSurvey seen = survey(vehicle_signals(car, recordings));
///     std::puts(survey_text(seen).c_str());
///     std::puts(mapping_text(seen).c_str());
std::string survey_text(const VehicleSurvey& survey);

/// The mapping proposed, as lines of a model file: time, inputs, outputs, use_when.
std::string mapping_text(const VehicleSurvey& survey);

/// The whole model file, with that mapping. What a recording cannot tell (mass, axle distances,
/// ratio) stands there without a value, so that `fit` asks for it by line; serious findings stand
/// above as comments.
/// @param recording  name of the file that was surveyed
std::string proposed_model(const VehicleSurvey& survey, const std::string& recording);

}  // namespace identikal
