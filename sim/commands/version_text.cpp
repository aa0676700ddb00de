#include "sim/commands/version_text.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "sim/files/versions.h"
#include "sim/scene/library.h"

namespace abbe::sim {
namespace {

std::string library_text() {
  try {
    return library_folder().string();
  } catch (const BadInput& fault) {
    return fault.what();
  }
}

}  // namespace

std::string version_text(const std::string& commit) {
  const std::string preset = ABBE_PRESET;
  return fmt::format(
      "abbe {}\ncommit        {}\ncompiler      {}\npreset        {}\nflags         {}\n"
      "instructions  {}\nlibraries     {}\nscenes        {}",
      version(), commit, ABBE_COMPILER, preset.empty() ? "none" : preset, ABBE_FLAGS,
      versions()["instructions"].get<std::string>(), ABBE_LIBRARIES, library_text());
}

}  // namespace abbe::sim
