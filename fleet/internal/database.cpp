#include "fleet/internal/database.h"

#include <cmath>
#include <filesystem>
#include <limits>

#include <fmt/format.h>
#include <sqlite3.h>

#include "lib/base/error.h"

namespace identikal {

Database::Database(const std::string& path, Open how) : path_(path) {
  std::error_code ignored;
  if (how != Open::create && !std::filesystem::exists(path, ignored)) {
    throw InputError({path}, "there is no store here", "one that 'fleet tune' and others write");
  }
  // What a process that was killed has left half done is undone by the next that opens the file, if
  // it may write.
  const int flags = SQLITE_OPEN_READWRITE | (how == Open::create ? SQLITE_OPEN_CREATE : 0);
  sqlite3* handle = nullptr;
  int code = sqlite3_open_v2(path.c_str(), &handle, flags, nullptr);
  if (code != SQLITE_OK && how == Open::read) {
    sqlite3_close_v2(handle);
    code = sqlite3_open_v2(path.c_str(), &handle, SQLITE_OPEN_READONLY, nullptr);
  }
  handle_ = std::shared_ptr<sqlite3>(handle, [](sqlite3* h) { sqlite3_close_v2(h); });
  if (code != SQLITE_OK) fail(code);
  // Another process that commits is waited for [ms].
  sqlite3_busy_timeout(handle, 10000);
  sqlite3_extended_result_codes(handle, 1);
}

void Database::fail(int code) const {
  const int kind = code & 0xff;
  const std::string said = handle_ ? sqlite3_errmsg(handle_.get()) : sqlite3_errstr(code);
  if (kind == SQLITE_NOTADB || kind == SQLITE_CORRUPT) {
    throw InputError({path_}, "this is no store: " + said, "a file that 'fleet' has written");
  }
  if (kind == SQLITE_ERROR && said.starts_with("no such ")) {
    throw InputError({path_}, "this is no store of a fleet: " + said,
                     "a file that 'fleet' has written");
  }
  if (kind == SQLITE_NOMEM) throw std::bad_alloc();
  throw OutputError(
      fmt::format("{}: the store cannot be written or read: {}; what was committed is in it, and "
                  "'identikal fleet resume' goes on",
                  path_, said));
}

void Database::execute(const std::string& sql) {
  const int code = sqlite3_exec(handle_.get(), sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) fail(code);
}

Statement::Statement(Database& database, const std::string& sql) : database_(&database) {
  sqlite3_stmt* statement = nullptr;
  const int code = sqlite3_prepare_v3(database.handle(), sql.c_str(), static_cast<int>(sql.size()),
                                      SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
  if (code != SQLITE_OK) database.fail(code);
  statement_ = std::shared_ptr<sqlite3_stmt>(statement, sqlite3_finalize);
}

bool Statement::step() {
  const int code = sqlite3_step(statement_.get());
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  database_->fail(code);
}

void Statement::reset() { sqlite3_reset(statement_.get()); }

void Statement::bind(int position, std::int64_t value) {
  sqlite3_bind_int64(statement_.get(), position, value);
}

void Statement::bind(int position, double value) {
  if (std::isnan(value)) {
    sqlite3_bind_null(statement_.get(), position);
  } else {
    sqlite3_bind_double(statement_.get(), position, value);
  }
}

void Statement::bind(int position, std::string_view value) {
  sqlite3_bind_text(statement_.get(), position, value.data(), static_cast<int>(value.size()),
                    SQLITE_TRANSIENT);
}

std::int64_t Statement::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

double Statement::number(int column) const {
  if (is_null(column)) return std::numeric_limits<double>::quiet_NaN();
  return sqlite3_column_double(statement_.get(), column);
}

std::string Statement::text(int column) const {
  const unsigned char* const text = sqlite3_column_text(statement_.get(), column);
  if (text == nullptr) return "";
  return {reinterpret_cast<const char*>(text),
          static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

bool Statement::is_null(int column) const {
  return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL;
}

Transaction::Transaction(Database& database) : database_(&database) {
  database.execute("BEGIN IMMEDIATE");
}

Transaction::~Transaction() {
  if (open_) sqlite3_exec(database_->handle(), "ROLLBACK", nullptr, nullptr, nullptr);
}

void Transaction::commit() {
  database_->execute("COMMIT");
  open_ = false;
}

}  // namespace identikal
