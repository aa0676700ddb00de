#include "render/vtk_environment.h"

#include <array>
#include <cstdint>
#include <filesystem>
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

namespace {

/// Files of a font in Debian, and its package.
struct Font {
  const char* regular;
  const char* bold;
  const char* package;
};

constexpr Font western{"/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
                       "/usr/share/fonts/truetype/dejavu/DejaVuSans-Bold.ttf", "fonts-dejavu-core"};
// This font has no bold face.
constexpr Font eastern{"/usr/share/fonts/truetype/wqy/wqy-microhei.ttc",
                       "/usr/share/fonts/truetype/wqy/wqy-microhei.ttc", "fonts-wqy-microhei"};

/// Returns true if a text contains Chinese, Japanese or Korean characters (U+2E80 to U+D7FF and the
/// wide forms). The first two bytes in UTF-8 suffice to recognise them.
bool is_eastern(const std::string& text) {
  for (std::size_t i = 0; i + 1 < text.size(); ++i) {
    const auto first = static_cast<std::uint8_t>(text[i]);
    const auto second = static_cast<std::uint8_t>(text[i + 1]);
    if ((first == 0xE2 && second >= 0xBA) || (first >= 0xE3 && first <= 0xED) ||
        (first == 0xEF && second >= 0xA4) || (first == 0xF0 && second >= 0xA0))
      return true;
  }
  return false;
}

const Font& font_for(const std::string& text) { return is_eastern(text) ? eastern : western; }

bool is_installed(const char* file) {
  std::error_code error_code;
  return std::filesystem::is_regular_file(file, error_code);
}

}  // namespace

std::string font_file(const std::string& text, bool bold) {
  const Font& font = font_for(text);
  const char* file = bold ? font.bold : font.regular;
  return is_installed(file) ? file : "";
}

std::string missing_font_package(const std::string& text) {
  const Font& font = font_for(text);
  return is_installed(font.regular) && is_installed(font.bold) ? "" : font.package;
}

}  // namespace abbe::render
