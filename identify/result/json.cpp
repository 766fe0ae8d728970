#include "identify/result/json.h"

#include <utility>

#include "identify/result/internal/json_writer.h"
#include "identify/result/internal/version_1.h"
#include "identify/result/internal/whole_file.h"

namespace identikal {

std::string result_json(const ResultSections& result, bool strict, double timing_s) {
  WholeFile file = file_to_write(result);
  file.exit = exit_code(*result.core, strict);
  file.timing_s = timing_s;
  JsonWriter::Json out = JsonWriter::object_of(file);
  add_old_keys(out);
  // The old keys of the whole stand before the time, which programs and people find at the end.
  JsonWriter::Json timing = std::move(out["timing_s"]);
  out.erase("timing_s");
  out["timing_s"] = std::move(timing);
  return out.dump(2, ' ', false, JsonWriter::Json::error_handler_t::replace) + "\n";
}

}  // namespace identikal
