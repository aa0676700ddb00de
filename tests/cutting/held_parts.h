#pragma once

#include "cutting/stock/part_findings.h"
#include "tests/test.h"

/// Designs, stocks milled to them, and what the one says of the other.
namespace abbe::cutting::held_parts {

/// Quads, corners counter-clockwise from outside, as a design whose facets are the surface.
struct Quads {
  std::vector<Vector3d> corners;
  std::vector<std::array<int, 3>> triangles;

  int corner(const Vector3d& p) {
    for (std::size_t i = 0; i < corners.size(); ++i)
      if ((corners[i] - p).norm() < 1e-12) return int(i);
    corners.push_back(p);
    return int(corners.size()) - 1;
  }
  void add(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
    const int i = corner(a), j = corner(b), k = corner(c), l = corner(d);
    triangles.push_back({i, j, k});
    triangles.push_back({i, k, l});
  }
  Design design(const Eigen::Isometry3d& T = Eigen::Isometry3d::Identity()) const {
    Design made;
    made.vertices.resize(Index(corners.size()), 3);
    for (std::size_t i = 0; i < corners.size(); ++i) made.vertices.row(Index(i)) = T * corners[i];
    made.triangles.resize(Index(triangles.size()), 3);
    for (std::size_t t = 0; t < triangles.size(); ++t)
      for (int k = 0; k < 3; ++k) made.triangles(Index(t), k) = triangles[t][std::size_t(k)];
    made.normals = vertex_normals(made.vertices, made.triangles);
    return made;
  }
};

inline const Vector3d block(40, 30, 20);

/// The block from the origin with a pocket in its top, its corners at x and y, down to z.
inline Quads pocketed(const std::array<double, 2>& x, const std::array<double, 2>& y, double z) {
  Quads quads;
  const std::array<double, 4> xs{0, x[0], x[1], block.x()}, ys{0, y[0], y[1], block.y()};
  const double top = block.z();
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const double a = xs[i], b = xs[i + 1], c = ys[j], d = ys[j + 1];
      const double up = i == 1 && j == 1 ? z : top;
      quads.add({a, c, up}, {b, c, up}, {b, d, up}, {a, d, up});
      quads.add({a, d, 0}, {b, d, 0}, {b, c, 0}, {a, c, 0});
    }
  for (std::size_t i = 0; i < 3; ++i) {
    const double a = xs[i], b = xs[i + 1], c = ys[i], d = ys[i + 1];
    quads.add({a, 0, 0}, {b, 0, 0}, {b, 0, top}, {a, 0, top});
    quads.add({b, block.y(), 0}, {a, block.y(), 0}, {a, block.y(), top}, {b, block.y(), top});
    quads.add({0, d, 0}, {0, c, 0}, {0, c, top}, {0, d, top});
    quads.add({block.x(), c, 0}, {block.x(), d, 0}, {block.x(), d, top}, {block.x(), c, top});
  }
  quads.add({x[0], y[0], top}, {x[1], y[0], top}, {x[1], y[0], z}, {x[0], y[0], z});
  quads.add({x[1], y[1], top}, {x[0], y[1], top}, {x[0], y[1], z}, {x[1], y[1], z});
  quads.add({x[0], y[1], top}, {x[0], y[0], top}, {x[0], y[0], z}, {x[0], y[1], z});
  quads.add({x[1], y[0], top}, {x[1], y[1], top}, {x[1], y[1], z}, {x[1], y[0], z});
  return quads;
}

inline const std::array<double, 2> pocket_x{8.13, 31.37}, pocket_y{6.21, 24.79};
inline constexpr double pocket_floor = 9.87;

/// Takes a box, in the grid's frame, out of a stock, exactly.
inline void carve(Stock& stock, const Vector3d& lower, const Vector3d& upper, int line) {
  const auto inside = [&](int axis, double at) { return at > lower[axis] && at < upper[axis]; };
  for (DexelField& field : stock.fields) {
    const int first = (field.along + 1) % 3, second = (field.along + 2) % 3;
    for (int j = 0; j < field.size[1]; ++j)
      for (int i = 0; i < field.size[0]; ++i) {
        const double p = stock.origin_k[first] + i * stock.spacing,
                     q = stock.origin_k[second] + j * stock.spacing;
        if (!inside(first, p) || !inside(second, q)) continue;
        const double from = stock.origin_k[field.along];
        field.lines[std::size_t(i) + std::size_t(field.size[0]) * std::size_t(j)].cut(
            lower[field.along] - from, upper[field.along] - from, line);
      }
  }
}

