// One model of all recordings of a fleet: what units share, and what is their own, in one likelihood.
#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include "fleet/internal/message.h"
#include "fleet/internal/mpi_world.h"
#include "fleet/internal/row_condition.h"
#include "fleet/internal/workers.h"
#include "fleet/manifest.h"
#include "fleet/simulated.h"
#include "fleet/verbs.h"
#include "jobs/verbs.h"
#include <fmt/format.h>
#include <sched.h>

#include "lib/base/error.h"
#include "lib/data/join.h"
#include "solvers/parallel.h"

namespace identikal {
namespace {

namespace fs = std::filesystem;

struct JointOptions {
  std::vector<std::string> manifests;
  std::string by, engine = "local";
  std::int64_t workers = 0;
};

// A recording of the joint fit, as the verb is to call it.
struct JointRecording {
  std::string name;
  std::map<std::string, std::string> labels;
};

std::map<std::string, std::string> labels_of(const FleetJob& job) {
  std::map<std::string, std::string> out(job.covariates.begin(), job.covariates.end());
  if (!job.unit.empty()) out["unit"] = job.unit;
  if (!job.group.empty()) out["group"] = job.group;
  return out;
}

// Reads rows of recordings, and gives every recording a name of its own: parameters are called by it.
class RecordingNames {
 public:
  RecordingNames(const JointOptions& options, Inputs& inputs) : by_(options.by), inputs_(inputs) {}

  std::vector<JointRecording> of(const std::vector<FleetJob>& jobs) {
    for (const FleetJob& job : jobs) ++files_[stem(job.recording)];
    for (const FleetJob& job : jobs) add(job, jobs.size() == 1);
    return std::move(out_);
  }

 private:
  static std::string stem(const std::string& path) { return fs::path(path).stem().string(); }

  void add(const FleetJob& job, bool alone) {
    if (is_simulation(job.recording)) {
      throw InputError({job.recording}, "a simulation in a joint fit", "recordings",
                       "'identikal simulate' writes one");
    }
    if (!job.options.empty()) {
      throw InputError({job.recording}, "options of one recording in a joint fit",
                       "options of the command, which hold for all");
    }
    const bool whole = by_.empty() && job.where.empty();
    const bool own_name = files_[stem(job.recording)] == 1;
    if (whole && own_name) {
      take(job.recording, job, "");
      return;
    }
    if (joined_files(job.recording).size() > 1) {
      throw InputError({job.recording}, "rows of files that are joined", "one file",
                       "--by and 'where' choose rows of a single one");
    }
    const std::string text = read_csv_text(job.recording);
    const Table table = parse_csv(text, job.recording);
    const std::vector<std::size_t> rows = rows_where(job.where, text, table);
    if (by_.empty()) {
      keep(job.unit.empty() ? path_as_name(job.recording) : job.unit, rows_at(table, rows), job,
           "");
      return;
    }
    for (const RowGroup& group : groups_by(by_, text, table, rows)) {
      keep(alone ? group.value : stem(job.recording) + "_" + group.value,
           rows_at(table, group.rows), job, group.value);
    }
  }

  static std::string path_as_name(std::string path) {
    std::replace(path.begin(), path.end(), '/', '_');
    return path;
  }

  void keep(const std::string& name, Table table, const FleetJob& job, const std::string& part) {
    std::string own = name;
    for (int k = 2; !names_.insert(own).second; ++k) own = fmt::format("{}_{}", name, k);
    table.path = own;
    inputs_.keep_table(own, std::move(table));
    take(own, job, part);
  }

  void take(const std::string& name, const FleetJob& job, const std::string& part) {
    JointRecording recording{name, labels_of(job)};
    if (!part.empty()) recording.labels.emplace("unit", part);
    out_.push_back(std::move(recording));
  }

