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

/// The triangles of a mesh in an order in which nearly every one shares an edge with one before it,
/// and the vertices in the order in which they are first met. Vertices without a triangle stand
/// last.
struct MeshWalk {
  std::vector<Eigen::Index> order;        ///< (n) old number of each
  std::vector<std::array<int, 3>> known;  ///< (n) new numbers of vertices met before: the edge over
                                          ///< which the walk came and the corner opposite it; the
                                          ///< one before, three times, where it came over none
  std::string code;                       ///< from which a page makes the triangles, range coded
};

/// @param triangles  any corners: holes, several parts, edges of more than two triangles; a
/// triangle
///                   keeps its sense and may begin at another of its corners
/// @param vertices   their number
/// Source: the edge conquest of Gumhold and Strasser 1998 and the valences of Touma and Gotsman
///         1998, without their splits of the border.
MeshWalk mesh_walk(const Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>& triangles,
                   Eigen::Index vertices);

// Numbers packed into the text of a page: each is predicted from those before it, and how far
// it lies from that is range coded and written in base64. render/report/unpack.js unpacks it.

/// From what a number is predicted: those at the vertices a and b of an edge met before and c
/// opposite it, or in a sequence of the one before, twice, and the one before that.
enum class Prediction {
  Parallelogram,  ///< a + b - c
  Middle,         ///< (a + b) / 2, rounded down
  Reference,      ///< nothing but the reference
};

/// Columns of whole numbers, packed one after the other; a value is offset + step times its number.
struct PackedColumns {
  Eigen::Index rows = 0, columns = 0;
  std::vector<double> offset, step;  ///< (columns); empty where the numbers are the values
  std::vector<Prediction> by;        ///< (columns)
  int reference = -1;                ///< which of those offered was taken; -1: none
  bool has_missing = false;
  Eigen::MatrixXi numbers;  ///< as coded, with what was predicted in place of missing ones
  std::string text;         ///< base64
};

/// The number that stands for NaN.
inline constexpr int missing = -2147483647 - 1;

/// No number to be packed is larger.
inline constexpr int max_packed = 1 << 29;

struct PackOptions {
  const MeshWalk* walk = nullptr;  ///< rows are its vertices in its order; null: a sequence
  /// (rows) offered to a single column: numbers without missing ones, each like those to be packed
  /// to within a change that is smooth over the mesh.
  std::vector<const Eigen::VectorXi*> references = {};
};

/// Whole numbers (n x m), `missing` among them, as they are.
/// @throws std::invalid_argument if one is too large
PackedColumns pack_numbers(const Eigen::MatrixXi& numbers, const PackOptions& options = {});

/// The numbers of values (n x m): the nearest to (value - offset) / step, `missing` for NaN.
/// @throws std::invalid_argument if the step is not positive, a value is infinite, or a number too
///         large
Eigen::MatrixXi numbers_of(const Eigen::MatrixXd& values, double step,
                           const std::vector<double>& offset);

/// Values (n x m) to within half a step.
/// @throws std::invalid_argument as `numbers_of`
PackedColumns pack_values(const Eigen::MatrixXd& values, double step,
                          const PackOptions& options = {});

/// The least step with which 16 bits suffice for every column; 1 where all values are one.
double step_for_16_bits(const Eigen::MatrixXd& values);

/// RFC 4648, padded.
std::string base64(std::string_view bytes);

/// What a page holds besides words: the index of its arrays, and their texts.
struct PageData {
  nlohmann::ordered_json index;
  std::string blocks;
};

void add_block(PageData& data, const std::string& name, const std::string& text);

/// An array by its name.
struct PageArray {
  std::string name;
  bool on_mesh = false;                      ///< rows are the vertices of the mesh
  std::vector<std::string> references = {};  ///< what its packing was offered
};
void add(PageData& data, const PageArray& array, const PackedColumns& packed);

/// A rigid pose, column after column.
nlohmann::ordered_json to_json(const Eigen::Isometry3d& T);
nlohmann::ordered_json to_json(const Eigen::Vector3d& v);

}  // namespace abbe::sim
