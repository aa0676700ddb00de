#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

namespace abbe::sim {

/// A traversal of a mesh: its triangles in an order in which nearly every one shares an edge with
/// an earlier one, and its vertices in the order of their first occurrence. Vertices without a
/// triangle come last.
struct MeshWalk {
  std::vector<Eigen::Index> order;  ///< (n) old number of each vertex
  /// (n) new numbers of earlier vertices: the edge over which the traversal came and the corner
  /// opposite it; the preceding vertex three times if it came over no edge.
  std::vector<std::array<int, 3>> known;
  std::string code;  ///< range-coded description from which a page rebuilds the triangles
};

/// Traverses a mesh.
/// @param triangles  any mesh: holes, several parts, edges of more than two triangles; a triangle
/// keeps its orientation and may begin at another corner
/// @param vertices   their number
/// Source: the edge conquest of Gumhold and Strasser 1998 and the valences of Touma and Gotsman
/// 1998, without their splits of the border.
MeshWalk mesh_walk(const Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>& triangles,
                   Eigen::Index vertices);

// Numbers packed into the text of a page: each number is predicted from earlier ones, and the
// difference is range coded and written in base64. render/report/unpack.js unpacks it.

/// Prediction of a number: from its values at the vertices a and b of an earlier edge and c
/// opposite it; in a sequence a and b are the preceding number and c the one before it.
enum class Prediction {
  Parallelogram,  ///< a + b - c
  Middle,         ///< (a + b) / 2, rounded down
  Reference,      ///< the reference only
};

/// Columns of integers, packed one after the other; a value is offset + step times its number.
struct PackedColumns {
  Eigen::Index rows = 0, columns = 0;
  std::vector<double> offset, step;  ///< (columns); empty if the numbers are the values
  std::vector<Prediction> by;        ///< (columns) prediction of each
  int reference = -1;                ///< index of the reference that was used; -1: none
  bool has_missing = false;
  Eigen::MatrixXi numbers;  ///< as coded, with the prediction in place of missing numbers
  std::string text;         ///< base64
};

/// The number that represents NaN.
inline constexpr int missing = -2147483647 - 1;

/// Largest number that can be packed.
inline constexpr int max_packed = 1 << 29;

/// Options of packing.
struct PackOptions {
  const MeshWalk* walk = nullptr;  ///< rows are its vertices in its order; null: a sequence
  /// References (rows) for a single column: numbers without missing ones that differ from the
  /// packed ones by a smooth function over the mesh.
  std::vector<const Eigen::VectorXi*> references = {};
};

/// Packs integers (n x m), `missing` among them, exactly.
/// @throws std::invalid_argument if a number is too large
PackedColumns pack_numbers(const Eigen::MatrixXi& numbers, const PackOptions& options = {});

/// Returns the numbers of values (n x m): the nearest to (value - offset) / step, `missing` for
/// NaN.
/// @throws std::invalid_argument if the step is not positive, a value is infinite, or a number is
/// too large
Eigen::MatrixXi numbers_of(const Eigen::MatrixXd& values, double step,
                           const std::vector<double>& offset);

/// Packs values (n x m) to within half a step.
/// @throws std::invalid_argument as `numbers_of`
PackedColumns pack_values(const Eigen::MatrixXd& values, double step,
                          const PackOptions& options = {});

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

/// Adds a text under a name.
void add_block(PageData& data, const std::string& name, const std::string& text);

/// Description of an array.
struct PageArray {
  std::string name;
  bool on_mesh = false;                      ///< rows are the vertices of the mesh
  std::vector<std::string> references = {};  ///< names of the arrays offered as references
};
/// Adds packed columns with their description in the index.
void add(PageData& data, const PageArray& array, const PackedColumns& packed);

/// Returns a rigid pose, column by column.
nlohmann::ordered_json to_json(const Eigen::Isometry3d& T);
nlohmann::ordered_json to_json(const Eigen::Vector3d& v);

}  // namespace abbe::sim
