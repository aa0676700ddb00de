#pragma once

#include <memory>

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

}  // namespace abbe::render
