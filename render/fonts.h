#pragma once

#include <string>

/// The letters of pictures. Those that VTK brings lack Greek and Chinese, and their square brackets
/// are round; so Debian's are taken where they are installed.
namespace abbe::render {

/// The file of the font that has all of a text; empty where that is not installed and VTK's own
/// stands in.
std::string font_file(const std::string& text, bool bold);

/// The Debian package without which a text is not drawn as it should be; empty if nothing is
/// missing.
std::string missing_font_package(const std::string& text);

}  // namespace abbe::render
