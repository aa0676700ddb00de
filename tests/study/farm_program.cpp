/// Stands in for `abbe study` in the tests of journal, farm and Slurm: cases that cost nothing but
/// have every kind of answer, and a pause that makes them long enough to be killed in.
///   farm_program study FILE --out FOLDER [--threads N] [--shard I/N] [--merge]

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include <fcntl.h>
#include <unistd.h>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include "kinematics/bad_input.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/study/farm.h"

namespace {

using namespace abbe;
using namespace abbe::sim::study;
namespace fs = std::filesystem;

struct Study {
  std::uint64_t cases = 200;
  std::uint64_t batch = 3;
  int pause_us = 0;           ///< of each case
  std::int64_t fail_at = -1;  ///< case that throws
  std::string failure;        ///< what it throws
};

struct Line {
  fs::path study;
  fs::path out;
  int threads = 0;
  std::optional<Shard> shard;
  bool merge = false;
};

Study read(const fs::path& file) {
  std::ifstream stream(file);
  std::map<std::string, std::string> values{
      {"cases", "200"}, {"batch", "3"}, {"pause_us", "0"}, {"fail_at", "-1"}, {"failure", ""}};
  for (std::string key, value; stream >> key >> value;) values.at(key) = value;
  return {std::stoull(values["cases"]), std::stoull(values["batch"]), std::stoi(values["pause_us"]),
          std::stoll(values["fail_at"]), values["failure"]};
}

Line parsed(int argc, char** argv) {
  Line line;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto value = [&] { return std::string(argv[++i]); };
    if (word == "study") line.study = value();
    if (word == "--out") line.out = value();
    if (word == "--threads") line.threads = std::stoi(value());
    if (word == "--merge") line.merge = true;
    if (word != "--shard") continue;
    line.shard.emplace();
    if (std::sscanf(argv[++i], "%d/%d", &line.shard->index, &line.shard->count) != 2)
      throw std::invalid_argument("no shard");
  }
  return line;
}

/// Appends a line that survives the death of this process.
void note(const fs::path& file, const std::string& text) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0666);
  if (::write(descriptor, text.data(), text.size()) != ssize_t(text.size()))
    throw std::runtime_error("no note");
  ::close(descriptor);
}

[[noreturn]] void fail(const std::string& failure) {
  if (failure == "BadInput") throw BadInput("scene.toml", 3, 7, "a farm", "a garden");
  if (failure == "OutputFailure") throw sim::OutputFailure("no more room");
  if (failure == "Interrupted") throw sim::Interrupted();
  throw std::runtime_error("a case that cannot be");
}

/// Parallel within the case, so that a thread that waits here would like to have other work.
std::vector<double> scaled_responses(std::uint64_t index) {
  std::vector<double> parts(64);
  tbb::parallel_for(std::size_t(0), parts.size(), [&](std::size_t k) {
    parts[k] = std::sin(1e-3 * double(index * 64 + k)) / double(k + 1);
  });
  const double sum = std::accumulate(parts.begin(), parts.end(), 0.0);
  const double odd[] = {std::bit_cast<double>(0x7ff8'0000'dead'beefu + index), -0.0,
                        std::numeric_limits<double>::denorm_min(),
                        -std::numeric_limits<double>::infinity()};
  return {sum, std::exp(sum), odd[index % 4], 1.0 / (1.0 + double(index))};
}

Row row_of(std::uint64_t index, const Study& study) {
  if (std::int64_t(index) == study.fail_at) fail(study.failure);
  std::this_thread::sleep_for(std::chrono::microseconds(study.pause_us));
  if (index % 11 == 3) return {index, {}, fmt::format("case {}: µm out of reach", index)};
  return {index, scaled_responses(index), ""};
}

/// @throws std::logic_error if this thread is in the midst of another batch
std::vector<Row> rows_of(const Batch& batch, const Study& study) {
  static thread_local bool busy = false;
  if (busy) throw std::logic_error("a batch begun within another");
  busy = true;
  std::vector<Row> rows;
  try {
    for (std::uint64_t i = batch.first; i < batch.last; ++i) rows.push_back(row_of(i, study));
  } catch (...) {
    busy = false;
    throw;
  }
  busy = false;
  return rows;
}

void write_table(const fs::path& out, const std::vector<Row>& rows) {
  std::string text;
  for (const Row& row : rows) {
    text += fmt::format("{}", row.index);
    for (const double answer : row.response_values)
      text += fmt::format(" {:016x}", std::bit_cast<std::uint64_t>(answer));
    text += fmt::format(" \"{}\"\n", row.fault);
  }
  // beside journals and notes of its own
  write_file(sim::ResultFolder(out, {{.force = true}}) / "table.txt", text);
}

fs::path journal_of(const Line& line) {
  if (!line.shard) return line.out / "journal.db";
  return line.out / fmt::format("journal-{}-of-{}.db", line.shard->index, line.shard->count);
}

void merge(const Line& line) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(line.out))
    if (entry.path().filename().string().starts_with("journal-") &&
        entry.path().extension() == ".db")
      files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  write_table(line.out, merge_journals(files).rows);
}

std::vector<Batch> batches_of(const Study& study) {
  std::vector<Batch> batches;
  for (std::uint64_t i = 0; i < study.cases; i += study.batch)
    batches.push_back({i, std::min(study.cases, i + study.batch)});
  return batches;
}

void run(const Line& line, const Ranks& here) {
  const Study study = read(line.study);
  note(line.out / fmt::format("rank-{}.pid", here.rank), fmt::format("{}\n", ::getpid()));
  std::optional<Journal> journal;
  std::vector<std::uint64_t> finished;
  if (here.rank == 0) {
    journal.emplace(journal_of(line), fmt::format("{} cases by {}", study.cases, study.batch));
    finished = journal->finished();
  }
  finished = broadcast_from_rank_0(here, finished);
  const std::vector<Batch> batches =
      unfinished(shard_batches(batches_of(study), line.shard.value_or(Shard{})), finished);
  const auto take = [&](const Batch& batch, std::vector<Row> rows) {
    journal->add(rows);
    note(line.out / "added.log", fmt::format("{} {}\n", batch.first, batch.last));
  };
  farm(
      batches, here, [&](const Batch& batch) { return rows_of(batch, study); }, take);
  if (here.rank != 0) return;
  journal.reset();
  if (!line.shard) write_table(line.out, read_journal(journal_of(line)).rows);
}

int exit_code_of(int argc, char** argv) {
  Ranks here;
  try {
    here = ranks(argc, argv);
    const Line line = parsed(argc, argv);
    std::optional<tbb::global_control> limit;
    if (line.threads > 0)
      limit.emplace(tbb::global_control::max_allowed_parallelism, std::size_t(line.threads));
    if (line.merge)
      merge(line);
    else
      run(line, here);
    return 0;
  } catch (const sim::Interrupted&) {
    return 130;
  } catch (const BadInput& fault) {
    if (here.rank == 0) fmt::print(stderr, "{}\n", fault.what());
    return 3;
  } catch (const sim::OutputFailure& failure) {
    if (here.rank == 0) fmt::print(stderr, "{}\n", failure.what());
    return 5;
  } catch (const std::exception& failure) {
    if (here.rank == 0) fmt::print(stderr, "{}\n", failure.what());
    return 4;
  }
}

}  // namespace

int main(int argc, char** argv) {
  sim::watch_interrupts();
  const int code = exit_code_of(argc, argv);
  std::fflush(stderr);
  finalize_ranks(code);
  return code;
}
