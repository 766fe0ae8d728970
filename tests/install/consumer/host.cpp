// A program that uses the shared library.
#include <cstdio>

long rows_of(const char* path);

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  std::printf("%ld rows, %ld without a file\n", rows_of(argv[1]), rows_of("no such file.csv"));
  return 0;
}
