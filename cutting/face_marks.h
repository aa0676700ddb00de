#pragma once

#include <array>
#include <compare>
#include <optional>
#include <string>
#include <vector>

namespace abbe::cutting {

/// Red, green and blue, 0 .. 255.
using Rgb = std::array<int, 3>;

/// A colour as a mesh file has it.
struct FaceColour {
  /// What a channel is written with.
  enum class Digits {
    EightBits,  ///< 0 .. 255
    FiveBits,   ///< 0 .. 31
    Fraction,   ///< 0 .. 1 with any number of digits; here it is rounded to 255ths
  };
  Rgb channels = {0, 0, 0};
  Digits digits = Digits::EightBits;
  auto operator<=>(const FaceColour&) const = default;
};

/// Whether a colour may have been written so. Eight bits are equal; five bits are those to which
/// the eight are cut (v / 8) or rounded (31 v / 255), since writers do either; a fraction is within
/// 1 / 255, since two digits are off by as much.
bool may_be(const FaceColour& written, const Rgb& colour);

/// The colour on a scale of 0 .. 255: five bits are spread over it.
Rgb spread(const FaceColour& written);

/// "#rrggbb"
std::string hex_text(const Rgb& colour);
/// The colour that "#rrggbb" means, in small or large letters; none if it is another text.
std::optional<Rgb> colour_of(const std::string& hex_text);

/// What a mesh file says of a face.
struct FaceMark {
  std::vector<int> names;  ///< sets of names, of `FaceMarks`
  std::optional<FaceColour> colour;
  auto operator<=>(const FaceMark&) const = default;
};

/// What a mesh file says of its faces besides where they are.
struct FaceMarks {
  std::vector<std::vector<std::string>> names;  ///< each set once
  std::vector<FaceMark> marks;                  ///< each once
  std::vector<int> of_face;  ///< (triangles) the mark of each; empty if nobody asked
};

/// Which marks are asked for.
struct WantedMarks {
  bool groups = false;
  bool colours = false;
  bool any() const { return groups || colours; }
};

}  // namespace abbe::cutting
