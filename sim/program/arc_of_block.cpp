#include "sim/program/arc_of_block.h"

#include <array>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "kinematics/bad_input.h"

namespace abbe::sim::program {

using Eigen::Vector2d;
using kinematics::AxisVector;

namespace {

/// Its two axes, right-handed, and the letters of a centre: of the first, the second and across.
struct PlaneLetters {
  std::string_view axes, centre, pair;
};

PlaneLetters letters_of_plane(int plane) {
  if (plane == 18) return {"ZX", "KIJ", "I K"};
  if (plane == 19) return {"YZ", "JKI", "J K"};
  return {"XY", "IJK", "I J"};
}

void find_centre(const Canon& canon, const ArcBlock& block, const PlaneLetters& letters,
                 ArcMove& arc) {
  const auto first = block.word(letters.centre[0]), second = block.word(letters.centre[1]);
  if (const auto outside = block.word(letters.centre[2]))
    canon.refuse(outside->cause, fmt::format("{} in the plane of G{}", letters.pair, block.plane));
  if (!first && !second)
    canon.refuse(block.cause,
                 fmt::format("{} or R beside {}", letters.pair, block.clockwise ? "G2" : "G3"),
                 "none");
  if (block.absolute_centre && (!first || !second))
    canon.refuse(block.cause, fmt::format("both {} under G90.1", letters.pair), "one");
  const Vector2d words(first ? first->mm : 0.0, second ? second->mm : 0.0);
  const auto in_plane = [&](const AxisVector& q) { return Vector2d(q[arc.first], q[arc.second]); };
  if (!canon.frame().rotation) {
    const AxisVector zero = AxisVector::Zero(block.from.size());
    arc.centre = words + in_plane(block.absolute_centre ? canon.placed(zero) : block.from);
    return;
  }
  AxisVector p = canon.unplaced(block.from);
  p[arc.first] = (block.absolute_centre ? 0.0 : p[arc.first]) + words.x();
  p[arc.second] = (block.absolute_centre ? 0.0 : p[arc.second]) + words.y();
  arc.placed_centre = canon.placed(std::move(p));
  arc.centre = in_plane(arc.placed_centre);
}

}  // namespace

ArcMove arc_of_block(const Canon& canon, const ArcBlock& block) {
  const PlaneLetters letters = letters_of_plane(block.plane);
  ArcMove arc{.first = canon.joint_of(letters.axes[0]),
              .second = canon.joint_of(letters.axes[1]),
              .end = block.end,
              .centre = {0, 0},
              .clockwise = block.clockwise,
              .cause = block.cause,
              .named = block.cause,
              .stated = block.stated};
  if (arc.first < 0 || arc.second < 0)
    canon.refuse(block.cause, fmt::format("a machine with the axes {} {} of the plane",
                                          letters.axes[0], letters.axes[1]));
  const auto radius = block.word('R');
  if (!radius) {
    find_centre(canon, block, letters, arc);
    return arc;
  }
  for (const char letter : {'I', 'J', 'K'})
    if (const auto word = block.word(letter)) canon.refuse(word->cause, "either R or I J K");
  arc.radius = radius->mm;
  arc.named = radius->cause;
  return arc;
}

}  // namespace abbe::sim::program
