#pragma once

#include <filesystem>

namespace abbe::sim::study {

/// A file beside a journal that one process at a time can hold, void as soon as its process ends.
/// SQLite's own locks serve reading and writing; they would not keep a second study from doing the
/// same cases.
class JournalLock {
 public:
  /// @throws OutputFailure if another process holds it, naming that process, or the file cannot be
  ///         one of abbe's
  explicit JournalLock(const std::filesystem::path& journal);
  ~JournalLock();
  JournalLock(const JournalLock&) = delete;
  JournalLock& operator=(const JournalLock&) = delete;

 private:
  void try_once();

  std::filesystem::path journal_, file_;
  int descriptor_ = -1;
};

}  // namespace abbe::sim::study
