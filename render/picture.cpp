#include "render/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <vector>

#include <vtkColorTransferFunction.h>
#include <vtkNew.h>
#include <zlib.h>

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

/// Interpolates between colours at equal distances, `part` in 0 .. 1.
template <std::size_t n>
Colour between(const std::array<Colour, n>& stops, double part) {
  const double at = std::clamp(part, 0.0, 1.0) * (n - 1);
  const std::size_t i = std::min(std::size_t(at), n - 2);
  const double t = at - double(i);
  const Colour &a = stops[i], &b = stops[i + 1];
  return {a.r + t * (b.r - a.r), a.g + t * (b.g - a.g), a.b + t * (b.b - a.b)};
}

constexpr Colour rgb(int code) {
  return {(code >> 16) / 255.0, ((code >> 8) & 255) / 255.0, (code & 255) / 255.0};
}

constexpr std::array cividis{rgb(0x00224e), rgb(0x123570), rgb(0x3b496c), rgb(0x575d6d),
                             rgb(0x707173), rgb(0x8a8678), rgb(0xa59c74), rgb(0xc3b369),
                             rgb(0xe1cc55), rgb(0xfee838)};
// The lightness falls evenly from that of the middle of the diverging scale to below that of its
// ends.
constexpr std::array reds{rgb(0xefece9), rgb(0xf2c5ac), rgb(0xe8926f),
                          rgb(0xcc5540), rgb(0xa01b26), rgb(0x6b0018)};
constexpr std::array blues{rgb(0xe9ecef), rgb(0xb6cdf2), rgb(0x85a6e4),
                           rgb(0x5579c9), rgb(0x2d4ba3), rgb(0x142066)};

}  // namespace

