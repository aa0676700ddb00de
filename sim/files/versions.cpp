#include "sim/files/versions.h"

#include <fmt/format.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace abbe::sim {

std::string version() { return ABBE_VERSION; }

nlohmann::ordered_json versions() {
  return {{"abbe", version()},
          {"eigen",
           fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
          {"compiler", __VERSION__},
          {"instructions",
#if defined(__AVX512F__)
           "avx512"
#elif defined(__AVX2__)
           "x86-64-v3"
#else
           "x86-64"
#endif
          }};
}

}  // namespace abbe::sim
