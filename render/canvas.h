#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"
#include "render/picture.h"

class vtkActor;
class vtkRenderer;
template <class T>
class vtkSmartPointer;

namespace abbe::render {

inline constexpr int max_side_px = 16384;  ///< px, largest width and height of a picture
inline constexpr int supersampling = 2;    ///< default samples of scenes per pixel and direction

/// Font, colour and anchor of a text.
struct TextStyle {
  double size_px = 24.0;  ///< height of the font's em
  bool bold = false;
  Colour colour = colours::ink;
  double horizontal_anchor = 0.0;  ///< 0 left edge, 0.5 centre, 1 right edge
  double vertical_anchor = 0.0;    ///< 0 lower edge, 0.5 centre, 1 upper edge
  bool turned_left = false;        ///< rotated to read upwards, together with its anchor
};

enum class PictureFormat {
  Png,
  Svg,  ///< lines, areas and letters as outlines, scenes in space as a raster image behind them
  Pdf,  ///< as SVG
};

/// Returns width and height of a text in pixels, before it is rotated. Thread-safe.
Eigen::Vector2d text_size(const std::string& text, const TextStyle& style);

/// Returns the Debian package that is missing to draw a text correctly; empty if none is missing.
std::string missing_font_package(const std::string& text);

/// A triangulated surface in space, coloured by one value per vertex, or uniformly without values.
struct Solid {
  cutting::Points points;
  cutting::Points normals;  ///< (n x 3) unit; empty: flat shading
  cutting::Triangles triangles;
  Eigen::VectorXd values;  ///< (n) or empty
  ColourScale scale;       ///< colours of the values
  Colour colour = colours::uncut;
  double opacity = 1.0;
  double shade = 0.18;  ///< darkening of faces that do not face the eye, 0 .. 1
};

/// Line segments in space.
struct Wire {
  cutting::Points points;
  std::vector<std::array<int, 2>> segments;  ///< rows of `points`
  Colour colour = colours::ink;
  double width_px = 1.5;
};

/// Draws a picture on white, in pixel coordinates from the lower left corner. Later elements are in
/// front of earlier ones; solids and wires are behind all flat elements. The same calls give the
/// same bytes. Only one canvas with scenes exists at a time: the first scene waits until the
/// previous canvas with scenes is written or destroyed, so a thread must not nest two of them.
class Canvas {
 public:
  /// @param oversampling  samples of scenes per pixel in each direction, 1 to 4, whose mean makes
  ///                      edges smooth; reduced if the samples would exceed max_side_px
  /// @throws std::invalid_argument unless both sizes are in 64 .. max_side_px and oversampling is
  ///         in 1 .. 4
  Canvas(int width, int height, int oversampling = supersampling);
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  void text(const Eigen::Vector2d& at, const std::string& text, const TextStyle& style);
  /// Draws a line through the points; it is closed if the last point is the first.
  /// @param dashes_px  lengths of dashes and gaps in turn; empty for a solid line
  void line(const std::vector<Eigen::Vector2d>& points, const Colour& colour, double width_px,
            const std::vector<double>& dashes_px = {});
  /// Fills a polygon.
  void fill(const std::vector<Eigen::Vector2d>& corners, const Colour& colour,
            double opacity = 1.0);
  void fill(const Rectangle& box, const Colour& colour, double opacity = 1.0);
  void frame(const Rectangle& box, const Colour& colour, double width_px);
  /// Draws solids and wires in `view`, within its rectangle.
  /// @throws std::runtime_error if no software or hardware OpenGL is available
  void scene(const View& view, const std::vector<Solid>& solids, const std::vector<Wire>& wires);

  /// Adds a scene that the caller owns and may change while the canvas exists. It is drawn within
  /// the rectangle of the view, with the camera of the view.
  /// @throws std::runtime_error if no software or hardware OpenGL is available
  void add(vtkRenderer& scene, const View& view);

  /// Removes all flat elements but no scenes.
  void clear_flat_elements();
  /// Returns the picture as drawn so far.
  Pixels pixels();

  /// Write the picture and end the canvas. No scene can be added any more; the next canvas does not
  /// have to wait for the file.
  /// @throws std::system_error with the path if the file cannot be written
  void write_png(const std::filesystem::path& path);
  void write(const std::filesystem::path& path, PictureFormat format);

 private:
  struct Sheet;
  std::unique_ptr<Sheet> sheet_;
};

/// Returns an actor of the lines, for a scene of the caller.
vtkSmartPointer<vtkActor> wire_actor(const Wire& wire);

/// Sets the camera of a scene according to the view.
void set_camera(vtkRenderer& scene, const View& view);

}  // namespace abbe::render
