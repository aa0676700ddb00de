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

MeshSource mesh_source(const std::filesystem::path& file, std::uintmax_t max_bytes,
                       std::int64_t max_triangles) {
  const auto refuse = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(file.string(), 0, 0, expected, seen);
  };
  std::error_code problem;
  const auto status = std::filesystem::status(file, problem);
  if (!std::filesystem::exists(status)) refuse("a mesh file", "no such file");
  if (!std::filesystem::is_regular_file(status)) refuse("a mesh file", "something that is no file");
  const std::uintmax_t size = std::filesystem::file_size(file, problem);
  if (problem) refuse("a mesh file", problem.message());
  // The size is checked before memory is taken.
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
  std::string out(text);
  for (char& c : out) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return out;
}

Words::Words(const MeshSource& source, char comment, std::size_t offset, int line)
    : source_(source), text_(source.bytes), at_(offset), line_(line), comment_(comment) {
  // the byte order mark of UTF-8
  if (text_.substr(at_, 3) == "\xef\xbb\xbf") at_ += 3;
  line_start_ = at_;
}

Word Words::next() {
  skip(true);
  return take();
}

Word Words::next_in_line() {
  skip(false);
  return take();
}

Word Words::rest_of_line() {
  Word rest = next_in_line();
  for (Word word = rest; !word.text.empty(); word = next_in_line())
    rest.text = {rest.text.data(),
                 std::size_t(word.text.data() + word.text.size() - rest.text.data())};
  return rest;
}

void Words::skip_line() {
  while (at_ < text_.size() && text_[at_] != '\n') ++at_;
}

bool Words::at_end() {
  skip(true);
  return at_ >= text_.size();
}

void Words::expect(std::string_view keyword, const Word& seen) const {
  if (lower(seen.text) != keyword) refuse(fmt::format("'{}'", keyword), seen);
}

double Words::number(const Word& word) const {
  // from_chars accepts no leading plus sign, which some writers use
  std::string_view digits = word.text;
  if (digits.size() > 1 && digits[0] == '+') digits.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  const bool whole = !digits.empty() && end == digits.data() + digits.size();
  if (!whole || error != std::errc() || !std::isfinite(value)) refuse("a finite number", word);
  return value;
}

Vector3d Words::point() {
  const double x = number();
  const double y = number();
  const double z = number();
  return {x, y, z};
}

std::int64_t Words::integer(const Word& word, std::int64_t least, std::int64_t most,
                            const std::string& what) const {
  std::int64_t value = 0;
  const char* end = word.text.data() + word.text.size();
  const auto parsed = std::from_chars(word.text.data(), end, value);
  if (word.text.empty() || parsed.ec != std::errc() || parsed.ptr != end || value < least ||
      value > most)
    refuse(least == most ? fmt::format("{} {}", what, least)
                         : fmt::format("{} ({} .. {})", what, least, most),
           word);
  return value;
}

void Words::refuse(const std::string& expected, const Word& seen) const {
  source_.refuse(expected, seen.text.empty() ? "the end" : in_quotes(seen.text), seen.line,
                 seen.column);
}

void Words::skip(bool over_lines) {
  while (at_ < text_.size()) {
    const char c = text_[at_];
    if (c == '\n') {
      if (!over_lines) return;
      ++at_;
      ++line_;
      line_start_ = at_;
    } else if (is_space(c)) {
      ++at_;
    } else if (comment_ != '\0' && c == comment_) {
      skip_line();
    } else {
      return;
    }
  }
}

Word Words::take() {
  const std::size_t first = at_;
  while (at_ < text_.size() && text_[at_] != '\n' && !is_space(text_[at_])) ++at_;
  return {text_.substr(first, at_ - first), line_, static_cast<int>(first - line_start_) + 1};
}

int FaceMarkCollector::set_of(const std::vector<std::string>& names) {
  const auto [place, is_new] = sets_.emplace(names, int(marks_.names.size()));
  if (!is_new) return place->second;
  names_ += names.size();
  // a file of distinct names would need far more memory than its bytes
  if (names_ > max_names)
    source_.refuse(fmt::format("at most {} names of groups", max_names), "more");
  marks_.names.push_back(names);
  return place->second;
}

