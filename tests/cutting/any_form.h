#pragma once

#include "cutting/surface/tool.h"
#include "tests/cutting/random.h"
#include "tests/test.h"

namespace abbe::cutting {

/// A form cutter of radius R: a cone, a barrel on a round corner, a tapered ball or a drill point.
inline Cutter any_form(Random& random, double R) {
  switch (random.below(4)) {
    case 0:
      return form_cutter(outline_from_points({{{R * random.in(0, 0.5), 0}},
                                              {{R, R * random.in(0, 0.4)}},
                                              {{R, R * random.in(1, 3)}}}));
    case 1: {
      const double height = R * random.in(0.5, 2);
      return form_cutter(
          outline_from_points({{{0.3 * R, 0}},
                               {{0.8 * R, 0.2 * R}, R},
                               {{0.8 * R, 0.2 * R + height}, height * random.decades(-0.15, 3)}}));
    }
    case 2: {
      const double corner = R * random.in(0.1, 0.9), lean = random.in(0, 0.5);
      return form_cutter(
          apt_outline({.diameter = 2 * corner * (1 - std::sin(lean)) / std::cos(lean),
                       .corner = corner,
                       .radial = 0.0,
                       .axial = corner,
                       .bottom = 0.0,
                       .flank = lean,
                       .height = 3 * R}));
    }
    default:
      return form_cutter(apt_outline({.diameter = 2 * R,
                                      .bottom = random.decades(-6, 0),
                                      .flank = -0.2 * random.some(1.0),
                                      .height = 3 * R}));
  }
}

}  // namespace abbe::cutting
