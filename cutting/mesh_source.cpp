#include "cutting/mesh_source.h"

#include <fstream>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"

namespace abbe::cutting {

void MeshSource::refuse(const std::string& expected, const std::string& seen, int line,
                        int column) const {
  throw BadInput(name, line, column, expected, seen);
}

void MeshSource::check_triangles(std::int64_t count) const {
  if (count > max_triangles)
    refuse(fmt::format("at most {} triangles", max_triangles), fmt::format("{}", count));
}

MeshSource mesh_source(const std::filesystem::path& file, std::uintmax_t max_bytes,
                       std::int64_t max_triangles) {
  const auto refuse = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(file.string(), 0, 0, expected, seen);
  };
  std::error_code problem;
  const auto status = std::filesystem::status(file, problem);
  if (!std::filesystem::exists(status)) refuse("a mesh file", "no such file");
  if (!std::filesystem::is_regular_file(status)) refuse("a mesh file", "something that is no file");
  const std::uintmax_t size = std::filesystem::file_size(file, problem);
  if (problem) refuse("a mesh file", problem.message());
  if (size == 0) refuse("a mesh", "an empty file");
  if (size > max_bytes) refuse(fmt::format("at most {} bytes", max_bytes), fmt::format("{}", size));
  std::string bytes(size, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<std::uintmax_t>(stream.gcount()) != size)
    refuse("a file that can be read", fmt::format("{} of {} bytes", stream.gcount(), size));
  return {file.string(), std::move(bytes), max_triangles};
}

}  // namespace abbe::cutting
