#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace abbe::sim::program {

/// What a comment of a CAM system says of a cutter.
struct ToolWords {
  enum class End { Unsaid, Flat, Ball };
  std::optional<int> number;  ///< T of the tool
  double diameter = 0.0;      ///< > 0, in the unit of the words
  std::optional<double> corner_radius;
  End end = End::Unsaid;
  std::optional<double> unit_mm;  ///< mm per unit, where the words name one; else the program's
};

/// A comment of a program that gives the diameter of a cutter.
struct ToolComment {
  int line = 0;
  std::string text;
  ToolWords words;         ///< in mm
  std::size_t before = 0;  ///< block that it stands before; the number of blocks at the end
};

/// Reads "T1 D=10. CR=0. - FLAT END MILL", "TOOL - 1 DIA. OFF. - 1 LEN. - 1 DIA. - 10.",
/// "T1 | 10. FLAT ENDMILL | H1", "TOOL DIAMETER: 10", "D10R1", "T2 D6", "5mm Endmill",
/// "End Mill {6.35 mm}" and what is like them, in letters of either case; lengths may be fractions
/// ("1/2", "1-1/2"). Register numbers (H1 D1, DIA. OFF.) are no diameters. @return none for a
/// comment that gives no diameter
std::optional<ToolWords> tool_words(std::string_view comment);

}  // namespace abbe::sim::program
