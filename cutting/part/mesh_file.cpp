#include "cutting/part/mesh_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <numeric>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::cutting {

using Eigen::Vector3d;

void MeshSource::refuse(const std::string& expected, const std::string& seen, int line,
                        int column) const {
  throw BadInput(name, line, column, expected, seen);
}

void MeshSource::check_triangles(std::int64_t count) const {
  if (count > max_triangles)
    refuse(fmt::format("at most {} triangles", max_triangles), fmt::format("{}", count));
}

MeshSource load_mesh_source(const std::filesystem::path& file, std::uintmax_t max_bytes,
                            std::int64_t max_triangles) {
  const auto refuse = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(file.string(), 0, 0, expected, seen);
  };
  std::error_code problem;
  const auto status = std::filesystem::status(file, problem);
  if (!std::filesystem::exists(status)) refuse("a mesh file", "no such file");
  if (!std::filesystem::is_regular_file(status))
    refuse("a mesh file", "something that is not a file");
  const std::uintmax_t size = std::filesystem::file_size(file, problem);
  if (problem) refuse("a mesh file", problem.message());
  // The size is checked before memory is allocated.
  if (size == 0) refuse("a mesh", "an empty file");
  if (size > max_bytes) refuse(fmt::format("at most {} bytes", max_bytes), fmt::format("{}", size));
  std::string bytes(size, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<std::uintmax_t>(stream.gcount()) != size)
    refuse("a file that can be read", fmt::format("{} of {} bytes", stream.gcount(), size));
  return {file.string(), std::move(bytes), max_triangles};
}

namespace {

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\f' || c == '\v'; }

}  // namespace

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return result;
}

TokenReader::TokenReader(const MeshSource& source, char comment, std::size_t offset, int line)
    : source_(source), text_(source.bytes), offset_(offset), line_(line), comment_(comment) {
  // A UTF-8 byte order mark is skipped.
  if (text_.substr(offset_, 3) == "\xef\xbb\xbf") offset_ += 3;
  line_start_ = offset_;
}

Token TokenReader::next() {
  skip(true);
  return take_token();
}

Token TokenReader::next_in_line() {
  skip(false);
  return take_token();
}

Token TokenReader::remaining_line() {
  Token line = next_in_line();
  for (Token token = line; !token.text.empty(); token = next_in_line())
    line.text = {line.text.data(),
                 std::size_t(token.text.data() + token.text.size() - line.text.data())};
  return line;
}

void TokenReader::skip_line() {
  while (offset_ < text_.size() && text_[offset_] != '\n') ++offset_;
}

bool TokenReader::at_end() {
  skip(true);
  return offset_ >= text_.size();
}

void TokenReader::expect(std::string_view keyword, const Token& token) const {
  if (lower(token.text) != keyword) refuse(fmt::format("'{}'", keyword), token);
}

double TokenReader::number(const Token& token) const {
  // std::from_chars accepts no leading plus sign, which some writers use.
  std::string_view digits = token.text;
  if (digits.size() > 1 && digits[0] == '+') digits.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  const bool is_whole = !digits.empty() && end == digits.data() + digits.size();
  if (!is_whole || error != std::errc() || !std::isfinite(value)) refuse("a finite number", token);
  return value;
}

Vector3d TokenReader::point() {
  const double x = number();
  const double y = number();
  const double z = number();
  return {x, y, z};
}

std::int64_t TokenReader::integer(const Token& token, std::int64_t min, std::int64_t max,
                                  const std::string& description) const {
  std::int64_t value = 0;
  const char* end = token.text.data() + token.text.size();
  const auto parsed = std::from_chars(token.text.data(), end, value);
  if (token.text.empty() || parsed.ec != std::errc() || parsed.ptr != end || value < min ||
      value > max)
    refuse(min == max ? fmt::format("{} {}", description, min)
                      : fmt::format("{} ({} to {})", description, min, max),
           token);
  return value;
}

void TokenReader::refuse(const std::string& expected, const Token& token) const {
  source_.refuse(expected, token.text.empty() ? "the end" : quoted_excerpt(token.text), token.line,
                 token.column);
}

void TokenReader::skip(bool across_lines) {
  while (offset_ < text_.size()) {
    const char c = text_[offset_];
    if (c == '\n') {
      if (!across_lines) return;
      ++offset_;
      ++line_;
      line_start_ = offset_;
    } else if (is_space(c)) {
      ++offset_;
    } else if (comment_ != '\0' && c == comment_) {
      skip_line();
    } else {
      return;
    }
  }
}

Token TokenReader::take_token() {
  const std::size_t first = offset_;
  while (offset_ < text_.size() && text_[offset_] != '\n' && !is_space(text_[offset_])) ++offset_;
  return {text_.substr(first, offset_ - first), line_, static_cast<int>(first - line_start_) + 1};
}

