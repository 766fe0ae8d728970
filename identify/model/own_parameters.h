// Which parameters have a value of their own in each recording, and which are shared by all of them?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/model/parameter.h"

namespace identikal {

/// The model of these recordings together, where its table (RecordingTable) says that some
/// parameters have values of their own there: for each of them a parameter is added, NAME_RECORDING or
/// NAME_LABEL, that starts where the file's does, or at a value found before, and is known where the
/// table has a number. Every recording says which of them it takes (Dataset::own). A model without
/// a table stays as it is.
///
///   p_i(recording) = p_source(i)     for the recording's own,     p_i     for all others
///
/// Example:
///
///     const Model model = read_model_file("growth.yaml");  // S0: {value: 1, per: recording}
///     const Model joint = for_recordings(model, recordings);
///     for (const Parameter& p : joint.parameters) std::puts(p.name.c_str());
///
/// @throws InputError where a recording has no row that says its label, or no value among those found
///   before, and where names of two recordings differ in signs alone
Model for_recordings(Model model, std::vector<Dataset>& recordings);

/// The same of further recordings, none of whose values are unknown: those of the file, or found.
/// @throws InputError for one that has an unknown of its own
void place_recordings(Model& model, std::vector<Dataset>& recordings);

/// Do values that differ between recordings do so by their logarithms? Of what cannot be negative.
bool varies_by_logarithm(const Parameter& parameter);

/// Is there a parameter whose values in recordings are draws of a population?
bool has_population(const Model& model);

/// Are this one's values such draws?
bool is_drawn(const Model& model, int parameter);

/// Could NAME be a parameter that for_recordings() adds, and of which one is it a value? -1: no.
int own_parameter_named(const Model& model, const std::string& name);

/// May recordings have values of their own of this parameter?
bool has_own_values(const Model& model, int parameter);

/// The values of all parameters in this recording.
ParameterSet values_in(const ParameterSet& at, const Dataset& recording);

/// The model of one recording alone: its parameters are those of the file, with this recording's
/// values, free where their sources are; without changes from row to row where its matrices hold none.
Model model_in(const Model& model, const Dataset& recording);

/// Of each parameter of model_in(), the place in the joint model of the one whose value it has.
std::vector<int> sources_in(const ParameterSet& joint, const Dataset& recording);

/// Of each free entry of the joint model the unit in whose recordings alone it has a say, -1: in
/// those of several. @param unit  of each recording; empty: each is one
std::vector<Eigen::Index> owners_of_entries(const Model& model,
                                            const std::vector<Dataset>& recordings,
                                            const std::vector<Eigen::Index>& unit = {});

/// Which free entry of the joint model each free entry of model_in() is.
std::vector<Eigen::Index> joint_entries(const Model& model, const Dataset& recording);

}  // namespace identikal
