#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace abbe::sim::study {

/// One finished case.
struct Row {
  std::uint64_t index = 0;      ///< of the case in its plan; < 2^63
  std::vector<double> answers;  ///< every response of every configuration; NaN where there is none
  std::string fault;            ///< reason why there is no response; empty if there is one
  /// Compares bit for bit, so that a NaN equals itself.
  friend bool operator==(const Row& a, const Row& b);
};

/// Finished cases of a study: one row a case, in SQLite, durable as soon as `add` returns. A
/// process killed at any instant, a full disk or a power failure loses no row that was added; at
/// most the last batch must be computed again. A lock file beside the journal keeps a second
/// process out; it becomes void as soon as its process ends, however it ends. Movable.
class Journal {
 public:
  /// Opens the journal, or creates it.
  /// @param identity  of study, scene and program: a journal with another identity is an error
  /// unless it has no case yet
  /// @throws BadInput if the file belongs to another study, is damaged (every row has a checksum)
  /// or is not a journal; the file is left as it was. OutputFailure if it cannot be written, or
  /// another process works on it
  Journal(const std::filesystem::path& file, const std::string& identity);
  Journal(Journal&&) noexcept;
  Journal& operator=(Journal&&) noexcept;
  ~Journal();

  /// Adds finished cases in one transaction; a case that is already there stays unchanged.
  /// @throws OutputFailure (full disk and the like); then none of the rows was added
  void add(const std::vector<Row>& rows);

  /// Returns the numbers of the finished cases, ascending.
  std::vector<std::uint64_t> finished() const;

 private:
  struct Connection;
  std::unique_ptr<Connection> connection_;
};

/// Contents of a journal: its rows in ascending order. It can be read while another process of this
/// computer adds to it. A journal that was closed can be read from a read-only folder; one whose
/// process was killed cannot.
struct Recorded {
  std::string identity;
  std::vector<Row> rows;
};
/// Reads a journal.
/// @throws BadInput if the file is missing, damaged or not a journal
Recorded recorded(const std::filesystem::path& file);

/// Returns the rows of several journals of one study in ascending order, each case once.
/// @param files  at least one
/// @throws BadInput naming the file if one belongs to another study, or two disagree about a case
Recorded merged(const std::vector<std::filesystem::path>& files);

}  // namespace abbe::sim::study
