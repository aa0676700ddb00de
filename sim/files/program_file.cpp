#include "sim/files/program_file.h"

namespace abbe::sim {
namespace {

std::filesystem::path& named() {
  static std::filesystem::path file;
  return file;
}

}  // namespace

std::filesystem::path program_file() { return named().empty() ? "/proc/self/exe" : named(); }

std::filesystem::path program_folder() {
  if (!named().empty()) return named().parent_path();
  std::error_code failure;
  return std::filesystem::read_symlink("/proc/self/exe", failure).parent_path();
}

void name_program_file(const std::filesystem::path& file) { named() = file; }

}  // namespace abbe::sim
