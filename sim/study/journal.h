#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace abbe::sim::study {

/// One finished case.
struct Row {
  std::uint64_t index = 0;  ///< of the case in its plan; < 2^63
  std::vector<double>
      response_values;  ///< all responses of all configurations; NaN if there is none
  std::string fault;    ///< reason of a missing response; empty if none is missing
  /// Compares bit by bit, so that NaN equals NaN.
  friend bool operator==(const Row& a, const Row& b);
};

/// Finished cases of a study in an SQLite database, one row per case, durable when `add` returns.
/// If the process is killed, the disk is full or the power fails, no added row is lost, and only
/// the last batch must be computed again. A lock file beside the journal excludes other processes;
/// it is released when its process ends, in whatever way. Movable.
class Journal {
 public:
  /// Opens or creates the journal.
  /// @param identity  of study, scene and program. A journal that has cases and another identity is
  /// an input error
  /// @throws BadInput if the file belongs to another study, is damaged (every row has a checksum)
  /// or is not a journal; then it is not changed. OutputFailure if it cannot be written, or if
  /// another process uses it
  Journal(const std::filesystem::path& file, const std::string& identity);
  Journal(Journal&&) noexcept;
  Journal& operator=(Journal&&) noexcept;
  ~Journal();

  /// Adds finished cases in one transaction. Cases that the journal already has are not changed.
  /// @throws OutputFailure, for example on a full disk; then none of the rows is added
  void add(const std::vector<Row>& rows);

  /// Returns the numbers of the finished cases, ascending.
  std::vector<std::uint64_t> finished() const;

 private:
  struct Connection;
  std::unique_ptr<Connection> connection_;
};

/// Contents of a journal.
struct JournalContents {
  std::string identity;
  std::vector<Row> rows;  ///< in ascending order
};
/// Reads a journal, also while another process of this computer adds rows. In a read-only folder a
/// journal can be read if it was closed, but not if its process was killed.
/// @throws BadInput if the file is missing, damaged or not a journal
JournalContents read_journal(const std::filesystem::path& file);

/// Returns the rows of several journals of one study in ascending order, each case once.
/// @param files  at least one
/// @throws BadInput that names the file if one belongs to another study, or if two differ in a case
JournalContents merge_journals(const std::vector<std::filesystem::path>& files);

}  // namespace abbe::sim::study
