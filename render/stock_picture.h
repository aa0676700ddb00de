#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "render/residual_field.h"

namespace abbe::render {

/// A machined body coloured by its deviation, with marks at its findings.
struct StockPicture {
  std::string title;
  StockField field;  ///< its mesh is in the frame of the view
  struct Mark {
    Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< mm, on the body
    std::string text;
    int kind = 0;
    int number = 0;  ///< number of the finding in the field, 0: none. If `at` is hidden, another
                     ///< point of the finding that is visible is marked instead
  };
  std::vector<Mark> marks;  ///< marks of the same kind in order of priority
  int max_marks_per_kind =
      3;  ///< largest number of drawn marks per kind; visible ones take priority
  std::vector<std::string> caption;
  int width = 1600;                                         ///< px
  int height = 1200;                                        ///< px
  Eigen::Vector3d from = Eigen::Vector3d(-0.5, -1.0, 0.9);  ///< direction from the body to the eye
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

/// Draws the body so that it fills the picture, slightly shaded. Colours show the deviation on a
/// diverging scale that is fitted to the values within the band; larger values have the colours of
/// its ends, and areas that are not compared are grey. Beside it are a colour bar with a histogram
/// by area, a scale bar and marks whose labels do not overlap if there is enough space.
/// @throws std::invalid_argument if there is nothing to draw or sizes do not match
/// @throws std::system_error with the path if the file cannot be written
void write_stock_picture(const std::filesystem::path& path, const StockPicture& picture);

}  // namespace abbe::render
