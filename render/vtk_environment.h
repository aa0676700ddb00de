#pragma once

#include <memory>
#include <string>

namespace abbe::render {

/// An OpenGL context without display, X server or window. It is current on this thread during its
/// lifetime. It uses an EGL surfaceless display and a pbuffer of one pixel; VTK draws into its own
/// buffers.
class HeadlessContext {
 public:
  /// @throws std::runtime_error with the step of EGL that failed
  HeadlessContext();
  ~HeadlessContext();
  HeadlessContext(const HeadlessContext&) = delete;
  HeadlessContext& operator=(const HeadlessContext&) = delete;

 private:
  struct Handles;
  std::unique_ptr<Handles> handles_;
};

// Fonts of pictures. The built-in fonts of VTK have no Greek and Chinese letters, and their square
// brackets are round, so fonts of Debian are used if they are installed.

/// Returns the file of a font with all characters of a text. Empty if it is not installed; the
/// built-in font of VTK is used then.
std::string font_file(const std::string& text, bool bold);

/// Returns the Debian package that is missing to draw a text correctly; empty if none is missing.
std::string missing_font_package(const std::string& text);

}  // namespace abbe::render
