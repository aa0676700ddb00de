#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cutting/part/mesh.h"
#include "kinematics/pose.h"
#include "render/canvas.h"
#include "render/picture.h"

/// Pictures of a moving machine, rendered frame by frame without a display.
namespace abbe::render {

/// A rigid moving body.
struct FilmBody {
  cutting::Points vertices;      ///< (n x 3) mm, in its own frame
  cutting::Triangles triangles;  ///< (m x 3)
  Colour colour{0.80, 0.83, 0.87};
  double opacity = 1.0;
  bool in_close_up = false;  ///< also shown in the close-up view of the part
};

/// The shape of the part in a frame.
struct FilmMesh {
  cutting::Points vertices;      ///< (n x 3) mm, workpiece frame
  cutting::Points normals;       ///< (n x 3) unit; empty: flat shading
  cutting::Triangles triangles;  ///< (m x 3)
  bool closed = false;           ///< closed, all triangles counter-clockwise seen from outside
};

/// The settings of a film, common to all frames.
struct FilmSettings {
  int width = 1280;  ///< px
  int height = 720;  ///< px
  std::string title, subtitle, machine_name = "machine", part_name = "part and tool";
  std::vector<FilmBody> bodies;
  struct Named {
    std::string name;
    Colour colour;
  };
  std::vector<Named>
      vertex_styles;           ///< colours of the vertices of the part, by index; also its legend
  std::vector<Named> lines;    ///< legend of the paths
  cutting::Points machine_b;   ///< (n x 3) mm, bed frame: points that the machine view must contain
  cutting::Points part_w;      ///< (n x 3) mm, workpiece frame: points that the part view must
                               ///< contain
  double part_depth = 1000.0;  ///< mm, clipping distance in front of and behind the part
  Eigen::Vector3d from_b{-0.5, -1.0, 0.6};  ///< direction from the machine to the eye
  Eigen::Vector3d from_w{-0.5, -1.0, 0.9};  ///< direction from the part to the eye, which moves
                                            ///< with the part
  Eigen::Vector3d up_w = Eigen::Vector3d::UnitZ();
  struct Label {
    std::string name;
    double relative_width = 1.0;  ///< relative width of its column
  };
  std::vector<Label> labels;  ///< names of the values shown below the views
};

/// The state of one frame.
struct FilmState {
  std::vector<std::optional<kinematics::Pose>> T_b;  ///< (bodies) body in the bed; empty: not shown
  kinematics::Pose T_bw = kinematics::Pose::Identity();  ///< workpiece in the bed
  std::shared_ptr<const FilmMesh> part;     ///< an unchanged pointer means an unchanged shape
  std::vector<std::uint8_t> vertex_styles;  ///< (vertices of the part) index in FilmSetting::looks
  std::vector<Wire> paths;                  ///< workpiece frame; shown only in the close-up
  std::string text;                         ///< line of the program
  std::vector<std::string> values;          ///< (labels) as text
  double progress = 0.0;                    ///< progress bar, 0 .. 1
};

/// Renders a film frame by frame. It owns a canvas, and only one canvas may exist at a time. The
/// same settings and states give the same pixels.
class Film {
 public:
  /// @throws the exceptions of the constructor of Canvas
  explicit Film(FilmSettings setting);
  ~Film();
  Film(const Film&) = delete;
  Film& operator=(const Film&) = delete;

  /// Returns the picture of a state.
  /// @throws std::invalid_argument if the state does not match the settings
  Pixels frame(const FilmState& state);

 private:
  struct Stage;
  std::unique_ptr<Stage> stage_;
};

}  // namespace abbe::render
