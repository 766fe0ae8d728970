#include "fleet/internal/message.h"

#include <cstring>
#include <stdexcept>

namespace identikal {
namespace {

constexpr std::size_t kLength = sizeof(std::uint32_t);
constexpr std::uint32_t kLongest = 1U << 30;

class Writer {
 public:
  explicit Writer(char kind) : bytes_(kLength, '\0') { bytes_ += kind; }

  Writer& operator<<(std::string_view text) {
    *this << static_cast<std::int64_t>(text.size());
    bytes_ += text;
    return *this;
  }
  Writer& operator<<(std::int64_t value) { return raw(value); }
  Writer& operator<<(double value) { return raw(value); }

  std::string frame() && {
    const auto length = static_cast<std::uint32_t>(bytes_.size() - kLength);
    std::memcpy(bytes_.data(), &length, kLength);
    return std::move(bytes_);
  }

 private:
  template <typename Value>
  Writer& raw(Value value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    bytes_.append(bytes, sizeof value);
    return *this;
  }

  std::string bytes_;
};

class Reader {
 public:
  explicit Reader(std::string_view bytes) : rest_(bytes) {}

  char kind() {
    const char out = take(1)[0];
    return out;
  }
  Reader& operator>>(std::string& text) {
    std::int64_t size = 0;
    *this >> size;
    if (size < 0) throw std::runtime_error("a text of negative length");
    text = std::string(take(static_cast<std::size_t>(size)));
    return *this;
  }
  Reader& operator>>(std::int64_t& value) { return raw(value); }
  Reader& operator>>(double& value) { return raw(value); }
  template <typename Whole>
  Whole whole() {
    std::int64_t value = 0;
    *this >> value;
    return static_cast<Whole>(value);
  }

 private:
  std::string_view take(std::size_t count) {
    if (count > rest_.size()) throw std::runtime_error("a message that ends too early");
    const std::string_view out = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return out;
  }
  template <typename Value>
  Reader& raw(Value& value) {
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return *this;
  }

  std::string_view rest_;
};

std::int64_t as_number(bool flag) { return flag ? 1 : 0; }

}  // namespace

std::string frame_of(const Assignment& assignment) {
  Writer out('J');
  const StoredJob& job = assignment.job;
  out << job.number << job.job.recording << job.job.unit << job.job.group << job.job.options
      << job.job.where << job.task << job.stamp << job.sha256 << as_number(job.again)
      << assignment.first_part;
  return std::move(out).frame();
}

std::string frame_of(const RowMessage& message) {
  Writer out('R');
  const FleetRow& row = message.row;
  out << message.number << row.part << std::int64_t{row.exit_code} << row.status << row.message
      << std::int64_t{row.rows} << row.log_likelihood << row.parameters << row.correlation
      << row.fits << row.tests << row.findings;
  return std::move(out).frame();
}

std::string frame_of(const DoneMessage& message) {
  Writer out('D');
  const FleetResult& result = message.result;
  out << result.number << result.task << result.stamp << result.sha256 << result.host
      << as_number(result.again) << as_number(result.unchanged) << result.seconds;
  return std::move(out).frame();
}

std::string frame_of(std::string_view bytes) {
  if (bytes.size() > kLongest) throw std::runtime_error("a message that is too long");
  const auto length = static_cast<std::uint32_t>(bytes.size());
  std::string out(kLength, '\0');
  std::memcpy(out.data(), &length, kLength);
  return out.append(bytes);
}

std::optional<std::string> FrameReader::next() {
  if (bytes_.size() - begin_ < kLength) {
    bytes_.erase(0, begin_);
    begin_ = 0;
    return std::nullopt;
  }
  std::uint32_t length = 0;
  std::memcpy(&length, bytes_.data() + begin_, kLength);
  if (length > kLongest) throw std::runtime_error("a message of impossible length");
  if (bytes_.size() - begin_ - kLength < length) {
    bytes_.erase(0, begin_);
    begin_ = 0;
    return std::nullopt;
  }
  std::string out = bytes_.substr(begin_ + kLength, length);
  begin_ += kLength + length;
  return out;
}

Assignment assignment_of(std::string_view frame) {
  Reader in(frame);
  if (in.kind() != 'J') throw std::runtime_error("a message that is no job");
  Assignment out;
  StoredJob& job = out.job;
  in >> job.number >> job.job.recording >> job.job.unit >> job.job.group >> job.job.options >>
      job.job.where >> job.task >> job.stamp >> job.sha256;
  job.again = in.whole<int>() != 0;
  in >> out.first_part;
  return out;
}

std::variant<RowMessage, DoneMessage> answer_of(std::string_view frame) {
  Reader in(frame);
  const char kind = in.kind();
  if (kind == 'R') {
    RowMessage out;
    FleetRow& row = out.row;
    in >> out.number >> row.part;
    row.exit_code = in.whole<int>();
    in >> row.status >> row.message;
    row.rows = in.whole<long>();
    in >> row.log_likelihood >> row.parameters >> row.correlation >> row.fits >> row.tests >>
        row.findings;
    return out;
  }
  if (kind != 'D') throw std::runtime_error("a message of unknown kind");
  DoneMessage out;
  FleetResult& result = out.result;
  in >> result.number >> result.task >> result.stamp >> result.sha256 >> result.host;
  result.again = in.whole<int>() != 0;
  result.unchanged = in.whole<int>() != 0;
  in >> result.seconds;
  return out;
}

}  // namespace identikal
