#pragma once

#include <memory>
#include <string>

namespace abbe::render {

/// An OpenGL context without display, X server or window, current on this thread while it lives: an
/// EGL surfaceless display and a pbuffer of one pixel. VTK draws into buffers of its own.
class HeadlessContext {
 public:
  /// @throws std::runtime_error naming the step that the graphics libraries refused
  HeadlessContext();
  ~HeadlessContext();
  HeadlessContext(const HeadlessContext&) = delete;
  HeadlessContext& operator=(const HeadlessContext&) = delete;

 private:
  struct Handles;
  std::unique_ptr<Handles> handles_;
};

// The letters of pictures. Those that VTK brings lack Greek and Chinese, and their square brackets
// are round; so Debian's are taken where they are installed.

/// The file of the font that has all of a text; empty where that is not installed and VTK's own
/// stands in.
std::string font_file(const std::string& text, bool bold);

/// The Debian package without which a text is not drawn as it should be; empty if nothing is
/// missing.
std::string missing_font_package(const std::string& text);

}  // namespace abbe::render
