#include "sim/study/journal.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "kinematics/bad_input.h"
#include "kinematics/hash.h"
#include "sim/files/atomic_output.h"
#include "sim/files/output.h"

namespace abbe::sim::study {

/// A lock file beside a journal that one process at a time can hold, void as soon as its process
/// ends. The locks of SQLite protect single reads and writes; they would not keep a second process
/// from computing the same cases.
class JournalLock {
 public:
  /// @throws OutputFailure naming the other process if it is held, or if the file is not a lock of
  /// abbe
  explicit JournalLock(const std::filesystem::path& journal);
  ~JournalLock();
  JournalLock(const JournalLock&) = delete;
  JournalLock& operator=(const JournalLock&) = delete;

 private:
  void try_once();

  std::filesystem::path journal_, file_;
  int descriptor_ = -1;
};

namespace {

[[noreturn]] void throw_not_locked(const std::filesystem::path& file, int reason) {
  throw OutputFailure(
      fmt::format("{}: cannot be locked: {}", file.string(), std::strerror(reason)));
}

/// Returns the process that holds the lock, as it wrote itself into the file.
std::string holder(int descriptor) {
  char text[200];
  const ssize_t length = ::pread(descriptor, text, sizeof text, 0);
  return length > 0 ? std::string(text, std::size_t(length)) : "another process";
}

/// Returns true if the file may be used as a lock: it is empty, or holds what an earlier holder
/// left.
bool is_lock(int descriptor) {
  struct stat about {};
  if (::fstat(descriptor, &about) != 0 || !S_ISREG(about.st_mode)) return false;
  const std::string who = about.st_size > 0 ? holder(descriptor) : "";
  return about.st_size == 0 ||
         (about.st_size < 200 && who.starts_with("process ") && who.find(" on ") != who.npos);
}

}  // namespace

JournalLock::JournalLock(const std::filesystem::path& journal)
    : journal_(journal), file_(journal.string() + "-lock") {
  while (descriptor_ < 0) try_once();
  char host[100] = "";
  ::gethostname(host, sizeof host - 1);
  const std::string who = fmt::format("process {} on {}", ::getpid(), host);
  // The name only informs others; on a full disk writing it may fail.
  if (::ftruncate(descriptor_, 0) == 0) [[maybe_unused]]
    const ssize_t written = ::pwrite(descriptor_, who.data(), who.size(), 0);
}

JournalLock::~JournalLock() {
  ::unlink(file_.c_str());
  ::close(descriptor_);
}

void JournalLock::try_once() {
  const int descriptor = ::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
  if (descriptor < 0) throw_not_locked(file_, errno);
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    const int reason = errno;
    const std::string who = holder(descriptor);
    ::close(descriptor);
    if (reason == EINTR) return;
    if (reason != EWOULDBLOCK) throw_not_locked(file_, reason);
    throw OutputFailure(fmt::format(
        "{}: another process works on this study ({}); wait for it, or use another --out",
        journal_.string(), who));
  }
  if (!is_lock(descriptor)) {
    ::close(descriptor);
    throw OutputFailure(fmt::format(
        "{}: a file that abbe did not make stands there; move it, or choose another --out",
        file_.string()));
  }
  // The holder may have ended and removed the file between open and flock: then this lock is on a
  // deleted file.
  struct stat held {
  }, there{};
  if (::fstat(descriptor, &held) == 0 && ::stat(file_.c_str(), &there) == 0 &&
      held.st_ino == there.st_ino && held.st_dev == there.st_dev)
    descriptor_ = descriptor;
  else
    ::close(descriptor);
}

namespace {

constexpr int application_id = 0x61626265;  // "abbe", the application id of the file
constexpr int busy_ms = 20000;  // ms: a reader may hold the file while the writer tidies up
constexpr const char* tables[] = {
    "CREATE TABLE cases (number INTEGER PRIMARY KEY, answers BLOB NOT NULL, fault TEXT NOT NULL, "
    "check_sum INTEGER NOT NULL)",
    "CREATE TABLE study (identity TEXT NOT NULL)"};

/// Little-endian on every computer, so that journals can be merged across computers.
std::string bytes_of(const std::vector<double>& answers) {
  std::string bytes;
  bytes.reserve(8 * answers.size());
  for (const double answer : answers) {
    const auto bits = std::bit_cast<std::uint64_t>(answer);
    for (int i = 0; i < 8; ++i) bytes += char(bits >> (8 * i));
  }
  return bytes;
}

std::vector<double> parse_responses(std::string_view bytes) {
  std::vector<double> answers(bytes.size() / 8);
  for (std::size_t k = 0; k < answers.size(); ++k) {
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < 8; ++i)
      bits |= std::uint64_t(static_cast<unsigned char>(bytes[8 * k + i])) << (8 * i);
    answers[k] = std::bit_cast<double>(bits);
  }
  return answers;
}

