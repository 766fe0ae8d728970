// What does the library say that is linked to MPI? Functions of C, found by name when it is loaded. For fleet alone.
#pragma once

#include <cstddef>

extern "C" {

/// @return 0, or not when there is no MPI
int identikal_mpi_begin(int* rank, int* size);
/// Returns at once.
void identikal_mpi_send(int to, const char* bytes, size_t count);
/// Hands one message to `take`. @return 0 when none is there
int identikal_mpi_receive(int wait, int* from, void (*take)(void* user, const char*, size_t),
                          void* user);
void identikal_mpi_end(void);
}
