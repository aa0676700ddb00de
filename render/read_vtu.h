#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::render {

/// A tensor at each of a number of points.
struct PointTensors {
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> points;  ///< (n x 3)
  std::vector<Eigen::Matrix3d> tensors;                              ///< (n)
};

inline constexpr std::uintmax_t max_vtu_bytes = std::uintmax_t(512) << 20;

/// Reads the points of a VTK XML unstructured grid and the point array of that name, with 9
/// components (row by row) or 6 (xx yy zz xy yz xz, symmetric); its cells are passed over. Float32
/// or Float64, little endian, in one piece; ascii, base64 or appended (base64 or raw), plain or
/// compressed by zlib or lz4: what VTK, ParaView and meshio write. Memory stays within a few times
/// what the bytes that are there can hold, whatever the file claims.
/// @throws BadInput naming the file and what was expected for anything else, a number that is not
///         finite, more than 512 MiB
PointTensors read_vtu(const std::filesystem::path& path, const std::string& array);

}  // namespace abbe::render
