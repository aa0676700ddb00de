#pragma once

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <csignal>
#include "tests/safety/program_run.h"
#include "tests/test.h"

/// Folders and processes of the tests of journal, farm and Slurm.
namespace abbe::sim::study {

/// A folder of its own for one test, gone afterwards.
struct RunFolder : safety::Folder {
  /// A folder in it.
  fs::path folder(const std::string& name) const {
    fs::create_directories(*this / name);
    return *this / name;
  }
};

inline std::string text_of(const fs::path& file) { return safety::bytes(file); }

inline bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

inline void wait_ms(double ms) {
  std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(ms));
}

/// Waits until something holds. @return whether it did within the time
template <typename Holds>
bool wait_until(const Holds& holds, double seconds) {
  for (double waited = 0; waited < seconds; waited += 0.005) {
    if (holds()) return true;
    wait_ms(5);
  }
  return holds();
}

/// A process that ends with this one, at the latest when it is forgotten.
class Process {
 public:
  Process(std::vector<std::string> words, const fs::path& log) {
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    id_ = ::fork();
    if (id_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int descriptor = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0666);
    ::dup2(::open("/dev/null", O_RDONLY), STDIN_FILENO);
    ::dup2(descriptor, STDOUT_FILENO);
    ::dup2(descriptor, STDERR_FILENO);
    ::execvp(arguments[0], arguments.data());
    ::_exit(127);
  }
  Process(Process&& other) noexcept
      : id_(std::exchange(other.id_, -1)), code_(std::exchange(other.code_, std::nullopt)) {}
  Process& operator=(Process&&) = delete;
  ~Process() {
    if (id_ <= 0 || code_) return;
    signal(SIGKILL);
    ::waitpid(id_, nullptr, 0);
  }

  pid_t id() const { return id_; }
  void signal(int number) const { ::kill(id_, number); }
  bool has_ended() { return code_ || look(WNOHANG); }
  /// Exit code, or minus the signal that ended it; it is killed after some seconds.
  int exit_code(double seconds = 60) {
    if (!wait_until([&] { return has_ended(); }, seconds)) signal(SIGKILL);
    if (!code_) look(0);
    return *code_;
  }

 private:
  bool look(int options) {
    int status = 0;
    if (::waitpid(id_, &status, options) != id_) return false;
    code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
    return true;
  }

  pid_t id_ = -1;
  std::optional<int> code_;
};

inline int run(std::vector<std::string> words, const fs::path& log) {
  return Process(std::move(words), log).exit_code();
}

inline bool is_installed(const std::string& program) {
  return std::system(("PATH=$PATH:/usr/sbin command -v " + program + " >/dev/null 2>&1").c_str()) ==
         0;
}

/// A study of the stand-in program; the same cases whatever the pause.
inline std::string farm_study(int pause_us = 0, const std::string& more = "") {
  return "cases 200\nbatch 3\npause_us " + std::to_string(pause_us) + "\n" + more;
}

/// The stand-in program's table as one process on one thread makes it undisturbed.
inline const std::string& undisturbed_table() {
  static const std::string table = [] {
    const RunFolder folder;
    const auto study = folder.write("study.txt", farm_study());
    run({ABBE_FARM_PROGRAM, "study", study, "--out", folder.path(), "--threads", "1"},
        folder / "log");
    return text_of(folder / "table.txt");
  }();
  return table;
}

/// The stand-in program on a study.
inline std::vector<std::string> command(const fs::path& study, const fs::path& out) {
  return {ABBE_FARM_PROGRAM, "study", study.string(), "--out", out.string()};
}

/// The same words for several ranks.
inline std::vector<std::string> among(int ranks, std::vector<std::string> words) {
  std::vector<std::string> all{
      "mpirun", "--allow-run-as-root", "--oversubscribe", "--bind-to", "none",
      "-n",     std::to_string(ranks)};
  all.insert(all.end(), words.begin(), words.end());
  return all;
}

/// Why no ranks can be had here; empty if they can.
inline std::string no_ranks() {
  if (!is_installed("mpirun")) return "mpirun is not installed";
  const RunFolder folder;
  const fs::path study = folder.write("study.txt", "cases 1\n");
  run(among(2, command(study, folder.path())), folder / "log");
  const bool without = text_of(folder / "log").find("built without MPI") != std::string::npos;
  return without ? "built without MPI" : "";
}

}  // namespace abbe::sim::study
