#pragma once

#include "cutting/part/mesh.h"
#include "tests/test.h"

/// Bodies with fillets as a CAD system writes them to an STL: vertices on the borders of faces only
/// where these are flat, or curved in one direction; facets of equal angles; numbers in float32.
namespace abbe::cutting::filleted {

/// mm, signed, of a point from the true surface, plus outside; and its outward normal there.
struct True {
  double distance;
  Vector3d normal;
};

struct Body {
  std::string name;
  std::vector<Vector3d> points;
  std::vector<std::array<int, 3>> triangles;
  std::function<True(const Vector3d&)> truth;
  std::map<std::string, int> faces;  ///< how many of each form
};

/// Points that are equal to 1e-9 mm made one.
class Builder {
 public:
  int add(const Vector3d& p) {
    std::array<long long, 3> key;
    for (int k = 0; k < 3; ++k) key[std::size_t(k)] = std::llround(p[k] * 1e8);
    const auto [place, is_new] = numbers_.emplace(key, int(points.size()));
    if (is_new) points.push_back(p);
    return place->second;
  }
  void triangle(int a, int b, int c) {
    if (a != b && b != c && c != a) triangles.push_back({a, b, c});
  }
  void quad(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
    const int i = add(a), j = add(b), k = add(c), l = add(d);
    triangle(i, j, k);
    triangle(i, k, l);
  }
  /// A convex outline, from its first corner.
  void fan(const std::vector<Vector3d>& outline) {
    const int first = add(outline[0]);
    for (std::size_t i = 1; i + 1 < outline.size(); ++i)
      triangle(first, add(outline[i]), add(outline[i + 1]));
  }
  std::vector<Vector3d> points;
  std::vector<std::array<int, 3>> triangles;

 private:
  std::map<std::array<long long, 3>, int> numbers_;
};

inline double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

/// A box of half the given size, all edges rounded by r: six planes, twelve cylinders, eight
/// octants of spheres.
inline Body rounded_box(const Vector3d& half, double r, double degrees) {
  const int n = int(std::lround(90.0 / degrees));
  const Vector3d b = half.array() - r;
  Builder made;
  const auto turned = [&](const Vector3d& sign, const std::array<Vector3d, 4>& q) {
    std::array<Vector3d, 4> p = q;
    for (Vector3d& one : p) one = one.cwiseProduct(sign);
    if (sign.prod() > 0.0)
      made.quad(p[0], p[1], p[2], p[3]);
    else
      made.quad(p[3], p[2], p[1], p[0]);
  };
  const auto on = [&](double polar, double azimuth) -> Vector3d {
    return b + r * Vector3d(std::sin(polar) * std::cos(azimuth),
                            std::sin(polar) * std::sin(azimuth), std::cos(polar));
  };
  for (int s = 0; s < 8; ++s) {
    const Vector3d sign(s & 1 ? 1 : -1, s & 2 ? 1 : -1, s & 4 ? 1 : -1);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const double p0 = radians(i * degrees), p1 = radians((i + 1) * degrees),
                     a0 = radians(j * degrees), a1 = radians((j + 1) * degrees);
        turned(sign, {on(p0, a0), on(p1, a0), on(p1, a1), on(p0, a1)});
      }
  }
  const auto edge = [&](int along, int u, int v, double su, double sv) {
    for (int i = 0; i < n; ++i) {
      const auto at = [&](int k, double end) {
        Vector3d p;
        p[along] = end * b[along];
        p[u] = su * (b[u] + r * std::cos(radians(k * degrees)));
        p[v] = sv * (b[v] + r * std::sin(radians(k * degrees)));
        return p;
      };
      const std::array<Vector3d, 4> q = {at(i, -1), at(i + 1, -1), at(i + 1, 1), at(i, 1)};
      const bool flip = su * sv < 0.0;
      if (flip)
        made.quad(q[3], q[2], q[1], q[0]);
      else
        made.quad(q[0], q[1], q[2], q[3]);
    }
  };
  for (const double su : {-1.0, 1.0})
    for (const double sv : {-1.0, 1.0})
      for (int along = 0; along < 3; ++along) edge(along, (along + 1) % 3, (along + 2) % 3, su, sv);
  for (int k = 0; k < 3; ++k)
    for (const double side : {-1.0, 1.0}) {
      const int u = (k + 1) % 3, v = (k + 2) % 3;
      const auto at = [&](double x, double y) {
        Vector3d p;
        p[k] = side * half[k];
        p[u] = x * b[u];
        p[v] = side * y * b[v];
        return p;
      };
      made.quad(at(-1, -1), at(1, -1), at(1, 1), at(-1, 1));
    }
  const auto truth = [b, r](const Vector3d& p) {
    const Vector3d q = p.cwiseAbs() - b, out = q.cwiseMax(0.0);
    const Vector3d sign = p.unaryExpr([](double x) { return x < 0.0 ? -1.0 : 1.0; });
    return True{out.norm() - r, out.cwiseProduct(sign).normalized()};
  };
  return {
      "box", made.points, made.triangles, truth, {{"plane", 6}, {"cylinder", 12}, {"sphere", 8}}};
}

