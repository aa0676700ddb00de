#include "sim/dialects/linuxcnc_packages.h"

#include <cstdlib>
#include <system_error>

#include "kinematics/bad_input.h"
#include "sim/files/program_file.h"

namespace abbe::sim::dialects {
namespace {

using std::filesystem::path;

bool is_file(const path& file) {
  std::error_code failure;
  return std::filesystem::is_regular_file(file, failure);
}

}  // namespace

std::optional<path> linuxcnc_packages() {
  const auto has = [](const path& folder) { return is_file(folder / "usr/bin/rs274"); };
  if (const char* named = std::getenv("ABBE_LINUXCNC"); named != nullptr && *named != '\0') {
    const path folder = std::filesystem::absolute(named);
    if (has(folder)) return folder;
    return std::nullopt;
  }
  // build/release/abbe and the tests in build/release/tests
  const path program = program_folder();
  for (const path& folder : {program.parent_path(), program.parent_path().parent_path()})
    if (!folder.empty() && has(folder / "linuxcnc")) return folder / "linuxcnc";
  if (has("/")) return path("/");
  return std::nullopt;
}

path all_digits_library() {
  const path name = ABBE_ALL_DIGITS_NAME;
  const path program = program_folder();
  for (const path& folder : {program, program.parent_path(), program / ABBE_MODULES_FROM_PROGRAM,
                             path(ABBE_MODULES_INSTALLED)})
    if (is_file(folder / name)) return std::filesystem::canonical(folder / name);
  throw BadInput(name.string(), 0, 0,
                 "abbe's library for LinuxCNC's digits beside the program or in " +
                     std::string(ABBE_MODULES_INSTALLED),
                 "none");
}

}  // namespace abbe::sim::dialects
