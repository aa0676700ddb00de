#include <array>

#include <fmt/format.h>

#include "errors/metrology/plans.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;

/// From one corner of the travel to the opposite one, the last of its axes going up.
struct Diagonal {
  std::string name;        ///< "+X -Y +Z"
  std::vector<int> joint;  ///< of its axes, by letter
  AxisVector from;
  AxisVector to;
  AxisVector overshoot;  ///< on every axis, the way the diagonal goes
};

/// All diagonals of the box of some axes: half as many as it has corners.
std::vector<Diagonal> box_diagonals(const Instrument& instrument, const Chain& nominal,
                                    const AxisVector& q, const std::vector<StandAxis>& axes) {
  std::vector<Diagonal> result;
  const int count = int(axes.size());
  for (int signs = 0; signs < 1 << (count - 1); ++signs) {
    Diagonal d{"", {}, q, q, AxisVector::Zero(q.size())};
    for (int k = 0; k < count; ++k) {
      const StandAxis& axis = axes[std::size_t(k)];
      const Range range = travel(instrument, nominal.joints()[std::size_t(axis.joint)]);
      const bool down = signs >> k & 1;
      d.name += fmt::format("{}{}{}", k == 0 ? "" : " ", down ? '-' : '+', axis.name);
      d.joint.push_back(axis.joint);
      d.from[axis.joint] = down ? range.to : range.from;
      d.to[axis.joint] = down ? range.from : range.to;
      d.overshoot[axis.joint] = down ? -range.overshoot : range.overshoot;
    }
    result.push_back(d);
  }
  return result;
}

/// The channel along a diagonal, counting from where the reflector is at its start.
Channel along_diagonal(const Instrument& instrument, const Chain& nominal, const Diagonal& d,
                       Quantity quantity) {
  const Vector3d start_w = reflector_w(instrument, nominal, d.from);
  const Vector3d direction_w = (reflector_w(instrument, nominal, d.to) - start_w).normalized();
  Channel c = channel(instrument, "along " + d.name, quantity, direction_w);
  c.point_in = start_w;
  return c;
}

void check_slides(const Instrument& instrument, const Stand& stand, std::size_t count) {
  expect_slides(instrument, stand, int(count));
  if (stand.slides.size() > 3)
    refuse(instrument, fmt::format("expected at most 3 slides, seen {}", stand.slides.size()));
  for (std::size_t a = 0; a < stand.slides.size(); ++a)
    for (std::size_t b = a + 1; b < stand.slides.size(); ++b)
      if (!cross(stand.slides[a], stand.slides[b]))
        refuse(instrument, fmt::format("expected slides across each other, seen {} along {}",
                                       stand.slides[a].name, stand.slides[b].name));
}

}  // namespace

Plan diagonals(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  check_slides(instrument, stand, 2);
  std::vector<Diagonal> list;
  const auto add = [&](const std::string& kind, const std::vector<StandAxis>& axes) {
    for (Diagonal& d : box_diagonals(instrument, nominal, stand.q, axes)) {
      d.name = kind + " diagonal " + d.name;
      list.push_back(d);
    }
  };
  const std::vector<StandAxis>& s = stand.slides;
  if (s.size() == 3) add("body", s);
  for (std::size_t a = 0; a < s.size(); ++a)
    for (std::size_t b = a + 1; b < s.size(); ++b) add("face", {s[a], s[b]});

  Walk walk(instrument, nominal, stand.q);
  for (const Diagonal& d : list) {
    walk.set_up(set_up(instrument, d.name,
                       {along_diagonal(instrument, nominal, d, Quantity::Displacement)}));
    const double overshoot = d.overshoot.cwiseAbs().sum() / (d.to - d.from).cwiseAbs().sum();
    walk.back_and_forth([&](double part) { return AxisVector(d.from + part * (d.to - d.from)); },
                        {0.0, 1.0, overshoot});
  }
  walk.move(stand.q);
  return std::move(walk).finish();
}

// Reading 0 of a run is at the start; reading 3 k + leg is after leg X (1), Y (2) or Z (3) of step
// k. Every leg goes its axis's way up the diagonal, so that no axis turns back within a run.
Plan step_diagonal(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  check_slides(instrument, stand, 3);
  Walk walk(instrument, nominal, stand.q);
  for (const Diagonal& d : box_diagonals(instrument, nominal, stand.q, stand.slides)) {
    Channel c = along_diagonal(instrument, nominal, d, Quantity::Mirror);
    c.normal_of = nominal.tool_in_workpiece(d.from).linear().transpose() * c.direction_in;
    SetUp optics = set_up(instrument, "step diagonal " + d.name, {c});
    optics.normal_sigma = instrument.rotation_sigma;
    walk.set_up(optics);
    const auto read = [&](int run, int target) {
      walk.wait(instrument.dwell_s);
      walk.read(run, target);
    };
    for (int run = 0; run < instrument.runs; ++run) {
      walk.move(d.from - d.overshoot);
      walk.move(d.from);
      read(run, 0);
      for (int step = 1; step <= instrument.targets; ++step) {
        for (int leg = 0; leg < 3; ++leg) {
          const int joint = d.joint[std::size_t(leg)];
          AxisVector q = walk.q();
          q[joint] = d.from[joint] + (d.to[joint] - d.from[joint]) * step / instrument.targets;
          walk.move(q);
          read(run, 3 * (step - 1) + leg + 1);
        }
      }
    }
  }
  walk.move(stand.q);
  return std::move(walk).finish();
}

}  // namespace abbe::errors::metrology
