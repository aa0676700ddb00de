#include "render/canvas.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include <cairo-ft.h>
#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <fontconfig/fontconfig.h>
#include <vtkActor.h>
#include <vtkCamera.h>
#include <vtkCellArray.h>
#include <vtkDoubleArray.h>
#include <vtkFloatArray.h>
#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkLookupTable.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderer.h>
#include <vtkSmartPointer.h>
#include <vtkUnsignedCharArray.h>

#include "kinematics/units.h"
#include "render/vtk_environment.h"
#include "render/vtk_writer.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;

template <auto release>
struct Release {
  void operator()(auto* handle) const { release(handle); }
};
using CairoSurface = std::unique_ptr<cairo_surface_t, Release<cairo_surface_destroy>>;
using CairoPen = std::unique_ptr<cairo_t, Release<cairo_destroy>>;
using CairoFace = std::unique_ptr<cairo_font_face_t, Release<cairo_font_face_destroy>>;
using CairoFont = std::unique_ptr<cairo_scaled_font_t, Release<cairo_scaled_font_destroy>>;

void require_success(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw std::runtime_error(std::string("no picture can be drawn: ") +
                             cairo_status_to_string(status));
}

/// Files of a font in Debian, and its package.
struct FontFiles {
  const char* regular;
  const char* bold;
  const char* package;
};

constexpr FontFiles western{"/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
                            "/usr/share/fonts/truetype/dejavu/DejaVuSans-Bold.ttf",
                            "fonts-dejavu-core"};
// This font has no bold face.
constexpr FontFiles eastern{"/usr/share/fonts/truetype/wqy/wqy-microhei.ttc",
                            "/usr/share/fonts/truetype/wqy/wqy-microhei.ttc", "fonts-wqy-microhei"};

/// Returns true if a text contains Chinese, Japanese or Korean characters (U+2E80 to U+D7FF and the
/// wide forms). The first two bytes in UTF-8 suffice to recognise them.
bool is_eastern(const std::string& text) {
  for (std::size_t i = 0; i + 1 < text.size(); ++i) {
    const auto first = static_cast<std::uint8_t>(text[i]);
    const auto second = static_cast<std::uint8_t>(text[i + 1]);
    if ((first == 0xE2 && second >= 0xBA) || (first >= 0xE3 && first <= 0xED) ||
        (first == 0xEF && second >= 0xA4) || (first == 0xF0 && second >= 0xA0))
      return true;
  }
  return false;
}

const FontFiles& font_files(const std::string& text) {
  return is_eastern(text) ? eastern : western;
}

bool is_installed(const char* file) {
  std::error_code error_code;
  return std::filesystem::is_regular_file(file, error_code);
}

// A named file gives the same letters whatever fonts fontconfig prefers on this machine.
CairoFace font_face(const std::string& text, bool bold) {
  const char* file = bold ? font_files(text).bold : font_files(text).regular;
  if (!is_installed(file))
    return CairoFace(
        cairo_toy_font_face_create("sans-serif", CAIRO_FONT_SLANT_NORMAL,
                                   bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL));
  FcPattern* pattern =
      FcPatternBuild(nullptr, FC_FILE, FcTypeString, file, FC_INDEX, FcTypeInteger, 0, nullptr);
  CairoFace face(cairo_ft_font_face_create_for_pattern(pattern));
  FcPatternDestroy(pattern);
  return face;
}

std::mutex font_mutex;  // FreeType reads a font file in one thread at a time

CairoFont scaled_font(const std::string& text, const TextStyle& style) {
  cairo_matrix_t size, identity;
  cairo_matrix_init_scale(&size, style.size_px, style.size_px);
  cairo_matrix_init_identity(&identity);
  cairo_font_options_t* options = cairo_font_options_create();
  // Without hinting a text has the same shape and width in every format and at every scale.
  cairo_font_options_set_hint_style(options, CAIRO_HINT_STYLE_NONE);
  cairo_font_options_set_hint_metrics(options, CAIRO_HINT_METRICS_OFF);
  CairoFont font(
      cairo_scaled_font_create(font_face(text, style.bold).get(), &size, &identity, options));
  cairo_font_options_destroy(options);
  return font;
}

