#pragma once

#include "cutting/surface/surface.h"
#include "tests/test.h"

/// Small designs and motions by hand for the tests of the milled surface.
namespace abbe::cutting {

inline constexpr double no_difference = 1e-9;  // mm; the promise is 1e-7
inline const Cutter ball_mill{5.0, 5.0, 20.0};

struct Site {
  Vector3d point;
  Vector3d normal = Vector3d::UnitZ();
};

inline Design design_of(const std::vector<Site>& sites) {
  Design design;
  design.vertices.resize(Index(sites.size()), 3);
  design.normals.resize(Index(sites.size()), 3);
  for (std::size_t i = 0; i < sites.size(); ++i) {
    design.vertices.row(Index(i)) = sites[i].point;
    design.normals.row(Index(i)) = sites[i].normal;
  }
  return design;
}

struct Stop {
  Vector3d tip;
  Vector3d axis = Vector3d::UnitZ();
};

/// One second from stop to stop; the move that ends at stop i is program line 10 i.
inline CutterMotion motion_of(const std::vector<Stop>& stops) {
  const Index n = Index(stops.size());
  CutterMotion motion{Points(n, 3), Points(n, 3), VectorXd(n), std::vector<int>(stops.size())};
  for (Index i = 0; i < n; ++i) {
    motion.tip.row(i) = stops[std::size_t(i)].tip;
    motion.axis.row(i) = stops[std::size_t(i)].axis;
    motion.time_s[i] = double(i);
    motion.line[std::size_t(i)] = 10 * int(i);
  }
  return motion;
}

inline bool same_bits(const Surface& a, const Surface& b) {
  const auto same = [](double x, double y) { return x == y || (std::isnan(x) && std::isnan(y)); };
  bool all =
      a.residual.size() == b.residual.size() && a.cut_line == b.cut_line && a.status == b.status;
  for (Index i = 0; all && i < a.residual.size(); ++i)
    all = same(a.residual[i], b.residual[i]) && same(a.cut_time_s[i], b.cut_time_s[i]);
  return all;
}

}  // namespace abbe::cutting
