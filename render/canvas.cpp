#include "render/canvas.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <vtkActor.h>
#include <vtkBrush.h>
#include <vtkCamera.h>
#include <vtkCellArray.h>
#include <vtkContext2D.h>
#include <vtkContextActor.h>
#include <vtkContextItem.h>
#include <vtkContextScene.h>
#include <vtkDoubleArray.h>
#include <vtkFloatArray.h>
#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkIntArray.h>
#include <vtkLookupTable.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkPath.h>
#include <vtkPen.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderer.h>
#include <vtkSmartPointer.h>
#include <vtkTextProperty.h>
#include <vtkTextRenderer.h>
#include <vtkUnsignedCharArray.h>
#include <vtkVersion.h>
#include <zlib.h>

#include "render/vtk_environment.h"
#include "render/vtk_writer.h"

#if VTK_VERSION_NUMBER < VTK_VERSION_CHECK(9, 2, 0)
#include <vtkUnicodeString.h>
#endif

class vtkTextProperty;

namespace abbe::render {

inline constexpr int dots_per_inch = 72;  // at which one point of a font is one pixel

/// Sets font, size and colour of a text.
void apply_style(const TextStyle& style, const std::string& text, vtkTextProperty& property);

/// The flat elements as an item of VTK, painted in the order in which they were drawn.
class FlatItem : public vtkContextItem {
 public:
  static FlatItem* New();
  vtkTypeMacro(FlatItem, vtkContextItem)

      bool Paint(vtkContext2D* painter) override {
    for (const auto& stroke : strokes) stroke(*painter);
    return true;
  }