int FaceMarkCollector::name_set_index(const std::vector<std::string>& names) {
  const auto [entry, is_new] = sets_.emplace(names, int(marks_.name_sets.size()));
  if (!is_new) return entry->second;
  name_count_ += names.size();
  // Distinct names need far more memory than their bytes in the file.
  if (name_count_ > max_names)
    source_.refuse(fmt::format("at most {} group names", max_names), "more");
  marks_.name_sets.push_back(names);
  return entry->second;
}

void FaceMarkCollector::mark(std::size_t count, const FaceMark& mark) {
  std::vector<int>& mark_of_face = marks_.mark_of_face;
  if (!mark_of_face.empty() && marks_.marks[std::size_t(mark_of_face.back())] == mark) {
    mark_of_face.resize(count, mark_of_face.back());  // consecutive faces mostly have the same mark
    return;
  }
  const auto [entry, is_new] = numbers_.emplace(mark, int(marks_.marks.size()));
  if (is_new) marks_.marks.push_back(mark);
  mark_of_face.resize(count, entry->second);
}

std::optional<FaceColour> common_corner_colour(
    const std::vector<std::optional<FaceColour>>& colours, const std::vector<int>& corners) {
  if (colours.empty()) return std::nullopt;
  const auto colour_at = [&](int corner) { return colours[std::size_t(corner)]; };
  const bool agree = std::ranges::all_of(
      corners, [&](int corner) { return colour_at(corner) == colour_at(corners[0]); });
  return agree ? colour_at(corners[0]) : std::nullopt;
}

namespace {

using Eigen::Vector2d;

/// Returns twice the area vector of a polygon.
Vector3d twice_area(const std::vector<Vector3d>& corners) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 1; i + 1 < corners.size(); ++i)
    sum += (corners[i] - corners[0]).cross(corners[i + 1] - corners[0]);
  return sum;
}

// Returns twice the signed area of the triangle a, b, c.
double twice_signed_area(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
}

/// The outline of a polygon from which corners are cut off.
struct Outline {
  std::vector<Vector2d> points;  ///< of every corner, projected along the mean normal
  std::vector<int> remaining;    ///< corners not cut off yet, in order
  double min_twice_area;         ///< mm^2; a smaller triangle counts as flat

  int corner_after(std::size_t i, std::size_t steps) const {
    return remaining[(i + steps) % remaining.size()];
  }

  /// Returns true if the corner can be cut off: it is convex, and no other corner lies in its
  /// triangle.
  bool is_ear(std::size_t i) const {
    const int a = corner_after(i, remaining.size() - 1), b = remaining[i], c = corner_after(i, 1);
    const Vector2d &pa = points[std::size_t(a)], &pb = points[std::size_t(b)],
                   &pc = points[std::size_t(c)];
    if (!(twice_signed_area(pa, pb, pc) > min_twice_area)) return false;
    for (const int other : remaining) {
      if (other == a || other == b || other == c) continue;
      const Vector2d& p = points[std::size_t(other)];
      if (twice_signed_area(pa, pb, p) >= -min_twice_area &&
          twice_signed_area(pb, pc, p) >= -min_twice_area &&
          twice_signed_area(pc, pa, p) >= -min_twice_area)
        return false;
    }
    return true;
  }
};

}  // namespace

std::vector<std::array<int, 3>> triangulate(const std::vector<Vector3d>& corners) {
  const Vector3d area = twice_area(corners);
  const double twice_area_size = area.norm();
  if (!(twice_area_size > 0.0) || !std::isfinite(twice_area_size)) return {};
  const Vector3d normal = area / twice_area_size, across = normal.unitOrthogonal();
  // 1e-9 of the area: corners that are collinear except for rounding are not convex.
  Outline outline{{}, std::vector<int>(corners.size()), 1e-9 * twice_area_size};
  for (const Vector3d& p : corners)
    outline.points.emplace_back((p - corners[0]).dot(across),
                                (p - corners[0]).dot(normal.cross(across)));
  std::iota(outline.remaining.begin(), outline.remaining.end(), 0);
  std::vector<std::array<int, 3>> triangles;
  // Cubic in the number of corners, which is limited to 1000.
  while (outline.remaining.size() >= 3) {
    const std::size_t n = outline.remaining.size();
    std::size_t best = n;
    double shortest_cut = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n; ++i) {
      const double cut = (corners[std::size_t(outline.corner_after(i, n - 1))] -
                          corners[std::size_t(outline.corner_after(i, 1))])
                             .norm();
      if (cut >= shortest_cut || !outline.is_ear(i)) continue;
      best = i;
      shortest_cut = cut;
    }
    if (best == n) return {};
    triangles.push_back({outline.corner_after(best, n - 1), outline.remaining[best],
                         outline.corner_after(best, 1)});
    if (n == 3) return triangles;
    outline.remaining.erase(outline.remaining.begin() + std::ptrdiff_t(best));
  }
  return {};
}

