#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <string>

#include "sim/commands/command_line.h"
#include "sim/compensation/plug_in.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/study/farm.h"

extern const char* const abbe_commit;  // defined in a file that commit.cmake writes

namespace {

/// Returns the command line for the manifests of results.
std::string typed_command(int argc, char** argv) {
  std::string text = "abbe";
  for (int i = 1; i < argc; ++i) text += " " + std::string(argv[i]);
  return text;
}

/// Keeps freed memory in the process. Maps are arrays of tens of megabytes that are allocated and
/// freed repeatedly; returning them to the system costs 5 % of a run, because pages are cleared
/// again.
void keep_memory() {
#ifdef __GLIBC__
  constexpr int large = 1 << 30;
  mallopt(M_MMAP_THRESHOLD, large);
  mallopt(M_TRIM_THRESHOLD, large);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  using namespace abbe::sim;
  keep_memory();
  // Before any file is opened, so that none gets the number of a closed standard stream.
  enable_write_errors();
  // A process started as the host of a plug-in does nothing else.
  if (const auto host = compensation::plug_in_host(argc, argv)) return *host;
  watch_interrupts();
  CommonOptions common;
  common.permissions.command = typed_command(argc, argv);
  common.commit = abbe_commit;
  const Exit code = exit_code(
      [&] { return run_command_line(all_commands(common, argc, argv), common, argc, argv); });
  study::finalize_ranks(int(code));
  return int(code);
}