  std::vector<std::function<void(vtkContext2D&)>> strokes;
};
vtkStandardNewMacro(FlatItem);

namespace {

using Eigen::Vector2d;

std::recursive_mutex canvas_mutex;  // VTK has one font cache and one OpenGL state per process

/// Returns the lower left corner of a text of `size` whose anchor is at `at`. It is rounded to
/// whole pixels, because letters between pixels are blurred.
Vector2d anchored_corner(const Vector2d& at, const Vector2d& size, const TextStyle& style) {
  Vector2d shift(style.horizontal_anchor * size.x(), style.vertical_anchor * size.y());
  if (style.turned_left)
    shift = {-(style.vertical_anchor * size.y()), style.horizontal_anchor * size.x()};
  return (at - shift).array().round();
}

vtkSmartPointer<vtkLookupTable> lookup_table(const ColourScale& scale) {
  const auto table = vtkSmartPointer<vtkLookupTable>::New();
  table->SetNumberOfTableValues(static_cast<vtkIdType>(scale.colours.size()));
  table->SetTableRange(scale.low, scale.high);
  vtkIdType i = 0;
  for (const Colour& colour : scale.colours)
    table->SetTableValue(i++, colour.r, colour.g, colour.b);
  table->SetBelowRangeColor(scale.below.r, scale.below.g, scale.below.b, 1.0);
  table->SetAboveRangeColor(scale.above.r, scale.above.g, scale.above.b, 1.0);
  table->UseBelowRangeColorOn();
  table->UseAboveRangeColorOn();
  return table;
}

vtkSmartPointer<vtkActor> solid_actor(const Solid& solid) {
  const auto data = poly_data(solid.points);
  data->SetPolys(cells(solid.triangles.data(), solid.triangles.rows(), 3));
  // Normals are needed for shading only.
  if (solid.normals.rows() > 0 && solid.shade > 0.0) {
    vtkNew<vtkFloatArray> normals;
    normals->SetNumberOfComponents(3);
    normals->SetNumberOfTuples(solid.normals.rows());
    std::copy(solid.normals.data(), solid.normals.data() + solid.normals.size(),
              normals->GetPointer(0));
    data->GetPointData()->SetNormals(normals);
  }
  vtkNew<vtkPolyDataMapper> mapper;
  // Faces are moved back by one depth step, so that lines on them are not half hidden.
  mapper->SetResolveCoincidentTopologyToPolygonOffset();
  mapper->SetRelativeCoincidentTopologyPolygonOffsetParameters(1.0, 1.0);
  mapper->ScalarVisibilityOff();
  if (solid.values.size() > 0) {
    vtkNew<vtkDoubleArray> values;
    values->SetNumberOfValues(solid.values.size());
    std::copy(solid.values.data(), solid.values.data() + solid.values.size(),
              values->GetPointer(0));
    data->GetPointData()->SetScalars(values);
    mapper->SetLookupTable(lookup_table(solid.scale));
    mapper->UseLookupTableScalarRangeOn();
    // Values and not colours are interpolated: between blue and red is grey, never purple.
    mapper->InterpolateScalarsBeforeMappingOn();
    mapper->ScalarVisibilityOn();
  }
  mapper->SetInputData(data);
  auto result = vtkSmartPointer<vtkActor>::New();
  result->SetMapper(mapper);
  vtkProperty& property = *result->GetProperty();
  property.SetColor(solid.colour.r, solid.colour.g, solid.colour.b);
  property.SetOpacity(solid.opacity);
  // Without shading, every face has the exact colour of the colour bar.
  property.SetAmbient(1.0 - solid.shade);
  property.SetDiffuse(solid.shade);
  property.SetSpecular(0.0);
  if (solid.shade == 0.0) property.LightingOff();
  if (solid.normals.rows() == 0) property.SetInterpolationToFlat();
  return result;
}

/// The rendered samples of a picture.
struct SampledPicture {
  int width, height;                            // px
  int oversampling;                             // samples per pixel in each direction
  vtkSmartPointer<vtkUnsignedCharArray> bytes;  // three per sample, the bottom row first
};

/// Returns the picture whose pixels are the means of `oversampling` x `oversampling` samples.
Pixels average_samples(const SampledPicture& samples) {
  const auto& [width, height, oversampling, bytes] = samples;
  const unsigned char* const first_sample = bytes->GetPointer(0);
  Pixels pixels{width, height, {}};
  const std::size_t row = 3 * std::size_t(width),
                    supersampled_row = row * std::size_t(oversampling);
  pixels.rgb.reserve(row * std::size_t(height));
  std::vector<unsigned> sums(row);
  const auto samples_per_pixel = unsigned(oversampling * oversampling);
  for (int y = oversampling * height - 1; y >= 0;) {
    // Starting at half of the divisor rounds the mean to the nearest value.
    std::ranges::fill(sums, samples_per_pixel / 2);
    for (int k = 0; k < oversampling; ++k, --y) {
      const unsigned char* sample = first_sample + supersampled_row * std::size_t(y);
      for (std::size_t x = 0; x < row; x += 3)
        for (int j = 0; j < oversampling; ++j, sample += 3)
          for (std::size_t c = 0; c < 3; ++c) sums[x + c] += sample[c];
    }
    for (const unsigned sum : sums) pixels.rgb.push_back(char(sum / samples_per_pixel));
  }
  return pixels;
}

}  // namespace

void apply_style(const TextStyle& style, const std::string& text, vtkTextProperty& property) {
  const std::string file = font_file(text, style.bold);
  if (file.empty()) {
    property.SetFontFamilyToArial();
  } else {
    property.SetFontFamily(VTK_FONT_FILE);
    property.SetFontFile(file.c_str());
  }
  // The bold face is a font file of its own; VTK emboldens only its built-in font.
  property.SetFontSize(static_cast<int>(std::lround(style.size_px)));
  property.SetBold(style.bold && file.empty());
  property.SetColor(style.colour.r, style.colour.g, style.colour.b);
  property.SetOrientation(0.0);
}

struct Canvas::Sheet {
  std::unique_lock<std::recursive_mutex> lock{canvas_mutex};
  HeadlessContext context;
  int width;
  int height;
  int oversampling;
  vtkNew<vtkGenericOpenGLRenderWindow> window;
  vtkNew<FlatItem> flat;
  std::vector<FlatMark> marks;  ///< flat elements, for formats that keep them as vectors
  bool has_scene = false;