namespace {

/// Returns the corners of a face without those that coincide with their predecessor.
std::vector<int> distinct_corners(const TriangleSoup& soup, const std::vector<int>& corners) {
  const auto point_at = [&](int corner) { return soup.points[static_cast<std::size_t>(corner)]; };
  std::vector<int> distinct;
  for (const int corner : corners)
    if (distinct.empty() || point_at(corner) != point_at(distinct.back()))
      distinct.push_back(corner);
  while (distinct.size() > 1 && point_at(distinct.back()) == point_at(distinct.front()))
    distinct.pop_back();
  return distinct;
}

}  // namespace

TriangleSoup append_face(TriangleSoup soup, Polygon polygon, const MeshSource& source) {
  const auto add_triangle = [&](int a, int b, int c) {
    soup.faces.push_back({a, b, c});
    if (polygon.line > 0) soup.line.push_back(polygon.line);
  };
  const std::size_t corners_in_file = polygon.corners.size();
  // A degenerate triangle is kept, because the check of the mesh reports it with its location.
  if (corners_in_file > 3) polygon.corners = distinct_corners(soup, polygon.corners);
  if (polygon.corners.size() < 3)
    source.refuse(
        "faces with an area above 0",
        fmt::format("a degenerate face, {} corners at {} points, one of them {}", corners_in_file,
                    polygon.corners.size(),
                    coordinates_text(soup.points[static_cast<std::size_t>(polygon.corners[0])])),
        polygon.line, polygon.line > 0 ? 1 : 0);
  if (polygon.corners.size() == 3) {
    add_triangle(polygon.corners[0], polygon.corners[1], polygon.corners[2]);
  } else {
    std::vector<Vector3d> points;
    for (const int corner : polygon.corners)
      points.push_back(soup.points[static_cast<std::size_t>(corner)]);
    const std::vector<TriangleSoup::Face> triangles = triangulate(points);
    if (triangles.empty())
      source.refuse("a face whose outline does not cross itself",
                    fmt::format("a face of {} corners that cannot be triangulated", points.size()),
                    polygon.line, polygon.line > 0 ? 1 : 0);
    for (const TriangleSoup::Face& triangle : triangles)
      add_triangle(polygon.corners[std::size_t(triangle[0])],
                   polygon.corners[std::size_t(triangle[1])],
                   polygon.corners[std::size_t(triangle[2])]);
  }
  source.check_triangles(static_cast<std::int64_t>(soup.faces.size()));
  return soup;
}

TriangleSoup merge_equal_points(const TriangleSoup& soup) {
  std::vector<std::size_t> order(soup.points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  // Sorting by coordinates makes equal points adjacent, those of equal coordinates by index.
  const auto key = [&](std::size_t i) {
    const Vector3d& p = soup.points[i];
    return std::array{p.x(), p.y(), p.z()};
  };
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const auto ka = key(a), kb = key(b);
    return ka < kb || (ka == kb && a < b);
  });
  std::vector<std::size_t> first_equal(order.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    first_equal[order[i]] =
        i > 0 && key(order[i]) == key(order[i - 1]) ? first_equal[order[i - 1]] : order[i];

  TriangleSoup result;
  result.line = soup.line;
  std::vector<int> index(order.size(), -1);
  for (std::size_t i = 0; i < order.size(); ++i)
    if (first_equal[i] == i) {
      index[i] = static_cast<int>(result.points.size());
      result.points.push_back(soup.points[i]);
    }
  for (const TriangleSoup::Face& face : soup.faces) {
    TriangleSoup::Face f;
    for (std::size_t k = 0; k < 3; ++k)
      f[k] = index[first_equal[static_cast<std::size_t>(face[k])]];
    result.faces.push_back(f);
  }
  return result;
}

TriangleSoup drop_unused_points(const TriangleSoup& soup) {
  std::vector<int> index(soup.points.size(), -1);  // -1: unused, 0: used, later the new index
  for (const TriangleSoup::Face& f : soup.faces)
    for (const int i : f) index[static_cast<std::size_t>(i)] = 0;
  TriangleSoup result;
  result.line = soup.line;
  for (std::size_t i = 0; i < index.size(); ++i)
    if (index[i] == 0) {
      index[i] = static_cast<int>(result.points.size());
      result.points.push_back(soup.points[i]);
    }
  for (TriangleSoup::Face f : soup.faces) {
    for (int& i : f) i = index[static_cast<std::size_t>(i)];
    result.faces.push_back(f);
  }
  return result;
}

std::string coordinates_text(const Vector3d& p) {
  return fmt::format("({:.6g}, {:.6g}, {:.6g})", p.x(), p.y(), p.z());
}

}  // namespace abbe::cutting
