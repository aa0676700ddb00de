#pragma once

#include <string>

namespace abbe::render {

/// A picture as it is on a screen.
struct Pixels {
  int width = 0;
  int height = 0;
  std::string rgb;  ///< (3 * width * height) the upper row first
};

/// What the file of a picture is made for.
enum class PngFor {
  Speed,
  Size,  ///< colours in steps of 8, white kept, 256 at most: of more, the most frequent and those
         ///< that are like no other; two thirds of the bytes go
};

/// A PNG file of it: no graphics library takes part, so any thread may encode while
/// another one draws. The same pixels give the same bytes.
/// @throws std::invalid_argument if the sizes do not fit
std::string png_file(const Pixels& pixels, PngFor made_for = PngFor::Speed);

}  // namespace abbe::render
