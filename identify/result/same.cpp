#include "identify/result/same.h"

#include "identify/result/internal/content_writer.h"
#include "identify/result/internal/whole_file.h"

namespace identikal {

bool same(const ResultSections& a, const ResultSections& b) {
  return ContentWriter::content_of(file_to_write(a)) == ContentWriter::content_of(file_to_write(b));
}

}  // namespace identikal
