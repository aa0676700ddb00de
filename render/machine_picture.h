#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"
#include "kinematics/pose.h"
#include "render/picture.h"

namespace abbe::render {

/// Returns the edges of a surface at which it bends by more than 26 degrees or ends, as pairs of
/// rows of `points`.
std::vector<std::array<int, 2>> sharp_edges(const cutting::Points& points,
                                            const cutting::Triangles& triangles);

/// A block centred at the origin of its frame.
struct BlockShape {
  Eigen::Vector3d size = Eigen::Vector3d::Constant(100.0);  ///< mm
};
/// A cylinder about the z axis of its frame, from z = 0 to z = height.
struct CylinderShape {
  double radius = 50.0;   ///< mm
  double height = 100.0;  ///< mm
};

/// Any closed surface.
struct SolidShape {
  cutting::Points vertices;      ///< (n x 3) mm
  cutting::Triangles triangles;  ///< (m x 3)
};

/// A rigid body such as a carriage, the bed or a tool, drawn with its edges.
struct Body {
  std::string label;                                  ///< written beside the machine; may be empty
  kinematics::Pose T = kinematics::Pose::Identity();  ///< in the frame of the picture
  std::variant<BlockShape, CylinderShape, SolidShape> shape;
  Colour colour{0.80, 0.83, 0.87};
  double opacity = 1.0;
  bool in_close_up = false;  ///< also drawn in the close-up view at the right
};

/// A tool path, nominal or actual, as a polyline.
struct DrawnPath {
  std::string name;  ///< for the legend; empty: not listed
  cutting::Points points;
  Colour colour = colours::ink;
  double width_px = 2.0;
};

/// A coordinate frame, drawn as three axes: X red, Y green, Z blue.
struct Frame {
  std::string name;
  kinematics::Pose T = kinematics::Pose::Identity();
};

/// The contents of a picture: a machine, a part and tool paths in one frame, with their labels.
struct MachinePicture {
  std::string title;
  std::vector<Body> bodies;
  std::string part_name = "part";  ///< for the legend
  Colour part_colour{0.93, 0.80, 0.55};
  cutting::Points part_vertices;  ///< (n x 3), may be empty
  cutting::Triangles part_triangles;
  std::vector<DrawnPath> paths;
  std::vector<Frame> frames;
  /// Factor by which the path errors are magnified; shown in the picture.
  double magnification = 1.0;
  std::vector<std::string> caption;
};

struct MachinePictureOptions {
  int width = 1600;   ///< px
  int height = 1000;  ///< px
  Eigen::Vector3d from =
      Eigen::Vector3d(-0.5, -1.0, 0.6);  ///< direction from the machine to the eye
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

/// Draws the whole machine with part and paths at the left, and a close-up view of the part, the
/// paths and the bodies with `in_close_up` at the right, each with a scale bar. States the
/// magnification.
/// @throws std::invalid_argument if there is nothing to draw, a number is not finite, or a triangle
///         refers to a missing vertex
/// @throws std::system_error with the path if the file cannot be written
void write_machine_picture(const std::filesystem::path& path, const MachinePicture& picture,
                           const MachinePictureOptions& options = {});

}  // namespace abbe::render
