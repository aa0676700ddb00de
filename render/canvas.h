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

inline constexpr int longest_side = 16384;  ///< px, maximum width and height of a picture
inline constexpr int supersampling = 2;     ///< default number of samples per pixel in each
                                            ///< direction

struct TextStyle {
  double size_px = 24.0;  ///< height of the font's em
  bool bold = false;
  Colour colour = colours::ink;
  double across = 0.0;       ///< anchor of the text at the point: 0 left, 0.5 centre, 1 right
  double upward = 0.0;       ///< anchor: 0 lower edge, 0.5 centre, 1 upper edge
  bool turned_left = false;  ///< reads upwards; across and upward turn with it
};

enum class PictureFormat {
  Png,
  Svg,  ///< lines, areas and letters as vectors, scenes in space as a raster behind them
  Pdf,  ///< likewise
};

/// Returns width and height of a text in pixels, before it is turned.
Eigen::Vector2d text_size(const std::string& text, const TextStyle& style);

/// Triangles in space, coloured by one value per vertex, or uniformly if there are no values.
struct Solid {
  cutting::Points points;
  cutting::Points normals;  ///< (n x 3) unit; empty: flat shading
  cutting::Triangles triangles;
  Eigen::VectorXd values;  ///< (n) or empty
  ColourScale scale;       ///< of the values
  Colour colour = colours::uncut;
  double opacity = 1.0;
  double shade = 0.18;  ///< darkening of faces that do not face the eye, 0 .. 1
};

/// Lines in space.
struct Wire {
  cutting::Points points;
  std::vector<std::array<int, 2>> segments;  ///< rows of `points`
  Colour colour = colours::ink;
  double width_px = 1.5;
};

/// A picture being drawn on white, with pixel coordinates from the lower left corner. Later
/// elements are drawn in front; solids and wires are behind all flat elements. The same calls give
/// the same bytes. Only one canvas exists at a time: a second one waits for the first, so they must
/// not be nested.
class Canvas {
 public:
  /// @param finer  samples per pixel in each direction, 1 to 4, averaged: edges are smooth, and a
  ///               thin triangle gets the colour of a point within it; reduced if the samples would
  ///               exceed longest_side
  /// @throws std::invalid_argument unless both sizes are in 64 .. longest_side and finer in 1 .. 4
  /// @throws std::runtime_error if no software or hardware OpenGL is available
  Canvas(int width, int height, int finer = supersampling);
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  void text(const Eigen::Vector2d& at, const std::string& text, const TextStyle& style);
  void line(const std::vector<Eigen::Vector2d>& points, const Colour& colour, double width_px);
  /// Fills a convex polygon.
  void fill(const std::vector<Eigen::Vector2d>& corners, const Colour& colour,
            double opacity = 1.0);
  void fill(const Rectangle& box, const Colour& colour, double opacity = 1.0);
  void frame(const Rectangle& box, const Colour& colour, double width_px);
  /// Draws solids and wires in `view`, within its rectangle.
  void scene(const View& view, const std::vector<Solid>& solids, const std::vector<Wire>& wires);

  /// Adds a scene that the caller owns and may change while the canvas exists; it is drawn within
  /// the rectangle of the view, with the camera set by `look`.
  void add(vtkRenderer& scene, const View& view);

  /// Removes all flat elements; scenes stay.
  void wipe();
  /// Returns the picture as drawn so far.
  Pixels pixels();

  /// Write the picture and end the canvas: nothing more can be drawn, and the next canvas need not
  /// wait for the file.
  /// @throws std::system_error with the path if the file cannot be written
  void write_png(const std::filesystem::path& path);
  void write(const std::filesystem::path& path, PictureFormat format);

 private:
  struct Sheet;
  std::unique_ptr<Sheet> sheet_;
};

/// Returns lines in their colour, for a caller's own scene.
vtkSmartPointer<vtkActor> wire_actor(const Wire& wire);

/// Sets the camera of a scene according to the view.
void look(vtkRenderer& scene, const View& view);

// Vector pictures, whose flat elements stay sharp at any size. Letters are written as outlines, so
// that a reader needs no font.

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

/// Raster behind the flat elements, on the whole page; empty if there is none.
struct Raster {
  std::string png;  ///< a PNG file
  std::string rgb;  ///< the same picture as three bytes per pixel, the upper row first
};

/// Return a whole file; marks in the order in which they are painted.
std::string svg_document(int width, int height, const std::vector<FlatMark>& marks,
                         const Raster& behind);
std::string pdf_document(int width, int height, const std::vector<FlatMark>& marks,
                         const Raster& behind);

}  // namespace abbe::render
