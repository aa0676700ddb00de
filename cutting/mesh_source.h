#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace abbe::cutting {

/// A mesh file in memory, and how much it may hold. Refusals name it.
struct MeshSource {
  std::string name;
  std::string bytes;
  std::int64_t max_triangles;

  /// @throws BadInput at this line and column, 0 where the file is binary
  [[noreturn]] void refuse(const std::string& expected, const std::string& seen, int line = 0,
                           int column = 0) const;
  /// @throws BadInput if there are more than `max_triangles`
  void check_triangles(std::int64_t count) const;
};

/// @throws BadInput if there is no such regular file, or it is empty, too long or unreadable
MeshSource mesh_source(const std::filesystem::path& file, std::uintmax_t max_bytes,
                       std::int64_t max_triangles);

}  // namespace abbe::cutting