cairo_text_extents_t text_extents(const CairoFont& font, const char* text) {
  cairo_text_extents_t extents;
  cairo_scaled_font_text_extents(font.get(), text, &extents);
  return extents;
}

// Every text is as high as these letters, so that texts side by side have the same baseline.
constexpr const char* tallest_letters = "_/7Agfy";

/// Returns the distance of the baseline of a text from its lower edge, px.
double descent(const std::string& text, const TextStyle& style) {
  const std::lock_guard lock(font_mutex);
  const cairo_text_extents_t line = text_extents(scaled_font(text, style), tallest_letters);
  return line.y_bearing + line.height;
}

/// Returns the point where the first letter of a text stands. It is rounded to whole pixels,
/// because letters on a baseline between pixels are blurred.
Vector2d text_start(const Vector2d& at, const std::string& text, const TextStyle& style) {
  const Vector2d size = text_size(text, style);
  Vector2d shift(style.horizontal_anchor * size.x(),
                 style.vertical_anchor * size.y() - descent(text, style));
  if (style.turned_left) shift = {-shift.y(), shift.x()};
  return (at - shift).array().round();
}

// Rounded to the bytes that VTK gives the same colour in a scene.
void set_colour(cairo_t* pen, const Colour& colour, double opacity = 1.0) {
  cairo_set_source_rgba(pen, to_byte(colour.r) / 255.0, to_byte(colour.g) / 255.0,
                        to_byte(colour.b) / 255.0, opacity);
}

void trace(cairo_t* pen, const std::vector<Vector2d>& points) {
  for (const Vector2d& point : points) cairo_line_to(pen, point.x(), point.y());
  if (points.size() > 2 && points.front() == points.back()) cairo_close_path(pen);
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

/// The OpenGL window of the scenes of a canvas.
struct SceneWindow {
  std::unique_lock<std::mutex> lock;  ///< of the only window of the process
  HeadlessContext context;
  vtkNew<vtkGenericOpenGLRenderWindow> window;

  /// @param width, height  samples
  SceneWindow(int width, int height);
  ~SceneWindow() { window->Finalize(); }
};

std::mutex window_mutex;  // VTK has one OpenGL state per process

SceneWindow::SceneWindow(int width, int height) : lock(window_mutex) {
  window->SetOwnContext(0);
  window->SetSize(width, height);
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
  // Two layers: paper and, in front of it, scenes in space.
  window->SetNumberOfLayers(2);
  vtkNew<vtkRenderer> paper;
  paper->SetBackground(1.0, 1.0, 1.0);
  window->AddRenderer(paper);
}

CairoSurface image_surface(int width, int height) {
  CairoSurface image(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height));
  require_success(cairo_surface_status(image.get()));
  return image;
}

/// Returns the pixels of a row of an image, as 0x00RRGGBB.
std::uint32_t* image_row(const CairoSurface& image, int y) {
  return reinterpret_cast<std::uint32_t*>(cairo_image_surface_get_data(image.get()) +
                                          std::ptrdiff_t(y) *
                                              cairo_image_surface_get_stride(image.get()));
}

}  // namespace

struct Canvas::Sheet {
  int width;         ///< px
  int height;        ///< px
  int oversampling;  ///< samples of the scenes per pixel in each direction
  std::vector<std::function<void(cairo_t*)>> elements;  ///< flat ones; each draws itself
  std::unique_ptr<SceneWindow> scenes;                  ///< null without any

  CairoSurface scene_image() const;
  void draw(cairo_surface_t* target, double unit, const CairoSurface& behind) const;
  Pixels pixels(const CairoSurface& behind) const;
  std::string vector_file(PictureFormat format, const CairoSurface& behind) const;
};

