#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "render/residual_field.h"

namespace abbe::render {

/// A machined body coloured by its deviation, with its findings.
struct StockPicture {
  std::string title;
  StockField field;  ///< mesh in the frame of the view
  struct Mark {
    Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< mm, on the body
    std::string text;
    int kind = 0;
    int number = 0;  ///< number of the finding in the field; 0: none. If `at` is hidden, a visible
                     ///< point of the finding is marked instead
  };
  std::vector<Mark> marks;     ///< those of one kind in order of priority
  int max_marks_per_kind = 3;  ///< number of marks shown per kind: visible ones first
  std::vector<std::string> caption;
  int width = 1600;                                         ///< px
  int height = 1200;                                        ///< px
  Eigen::Vector3d from = Eigen::Vector3d(-0.5, -1.0, 0.9);  ///< direction from the body to the eye
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

/// Draws the body such that it fills the picture: coloured by deviation on a diverging scale fitted
/// to the values within the band, larger ones in the colours of the ends, not compared in grey,
/// slightly shaded by direction; with colour bar, histogram by area, scale bar and marks whose
/// labels do not overlap as long as there is room.
/// @throws std::invalid_argument if there is nothing to draw or sizes do not match
/// @throws std::system_error with the path if the file cannot be written
void write_stock_picture(const std::filesystem::path& path, const StockPicture& picture);

}  // namespace abbe::render