void FaceMarkCollector::mark(std::size_t count, const FaceMark& mark) {
  std::vector<int>& of_face = marks_.of_face;
  if (!of_face.empty() && marks_.marks[std::size_t(of_face.back())] == mark) {
    of_face.resize(count, of_face.back());  // consecutive faces mostly have the same mark
    return;
  }
  const auto [place, is_new] = numbers_.emplace(mark, int(marks_.marks.size()));
  if (is_new) marks_.marks.push_back(mark);
  of_face.resize(count, place->second);
}

std::optional<FaceColour> common_corner_colour(
    const std::vector<std::optional<FaceColour>>& colours, const std::vector<int>& corners) {
  if (colours.empty()) return std::nullopt;
  const auto of = [&](int corner) { return colours[std::size_t(corner)]; };
  const bool agree =
      std::ranges::all_of(corners, [&](int corner) { return of(corner) == of(corners[0]); });
  return agree ? of(corners[0]) : std::nullopt;
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
double turn(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
}

struct Outline {
  std::vector<Vector2d> at;  ///< of every corner, projected along the mean normal
  std::vector<int> left;     ///< corners not cut off yet, in order
  double min_turn;

  int next(std::size_t i, std::size_t by) const { return left[(i + by) % left.size()]; }

  /// Returns true if the corner can be cut off: it is convex, and no other corner lies in its
  /// triangle.
  bool is_ear(std::size_t i) const {
    const int a = next(i, left.size() - 1), b = left[i], c = next(i, 1);
    const Vector2d &pa = at[std::size_t(a)], &pb = at[std::size_t(b)], &pc = at[std::size_t(c)];
    if (!(turn(pa, pb, pc) > min_turn)) return false;
    for (const int other : left) {
      if (other == a || other == b || other == c) continue;
      const Vector2d& p = at[std::size_t(other)];
      if (turn(pa, pb, p) >= -min_turn && turn(pb, pc, p) >= -min_turn &&
          turn(pc, pa, p) >= -min_turn)
        return false;
    }
    return true;
  }
};

}  // namespace

std::vector<std::array<int, 3>> triangulated(const std::vector<Vector3d>& corners) {
  const Vector3d area = twice_area(corners);
  const double size = area.norm();
  if (!(size > 0.0) || !std::isfinite(size)) return {};
  const Vector3d normal = area / size, across = normal.unitOrthogonal();
  // 1e-9 of the area: corners that are collinear to rounding are not convex
  Outline outline{{}, std::vector<int>(corners.size()), 1e-9 * size};
  for (const Vector3d& p : corners)
    outline.at.emplace_back((p - corners[0]).dot(across),
                            (p - corners[0]).dot(normal.cross(across)));
  std::iota(outline.left.begin(), outline.left.end(), 0);
  std::vector<std::array<int, 3>> triangles;
  // Cubic in the number of corners, which is limited to 1000.
  while (outline.left.size() >= 3) {
    const std::size_t n = outline.left.size();
    std::size_t best = n;
    double shortest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n; ++i) {
      const double cut =
          (corners[std::size_t(outline.next(i, n - 1))] - corners[std::size_t(outline.next(i, 1))])
              .norm();
      if (cut >= shortest || !outline.is_ear(i)) continue;
      best = i;
      shortest = cut;
    }
    if (best == n) return {};
    triangles.push_back({outline.next(best, n - 1), outline.left[best], outline.next(best, 1)});
    if (n == 3) return triangles;
    outline.left.erase(outline.left.begin() + std::ptrdiff_t(best));
  }
  return {};
}

namespace {

/// Returns the corners of a face without those that coincide with the one before.
std::vector<int> distinct_corners(const TriangleSoup& soup, const std::vector<int>& corners) {
  const auto at = [&](int corner) { return soup.points[static_cast<std::size_t>(corner)]; };
  std::vector<int> distinct;
  for (const int corner : corners)
    if (distinct.empty() || at(corner) != at(distinct.back())) distinct.push_back(corner);
  while (distinct.size() > 1 && at(distinct.back()) == at(distinct.front())) distinct.pop_back();
  return distinct;
}

}  // namespace

