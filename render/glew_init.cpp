#include <dlfcn.h>

#include <cstdio>
#include <cstdlib>

namespace {

constexpr unsigned no_glx_display = 4;  // GLEW_ERROR_NO_GLX_DISPLAY

}  // namespace

// GLEW ends with "no GLX display" on a context from EGL, although it has loaded every function by
// then; VTK would treat that as a failure. This function is in the executable, which precedes the
// library in the symbol order, and ignores that one code.
extern "C" unsigned glewInit() {
  using Init = unsigned (*)();
  static const auto library_init = reinterpret_cast<Init>(::dlsym(RTLD_NEXT, "glewInit"));
  if (library_init == nullptr) {
    std::fputs("glewInit is in no library of this program\n", stderr);
    std::abort();
  }
  const unsigned code = library_init();
  return code == no_glx_display ? 0 : code;
}
