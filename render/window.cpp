#include "render/window.h"

#include <array>
#include <stdexcept>
#include <string>

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <fmt/format.h>

namespace abbe::render {

struct HeadlessContext::Handles {
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLSurface surface = EGL_NO_SURFACE;
  EGLContext context = EGL_NO_CONTEXT;

  Handles() = default;
  Handles(const Handles&) = delete;
  Handles& operator=(const Handles&) = delete;
  ~Handles() {
    if (display == EGL_NO_DISPLAY) return;
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context != EGL_NO_CONTEXT) eglDestroyContext(display, context);
    if (surface != EGL_NO_SURFACE) eglDestroySurface(display, surface);
    // EGL frees its state of a thread when the thread ends; a thread of a pool ends after EGL is
    // gone
    eglReleaseThread();
    // the display is shared by the process and stays initialised: GLEW keeps pointers into its
    // driver
  }
};

namespace {

void require_step(bool done, const char* step) {
  if (!done) {
    throw std::runtime_error(fmt::format("no picture can be drawn: {} failed (EGL error 0x{:x})",
                                         step, static_cast<unsigned>(eglGetError())));
  }
}

}  // namespace

HeadlessContext::HeadlessContext() : handles_(std::make_unique<Handles>()) {
  Handles& h = *handles_;
  h.display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
  require_step(h.display != EGL_NO_DISPLAY, "the EGL surfaceless display");
  require_step(eglInitialize(h.display, nullptr, nullptr) == EGL_TRUE, "eglInitialize");
  require_step(eglBindAPI(EGL_OPENGL_API) == EGL_TRUE, "binding desktop OpenGL");

  constexpr std::array<EGLint, 11> wanted{EGL_SURFACE_TYPE,
                                          EGL_PBUFFER_BIT,
                                          EGL_RENDERABLE_TYPE,
                                          EGL_OPENGL_BIT,
                                          EGL_RED_SIZE,
                                          8,
                                          EGL_GREEN_SIZE,
                                          8,
                                          EGL_BLUE_SIZE,
                                          8,
                                          EGL_NONE};
  EGLConfig config = nullptr;
  EGLint found = 0;
  require_step(
      eglChooseConfig(h.display, wanted.data(), &config, 1, &found) == EGL_TRUE && found == 1,
      "eglChooseConfig");

  constexpr std::array<EGLint, 5> one_pixel{EGL_WIDTH, 1, EGL_HEIGHT, 1, EGL_NONE};
  h.surface = eglCreatePbufferSurface(h.display, config, one_pixel.data());
  require_step(h.surface != EGL_NO_SURFACE, "eglCreatePbufferSurface");

  constexpr std::array<EGLint, 7> version{EGL_CONTEXT_MAJOR_VERSION,
                                          3,
                                          EGL_CONTEXT_MINOR_VERSION,
                                          2,
                                          EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                          EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                          EGL_NONE};
  h.context = eglCreateContext(h.display, config, EGL_NO_CONTEXT, version.data());
  require_step(h.context != EGL_NO_CONTEXT, "an OpenGL 3.2 context");
  require_step(eglMakeCurrent(h.display, h.surface, h.surface, h.context) == EGL_TRUE,
               "eglMakeCurrent");
}

HeadlessContext::~HeadlessContext() = default;

}  // namespace abbe::render
