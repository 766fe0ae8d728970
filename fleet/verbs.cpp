#include "fleet/verbs.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <set>

#include "fleet/internal/mpi_world.h"
#include "fleet/mirrored_options.h"
#include "fleet/page.h"
#include "fleet/population.h"
#include "fleet/run.h"
#include "fleet/simulated.h"
#include "fleet/slurm.h"
#include "fleet/summary.h"
#include "fleet/table.h"
#include "fleet/task.h"
#include "jobs/output_files.h"
#include "jobs/run.h"
#include <fmt/format.h>
#include <glob.h>

#include "lib/base/error.h"
#include "lib/data/join.h"

namespace identikal {
namespace {

namespace fs = std::filesystem;

/// How the work is done; not what comes out of it.
struct EngineOptions {
  std::string engine = "local";
  std::string sbatch;
  std::int64_t workers = 0, shards = 0, retries = 3, timeout = 0;
  bool wait = false, dry_run = false, quiet = false;
};

struct FleetOptions {
  std::string verb, model, store, by;
  std::vector<std::string> manifests;
  MirroredOptions of_verb;
  EngineOptions engine;
};

void add_workers(Verb& verb, EngineOptions& options) {
  add_number(verb, "--workers", options.workers, 1, 4096,
             "Number of processes that share the recordings. Without it, one for each processor.");
  add_number(verb, "--retries", options.retries, 0, 1000,
             "Try a recording whose process ended by itself so many times again.");
  add_number(verb, "--timeout", options.timeout, 0, 10000000,
             "End a recording that takes longer than this many seconds; 0 stands for never.");
  add_quiet(verb, options.quiet);
}

void add_engine(Verb& verb, EngineOptions& options) {
  add_workers(verb, options);
  add_choice(verb, "--engine", options.engine, {"local", "slurm", "mpi"},
             "Choose who does the work: processes of this machine, the nodes of a Slurm cluster, "
             "or the ranks of 'mpirun identikal fleet ...'.");
  add_number(verb, "--shards", options.shards, 1, 100000,
             "slurm: Number of tasks of the array, which have about the same work. Without it, 8.");
  add_text(verb, "--sbatch", options.sbatch,
           "slurm: Further options of sbatch, e.g. '--partition=long --time=2:00:00'.");
  add_flag(verb, "--wait", options.wait, "slurm: Wait for the end of all of it.");
  add_flag(verb, "--dry-run", options.dry_run,
           "slurm: Print the scripts, and hand none of them in.");
}

void check_engine(const EngineOptions& options) {
  if (options.engine == "mpi" && options.workers > 0) {
    throw InputError({}, "--workers does not apply to --engine mpi", "mpirun -n N");
  }
  if (options.engine == "slurm") return;
  for (const auto& [given, name] :
       {std::pair{options.shards > 0, "--shards"}, std::pair{!options.sbatch.empty(), "--sbatch"},
        std::pair{options.wait, "--wait"}, std::pair{options.dry_run, "--dry-run"}}) {
    if (given) {
      throw InputError({}, fmt::format("{} does not apply to --engine {}", name, options.engine),
                       "--engine slurm");
    }
  }
}

std::string current_folder() { return fs::current_path().string(); }

// Paths of a store are relative to the folder where it was begun.
void check_folder(FleetStore& store) {
  const std::string folder = store.task().folder;
  if (folder == current_folder()) return;
  throw InputError({store.path()},
                   fmt::format("its recordings were named in the folder '{}', this is '{}'", folder,
                               current_folder()),
                   "the same folder", fmt::format("cd '{}' first", folder));
}

// Bytes of its files; a recording that is not there costs nothing.
double cost_of(const FleetJob& job) {
  double out = 0.0;
  if (is_simulation(job.recording)) return 1000.0;
  for (const std::string& file : joined_files(job.recording)) {
    std::error_code error;
    const auto size = fs::file_size(file, error);
    if (!error) out += static_cast<double>(size);
  }
  return out + 1000.0;  // to open a file takes time too
}

// Options of single recordings that no recording could take.
void check_options(const std::string& verb, const std::vector<FleetJob>& jobs) {
  std::set<std::string> seen;
  for (const FleetJob& job : jobs) {
    if (job.options.empty() || !seen.insert(job.options).second) continue;
    try {
      take_words(make_fleet_verb(verb), option_words(job.options));
    } catch (const InputError& error) {
      throw InputError({job.recording}, fmt::format("options '{}': {}", job.options, error.what()));
    }
  }
}

FleetTask task_of(const FleetOptions& options) {
  FleetTask out{options.verb, options.model,    options.of_verb.words(),
                options.by,   current_folder(), ""};
  out.digest = digest_of(out);
  return out;
}

FleetRun run_of(const EngineOptions& options, const Call& call) {
  FleetRun run;
  run.workers = static_cast<int>(options.workers);
  run.retries = static_cast<int>(options.retries);
  run.timeout = static_cast<double>(options.timeout);
  run.progress = [&call](const std::string& what, double share) {
    return report_progress(call, what, share);
  };
  return run;
}

Outcome run_here(FleetStore& store, const EngineOptions& options, const Call& call) {
  const FleetRun run = run_of(options, call);
  const FleetSummary summary =
      options.engine == "mpi" ? run_fleet_by_mpi(store, run) : run_fleet(store, run);
  Outcome out;
  out.text = summary_text(store, summary, !options.quiet);
  out.exit_code = exit_code_of(store.counts());
  return out;
}

bool is_other_rank(const EngineOptions& options) {
  return options.engine == "mpi" && rank_by_environment() > 0;
}

Outcome work_for_rank_0(const FleetTask& task, const EngineOptions& options, const Call& call) {
  work_as_rank(task, run_of(options, call));
  return {};
}

Outcome run_on_slurm(const std::string& store, const EngineOptions& options) {
  SlurmRun run;
  run.shards = options.shards > 0 ? static_cast<int>(options.shards) : 8;
  run.workers = options.workers > 0 ? static_cast<int>(options.workers) : 1;
  run.timeout = static_cast<double>(options.timeout);
  run.retries = static_cast<int>(options.retries);
  run.sbatch = options.sbatch;
  run.wait = options.wait;
  const SlurmScripts scripts = slurm_scripts(run, this_program(), fs::absolute(store).string());
  Outcome out;
  if (options.dry_run) {
    out.text = scripts.array + "\n" + scripts.merge;
    return out;
  }
  fs::create_directories(store + ".slurm");  // for what the tasks print
  const std::string number = submit(scripts, run);
  if (!run.wait) {
    out.text = fmt::format(
        "handed in: an array of {} tasks, and job {}, which merges their stores into {}\n"
        "'identikal fleet status {}' says how far it is\n",
        run.shards, number, store, store);
    return out;
  }
  FleetStore done(store, FleetStore::Open::read);
  out.text = status_text(done);
  out.exit_code = exit_code_of(done.counts());
  return out;
}

Outcome begin_fleet(const FleetOptions& options, const Call& call) {
  check_engine(options.engine);
  const FleetTask task = task_of(options);
  if (is_other_rank(options.engine)) return work_for_rank_0(task, options.engine, call);
  const std::vector<FleetJob> jobs = read_manifests(options.manifests);
  check_options(options.verb, jobs);
  std::vector<double> costs;
  for (const FleetJob& job : jobs) costs.push_back(cost_of(job));
  if (const fs::path folder = fs::path(options.store).parent_path(); !folder.empty()) {
    std::error_code error;
    fs::create_directories(folder, error);
  }
  {
    FleetStore store(options.store, FleetStore::Open::create);
    store.plan(task, jobs, costs);
    if (options.engine.engine != "slurm") return run_here(store, options.engine, call);
  }
  return run_on_slurm(options.store, options.engine);
}

/// "3/100"
std::pair<int, int> share_of(const std::string& text) {
  const std::size_t slash = text.find('/');
  const auto whole = [](const std::string& digits) {
    const bool plain = !digits.empty() && digits.size() < 7 &&
                       digits.find_first_not_of("0123456789") == std::string::npos;
    return plain ? std::stoi(digits) : 0;
  };
  const int k = whole(text.substr(0, slash));
  const int n = slash == std::string::npos ? 0 : whole(text.substr(slash + 1));
  if (k < 1 || k > n) {
    throw InputError({}, fmt::format("--shard '{}'", text), "K/N, K from 1 to N, e.g. 3/100");
  }
  return {k, n};
}

std::string name_of_share(const std::string& store, int k, int n) {
  return fmt::format("{}.{}-of-{}", store, k, n);
}

Outcome resume_share(const std::string& path, const std::string& shard,
                     const EngineOptions& options, const Call& call) {
  const auto [k, n] = share_of(shard);
  std::optional<std::pair<std::int64_t, std::int64_t>> share;
  {
    FleetStore whole(path, FleetStore::Open::read);
    check_folder(whole);
    share = whole.share(k, n);
  }
  Outcome out;
  if (!share) {
    out.text = fmt::format("share {} of {} has no recordings\n", k, n);
    return out;
  }
  FleetStore own(name_of_share(path, k, n), FleetStore::Open::create);
  own.copy_share(path, share->first, share->second);
  return run_here(own, options, call);
}

struct ResumeOptions {
  std::string store, shard;
  EngineOptions engine;
};

// A model file that has changed since is another task.
void renew_task(FleetStore& store, const Call& call) {
  FleetTask task = store.task();
  task.digest = digest_of(task);
  if (task.digest == store.task().digest) return;
  notice(call,
         fmt::format("'{}' or this program has changed since: all is done again", task.model));
  store.set_task(task);
}

Outcome resume(const ResumeOptions& options, const Call& call) {
  check_engine(options.engine);
  if (!options.shard.empty()) {
    if (options.engine.engine != "local") {
      throw InputError({}, "--shard with --engine " + options.engine.engine, "one of the two");
    }
    return resume_share(options.store, options.shard, options.engine, call);
  }
  if (is_other_rank(options.engine)) {
    FleetTask task = FleetStore(options.store, FleetStore::Open::read).task();
    task.digest = digest_of(task);
    return work_for_rank_0(task, options.engine, call);
  }
  {
    FleetStore store(options.store, FleetStore::Open::write);
    check_folder(store);
    renew_task(store, call);
    if (options.engine.engine != "slurm") return run_here(store, options.engine, call);
  }
  return run_on_slurm(options.store, options.engine);
}

std::vector<std::string> shares_beside(const std::string& store) {
  std::string pattern;
  for (const char c : store) {
    if (std::string_view("*?[\\").find(c) != std::string_view::npos) pattern += '\\';
    pattern += c;
  }
  glob_t found{};
  std::vector<std::string> out;
  if (glob((pattern + ".*-of-*").c_str(), 0, nullptr, &found) == 0) {
    for (std::size_t i = 0; i < found.gl_pathc; ++i) {
      const std::string path = found.gl_pathv[i];
      if (path.find_first_not_of("0123456789-of", store.size() + 1) == std::string::npos) {
        out.push_back(path);
      }
    }
  }
  globfree(&found);
  return out;
}

struct MergeOptions {
  std::string store;
  std::vector<std::string> others;
};

Outcome merge(const MergeOptions& options, const Call& call) {
  const bool given = !options.others.empty();
  const std::vector<std::string> others = given ? options.others : shares_beside(options.store);
  FleetStore store(options.store, FleetStore::Open::write);
  std::int64_t taken = 0;
  for (const std::string& other : others) {
    if (given) {
      taken += store.take_from(other);
      continue;
    }
    try {
      const FleetStore at_rest(other, FleetStore::Open::write);
      taken += store.take_from(other);
      // What they were for is in the store.
      std::error_code ignored;
      fs::remove(other, ignored);
    } catch (const InputError& error) {
      notice(call, error.what());
    }
  }
  Outcome out;
  out.text =
      fmt::format("{} recordings of {} stores taken\n", taken, others.size()) + status_text(store);
  out.exit_code = exit_code_of(store.counts());
  return out;
}

Verb fleet_verb(const std::string& name, const char* help) {
  const auto options = std::make_shared<FleetOptions>();
  options->verb = name;
  Verb verb{"fleet " + name, help};
  const bool of_result = name == "validate";
  add_argument(
      verb, of_result ? "RESULT" : "MODEL", options->model,
      of_result ? "Result to validate: result.json, or its folder." : "Model file (YAML).");
  add_arguments(verb, "MANIFEST", options->manifests,
                "Recordings: files, a folder, a quoted pattern such as 'drives/*.csv', a CSV "
                "file with a column recording and, where they are needed, unit, group, options "
                "and where, or simulations of the model such as 'simulate:1-500 -n 300'.");
  add_required_text(verb, "-o,--output", options->store,
                    "Store of the results, a SQLite database. What is in it already and still "
                    "holds is not done again.");
  add_text(verb, "--by", options->by,
           "Part every recording by the values of this column, with a row for each.");
  add_engine(verb, options->engine);
  options->of_verb.add(verb, make_fleet_verb(name));
  verb.run = [options](Call& call) { return begin_fleet(*options, call); };
  return verb;
}

}  // namespace

Verb fleet_tune_verb() {
  return fleet_verb("tune", "Estimate the noise covariances of each of many recordings.");
}

Verb fleet_fit_verb() { return fleet_verb("fit", "Fit a model to each of many recordings."); }

Verb fleet_check_verb() { return fleet_verb("check", "Test a filter on each of many recordings."); }

Verb fleet_validate_verb() {
  return fleet_verb("validate", "Score a result on each of many recordings.");
}

Verb fleet_resume_verb() {
  const auto options = std::make_shared<ResumeOptions>();
  Verb verb{"fleet resume", "Go on with a fleet: do what is not done, or has changed."};
  add_argument(verb, "STORE", options->store, "Store of the fleet.");
  add_text(verb, "--shard", options->shard,
           "Do the share K of N, e.g. 3/100, into a store of its own, STORE.K-of-N, for 'fleet "
           "merge'.");
  add_engine(verb, options->engine);
  verb.run = [options](Call& call) { return resume(*options, call); };
  return verb;
}

Verb fleet_status_verb() {
  struct StatusOptions {
    std::string store;
    bool json = false;
  };
  const auto options = std::make_shared<StatusOptions>();
  Verb verb{"fleet status", "Say how far a fleet is, and what came out of it."};
  add_argument(verb, "STORE", options->store, "Store of the fleet.");
  add_json(verb, options->json);
  verb.run = [options](Call&) {
    FleetStore store(options->store, FleetStore::Open::read);
    Outcome out;
    out.text = options->json ? status_json(store) : status_text(store);
    out.exit_code = exit_code_of(store.counts());
    return out;
  };
  return verb;
}

Verb fleet_population_verb() {
  struct PopulationRequest {
    std::string store;
    bool json = false;
  };
  const auto options = std::make_shared<PopulationRequest>();
  Verb verb{"fleet population",
            "Say what the units of a fleet have in common, how much they differ, and which of them "
            "do not belong."};
  add_argument(verb, "STORE", options->store, "Store of the fleet.");
  add_json(verb, options->json);
  verb.run = [options](Call&) {
    FleetStore store(options->store, FleetStore::Open::read);
    const Population population = population_of(store);
    Outcome out;
    out.text = options->json ? population_json(population) : population_text(population);
    return out;
  };
  return verb;
}

Verb fleet_report_verb() {
  struct PageRequest {
    std::string store, file;
  };
  const auto options = std::make_shared<PageRequest>();
  Verb verb{"fleet report", "Draw a fleet on one page (HTML)."};
  add_argument(verb, "STORE", options->store, "Store of the fleet.");
  add_required_text(verb, "-o,--output", options->file, "Write the page to this file.");
  verb.run = [options](Call&) {
    FleetStore store(options->store, FleetStore::Open::read);
    write_files({{options->file, fleet_page(store, population_of(store))}}, {options->store});
    Outcome out;
    out.text = fmt::format("{} written\n", options->file);
    return out;
  };
  return verb;
}

Verb fleet_export_verb() {
  struct TableOptions {
    std::string store, file;
  };
  const auto options = std::make_shared<TableOptions>();
  Verb verb{"fleet export", "Print a fleet's results as CSV, in the order of its manifest."};
  add_argument(verb, "STORE", options->store, "Store of the fleet.");
  add_file(verb, "-o,--output", options->file, "Write the table to this file instead.");
  verb.run = [options](Call& call) {
    FleetStore store(options->store, FleetStore::Open::read);
    Outcome out;
    const bool as_it_comes = options->file.empty() && call.print;
    write_table(store, [&](const std::string& text) {
      if (as_it_comes) {
        call.print(text);
      } else {
        out.text += text;
      }
    });
    if (!options->file.empty()) {
      write_files({{options->file, out.text}}, {options->store});
      out.text = fmt::format("{} written\n", options->file);
    }
    return out;
  };
  return verb;
}

Verb fleet_coverage_verb() {
  struct CoverageOptions {
    std::string store;
    bool json = false;
  };
  const auto options = std::make_shared<CoverageOptions>();
  Verb verb{"fleet coverage",
            "Set estimates from simulated recordings beside the values that these were made with."};
  add_argument(verb, "STORE", options->store, "Store of the fleet.");
  add_json(verb, options->json);
  verb.run = [options](Call&) {
    FleetStore store(options->store, FleetStore::Open::read);
    check_folder(store);
    const CoverageReport report = coverage_of(store);
    Outcome out;
    out.text = options->json ? coverage_json(report) : coverage_text(report);
    return out;
  };
  return verb;
}

Verb fleet_merge_verb() {
  const auto options = std::make_shared<MergeOptions>();
  Verb verb{"fleet merge", "Bring the stores of a fleet's shares together."};
  add_argument(verb, "STORE", options->store, "Store of the fleet.");
  Option others;
  others.names = "SHARES";
  others.help = "Stores of shares. Without them, STORE.K-of-N, which are taken away then.";
  others.value = &options->others;
  verb.options.push_back(std::move(others));
  verb.run = [options](Call& call) { return merge(*options, call); };
  return verb;
}

}  // namespace identikal