std::int64_t check_sum(std::uint64_t index, std::string_view answers, std::string_view fault) {
  const std::uint64_t begun = fnv_1a(fmt::format("{} {} ", index, answers.size()));
  return std::int64_t(fnv_1a(fault, fnv_1a(answers, begun)));
}

struct CloseDatabase {
  void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
};
struct FinishStatement {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Statement = std::unique_ptr<sqlite3_stmt, FinishStatement>;

BadInput not_a_journal(const std::filesystem::path& file, const std::string& seen) {
  return BadInput(file.string(), 0, 0,
                  "the journal of a study (to start from the beginning, delete the file or choose "
                  "another --out)",
                  seen);
}

struct Database {
  std::filesystem::path file;
  bool to_write = false;
  std::unique_ptr<sqlite3, CloseDatabase> handle;

  [[noreturn]] void fail(int code) const {
    std::string reason = sqlite3_errmsg(handle.get());
    const int system = sqlite3_system_errno(handle.get());
    const int kind = code & 0xff;
    if (system != 0 && (kind == SQLITE_IOERR || kind == SQLITE_CANTOPEN))
      reason += fmt::format(" ({})", std::strerror(system));
    if (kind == SQLITE_NOTADB) throw not_a_journal(file, "something else");
    if (kind == SQLITE_CORRUPT) throw not_a_journal(file, "a damaged one");
    if (!to_write) throw not_a_journal(file, reason);
    throw OutputFailure(fmt::format("{}: cannot be written: {}", file.string(), reason));
  }
  Statement prepared(std::string_view sql) const {
    sqlite3_stmt* statement = nullptr;
    const int code =
        sqlite3_prepare_v2(handle.get(), sql.data(), int(sql.size()), &statement, nullptr);
    if (code != SQLITE_OK) fail(code);
    return Statement(statement);
  }
  /// Returns true if there is another row.
  bool step(const Statement& statement) const {
    const int code = sqlite3_step(statement.get());
    if (code != SQLITE_ROW && code != SQLITE_DONE) fail(code);
    return code == SQLITE_ROW;
  }
  void run(std::string_view sql) const {
    for (const Statement statement = prepared(sql); step(statement);) continue;
  }
  std::int64_t number(std::string_view sql) const {
    const Statement statement = prepared(sql);
    return step(statement) ? sqlite3_column_int64(statement.get(), 0) : 0;
  }
};

Database opened(const std::filesystem::path& file, int flags) {
  sqlite3* handle = nullptr;
  const int code =
      sqlite3_open_v2(std::filesystem::absolute(file).c_str(), &handle, flags, nullptr);
  Database database{file, (flags & SQLITE_OPEN_READWRITE) != 0, {}};
  database.handle.reset(handle);
  if (handle == nullptr) throw std::bad_alloc();
  if (code != SQLITE_OK) database.fail(code);
  sqlite3_extended_result_codes(handle, 1);
  sqlite3_busy_timeout(handle, busy_ms);
  // The file may come from an untrusted source.
  sqlite3_db_config(handle, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  database.run("PRAGMA cell_size_check = ON");
  return database;
}

/// Returns the bytes of a text or blob, which SQLite keeps until the next step.
std::string_view bytes(const Statement& row, int column) {
  const void* data = sqlite3_column_blob(row.get(), column);
  const int size = sqlite3_column_bytes(row.get(), column);
  return data == nullptr ? std::string_view()
                         : std::string_view(static_cast<const char*>(data), std::size_t(size));
}

Row row_at(const Database& database, const Statement& step) {
  Row row;
  row.index = std::uint64_t(sqlite3_column_int64(step.get(), 0));
  const bool kinds = sqlite3_column_type(step.get(), 1) == SQLITE_BLOB &&
                     sqlite3_column_type(step.get(), 2) == SQLITE_TEXT;
  const std::string_view answers = bytes(step, 1);
  row.fault = bytes(step, 2);
  if (!kinds || answers.size() % 8 != 0 ||
      sqlite3_column_int64(step.get(), 3) != check_sum(row.index, answers, row.fault))
    throw not_a_journal(database.file, fmt::format("a damaged one (case {})", row.index));
  row.answers = parse_responses(answers);
  return row;
}

template <typename Visit>
void for_every_row(const Database& database, const Visit& visit) {
  const Statement rows =
      database.prepared("SELECT number, answers, fault, check_sum FROM cases ORDER BY number");
  while (database.step(rows)) visit(row_at(database, rows));
}

/// Checks the whole file, so that damage is reported before hours of work. Rows have their own
/// checksums; this finds pages in the wrong order.
void check_pages(const Database& database) {
  const Statement check = database.prepared("PRAGMA quick_check(1)");
  if (!database.step(check) || bytes(check, 0) != "ok")
    throw not_a_journal(database.file, "a damaged one");
}

/// Returns true if nothing has been written to the file: a process may end just after creating it.
bool is_blank(const Database& database) {
  return database.number("SELECT count(*) FROM sqlite_schema") == 0 &&
         database.number("PRAGMA application_id") == 0;
}

/// @throws BadInput if the database is not a journal
std::string study_identity(const Database& database) {
  const Statement schema = database.prepared("SELECT sql FROM sqlite_schema ORDER BY name");
  for (const char* table : tables)
    if (!database.step(schema) || bytes(schema, 0) != table)
      throw not_a_journal(database.file, "something else");
  if (database.step(schema) || database.number("PRAGMA application_id") != application_id)
    throw not_a_journal(database.file, "something else");
  const Statement study = database.prepared("SELECT identity FROM study");
  if (!database.step(study)) throw not_a_journal(database.file, "one without a study");
  return std::string(bytes(study, 0));
}

/// Runs `write` in a transaction: either all of it takes effect or nothing.
template <typename Write>
void run_transaction(const Database& database, const Write& write) {
  database.run("BEGIN IMMEDIATE");
  try {
    write();
    database.run("COMMIT");
  } catch (...) {
    sqlite3_exec(database.handle.get(), "ROLLBACK", nullptr, nullptr, nullptr);
    throw;
  }
}

void bind_bytes(const Statement& statement, int place, std::string_view value, bool text) {
  const char* data = value.empty() ? "" : value.data();  // a null pointer would mean NULL
  if (text)
    sqlite3_bind_text(statement.get(), place, data, int(value.size()), SQLITE_STATIC);
  else
    sqlite3_bind_blob(statement.get(), place, data, int(value.size()), SQLITE_STATIC);
}

void begin(const Database& database, const std::string& identity) {
  run_transaction(database, [&] {
    for (const char* table : tables) database.run(table);
    const Statement study = database.prepared("INSERT INTO study VALUES (?)");
    bind_bytes(study, 1, identity, true);
    database.step(study);
    database.run(fmt::format("PRAGMA application_id = {}", application_id));
  });
}

void rename(const Database& database, const std::string& identity) {
  run_transaction(database, [&] {
    const Statement study = database.prepared("UPDATE study SET identity = ?");
    bind_bytes(study, 1, identity, true);
    database.step(study);
  });
}

void check_identity(const std::filesystem::path& file, const std::string& seen,
                    const std::string& expected) {
  if (seen == expected) return;
  throw BadInput(file.string(), 0, 0,
                 "the journal of this study with this scene and program (choose another --out, or "
                 "delete the file to start from the beginning)",
                 "the journal of another one");
}

/// Signature of a file that SQLite keeps beside a database; zeros while SQLite fills it.
struct Beside {
  const char* ending;
  std::string_view begins;
  std::uintmax_t min_file_bytes;  ///< a smaller file is being created
};
constexpr std::string_view memory_begins(
    std::endian::native == std::endian::little ? "\x18\xe2\x2d\0" : "\0\x2d\xe2\x18", 4);
constexpr Beside beside[] = {{"-wal", "\x37\x7f\x06", 1},
                             {"-shm", memory_begins, 4},
                             {"-journal", "\xd9\xd5\x05\xf9\x20\xa1\x63\xd7", 1}};

bool is_sqlite_companion(const std::filesystem::path& file, const Beside& kind) {
  std::error_code failure;
  if (std::filesystem::file_size(file, failure) < kind.min_file_bytes && !failure) return true;
  std::string head(kind.begins.size(), '\0');
  std::ifstream(file, std::ios::binary).read(head.data(), std::streamsize(head.size()));
  return head == kind.begins || head == std::string(head.size(), '\0');
}

/// Checks the files at the names that SQLite uses: it would follow links and overwrite foreign
/// files.
void check_places(const std::filesystem::path& file) {
  const auto refuse = [](const std::filesystem::path& seen, const char* what) {
    throw OutputFailure(
        fmt::format("{}: {} stands there; move it, or choose another --out", seen.string(), what));
  };
  std::error_code none;
  const auto is_there = [&](const std::filesystem::path& one) {
    const auto status = std::filesystem::symlink_status(one, none);
    const bool there = std::filesystem::exists(status);
    if (there && status.type() != std::filesystem::file_type::regular)
      refuse(one, "a link, or what is no file,");
    return there;
  };
  is_there(file);
  for (const Beside& kind : beside) {
    const std::filesystem::path one = file.string() + kind.ending;
    if (is_there(one) && !is_sqlite_companion(one, kind))
      refuse(one, "a file that abbe did not make");
  }
}

Database open_to_write(const std::filesystem::path& file, const std::string& identity) {
  check_places(file);
  std::error_code missing;
  const auto size = std::filesystem::file_size(file, missing);
  // SQLite takes a file shorter than a page for an empty database, and would overwrite it.
  if (!missing && size > 0 && size < 512) throw not_a_journal(file, "something else");
  Database database = opened(file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  const bool blank = is_blank(database);
  const std::string seen = blank ? identity : study_identity(database);
  const bool others = seen != identity;
  // A study that failed before its first case leaves nothing that could be mixed up with another
  // one.
  const bool empty = !blank && database.number("SELECT count(*) FROM cases") == 0;
  if (!empty) check_identity(file, seen, identity);
  // WAL: committed rows need no repair after a crash, and readers need not wait. FULL: WAL with the
  // default NORMAL may lose the last commits in a power failure.
  database.run("PRAGMA journal_mode = WAL");
  database.run("PRAGMA synchronous = FULL");
  if (blank) begin(database, identity);
  if (others) rename(database, identity);
  check_pages(database);
  for_every_row(database, [](const Row&) {});
  return database;
}

Database open_to_read(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored))
    throw not_a_journal(file,
                        std::filesystem::exists(file, ignored) ? "something else" : "no file");
  check_places(file);
  return opened(file, SQLITE_OPEN_READONLY);
}

}  // namespace