inline Eigen::Isometry3d any_pose(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const Eigen::Quaterniond turn(normal(random), normal(random), normal(random), normal(random));
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = turn.normalized().toRotationMatrix();
  T.translation() = 50.0 * Vector3d(normal(random), normal(random), normal(random));
  return T;
}

inline Stock full_block(const Eigen::Isometry3d& T_wk, double spacing, bool three = true) {
  return make_stock(BoxBlank{Vector3d::Zero(), block}, T_wk, {spacing, three});
}

/// The pocket to a floor, but for a box in it that is left higher.
inline void mill_pocket(Stock& stock, double floor, double left_to, const std::array<double, 2>& x,
                        const std::array<double, 2>& y) {
  const double top = block.z() + 1;
  carve(stock, {pocket_x[0], pocket_y[0], left_to}, {pocket_x[1], pocket_y[1], top}, 7);
  carve(stock, {pocket_x[0], pocket_y[0], floor}, {x[0], pocket_y[1], top}, 8);
  carve(stock, {x[1], pocket_y[0], floor}, {pocket_x[1], pocket_y[1], top}, 8);
  carve(stock, {pocket_x[0], pocket_y[0], floor}, {pocket_x[1], y[0], top}, 8);
  carve(stock, {pocket_x[0], y[1], floor}, {pocket_x[1], pocket_y[1], top}, 8);
}

struct Held {
  StockSkin skin;
  PartDeviation part;
  Findings found;
};
inline DeviationOptions facets() {
  DeviationOptions options;
  options.smooth = false;
  return options;
}
inline Held held(const StockSkin& skin, const Design& design, const FindingOptions& options = {}) {
  const DesignDistance distance(design, facets());
  Held all{skin, part_deviation(skin, distance, facets()), {}};
  all.found = findings(all.skin, all.part, distance, options);
  return all;
}
inline Held held(const Stock& stock, const Design& design, const FindingOptions& options = {}) {
  return held(stock_skin(stock), design, options);
}

inline FindingOptions along_grid(const Eigen::Isometry3d& T_wk, double limit = 0.05) {
  FindingOptions options;
  options.rest = options.gouge = limit;
  options.undercut_along = T_wk.linear().col(2);
  return options;
}

inline std::size_t regions(const Findings& found, FindingKind kind) {
  return found.sums[std::size_t(kind)].regions;
}
inline void expect_none(const Held& all) {
  for (const Findings::Sums& sums : all.found.sums) {
    EXPECT_EQ(sums.regions, 0u);
    EXPECT_EQ(sums.speckles, 0u);
  }
}

/// Largest magnitude of what is compared, which must be something.
inline double worst(const PartDeviation& part) {
  double most = -1.0;
  for (const double d : part.max_deviation)
    if (std::isfinite(d)) most = std::max(most, std::abs(d));
  EXPECT_GE(most, 0.0);
  return most;
}

/// A dome cap of an open design over a block.
inline Design dome(double R, double radius, const Vector3d& centre, int rings, int around) {
  Quads cap;
  const auto at = [&](int i, int k) {
    const double r = radius * i / rings, f = 2 * pi * (k % around) / around;
    return Vector3d(centre + Vector3d(r * std::cos(f), r * std::sin(f), std::sqrt(R * R - r * r)));
  };
  cap.corners.push_back(at(0, 0));
  for (int i = 1; i <= rings; ++i)
    for (int k = 0; k < around; ++k) cap.corners.push_back(at(i, k));
  const auto ring = [&](int i, int k) { return 1 + (i - 1) * around + k % around; };
  for (int k = 0; k < around; ++k) {
    cap.triangles.push_back({0, ring(1, k), ring(1, k + 1)});
    for (int i = 1; i < rings; ++i) {
      cap.triangles.push_back({ring(i, k), ring(i + 1, k), ring(i + 1, k + 1)});
      cap.triangles.push_back({ring(i, k), ring(i + 1, k + 1), ring(i, k + 1)});
    }
  }
  Design design = cap.design();
  design.normals = (design.vertices.rowwise() - centre.transpose()).rowwise().normalized();
  return design;
}

}  // namespace abbe::cutting::held_parts
