#include "identify/result/file_digest.h"

#include <fstream>
#include <iterator>
#include <memory>
#include <vector>

#include <openssl/evp.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

using DigestContext = std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)>;

// Looked up once: OpenSSL searches its providers at every use of EVP_sha256(), which takes longer than a
// short text.
const EVP_MD* sha256() {
  static const EVP_MD* const found = EVP_MD_fetch(nullptr, "SHA256", nullptr);
  return found != nullptr ? found : EVP_sha256();
}

DigestContext sha256_begun() {
  DigestContext context(EVP_MD_CTX_new(), &EVP_MD_CTX_free);
  EVP_DigestInit_ex(context.get(), sha256(), nullptr);
  return context;
}

std::string sha256_ended(EVP_MD_CTX* context) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int size = 0;
  EVP_DigestFinal_ex(context, digest, &size);
  constexpr char kDigits[] = "0123456789abcdef";
  std::string out;
  for (unsigned int i = 0; i < size; ++i) {
    out += kDigits[digest[i] >> 4];
    out += kDigits[digest[i] & 15];
  }
  return out;
}

}  // namespace

std::string sha256_of_text(std::string_view text) {
  const DigestContext context = sha256_begun();
  EVP_DigestUpdate(context.get(), text.data(), text.size());
  return sha256_ended(context.get());
}

std::string text_of_file(const std::string& path, const std::string& expected,
                         const std::string& hint) {
  std::ifstream file(path, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(file), {});
  if (!file || file.bad()) throw InputError({path, 0, 0}, "cannot be read", expected, hint);
  return text;
}

std::string sha256_of_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError({path, 0, 0}, "cannot be read");
  const DigestContext context = sha256_begun();
  std::vector<char> buffer(1 << 16);
  while (file.read(buffer.data(), static_cast<std::streamsize>(buffer.size())) ||
         file.gcount() > 0) {
    EVP_DigestUpdate(context.get(), buffer.data(), static_cast<std::size_t>(file.gcount()));
  }
  return sha256_ended(context.get());
}

}  // namespace identikal