  Sheet(int width_px, int height_px, int samples_per_side);
  ~Sheet() { window->Finalize(); }
  SampledPicture draw();
};

Canvas::Sheet::Sheet(int width_px, int height_px, int samples_per_side)
    : width(width_px), height(height_px), oversampling(samples_per_side) {
  window->SetOwnContext(0);
  window->SetSize(oversampling * width, oversampling * height);
  window->SetDPI(oversampling * dots_per_inch);
  // The canvas averages samples itself; multisampling by a software driver is several times slower.
  window->SetMultiSamples(0);
  window->SetUseOffScreenBuffers(true);
  // The OpenGL context exists and is current, so VTK must not search for a display.
  window->SetShowWindow(false);
  window->SetReadyForRendering(true);
  window->SetSupportsOpenGL(1);
  window->SetIsDirect(1);
  window->SetIsCurrent(true);
  if (!window->InitializeFromCurrentContext()) {
    throw std::runtime_error("no picture can be drawn: VTK could not create an OpenGL context");
  }
  // Three layers: paper, scenes in space, flat elements in front.
  window->SetNumberOfLayers(3);
  vtkNew<vtkRenderer> paper;
  paper->SetBackground(1.0, 1.0, 1.0);
  window->AddRenderer(paper);

  vtkNew<vtkRenderer> front;
  front->SetLayer(2);
  vtkNew<vtkContextActor> solid_actor;
  solid_actor->GetScene()->AddItem(flat);
  solid_actor->GetScene()->SetRenderer(front);
  front->AddActor(solid_actor);
  window->AddRenderer(front);
}

Canvas::Canvas(int width, int height, int oversampling) {
  const auto is_valid_size = [](int size) { return size >= 64 && size <= max_side_px; };
  if (!is_valid_size(width) || !is_valid_size(height)) {
    throw std::invalid_argument("the width and height of a picture must be 64 to 16384 pixels");
  }
  if (oversampling < 1 || oversampling > 4)
    throw std::invalid_argument("supersampling must be 1 to 4 samples per direction");
  // The buffer of the samples is limited to longest_side as well.
  sheet_ = std::make_unique<Sheet>(width, height,
                                   std::min(oversampling, max_side_px / std::max(width, height)));
}

Canvas::~Canvas() = default;

Vector2d text_size(const std::string& text, const TextStyle& style) {
  const std::lock_guard<std::recursive_mutex> lock(canvas_mutex);
  vtkNew<vtkTextProperty> property;
  apply_style(style, text, *property);
  int box[4] = {0, -1, 0, -1};
  // Measured at the resolution of the samples, because letters end at whole samples.
  vtkTextRenderer::GetInstance()->GetBoundingBox(property, text, box,
                                                 supersampling * dots_per_inch);
  return Vector2d(box[1] - box[0] + 1.0, box[3] - box[2] + 1.0) / supersampling;
}

void Canvas::text(const Vector2d& at, const std::string& text, const TextStyle& style) {
  if (text.empty()) return;
  const Vector2d position = anchored_corner(at, text_size(text, style), style);
  sheet_->marks.emplace_back(FlatText{position, text, style});
  const Vector2d device_position = sheet_->oversampling * position;
  sheet_->flat->strokes.emplace_back([=](vtkContext2D& painter) {
    apply_style(style, text, *painter.GetTextProp());
    painter.GetTextProp()->SetOrientation(style.turned_left ? 90.0 : 0.0);
    painter.GetTextProp()->SetJustificationToLeft();
    painter.GetTextProp()->SetVerticalJustificationToBottom();
    painter.DrawString(static_cast<float>(device_position.x()),
                       static_cast<float>(device_position.y()), text);
  });
}

void Canvas::line(const std::vector<Vector2d>& points, const Colour& colour, double width_px) {
  // Each segment is filled as a rectangle, because wide lines of OpenGL differ between drivers.
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Vector2d d = points[i] - points[i - 1];
    if (!(d.norm() > 0.0)) continue;
    // Extending the rectangles by 0.3 of the width closes joints of up to about 60 degrees.
    const Vector2d along = d.normalized() * (points.size() > 2 ? 0.3 * width_px : 0.0);
    const Vector2d across = Vector2d(-d.y(), d.x()).normalized() * (0.5 * width_px);
    fill({points[i - 1] - along - across, points[i] + along - across, points[i] + along + across,
          points[i - 1] - along + across},
         colour);
  }
}

