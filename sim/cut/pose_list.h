#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/chain.h"

namespace abbe::sim {

/// Poses that are asked for, as they were written.
struct PoseList {
  struct Column {
    std::string head;   ///< "X_mm", "A_deg", "A_rad", "time_s", "time_min", "time_h"
    int joint = -1;     ///< of the chain; -1: time
    double unit = 1.0;  ///< mm, rad or s for one of its own
  };
  std::vector<Column> columns;
  std::vector<double> numbers;    ///< (poses x columns) by rows, in the unit of the column
  std::vector<int> line;          ///< (poses) of the file; empty where there is none
  std::string file;               ///< what refusals call the source
  kinematics::AxisVector others;  ///< (joints) where axes without a column stand

  std::size_t size() const { return columns.empty() ? 0 : numbers.size() / columns.size(); }
  bool is_timed() const;
  kinematics::AxisState state(std::size_t pose) const;
  /// "X_mm = 100, A_deg = 30"
  std::string text(std::size_t pose) const;
};

inline constexpr std::size_t most_pose_bytes = std::size_t(1) << 30;
inline constexpr std::size_t most_poses = 10'000'000;

/// Reads poses from CSV: a head of axes X_mm, A_deg or A_rad and, if wanted, time_s, time_min or
/// time_h from the start of the program, in any order, then one pose a row; commas, semicolons or
/// blanks; empty lines and lines that begin with # are passed over. Axes without a column stand at
/// zero.
/// @param file  what refusals call it
/// @throws BadScene with the faults of up to 20 rows, each with line and column: a column that is
///         unknown or comes twice, no axis, a cell too few or too many or that is no number within
///         +-1e9, a position beyond the limits of travel, no pose, more than most_poses of them
PoseList read_poses(std::string_view text, const std::string& file, const kinematics::Chain& chain);

/// The same from a file. @throws BadInput also beyond most_pose_bytes
PoseList read_poses_file(const std::filesystem::path& file, const kinematics::Chain& chain);

}  // namespace abbe::sim
