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

/// A lock file beside a journal, held by one process and released when that process ends. The locks
/// of SQLite are not sufficient, since they protect single reads and writes: a second process could
/// compute the same cases.
class JournalLock {
 public:
  /// @throws OutputFailure if another process, which it names, holds the lock, or if the file is
  /// not a lock of abbe
  explicit JournalLock(const std::filesystem::path& journal);
  ~JournalLock();
  JournalLock(const JournalLock&) = delete;
  JournalLock& operator=(const JournalLock&) = delete;

 private:
  void try_to_lock();

  std::filesystem::path journal_, file_;
  int descriptor_ = -1;
};

namespace {

[[noreturn]] void throw_not_locked(const std::filesystem::path& file, int reason) {
  throw OutputFailure(
      fmt::format("{}: cannot be locked: {}", file.string(), std::strerror(reason)));
}

/// Returns the process that holds the lock, as it is named in the file.
std::string lock_holder(int descriptor) {
  char text[200];
  const ssize_t length = ::pread(descriptor, text, sizeof text, 0);
  return length > 0 ? std::string(text, std::size_t(length)) : "another process";
}

/// Returns true if the file can be a lock: it is empty or names an earlier holder.
bool is_lock(int descriptor) {
  struct stat status {};
  if (::fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) return false;
  const std::string holder = status.st_size > 0 ? lock_holder(descriptor) : "";
  return status.st_size == 0 || (status.st_size < 200 && holder.starts_with("process ") &&
                                 holder.find(" on ") != holder.npos);
}

}  // namespace

JournalLock::JournalLock(const std::filesystem::path& journal)
    : journal_(journal), file_(journal.string() + "-lock") {
  while (descriptor_ < 0) try_to_lock();
  char host[100] = "";
  ::gethostname(host, sizeof host - 1);
  const std::string holder = fmt::format("process {} on {}", ::getpid(), host);
  // The text is only information for other processes, so a failure, as on a full disk, is ignored.
  if (::ftruncate(descriptor_, 0) == 0) [[maybe_unused]]
    const ssize_t written = ::pwrite(descriptor_, holder.data(), holder.size(), 0);
}

JournalLock::~JournalLock() {
  ::unlink(file_.c_str());
  ::close(descriptor_);
}

void JournalLock::try_to_lock() {
  const int descriptor = ::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
  if (descriptor < 0) throw_not_locked(file_, errno);
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    const int reason = errno;
    const std::string holder = lock_holder(descriptor);
    ::close(descriptor);
    if (reason == EINTR) return;
    if (reason != EWOULDBLOCK) throw_not_locked(file_, reason);
    throw OutputFailure(fmt::format(
        "{}: another process is running this study ({}); wait for it or choose another --out",
        journal_.string(), holder));
  }
  if (!is_lock(descriptor)) {
    ::close(descriptor);
    throw OutputFailure(fmt::format(
        "{}: the file exists and was not created by abbe; move it or choose another --out",
        file_.string()));
  }
  // If the last holder removed the file between open and flock, this lock is on a deleted file and
  // must be requested again.
  struct stat locked {
  }, current{};
  if (::fstat(descriptor, &locked) == 0 && ::stat(file_.c_str(), &current) == 0 &&
      locked.st_ino == current.st_ino && locked.st_dev == current.st_dev)
    descriptor_ = descriptor;
  else
    ::close(descriptor);
}

