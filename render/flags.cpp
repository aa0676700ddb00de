#include "render/flags.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kinematics/units.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

bool overlap(const Rectangle& a, const Rectangle& b) {
  return a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
}

bool is_within(const Rectangle& inner, const Rectangle& outer) {
  return inner.x >= outer.x && inner.y >= outer.y &&
         inner.x + inner.width <= outer.x + outer.width &&
         inner.y + inner.height <= outer.y + outer.height;
}

Rectangle moved_into(Rectangle box, const Rectangle& room) {
  box.x = std::max(room.x, std::min(box.x, room.x + room.width - box.width));
  box.y = std::max(room.y, std::min(box.y, room.y + room.height - box.height));
  return box;
}

/// How much of a place is taken already; 0: free.
int collisions(const Rectangle& box, const std::vector<Rectangle>& taken,
               const std::vector<Vector2d>& points, double em) {
  int count = 0;
  for (const Rectangle& one : taken) count += overlap(box, one) ? 2 : 0;
  for (const Vector2d& p : points)
    count += overlap(box, {p.x() - 0.5 * em, p.y() - 0.5 * em, em, em}) ? 1 : 0;
  return count;
}

Rectangle label_box(const Vector2d& point, const Vector2d& size,
                    const std::vector<Rectangle>& taken, const std::vector<Vector2d>& points,
                    const Rectangle& room, double em) {
  Rectangle best = moved_into({point.x() + em, point.y() + em, size.x(), size.y()}, room);
  int least = collisions(best, taken, points, em);
  for (const double reach : {1.6, 3.0, 5.0, 8.0}) {
    for (int k = 0; k < 12 && least > 0; ++k) {
      const double angle = pi / 4.0 + k * pi / 6.0;
      const Vector2d d(std::cos(angle), std::sin(angle));
      const Vector2d middle = point + reach * em * d + 0.5 * d.cwiseProduct(size);
      const Rectangle box{middle.x() - 0.5 * size.x(), middle.y() - 0.5 * size.y(), size.x(),
                          size.y()};
      if (!is_within(box, room)) continue;
      const int count = collisions(box, taken, points, em);
      if (count >= least) continue;
      best = box;
      least = count;
    }
  }
  return best;
}

/// The point of a rectangle that is nearest to another.
Vector2d nearest(const Rectangle& box, const Vector2d& p) {
  return {std::clamp(p.x(), box.x, box.x + box.width),
          std::clamp(p.y(), box.y, box.y + box.height)};
}

void draw_disc(Canvas& canvas, const Vector2d& middle, double radius, const Colour& colour) {
  std::vector<Vector2d> corners;
  for (int i = 0; i < 24; ++i)
    corners.push_back(middle + radius * Vector2d(std::cos(pi * i / 12.0), std::sin(pi * i / 12.0)));
  canvas.fill(corners, colour);
}

}  // namespace

bool is_hidden(const View& view, const cutting::Design& design, const Vector3d& point) {
  Eigen::Matrix3d to_view;
  to_view << view.right.transpose(), view.up.transpose(), view.toward.transpose();
  const Vector3d p = to_view * point;
  const double nearer = 3.0 * view.mm_per_px;  // about the point itself nothing counts
  for (const auto& t : design.triangles.rowwise()) {
    const Vector3d a = to_view * design.vertices.row(t[0]).transpose();
    const Vector3d b = to_view * design.vertices.row(t[1]).transpose();
    const Vector3d c = to_view * design.vertices.row(t[2]).transpose();
    if (std::max({a.z(), b.z(), c.z()}) < p.z() + nearer) continue;
    const auto side = [&](const Vector3d& from, const Vector3d& to) {
      return (to.x() - from.x()) * (p.y() - from.y()) - (to.y() - from.y()) * (p.x() - from.x());
    };
    const double u = side(b, c), v = side(c, a), w = side(a, b), all = u + v + w;
    if (all == 0.0 || u / all < 0.0 || v / all < 0.0 || w / all < 0.0) continue;
    if ((u * a.z() + v * b.z() + w * c.z()) / all > p.z() + nearer) return true;
  }
  return false;
}

std::vector<Rectangle> placed_labels(const std::vector<Vector2d>& points,
                                     const std::vector<Vector2d>& sizes, const Rectangle& room,
                                     double em) {
  std::vector<Rectangle> boxes;
  for (std::size_t i = 0; i < points.size(); ++i)
    boxes.push_back(label_box(points[i], sizes[i], boxes, points, room, em));
  return boxes;
}

void draw_flags(Canvas& canvas, const std::vector<Flag>& flags, const Rectangle& room,
                const TextStyle& style) {
  const double em = style.size_px;
  std::vector<Vector2d> points, sizes;
  for (const Flag& flag : flags) {
    points.push_back(flag.at);
    sizes.push_back(text_size(flag.text, style) + Vector2d(0.8 * em, 0.5 * em));
  }
  const std::vector<Rectangle> boxes = placed_labels(points, sizes, room, em);
  for (std::size_t i = 0; i < flags.size(); ++i)
    canvas.line({flags[i].at, nearest(boxes[i], flags[i].at)}, colours::ink, em / 11.0);
  TextStyle centred = style;
  centred.across = centred.upward = 0.5;
  for (std::size_t i = 0; i < flags.size(); ++i) {
    draw_disc(canvas, flags[i].at, 0.34 * em, colours::white);
    draw_disc(canvas, flags[i].at, 0.26 * em, colours::ink);
    if (flags[i].hidden) draw_disc(canvas, flags[i].at, 0.16 * em, colours::white);
    canvas.fill(boxes[i], colours::white, 0.9);
    canvas.frame(boxes[i], colours::faint_ink, em / 16.0);
    canvas.text({boxes[i].x + 0.5 * boxes[i].width, boxes[i].y + 0.5 * boxes[i].height},
                flags[i].text, centred);
  }
}

}  // namespace abbe::render
