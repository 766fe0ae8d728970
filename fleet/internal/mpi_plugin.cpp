// The one file that MPI is linked to: a library of its own, which the program loads when it is told to, so that it runs
// where there is no MPI.
#include "fleet/internal/mpi_plugin.h"

#include <cstring>
#include <list>
#include <string>

#include <mpi.h>

namespace {

constexpr int kTag = 1;

// Bytes under way: they have to stay until they have been taken.
struct Sent {
  std::string bytes;
  MPI_Request request;
};

std::list<Sent>& under_way() {
  static std::list<Sent> all;
  return all;
}

void forget_taken() {
  for (auto sent = under_way().begin(); sent != under_way().end();) {
    int done = 0;
    MPI_Test(&sent->request, &done, MPI_STATUS_IGNORE);
    sent = done != 0 ? under_way().erase(sent) : std::next(sent);
  }
}

}  // namespace

int identikal_mpi_begin(int* rank, int* size) {
  int threads = 0;
  if (MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SINGLE, &threads) != MPI_SUCCESS) return 1;
  MPI_Comm_rank(MPI_COMM_WORLD, rank);
  MPI_Comm_size(MPI_COMM_WORLD, size);
  return 0;
}

void identikal_mpi_send(int to, const char* bytes, size_t count) {
  forget_taken();
  under_way().push_back({std::string(bytes, count), {}});
  Sent& sent = under_way().back();
  MPI_Isend(sent.bytes.data(), static_cast<int>(count), MPI_BYTE, to, kTag, MPI_COMM_WORLD,
            &sent.request);
}

int identikal_mpi_receive(int wait, int* from, void (*take)(void* user, const char*, size_t),
                          void* user) {
  int there = 0;
  MPI_Status status;
  if (wait != 0) {
    MPI_Probe(MPI_ANY_SOURCE, kTag, MPI_COMM_WORLD, &status);
  } else {
    forget_taken();
    MPI_Iprobe(MPI_ANY_SOURCE, kTag, MPI_COMM_WORLD, &there, &status);
    if (there == 0) return 0;
  }
  int count = 0;
  MPI_Get_count(&status, MPI_BYTE, &count);
  std::string bytes(static_cast<size_t>(count), '\0');
  MPI_Recv(bytes.data(), count, MPI_BYTE, status.MPI_SOURCE, kTag, MPI_COMM_WORLD,
           MPI_STATUS_IGNORE);
  *from = status.MPI_SOURCE;
  take(user, bytes.data(), bytes.size());
  return 1;
}

void identikal_mpi_end(void) {
  for (Sent& sent : under_way()) MPI_Wait(&sent.request, MPI_STATUS_IGNORE);
  under_way().clear();
  MPI_Finalize();
}
