#pragma once

#include <string>

namespace abbe::sim {

/// What `abbe --version` prints: version, commit, compiler with preset and flags, libraries, and
/// where the scenes are.
/// @param commit  from which the program was built
std::string version_text(const std::string& commit);

}  // namespace abbe::sim