namespace {

constexpr int application_id = 0x61626265;  // "abbe", in the header of the file
constexpr int busy_ms = 20000;  // a reader may hold the file while the writer merges its log
constexpr const char* tables[] = {
    "CREATE TABLE cases (number INTEGER PRIMARY KEY, answers BLOB NOT NULL, fault TEXT NOT NULL, "
    "check_sum INTEGER NOT NULL)",
    "CREATE TABLE study (identity TEXT NOT NULL)"};

/// Returns responses as bytes, little-endian on every computer, so that journals of different
/// computers can be merged.
std::string response_bytes(const std::vector<double>& responses) {
  std::string bytes;
  bytes.reserve(8 * responses.size());
  for (const double response : responses) {
    const auto bits = std::bit_cast<std::uint64_t>(response);
    for (int i = 0; i < 8; ++i) bytes += char(bits >> (8 * i));
  }
  return bytes;
}

/// Returns the responses in such bytes.
std::vector<double> parse_responses(std::string_view bytes) {
  std::vector<double> responses(bytes.size() / 8);
  for (std::size_t k = 0; k < responses.size(); ++k) {
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < 8; ++i)
      bits |= std::uint64_t(static_cast<unsigned char>(bytes[8 * k + i])) << (8 * i);
    responses[k] = std::bit_cast<double>(bits);
  }
  return responses;
}

/// Returns the checksum of a row.
std::int64_t row_checksum(std::uint64_t index, std::string_view response_blob,
                          std::string_view fault) {
  const std::uint64_t start = fnv_1a(fmt::format("{} {} ", index, response_blob.size()));
  return std::int64_t(fnv_1a(fault, fnv_1a(response_blob, start)));
}

struct DatabaseCloser {
  void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
};
struct StatementFinalizer {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Statement = std::unique_ptr<sqlite3_stmt, StatementFinalizer>;

/// Returns the exception for a file that is not a journal, or not a readable one.
BadInput journal_error(const std::filesystem::path& file, const std::string& seen) {
  return BadInput(file.string(), 0, 0,
                  "the journal of a study (to start over, delete the file or choose another --out)",
                  seen);
}

/// An SQLite database. Its functions throw BadInput or, if it was opened for writing,
/// OutputFailure.
struct Database {
  std::filesystem::path file;
  bool is_writable = false;
  std::unique_ptr<sqlite3, DatabaseCloser> handle;