void Canvas::fill(const std::vector<Vector2d>& corners, const Colour& colour, double opacity) {
  sheet_->marks.emplace_back(FlatPolygon{corners, colour, opacity});
  std::vector<float> xy;
  for (const Vector2d& c : corners) {
    xy.push_back(static_cast<float>(sheet_->oversampling * c.x()));
    xy.push_back(static_cast<float>(sheet_->oversampling * c.y()));
  }
  sheet_->flat->strokes.emplace_back([=](vtkContext2D& painter) mutable {
    painter.GetPen()->SetLineType(vtkPen::NO_PEN);
    painter.GetBrush()->SetColor(to_byte(colour.r), to_byte(colour.g), to_byte(colour.b),
                                 to_byte(opacity));
    painter.DrawPolygon(xy.data(), static_cast<int>(xy.size() / 2));
  });
}

void Canvas::fill(const Rectangle& box, const Colour& colour, double opacity) {
  fill({{box.x, box.y},
        {box.x + box.width, box.y},
        {box.x + box.width, box.y + box.height},
        {box.x, box.y + box.height}},
       colour, opacity);
}

void Canvas::frame(const Rectangle& box, const Colour& colour, double width_px) {
  const double left = box.x;
  const double right = box.x + box.width;
  const double low = box.y;
  const double high = box.y + box.height;
  line({{left, low}, {right, low}, {right, high}, {left, high}, {left, low}}, colour, width_px);
}

vtkSmartPointer<vtkActor> wire_actor(const Wire& wire) {
  const auto data = poly_data(wire.points);
  static_assert(sizeof(std::array<int, 2>) == 2 * sizeof(int));
  const int* indices = wire.segments.empty() ? nullptr : wire.segments.front().data();
  data->SetLines(cells(indices, static_cast<Eigen::Index>(wire.segments.size()), 2));
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputData(data);
  mapper->ScalarVisibilityOff();
  auto result = vtkSmartPointer<vtkActor>::New();
  result->SetMapper(mapper);
  result->GetProperty()->SetColor(wire.colour.r, wire.colour.g, wire.colour.b);
  result->GetProperty()->SetLineWidth(static_cast<float>(wire.width_px));
  result->GetProperty()->LightingOff();
  return result;
}

void set_camera(vtkRenderer& scene, const View& view) {
  vtkCamera& camera = *scene.GetActiveCamera();
  // From a distance of twice the depth, the whole scene is between the clipping planes.
  const Eigen::Vector3d eye = view.centre + 2.0 * view.depth * view.toward_eye;
  camera.ParallelProjectionOn();
  camera.SetFocalPoint(view.centre.data());
  camera.SetPosition(eye.data());
  camera.SetViewUp(view.up.data());
  camera.SetParallelScale(0.5 * view.area.height * view.mm_per_px);
  camera.SetClippingRange(view.depth, 3.0 * view.depth);
}

void Canvas::add(vtkRenderer& scene, const View& view) {
  sheet_->has_scene = true;
  const Rectangle& area = view.area;
  scene.SetViewport(area.x / sheet_->width, area.y / sheet_->height,
                    (area.x + area.width) / sheet_->width, (area.y + area.height) / sheet_->height);
  scene.SetLayer(1);
  set_camera(scene, view);
  sheet_->window->AddRenderer(&scene);
}