/// Returns the scenes as drawn so far; null if there are none. A pixel is the mean of its samples.
CairoSurface Canvas::Sheet::scene_image() const {
  if (!scenes) return nullptr;
  scenes->window->Render();
  vtkNew<vtkUnsignedCharArray> bytes;
  scenes->window->GetPixelData(0, 0, oversampling * width - 1, oversampling * height - 1, 0, bytes,
                               0);
  const unsigned char* sample = bytes->GetPointer(0);
  CairoSurface image = image_surface(width, height);
  std::vector<unsigned> sums(3 * std::size_t(width));
  const auto samples_per_pixel = unsigned(oversampling * oversampling);
  for (int y = height - 1; y >= 0; --y) {  // VTK's first row is the lowest
    // Starting at half of the divisor rounds the mean to the nearest value.
    std::ranges::fill(sums, samples_per_pixel / 2);
    for (int k = 0; k < oversampling; ++k)
      for (std::size_t x = 0; x < sums.size(); x += 3)
        for (int j = 0; j < oversampling; ++j, sample += 3)
          for (std::size_t c = 0; c < 3; ++c) sums[x + c] += sample[c];
    std::uint32_t* pixel = image_row(image, y);
    for (std::size_t x = 0; x < sums.size(); x += 3)
      *pixel++ = sums[x] / samples_per_pixel << 16 | sums[x + 1] / samples_per_pixel << 8 |
                 sums[x + 2] / samples_per_pixel;
  }
  cairo_surface_mark_dirty(image.get());
  return image;
}

/// Draws the picture on a surface of Cairo.
/// @param unit    length of a pixel in units of the surface
/// @param behind  image behind the flat elements, or null
void Canvas::Sheet::draw(cairo_surface_t* target, double unit, const CairoSurface& behind) const {
  const CairoPen pen(cairo_create(target));
  cairo_scale(pen.get(), unit, unit);
  set_colour(pen.get(), colours::white);
  cairo_paint(pen.get());
  if (behind) {
    cairo_set_source_surface(pen.get(), behind.get(), 0.0, 0.0);
    cairo_paint(pen.get());
  }
  // The y axis of a canvas points upwards, that of Cairo downwards.
  cairo_translate(pen.get(), 0.0, height);
  cairo_scale(pen.get(), 1.0, -1.0);
  // Miters of sharp corners would be longer than the line is wide.
  cairo_set_line_join(pen.get(), CAIRO_LINE_JOIN_ROUND);
  for (const auto& element : elements) element(pen.get());
  require_success(cairo_status(pen.get()));
}

Pixels Canvas::Sheet::pixels(const CairoSurface& behind) const {
  const CairoSurface image = image_surface(width, height);
  draw(image.get(), 1.0, behind);
  cairo_surface_flush(image.get());
  Pixels pixels{width, height, {}};
  pixels.rgb.reserve(3 * std::size_t(width) * std::size_t(height));
  for (int y = 0; y < height; ++y) {
    const std::uint32_t* row = image_row(image, y);
    for (int x = 0; x < width; ++x)
      for (const int shift : {16, 8, 0}) pixels.rgb.push_back(char(row[x] >> shift & 0xFFu));
  }
  return pixels;
}

/// Returns the bytes of an SVG or PDF file.
std::string Canvas::Sheet::vector_file(PictureFormat format, const CairoSurface& behind) const {
  const bool is_pdf = format == PictureFormat::Pdf;
  const double unit = is_pdf ? 0.5 : 1.0;  // 1600 px are 800 points of PDF, i.e. 28 cm
  std::string file;
  const cairo_write_func_t append = [](void* target, const unsigned char* bytes, unsigned size) {
    static_cast<std::string*>(target)->append(reinterpret_cast<const char*>(bytes), size);
    return CAIRO_STATUS_SUCCESS;
  };
  const CairoSurface surface(
      (is_pdf ? cairo_pdf_surface_create_for_stream : cairo_svg_surface_create_for_stream)(
          append, &file, unit * width, unit * height));
  // The time of writing would make equal pictures differ.
  if (is_pdf)
    cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATE_DATE,
                                   "1980-01-01T00:00:00Z");
  else
    cairo_svg_surface_set_document_unit(surface.get(), CAIRO_SVG_UNIT_PX);
  draw(surface.get(), unit, behind);
  cairo_surface_finish(surface.get());
  require_success(cairo_surface_status(surface.get()));
  if (is_pdf) return file;
  // The names of the image and of the page end in a number that counts all surfaces of the process;
  // without it, equal pictures have the same bytes.
  for (const std::string name : {"\"image", "\"#image", "\"surface", "\"source-", "\"#source-"})
    for (std::size_t at = 0; (at = file.find(name, at)) != std::string::npos;) {
      at += name.size();
      file.erase(at, file.find('"', at) - at);
    }
  return file;
}

