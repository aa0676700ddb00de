#pragma once

#include <string>

#include "render/canvas.h"

class vtkTextProperty;

namespace abbe::render {

inline constexpr int dots_per_inch = 72;  // a point of the font is then a pixel

/// Sets font, size and colour for a text.
void apply_style(const TextStyle& style, const std::string& text, vtkTextProperty& property);

}  // namespace abbe::render