void Canvas::scene(const View& view, const std::vector<Solid>& solids,
                   const std::vector<Wire>& wires) {
  vtkNew<vtkRenderer> renderer;
  for (const Solid& solid : solids) renderer->AddActor(solid_actor(solid));
  // Lines on a surface are moved towards the eye, so that the surface does not hide half of them.
  // In a parallel projection this does not change their position in the picture.
  const Eigen::Vector3d offset = 2.0 * view.mm_per_px * view.toward_eye;
  for (const Wire& wire : wires) {
    const auto lines = wire_actor(wire);
    lines->GetProperty()->SetLineWidth(float(sheet_->oversampling * wire.width_px));
    lines->SetPosition(offset.x(), offset.y(), offset.z());
    renderer->AddActor(lines);
  }
  add(*renderer, view);
}

void Canvas::clear_flat_elements() {
  sheet_->flat->strokes.clear();
  sheet_->marks.clear();
}

SampledPicture Canvas::Sheet::draw() {
  window->Render();
  const auto bytes = vtkSmartPointer<vtkUnsignedCharArray>::New();
  window->GetPixelData(0, 0, oversampling * width - 1, oversampling * height - 1, 0, bytes.Get(),
                       0);
  return {width, height, oversampling, bytes};
}

Pixels Canvas::pixels() { return average_samples(sheet_->draw()); }

void Canvas::write_png(const std::filesystem::path& path) { write(path, PictureFormat::Png); }

void Canvas::write(const std::filesystem::path& path, PictureFormat format) {
  const bool is_vector_format = format != PictureFormat::Png;
  // In SVG and PDF the flat elements are vectors, so the raster image contains scenes only.
  if (is_vector_format) sheet_->flat->strokes.clear();
  const int width = sheet_->width, height = sheet_->height;
  const std::vector<FlatMark> marks = std::move(sheet_->marks);
  std::optional<SampledPicture> samples;
  if (!is_vector_format || sheet_->has_scene) samples = sheet_->draw();
  // Releases the lock, so that the next canvas can be drawn while this one is compressed.
  sheet_.reset();
  Raster raster;
  if (samples) {
    const Pixels picture = average_samples(*samples);
    raster.png = png_file(picture);
    if (format == PictureFormat::Pdf) raster.rgb = picture.rgb;
  }
  std::unique_lock<std::recursive_mutex> lock(canvas_mutex, std::defer_lock);
  if (is_vector_format) lock.lock();  // the outlines of letters come from VTK's font cache
  write_bytes(path, format == PictureFormat::Png   ? raster.png
                    : format == PictureFormat::Svg ? svg_document(width, height, marks, raster)
                                                   : pdf_document(width, height, marks, raster));
}