TriangleSoup with_face(TriangleSoup soup, Polygon face, const MeshSource& source) {
  const auto add = [&](int a, int b, int c) {
    soup.faces.push_back({a, b, c});
    if (face.line > 0) soup.line.push_back(face.line);
  };
  const std::size_t written = face.corners.size();
  // A degenerate triangle is kept; the check of the mesh reports it with its location.
  if (written > 3) face.corners = distinct_corners(soup, face.corners);
  if (face.corners.size() < 3)
    source.refuse("faces with an area",
                  fmt::format("a degenerate one, {} corners at {} places, one of them {}", written,
                              face.corners.size(),
                              place_text(soup.points[static_cast<std::size_t>(face.corners[0])])),
                  face.line, face.line > 0 ? 1 : 0);
  if (face.corners.size() == 3) {
    add(face.corners[0], face.corners[1], face.corners[2]);
  } else {
    std::vector<Vector3d> points;
    for (const int corner : face.corners)
      points.push_back(soup.points[static_cast<std::size_t>(corner)]);
    const std::vector<TriangleSoup::Face> parts = triangulated(points);
    if (parts.empty())
      source.refuse("a face whose outline does not cross itself",
                    fmt::format("one of {} corners that no triangles fill", points.size()),
                    face.line, face.line > 0 ? 1 : 0);
    for (const TriangleSoup::Face& part : parts)
      add(face.corners[std::size_t(part[0])], face.corners[std::size_t(part[1])],
          face.corners[std::size_t(part[2])]);
  }
  source.check_triangles(static_cast<std::int64_t>(soup.faces.size()));
  return soup;
}

TriangleSoup merged(const TriangleSoup& soup) {
  std::vector<std::size_t> order(soup.points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  // sorting by coordinates makes equal points adjacent; ties by index keep the first of them
  const auto key = [&](std::size_t i) {
    const Vector3d& p = soup.points[i];
    return std::array{p.x(), p.y(), p.z()};
  };
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const auto ka = key(a), kb = key(b);
    return ka < kb || (ka == kb && a < b);
  });
  std::vector<std::size_t> first_of(order.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    first_of[order[i]] =
        i > 0 && key(order[i]) == key(order[i - 1]) ? first_of[order[i - 1]] : order[i];

  TriangleSoup out;
  out.line = soup.line;
  std::vector<int> index(order.size(), -1);
  for (std::size_t i = 0; i < order.size(); ++i)
    if (first_of[i] == i) {
      index[i] = static_cast<int>(out.points.size());
      out.points.push_back(soup.points[i]);
    }
  for (const TriangleSoup::Face& face : soup.faces) {
    TriangleSoup::Face f;
    for (std::size_t k = 0; k < 3; ++k) f[k] = index[first_of[static_cast<std::size_t>(face[k])]];
    out.faces.push_back(f);
  }
  return out;
}

// index is -1 for unused points, 0 for used ones, then their new number.
TriangleSoup drop_unused_points(const TriangleSoup& soup) {
  std::vector<int> index(soup.points.size(), -1);
  for (const TriangleSoup::Face& f : soup.faces)
    for (const int i : f) index[static_cast<std::size_t>(i)] = 0;
  TriangleSoup out;
  out.line = soup.line;
  for (std::size_t i = 0; i < index.size(); ++i)
    if (index[i] == 0) {
      index[i] = static_cast<int>(out.points.size());
      out.points.push_back(soup.points[i]);
    }
  for (TriangleSoup::Face f : soup.faces) {
    for (int& i : f) i = index[static_cast<std::size_t>(i)];
    out.faces.push_back(f);
  }
  return out;
}

std::string place_text(const Vector3d& p) {
  return fmt::format("({:.6g}, {:.6g}, {:.6g})", p.x(), p.y(), p.z());
}

}  // namespace abbe::cutting
