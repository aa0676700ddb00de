#include "render/colour.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <vtkColorTransferFunction.h>
#include <vtkNew.h>

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

/// Between colours at equal distances, `part` in 0 .. 1.
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
// lightness falls evenly from that of the middle of the diverging scale to below that of its ends
constexpr std::array reds{rgb(0xefece9), rgb(0xf2c5ac), rgb(0xe8926f),
                          rgb(0xcc5540), rgb(0xa01b26), rgb(0x6b0018)};
constexpr std::array blues{rgb(0xe9ecef), rgb(0xb6cdf2), rgb(0x85a6e4),
                           rgb(0x5579c9), rgb(0x2d4ba3), rgb(0x142066)};

}  // namespace

ColourScale colour_scale(double low, double high, Palette palette) {
  constexpr int entries = 1024;
  ColourScale scale{low, high, {}, colours::beyond_low, colours::beyond_high};
  if (palette == Palette::Cividis) {
    scale.below = {0.10, 0.60, 0.62};
    scale.above = {0.85, 0.20, 0.10};
  }
  const double end = std::max(std::abs(low), std::abs(high));
  const std::vector<Colour> about_zero = diverging(2 * entries - 1);
  for (int i = 0; i < entries; ++i) {
    const double part = i / (entries - 1.0), value = low + part * (high - low);
    const auto place = std::size_t(std::lround((1.0 + value / end) * (entries - 1)));
    scale.colours.push_back(palette == Palette::Cividis ? between(cividis, part)
                            : low >= 0.0                ? between(reds, part)
                            : high <= 0.0               ? between(blues, 1.0 - part)
                                                        : about_zero[place]);
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

unsigned char byte_of(double share) {
  return static_cast<unsigned char>(std::lround(255.0 * std::clamp(share, 0.0, 1.0)));
}

}  // namespace abbe::render
