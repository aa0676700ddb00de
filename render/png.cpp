#include "render/png.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <stdexcept>
#include <string_view>

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

std::string packed_rows(const std::string& bytes, PngFor made_for) {
  const int level = made_for == PngFor::Size ? 9 : 2;
  uLongf size = compressBound(uLong(bytes.size()));
  std::string packed(size, '\0');
  const int state =
      compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                reinterpret_cast<const Bytef*>(bytes.data()), uLong(bytes.size()), level);
  if (state != Z_OK) throw std::runtime_error("a picture could not be compressed");
  packed.resize(size);
  return packed;
}

Pixels with_fewer_colours(Pixels pixels) {
  constexpr int step = 8, white = 255;
  for (char& one : pixels.rgb) {
    const int rounded = (static_cast<unsigned char>(one) + step / 2) / step * step;
    one = char(std::min(rounded, white));
  }
  return pixels;
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
  head.append("\x08\x02\x00\x00\x00", 5);  // eight bits each of red, green and blue
  append_chunk(file, "IHDR", head);
  append_chunk(file, "IDAT",
               made_for == PngFor::Size
                   ? packed_rows(filtered_rows(with_fewer_colours(pixels)), made_for)
                   : packed_rows(filtered_rows(pixels), made_for));
  append_chunk(file, "IEND", {});
  return file;
}

}  // namespace abbe::render
