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

/// Pictures of a machine that moves, one after the other by one camera.
namespace abbe::render {

/// A body that moves and keeps its shape.
struct FilmBody {
  cutting::Points vertices;      ///< (n x 3) mm, in a frame of its own
  cutting::Triangles triangles;  ///< (m x 3)
  Colour colour{0.80, 0.83, 0.87};
  double opacity = 1.0;
  bool close = false;  ///< seen beside the part, too
};

/// The shape of a part.
struct FilmMesh {
  cutting::Points vertices;      ///< (n x 3) mm, workpiece frame
  cutting::Points normals;       ///< (n x 3) unit; empty: the triangles look flat
  cutting::Triangles triangles;  ///< (m x 3)
  bool closed = false;           ///< all triangles counter-clockwise seen from outside
};

/// What does not change in a film.
struct FilmSetting {
  int width = 1280;  ///< px
  int height = 720;  ///< px
  std::string title, subtitle, machine_name = "machine", part_name = "part and tool";
  std::vector<FilmBody> bodies;
  struct NamedFiles {
    std::string name;
    Colour colour;
  };
  std::vector<NamedFiles> looks;  ///< of the vertices of the part, by number
  std::vector<NamedFiles> lines;  ///< of the paths, for the legend
  cutting::Points machine_b;  ///< (n x 3) all that the picture of the machine must hold, bed frame
  cutting::Points part_w;  ///< (n x 3) all that the picture of the part must hold, workpiece frame
  double part_depth = 1000.0;               ///< mm, before and behind it anything else is cut off
  Eigen::Vector3d from_b{-0.5, -1.0, 0.6};  ///< from the machine to the eye
  Eigen::Vector3d from_w{-0.5, -1.0, 0.9};  ///< from the part to the eye, which goes with the part
  Eigen::Vector3d up_w = Eigen::Vector3d::UnitZ();
  struct Label {
    std::string name;
    double share = 1.0;  ///< of the width
  };
  std::vector<Label> labels;  ///< of the values below the pictures
};

/// What is seen at one moment.
struct FilmState {
  std::vector<std::optional<kinematics::Pose>> T_b;  ///< (bodies) in the bed; none: not there now
  kinematics::Pose T_bw = kinematics::Pose::Identity();  ///< the workpiece in the bed
  std::shared_ptr<const FilmMesh> part;  ///< the same pointer: the same shape as before
  std::vector<std::uint8_t> looks;       ///< (vertices of the part)
  std::vector<Wire> paths;               ///< workpiece frame, beside the part only
  std::string text;                      ///< of the program
  std::vector<std::string> values;       ///< (labels)
  double done = 0.0;                     ///< 0 .. 1, of the progress bar
};

/// A film in the making: set up once, then asked for one frame after the other. It holds the one
/// canvas that may live. The same setting and states give the same pixels.
class Film {
 public:
  /// @throws as Canvas
  explicit Film(FilmSetting setting);
  ~Film();
  Film(const Film&) = delete;
  Film& operator=(const Film&) = delete;

  /// @throws std::invalid_argument if a state does not fit the setting
  Pixels frame(const FilmState& state);

 private:
  struct Stage;
  std::unique_ptr<Stage> stage_;
};

}  // namespace abbe::render