bool operator==(const Row& a, const Row& b) {
  return a.index == b.index && a.fault == b.fault && bytes_of(a.answers) == bytes_of(b.answers);
}

struct Journal::Connection {
  Connection(const std::filesystem::path& file, const std::string& identity)
      : lock(file), database(open_to_write(file, identity)) {}
  /// Leaves one file, which can be read from a read-only folder; while a reader uses it, the
  /// journal stays as it is.
  ~Connection() {
    sqlite3_busy_timeout(database.handle.get(), 0);
    sqlite3_exec(database.handle.get(), "PRAGMA journal_mode = DELETE", nullptr, nullptr, nullptr);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  JournalLock lock;  // outlives the database
  Database database;
};

Journal::Journal(const std::filesystem::path& file, const std::string& identity)
    : connection_(std::make_unique<Connection>(file, identity)) {}
Journal::Journal(Journal&&) noexcept = default;
Journal& Journal::operator=(Journal&&) noexcept = default;
Journal::~Journal() = default;

void Journal::add(const std::vector<Row>& rows) {
  const Database& database = connection_->database;
  run_transaction(database, [&] {
    const Statement insert =
        database.prepared("INSERT INTO cases VALUES (?, ?, ?, ?) ON CONFLICT DO NOTHING");
    for (const Row& row : rows) {
      // SQLite's integers are signed.
      assert(row.index >> 63 == 0);
      const std::string answers = bytes_of(row.answers);
      sqlite3_bind_int64(insert.get(), 1, std::int64_t(row.index));
      bind_bytes(insert, 2, answers, false);
      bind_bytes(insert, 3, row.fault, true);
      sqlite3_bind_int64(insert.get(), 4, check_sum(row.index, answers, row.fault));
      database.step(insert);
      sqlite3_reset(insert.get());
    }
  });
}

std::vector<std::uint64_t> Journal::finished() const {
  const Database& database = connection_->database;
  std::vector<std::uint64_t> numbers;
  const Statement cases = database.prepared("SELECT number FROM cases ORDER BY number");
  while (database.step(cases))
    numbers.push_back(std::uint64_t(sqlite3_column_int64(cases.get(), 0)));
  return numbers;
}

Recorded recorded(const std::filesystem::path& file) {
  const Database database = open_to_read(file);
  if (is_blank(database)) throw not_a_journal(file, "an empty file");
  Recorded found;
  found.identity = study_identity(database);
  check_pages(database);
  for_every_row(database, [&](Row row) { found.rows.push_back(std::move(row)); });
  return found;
}

Recorded merged(const std::vector<std::filesystem::path>& files) {
  if (files.empty()) throw std::invalid_argument("no journals to merge");
  struct Found {
    Row row;
    std::size_t file;
  };
  std::vector<Found> all;
  Recorded result;
  for (std::size_t i = 0; i < files.size(); ++i) {
    Recorded one = recorded(files[i]);
    if (i == 0) result.identity = one.identity;
    check_identity(files[i], one.identity, result.identity);
    for (Row& row : one.rows) all.push_back({std::move(row), i});
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Found& a, const Found& b) { return a.row.index < b.row.index; });
  for (Found& found : all) {
    const bool again = !result.rows.empty() && result.rows.back().index == found.row.index;
    if (!again)
      result.rows.push_back(std::move(found.row));
    else if (result.rows.back() != found.row)
      throw BadInput(
          files[found.file].string(), 0, 0,
          fmt::format("the answers of case {} as in the other journals", found.row.index),
          "other answers");
  }
  return result;
}

}  // namespace abbe::sim::study
