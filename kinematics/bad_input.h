#pragma once

#include <stdexcept>
#include <string>

namespace abbe {

/// Refusal of something that came from outside: where it stands, what was expected, what was seen.
/// `what()` reads "file:line:column: expected ..., seen ...". Line and column count from 1; 0 is
/// "not known" and is left out of the text. It is one line, with what came from outside escaped; the
/// members are as they came.
struct BadInput : std::runtime_error {
  BadInput(std::string file, int line, int column, std::string expected, std::string seen);

  std::string file;
  int line;
  int column;
  std::string expected;
  std::string seen;
};

}  // namespace abbe
