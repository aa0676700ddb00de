#pragma once

#include <memory>

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

}  // namespace abbe::render
