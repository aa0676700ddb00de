#include "cutting/triangle_soup.h"

#include <algorithm>
#include <array>
#include <numeric>

#include <fmt/format.h>

#include "cutting/polygon.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

/// The corners of a face without those that stand where the one before stands.
std::vector<int> distinct_corners(const Soup& soup, const std::vector<int>& corners) {
  const auto at = [&](int corner) { return soup.points[static_cast<std::size_t>(corner)]; };
  std::vector<int> distinct;
  for (const int corner : corners)
    if (distinct.empty() || at(corner) != at(distinct.back())) distinct.push_back(corner);
  while (distinct.size() > 1 && at(distinct.back()) == at(distinct.front())) distinct.pop_back();
  return distinct;
}

}  // namespace

Soup with_face(Soup soup, Polygon face, const MeshSource& source) {
  const auto add = [&](int a, int b, int c) {
    soup.faces.push_back({a, b, c});
    if (face.line > 0) soup.line.push_back(face.line);
  };
  const std::size_t written = face.corners.size();
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
    const std::vector<Soup::Face> parts = triangulated(points);
    if (parts.empty())
      source.refuse("a face whose outline does not cross itself",
                    fmt::format("one of {} corners that no triangles fill", points.size()),
                    face.line, face.line > 0 ? 1 : 0);
    for (const Soup::Face& part : parts)
      add(face.corners[std::size_t(part[0])], face.corners[std::size_t(part[1])],
          face.corners[std::size_t(part[2])]);
  }
  source.check_triangles(static_cast<std::int64_t>(soup.faces.size()));
  return soup;
}

Soup merged(const Soup& soup) {
  std::vector<std::size_t> order(soup.points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
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

  Soup out;
  out.line = soup.line;
  std::vector<int> index(order.size(), -1);
  for (std::size_t i = 0; i < order.size(); ++i)
    if (first_of[i] == i) {
      index[i] = static_cast<int>(out.points.size());
      out.points.push_back(soup.points[i]);
    }
  for (const Soup::Face& face : soup.faces) {
    Soup::Face f;
    for (std::size_t k = 0; k < 3; ++k) f[k] = index[first_of[static_cast<std::size_t>(face[k])]];
    out.faces.push_back(f);
  }
  return out;
}

Soup without_unused(const Soup& soup) {
  std::vector<int> index(soup.points.size(), -1);
  for (const Soup::Face& f : soup.faces)
    for (const int i : f) index[static_cast<std::size_t>(i)] = 0;
  Soup out;
  out.line = soup.line;
  for (std::size_t i = 0; i < index.size(); ++i)
    if (index[i] == 0) {
      index[i] = static_cast<int>(out.points.size());
      out.points.push_back(soup.points[i]);
    }
  for (Soup::Face f : soup.faces) {
    for (int& i : f) i = index[static_cast<std::size_t>(i)];
    out.faces.push_back(f);
  }
  return out;
}

std::string place_text(const Vector3d& p) {
  return fmt::format("({:.6g}, {:.6g}, {:.6g})", p.x(), p.y(), p.z());
}

}  // namespace abbe::cutting
