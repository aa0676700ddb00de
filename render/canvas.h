#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"
#include "render/picture.h"

class vtkActor;
class vtkRenderer;
template <class T>
class vtkSmartPointer;

namespace abbe::render {

inline constexpr int longest_side = 16384;  ///< px, of a picture
inline constexpr int supersampling = 2;     ///< points drawn a pixel each way, unless asked for

struct TextStyle {
  double size_px = 24.0;  ///< height of the font's em
  bool bold = false;
  Colour colour = colours::ink;
  double across = 0.0;       ///< which part of the text stands at the point: 0 left, 0.5, 1 right
  double upward = 0.0;       ///< 0 its lower edge, 0.5, 1 its upper edge
  bool turned_left = false;  ///< reads upwards; across and upward turn with it
};

enum class PictureFormat {
  Png,
  Svg,  ///< lines, areas and letters as such, scenes in space as a raster behind them
  Pdf,  ///< the same
};

/// Width and height in pixels that a text takes, before it is turned.
Eigen::Vector2d text_size(const std::string& text, const TextStyle& style);

/// Triangles in space, coloured by one value a vertex, or all alike where there are no values.
struct Solid {
  cutting::Points points;
  cutting::Points normals;  ///< (n x 3) unit; empty: the triangles look flat
  cutting::Triangles triangles;
  Eigen::VectorXd values;  ///< (n) or empty
  ColourScale scale;       ///< of the values
  Colour colour = colours::uncut;
  double opacity = 1.0;
  double shade = 0.18;  ///< how much darker a face is that looks aside, 0 .. 1
};

/// Lines in space.
struct Wire {
  cutting::Points points;
  std::vector<std::array<int, 2>> segments;  ///< rows of `points`
  Colour colour = colours::ink;
  double width_px = 1.5;
};

/// One picture in the making, white, pixels counted from the lower left corner; what is drawn later
/// stands in front, solids and wires behind everything flat. The same calls give the same bytes.
/// Only one canvas lives at a time: a second one waits for the first, so do not nest them.
class Canvas {
 public:
  /// @param finer  points drawn a pixel each way, 1 to 4, of which a pixel is the mean: edges are
  ///               smooth, and a thin triangle has the colour of a place within it; fewer where
  ///               more would make the picture longer than longest_side
  /// @throws std::invalid_argument unless both sizes are in 64 .. longest_side and finer in 1 .. 4
  /// @throws std::runtime_error if there is no software or hardware OpenGL to draw with
  Canvas(int width, int height, int finer = supersampling);
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  void text(const Eigen::Vector2d& at, const std::string& text, const TextStyle& style);
  void line(const std::vector<Eigen::Vector2d>& points, const Colour& colour, double width_px);
  /// A convex polygon.
  void fill(const std::vector<Eigen::Vector2d>& corners, const Colour& colour,
            double opacity = 1.0);
  void fill(const Rectangle& box, const Colour& colour, double opacity = 1.0);
  void frame(const Rectangle& box, const Colour& colour, double width_px);
  /// Solids and wires seen in `view`, within its rectangle.
  void scene(const View& view, const std::vector<Solid>& solids, const std::vector<Wire>& wires);

  /// A scene of somebody's own, who keeps and changes it while the canvas lives; it is drawn within
  /// the rectangle of the view, seen as `look` says.
  void add(vtkRenderer& scene, const View& view);

  /// Takes away what is flat; scenes stay.
  void wipe();
  /// What is drawn, now.
  Pixels pixels();

  /// Ends the canvas: nothing more is drawn, and the next one need not wait for the file.
  /// @throws std::system_error with the path if the file cannot be written
  void write_png(const std::filesystem::path& path);
  void write(const std::filesystem::path& path, PictureFormat format);

 private:
  struct Sheet;
  std::unique_ptr<Sheet> sheet_;
};

/// Lines in their colour, for a scene of one's own.
vtkSmartPointer<vtkActor> wire_actor(const Wire& wire);

/// Puts the camera of a scene where the view says.
void look(vtkRenderer& scene, const View& view);

// Pictures whose flat parts stay sharp at any size. Letters are written as outlines, so that a
// reader needs no font.

/// A convex polygon.
struct FlatPolygon {
  std::vector<Eigen::Vector2d> corners;  ///< px from the lower left corner of the picture
  Colour colour;
  double opacity = 1.0;
};
struct FlatText {
  Eigen::Vector2d at;  ///< px, its lower left corner before it is turned
  std::string text;
  TextStyle style;
};
using FlatMark = std::variant<FlatPolygon, FlatText>;

/// What stands behind the flat marks, on the whole page; empty where nothing does.
struct Raster {
  std::string png;  ///< a file
  std::string rgb;  ///< the same as three bytes a pixel, the upper row first
};

/// A whole file; marks in the order in which they are painted.
std::string svg_document(int width, int height, const std::vector<FlatMark>& marks,
                         const Raster& behind);
std::string pdf_document(int width, int height, const std::vector<FlatMark>& marks,
                         const Raster& behind);

}  // namespace abbe::render
