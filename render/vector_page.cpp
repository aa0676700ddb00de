#include "render/vector_page.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include <fmt/format.h>
#include <vtkFloatArray.h>
#include <vtkIntArray.h>
#include <vtkNew.h>
#include <vtkPath.h>
#include <vtkPoints.h>
#include <vtkTextProperty.h>
#include <vtkTextRenderer.h>
#include <vtkVersion.h>
#include <zlib.h>

#include "render/text_property.h"

#if VTK_VERSION_NUMBER < VTK_VERSION_CHECK(9, 2, 0)
#include <vtkUnicodeString.h>
#endif

namespace abbe::render {
namespace {

using Eigen::Vector2d;

/// A piece of an outline: M to a point, L a line, C a cubic, Z closed.
struct Piece {
  char kind = 'M';
  std::array<Vector2d, 3> to;
};

/// VTK 9.1 leaves out what is not ASCII, unless it is asked in the older way.
void to_path(const std::string& text, vtkTextProperty& property, vtkPath& path) {
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

/// The letters of a text, in px of the picture.
std::vector<Piece> outlines(const FlatText& text) {
  vtkNew<vtkTextProperty> property;
  apply_style(text.style, text.text, *property);
  property->SetJustificationToLeft();
  property->SetVerticalJustificationToBottom();
  vtkNew<vtkPath> path;
  to_path(text.text, *property, *path);
  const auto place = [&](vtkIdType i) -> Vector2d {
    const double* p = path->GetPoints()->GetPoint(i);
    return text.style.turned_left ? text.at + Vector2d(-p[1], p[0])
                                  : text.at + Vector2d(p[0], p[1]);
  };
  std::vector<Piece> pieces;
  Vector2d last(0.0, 0.0);
  const vtkIdType n = path->GetCodes()->GetNumberOfValues();
  for (vtkIdType i = 0; i < n;) {
    const int code = path->GetCodes()->GetValue(i);
    const Vector2d first = place(i);
    if (code == vtkPath::MOVE_TO) {
      if (!pieces.empty()) pieces.push_back({'Z', {}});
      pieces.push_back({'M', {first, first, first}});
      last = first;
      i += 1;
    } else if (code == vtkPath::LINE_TO) {
      pieces.push_back({'L', {first, first, first}});
      last = first;
      i += 1;
    } else if (code == vtkPath::CONIC_CURVE) {
      const Vector2d end = place(i + 1);
      pieces.push_back(
          {'C', {last + (first - last) * (2.0 / 3.0), end + (first - end) * (2.0 / 3.0), end}});
      last = end;
      i += 2;
    } else {
      const Vector2d end = place(i + 2);
      pieces.push_back({'C', {first, place(i + 1), end}});
      last = end;
      i += 3;
    }
  }
  if (!pieces.empty()) pieces.push_back({'Z', {}});
  return pieces;
}

std::string base64(const std::string& bytes) {
  constexpr const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k)
      word = (word << 8) | (i + k < bytes.size() ? std::uint8_t(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? digits[(word >> (18 - 6 * k)) & 63] : '=';
  }
  return text;
}

std::string hex(const Colour& c) {
  const auto byte = [](double part) {
    return int(std::lround(255.0 * std::clamp(part, 0.0, 1.0)));
  };
  return fmt::format("#{:02x}{:02x}{:02x}", byte(c.r), byte(c.g), byte(c.b));
}

/// SVG counts downwards.
std::string svg_path(const FlatMark& mark, double height) {
  const auto xy = [&](const Vector2d& p) {
    return fmt::format("{:.2f} {:.2f}", p.x(), height - p.y());
  };
  std::string d;
  if (const auto* polygon = std::get_if<FlatPolygon>(&mark)) {
    for (const Vector2d& corner : polygon->corners) d += (d.empty() ? "M" : "L") + xy(corner);
    return d + "Z";
  }
  for (const Piece& piece : outlines(std::get<FlatText>(mark))) {
    d += piece.kind;
    if (piece.kind == 'C') d += xy(piece.to[0]) + " " + xy(piece.to[1]) + " ";
    if (piece.kind != 'Z') d += xy(piece.to[2]);
  }
  return d;
}

std::string pdf_path(const FlatMark& mark) {
  const auto xy = [](const Vector2d& p) { return fmt::format("{:.2f} {:.2f} ", p.x(), p.y()); };
  std::string d;
  if (const auto* polygon = std::get_if<FlatPolygon>(&mark)) {
    for (const Vector2d& corner : polygon->corners) d += xy(corner) + (d.empty() ? "m " : "l ");
    return d + "h f\n";
  }
  for (const Piece& piece : outlines(std::get<FlatText>(mark))) {
    if (piece.kind == 'Z') d += "h ";
    if (piece.kind == 'C') d += xy(piece.to[0]) + xy(piece.to[1]) + xy(piece.to[2]) + "c ";
    if (piece.kind == 'M' || piece.kind == 'L')
      d += xy(piece.to[2]) + (piece.kind == 'M' ? "m " : "l ");
  }
  return d + "f\n";
}

struct Ink {
  Colour colour;
  double opacity;
};

Ink ink_of(const FlatMark& mark) {
  if (const auto* polygon = std::get_if<FlatPolygon>(&mark))
    return {polygon->colour, polygon->opacity};
  return {std::get<FlatText>(mark).style.colour, 1.0};
}

std::string deflated(const std::string& bytes) {
  uLongf size = compressBound(uLong(bytes.size()));
  std::string packed(size, '\0');
  if (compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                reinterpret_cast<const Bytef*>(bytes.data()), uLong(bytes.size()), 6) != Z_OK)
    throw std::runtime_error("a picture could not be compressed");
  packed.resize(size);
  return packed;
}

std::string stream(const std::string& entries, const std::string& bytes) {
  const std::string packed = deflated(bytes);
  return fmt::format("<< {}/Filter /FlateDecode /Length {} >>\nstream\n", entries, packed.size()) +
         packed + "\nendstream";
}

/// Objects 1, 2 ... with the table of where they begin.
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

std::string svg_of(int width, int height, const std::vector<FlatMark>& marks,
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
    const Ink ink = ink_of(mark);
    const std::string opacity =
        ink.opacity < 1.0 ? fmt::format(" fill-opacity=\"{:.2f}\"", ink.opacity) : "";
    svg += fmt::format("<path fill=\"{}\"{} d=\"{}\"/>\n", hex(ink.colour), opacity,
                       svg_path(mark, height));
  }
  return svg + "</svg>\n";
}

std::string pdf_of(int width, int height, const std::vector<FlatMark>& marks,
                   const Raster& behind) {
  constexpr double point_per_px = 0.5;  // 1600 px are 28 cm
  std::string page = fmt::format("{0} 0 0 {0} 0 0 cm\n", point_per_px);
  if (!behind.rgb.empty()) page += fmt::format("q {} 0 0 {} 0 0 cm /Im Do Q\n", width, height);
  std::string states;
  for (int i = 0; i <= 20; ++i) states += fmt::format("/G{} << /ca {:.2f} >> ", i, i / 20.0);
  for (const FlatMark& mark : marks) {
    const Ink ink = ink_of(mark);
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
      stream("", page)};
  if (!behind.rgb.empty())
    objects.push_back(stream(
        fmt::format("/Type /XObject /Subtype /Image /Width {} /Height {} /ColorSpace /DeviceRGB "
                    "/BitsPerComponent 8 ",
                    width, height),
        behind.rgb));
  return pdf_file(objects);
}

}  // namespace abbe::render
