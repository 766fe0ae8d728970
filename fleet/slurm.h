// How does a cluster do a fleet? Shares as one array of Slurm, and a job that brings their stores together.
#pragma once

#include <string>

#include "jobs/verb.h"

namespace identikal {

struct SlurmRun {
  int shards = 0;        ///< tasks of the array
  int workers = 1;       ///< processes of each task
  double timeout = 0.0;  ///< of a row [s]; 0: none
  int retries = 3;
  std::string sbatch;  ///< further options of sbatch, "--partition=long --time=2:00:00"
  bool wait = false;   ///< until all is done
};

/// Scripts for sbatch: what each task of the array does, and what follows on them.
struct SlurmScripts {
  std::string array, merge;
};

/// How this program was called, up to its verb, as words of sh: its path, or Python's with "-m identikal".
std::string this_program();

/// @param program  on the nodes, as words of sh; @param store  on a file system that they share
SlurmScripts slurm_scripts(const SlurmRun& run, const std::string& program,
                           const std::string& store);

/// Hands both to sbatch. @return the number of the job that merges; with `wait` after its end
/// @throws OutputError where sbatch is not there or refuses
std::string submit(const SlurmScripts& scripts, const SlurmRun& run);

}  // namespace identikal