namespace {

/// A segment of an outline, as in SVG: M move to a point, L line, C cubic curve, Z close.
struct PathSegment {
  char kind = 'M';
  std::array<Vector2d, 3> to;
};

/// Converts a text to outlines. VTK 9.1 drops non-ASCII characters unless it is called through its
/// older interface.
void outline_text(const std::string& text, vtkTextProperty& property, vtkPath& path) {
#if VTK_VERSION_NUMBER < VTK_VERSION_CHECK(9, 2, 0)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
  vtkTextRenderer::GetInstance()->StringToPath(&property, vtkUnicodeString::from_utf8(text), &path,
                                               dots_per_inch);
#pragma GCC diagnostic pop
#else
  vtkTextRenderer::GetInstance()->StringToPath(&property, text, &path, dots_per_inch);
#endif
}

/// Returns the outlines of the letters of a text, in px of the picture.
std::vector<PathSegment> outlines(const FlatText& text) {
  vtkNew<vtkTextProperty> property;
  apply_style(text.style, text.text, *property);
  property->SetJustificationToLeft();
  property->SetVerticalJustificationToBottom();
  vtkNew<vtkPath> path;
  outline_text(text.text, *property, *path);
  const auto position = [&](vtkIdType i) -> Vector2d {
    const double* p = path->GetPoints()->GetPoint(i);
    return text.style.turned_left ? text.at + Vector2d(-p[1], p[0])
                                  : text.at + Vector2d(p[0], p[1]);
  };
  std::vector<PathSegment> segments;
  Vector2d start(0.0, 0.0);
  const vtkIdType n = path->GetCodes()->GetNumberOfValues();
  for (vtkIdType i = 0; i < n;) {
    const int code = path->GetCodes()->GetValue(i);
    const Vector2d first = position(i);
    if (code == vtkPath::MOVE_TO) {
      if (!segments.empty()) segments.push_back({'Z', {}});
      segments.push_back({'M', {first, first, first}});
      start = first;
      i += 1;
    } else if (code == vtkPath::LINE_TO) {
      segments.push_back({'L', {first, first, first}});
      start = first;
      i += 1;
    } else if (code == vtkPath::CONIC_CURVE) {
      // As a cubic curve, whose control points lie two thirds of the way to the quadratic one.
      const Vector2d end = position(i + 1);
      segments.push_back(
          {'C', {start + (first - start) * (2.0 / 3.0), end + (first - end) * (2.0 / 3.0), end}});
      start = end;
      i += 2;
    } else {
      const Vector2d end = position(i + 2);
      segments.push_back({'C', {first, position(i + 1), end}});
      start = end;
      i += 3;
    }
  }
  if (!segments.empty()) segments.push_back({'Z', {}});
  return segments;
}

std::string base64(const std::string& bytes) {
  constexpr const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = (group << 8) | (i + k < bytes.size() ? std::uint8_t(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? digits[(group >> (18 - 6 * k)) & 63] : '=';
  }
  return text;
}

std::string hex_colour(const Colour& c) {
  const auto byte = [](double component) {
    return int(std::lround(255.0 * std::clamp(component, 0.0, 1.0)));
  };
  return fmt::format("#{:02x}{:02x}{:02x}", byte(c.r), byte(c.g), byte(c.b));
}

/// Returns the path of a flat element in SVG, whose y axis points downwards.
std::string svg_path(const FlatMark& mark, double height) {
  // Hundredths of a pixel; more digits would only make the file longer.
  const auto xy = [&](const Vector2d& p) {
    return fmt::format("{:.2f} {:.2f}", p.x(), height - p.y());
  };
  std::string path;
  if (const auto* polygon = std::get_if<FlatPolygon>(&mark)) {
    for (const Vector2d& anchored_corner : polygon->corners)
      path += (path.empty() ? "M" : "L") + xy(anchored_corner);
    return path + "Z";
  }
  for (const PathSegment& segment : outlines(std::get<FlatText>(mark))) {
    path += segment.kind;
    if (segment.kind == 'C') path += xy(segment.to[0]) + " " + xy(segment.to[1]) + " ";
    if (segment.kind != 'Z') path += xy(segment.to[2]);
  }
  return path;
}

std::string pdf_path(const FlatMark& mark) {
  const auto xy = [](const Vector2d& p) { return fmt::format("{:.2f} {:.2f} ", p.x(), p.y()); };
  std::string path;
  if (const auto* polygon = std::get_if<FlatPolygon>(&mark)) {
    for (const Vector2d& anchored_corner : polygon->corners)
      path += xy(anchored_corner) + (path.empty() ? "m " : "l ");
    return path + "h f\n";
  }
  for (const PathSegment& segment : outlines(std::get<FlatText>(mark))) {
    if (segment.kind == 'Z') path += "h ";
    if (segment.kind == 'C')
      path += xy(segment.to[0]) + xy(segment.to[1]) + xy(segment.to[2]) + "c ";
    if (segment.kind == 'M' || segment.kind == 'L')
      path += xy(segment.to[2]) + (segment.kind == 'M' ? "m " : "l ");
  }
  return path + "f\n";
}

struct Ink {
  Colour colour;
  double opacity;
};

/// Returns the colour and opacity of a flat element.
Ink mark_ink(const FlatMark& mark) {
  if (const auto* polygon = std::get_if<FlatPolygon>(&mark))
    return {polygon->colour, polygon->opacity};
  return {std::get<FlatText>(mark).style.colour, 1.0};
}

std::string deflate_bytes(const std::string& bytes) {
  uLongf size = compressBound(uLong(bytes.size()));
  std::string packed(size, '\0');
  if (compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                reinterpret_cast<const Bytef*>(bytes.data()), uLong(bytes.size()), 6) != Z_OK)
    throw std::runtime_error("a picture could not be compressed");
  packed.resize(size);
  return packed;
}

/// Returns a compressed stream object of PDF.
std::string pdf_stream(const std::string& entries, const std::string& bytes) {
  const std::string packed = deflate_bytes(bytes);
  return fmt::format("<< {}/Filter /FlateDecode /Length {} >>\nstream\n", entries, packed.size()) +
         packed + "\nendstream";
}

/// Returns a PDF file of the objects 1, 2 ... with the table of their offsets.
std::string pdf_file(const std::vector<std::string>& objects) {
  std::string file = "%PDF-1.5\n%\xE2\xE3\xCF\xD3\n";
  std::string table = fmt::format("xref\n0 {}\n0000000000 65535 f \n", objects.size() + 1);
  for (std::size_t i = 0; i < objects.size(); ++i) {
    table += fmt::format("{:010} 00000 n \n", file.size());
    file += fmt::format("{} 0 obj\n", i + 1) + objects[i] + "\nendobj\n";
  }
  return file + table +
         fmt::format("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n",
                     objects.size() + 1, file.size());
}

}  // namespace

