// How does this room speak with SQLite? Errors become what the rest of the program throws. For fleet alone.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "fleet/store.h"

struct sqlite3;
struct sqlite3_stmt;

namespace identikal {

class Database;

/// A statement, prepared once and run many times.
class Statement {
 public:
  Statement(Database& database, const std::string& sql);

  /// The values of its ?1, ?2, ... in their order.
  template <typename... Values>
  Statement& with(const Values&... values) {
    reset();
    int position = 0;
    (bind(++position, values), ...);
    return *this;
  }
  /// The next row: false when there is none.
  /// @throws OutputError when the file takes no more, InputError when it is no store
  bool step();
  /// For a statement without rows.
  void run() {
    step();
    reset();
  }

  std::int64_t integer(int column) const;
  double number(int column) const;  ///< NaN for NULL
  std::string text(int column) const;
  bool is_null(int column) const;
  void reset();

 private:
  void bind(int position, std::int64_t value);
  void bind(int position, int value) { bind(position, static_cast<std::int64_t>(value)); }
  void bind(int position, double value);
  void bind(int position, std::string_view value);

  Database* database_;
  std::shared_ptr<sqlite3_stmt> statement_;
};

class Database {
 public:
  using Open = FleetStore::Open;

  /// @throws InputError for a file that is not there or is no database; OutputError for one that
  ///   cannot be made
  Database(const std::string& path, Open how);

  void execute(const std::string& sql);
  const std::string& path() const { return path_; }
  sqlite3* handle() const { return handle_.get(); }
  /// Throws what the last error means.
  [[noreturn]] void fail(int code) const;

 private:
  std::string path_;
  std::shared_ptr<sqlite3> handle_;
};

/// Changes that are all made, or none of them.
class Transaction {
 public:
  explicit Transaction(Database& database);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  void commit();

 private:
  Database* database_;
  bool open_ = true;
};

}  // namespace identikal
