#include "sim/files/program_file.h"

#include <fmt/format.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace abbe::sim {

namespace {

std::filesystem::path& named() {
  static std::filesystem::path file;
  return file;
}

}  // namespace

/// /proc/self/exe leads to the running executable even after its file was replaced.
std::filesystem::path program_file() { return named().empty() ? "/proc/self/exe" : named(); }

std::filesystem::path program_folder() {
  if (!named().empty()) return named().parent_path();
  std::error_code failure;
  return std::filesystem::read_symlink("/proc/self/exe", failure).parent_path();
}

void name_program_file(const std::filesystem::path& file) { named() = file; }

std::string version() { return ABBE_VERSION; }

nlohmann::ordered_json versions() {
  // Compiler and instruction set change the order and fusion of floating-point operations.
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