ColourScale colour_scale(double low, double high, Palette palette) {
  // 1024 entries: neighbouring colours differ by less than a screen can show.
  constexpr int entries = 1024;
  ColourScale scale{low, high, {}, colours::beyond_low, colours::beyond_high};
  if (palette == Palette::Cividis) {
    scale.below = {0.10, 0.60, 0.62};
    scale.above = {0.85, 0.20, 0.10};
  }
  const double end = std::max(std::abs(low), std::abs(high));
  const std::vector<Colour> diverging_colours = diverging(2 * entries - 1);
  for (int i = 0; i < entries; ++i) {
    const double part = i / (entries - 1.0), value = low + part * (high - low);
    // The farther end determines the colour, so that equal magnitudes have equal strength on both
    // sides.
    const auto place = std::size_t(std::lround((1.0 + value / end) * (entries - 1)));
    scale.colours.push_back(palette == Palette::Cividis ? between(cividis, part)
                            : low >= 0.0                ? between(reds, part)
                            : high <= 0.0               ? between(blues, 1.0 - part)
                                                        : diverging_colours[place]);
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

unsigned char to_byte(double share) {
  return static_cast<unsigned char>(std::lround(255.0 * std::clamp(share, 0.0, 1.0)));
}

namespace {

using Eigen::Vector3d;

/// Returns the component of `up` across the line of sight, or of the first axis that is not
/// parallel to it.
Vector3d upward(const Vector3d& toward, const Vector3d& up) {
  for (const Vector3d& wanted : {up, Vector3d(Vector3d::UnitY()), Vector3d(Vector3d::UnitX())}) {
    const Vector3d across = wanted - wanted.dot(toward) * toward;
    if (across.norm() > 1e-6 * std::max(wanted.norm(), 1e-300)) return across.normalized();
  }
  return Vector3d::UnitZ();
}

}  // namespace

View fit_view(const cutting::Points& points, const Vector3d& from, const Vector3d& up,
              const Rectangle& area) {
  View view;
  view.area = area;
  view.toward = from.norm() > 0.0 ? Vector3d(from.normalized()) : Vector3d(Vector3d::UnitZ());
  view.up = upward(view.toward, up);
  view.right = view.up.cross(view.toward);
  if (points.rows() == 0) return view;

  Eigen::Matrix3d to_view;
  to_view << view.right.transpose(), view.up.transpose(), view.toward.transpose();
  const cutting::Points seen = points * to_view.transpose();
  const Vector3d lower = seen.colwise().minCoeff();
  const Vector3d upper = seen.colwise().maxCoeff();
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
  // Scales that fit a width, and a height, of one pixel.
  const double width = fit_view(points, from, up, {0, 0, 1.0, 1e12}).mm_per_px;
  const double height = fit_view(points, from, up, {0, 0, 1e12, 1.0}).mm_per_px;
  return height / width;
}

Eigen::Vector2d projected(const View& view, const Vector3d& p) {
  const Vector3d d = (p - view.centre) / view.mm_per_px;
  return {view.area.x + 0.5 * view.area.width + d.dot(view.right),
          view.area.y + 0.5 * view.area.height + d.dot(view.up)};
}

std::string view_description(const View& view) {
  constexpr std::array<const char*, 3> positive{"+X", "+Y", "+Z"};
  constexpr std::array<const char*, 3> negative{"−X", "−Y", "−Z"};
  for (int i = 0; i < 3; ++i) {
    if (std::abs(view.toward[i]) > 1.0 - 1e-9) {
      return std::string("from ") + (view.toward[i] > 0.0 ? positive[i] : negative[i]);
    }
  }
  return "from (" + fixed(view.toward.x(), 2) + ", " + fixed(view.toward.y(), 2) + ", " +
         fixed(view.toward.z(), 2) + ")";
}

namespace {

void append_number(std::string& bytes, std::uint32_t number) {
  for (const int shift : {24, 16, 8, 0}) bytes.push_back(char(number >> shift & 0xFFu));
}

void append_chunk(std::string& file, std::string_view kind, std::string_view data) {
  append_number(file, std::uint32_t(data.size()));
  const std::size_t start = file.size();
  file.append(kind).append(data);
  const auto* begin = reinterpret_cast<const Bytef*>(file.data() + start);
  append_number(file, std::uint32_t(crc32_z(0, begin, file.size() - start)));
}

/// Returns the rows as differences from the row above (PNG filter 2): in most drawings these are
/// mostly zero.
std::string filtered_rows(const Pixels& pixels) {
  constexpr char up = 2;
  const std::size_t row = 3 * std::size_t(pixels.width);
  std::string rows;
  rows.resize((row + 1) * std::size_t(pixels.height));
  const char* from = pixels.rgb.data();
  char* to = rows.data();
  for (int y = 0; y < pixels.height; ++y, from += row) {
    *to++ = up;
    for (std::size_t i = 0; i < row; ++i) {
      const char above = y > 0 ? *(from + i - row) : char(0);
      *to++ = char(static_cast<unsigned char>(from[i]) - static_cast<unsigned char>(above));
    }
  }
  return rows;
}

std::string compressed(const std::string& bytes, int level) {
  uLongf size = compressBound(uLong(bytes.size()));
  std::string packed(size, '\0');
  const int state =
      compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                reinterpret_cast<const Bytef*>(bytes.data()), uLong(bytes.size()), level);
  if (state != Z_OK) throw std::runtime_error("a picture could not be compressed");
  packed.resize(size);
  return packed;
}

// Colours in steps of 8: 32 steps up to 256, which stands for 255 of white.
constexpr int step = 8, steps = 33, colour_count = steps * steps * steps;

using Rgb = std::array<int, 3>;

Rgb colour_of(int number) {
  const auto value = [](int levels_up) { return std::min(step * levels_up, 255); };
  return {value(number / steps / steps), value(number / steps % steps), value(number % steps)};
}

/// Returns the index of every pixel's colour.
std::vector<int> rounded_colours(const Pixels& pixels) {
  std::vector<int> colours(pixels.rgb.size() / 3, 0);
  for (std::size_t i = 0; i < pixels.rgb.size(); ++i) {
    const int value = static_cast<unsigned char>(pixels.rgb[i]);
    colours[i / 3] = colours[i / 3] * steps + (value + step / 2) / step;
  }
  return colours;
}

int distance(int number_a, int number_b) {
  const Rgb a = colour_of(number_a), b = colour_of(number_b);
  int sum = 0;
  for (std::size_t k = 0; k < 3; ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
  return sum;
}

/// Returns at most 256 colours: the most frequent, then repeatedly the one that is farthest from
/// all previous ones, so that a rare but distinct colour is kept.
std::vector<int> palette_of(const std::vector<int>& colours) {
  // 192 by frequency leave a quarter of the palette for rare colours.
  constexpr std::size_t most = 256, by_count = 192;
  std::vector<std::size_t> count(colour_count, 0);
  for (const int colour : colours) ++count[std::size_t(colour)];
  std::vector<int> palette;
  for (int colour = 0; colour < colour_count; ++colour)
    if (count[std::size_t(colour)] > 0) palette.push_back(colour);
  std::ranges::stable_sort(palette, std::greater{},
                           [&](int colour) { return count[std::size_t(colour)]; });
  if (palette.size() <= most) return palette;
  std::vector<int> left(palette.begin() + by_count, palette.end());
  palette.resize(by_count);
  std::vector<int> far(left.size(), std::numeric_limits<int>::max());
  std::size_t looked_at = 0;
  while (palette.size() < most) {
    for (; looked_at < palette.size(); ++looked_at)
      for (std::size_t i = 0; i < left.size(); ++i)
        far[i] = std::min(far[i], distance(left[i], palette[looked_at]));
    palette.push_back(left[std::size_t(std::ranges::max_element(far) - far.begin())]);
  }
  return palette;
}

/// Returns the index of the nearest colour of the palette.
std::size_t nearest(const std::vector<int>& palette, int colour) {
  const auto far = [&](int other) { return distance(colour, other); };
  return std::size_t(std::ranges::min_element(palette, {}, far) - palette.begin());
}

/// Returns rows of palette indices, unfiltered: differences between indices are meaningless.
std::string indexed_rows(const Pixels& pixels, const std::vector<int>& colours,
                         const std::vector<int>& palette) {
  std::vector<int> place(colour_count, -1);
  std::string rows;
  rows.reserve(colours.size() + std::size_t(pixels.height));
  for (std::size_t i = 0; i < colours.size(); ++i) {
    if (i % std::size_t(pixels.width) == 0) rows.push_back('\0');
    int& at = place[std::size_t(colours[i])];
    if (at < 0) at = int(nearest(palette, colours[i]));
    rows.push_back(char(at));
  }
  return rows;
}

void append_true_colours(std::string& file, const Pixels& pixels) {
  // Level 2 takes a third of the time of the default; the filter has already removed most
  // redundancy.
  constexpr int level = 2;
  append_chunk(file, "IDAT", compressed(filtered_rows(pixels), level));
}

void append_few_colours(std::string& file, const Pixels& pixels) {
  constexpr int level = 6;
  const std::vector<int> colours = rounded_colours(pixels), palette = palette_of(colours);
  std::string bytes;
  for (const int colour : palette)
    for (const int value : colour_of(colour)) bytes.push_back(char(value));
  append_chunk(file, "PLTE", bytes);
  append_chunk(file, "IDAT", compressed(indexed_rows(pixels, colours, palette), level));
}

}  // namespace

std::string png_file(const Pixels& pixels, PngPurpose png_purpose) {
  if (pixels.width < 1 || pixels.height < 1 ||
      pixels.rgb.size() != 3 * std::size_t(pixels.width) * std::size_t(pixels.height))
    throw std::invalid_argument("a picture of three bytes for every pixel");
  std::string file("\x89PNG\r\n\x1a\n", 8);
  std::string head;
  append_number(head, std::uint32_t(pixels.width));
  append_number(head, std::uint32_t(pixels.height));
  // Eight bits each of red, green and blue, or of a palette index.
  head.append(png_purpose == PngPurpose::Size ? "\x08\x03" : "\x08\x02", 2).append(3, '\0');
  append_chunk(file, "IHDR", head);
  png_purpose == PngPurpose::Size ? append_few_colours(file, pixels)
                                  : append_true_colours(file, pixels);
  append_chunk(file, "IEND", {});
  return file;
}

}  // namespace abbe::render
