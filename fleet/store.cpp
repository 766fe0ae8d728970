#include "fleet/store.h"

#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>
#include <unordered_map>

#include "fleet/internal/database.h"
#include <fcntl.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

constexpr std::int64_t kFormat = 1;

const char* const kTables = R"(
CREATE TABLE IF NOT EXISTS fleet(key TEXT PRIMARY KEY, value) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS job(
  number INTEGER PRIMARY KEY, recording TEXT NOT NULL, unit TEXT NOT NULL, "group" TEXT NOT NULL,
  options TEXT NOT NULL, "where" TEXT NOT NULL, covariates TEXT, cost REAL NOT NULL,
  task TEXT NOT NULL DEFAULT '', stamp TEXT NOT NULL DEFAULT '', sha256 TEXT NOT NULL DEFAULT '',
  again INTEGER NOT NULL DEFAULT 0, attempts INTEGER NOT NULL DEFAULT 0, seconds REAL, host TEXT,
  finished TEXT);
CREATE TABLE IF NOT EXISTS result(
  job INTEGER NOT NULL, place INTEGER NOT NULL, part TEXT NOT NULL, exit_code INTEGER NOT NULL,
  status TEXT NOT NULL, message TEXT NOT NULL, rows INTEGER NOT NULL, log_likelihood REAL,
  parameters TEXT, correlation TEXT, fits TEXT, tests TEXT, findings TEXT,
  PRIMARY KEY(job, place)) WITHOUT ROWID;
CREATE VIEW IF NOT EXISTS parameter AS
  SELECT job.number AS job, recording, unit, "group", part, status, p.key AS name,
    json_extract(p.value, '$.value') AS value, json_extract(p.value, '$.se') AS se,
    json_extract(p.value, '$.low') AS low, json_extract(p.value, '$.high') AS high
  FROM result JOIN job ON job.number = result.job, json_each(result.parameters) AS p;
)";

const char* const kJobColumns =
    "number, recording, unit, \"group\", options, \"where\", covariates, task, stamp, sha256, "
    "again";

using Covariates = std::vector<std::pair<std::string, std::string>>;

// {"mileage": "12000"}; empty where there are none.
std::string json_of(const Covariates& covariates) {
  if (covariates.empty()) return "";
  nlohmann::ordered_json out = nlohmann::ordered_json::object();
  for (const auto& [name, value] : covariates) out[name] = value;
  return out.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

Covariates covariates_of(const std::string& json) {
  Covariates out;
  const auto all = nlohmann::ordered_json::parse(json, nullptr, false);
  if (!all.is_object()) return out;
  for (const auto& [name, value] : all.items()) {
    if (value.is_string()) out.emplace_back(name, value.get<std::string>());
  }
  return out;
}

StoredJob job_at(const Statement& row) {
  return {
      row.integer(0),
      {row.text(1), row.text(2), row.text(3), row.text(4), row.text(5), covariates_of(row.text(6))},
      row.text(7),
      row.text(8),
      row.text(9),
      row.integer(10) != 0};
}

const char* const kRows =
    "SELECT number, recording, unit, \"group\", options, \"where\", covariates, part, exit_code, "
    "status, "
    "message, rows, log_likelihood, parameters, correlation, fits, tests, findings "
    "FROM result JOIN job ON job.number = result.job";

StoredRow row_at(const Statement& row) {
  return {
      row.integer(0),
      {row.text(1), row.text(2), row.text(3), row.text(4), row.text(5), covariates_of(row.text(6))},
      {row.text(7), static_cast<int>(row.integer(8)), row.text(9), row.text(10),
       static_cast<long>(row.integer(11)), row.number(12), row.text(13), row.text(14), row.text(15),
       row.text(16), row.text(17)}};
}

std::string key_of(const FleetJob& job) {
  std::string out;
  for (const std::string* text : {&job.recording, &job.options, &job.where}) {
    out += *text;
    out += '\n';
  }
  return out;
}

// The words of a command line as one text; none of them holds a line's end.
std::string joined_lines(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& word : words) out += word + "\n";
  return out;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> out;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    out.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return out;
}

