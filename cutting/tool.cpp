#include "cutting/tool.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cutting/hollow_outline.h"
#include "kinematics/require.h"

namespace abbe::cutting {

Cutter form_cutter(ToolOutline outline) {
  const double radius = outline.radius, height = outline.height;
  return {radius, 0.0, height, std::make_shared<const ToolOutline>(std::move(outline))};
}

Nose nose_of(EdgeProfile profile) {
  Nose nose{profile.radius, {}};
  nose.profile = std::make_shared<const EdgeProfile>(std::move(profile));
  return nose;
}

void check_cutter(const Cutter& cutter) {
  require(std::isfinite(cutter.radius) && cutter.radius > 0.0 && cutter.corner_radius >= 0.0 &&
              cutter.corner_radius <= cutter.radius && std::isfinite(cutter.flank_length) &&
              cutter.flank_length >= cutter.corner_radius,
          "cutter: expected radius > 0, corner radius from 0 to radius, flank at least as long");
}

std::vector<Cutter> convex_parts(const Cutter& cutter) {
  if (!is_hollow(cutter)) return {cutter};
  std::vector<Cutter> parts;
  for (const ToolOutline& part : cutter.outline->parts)
    parts.push_back(
        {part.radius, 0.0, part.height, std::shared_ptr<const ToolOutline>(cutter.outline, &part)});
  return parts;
}

ShrunkCutter shrunk(const Cutter& cutter, double margin) {
  const double by = std::min(margin, 0.25 * cutter.radius);
  if (cutter.outline) {
    const double depth = std::min(by, 0.25 * cutter.flank_length);
    InnerOutline inner =
        is_hollow(cutter) ? inside_hollow(*cutter.outline, depth) : inside(*cutter.outline, depth);
    return {form_cutter(std::move(inner.outline)), inner.raised};
  }
  return {{cutter.radius - by, std::max(0.0, cutter.corner_radius - by), cutter.flank_length}, by};
}

}  // namespace abbe::cutting
