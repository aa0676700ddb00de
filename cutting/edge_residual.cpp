#include "cutting/edge_residual.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

constexpr double pass_travel = 4.0;  // lengths of an edge that the tool goes along one pass
constexpr double crest_margin =
    0.1;  // of an edge; nearer to its end a crest is left to shorter edges

/// The derivative by u of the place on an edge, at its end `from`.
Vector3d way(const OnSurface& on_surface, const Knot& from, const Knot& to) {
  constexpr double little = 1e-3;
  return (between(on_surface, from, to, little).point - from.point) / little;
}

/// Where two passes cross between places x0 < x1 of an edge that both curve by k: the crest.
double crossing(double r0, double s0, double r1, double s1, double width, double k) {
  const double closing = s0 - s1 + k * width;
  const double gap = r1 - r0 - s1 * width + 0.5 * k * width * width;
  return gap / closing;
}

}  // namespace

bool is_one_pass(const Knot& a, const Knot& b, double length) {
  return std::abs(a.travel - b.travel) < pass_travel * length;
}

Contact between(const OnSurface& on_surface, const Knot& a, const Knot& b, double u) {
  const std::array<Contact, 2> corners = {a.place(), b.place()};
  const std::array<double, 2> weights = {1.0 - u, u};
  return on_surface(corners, weights);
}

Span span_of(const OnSurface& on_surface, const Knot& a, const Knot& b) {
  return {a.residual, b.residual, -a.gradient.dot(way(on_surface, a, b)),
          b.gradient.dot(way(on_surface, b, a)), is_one_pass(a, b, (b.point - a.point).norm())};
}

std::optional<double> crest_of(const OnSurface& on_surface, const Knot& a, const Knot& b,
                               const EdgeProbe& probe) {
  if (!probe.knot.cut) return std::nullopt;
  const Span from_a = span_of(on_surface, a, probe.knot), to_b = span_of(on_surface, probe.knot, b);
  if (from_a.one_pass == to_b.one_pass) return std::nullopt;
  const double u = probe.u, rest = 1.0 - u;
  // slopes by u of the whole edge
  const double s_a = from_a.slope_a / u, s_m = from_a.slope_b / u, s_b = to_b.slope_b / rest;
  const double m_b = to_b.slope_a / rest;
  const double crest =
      from_a.one_pass
          ? u + crossing(probe.knot.residual, m_b, b.residual, s_b, rest, (s_m - s_a) / u)
          : crossing(a.residual, s_a, probe.knot.residual, s_m, u, (s_b - m_b) / rest);
  const bool inside = crest > crest_margin && crest < 1.0 - crest_margin;
  return inside ? std::optional(crest) : std::nullopt;
}

}  // namespace abbe::cutting