void check_format(Database& database) {
  Statement format(database, "SELECT value FROM fleet WHERE key = 'format'");
  if (!format.step()) {
    throw InputError({database.path()}, "this is no store of a fleet",
                     "a file that 'fleet' has written");
  }
  if (format.integer(0) > kFormat) {
    throw InputError({database.path()}, fmt::format("a store of format {}", format.integer(0)),
                     fmt::format("format {}", kFormat), "a newer Identikal reads it");
  }
}

// PATH.lock, held: one process at a time writes.
struct Lock {
  std::string path;
  int file = -1;

  Lock() = default;
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;
  ~Lock() {
    if (file < 0) return;
    unlink(path.c_str());  // while it is held: who waits for it finds that it is gone
    close(file);
  }
};

std::shared_ptr<Lock> locked(const std::string& path, FleetStore::Open how) {
  using Open = FleetStore::Open;
  auto out = std::make_shared<Lock>();
  if (how == Open::read) return out;
  if (struct stat status{}; how == Open::write && stat(path.c_str(), &status) != 0) {
    return out;  // opening it says so
  }
  out->path = path + ".lock";
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  for (;;) {
    const int file = open(out->path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
    if (file < 0) {
      throw OutputError(fmt::format("{}: cannot be made: {}", out->path, std::strerror(errno)));
    }
    struct flock lock {};
    lock.l_type = F_WRLCK;
    lock.l_whence = SEEK_SET;
    if (fcntl(file, F_SETLK, &lock) != 0) {
      close(file);
      // One that merges is done in a moment.
      if (std::chrono::steady_clock::now() < end) {
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        continue;
      }
      throw InputError({path}, "another process is at work on this store", "one at a time",
                       "'identikal fleet status' reads it meanwhile");
    }
    struct stat held {
    }, there{};
    const bool is_there = fstat(file, &held) == 0 && stat(out->path.c_str(), &there) == 0 &&
                          held.st_ino == there.st_ino && held.st_dev == there.st_dev;
    if (is_there) {
      out->file = file;
      return out;
    }
    close(file);
  }
}

}  // namespace

struct FleetStore::Opened {
  std::shared_ptr<Lock> lock;
  Database database;
  std::shared_ptr<Statement> put_job{}, put_row{}, drop_rows{}, put_unchanged{};

  void prepare() {
    if (put_job) return;
    put_job = std::make_shared<Statement>(
        database,
        "UPDATE job SET task = ?2, stamp = ?3, sha256 = ?4, again = ?5, attempts = ?6, "
        "seconds = ?7, host = ?8, finished = ?9 WHERE number = ?1");
    put_unchanged =
        std::make_shared<Statement>(database, "UPDATE job SET stamp = ?2 WHERE number = ?1");
    drop_rows = std::make_shared<Statement>(database, "DELETE FROM result WHERE job = ?1");
    put_row = std::make_shared<Statement>(database,
                                          "INSERT INTO result VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, "
                                          "?8, nullif(?9, ''), nullif(?10, ''), "
                                          "nullif(?11, ''), nullif(?12, ''), nullif(?13, ''))");
  }
};

FleetStore::~FleetStore() = default;

const std::string& FleetStore::path() const { return opened_->database.path(); }

FleetStore::FleetStore(const std::string& path, Open how)
    : opened_(new Opened{locked(path, how), Database(path, how)}) {
  if (how != Open::read)
    opened_->database.execute("PRAGMA synchronous = FULL; PRAGMA cache_size = -8000;");
  if (how == Open::create) {
    Statement tables(opened_->database, "SELECT count(*) FROM sqlite_master");
    tables.step();
    const bool is_new = tables.integer(0) == 0;
    tables.reset();
    if (is_new) {
      Transaction all(opened_->database);
      opened_->database.execute(kTables);
      Statement(opened_->database, "INSERT INTO fleet VALUES('format', ?1)").with(kFormat).run();
      all.commit();
    }
  }
  check_format(opened_->database);
}

FleetTask FleetStore::task() {
  std::map<std::string, std::string> values;
  Statement all(opened_->database, "SELECT key, value FROM fleet");
  while (all.step()) values[all.text(0)] = all.text(1);
  return {values["verb"], values["model"],  lines_of(values["options"]),
          values["by"],   values["folder"], values["digest"]};
}

