// How do options of one verb become options of another, which hands them on as they were typed?
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "jobs/verb.h"

namespace identikal {

/// What was typed for options of another verb.
class MirroredOptions {
 public:
  /// Adds those options of `from` that a fleet takes to `to`, which must not outlive this.
  void add(Verb& to, const Verb& from);
  /// "--starts", "1", ...: those that were given, in the order of the verb's options.
  std::vector<std::string> words() const;

 private:
  struct Value {
    std::string name;
    bool flag = false;
    std::string text;
    std::vector<std::string> list;
  };
  std::vector<std::unique_ptr<Value>> values_;
};

}  // namespace identikal
