#pragma once

#include "sim/scene/toml.h"
#include "tests/test.h"

/// Sections that are read from a text, and written as one.
namespace abbe::sim {

/// What a reader makes of a text in which it finds no fault.
/// @param read  (const Node&, Faults&)
template <typename Read>
auto read_section(const std::string& text, const Read& read) {
  InputErrors input_errors;
  auto value = read(parse_toml(text, "s.toml"), input_errors);
  for (const BadInput& fault : input_errors.list()) ADD_FAILURE() << fault.what();
  return value;
}

/// The text that a section of a text is written as, which reads and is written as the same.
/// @param write  of what was read, gives a table
template <typename Read, typename Write>
std::string written_again(const std::string& text, const Read& read, const Write& write) {
  const std::string once = to_toml(Node{{}, write(read_section(text, read))});
  EXPECT_EQ(to_toml(Node{{}, write(read_section(once, read))}), once);
  return once;
}

}  // namespace abbe::sim
