#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include <sys/types.h>

#include "sim/dialects/read_options.h"

namespace abbe::sim::dialects {

/// A folder of this run alone in the temporary folder, removed with its name. Linux.
class PrivateFolder {
 public:
  /// @throws BadInput where none can be made
  PrivateFolder();
  ~PrivateFolder();
  PrivateFolder(const PrivateFolder&) = delete;
  PrivateFolder& operator=(const PrivateFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// How the interpreter ended.
struct InterpreterEnd {
  enum class Why { Exit, Signal, Time, Bytes, Stopped } why = Why::Exit;
  int number = 0;    ///< exit code, or the signal
  std::string said;  ///< on stderr, at most 64 kB of it
};

/// Runs rs274 in `folder`, which is its home and its working directory: `machine.ini`, `tool.tbl`,
/// `numbers.var` and `program` (a path in the folder) are there. It sees nothing of our environment
/// and no open file of ours, and cannot write more than 16 MB into files or take more than 4 GB of
/// memory. Its canonical commands come line by line as it writes them.
/// @param take  is given each line, without its end; false ends the run. What it throws passes
///              through; the process is ended before
/// @throws BadInput if it cannot be started
InterpreterEnd run_rs274(const std::filesystem::path& packages, const std::filesystem::path& folder,
                         const std::string& program, const InterpreterLimits& limits,
                         const std::function<bool(std::string_view line)>& take);

}  // namespace abbe::sim::dialects
