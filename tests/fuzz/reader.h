#pragma once

#include <string_view>

namespace abbe::fuzz {

/// Reads a text as one of abbe's readers does; each program of this folder has its own. It may
/// throw BadInput, as for any broken file, and nothing else.
void read(std::string_view text);

}  // namespace abbe::fuzz
