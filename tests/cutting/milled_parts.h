#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/surface/surface.h"

/// Small designs and motions by hand for the tests of the milled surface.
namespace abbe::cutting {

inline constexpr double no_difference = 1e-9;  // mm; the promise is 1e-7
inline const Cutter ball_mill{5.0, 5.0, 20.0};

struct Site {
  Eigen::Vector3d point;
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
};

inline Design design_of(const std::vector<Site>& sites) {
  Design design;
  design.vertices.resize(Eigen::Index(sites.size()), 3);
  design.normals.resize(Eigen::Index(sites.size()), 3);
  for (std::size_t i = 0; i < sites.size(); ++i) {
    design.vertices.row(Eigen::Index(i)) = sites[i].point;
    design.normals.row(Eigen::Index(i)) = sites[i].normal;
  }
  return design;
}

struct Stop {
  Eigen::Vector3d tip;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
};

/// One second from stop to stop; the move that ends at stop i is program line 10 i.
inline CutterMotion motion_of(const std::vector<Stop>& stops) {
  const Eigen::Index n = Eigen::Index(stops.size());
  CutterMotion motion{Points(n, 3), Points(n, 3), Eigen::VectorXd(n),
                      std::vector<int>(stops.size())};
  for (Eigen::Index i = 0; i < n; ++i) {
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
  for (Eigen::Index i = 0; all && i < a.residual.size(); ++i)
    all = same(a.residual[i], b.residual[i]) && same(a.cut_time_s[i], b.cut_time_s[i]);
  return all;
}

}  // namespace abbe::cutting