Canvas::Canvas(int width, int height, int oversampling) {
  const auto is_valid_size = [](int size) { return size >= 64 && size <= max_side_px; };
  if (!is_valid_size(width) || !is_valid_size(height)) {
    throw std::invalid_argument("the width and height of a picture must be 64 to 16384 pixels");
  }
  if (oversampling < 1 || oversampling > 4)
    throw std::invalid_argument("supersampling must be 1 to 4 samples per direction");
  // The buffer of the samples is limited to max_side_px as well.
  sheet_ = std::make_unique<Sheet>(
      Sheet{width, height, std::min(oversampling, max_side_px / std::max(width, height)), {}, {}});
}

Canvas::~Canvas() = default;

Vector2d text_size(const std::string& text, const TextStyle& style) {
  const std::lock_guard lock(font_mutex);
  const CairoFont font = scaled_font(text, style);
  return {text_extents(font, text.c_str()).x_advance, text_extents(font, tallest_letters).height};
}

std::string missing_font_package(const std::string& text) {
  const FontFiles& font = font_files(text);
  return is_installed(font.regular) && is_installed(font.bold) ? "" : font.package;
}

void Canvas::text(const Vector2d& at, const std::string& text, const TextStyle& style) {
  if (text.empty()) return;
  const Vector2d start = text_start(at, text, style);
  sheet_->elements.emplace_back([=](cairo_t* pen) {
    const std::lock_guard lock(font_mutex);
    cairo_save(pen);
    cairo_translate(pen, start.x(), start.y());
    if (style.turned_left) cairo_rotate(pen, 0.5 * pi);
    cairo_scale(pen, 1.0, -1.0);
    cairo_set_scaled_font(pen, scaled_font(text, style).get());
    cairo_move_to(pen, 0.0, 0.0);
    // As outlines, letters stand between pixels where they belong, and files need no fonts.
    cairo_text_path(pen, text.c_str());
    set_colour(pen, style.colour);
    cairo_fill(pen);
    cairo_restore(pen);
  });
}

void Canvas::line(const std::vector<Vector2d>& points, const Colour& colour, double width_px,
                  const std::vector<double>& dashes_px) {
  sheet_->elements.emplace_back([=](cairo_t* pen) {
    trace(pen, points);
    set_colour(pen, colour);
    cairo_set_line_width(pen, width_px);
    cairo_set_dash(pen, dashes_px.data(), int(dashes_px.size()), 0.0);
    cairo_stroke(pen);
  });
}

void Canvas::fill(const std::vector<Vector2d>& corners, const Colour& colour, double opacity) {
  sheet_->elements.emplace_back([=](cairo_t* pen) {
    trace(pen, corners);
    set_colour(pen, colour, opacity);
    cairo_fill(pen);
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
  Sheet& sheet = *sheet_;
  if (!sheet.scenes)
    sheet.scenes = std::make_unique<SceneWindow>(sheet.oversampling * sheet.width,
                                                 sheet.oversampling * sheet.height);
  const Rectangle& area = view.area;
  scene.SetViewport(area.x / sheet.width, area.y / sheet.height,
                    (area.x + area.width) / sheet.width, (area.y + area.height) / sheet.height);
  scene.SetLayer(1);
  set_camera(scene, view);
  sheet.scenes->window->AddRenderer(&scene);
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

void Canvas::clear_flat_elements() { sheet_->elements.clear(); }

Pixels Canvas::pixels() { return sheet_->pixels(sheet_->scene_image()); }

void Canvas::write_png(const std::filesystem::path& path) { write(path, PictureFormat::Png); }

void Canvas::write(const std::filesystem::path& path, PictureFormat format) {
  const CairoSurface behind = sheet_->scene_image();
  // Releases the lock, so that the next scenes can be drawn while this picture is written.
  sheet_->scenes.reset();
  write_bytes(path, format == PictureFormat::Png ? png_file(sheet_->pixels(behind))
                                                 : sheet_->vector_file(format, behind));
}

}  // namespace abbe::render
