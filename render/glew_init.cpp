#include <dlfcn.h>

#include <cstdio>
#include <cstdlib>

namespace {

constexpr unsigned no_glx_display = 4;  // GLEW_ERROR_NO_GLX_DISPLAY

}  // namespace

// With a context from EGL, glewInit() of GLEW loads every function but then returns "no GLX
// display", which VTK takes for a failure. This function replaces it, because the symbols of the
// executable precede those of libraries, and turns this error code into success.
extern "C" unsigned glewInit() {
  using Init = unsigned (*)();
  static const auto library_init = reinterpret_cast<Init>(::dlsym(RTLD_NEXT, "glewInit"));
  if (library_init == nullptr) {
    std::fputs("no library of this program provides glewInit\n", stderr);
    std::abort();
  }
  const unsigned code = library_init();
  return code == no_glx_display ? 0 : code;
}