  [[noreturn]] void fail(int code) const {
    std::string reason = sqlite3_errmsg(handle.get());
    const int system = sqlite3_system_errno(handle.get());
    const int kind = code & 0xff;
    if (system != 0 && (kind == SQLITE_IOERR || kind == SQLITE_CANTOPEN))
      reason += fmt::format(" ({})", std::strerror(system));
    if (kind == SQLITE_NOTADB) throw journal_error(file, "a different file");
    if (kind == SQLITE_CORRUPT) throw journal_error(file, "a damaged journal");
    if (!is_writable) throw journal_error(file, reason);
    throw OutputFailure(fmt::format("{}: cannot be written: {}", file.string(), reason));
  }
  Statement prepare(std::string_view sql) const {
    sqlite3_stmt* statement = nullptr;
    const int code =
        sqlite3_prepare_v2(handle.get(), sql.data(), int(sql.size()), &statement, nullptr);
    if (code != SQLITE_OK) fail(code);
    return Statement(statement);
  }
  /// Executes a statement up to its next row. Returns true if there is one.
  bool step(const Statement& statement) const {
    const int code = sqlite3_step(statement.get());
    if (code != SQLITE_ROW && code != SQLITE_DONE) fail(code);
    return code == SQLITE_ROW;
  }
  void run(std::string_view sql) const {
    for (const Statement statement = prepare(sql); step(statement);) continue;
  }
  std::int64_t number(std::string_view sql) const {
    const Statement statement = prepare(sql);
    return step(statement) ? sqlite3_column_int64(statement.get(), 0) : 0;
  }
};

/// Opens a database with protection against manipulated files.
/// @param flags  of sqlite3_open_v2
Database open_database(const std::filesystem::path& file, int flags) {
  sqlite3* handle = nullptr;
  const int code =
      sqlite3_open_v2(std::filesystem::absolute(file).c_str(), &handle, flags, nullptr);
  Database database{file, (flags & SQLITE_OPEN_READWRITE) != 0, {}};
  database.handle.reset(handle);
  if (handle == nullptr) throw std::bad_alloc();
  if (code != SQLITE_OK) database.fail(code);
  sqlite3_extended_result_codes(handle, 1);
  sqlite3_busy_timeout(handle, busy_ms);
  // A journal may come from an untrusted source.
  sqlite3_db_config(handle, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  database.run("PRAGMA cell_size_check = ON");
  return database;
}

/// Returns the bytes of a text or blob, which are valid until the next step.
std::string_view column_bytes(const Statement& row, int column) {
  const void* data = sqlite3_column_blob(row.get(), column);
  const int size = sqlite3_column_bytes(row.get(), column);
  return data == nullptr ? std::string_view()
                         : std::string_view(static_cast<const char*>(data), std::size_t(size));
}

/// Returns the row at which a statement is. Throws BadInput if its checksum is wrong.
Row read_row(const Database& database, const Statement& statement) {
  Row row;
  row.index = std::uint64_t(sqlite3_column_int64(statement.get(), 0));
  const bool has_types = sqlite3_column_type(statement.get(), 1) == SQLITE_BLOB &&
                         sqlite3_column_type(statement.get(), 2) == SQLITE_TEXT;
  const std::string_view response_blob = column_bytes(statement, 1);
  row.fault = column_bytes(statement, 2);
  if (!has_types || response_blob.size() % 8 != 0 ||
      sqlite3_column_int64(statement.get(), 3) != row_checksum(row.index, response_blob, row.fault))
    throw journal_error(database.file, fmt::format("a damaged journal (case {})", row.index));
  row.response_values = parse_responses(response_blob);
  return row;
}

template <typename Visit>
void for_every_row(const Database& database, const Visit& visit) {
  const Statement rows =
      database.prepare("SELECT number, answers, fault, check_sum FROM cases ORDER BY number");
  while (database.step(rows)) visit(read_row(database, rows));
}

/// Checks the structure of the whole file, so that damage is reported before hours of work. The
/// checksums of the rows do not detect pages in the wrong order.
void check_pages(const Database& database) {
  const Statement check = database.prepare("PRAGMA quick_check(1)");
  if (!database.step(check) || column_bytes(check, 0) != "ok")
    throw journal_error(database.file, "a damaged journal");
}

/// Returns true if nothing has been written to the file, as after a process that ended just after
/// creating it.
bool is_blank(const Database& database) {
  return database.number("SELECT count(*) FROM sqlite_schema") == 0 &&
         database.number("PRAGMA application_id") == 0;
}

/// Returns the identity of the study to which a journal belongs.
/// @throws BadInput if the database is not a journal
std::string journal_identity(const Database& database) {
  const Statement schema = database.prepare("SELECT sql FROM sqlite_schema ORDER BY name");
  for (const char* table : tables)
    if (!database.step(schema) || column_bytes(schema, 0) != table)
      throw journal_error(database.file, "a different file");
  if (database.step(schema) || database.number("PRAGMA application_id") != application_id)
    throw journal_error(database.file, "a different file");
  const Statement study = database.prepare("SELECT identity FROM study");
  if (!database.step(study)) throw journal_error(database.file, "a journal without a study");
  return std::string(column_bytes(study, 0));
}

/// Runs `write` in a transaction: either all of its changes take effect or none.
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

/// Returns a pointer to the bytes that is never null, because SQLite takes a null pointer as NULL.
const char* non_null_data(std::string_view value) { return value.empty() ? "" : value.data(); }

void bind_text(const Statement& statement, int index, std::string_view text) {
  sqlite3_bind_text(statement.get(), index, non_null_data(text), int(text.size()), SQLITE_STATIC);
}

void bind_blob(const Statement& statement, int index, std::string_view bytes) {
  sqlite3_bind_blob(statement.get(), index, non_null_data(bytes), int(bytes.size()), SQLITE_STATIC);
}

/// Creates the tables of a new journal.
void create_tables(const Database& database, const std::string& identity) {
  run_transaction(database, [&] {
    for (const char* table : tables) database.run(table);
    const Statement study = database.prepare("INSERT INTO study VALUES (?)");
    bind_text(study, 1, identity);
    database.step(study);
    database.run(fmt::format("PRAGMA application_id = {}", application_id));
  });
}

/// Gives a journal without cases to a study.
void set_identity(const Database& database, const std::string& identity) {
  run_transaction(database, [&] {
    const Statement study = database.prepare("UPDATE study SET identity = ?");
    bind_text(study, 1, identity);
    database.step(study);
  });
}

/// Throws BadInput if a journal belongs to another study.
void check_identity(const std::filesystem::path& file, const std::string& seen,
                    const std::string& expected) {
  if (seen == expected) return;
  throw BadInput(file.string(), 0, 0,
                 "the journal of this study with this scene and program (to start over, choose "
                 "another --out or delete the file)",
                 "the journal of another study");
}

/// A file that SQLite keeps beside a database.
struct CompanionFile {
  const char* suffix;
  std::string_view signature;     ///< first bytes; zeros while SQLite fills the file
  std::uintmax_t min_file_bytes;  ///< a smaller file is being created
};
constexpr std::string_view shared_memory_signature(
    std::endian::native == std::endian::little ? "\x18\xe2\x2d\0" : "\0\x2d\xe2\x18", 4);
constexpr CompanionFile companion_files[] = {{"-wal", "\x37\x7f\x06", 1},
                                             {"-shm", shared_memory_signature, 4},
                                             {"-journal", "\xd9\xd5\x05\xf9\x20\xa1\x63\xd7", 1}};

/// Returns true if a file has the signature of its kind, or if SQLite is creating it.
bool is_sqlite_companion(const std::filesystem::path& file, const CompanionFile& companion) {
  std::error_code failure;
  if (std::filesystem::file_size(file, failure) < companion.min_file_bytes && !failure) return true;
  std::string first_bytes(companion.signature.size(), '\0');
  std::ifstream(file, std::ios::binary)
      .read(first_bytes.data(), std::streamsize(first_bytes.size()));
  return first_bytes == companion.signature || first_bytes == std::string(first_bytes.size(), '\0');
}

/// Throws OutputFailure if a file name that SQLite uses is a link or a file of something else:
/// SQLite would follow or overwrite it.
void check_file_names(const std::filesystem::path& file) {
  const auto fail = [](const std::filesystem::path& seen, const char* what) {
    throw OutputFailure(
        fmt::format("{}: {}; move it or choose another --out", seen.string(), what));
  };
  std::error_code ignored;
  const auto check_exists = [&](const std::filesystem::path& name) {
    const auto status = std::filesystem::symlink_status(name, ignored);
    const bool exists = std::filesystem::exists(status);
    if (exists && status.type() != std::filesystem::file_type::regular)
      fail(name, "the path is a link or not a regular file");
    return exists;
  };
  check_exists(file);
  for (const CompanionFile& kind : companion_files) {
    const std::filesystem::path companion = file.string() + kind.suffix;
    if (check_exists(companion) && !is_sqlite_companion(companion, kind))
      fail(companion, "the file was not created by abbe");
  }
}

/// Opens a journal, or creates it if the file does not exist.
Database open_to_write(const std::filesystem::path& file, const std::string& identity) {
  check_file_names(file);
  std::error_code missing;
  const auto size = std::filesystem::file_size(file, missing);
  // SQLite would overwrite a file shorter than a page, because it takes it for an empty database.
  if (!missing && size > 0 && size < 512) throw journal_error(file, "a different file");
  Database database = open_database(file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  const bool is_new = is_blank(database);
  const std::string seen = is_new ? identity : journal_identity(database);
  // A journal without cases, left by a study that failed early, may be reused by another study.
  const bool has_no_cases = !is_new && database.number("SELECT count(*) FROM cases") == 0;
  if (!has_no_cases) check_identity(file, seen, identity);
  // With WAL committed rows need no repair after a crash, and readers do not wait. It needs FULL,
  // because with the default, NORMAL, a power failure may lose the last commits.
  database.run("PRAGMA journal_mode = WAL");
  database.run("PRAGMA synchronous = FULL");
  if (is_new) create_tables(database, identity);
  if (seen != identity) set_identity(database, identity);
  check_pages(database);
  for_every_row(database, [](const Row&) {});  // verifies the checksums
  return database;
}

/// Opens a journal for reading only.
Database open_to_read(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored))
    throw journal_error(file,
                        std::filesystem::exists(file, ignored) ? "a different file" : "no file");
  check_file_names(file);
  return open_database(file, SQLITE_OPEN_READONLY);
}

}  // namespace

