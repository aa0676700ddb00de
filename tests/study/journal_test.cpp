#include "sim/study/journal.h"
#include <sqlite3.h>
#include <sys/resource.h>
#include "sim/files/output.h"
#include "tests/study/farm_runs.h"
#include "tests/study/small_disk.h"
#include "tests/test.h"

namespace abbe::sim::study {
namespace {

Row random_row(std::uint64_t index, std::mt19937_64& random) {
  Row row{index, std::vector<double>(random() % 9), ""};
  for (double& answer : row.response_values)
    answer = std::bit_cast<double>(random());  // many are NaN
  for (std::uint64_t n = random() % 3 == 0 ? random() % 50 : 0; n > 0; --n)
    row.fault += char(random());
  return row;
}

std::vector<Row> random_rows(std::uint64_t first, std::uint64_t last, unsigned seed) {
  std::mt19937_64 random(seed + first);
  std::vector<Row> rows;
  for (std::uint64_t i = first; i < last; ++i) rows.push_back(random_row(i, random));
  return rows;
}

/// As batches of ten make them.
std::vector<Row> random_rows_in_tens(std::uint64_t first, std::uint64_t last) {
  std::vector<Row> rows;
  for (std::uint64_t i = first; i < last; i += 10)
    for (Row& row : random_rows(i, i + 10, 1)) rows.push_back(std::move(row));
  return rows;
}

/// What is said by the one of our failures that it throws; the other kinds pass through.
template <typename Failure, typename Act>
std::string failure_by(const Act& act) {
  return thrown_text<Failure>([&] { act(); });
}

int files_in(const fs::path& folder) {
  return int(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(Journal, RowsComeBackBitForBit) {
  const unsigned seed = 61;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const RunFolder folder;
  std::vector<Row> rows = random_rows(0, 500, seed);
  rows.push_back({777, {std::bit_cast<double>(0xfff4'0000'0000'0001u), -0.0, 5e-324}, ""});
  rows.push_back({(std::uint64_t(1) << 63) - 1, {}, std::string("a\0b µ", 6)});
  {
    Journal journal(folder / "journal.db", "study 1");
    EXPECT_TRUE(journal.finished().empty());
    std::vector<Row> backwards(rows.rbegin(), rows.rend());
    journal.add({backwards.begin(), backwards.begin() + 100});
    journal.add({});
    journal.add({backwards.begin() + 100, backwards.end()});
  }
  const JournalContents found = read_journal(folder / "journal.db");
  EXPECT_EQ(found.identity, "study 1");
  EXPECT_EQ(found.rows, rows);
  EXPECT_EQ(files_in(folder.path()), 1) << "a closed journal is one file";
}

TEST(Journal, ACaseThatIsThereStaysAsItIs) {
  const RunFolder folder;
  Journal journal(folder / "journal.db", "study 1");
  journal.add({{4, {1.0}, ""}});
  journal.add({{3, {2.0}, ""}, {4, {9.0}, "other"}});
  Journal moved = std::move(journal);
  EXPECT_EQ(moved.finished(), (std::vector<std::uint64_t>{3, 4}));
  EXPECT_EQ(read_journal(folder / "journal.db").rows,
            (std::vector<Row>{{3, {2.0}, ""}, {4, {1.0}, ""}}));
}

TEST(Journal, OneOfAnotherStudyIsRefusedWithWhatToDo) {
  const RunFolder folder;
  const fs::path file = folder / "journal.db";
  Journal(file, "study 1").add(random_rows(0, 20, 1));
  const std::string before = text_of(file);
  const std::string refusal = failure_by<BadInput>([&] { Journal(file, "study 2"); });
  EXPECT_TRUE(has(refusal, file.string()) && has(refusal, "--out") && has(refusal, "delete"))
      << refusal;
  EXPECT_EQ(text_of(file), before);
  EXPECT_EQ(files_in(folder.path()), 1);
  EXPECT_EQ(Journal(file, "study 1").finished().size(), 20u);
}

TEST(Journal, WhatIsNoJournalIsRefusedAndLeftAsItWas) {
  const RunFolder folder;
  sqlite3* other = nullptr;
  sqlite3_open((folder / "other.db").c_str(), &other);
  sqlite3_exec(other, "CREATE TABLE cases (number INTEGER)", nullptr, nullptr, nullptr);
  sqlite3_close(other);
  folder.write("letter.db", "x");
  folder.write("text.db", "cases = 3\n");
  folder.write("noise.db", std::string(5000, '\x9d'));
  folder.write("head.db", text_of(folder / "other.db").substr(0, 16) + std::string(9000, '\x11'));
  for (const char* name : {"other.db", "letter.db", "text.db", "noise.db", "head.db"}) {
    const std::string before = text_of(folder / name);
    EXPECT_TRUE(has(failure_by<BadInput>([&] { Journal(folder / name, "study"); }), name)) << name;
    EXPECT_TRUE(has(failure_by<BadInput>([&] { read_journal(folder / name); }), name)) << name;
    EXPECT_EQ(text_of(folder / name), before) << name;
  }
  EXPECT_TRUE(has(failure_by<BadInput>([&] { read_journal(folder / "no.db"); }), "no file"));
  EXPECT_NE(failure_by<BadInput>([&] { read_journal(folder.path()); }), "");
  EXPECT_NE(failure_by<OutputFailure>([&] { Journal(folder.path(), "study"); }), "");
  EXPECT_NE(failure_by<OutputFailure>([&] { Journal(folder / "no/journal.db", "study"); }), "");
}

TEST(Journal, AnEmptyFileIsBegun) {
  const RunFolder folder;
  const fs::path file = folder.write("journal.db", "");
  EXPECT_NE(failure_by<BadInput>([&] { read_journal(file); }), "");
  Journal(file, "study").add(random_rows(0, 3, 1));
  EXPECT_EQ(read_journal(file).rows, random_rows(0, 3, 1));
}

TEST(Journal, ATruncatedOneIsRefused) {
  const RunFolder folder;
  const fs::path file = folder / "journal.db", cut = folder / "cut.db";
  Journal(file, "study").add(random_rows(0, 300, 1));
  const std::string whole = text_of(file);
  for (std::size_t size = 1; size < whole.size(); size += 509) {
    folder.write("cut.db", whole.substr(0, size));
    EXPECT_NE(failure_by<BadInput>([&] { read_journal(cut); }), "") << size;
    EXPECT_NE(failure_by<BadInput>([&] { Journal(cut, "study"); }), "") << size;
  }
}

TEST(Journal, ADamagedOneIsRefusedUnlessTheDamageIsOutsideItsRows) {
  SeededRandom random(62);
  const RunFolder folder;
  const fs::path file = folder / "journal.db", damaged = folder / "damaged.db";
  const std::vector<Row> rows = random_rows(0, 300, 1);
  Journal(file, "study").add(rows);
  const std::string whole = text_of(file);
  int refused = 0;
  const int trials = 400;
  for (int i = 0; i < trials; ++i) {
    std::string text = whole;
    const std::size_t place = i < 100 ? std::size_t(i) : random() % text.size();
    text[place] = char(text[place] ^ (1 << random() % 8));
    folder.write("damaged.db", text);
    try {
      const JournalContents found = read_journal(damaged);
      EXPECT_EQ(found.rows, rows) << "byte " << place;
    } catch (const BadInput&) {
      ++refused;
    }
  }
  std::cout << refused << " of " << trials << " single bits refused, " << whole.size()
            << " bytes\n";
  EXPECT_GT(refused, trials / 3);
}

TEST(Journal, ASecondProcessIsTurnedAwayUntilTheFirstEnds) {
  const RunFolder folder;
  const fs::path file = folder / "journal.db";
  {
    Journal journal(file, "study");
    const std::string refusal = failure_by<OutputFailure>([&] { Journal(file, "study"); });
    EXPECT_TRUE(has(refusal, "another process") && has(refusal, std::to_string(::getpid())))
        << refusal;
    journal.add({{1, {1.0}, ""}});
    EXPECT_EQ(read_journal(file).rows.size(), 1u) << "reading is not kept away";
  }
  EXPECT_EQ(Journal(file, "study").finished().size(), 1u);
}

TEST(Journal, AKilledProcessLeavesItsRowsAndNoLock) {
  const RunFolder folder;
  const fs::path file = folder / "journal.db";
  const std::vector<Row> rows = random_rows(0, 40, 1);
  const pid_t child = ::fork();
  if (child == 0) {
    Journal journal(file, "study");
    journal.add(rows);
    ::kill(::getpid(), SIGKILL);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_TRUE(fs::exists(file.string() + "-wal"));
  EXPECT_EQ(read_journal(file).rows, rows) << "read as it lies";
  EXPECT_EQ(Journal(file, "study").finished().size(), 40u);
  EXPECT_EQ(read_journal(file).rows, rows);
  EXPECT_EQ(files_in(folder.path()), 1);
}

TEST(Journal, IsReadWhileAnotherProcessAdds) {
  const RunFolder folder;
  const fs::path file = folder / "journal.db";
  constexpr std::uint64_t batches = 150, batch = 5;
  Journal(file, "study");
  const pid_t child = ::fork();
  if (child == 0) {
    Journal journal(file, "study");
    for (std::uint64_t i = 0; i < batches; ++i)
      journal.add(random_rows(i * batch, (i + 1) * batch, 1));
    journal = Journal(file.string() + "2", "study");  // closes the first
    ::_exit(0);
  }
  std::size_t rows = 0, reads = 0;
  for (bool running = true; running; ++reads) {
    running = ::waitpid(child, nullptr, WNOHANG) == 0;
    const JournalContents found = read_journal(file);
    EXPECT_GE(found.rows.size(), rows);
    EXPECT_EQ(found.rows.size() % batch, 0u) << "a batch is there or not";
    rows = found.rows.size();
  }
  std::cout << reads << " reads beside " << batches << " batches\n";
  EXPECT_EQ(rows, batches * batch);
}

/// Adds batches of 10 until it fails, and says how many were added.
std::uint64_t fill(Journal& journal, std::uint64_t first) {
  for (std::uint64_t i = first; i < first + 100000; i += 10) {
    const std::vector<Row> rows = random_rows(i, i + 10, 1);
    if (!failure_by<OutputFailure>([&] { journal.add(rows); }).empty()) return i;
  }
  return 0;
}

TEST(Journal, AFullDiskLosesNoRowThatWasAdded) {
  const RunFolder folder;
  const SmallDisk disk(folder.folder("disk"), "400k");
  if (!disk.mounted) GTEST_SKIP() << "no right to mount a small disk";
  const fs::path file = disk.path / "journal.db";
  std::uint64_t added = 0;
  {
    Journal journal(file, "study");
    added = fill(journal, 0);
    ASSERT_GT(added, 0u);
    EXPECT_EQ(journal.finished().size(), added);
    EXPECT_EQ(read_journal(file).rows, random_rows_in_tens(0, added)) << "with the disk still full";
    ASSERT_TRUE(disk.resize("4m"));
    journal.add(random_rows(added, added + 10, 1));
  }
  std::cout << added << " rows fitted\n";
  EXPECT_EQ(read_journal(file).rows, random_rows_in_tens(0, added + 10));
}

TEST(Journal, AFullDiskIsToldWhenAJournalBegins) {
  const RunFolder folder;
  const SmallDisk disk(folder.folder("disk"), "400k");
  if (!disk.mounted) GTEST_SKIP() << "no right to mount a small disk";
  std::ofstream(disk.path / "filler") << std::string(1 << 20, 'x');
  const std::string refusal =
      failure_by<OutputFailure>([&] { Journal(disk.path / "journal.db", "study"); });
  EXPECT_TRUE(has(refusal, "journal.db")) << refusal;
  fs::remove(disk.path / "filler");
  EXPECT_TRUE(Journal(disk.path / "journal.db", "study").finished().empty());
}

TEST(Journal, ALimitOfFileSizeLosesNoRowThatWasAdded) {
  const RunFolder folder;
  const fs::path file = folder / "journal.db";
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit limit{100000, 100000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    std::signal(SIGXFSZ, SIG_IGN);
    Journal journal(file, "study");
    const std::uint64_t added = fill(journal, 0);
    ::_exit(added == 0 || journal.finished().size() != added ? 1 : 0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  const std::size_t rows = Journal(file, "study").finished().size();
  EXPECT_GT(rows, 0u);
  EXPECT_EQ(read_journal(file).rows, random_rows_in_tens(0, rows));
}

TEST(Merged, HasEveryCaseOnceInAscendingOrder) {
  const RunFolder folder;
  const std::vector<Row> rows = random_rows(0, 90, 1);
  std::vector<fs::path> files;
  for (std::size_t shard = 0; shard < 3; ++shard) {
    files.push_back(folder / ("journal-" + std::to_string(shard) + ".db"));
    Journal journal(files.back(), "study");
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (i % 3 == shard || i == 7) journal.add({rows[i]});
  }
  EXPECT_EQ(merge_journals(files).rows, rows);
  EXPECT_EQ(merge_journals(files).identity, "study");
  EXPECT_EQ(merge_journals({files[0]}).rows, read_journal(files[0]).rows);
  EXPECT_THROW(merge_journals({}), std::invalid_argument);
}

TEST(Merged, NamesTheFileThatDoesNotFit) {
  const RunFolder folder;
  Journal(folder / "a.db", "study").add({{1, {1.0}, ""}, {2, {2.0}, ""}});
  Journal(folder / "b.db", "study").add({{2, {2.5}, ""}, {3, {3.0}, ""}});
  Journal(folder / "c.db", "other study").add({{5, {}, ""}});
  const auto refusal = [&](const char* name) {
    return failure_by<BadInput>([&] { merge_journals({folder / "a.db", folder / name}); });
  };
  EXPECT_TRUE(has(refusal("b.db"), "b.db") && has(refusal("b.db"), "case 2")) << refusal("b.db");
  EXPECT_TRUE(has(refusal("c.db"), "c.db") && has(refusal("c.db"), "another study"))
      << refusal("c.db");
  EXPECT_TRUE(has(refusal("d.db"), "d.db") && has(refusal("d.db"), "no file")) << refusal("d.db");
}

TEST(Journal, TakesABatchInSomeMilliseconds) {
  const RunFolder folder;
  const std::vector<Row> rows = random_rows(0, 20000, 1);
  const auto start = std::chrono::steady_clock::now();
  const auto spent_ms = [&] {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
        .count();
  };
  {
    Journal journal(folder / "journal.db", "study");
    for (std::size_t i = 0; i < rows.size(); i += 100)
      journal.add({rows.begin() + std::ptrdiff_t(i), rows.begin() + std::ptrdiff_t(i) + 100});
  }
  const double adding = spent_ms();
  EXPECT_EQ(read_journal(folder / "journal.db").rows.size(), rows.size());
  std::cout << adding / 200 << " ms a batch of 100 rows, " << spent_ms() - adding
            << " ms to read 20000\n";
  EXPECT_LT(adding, 60000) << "not seconds a batch, on the slowest disk";
}

}  // namespace
}  // namespace abbe::sim::study
