#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "sim/report/mesh_walk.h"

/// Numbers packed into the text of a page: each is predicted from those before it, and how far
/// it lies from that is range coded and written in base64. render/report/unpack.js unpacks it.
namespace abbe::sim {

/// From what a number is predicted: those at the vertices a and b of an edge met before and c
/// opposite it, or in a sequence of the one before, twice, and the one before that.
enum class Prediction {
  Parallelogram,  ///< a + b - c
  Middle,         ///< (a + b) / 2, rounded down
  Reference,      ///< nothing but the reference
};

/// Columns of whole numbers, packed one after the other; a value is offset + step times its number.
struct Packed {
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
inline constexpr int largest_packed = 1 << 29;

struct PackOptions {
  const MeshWalk* walk = nullptr;  ///< rows are its vertices in its order; null: a sequence
  /// (rows) offered to a single column: numbers without missing ones, each like those to be packed
  /// to within a change that is smooth over the mesh.
  std::vector<const Eigen::VectorXi*> references = {};
};

/// Whole numbers (n x m), `missing` among them, as they are.
/// @throws std::invalid_argument if one is too large
Packed packed_numbers(const Eigen::MatrixXi& numbers, const PackOptions& options = {});

/// The numbers of values (n x m): the nearest to (value - offset) / step, `missing` for NaN.
/// @throws std::invalid_argument if the step is not positive, a value is infinite, or a number too
///         large
Eigen::MatrixXi numbers_of(const Eigen::MatrixXd& values, double step,
                           const std::vector<double>& offset);

/// Values (n x m) to within half a step.
/// @throws std::invalid_argument as `numbers_of`
Packed packed_values(const Eigen::MatrixXd& values, double step, const PackOptions& options = {});

/// The least step with which 16 bits suffice for every column; 1 where all values are one.
double step_of_16_bits(const Eigen::MatrixXd& values);

/// RFC 4648, padded.
std::string base64(std::string_view bytes);

}  // namespace abbe::sim
