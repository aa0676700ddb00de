#include "cutting/mesh_contact.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "cutting/nearest.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double smooth_cosine = 0.8660254037844386;  // 30 degrees
constexpr double edge_slack = 1e-12;  // of a plan coordinate: no gap between neighbours

struct Corners {
  std::array<Vector3d, 3> p;
  Vector3d cross;  ///< twice the area, outward
};

Corners corners(const Design& design, int triangle) {
  Corners c;
  for (int k = 0; k < 3; ++k)
    c.p[static_cast<std::size_t>(k)] = design.vertices.row(design.triangles(triangle, k));
  c.cross = (c.p[1] - c.p[0]).cross(c.p[2] - c.p[0]);
  return c;
}

bool looks_up(const Corners& c) { return c.cross.z() > 1e-9 * c.cross.norm(); }

double area2(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Weights of the corners at (x, y) in plan; empty farther outside than the gap.
std::optional<Vector3d> weights(const Corners& c, const Vector2d& at, double gap) {
  Vector3d w;
  for (int k = 0; k < 3; ++k) {
    const Vector2d a = c.p[static_cast<std::size_t>((k + 1) % 3)].head<2>() - at;
    const Vector2d b = c.p[static_cast<std::size_t>((k + 2) % 3)].head<2>() - at;
    w[k] = area2(a, b) / c.cross.z();
    if (w[k] < -edge_slack - gap * (b - a).norm() / c.cross.z()) return std::nullopt;
  }
  return w;
}

Contact smooth_point(const Design& design, int triangle, const Corners& c, const Vector2d& at,
                     const Vector3d& w) {
  const Vector3d flat_normal = c.cross.normalized();
  const double flat = w[0] * c.p[0].z() + w[1] * c.p[1].z() + w[2] * c.p[2].z();
  double tangent = 0.0;
  Vector2d slope = Vector2d::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vector3d n = design.normals.row(design.triangles(triangle, k));
    if (n.dot(flat_normal) < smooth_cosine || n.z() < 1e-3)
      return {Vector3d(at.x(), at.y(), flat), flat_normal};
    const Vector3d& p = c.p[static_cast<std::size_t>(k)];
    const Vector2d gradient = -n.head<2>() / n.z();
    tangent += w[k] * (p.z() + gradient.dot(at - p.head<2>()));
    slope += w[k] * gradient;
  }
  return {Vector3d(at.x(), at.y(), 0.5 * (flat + tangent)),
          Vector3d(-slope.x(), -slope.y(), 1.0).normalized()};
}

/// The surface of a face above a place, near a height; empty where it stands upright.
std::optional<Contact> face_above(const RecognisedPatch& face, Vector3d p) {
  constexpr int rounds = 20;
  constexpr double least_z = 1e-3, still = 1e-13;
  for (int round = 0; round < rounds; ++round) {
    const Vector3d n = outward(face, p);
    if (!(std::abs(n.z()) > least_z)) return std::nullopt;
    const double off = distance_of(face, p) / n.z();
    p.z() -= off;
    if (std::abs(off) <= still * std::abs(p.z()) + still) break;
  }
  return Contact{p, face.sign * outward(face, p)};
}

}  // namespace

MeshContact::MeshContact(Design design, std::vector<RecognisedPatch> faces)
    : design_(std::move(design)), faces_(std::move(faces)) {
  for (const RecognisedPatch& one : faces_) gap_ = std::max(gap_, 2.0 * one.off);
  if (!design_.vertices.allFinite() || !design_.normals.allFinite())
    throw std::invalid_argument("MeshContact: a vertex or a normal is not finite");
  if (design_.vertices.rows() == 0) return;
  lower_ = design_.vertices.leftCols<2>().colwise().minCoeff();
  const Vector2d size = design_.vertices.leftCols<2>().colwise().maxCoeff().transpose() - lower_;
  const double triangles = std::max<double>(1.0, double(design_.triangles.rows()));
  // two triangles a cell on average; the bound keeps a sliver of a part from asking for a huge grid
  cell_ =
      std::max({std::sqrt(size.x() * size.y() / triangles * 2.0), size.maxCoeff() / 4096.0, 1e-9});
  columns_ = static_cast<int>(size.x() / cell_) + 1;
  rows_ = static_cast<int>(size.y() / cell_) + 1;

  const double slack = 1e-9 + 2.0 * gap_;
  const auto each_cell = [&](auto&& visit) {
    for (int t = 0; t < design_.triangles.rows(); ++t) {
      const Corners c = corners(design_, t);
      if (!looks_up(c)) continue;
      const auto [x0, x1] = std::minmax({c.p[0].x(), c.p[1].x(), c.p[2].x()});
      const auto [y0, y1] = std::minmax({c.p[0].y(), c.p[1].y(), c.p[2].y()});
      for (int j = row(y0 - slack); j <= row(y1 + slack); ++j)
        for (int i = column(x0 - slack); i <= column(x1 + slack); ++i)
          visit(static_cast<std::size_t>(j) * static_cast<std::size_t>(columns_) +
                    static_cast<std::size_t>(i),
                t);
    }
  };
  first_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1, 0);
  each_cell([&](std::size_t cell, int) { ++first_[cell + 1]; });
  for (std::size_t k = 1; k < first_.size(); ++k) first_[k] += first_[k - 1];
  triangles_.resize(static_cast<std::size_t>(first_.back()));
  std::vector<int> fill(first_.begin(), first_.end() - 1);
  each_cell(
      [&](std::size_t cell, int t) { triangles_[static_cast<std::size_t>(fill[cell]++)] = t; });
}

int MeshContact::column(double x) const {
  return static_cast<int>(std::clamp((x - lower_.x()) / cell_, 0.0, double(columns_ - 1)));
}

int MeshContact::row(double y) const {
  return static_cast<int>(std::clamp((y - lower_.y()) / cell_, 0.0, double(rows_ - 1)));
}

std::optional<Contact> contact_above(const MeshContact& mesh, double x, double y) {
  if (mesh.triangles_.empty() || !std::isfinite(x) || !std::isfinite(y)) return std::nullopt;
  const auto cell =
      static_cast<std::size_t>(mesh.row(y)) * static_cast<std::size_t>(mesh.columns_) +
      static_cast<std::size_t>(mesh.column(x));
  std::optional<Contact> highest;
  for (int k = mesh.first_[cell]; k < mesh.first_[cell + 1]; ++k) {
    const int triangle = mesh.triangles_[static_cast<std::size_t>(k)];
    const Corners c = corners(mesh.design_, triangle);
    const auto w = weights(c, {x, y}, mesh.gap_);
    if (!w) continue;
    Contact here = smooth_point(mesh.design_, triangle, c, {x, y}, *w);
    const int face = place_of(mesh.design_, mesh.design_.triangles(triangle, 0)).face;
    if (face >= 0 && !mesh.faces_.empty())
      here = face_above(mesh.faces_[std::size_t(face)], here.point).value_or(here);
    if (!highest || here.point.z() > highest->point.z()) highest = here;
  }
  return highest;
}

}  // namespace abbe::cutting