void FleetStore::set_task(const FleetTask& task) {
  Statement put(opened_->database, "INSERT OR REPLACE INTO fleet VALUES(?1, ?2)");
  put.with(std::string_view("verb"), task.verb).run();
  put.with(std::string_view("model"), task.model).run();
  put.with(std::string_view("options"), joined_lines(task.options)).run();
  put.with(std::string_view("by"), task.by).run();
  put.with(std::string_view("folder"), task.folder).run();
  put.with(std::string_view("digest"), task.digest).run();
}

void FleetStore::plan(const FleetTask& task, const std::vector<FleetJob>& jobs,
                      const std::vector<double>& costs) {
  Transaction all(opened_->database);
  set_task(task);
  // Old jobs by what they are; their results move with them, by way of numbers that nobody has.
  std::unordered_map<std::string, std::int64_t> old;
  Statement known(opened_->database, fmt::format("SELECT {} FROM job", kJobColumns));
  while (known.step()) old[key_of(job_at(known).job)] = known.integer(0);
  known.reset();
  if (!old.empty()) {
    opened_->database.execute(
        "UPDATE job SET number = -1 - number; UPDATE result SET job = -1 - job;");
  }
  Statement insert(opened_->database,
                   "INSERT INTO job(number, recording, unit, \"group\", options, \"where\", cost, "
                   "covariates) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, nullif(?8, ''))");
  Statement move(opened_->database,
                 "UPDATE job SET number = ?1, unit = ?2, \"group\" = ?3, cost = ?4, "
                 "covariates = nullif(?6, '') WHERE number = -1 - ?5");
  Statement move_rows(opened_->database, "UPDATE result SET job = ?1 WHERE job = -1 - ?2");
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const FleetJob& job = jobs[i];
    const auto number = static_cast<std::int64_t>(i);
    const auto there = old.find(key_of(job));
    if (there == old.end()) {
      insert
          .with(number, job.recording, job.unit, job.group, job.options, job.where, costs[i],
                json_of(job.covariates))
          .run();
      continue;
    }
    move.with(number, job.unit, job.group, costs[i], there->second, json_of(job.covariates)).run();
    move_rows.with(number, there->second).run();
  }
  opened_->database.execute("DELETE FROM result WHERE job < 0; DELETE FROM job WHERE number < 0;");
  all.commit();
}

std::vector<StoredJob> FleetStore::jobs_after(std::int64_t last, int most) {
  Statement rows(
      opened_->database,
      fmt::format("SELECT {} FROM job WHERE number > ?1 ORDER BY number LIMIT ?2", kJobColumns));
  rows.with(last, most);
  std::vector<StoredJob> out;
  while (rows.step()) out.push_back(job_at(rows));
  return out;
}

std::optional<std::pair<std::int64_t, std::int64_t>> FleetStore::share(int k, int n) {
  // A job belongs to the share in which the middle of its cost lies, when all are laid in a row.
  Statement total(opened_->database, "SELECT sum(cost) FROM job");
  total.step();
  const double all = total.number(0);
  Statement row(opened_->database,
                "SELECT min(number), max(number) FROM (SELECT number, (sum(cost) OVER (ORDER BY "
                "number) - 0.5 * cost) / ?1 * ?2 AS middle FROM job) "
                "WHERE min(CAST(middle AS INTEGER), ?2 - 1) = ?3");
  row.with(all, n, k - 1);
  if (!row.step() || row.is_null(0)) return std::nullopt;
  return std::pair(row.integer(0), row.integer(1));
}

void FleetStore::begin() { opened_->database.execute("BEGIN IMMEDIATE"); }
void FleetStore::commit() { opened_->database.execute("COMMIT"); }

void FleetStore::put(const FleetResult& result) {
  opened_->prepare();
  if (result.unchanged) {
    opened_->put_unchanged->with(result.number, result.stamp).run();
    return;
  }
  opened_->put_job
      ->with(result.number, result.task, result.stamp, result.sha256, result.again, result.attempts,
             result.seconds, result.host, result.finished)
      .run();
  opened_->drop_rows->with(result.number).run();
  std::int64_t place = 0;
  for (const FleetRow& row : result.rows) {
    opened_->put_row
        ->with(result.number, place++, row.part, row.exit_code, row.status, row.message,
               static_cast<std::int64_t>(row.rows), row.log_likelihood, row.parameters,
               row.correlation, row.fits, row.tests, row.findings)
        .run();
  }
}

