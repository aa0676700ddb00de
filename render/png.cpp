#include "render/png.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <vector>

#include <zlib.h>

namespace abbe::render {
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

/// Rows as differences to the row above: most of a drawing is zero then.
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

// colours in steps of 8 by a number: 32 steps to 256, for which white's 255 stands
constexpr int step = 8, steps = 33, colour_count = steps * steps * steps;

using Rgb = std::array<int, 3>;

Rgb colour_of(int number) {
  const auto value = [](int steps_up) { return std::min(step * steps_up, 255); };
  return {value(number / steps / steps), value(number / steps % steps), value(number % steps)};
}

/// The number of every pixel's colour.
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

/// 256 colours at most: the most frequent, and then each time the one that is farthest from all
/// before, so that a rare colour that is like no other keeps its place.
std::vector<int> palette_of(const std::vector<int>& colours) {
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

/// Which colour of the palette is nearest.
std::size_t nearest(const std::vector<int>& palette, int colour) {
  const auto far = [&](int other) { return distance(colour, other); };
  return std::size_t(std::ranges::min_element(palette, {}, far) - palette.begin());
}

/// Rows of places in the palette, unfiltered: neighbouring places mean nothing.
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

std::string png_file(const Pixels& pixels, PngFor made_for) {
  if (pixels.width < 1 || pixels.height < 1 ||
      pixels.rgb.size() != 3 * std::size_t(pixels.width) * std::size_t(pixels.height))
    throw std::invalid_argument("a picture of three bytes for every pixel");
  std::string file("\x89PNG\r\n\x1a\n", 8);
  std::string head;
  append_number(head, std::uint32_t(pixels.width));
  append_number(head, std::uint32_t(pixels.height));
  // eight bits each of red, green and blue, or of the number of a colour
  head.append(made_for == PngFor::Size ? "\x08\x03" : "\x08\x02", 2).append(3, '\0');
  append_chunk(file, "IHDR", head);
  made_for == PngFor::Size ? append_few_colours(file, pixels) : append_true_colours(file, pixels);
  append_chunk(file, "IEND", {});
  return file;
}

}  // namespace abbe::render
