#include <fmt/format.h>

#include "errors/metrology/plans.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;

const Joint& joint_of(const StandAxis& axis, const Chain& nominal) {
  return nominal.joints()[std::size_t(axis.joint)];
}

AxisVector middle(const Stand& stand, const StandAxis& slide, const Range& range) {
  AxisVector q = stand.q;
  q[slide.joint] = 0.5 * (range.from + range.to);
  return q;
}

/// Straightness of one slide towards another.
Channel across_line(const Instrument& instrument, const Chain& nominal, const Stand& stand,
                    const StandAxis& line, const StandAxis& other) {
  const double lean = line.direction_w.dot(other.direction_w);
  Channel c =
      channel(instrument, fmt::format("{} along {}", other.name, line.name), Quantity::Displacement,
              (other.direction_w - lean * line.direction_w).normalized());
  const Range range = travel(instrument, joint_of(line, nominal));
  c.point_in = reflector_w(instrument, nominal, middle(stand, line, range));
  return c;
}

}  // namespace

// The counter is meant to show the axis position, so p_in is where the reflector is at its zero.
Plan laser(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  expect_slides(instrument, stand, 1);
  Walk walk(instrument, nominal, stand.q);
  for (const StandAxis& slide : stand.slides) {
    Channel c = channel(instrument, fmt::format("along {}", slide.name), Quantity::Displacement,
                        slide.direction_w);
    c.point_in =
        reflector_w(instrument, nominal, stand.q) - stand.q[slide.joint] * slide.direction_w;
    walk.set_up(set_up(instrument, fmt::format("{} positioning", slide.name), {c}));
    walk.back_and_forth(along(stand.q, slide.joint), travel(instrument, joint_of(slide, nominal)));
    walk.move(stand.q);
  }
  return std::move(walk).finish();
}

// The optics are turned for the second direction, which is a set-up of its own.
Plan straightness(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  expect_slides(instrument, stand, 1);
  Walk walk(instrument, nominal, stand.q);
  for (const StandAxis& slide : stand.slides) {
    const Range range = travel(instrument, joint_of(slide, nominal));
    const Across across = metrology::across(nominal, stand.q, slide.direction_w);
    for (int k = 0; k < 2; ++k) {
      Channel c = channel(instrument, fmt::format("{} along {}", across.letter[k], slide.name),
                          Quantity::Displacement, across.direction_w[k]);
      c.point_in = reflector_w(instrument, nominal, middle(stand, slide, range));
      walk.set_up(set_up(instrument,
                         fmt::format("{} straightness in {}", slide.name, across.letter[k]), {c}));
      walk.back_and_forth(along(stand.q, slide.joint), range);
      walk.move(stand.q);
    }
  }
  return std::move(walk).finish();
}

Plan angle_optics(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  if (stand.rotary.empty()) expect_slides(instrument, stand, 1);
  Walk walk(instrument, nominal, stand.q);
  for (const StandAxis& slide : stand.slides) {
    const Across across = metrology::across(nominal, stand.q, slide.direction_w);
    std::vector<Channel> channels;
    for (int k = 0; k < 2; ++k)
      channels.push_back(
          channel(instrument,
                  fmt::format("about {} along {}", char(across.letter[k] - 'X' + 'A'), slide.name),
                  Quantity::Angle, across.direction_w[k]));
    walk.set_up(set_up(instrument, fmt::format("{} pitch and yaw", slide.name), channels));
    walk.back_and_forth(along(stand.q, slide.joint), travel(instrument, joint_of(slide, nominal)));
    walk.move(stand.q);
  }
  for (const StandAxis& rotary : stand.rotary) {
    const Channel c = channel(instrument, fmt::format("about {}", rotary.name), Quantity::Angle,
                              rotary.direction_w);
    walk.set_up(set_up(instrument, fmt::format("{} positions", rotary.name), {c}));
    walk.back_and_forth(along(stand.q, rotary.joint), arc(instrument, joint_of(rotary, nominal)));
    walk.move(stand.q);
  }
  return std::move(walk).finish();
}

// One artefact serves both lines, so that its place and turn are common to the two channels and
// only the angle between the lines is left to be the machine's.
Plan square(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  expect_slides(instrument, stand, 2);
  Walk walk(instrument, nominal, stand.q);
  for (const std::array<StandAxis, 2>& pair : pairs_across(instrument, stand)) {
    std::vector<Channel> channels;
    for (std::size_t k = 0; k < 2; ++k)
      channels.push_back(across_line(instrument, nominal, stand, pair[k], pair[1 - k]));
    walk.set_up(
        set_up(instrument, fmt::format("{}{} square", pair[0].name, pair[1].name), channels));
    for (std::size_t k = 0; k < 2; ++k) {
      walk.back_and_forth(along(stand.q, pair[k].joint),
                          travel(instrument, joint_of(pair[k], nominal)), 1, {int(k)});
      walk.move(stand.q);
    }
  }
  return std::move(walk).finish();
}

// A level stands on what the slide carries and knows the bed by gravity; it cannot feel a turn
// about the plumb line.
Plan level(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  expect_slides(instrument, stand, 1);
  Walk walk(instrument, nominal, stand.q);
  int plumb = 0;
  instrument.up_b.cwiseAbs().maxCoeff(&plumb);
  for (const StandAxis& slide : stand.slides) {
    const bool primed = joint_of(slide, nominal).side == kinematics::Side::Workpiece;
    std::vector<Channel> channels;
    for (int k = 0; k < 3; ++k) {
      if (k == plumb) continue;
      const Vector3d level_b =
          Vector3d::Unit(k) - Vector3d::Unit(k).dot(instrument.up_b) * instrument.up_b;
      channels.push_back(channel(instrument,
                                 fmt::format("about {} along {}", char('A' + k), slide.name),
                                 Quantity::Angle, level_b.normalized()));
      channels.back().of = primed ? Body::Workpiece : Body::Tool;
      channels.back().in = Body::Bed;
    }
    walk.set_up(set_up(instrument, fmt::format("{} level", slide.name), channels));
    walk.back_and_forth(along(stand.q, slide.joint), travel(instrument, joint_of(slide, nominal)));
    walk.move(stand.q);
  }
  return std::move(walk).finish();
}

// Both lines are read against one flat straightedge: what turns the straightedge is common to
// them, so that their difference is the roll.
Plan roll_lines(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  expect_slides(instrument, stand, 1);
  Walk walk(instrument, nominal, stand.q);
  for (const StandAxis& slide : stand.slides) {
    const Range range = travel(instrument, joint_of(slide, nominal));
    const AxisVector q = middle(stand, slide, range);
    const Across across = metrology::across(nominal, stand.q, slide.direction_w);
    const Vector3d arm_w = 0.5 * instrument.lever * across.direction_w[0];
    const kinematics::Pose T_wt = nominal.tool_in_workpiece(q);
    std::vector<Channel> channels;
    for (const double side : {-1.0, 1.0}) {
      Channel c = channel(instrument,
                          fmt::format("{} along {} at {}{}", across.letter[1], slide.name,
                                      side < 0.0 ? '-' : '+', across.letter[0]),
                          Quantity::Displacement, across.direction_w[1]);
      c.point_of += T_wt.linear().transpose() * (side * arm_w);
      c.point_in = T_wt * c.point_of;
      channels.push_back(c);
    }
    walk.set_up(set_up(instrument, fmt::format("{} roll lines", slide.name), channels));
    walk.back_and_forth(along(stand.q, slide.joint), range);
    walk.move(stand.q);
  }
  return std::move(walk).finish();
}

}  // namespace abbe::errors::metrology
