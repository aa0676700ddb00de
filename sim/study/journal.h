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
  std::vector<double> answers;  ///< every response of every arm; NaN where there is none
  std::string fault;            ///< why there is no answer; empty if there is one
  /// Bit for bit, so that a NaN equals itself.
  friend bool operator==(const Row& a, const Row& b);
};

/// What is done of a study: one row a case, in SQLite, durable as soon as `add` returns. A process
/// killed at any instant, a full disk or a power failure loses no row that was added; at most the
/// last batch has to be done again. A lock file beside the journal keeps a second process away; it
/// is void as soon as its process ends, however that ends. Movable.
class Journal {
 public:
  /// Opens the journal, or begins it.
  /// @param identity  of study, scene and program: a journal of another one is refused, unless it
  ///                  has no case yet
  /// @throws BadInput if the file is a journal of another study, damaged (every row has a check
  ///         sum) or no journal; it is left as it was,
  ///         OutputFailure if it cannot be written, or another process works on it
  Journal(const std::filesystem::path& file, const std::string& identity);
  Journal(Journal&&) noexcept;
  Journal& operator=(Journal&&) noexcept;
  ~Journal();

  /// Adds finished cases in one transaction; a case that is there already stays as it is.
  /// @throws OutputFailure (full disk and the like); then none of them was added
  void add(const std::vector<Row>& rows);

  /// Which cases are there: ascending numbers.
  std::vector<std::uint64_t> finished() const;

 private:
  struct Connection;
  std::unique_ptr<Connection> connection_;
};

/// The rows of a journal in ascending order, also while another process of this computer adds to
/// it. One that was closed can be read in a folder that cannot be written, one whose process was
/// killed not.
struct Recorded {
  std::string identity;
  std::vector<Row> rows;
};
/// @throws BadInput if it is not there, damaged or no journal
Recorded recorded(const std::filesystem::path& file);

/// Rows of several journals of one study in ascending order, each case once.
/// @param files  at least one
/// @throws BadInput naming the file if one is of another study, or two disagree about a case
Recorded merged(const std::vector<std::filesystem::path>& files);

}  // namespace abbe::sim::study
