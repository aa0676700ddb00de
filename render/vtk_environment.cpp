#include "render/vtk_environment.h"

#include <array>
#include <stdexcept>

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
    // The state of this thread is freed here, because threads of a pool end after EGL is unloaded.
    eglReleaseThread();
    // The display remains initialised, because GLEW keeps pointers into its driver.
  }
};

namespace {

void require_step(bool succeeded, const char* step) {
  if (!succeeded) {
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

  constexpr std::array<EGLint, 11> config_attributes{EGL_SURFACE_TYPE,
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
  EGLint config_count = 0;
  require_step(
      eglChooseConfig(h.display, config_attributes.data(), &config, 1, &config_count) == EGL_TRUE &&
          config_count == 1,
      "eglChooseConfig");

  // A context needs some surface to be current, although VTK draws into its own buffers.
  constexpr std::array<EGLint, 5> pbuffer_attributes{EGL_WIDTH, 1, EGL_HEIGHT, 1, EGL_NONE};
  h.surface = eglCreatePbufferSurface(h.display, config, pbuffer_attributes.data());
  require_step(h.surface != EGL_NO_SURFACE, "eglCreatePbufferSurface");

  // VTK needs at least OpenGL 3.2 core.
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
