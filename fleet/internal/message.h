// How do jobs go to another process, and rows come back? As frames of bytes; a process that ends leaves no half of one
// behind that is read. For fleet alone.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "fleet/store.h"

namespace identikal {

/// A job as a worker gets it.
struct Assignment {
  StoredJob job;
  std::int64_t first_part = 0;  ///< the parts before are done
};

/// A row of the job that the worker is at.
struct RowMessage {
  std::int64_t number = 0;
  FleetRow row;
};

/// The job is done: all but its rows.
struct DoneMessage {
  FleetResult result;
};

std::string frame_of(const Assignment& assignment);
std::string frame_of(const RowMessage& message);
std::string frame_of(const DoneMessage& message);

/// Of any bytes.
std::string frame_of(std::string_view bytes);

/// Takes whole frames off bytes that come in pieces.
class FrameReader {
 public:
  void add(std::string_view bytes) { bytes_.append(bytes); }
  /// The next frame's bytes, without their length; nothing while it is not whole.
  /// @throws std::runtime_error for a length that no frame has
  std::optional<std::string> next();

 private:
  std::string bytes_;
  std::size_t begin_ = 0;
};

/// @throws std::runtime_error for bytes that are no such message
Assignment assignment_of(std::string_view frame);
std::variant<RowMessage, DoneMessage> answer_of(std::string_view frame);

}  // namespace identikal
