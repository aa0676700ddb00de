#pragma once

#include <limits>
#include <optional>

#include "cutting/map/residual.h"
#include "kinematics/units.h"
#include "render/figures.h"
#include "render/machine_picture.h"
#include "render/plot.h"
#include "render/residual_map.h"
#include "render/stock_picture.h"
#include "sim/cut/collision_events.h"
#include "sim/report/stock_check.h"

namespace abbe::sim {

/// What a map comes to, as pictures print it.
inline render::Figures figures(const cutting::Statistics& s) {
  const auto um = [](const std::optional<double>& mm) {
    return mm ? *mm / units::um : std::numeric_limits<double>::quiet_NaN();
  };
  return {um(s.pv), um(s.rms), um(s.mean)};
}

inline render::ToleranceShares shares(const cutting::Conformance& c) {
  return {c.in, c.over, c.under, c.uncut};
}

/// The body as `stock.vtp` has it, in the workpiece frame.
render::StockField stock_field(const StockCheck& check);

/// What `stock.vtp` says of itself.
render::Facts stock_facts(const StockCheck& check);

/// `stock.png`: in the part frame, as the map, with the three largest findings of each kind.
render::StockPicture stock_picture(const Job& job, const Verdict& verdict, const StockCheck& check,
                                   const render::StockField& field);

/// The first contact, or else the pair that comes nearest of the near misses; null where there is
/// neither.
const Collision* first_of(const Collisions& collisions);

/// The machine with all its bodies at the moment of an event, the two in red, beside the part and
/// the two alone.
render::MachinePicture collision_picture(const Job& job, const Collisions& collisions,
                                         const Collision& event);

/// The smallest clearance of every block over time, of the pairs that meet and of those that have
/// it most; no series where no pair was looked at.
render::Panel clearance_panel(const Collisions& collisions);

/// Of what that is a lower bound, and which pairs it leaves out.
std::vector<std::string> clearance_caption(const Collisions& collisions);

}  // namespace abbe::sim
