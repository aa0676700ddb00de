#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "cutting/part/mesh.h"

namespace abbe::sim {

// The mesh of a page. Vertices and triangles are sorted so that consecutive numbers differ little.

/// Returns the old numbers (n) of vertices along a Morton curve through 1024 cells in each
/// direction of their bounding box.
/// Source: Morton 1966, A computer oriented geodetic data base.
std::vector<Eigen::Index> morton_order(const Eigen::MatrixX3d& vertices);

/// Returns the triangles (m x 3) by the new numbers of their corners, the smallest corner first and
/// the orientation kept, in ascending order.
/// @param order  (n) old number of each vertex, a permutation
Eigen::MatrixXi sorted_triangles(const cutting::Triangles& triangles,
                                 const std::vector<Eigen::Index>& order);

// Numbers packed into the text of a page: differences of consecutive numbers, deflated, in base64.
// render/report/unpack.js unpacks them.

/// Columns of integers; a value is offset + step times its number.
struct PackedColumns {
  Eigen::Index rows = 0, columns = 0;
  std::vector<double> offset, step;  ///< (columns); empty if the numbers are the values
  int reference = -1;                ///< index of the reference that was used; -1: none
  /// Base64 of a zlib stream of 4 rows columns bytes: the lowest bytes of all differences, column
  /// by column, then the next higher bytes. A difference d is stored as 2 d if d >= 0, as -2 d - 1
  /// if d < 0; 2^32 - 1 marks a missing number.
  std::string text;
};

/// The number that represents NaN.
inline constexpr int missing = -2147483647 - 1;

/// Largest magnitude of a number that can be packed: differences of differences fit into 32 bits.
inline constexpr int max_packed = (1 << 29) - 1;

/// Packs integers (n x m), `missing` among them, exactly. Each number is predicted from the
/// preceding one that is not missing.
/// @param references  columns (n) that resemble a single packed column: the one whose subtraction
/// saves most bytes is used, if any does; a missing number of it counts as 0
/// @throws std::invalid_argument if a number is too large
PackedColumns pack_numbers(const Eigen::MatrixXi& numbers,
                           const std::vector<const Eigen::VectorXi*>& references = {});

/// Returns the numbers of values (n x m): the nearest to (value - offset) / step, `missing` for
/// NaN.
/// @throws std::invalid_argument if the step is not positive, a value is infinite, or a number is
/// too large
Eigen::MatrixXi numbers_of(const Eigen::MatrixXd& values, double step,
                           const std::vector<double>& offset);

/// Packs values (n x m) to within half a step.
/// @throws std::invalid_argument as `numbers_of`
PackedColumns pack_values(const Eigen::MatrixXd& values, double step);

/// Returns the smallest step with which 16 bits suffice for every column; 1 if all values are
/// equal.
double step_for_16_bits(const Eigen::MatrixXd& values);

/// Returns bytes in base64 by RFC 4648, padded.
std::string base64(std::string_view bytes);

/// Binary data of a page: the index of its arrays, and their texts.
struct PageData {
  nlohmann::ordered_json index;
  std::string blocks;
};

/// Adds packed columns under a name, with their description in the index.
/// @param references  names of the arrays that were offered as references
void add(PageData& data, const std::string& name, const PackedColumns& packed,
         const std::vector<std::string>& references = {});

/// Returns a rigid pose, column by column.
nlohmann::ordered_json to_json(const Eigen::Isometry3d& T);
nlohmann::ordered_json to_json(const Eigen::Vector3d& v);

}  // namespace abbe::sim
