#pragma once

#include <memory>
#include <string>

namespace abbe::render {

/// An OpenGL context without display, X server or window, current on this thread during its
/// lifetime: an EGL surfaceless display and a pbuffer of one pixel. VTK draws into its own buffers.
class HeadlessContext {
 public:
  /// @throws std::runtime_error naming the step that failed in the graphics libraries
  HeadlessContext();
  ~HeadlessContext();
  HeadlessContext(const HeadlessContext&) = delete;
  HeadlessContext& operator=(const HeadlessContext&) = delete;

 private:
  struct Handles;
  std::unique_ptr<Handles> handles_;
};

// Fonts of pictures. VTK's own fonts lack Greek and Chinese, and their square brackets are round;
// so those of Debian are used if installed.

/// Returns the file of a font with all characters of a text; empty if it is not installed and VTK's
/// own is used.
std::string font_file(const std::string& text, bool bold);

/// Returns the Debian package that a text needs to be drawn correctly; empty if nothing is missing.
std::string missing_font_package(const std::string& text);

}  // namespace abbe::render