  const std::string& by_;
  Inputs& inputs_;
  std::map<std::string, int> files_;
  std::set<std::string> names_;
  std::vector<JointRecording> out_;
};

// Rank 0 of a team, whose others are these.
LikelihoodTeam team_of(const Workers& workers) {
  struct State {
    Workers workers;
    std::vector<FrameReader> frames;
  };
  const auto state = std::make_shared<State>();
  state->workers = workers;
  state->frames.resize(static_cast<std::size_t>(workers.count));
  for (int i = 0; i < workers.count; ++i) {
    workers.send(i, frame_of(fmt::format("{} {}", i + 1, workers.count + 1)));
  }
  LikelihoodTeam out;
  out.size = workers.count + 1;
  out.tell = [state](const std::string& bytes) {
    const std::string frame = frame_of(std::string_view(bytes));
    for (int i = 0; i < state->workers.count; ++i) state->workers.send(i, frame);
  };
  out.answers = [state] {
    std::vector<std::optional<std::string>> got(state->frames.size());
    const auto missing = [&] {
      return std::any_of(got.begin(), got.end(), [](const auto& one) { return !one; });
    };
    for (;;) {
      for (std::size_t i = 0; i < got.size(); ++i) {
        if (!got[i]) got[i] = state->frames[i].next();
      }
      if (!missing()) break;
      for (const WorkerEvent& event : state->workers.wait(1.0)) {
        state->frames[static_cast<std::size_t>(event.worker)].add(event.bytes);
        if (!event.ended) continue;
        throw OutputError(event.without_memory ? "a process of the joint fit had too little memory"
                                               : "a process of the joint fit has ended");
      }
    }
    std::vector<std::string> all;
    for (auto& one : got) all.push_back(std::move(*one));
    return all;
  };
  return out;
}

// The same fit, as another rank that works for rank 0.
void work_with(const Verb& fit, Call call, const Connection& connection) {
  const std::optional<std::string> first = connection.receive();
  if (!first) return;
  LikelihoodTeam team;
  const std::size_t space = first->find(' ');
  team.rank = std::stoi(first->substr(0, space));
  team.size = std::stoi(first->substr(space + 1));
  bool ended = false;
  team.hear = [&] {
    std::optional<std::string> bytes = connection.receive();
    ended = !bytes;
    return bytes;
  };
  team.answer = [&connection](const std::string& bytes) {
    connection.send(frame_of(std::string_view(bytes)));
  };
  call.team = &team;
  call.progress = nullptr;
  call.notice = nullptr;
  std::string failure = "the fit has ended on this process";
  try {
    fit.run(call);
  } catch (const std::exception& error) {
    failure = error.what();
  }
  while (!ended && team.hear()) team.answer(bytes_of_failure(failure));
}

// No processes of this machine beside the ranks.
Workers none_of_its_own() {
  Workers out;
  out.wait = [](double) {
    sched_yield();
    return std::vector<WorkerEvent>();
  };
  return out;
}

Outcome fit_over_mpi(const Verb& fit, Call& call) {
  MpiWorld world;
  use_threads_at_most(1);
  if (world.rank() > 0) {
    work_with(fit, call, world.connection());
    return {};
  }
  // It goes before MPI ends, and tells the others that no more will come.
  const LikelihoodTeam team =
      world.size() > 1 ? team_of(world.workers(none_of_its_own())) : LikelihoodTeam{};
  if (world.size() > 1) call.team = &team;
  return fit.run(call);
}

Outcome fit_on_this_machine(const Verb& fit, int processes, Call& call) {
  if (processes < 2) return fit.run(call);
  const Workers workers = local_workers(processes - 1, [&](const Connection& connection) {
    use_threads_at_most(1);
    work_with(fit, call, connection);
  });
  const LikelihoodTeam team = team_of(workers);
  call.team = &team;
  return fit.run(call);
}

Outcome joint(const JointOptions& options, const Verb& fit, Call& call) {
  if (options.engine == "mpi" && options.workers > 0) {
    throw InputError({}, "--workers does not apply to --engine mpi", "mpirun -n N");
  }
  std::vector<JointRecording> recordings;
  try {
    recordings = RecordingNames(options, call.inputs).of(read_manifests(options.manifests));
  } catch (const InputError&) {
    if (options.engine != "mpi" || rank_by_environment() == 0) throw;
    Outcome out;
    out.exit_code = 2;  // rank 0 says why
    return out;
  }
  const auto data = std::find_if(fit.options.begin(), fit.options.end(),
                                 [](const Option& option) { return option.names == "DATA"; });
  for (const JointRecording& recording : recordings) {
    take(*data, recording.name);
    call.inputs.keep_labels(recording.name, recording.labels);
  }
  if (options.engine == "mpi") return fit_over_mpi(fit, call);
  const std::int64_t processes = options.workers > 0 ? options.workers : usable_processors();
  return fit_on_this_machine(fit,
                             static_cast<int>(std::min<std::int64_t>(
                                 processes, static_cast<std::int64_t>(recordings.size()))),
                             call);
}

bool is_for_one_process(const Option& option) {
  const std::vector<std::string> kOthers = {
      "DATA",     "--threads",   "--robust",    "--reject-outliers",
      "--method", "--structure", "--bootstrap", "--objective"};
  return std::find(kOthers.begin(), kOthers.end(), option.called()) != kOthers.end();
}

}  // namespace

Verb fleet_joint_verb() {
  const auto options = std::make_shared<JointOptions>();
  const auto fit = std::make_shared<Verb>(fit_verb());
  Verb verb{"fleet joint",
            "Fit one model to all recordings at once: what they share, and what is their own."};
  for (const Option& option : fit->options) {
    if (option.names == "MODEL") verb.options.push_back(option);
  }
  add_arguments(verb, "MANIFEST", options->manifests,
                "Recordings: files, a folder, a quoted pattern such as 'drives/*.csv', or a CSV "
                "file with a column recording and, where they are needed, unit, group, where and "
                "other labels, which 'per' of a parameter may name.");
  add_text(verb, "--by", options->by,
           "Part every recording by the values of this column; the label 'unit' is its value.");
  add_number(verb, "--workers", options->workers, 1, 4096,
             "Number of processes that share the recordings. Without it, one for each processor.");
  add_choice(verb, "--engine", options->engine, {"local", "mpi"},
             "Choose who evaluates the likelihood: processes of this machine, or the ranks of "
             "'mpirun identikal fleet joint ...'.");
  for (const Option& option : fit->options) {
    if (!option.is_argument() && !is_for_one_process(option)) verb.options.push_back(option);
  }
  verb.run = [options, fit](Call& call) { return joint(*options, *fit, call); };
  return verb;
}

}  // namespace identikal
