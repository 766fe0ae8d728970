// A text that is written when somebody first asks for it.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace identikal {

/// Copies share the text. Several threads may ask at once: it is written one time.
///
/// Example:
///
///     const LateText json([result] { return result_json(sections_of(*result), false, 0.0); });
///     if (wanted) std::puts(json.text().c_str());
class LateText {
 public:
  LateText() = default;
  explicit LateText(std::function<std::string()> write)
      : shared_(std::make_shared<Shared>(std::move(write))) {}

  /// Is there one? False for those that are default-constructed.
  bool exists() const { return shared_ != nullptr; }

  /// Empty where there is none. @throws what writing it throws; the next call tries again
  const std::string& text() const {
    static const std::string kNothing;
    if (!shared_) return kNothing;
    // Not std::call_once: where memory is short, what write() throws does not come through it.
    const std::lock_guard<std::mutex> lock(shared_->mutex);
    if (shared_->write) {
      shared_->text = shared_->write();
      shared_->write = nullptr;  // and what it held
    }
    return shared_->text;
  }

 private:
  struct Shared {
    explicit Shared(std::function<std::string()> how) : write(std::move(how)) {}
    std::mutex mutex;
    std::function<std::string()> write;
    std::string text;
  };
  std::shared_ptr<Shared> shared_;
};

}  // namespace identikal
