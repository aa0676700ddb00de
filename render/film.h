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
  bool close = false;  ///< also shown in the close-up of the part
};

/// The shape of a part.
struct FilmMesh {
  cutting::Points vertices;      ///< (n x 3) mm, workpiece frame
  cutting::Points normals;       ///< (n x 3) unit; empty: flat shading
  cutting::Triangles triangles;  ///< (m x 3)
  bool closed = false;           ///< a closed mesh, all triangles counter-clockwise from outside
};

/// Settings that stay the same in all frames of a film.
struct FilmSetting {
  int width = 1280;  ///< px
  int height = 720;  ///< px
  std::string title, subtitle, machine_name = "machine", part_name = "part and tool";
  std::vector<FilmBody> bodies;
  struct Named {
    std::string name;
    Colour colour;
  };
  std::vector<Named> looks;    ///< legend of the part: what its vertices may look like, by index
  std::vector<Named> lines;    ///< legend of the paths
  cutting::Points machine_b;   ///< (n x 3) mm, bed frame: points that the picture of the machine
                               ///< must contain
  cutting::Points part_w;      ///< (n x 3) mm, workpiece frame: points that the picture of the part
                               ///< must contain
  double part_depth = 1000.0;  ///< mm; anything farther off, in front or behind, is clipped
  Eigen::Vector3d from_b{-0.5, -1.0, 0.6};  ///< direction from the machine to the eye
  Eigen::Vector3d from_w{-0.5, -1.0, 0.9};  ///< direction from the part to the eye; this eye
                                            ///< moves with the part
  Eigen::Vector3d up_w = Eigen::Vector3d::UnitZ();
  struct Label {
    std::string name;
    double share = 1.0;  ///< fraction of the width
  };
  std::vector<Label> labels;  ///< names of the values shown below the pictures
};

/// The state of one frame.
struct FilmState {
  std::vector<std::optional<kinematics::Pose>> T_b;  ///< (bodies) body in the bed; empty: not shown
  kinematics::Pose T_bw = kinematics::Pose::Identity();  ///< workpiece in the bed
  std::shared_ptr<const FilmMesh> part;  ///< while the pointer is the same, so is the shape
  std::vector<std::uint8_t> looks;       ///< (vertices of the part) index in FilmSetting::looks
  std::vector<Wire> paths;               ///< workpiece frame; shown only in the close-up
  std::string text;                      ///< line of the program
  std::vector<std::string> values;       ///< (labels) as text
  double done = 0.0;                     ///< progress, 0 .. 1
};

/// A film: set up once, then rendered frame by frame. It owns the one canvas that may exist at a
/// time. The same settings and states give the same pixels.
class Film {
 public:
  /// @throws the exceptions of the constructor of Canvas
  explicit Film(FilmSetting setting);
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
