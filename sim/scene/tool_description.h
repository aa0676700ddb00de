#pragma once

#include <optional>
#include <string>
#include <variant>

#include "cutting/tool.h"

namespace abbe::sim {

/// A tool, what the control believes of it, and what it really is.
struct ToolDescription {
  std::string name;
  std::optional<int> number;  ///< T of a program that calls it
  std::variant<cutting::Cutter, cutting::Nose> nominal;
  std::variant<cutting::Cutter, cutting::Nose> actual;  ///< same alternative as nominal
  double length = 0.0;                                  ///< mm from the nose s to the tip t
  double actual_length = 0.0;                           ///< mm
  double centring_offset = 0.0;  ///< mm, turning: the tip stands this much along t's x really
  double centring_height = 0.0;  ///< mm, turning: and this much along t's y
};

}  // namespace abbe::sim
