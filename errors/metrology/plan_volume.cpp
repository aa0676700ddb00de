#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "errors/metrology/plans.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;

std::vector<AxisVector> travel_grid(const Instrument& instrument, const Chain& nominal,
                                    const Stand& stand) {
  std::vector<GridLine> lines;
  for (const StandAxis& slide : stand.slides) {
    const Range range = travel(instrument, nominal.joints()[std::size_t(slide.joint)]);
    lines.push_back({slide.joint, targets(range, instrument.targets)});
  }
  return grid(instrument, stand.q, lines);
}

/// The box that the reflector goes through: its centre and half its edges, a third across two.
struct Box {
  Vector3d centre_w;
  std::array<Vector3d, 3> half_w;
};

Box box(const Instrument& instrument, const Chain& nominal, const Stand& stand) {
  Box b{reflector_w(instrument, nominal, stand.q), {}};
  for (std::size_t k = 0; k < 3; ++k) {
    if (k < stand.slides.size()) {
      const StandAxis& slide = stand.slides[k];
      const Range range = travel(instrument, nominal.joints()[std::size_t(slide.joint)]);
      b.half_w[k] = 0.5 * (range.to - range.from) * slide.direction_w;
    } else {
      b.half_w[k] = b.half_w[0].norm() * b.half_w[0].cross(b.half_w[1]).normalized();
    }
  }
  return b;
}

Vector3d place(const Box& box, double a, double b, double c) {
  return box.centre_w + a * box.half_w[0] + b * box.half_w[1] + c * box.half_w[2];
}

void check(const Instrument& instrument, const Stand& stand) {
  expect_slides(instrument, stand, 2);
  if (stand.slides.size() > 3)
    refuse(instrument, fmt::format("expected at most 3 slides, seen {}", stand.slides.size()));
}

}  // namespace

// The two angles of a tracker are displacements across its beam, so that every place has two
// channels of its own, as noisy as the angle times the range; the range has one for all.
Plan tracker(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  check(instrument, stand);
  const std::vector<AxisVector> places = travel_grid(instrument, nominal, stand);
  const Vector3d station_w =
      instrument.at_w ? *instrument.at_w : place(box(instrument, nominal, stand), -2.5, -2.0, 0.4);
  std::vector<Channel> channels = {
      channel(instrument, "range", Quantity::Length, Vector3d::UnitX())};
  channels[0].point_in = station_w;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Vector3d beam_w = reflector_w(instrument, nominal, places[i]) - station_w;
    if (!(beam_w.norm() > 1.0))
      refuse(instrument, "expected a station off the places that it looks at");
    const Across across = metrology::across(nominal, stand.q, beam_w.normalized());
    for (int k = 0; k < 2; ++k) {
      Channel c = channel(instrument, fmt::format("{} of place {}", across.letter[k], i),
                          Quantity::Displacement, across.direction_w[k]);
      c.point_in = station_w;
      c.noise = instrument.noise_rad * beam_w.norm();
      c.resolution = instrument.resolution_rad * beam_w.norm();
      channels.push_back(c);
    }
  }
  SetUp station = set_up(instrument, "station", std::move(channels));
  station.zero_unknown = false;  // the range counts from the station's own centre
  station.point_in_sigma = instrument.position_sigma;
  Walk walk(instrument, nominal, stand.q);
  walk.set_up(station);
  walk.visit(places, [](int target) {
    return std::vector<int>{0, 2 * target + 1, 2 * target + 2};
  });
  return std::move(walk).finish();
}

// One instrument is carried from place to place and the whole grid is visited from each; three
// places are low, the fourth is high, so that no plane holds all four.
Plan multilateration(const Instrument& instrument, const Chain& nominal) {
  const Stand stand = metrology::stand(instrument, nominal);
  check(instrument, stand);
  const std::vector<AxisVector> places = travel_grid(instrument, nominal, stand);
  const Box b = box(instrument, nominal, stand);
  const std::array<Vector3d, 4> stations_w = {place(b, -1.3, -1.3, -1.3), place(b, 1.3, -1.3, -1.3),
                                              place(b, -1.3, 1.3, -1.3), place(b, 1.3, 1.3, 1.3)};
  Walk walk(instrument, nominal, stand.q);
  for (std::size_t k = 0; k < stations_w.size(); ++k) {
    Channel c = channel(instrument, "length", Quantity::Length, Vector3d::UnitX());
    c.point_in = stations_w[k];
    SetUp station = set_up(instrument, fmt::format("station {}", k + 1), {c});
    station.rotation_sigma = 0.0;  // a length has no direction
    station.point_in_sigma = instrument.position_sigma;
    walk.set_up(station);
    walk.visit(places);
  }
  return std::move(walk).finish();
}

}  // namespace abbe::errors::metrology