/// A pocket with a fillet r around its floor and corners of R: floor, four walls, eight cylinders,
/// four quarters of a torus. Its mouth is open.
inline Body pocket(double half_x, double half_y, double R, double r, double depth, double degrees) {
  const int n = int(std::lround(90.0 / degrees));
  const Vector2d c(half_x - R, half_y - R);
  const auto loop = [&](double rho, double z) {
    std::vector<Vector3d> all;
    for (int corner = 0; corner < 4; ++corner)
      for (int k = 0; k <= n; ++k) {
        const double a = radians(90.0 * corner + k * degrees);
        const double x = corner == 0 || corner == 3 ? c.x() : -c.x(),
                     y = corner < 2 ? c.y() : -c.y();
        all.emplace_back(x + rho * std::cos(a), y + rho * std::sin(a), z);
      }
    return all;
  };
  std::vector<std::vector<Vector3d>> loops;
  for (int i = 0; i <= n; ++i) {
    const double a = radians(i * degrees);
    loops.push_back(loop(R - r + r * std::sin(a), r * (1.0 - std::cos(a))));
  }
  loops.push_back(loop(R, depth));
  Builder made;
  made.fan(loops.front());
  for (std::size_t i = 0; i + 1 < loops.size(); ++i)
    for (std::size_t k = 0; k < loops[i].size(); ++k) {
      const std::size_t next = (k + 1) % loops[i].size();
      made.quad(loops[i][k], loops[i + 1][k], loops[i + 1][next], loops[i][next]);
    }
  for (auto& t : made.triangles) {  // all must look into the pocket
    const auto& p = made.points;
    const auto at = [&](int k) { return p[std::size_t(t[std::size_t(k)])]; };
    const Vector3d n_t = (at(1) - at(0)).cross(at(2) - at(0));
    const Vector3d m = (at(0) + at(1) + at(2)) / 3.0;
    if (n_t.dot(Vector3d(0, 0, depth + 10.0) - m) < 0.0) std::swap(t[1], t[2]);
  }
  const auto truth = [c, R, r](const Vector3d& p) {
    const Vector2d q = p.head<2>().cwiseAbs() - c, out = q.cwiseMax(0.0);
    Vector2d way = out.norm() > 0.0 ? Vector2d(out.normalized()) : Vector2d(0, 0);
    for (int k = 0; k < 2; ++k)
      if (p[k] < 0.0) way[k] = -way[k];
    const double a = std::max(out.norm() - (R - r), 0.0), b = std::max(r - p.z(), 0.0);
    const double length = std::hypot(a, b);
    return True{r - length, Vector3d(-a * way.x(), -a * way.y(), b) / length};
  };
  return {
      "pocket", made.points, made.triangles, truth, {{"plane", 5}, {"cylinder", 8}, {"torus", 4}}};
}

/// A round boss of radius R and height H on a floor, fillets r at its foot and top.
inline Body boss(double R, double H, double r, double floor, double degrees) {
  const int n = int(std::lround(90.0 / degrees)), m = int(std::lround(360.0 / degrees));
  std::vector<Vector2d> profile = {{floor, 0.0}};
  for (int i = 0; i <= n; ++i) {
    const double a = radians(i * degrees);
    profile.emplace_back(R + r - r * std::sin(a), r - r * std::cos(a));
  }
  for (int i = 0; i <= n; ++i) {
    const double a = radians(i * degrees);
    profile.emplace_back(R - r + r * std::cos(a), H - r + r * std::sin(a));
  }
  Builder made;
  const auto at = [&](const Vector2d& p, int k) {
    const double a = radians((k % m) * degrees);
    return Vector3d(p[0] * std::cos(a), p[0] * std::sin(a), p[1]);
  };
  for (std::size_t i = 0; i + 1 < profile.size(); ++i)
    for (int k = 0; k < m; ++k)
      made.quad(at(profile[i], k), at(profile[i], k + 1), at(profile[i + 1], k + 1),
                at(profile[i + 1], k));
  std::vector<Vector3d> top;
  for (int k = 0; k < m; ++k) top.push_back(at(profile.back(), k));
  made.fan(top);
  const auto truth = [R, H, r](const Vector3d& p) {
    const double rho = p.head<2>().norm();
    const Vector3d way = Vector3d(p.x(), p.y(), 0.0) / std::max(rho, 1e-300);
    const auto turned = [&](double d, const Vector2d& n2) {
      return True{d, n2[0] * way + n2[1] * Vector3d::UnitZ()};
    };
    const Vector2d at_rz(rho, p.z()), foot(R + r, r), top_of(R - r, H - r);
    if (rho <= R - r && p.z() > 0.5 * H) return turned(p.z() - H, {0, 1});
    if (p.z() >= H - r) return turned((at_rz - top_of).norm() - r, (at_rz - top_of).normalized());
    if (p.z() >= r) return turned(rho - R, {1, 0});
    if (rho < R + r) return turned(r - (at_rz - foot).norm(), (foot - at_rz).normalized());
    return turned(p.z(), {0, 1});
  };
  return {
      "boss", made.points, made.triangles, truth, {{"plane", 2}, {"cylinder", 1}, {"torus", 2}}};
}

inline Eigen::Isometry3d any_pose(unsigned seed, double far) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto any = [&] { return Vector3d(unit(random), unit(random), unit(random)); };
  return Eigen::Translation3d(far * any()) *
         Eigen::AngleAxisd(3.0 * unit(random), any().normalized());
}

/// What an STL of the body that stands at T holds.
inline Design as_stl(const Body& body, const Eigen::Isometry3d& T) {
  Design mesh;
  mesh.vertices.resize(Index(body.points.size()), 3);
  for (std::size_t i = 0; i < body.points.size(); ++i)
    mesh.vertices.row(Index(i)) = (T * body.points[i]).cast<float>().cast<double>();
  mesh.triangles.resize(Index(body.triangles.size()), 3);
  for (std::size_t t = 0; t < body.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) mesh.triangles(Index(t), k) = body.triangles[t][std::size_t(k)];
  mesh.normals = vertex_normals(mesh.vertices, mesh.triangles);
  mesh.area = vertex_area(mesh.vertices, mesh.triangles);
  mesh.facet_error = facet_error(mesh.vertices, mesh.normals, mesh.triangles);
  return mesh;
}

}  // namespace abbe::cutting::filleted