std::string svg_document(int width, int height, const std::vector<FlatMark>& marks,
                         const Raster& behind) {
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" "
      "width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\">\n"
      "<rect width=\"{0}\" height=\"{1}\" fill=\"#ffffff\"/>\n",
      width, height);
  if (!behind.png.empty())
    svg += fmt::format("<image width=\"{}\" height=\"{}\" xlink:href=\"data:image/png;base64,",
                       width, height) +
           base64(behind.png) + "\"/>\n";
  for (const FlatMark& mark : marks) {
    const Ink ink = mark_ink(mark);
    const std::string opacity =
        ink.opacity < 1.0 ? fmt::format(" fill-opacity=\"{:.2f}\"", ink.opacity) : "";
    svg += fmt::format("<path fill=\"{}\"{} d=\"{}\"/>\n", hex_colour(ink.colour), opacity,
                       svg_path(mark, height));
  }
  return svg + "</svg>\n";
}

std::string pdf_document(int width, int height, const std::vector<FlatMark>& marks,
                         const Raster& behind) {
  constexpr double point_per_px = 0.5;  // 1600 px are then 28 cm
  std::string page = fmt::format("{0} 0 0 {0} 0 0 cm\n", point_per_px);
  if (!behind.rgb.empty()) page += fmt::format("q {} 0 0 {} 0 0 cm /Im Do Q\n", width, height);
  std::string states;
  // In PDF, opacity belongs to a graphics state; there are 21 states in steps of 5 %.
  for (int i = 0; i <= 20; ++i) states += fmt::format("/G{} << /ca {:.2f} >> ", i, i / 20.0);
  for (const FlatMark& mark : marks) {
    const Ink ink = mark_ink(mark);
    page += fmt::format("/G{} gs {:.4f} {:.4f} {:.4f} rg ", std::lround(20.0 * ink.opacity),
                        ink.colour.r, ink.colour.g, ink.colour.b) +
            pdf_path(mark);
  }
  std::vector<std::string> objects{
      "<< /Type /Catalog /Pages 2 0 R >>", "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
      fmt::format("<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:g} {:g}] /Contents 4 0 R "
                  "/Resources << /ExtGState << {}>> {}>> >>",
                  point_per_px * width, point_per_px * height, states,
                  behind.rgb.empty() ? "" : "/XObject << /Im 5 0 R >> "),
      pdf_stream("", page)};
  if (!behind.rgb.empty())
    objects.push_back(pdf_stream(
        fmt::format("/Type /XObject /Subtype /Image /Width {} /Height {} /ColorSpace /DeviceRGB "
                    "/BitsPerComponent 8 ",
                    width, height),
        behind.rgb));
  return pdf_file(objects);
}

}  // namespace abbe::render
