#include "fleet/slurm.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <vector>

#include "fleet/manifest.h"
#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "lib/base/error.h"

extern char** environ;

namespace identikal {
namespace {

// As a word of sh.
std::string shell_word(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? "'\\''" : std::string(1, c);
  return out + "'";
}

struct Ended {
  int code = 0;
  std::string output;
};

std::string read_all(int file) {
  std::string out;
  std::array<char, 4096> piece;
  for (;;) {
    const ssize_t count = read(file, piece.data(), piece.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return out;
    out.append(piece.data(), static_cast<std::size_t>(count));
  }
}

void write_all(int file, const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t count = write(file, text.data() + done, text.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return;
    done += static_cast<std::size_t>(count);
  }
}

// A script is short: a pipe takes all of it before anybody reads.
Ended run_with_input(const std::vector<std::string>& words, const std::string& input) {
  std::array<int, 2> in, out;
  if (pipe2(in.data(), O_CLOEXEC) != 0 || pipe2(out.data(), O_CLOEXEC) != 0) {
    throw OutputError(fmt::format("no pipe to {}: {}", words.front(), std::strerror(errno)));
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, in[0], 0);
  posix_spawn_file_actions_adddup2(&actions, out[1], 1);
  posix_spawn_file_actions_adddup2(&actions, out[1], 2);
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  pid_t id = 0;
  const int error = posix_spawnp(&id, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(in[0]);
  close(out[1]);
  Ended ended;
  if (error == 0) {
    // One that ends before it has read its input is no reason to end too.
    const auto before = std::signal(SIGPIPE, SIG_IGN);
    write_all(in[1], input);
    std::signal(SIGPIPE, before);
    close(in[1]);
    ended.output = read_all(out[0]);
    int status = 0;
    while (waitpid(id, &status, 0) < 0 && errno == EINTR) {
    }
    ended.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128;
  } else {
    close(in[1]);
  }
  close(out[0]);
  if (error != 0) {
    throw OutputError(
        fmt::format("{} cannot be started: {}; --engine slurm runs where Slurm's "
                    "commands are",
                    words.front(), std::strerror(error)));
  }
  return ended;
}

// The number of the job. "123" or "123;cluster"
std::string submit_one(const std::vector<std::string>& options, const std::string& script) {
  std::vector<std::string> words{"sbatch", "--parsable"};
  words.insert(words.end(), options.begin(), options.end());
  const Ended ended = run_with_input(words, script);
  const std::size_t digits = ended.output.find_first_not_of("0123456789");
  // With --wait the exit status is that of the job, when it was taken.
  if (digits == 0 || digits == std::string::npos) {
    std::string said = ended.output;
    while (said.ends_with('\n')) said.pop_back();
    for (std::size_t at = 0; (at = said.find('\n', at)) != std::string::npos;)
      said.replace(at, 1, "; ");
    throw OutputError(fmt::format("sbatch refuses (exit status {}): {}", ended.code, said));
  }
  return ended.output.substr(0, digits);
}

}  // namespace

std::string this_program() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::string out = shell_word(std::filesystem::read_symlink("/proc/self/exe").string());
  bool first = true;
  for (std::string word; std::getline(file, word, '\0') && word != "fleet"; first = false) {
    if (!first) out += " " + shell_word(word);
  }
  return out;
}

SlurmScripts slurm_scripts(const SlurmRun& run, const std::string& program,
                           const std::string& store) {
  std::string options = fmt::format("--retries {}", run.retries);
  if (run.timeout > 0.0) options += fmt::format(" --timeout {:g}", run.timeout);
  SlurmScripts out;
  out.array = fmt::format(
      "#!/bin/sh\n"
      "#SBATCH --job-name=identikal-fleet\n"
      "#SBATCH --array=1-{0}\n"
      "#SBATCH --ntasks=1\n"
      "#SBATCH --cpus-per-task={1}\n"
      "#SBATCH --requeue\n"
      "#SBATCH --output={5}/%A_%a.txt\n"
      "exec {2} fleet resume {3} --shard \"$SLURM_ARRAY_TASK_ID/{0}\" --workers {1} {4} --quiet\n",
      run.shards, run.workers, program, shell_word(store), options, store + ".slurm");
  out.merge = fmt::format(
      "#!/bin/sh\n"
      "#SBATCH --job-name=identikal-merge\n"
      "#SBATCH --ntasks=1\n"
      "#SBATCH --requeue\n"
      "#SBATCH --output={2}/%j.txt\n"
      "exec {0} fleet merge {1}\n",
      program, shell_word(store), store + ".slurm");
  return out;
}

std::string submit(const SlurmScripts& scripts, const SlurmRun& run) {
  const std::vector<std::string> more = option_words(run.sbatch);
  const std::string array = submit_one(more, scripts.array);
  // Also after tasks that failed: what they have done is merged, and the rest is seen in the status.
  std::vector<std::string> options = more;
  options.push_back("--dependency=afterany:" + array);
  if (run.wait) options.emplace_back("--wait");
  return submit_one(options, scripts.merge);
}

}  // namespace identikal
