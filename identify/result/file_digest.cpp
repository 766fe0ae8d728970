#include "identify/result/file_digest.h"

#include <fstream>
#include <vector>

// The digest's own functions: the newer interface reads a configuration and loads algorithms first, which takes
// a third as long as fitting a short recording.
#define OPENSSL_SUPPRESS_DEPRECATED
#include <openssl/sha.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

SHA256_CTX sha256_begun() {
  SHA256_CTX context;
  SHA256_Init(&context);
  return context;
}

std::string sha256_ended(SHA256_CTX context) {
  unsigned char digest[SHA256_DIGEST_LENGTH];
  SHA256_Final(digest, &context);
  constexpr char kDigits[] = "0123456789abcdef";
  std::string out;
  for (const unsigned char byte : digest) {
    out += kDigits[byte >> 4];
    out += kDigits[byte & 15];
  }
  return out;
}

}  // namespace

std::string sha256_of_text(std::string_view text) {
  SHA256_CTX context = sha256_begun();
  SHA256_Update(&context, text.data(), text.size());
  return sha256_ended(context);
}

constexpr std::size_t kMostBytes = 500'000'000;  // of a file that is read whole

std::string text_of_file(const std::string& path, const std::string& expected,
                         const std::string& hint) {
  std::ifstream file(path, std::ios::binary);
  std::string text;
  std::vector<char> buffer(1 << 16);
  while (file.read(buffer.data(), static_cast<std::streamsize>(buffer.size())) ||
         file.gcount() > 0) {
    text.append(buffer.data(), static_cast<std::size_t>(file.gcount()));
    if (text.size() > kMostBytes) {
      throw InputError({path, 0, 0}, "is larger than 500 MB, which no result is", expected, hint);
    }
  }
  if (!file.eof() || file.bad()) throw InputError({path, 0, 0}, "cannot be read", expected, hint);
  return text;
}

std::string sha256_of_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError({path, 0, 0}, "cannot be read");
  SHA256_CTX context = sha256_begun();
  std::vector<char> buffer(1 << 16);
  while (file.read(buffer.data(), static_cast<std::streamsize>(buffer.size())) ||
         file.gcount() > 0) {
    SHA256_Update(&context, buffer.data(), static_cast<std::size_t>(file.gcount()));
  }
  return sha256_ended(context);
}

}  // namespace identikal