bool operator==(const Row& a, const Row& b) {
  return a.index == b.index && a.fault == b.fault &&
         response_bytes(a.response_values) == response_bytes(b.response_values);
}

struct Journal::Connection {
  Connection(const std::filesystem::path& file, const std::string& identity)
      : lock(file), database(open_to_write(file, identity)) {}
  /// Merges the write-ahead log into the journal, so that it can be read from a read-only folder.
  /// If a reader uses the journal, this is left out.
  ~Connection() {
    sqlite3_busy_timeout(database.handle.get(), 0);
    sqlite3_exec(database.handle.get(), "PRAGMA journal_mode = DELETE", nullptr, nullptr, nullptr);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  JournalLock lock;  // must outlive the database
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
        database.prepare("INSERT INTO cases VALUES (?, ?, ?, ?) ON CONFLICT DO NOTHING");
    for (const Row& row : rows) {
      // SQLite's integers are signed.
      assert(row.index >> 63 == 0);
      const std::string response_values = response_bytes(row.response_values);
      sqlite3_bind_int64(insert.get(), 1, std::int64_t(row.index));
      bind_blob(insert, 2, response_values);
      bind_text(insert, 3, row.fault);
      sqlite3_bind_int64(insert.get(), 4, row_checksum(row.index, response_values, row.fault));
      database.step(insert);
      sqlite3_reset(insert.get());
    }
  });
}

