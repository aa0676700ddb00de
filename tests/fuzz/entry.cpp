#include <cstddef>
#include <cstdint>

#include "kinematics/bad_input.h"
#include "tests/fuzz/reader.h"

/// What libFuzzer calls: an exception other than BadInput ends the run, as a crash does.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    abbe::fuzz::read({reinterpret_cast<const char*>(data), size});
  } catch (const abbe::BadInput&) {
  }
  return 0;
}
