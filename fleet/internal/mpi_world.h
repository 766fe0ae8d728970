// How do processes that mpirun has started share a fleet? Rank 0 hands out, all work. For fleet alone.
#pragma once

#include <memory>

#include "fleet/internal/workers.h"

namespace identikal {

/// MPI, from its begin to its end.
class MpiWorld {
 public:
  /// @throws OutputError where the library that speaks MPI was not built, or cannot begin
  MpiWorld();
  ~MpiWorld();
  MpiWorld(const MpiWorld&) = delete;
  MpiWorld& operator=(const MpiWorld&) = delete;

  int rank() const;
  int size() const;
  /// Of a rank that is not 0: with rank 0.
  Connection connection();
  /// Of rank 0: the other ranks behind `own`, which are processes of this one. When they are
  /// dropped, the other ranks are told that no more will come.
  Workers workers(const Workers& own);

 private:
  struct Library;
  std::shared_ptr<Library> library_;
};

/// The rank that mpirun has given to this process, before MPI has begun; 0 where it says none.
int rank_by_environment();

}  // namespace identikal