std::vector<std::uint64_t> Journal::finished() const {
  const Database& database = connection_->database;
  std::vector<std::uint64_t> numbers;
  const Statement cases = database.prepare("SELECT number FROM cases ORDER BY number");
  while (database.step(cases))
    numbers.push_back(std::uint64_t(sqlite3_column_int64(cases.get(), 0)));
  return numbers;
}

JournalContents read_journal(const std::filesystem::path& file) {
  const Database database = open_to_read(file);
  if (is_blank(database)) throw journal_error(file, "an empty file");
  JournalContents contents;
  contents.identity = journal_identity(database);
  check_pages(database);
  for_every_row(database, [&](Row row) { contents.rows.push_back(std::move(row)); });
  return contents;
}

JournalContents merge_journals(const std::vector<std::filesystem::path>& files) {
  if (files.empty()) throw std::invalid_argument("no journals to merge");
  struct FileRow {
    Row row;
    std::size_t file;
  };
  std::vector<FileRow> file_rows;
  JournalContents result;
  for (std::size_t i = 0; i < files.size(); ++i) {
    JournalContents contents = read_journal(files[i]);
    if (i == 0) result.identity = contents.identity;
    check_identity(files[i], contents.identity, result.identity);
    for (Row& row : contents.rows) file_rows.push_back({std::move(row), i});
  }
  std::stable_sort(file_rows.begin(), file_rows.end(),
                   [](const FileRow& a, const FileRow& b) { return a.row.index < b.row.index; });
  for (FileRow& file_row : file_rows) {
    const Row& row = file_row.row;
    const bool is_repeated = !result.rows.empty() && result.rows.back().index == row.index;
    if (!is_repeated)
      result.rows.push_back(std::move(file_row.row));
    else if (result.rows.back() != row)
      throw BadInput(files[file_row.file].string(), 0, 0,
                     fmt::format("the same results of case {} as in the other journals", row.index),
                     "different results");
  }
  return result;
}

}  // namespace abbe::sim::study