FleetCounts FleetStore::counts() {
  FleetCounts out;
  const FleetTask now = task();
  Statement jobs(opened_->database, "SELECT count(*), sum(task = ?1 AND NOT again) FROM job");
  jobs.with(now.digest).step();
  out.jobs = jobs.integer(0);
  out.done = jobs.integer(1);
  Statement rows(opened_->database, "SELECT status, count(*) FROM result GROUP BY status");
  while (rows.step()) {
    out.by_status[rows.text(0)] = rows.integer(1);
    out.rows += rows.integer(1);
  }
  return out;
}

void FleetStore::for_each_row(const std::function<void(const StoredRow&)>& each) {
  Statement rows(opened_->database, fmt::format("{} ORDER BY job, place", kRows));
  while (rows.step()) each(row_at(rows));
}

std::vector<StoredRow> FleetStore::failed_rows(std::size_t most) {
  Statement rows(
      opened_->database,
      fmt::format("{} WHERE status = 'failed' ORDER BY job, place LIMIT {}", kRows, most));
  std::vector<StoredRow> out;
  while (rows.step()) out.push_back(row_at(rows));
  return out;
}

std::int64_t FleetStore::take_from(const std::string& path) {
  const FleetTask now = task();
  {
    FleetStore other(path, Open::read);
    if (other.task().digest != now.digest) {
      throw InputError({path}, "a store of another task", "one of the same model and options");
    }
  }
  Statement(opened_->database, "ATTACH ?1 AS other").with(path).run();
  std::int64_t taken = 0;
  {
    Transaction all(opened_->database);
    // The jobs that the other has done, and this one has not.
    Statement count(
        opened_->database,
        "SELECT count(*) FROM other.job AS o JOIN main.job AS m USING(number, recording, options, "
        "\"where\") WHERE o.task = ?1 AND (m.task <> ?1 OR m.again OR m.stamp <> o.stamp)");
    count.with(now.digest).step();
    taken = count.integer(0);
    count.reset();
    Statement list(opened_->database,
                   "CREATE TEMP TABLE taken AS SELECT o.number FROM other.job AS o JOIN main.job "
                   "AS m USING(number, recording, options, \"where\") WHERE o.task = ?1 AND "
                   "(m.task <> ?1 OR m.again OR m.stamp <> o.stamp)");
    list.with(now.digest).run();
    opened_->database.execute(
        "DELETE FROM main.result WHERE job IN taken;"
        "INSERT INTO main.result SELECT * FROM other.result WHERE job IN taken;"
        "UPDATE main.job SET (task, stamp, sha256, again, attempts, seconds, host, finished) = "
        "(SELECT task, stamp, sha256, again, attempts, seconds, host, finished FROM other.job AS o "
        "WHERE o.number = main.job.number) WHERE number IN taken;"
        "DROP TABLE taken;");
    all.commit();
  }
  opened_->database.execute("DETACH other");
  return taken;
}

void FleetStore::copy_share(const std::string& path, std::int64_t first, std::int64_t last) {
  const FleetTask task = FleetStore(path, Open::read).task();
  Statement(opened_->database, "ATTACH ?1 AS whole").with(path).run();
  {
    Transaction all(opened_->database);
    // Of an earlier task, or of another share, nothing is kept.
    if (this->task() != task) {
      opened_->database.execute("DELETE FROM main.result; DELETE FROM main.job;");
      set_task(task);
    }
    Statement(opened_->database, "DELETE FROM main.result WHERE job < ?1 OR job > ?2")
        .with(first, last)
        .run();
    Statement(opened_->database, "DELETE FROM main.job WHERE number < ?1 OR number > ?2")
        .with(first, last)
        .run();
    Statement(opened_->database,
              "INSERT OR IGNORE INTO main.job SELECT * FROM whole.job WHERE number BETWEEN ?1 AND "
              "?2")
        .with(first, last)
        .run();
    Statement(opened_->database,
              "INSERT OR IGNORE INTO main.result SELECT * FROM whole.result WHERE job BETWEEN ?1 "
              "AND ?2")
        .with(first, last)
        .run();
    all.commit();
  }
  opened_->database.execute("DETACH whole");
}

}  // namespace identikal
