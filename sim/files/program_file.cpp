#include "sim/files/program_file.h"

#include <fmt/format.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace abbe::sim {

namespace {

std::filesystem::path& configured_program_file() {
  static std::filesystem::path file;
  return file;
}

}  // namespace

// /proc/self/exe leads to the running executable even after its file was replaced.
std::filesystem::path program_file() {
  return configured_program_file().empty() ? "/proc/self/exe" : configured_program_file();
}

std::filesystem::path program_folder() {
  if (!configured_program_file().empty()) return configured_program_file().parent_path();
  std::error_code failure;
  return std::filesystem::read_symlink("/proc/self/exe", failure).parent_path();
}

void name_program_file(const std::filesystem::path& file) { configured_program_file() = file; }

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
