#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <string>

#include "sim/commands/command_line.h"
#include "sim/compensation/plug_in.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/study/farm.h"

extern const char* const abbe_commit;  // commit.cmake writes it

namespace {

/// The command for the marks of results.
std::string typed_command(int argc, char** argv) {
  std::string text = "abbe";
  for (int i = 1; i < argc; ++i) text += " " + std::string(argv[i]);
  return text;
}

/// Maps are arrays of tens of megabytes that come and go: what one leaves is used by the next,
/// where handing it back to the system costs a twentieth of a run in pages that are cleared again.
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
  enable_write_errors();
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
