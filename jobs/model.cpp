// model: which linear model do recordings of inputs and outputs ask for, when nobody brings one?
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <utility>

#include "jobs/output_files.h"
#include "jobs/quantity.h"
#include "jobs/run.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/black_box/black_box.h"
#include "identify/colour/shaped_model.h"
#include "identify/filter/pictures.h"
#include "identify/model/builder.h"
#include "identify/result/file_digest.h"
#include "lib/base/error.h"
#include "lib/base/median.h"

namespace identikal {
namespace {

constexpr const char* kModelFile = "model.yaml";
constexpr double kClearDelay = 0.25;  // of the largest response

struct BlackBoxVerbOptions {
  RecordingOptions recordings;
  ResultOptions result;
  std::string inputs, outputs, time, step, orders, purpose = "automatic", hold_out = "30%";
  std::string structure = "states", polynomials, delay, steps;
};

std::vector<std::string> names_in(const std::string& option, const std::string& list) {
  std::vector<std::string> out;
  for (std::size_t begin = 0; !list.empty() && begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    std::string name = list.substr(begin, end - begin);
    name.erase(0, name.find_first_not_of(' '));
    name.erase(name.find_last_not_of(' ') + 1);
    if (name.empty())
      throw InputError({}, fmt::format("an empty name in {} '{}'", option, list), "u1,u2");
    out.push_back(name);
    begin = end + 1;
  }
  return out;
}

std::string columns_of(const Table& table) {
  std::string out;
  for (const Column& column : table.columns) out += (out.empty() ? "" : ", ") + column.name;
  return out;
}

std::vector<ChannelSource> channels(const std::vector<std::string>& columns, const char* kind) {
  std::vector<ChannelSource> out;
  for (const std::string& column : columns) {
    ChannelSource source;
    const bool is_number = column.find_first_not_of("0123456789") == std::string::npos;
    source.name = is_number ? kind + column : column;
    source.column = column;
    out.push_back(source);
  }
  return out;
}

// Dates of days on which nothing is recorded are no gaps: of five days a week rows follow each other.
bool is_usable_time(const Column& column) {
  if (!looks_like_time(column) || column.text_cells > 0) return false;
  if (column.dates == Dates::none) return true;
  const std::vector<double> stamps = exact_stamps(column);
  std::vector<double> steps;
  for (std::size_t k = 1; k < stamps.size(); ++k) steps.push_back(stamps[k] - stamps[k - 1]);
  const double usual = median(steps);
  const auto even = std::count_if(steps.begin(), steps.end(), [&](double step) {
    return std::abs(step - usual) < 0.05 * usual;
  });
  constexpr double kMostly = 0.9;
  return static_cast<double>(even) > kMostly * static_cast<double>(steps.size());
}

// A column of time stamps, --step, or rows one after the other.
TimeSource time_of(const BlackBoxVerbOptions& given, const Table& table,
                   const std::vector<std::string>& taken) {
  TimeSource time;
  if (!given.step.empty()) time.step = quantity("--step", given.step, "s");
  if (!given.time.empty()) {
    time.column = given.time;
    return time;
  }
  if (time.step > 0.0) return time;
  for (const Column& column : table.columns) {
    const bool is_taken = std::find(taken.begin(), taken.end(), column.name) != taken.end();
    if (is_taken || !is_usable_time(column)) continue;
    time.column = column.name;
    time.unit = time_unit(column);
    return time;
  }
  time.step = 1.0;
  return time;
}

// What the recordings are read by: channels and time; the matrices say nothing yet.
Model channel_model(const BlackBoxVerbOptions& given, Inputs& inputs) {
  const std::vector<Table> files = read_files(given.recordings.files.front(), inputs);
  const Table& table = files.front();
  const std::vector<std::string> u = names_in("--input", given.inputs),
                                 y = names_in("--output", given.outputs);
  std::vector<std::string> all = u;
  all.insert(all.end(), y.begin(), y.end());
  for (auto each = all.begin(); each != all.end(); ++each) {
    if (std::find(all.begin(), each, *each) != each) {
      throw InputError({}, fmt::format("column '{}' is named twice", *each),
                       "each column once, in --input or --output");
    }
  }
  const auto p = static_cast<Eigen::Index>(y.size());
  LinearModelBuilder builder = linear_model();
  std::vector<std::string> names;
  for (const ChannelSource& each : channels(y, "y")) names.push_back(each.name);
  builder.A(0.0).C(Eigen::MatrixXd::Ones(p, 1)).process_noise(1.0).outputs(names);
  builder.measurement_noise(Eigen::MatrixXd(Eigen::MatrixXd::Identity(p, p)));
  names.clear();
  for (const ChannelSource& each : channels(u, "u")) names.push_back(each.name);
  if (!u.empty())
    builder.B(Eigen::MatrixXd::Ones(1, static_cast<Eigen::Index>(u.size()))).inputs(names);
  Model out = builder.diffuse();
  out.name = std::filesystem::path(table.path).stem().string();
  out.time = time_of(given, table, all);
  out.inputs = channels(u, "u");
  out.outputs = channels(y, "y");
  return out;
}

int order_in(const std::string& text) {
  const bool is_number =
      !text.empty() && text.size() < 4 && text.find_first_not_of("0123456789") == std::string::npos;
  const int order = is_number ? std::stoi(text) : 0;
  if (order < 1 || order > 60)
    throw InputError({}, fmt::format("--order '{}' is none", text), "4, or 1:12; at most 60");
  return order;
}

int rows_in(const std::string& option, const std::string& text, int least, int most) {
  const bool is_number =
      text.size() < 5 && text.find_first_not_of("0123456789") == std::string::npos;
  const int rows = is_number ? std::stoi(text) : -1;
  if (rows < least || rows > most) {
    throw InputError({}, fmt::format("{} '{}' is none", option, text),
                     fmt::format("a number of rows from {} to {}", least, most));
  }
  return rows;
}

// "na=2,nb=3,nk=1": coefficients of each polynomial, and rows until an input is seen.
void take_polynomials(const std::string& text, BlackBoxOptions& out) {
  PolynomialOrders orders;
  for (const std::string& each : names_in("--polynomials", text)) {
    const std::size_t equals = std::min(each.find('='), each.size());
    const std::string name = each.substr(0, equals),
                      number = each.substr(std::min(equals + 1, each.size()));
    Eigen::Index* place = name == "na"   ? &orders.na
                          : name == "nb" ? &orders.nb
                          : name == "nc" ? &orders.nc
                          : name == "nd" ? &orders.nd
                          : name == "nf" ? &orders.nf
                                         : nullptr;
    const bool is_number = !number.empty() && number.size() < 3 &&
                           number.find_first_not_of("0123456789") == std::string::npos;
    if (place == nullptr || !is_number || std::stoi(number) > 60) {
      throw InputError({}, fmt::format("'{}' in --polynomials", each),
                       "na, nb, nc, nd or nf and a number up to 60: na=2,nb=3,nc=1");
    }
    *place = std::stoi(number);
  }
  out.polynomials = orders;
}

struct StructureName {
  const char* name;
  ModelStructure structure;
  const char* allowed;  // its polynomials
};
constexpr StructureName kStructures[] = {
    {"states", ModelStructure::states, ""},      {"arx", ModelStructure::arx, "ab"},
    {"armax", ModelStructure::armax, "abc"},     {"oe", ModelStructure::output_error, "bf"},
    {"bj", ModelStructure::box_jenkins, "bcdf"},
};

// Which polynomials a structure has, and whether an option is one of a structure without them.
void check_polynomials(const BlackBoxVerbOptions& given, const StructureName& structure,
                       const BlackBoxOptions& options) {
  const bool of_states = options.structure == ModelStructure::states;
  if (of_states && !(given.polynomials.empty() && given.delay.empty())) {
    throw InputError(
        {}, fmt::format("{} without --as", given.delay.empty() ? "--polynomials" : "--delay"),
        "--as arx, armax, oe or bj");
  }
  if (!options.polynomials) return;
  if (!given.orders.empty()) {
    throw InputError({}, "both --order and --polynomials", "one of them");
  }
  const PolynomialOrders& n = *options.polynomials;
  const std::pair<char, Eigen::Index> all[] = {
      {'a', n.na}, {'b', n.nb}, {'c', n.nc}, {'d', n.nd}, {'f', n.nf}};
  const std::string_view allowed = structure.allowed;
  Eigen::Index sum = 0;
  for (const auto& [letter, count] : all) {
    sum += count;
    if (count == 0 || allowed.find(letter) != allowed.npos) continue;
    throw InputError({}, fmt::format("n{} of --polynomials with --as {}", letter, structure.name),
                     fmt::format("polynomials of that model: {}", fmt::join(allowed, ", ")));
  }
  const bool no_input = given.inputs.empty() && sum == n.nb;
  const bool nothing_driven = n.nb == 0 && n.nf > 0;
  if (sum == 0 || no_input || nothing_driven) {
    throw InputError({},
                     fmt::format("--polynomials {} leaves nothing to estimate", given.polynomials),
                     "at least one coefficient, and nb beside nf");
  }
}

void take_structure(const BlackBoxVerbOptions& given, BlackBoxOptions& out) {
  const StructureName* found = &kStructures[0];
  for (const StructureName& each : kStructures) {
    if (given.structure == each.name) found = &each;
  }
  out.structure = found->structure;
  if (!given.polynomials.empty()) take_polynomials(given.polynomials, out);
  if (!given.delay.empty()) out.delay = rows_in("--delay", given.delay, 0, 100);
  check_polynomials(given, *found, out);
}

BlackBoxOptions black_box_options(const BlackBoxVerbOptions& given, const Call& call) {
  BlackBoxOptions out;
  out.held_out_share = hold_out_share(given.hold_out);
  take_structure(given, out);
  if (!given.orders.empty()) {
    const std::size_t colon = given.orders.find(':');
    out.least_order = order_in(given.orders.substr(0, colon));
    out.most_order =
        colon == std::string::npos ? out.least_order : order_in(given.orders.substr(colon + 1));
    if (out.most_order < out.least_order) {
      throw InputError({}, fmt::format("--order '{}' falls", given.orders),
                       "the lowest order first, 1:12");
    }
  }
  if (given.purpose == "simulation") out.purpose = BlackBoxPurpose::simulation;
  if (given.purpose == "prediction") out.purpose = BlackBoxPurpose::prediction;
  if (given.purpose == "control") out.purpose = BlackBoxPurpose::control;
  const bool by_inputs = given.purpose == "simulation" || given.purpose == "control";
  if (by_inputs && given.inputs.empty()) {
    throw InputError({}, fmt::format("--for {} without --input", given.purpose),
                     "the columns that drive the outputs");
  }
  if (!given.steps.empty()) {
    if (given.purpose != "control") {
      throw InputError({}, "--steps without --for control",
                       "how many rows a controller looks ahead");
    }
    out.horizon = rows_in("--steps", given.steps, 1, 1000);
  }
  out.progress = [&call](const std::string& what) { return report_progress(call, what); };
  return out;
}

std::string text_of_candidate(const BlackBox::Candidate& each, bool for_control, bool chosen) {
  const auto number = [](double value) {
    if (std::isnan(value)) return std::string("-");
    return std::abs(value) < 1e8 ? fmt::format("{:.2f}", value) : fmt::format("{:.3g}", value);
  };
  const std::string control =
      for_control ? fmt::format(" {:>12}", number(each.control_fit)) : std::string();
  return fmt::format("{:>5} {:<16} {:>14} {:>12} {:>12}{}{}", each.order, each.refinement,
                     number(each.bic), number(each.prediction_fit), number(each.simulation_fit),
                     control, chosen ? "  <-" : "");
}

std::string number_with_error(double value, double se) {
  return std::isnan(se) ? fmt::format("{:.6g}", value) : fmt::format("{:.6g} +- {:.2g}", value, se);
}

// B of voltage: 0.3 +- 0.01 q^-1 + 0.2 +- 0.02 q^-2
std::string text_of_polynomial(const BlackBox::Polynomial& each, bool names_output) {
  std::string out = each.name + (each.input.empty() ? "" : " of " + each.input);
  if (names_output) out += " to " + each.output;
  out += ":";
  for (Eigen::Index k = 0; k < each.value.size(); ++k) {
    const long power = each.delay + static_cast<long>(k);
    const bool is_one = each.se[k] == 0.0;
    const double value = each.value[k];
    out += k == 0 ? (value < 0.0 ? " -" : " ") : value < 0.0 ? " - " : " + ";
    out += is_one ? fmt::format("{:g}", std::abs(value))
                  : number_with_error(std::abs(value), each.se[k]);
    if (power > 0) out += fmt::format(" q^-{}", power);
  }
  return out;
}

// To two digits of the error.
std::string rounded_with_error(double value, double se) {
  if (!(se > 0.0)) return number_with_error(value, se);
  const int decimals = std::max(0, 1 - static_cast<int>(std::floor(std::log10(se))));
  return fmt::format("{:.{}f} +- {:.{}f}", value, decimals, se, decimals);
}

// s^2 + (3.10 +- 0.12) s + (120.0 +- 3.1)
std::string text_of_coefficients(const Eigen::VectorXd& value, const Eigen::VectorXd& se) {
  std::string out;
  for (Eigen::Index k = 0; k < value.size(); ++k) {
    if (value[k] == 0.0 && se[k] == 0.0) continue;
    const Eigen::Index power = value.size() - 1 - k;
    const bool is_one = value[k] == 1.0 && se[k] == 0.0 && power > 0;
    out += out.empty() ? (value[k] < 0.0 ? "-" : "") : value[k] < 0.0 ? " - " : " + ";
    if (!is_one) out += fmt::format("({})", rounded_with_error(std::abs(value[k]), se[k]));
    if (!is_one && power > 0) out += " ";
    if (power > 0) out += power > 1 ? fmt::format("s^{}", power) : "s";
  }
  return out;
}

// Of few coefficients; the result file has the others.
void add_transfer_functions(const BlackBox& box, std::vector<std::string>& out) {
  constexpr Eigen::Index kMostStates = 4;
  for (const BlackBox::TransferFunction& each : box.transfer_functions) {
    if (each.denominator.size() > kMostStates + 1) return;
    const std::string of = fmt::format("{} / {} in continuous time", each.output, each.input);
    out.push_back(
        fmt::format("{}: {}", of, text_of_coefficients(each.numerator, each.numerator_se)));
    out.push_back(
        fmt::format("   over {}", text_of_coefficients(each.denominator, each.denominator_se)));
  }
}

// What was tried, and the model in the terms of an engineer, line by line.
std::vector<std::string> tables(const BlackBox& box) {
  const bool for_control = box.horizon > 0;
  const std::string ahead =
      for_control ? fmt::format("; control: 1 to {} rows ahead together", box.horizon) : "";
  std::vector<std::string> out{
      fmt::format("held-out last {:.0f} % of the rows, fit in % (mean over outputs){}",
                  100.0 * box.held_out_share, ahead),
      fmt::format("{:>5} {:<16} {:>14} {:>12} {:>12}{}", "order", "found by", "BIC", "prediction",
                  "simulation", for_control ? fmt::format(" {:>12}", "control") : "")};
  for (const BlackBox::Candidate& each : box.candidates) {
    out.push_back(text_of_candidate(each, for_control,
                                    each.order == box.order && each.refinement == box.refinement));
  }
  for (const BlackBox::Polynomial& each : box.polynomials)
    out.push_back(text_of_polynomial(each, box.outputs.size() > 1));
  for (const BlackBox::Pole& pole : box.poles) {
    const std::string imaginary =
        pole.imaginary > 0.0
            ? fmt::format(" +- ({})i", number_with_error(pole.imaginary, pole.imaginary_se))
            : "";
    out.push_back(fmt::format("pole {}{}: {:.4g} rad/s, damping {:.3g}",
                              number_with_error(pole.real, pole.real_se), imaginary, pole.frequency,
                              pole.damping));
  }
  for (Eigen::Index i = 0; i < box.gain.rows(); ++i) {
    for (Eigen::Index j = 0; j < box.gain.cols(); ++j) {
      out.push_back(fmt::format("steady gain {} / {}: {}", box.outputs[static_cast<std::size_t>(i)],
                                box.inputs[static_cast<std::size_t>(j)],
                                number_with_error(box.gain(i, j), box.gain_se(i, j))));
    }
  }
  add_transfer_functions(box, out);
  for (const BlackBox::Delay& each : box.delays) {
    if (each.rows == 0) continue;
    const char* rows = each.rows == 1 ? "row" : "rows";
    if (each.before > kClearDelay) {
      out.push_back(
          fmt::format("no response to '{}' within {} {} is seen, but none is ruled out either",
                      each.input, each.rows, rows));
      continue;
    }
    const std::string before =
        std::isnan(each.before) ? ""
                                : fmt::format("; before, at most {:.2g} % of its largest response",
                                              100.0 * each.before);
    out.push_back(
        fmt::format("'{}' is first seen after {} {}{}", each.input, each.rows, rows, before));
  }
  const bool moved = std::any_of(box.operating_point.begin(), box.operating_point.end(),
                                 [](const auto& each) { return each.value != 0.0; });
  for (const BlackBox::OperatingPoint& each : box.operating_point) {
    if (!moved) continue;
    const std::string unit = each.unit.empty() ? "" : " " + each.unit;
    out.push_back(fmt::format("operating point {} = {:.6g}{}", each.channel, each.value, unit));
  }
  return out;
}

bool is_model_file(const std::string& path) {
  return path.ends_with(".yaml") || path.ends_with(".yml");
}

Outcome find_model(const BlackBoxVerbOptions& given, Call& call) {
  if (given.outputs.empty()) {
    const std::vector<Table> files = read_files(given.recordings.files.front(), call.inputs);
    throw InputError({}, "--output is missing",
                     fmt::format("one or more of {}", columns_of(files.front())));
  }
  const BlackBoxOptions options = black_box_options(given, call);
  const Model channels = channel_model(given, call.inputs);
  Run run{"model", call, {}, {}, given.result};
  const Recordings recordings = load_recordings(given.recordings, channels, run.verb, call.inputs);
  BlackBoxResult found = estimate_black_box(channels, recordings.data, options);
  const BlackBox& box = found.estimate.black_box;
  found.estimate.notes = tables(box);
  const std::string text = model_text(
      found.model,
      {fmt::format("{} states from data alone, chosen for {}; driven by its innovations.",
                   box.order, box.purpose),
       "Offsets of the channels are its operating point."});
  if (run.wants_pictures()) picture_filter(found.model, found.recordings, found.estimate);
  const auto estimate = std::make_shared<BlackBoxEstimate>(std::move(found.estimate));
  KeptResult result = kept(estimate);
  result.take({kModelFile, sha256_of_text(text), text, {}});
  if (is_model_file(run.options.folder)) {
    write_files({{run.options.folder, text}}, given.recordings.files);
    run.options.folder.clear();
  }
  std::vector<ResultFile> files;
  if (!run.options.folder.empty()) files.push_back({kModelFile, text});
  return finish(run, recordings, std::move(result), files);
}

}  // namespace

Verb model_verb() {
  const auto options = std::make_shared<BlackBoxVerbOptions>();
  Verb verb{"model",
            "Find a linear model of inputs and outputs from recordings alone, with its noise."};
  add_recordings(verb, options->recordings);
  add_text(verb, "--input", options->inputs,
           "Columns that drive the others, by name or number: u1,u2.", "none");
  add_text(verb, "--output", options->outputs, "Columns that the model is to give: y1,y2.");
  add_text(verb, "--time", options->time, "Column of time stamps.", "one that is called so");
  add_text(verb, "--step", options->step, "Time from row to row, 10ms.", "by the stamps, else 1 s");
  add_choice(verb, "--as", options->structure, {"states", "arx", "armax", "oe", "bj"},
             "What kind of model. states: all outputs together, with their noise; the others are "
             "polynomials in the delay, every output by itself: ARX, ARMAX, output error, "
             "Box-Jenkins.");
  add_text(verb, "--order", options->orders,
           "Number of states, or of coefficients of each polynomial, or the range to choose from.",
           "1:12");
  add_text(verb, "--polynomials", options->polynomials,
           "Coefficients of each polynomial in place of --order: na=2,nb=3,nc=1.");
  add_text(verb, "--delay", options->delay, "Rows until the inputs are seen, of polynomials.",
           "as a test tells");
  add_choice(
      verb, "--for", options->purpose, {"automatic", "simulation", "prediction", "control"},
      "What the model is to be good at. simulation: outputs from inputs alone, judged on held-out "
      "rows; "
      "prediction: the next row, judged by BIC; control: all rows up to --steps ahead, judged on "
      "held-out rows; automatic: the likeliest, unless another simulates held-out rows better.");
  add_text(verb, "--steps", options->steps, "Rows ahead that count for control.",
           "until the slowest pole has come to 1/e");
  add_text(verb, "--hold-out", options->hold_out,
           "Last share of each recording that orders are judged on.");
  add_range(verb, options->recordings.range);
  add_folder(
      verb, "-o", options->result.folder,
      "Write the result files to this folder, or, where it ends in .yaml, the model to this file.");
  add_json(verb, options->result.json);
  add_strict(verb, options->result.strict);
  add_page(verb, options->result);
  verb.run = [options](Call& call) { return find_model(*options, call); };
  return verb;
}

}  // namespace identikal
