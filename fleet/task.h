// What does a fleet do with one recording? A verb, with the options of the fleet and of the job.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "fleet/store.h"
#include "jobs/verb.h"

namespace identikal {

/// The verbs that a fleet has: "tune", "fit", "check", "validate".
const std::vector<std::string>& fleet_verb_names();
/// One of them, with options of its own. @throws InputError for another name
Verb make_fleet_verb(const std::string& name);

/// Options that a fleet takes for each of its recordings: not those that name files to write.
bool is_option_of_fleet(const Option& option);
/// Takes words such as "--starts", "1", "--set=q=3" as a command line would.
/// @param argument  of the verb, which a word without dashes is; empty: there is none
/// @throws InputError for an option that the verb does not have, or a fleet does not take
void take_words(const Verb& verb, const std::vector<std::string>& words,
                const std::string& argument = "");

/// SHA-256 of the verb, the model with what it includes, the options and this version.
/// @throws InputError for a model that cannot be read
std::string digest_of(const FleetTask& task);

/// "size:time" of the recording's files, by which one that has not changed is known; "absent".
std::string stamp_of(const std::string& recording);

/// Does jobs one after the other. What they share (the model's text, the table of a file that
/// several take rows of) is read once.
class JobRunner {
 public:
  explicit JobRunner(FleetTask task);
  ~JobRunner();

  /// @param first_part  of a recording with parts: those before are left out
  /// @param each  takes rows as they come
  /// @return all but the rows; never throws for what is the job's own
  FleetResult run(const StoredJob& job, std::size_t first_part,
                  const std::function<void(FleetRow row)>& each);

 private:
  struct Shared;
  std::unique_ptr<Shared> shared_;
};

}  // namespace identikal
