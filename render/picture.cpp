#include "render/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <vector>

#include <png.h>
#include <vtkColorTransferFunction.h>
#include <vtkNew.h>

#include "render/figures.h"

namespace abbe::render {

std::vector<Colour> diverging(int n) {
  vtkNew<vtkColorTransferFunction> scale;
  scale->SetColorSpaceToDiverging();
  scale->AddRGBPoint(-1.0, 0.230, 0.299, 0.754);
  scale->AddRGBPoint(1.0, 0.706, 0.016, 0.150);
  std::vector<Colour> table(n);
  for (int i = 0; i < n; ++i) {
    std::array<double, 3> rgb{};
    scale->GetColor(n > 1 ? -1.0 + 2.0 * i / (n - 1) : 0.0, rgb.data());
    table[i] = {rgb[0], rgb[1], rgb[2]};
  }
  return table;
}

namespace {

/// Interpolates linearly between colours at equal distances.
/// @param fraction  position between the first and the last colour, 0 .. 1
template <std::size_t n>
Colour interpolate(const std::array<Colour, n>& stops, double fraction) {
  const double position = std::clamp(fraction, 0.0, 1.0) * (n - 1);
  const std::size_t i = std::min(std::size_t(position), n - 2);
  const double t = position - double(i);
  const Colour &a = stops[i], &b = stops[i + 1];
  return {a.r + t * (b.r - a.r), a.g + t * (b.g - a.g), a.b + t * (b.b - a.b)};
}

constexpr Colour rgb(int code) {
  return {(code >> 16) / 255.0, ((code >> 8) & 255) / 255.0, (code & 255) / 255.0};
}

constexpr std::array cividis{rgb(0x00224e), rgb(0x123570), rgb(0x3b496c), rgb(0x575d6d),
                             rgb(0x707173), rgb(0x8a8678), rgb(0xa59c74), rgb(0xc3b369),
                             rgb(0xe1cc55), rgb(0xfee838)};
// The lightness falls evenly from that of the middle of the diverging scale to below its ends.
constexpr std::array reds{rgb(0xefece9), rgb(0xf2c5ac), rgb(0xe8926f),
                          rgb(0xcc5540), rgb(0xa01b26), rgb(0x6b0018)};
constexpr std::array blues{rgb(0xe9ecef), rgb(0xb6cdf2), rgb(0x85a6e4),
                           rgb(0x5579c9), rgb(0x2d4ba3), rgb(0x142066)};

}  // namespace

ColourScale colour_scale(double low, double high, Palette palette) {
  // With 1024 entries, adjacent colours differ by less than a screen can show.
  constexpr int entries = 1024;
  ColourScale scale{low, high, {}, colours::beyond_low, colours::beyond_high};
  if (palette == Palette::Cividis) {
    scale.below = {0.10, 0.60, 0.62};
    scale.above = {0.85, 0.20, 0.10};
  }
  const double end = std::max(std::abs(low), std::abs(high));
  const std::vector<Colour> diverging_colours = diverging(2 * entries - 1);
  for (int i = 0; i < entries; ++i) {
    const double fraction = i / (entries - 1.0), value = low + fraction * (high - low);
    // Relative to the farther end, so that equal magnitudes have equally strong colours.
    const auto index = std::size_t(std::lround((1.0 + value / end) * (entries - 1)));
    scale.colours.push_back(palette == Palette::Cividis ? interpolate(cividis, fraction)
                            : low >= 0.0                ? interpolate(reds, fraction)
                            : high <= 0.0               ? interpolate(blues, 1.0 - fraction)
                                                        : diverging_colours[index]);
  }
  return scale;
}

ColourScale tolerance_scale() {
  return {0.0, 1.0, {colours::in, colours::in}, colours::under, colours::over};
}

Colour series_colour(int index) {
  static constexpr std::array<Colour, series_colours> wheel{{{0.00, 0.27, 0.55},
                                                             {0.80, 0.30, 0.05},
                                                             {0.10, 0.52, 0.35},
                                                             {0.55, 0.25, 0.60},
                                                             {0.75, 0.55, 0.05},
                                                             {0.35, 0.36, 0.38}}};
  return wheel[index % wheel.size()];
}

unsigned char to_byte(double fraction) {
  return static_cast<unsigned char>(std::lround(255.0 * std::clamp(fraction, 0.0, 1.0)));
}

namespace {

using Eigen::Vector3d;

/// Returns the unit vector of `up` across the line of sight. If `up` is parallel to it, Y or X is
/// used instead.
Vector3d upward_direction(const Vector3d& toward_eye, const Vector3d& up) {
  for (const Vector3d& candidate : {up, Vector3d(Vector3d::UnitY()), Vector3d(Vector3d::UnitX())}) {
    const Vector3d projected_candidate = candidate - candidate.dot(toward_eye) * toward_eye;
    if (projected_candidate.norm() > 1e-6 * std::max(candidate.norm(), 1e-300))
      return projected_candidate.normalized();
  }
  return Vector3d::UnitZ();
}

}  // namespace

View fit_view(const cutting::Points& points, const Vector3d& from, const Vector3d& up,
              const Rectangle& area) {
  View view;
  view.area = area;
  view.toward_eye = from.norm() > 0.0 ? Vector3d(from.normalized()) : Vector3d(Vector3d::UnitZ());
  view.up = upward_direction(view.toward_eye, up);
  view.right = view.up.cross(view.toward_eye);
  if (points.rows() == 0) return view;

  Eigen::Matrix3d to_view;
  to_view << view.right.transpose(), view.up.transpose(), view.toward_eye.transpose();
  const cutting::Points view_points = points * to_view.transpose();
  const Vector3d lower = view_points.colwise().minCoeff();
  const Vector3d upper = view_points.colwise().maxCoeff();
  const Vector3d size = upper - lower;
  view.centre = to_view.transpose() * (0.5 * (lower + upper));
  constexpr double rim_px = 6.0;  // reserved for lines along the rim
  view.mm_per_px = std::max(size.x() / std::max(area.width - rim_px, 1.0),
                            size.y() / std::max(area.height - rim_px, 1.0));
  if (!(view.mm_per_px > 0.0)) view.mm_per_px = 1.0;
  view.depth = size.norm() + view.mm_per_px;
  return view;
}

double aspect(const cutting::Points& points, const Vector3d& from, const Vector3d& up) {
  // The scales at which the points fit into a width, and a height, of one pixel.
  const double width = fit_view(points, from, up, {0, 0, 1.0, 1e12}).mm_per_px;
  const double height = fit_view(points, from, up, {0, 0, 1e12, 1.0}).mm_per_px;
  return height / width;
}

Eigen::Vector2d project(const View& view, const Vector3d& p) {
  const Vector3d d = (p - view.centre) / view.mm_per_px;
  return {view.area.x + 0.5 * view.area.width + d.dot(view.right),
          view.area.y + 0.5 * view.area.height + d.dot(view.up)};
}

std::string view_description(const View& view) {
  constexpr std::array<const char*, 3> positive{"+X", "+Y", "+Z"};
  constexpr std::array<const char*, 3> negative{"−X", "−Y", "−Z"};
  for (int i = 0; i < 3; ++i) {
    if (std::abs(view.toward_eye[i]) > 1.0 - 1e-9) {
      return std::string("from ") + (view.toward_eye[i] > 0.0 ? positive[i] : negative[i]);
    }
  }
  return "from (" + fixed(view.toward_eye.x(), 2) + ", " + fixed(view.toward_eye.y(), 2) + ", " +
         fixed(view.toward_eye.z(), 2) + ")";
}

namespace {

// The palette has colours in steps of 8. There are 33 levels; the last one, 256, stands for 255.
constexpr int step = 8, levels = 33, colour_count = levels * levels * levels;

using Rgb = std::array<int, 3>;

/// Returns the colour with an index in 0 .. colour_count - 1.
Rgb indexed_colour(int index) {
  const auto value = [](int levels_up) { return std::min(step * levels_up, 255); };
  return {value(index / levels / levels), value(index / levels % levels), value(index % levels)};
}

/// Returns the index of the colour of every pixel.
std::vector<int> rounded_colours(const Pixels& pixels) {
  std::vector<int> colours(pixels.rgb.size() / 3, 0);
  for (std::size_t i = 0; i < pixels.rgb.size(); ++i) {
    const int value = static_cast<unsigned char>(pixels.rgb[i]);
    colours[i / 3] = colours[i / 3] * levels + (value + step / 2) / step;
  }
  return colours;
}

/// Returns the squared distance of two colours.
int squared_distance(int index_a, int index_b) {
  const Rgb a = indexed_colour(index_a), b = indexed_colour(index_b);
  int sum = 0;
  for (std::size_t k = 0; k < 3; ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
  return sum;
}

/// Returns at most 256 colours: the most frequent ones, then repeatedly the one that is farthest
/// from all previous ones, so that rare but distinct colours are included.
std::vector<int> select_palette(const std::vector<int>& colours) {
  // The most frequent colours take three quarters of the palette.
  constexpr std::size_t max_colours = 256, frequent_colours = 192;
  std::vector<std::size_t> count(colour_count, 0);
  for (const int colour : colours) ++count[std::size_t(colour)];
  std::vector<int> palette;
  for (int colour = 0; colour < colour_count; ++colour)
    if (count[std::size_t(colour)] > 0) palette.push_back(colour);
  std::ranges::stable_sort(palette, std::greater{},
                           [&](int colour) { return count[std::size_t(colour)]; });
  if (palette.size() <= max_colours) return palette;
  std::vector<int> candidates(palette.begin() + frequent_colours, palette.end());
  palette.resize(frequent_colours);
  // Squared distance of each candidate to the nearest of the first `compared` colours.
  std::vector<int> distances(candidates.size(), std::numeric_limits<int>::max());
  std::size_t compared = 0;
  while (palette.size() < max_colours) {
    for (; compared < palette.size(); ++compared)
      for (std::size_t i = 0; i < candidates.size(); ++i)
        distances[i] = std::min(distances[i], squared_distance(candidates[i], palette[compared]));
    palette.push_back(
        candidates[std::size_t(std::ranges::max_element(distances) - distances.begin())]);
  }
  return palette;
}

/// Returns the index of the nearest colour in the palette.
std::size_t nearest_index(const std::vector<int>& palette, int colour) {
  const auto distance_to = [&](int other) { return squared_distance(colour, other); };
  return std::size_t(std::ranges::min_element(palette, {}, distance_to) - palette.begin());
}

/// Returns the index in the palette of every pixel.
std::string palette_indices(const std::vector<int>& colours, const std::vector<int>& palette) {
  std::vector<int> palette_index(colour_count, -1);  // of each colour; -1: not yet known
  std::string indices;
  for (const int colour : colours) {
    int& index = palette_index[std::size_t(colour)];
    if (index < 0) index = int(nearest_index(palette, colour));
    indices.push_back(char(index));
  }
  return indices;
}

/// Returns the three bytes of every colour.
std::string colour_bytes(const std::vector<int>& palette) {
  std::string bytes;
  for (const int colour : palette)
    for (const int value : indexed_colour(colour)) bytes.push_back(char(value));
  return bytes;
}

/// Returns the bytes of a PNG file of `image`.
std::string compress(png_image image, const std::string& pixels, const std::string& palette) {
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string file(size, '\0');
  if (png_image_write_to_memory(&image, file.data(), &size, 0, pixels.data(), 0, palette.data()) ==
      0)
    throw std::runtime_error(std::string("a picture could not be compressed: ") + image.message);
  file.resize(size);
  file.shrink_to_fit();
  return file;
}

}  // namespace

std::string png_file(const Pixels& pixels, PngPurpose png_purpose) {
  if (pixels.width < 1 || pixels.height < 1 ||
      pixels.rgb.size() != 3 * std::size_t(pixels.width) * std::size_t(pixels.height))
    throw std::invalid_argument("a picture with three bytes per pixel");
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = png_uint_32(pixels.width);
  image.height = png_uint_32(pixels.height);
  if (png_purpose == PngPurpose::Speed) {
    image.format = PNG_FORMAT_RGB;
    // A fifth of the time of the default compression, for up to two fifths more bytes.
    image.flags = PNG_IMAGE_FLAG_FAST;
    return compress(image, pixels.rgb, {});
  }
  const std::vector<int> colours = rounded_colours(pixels), palette = select_palette(colours);
  image.format = PNG_FORMAT_RGB_COLORMAP;
  image.colormap_entries = png_uint_32(palette.size());
  return compress(image, palette_indices(colours, palette), colour_bytes(palette));
}

}  // namespace abbe::render
