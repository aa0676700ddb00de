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

/// Returns the figures of a map for a picture, um.
inline render::Figures figures(const cutting::Statistics& s) {
  const auto um = [](const std::optional<double>& mm) {
    return mm ? *mm / units::um : std::numeric_limits<double>::quiet_NaN();
  };
  return {um(s.pv), um(s.rms), um(s.mean)};
}

/// Returns the percentages of the judged area in, over and under the tolerance, and not cut.
inline render::TolerancePercentages percentages(const cutting::Conformance& c) {
  return {c.in, c.over, c.under, c.uncut};
}

/// Returns the body with the fields of `stock.vtp`, in the workpiece frame.
render::StockField stock_field(const StockCheck& check);

/// Returns the metadata of `stock.vtp`.
render::Facts stock_facts(const StockCheck& check);

/// Returns the contents of `stock.png`, in the part frame like the map, with the largest findings
/// of each kind.
render::StockPicture stock_picture(const Job& job, const Verdict& verdict, const StockCheck& check,
                                   const render::StockField& field);

/// Returns the first contact or, without contacts, the nearest near miss; null if there is neither.
const Collision* first_event(const Collisions& collisions);

/// Returns a picture of an event: the whole machine with the two bodies in red, and beside it a
/// close view of the part and these two bodies.
render::MachinePicture collision_picture(const Job& job, const Collisions& collisions,
                                         const Collision& event);

/// Returns the chart of the smallest clearance of every block over time, for the pairs with
/// contacts and the nearest pairs; without series if no pair was examined.
render::Panel clearance_panel(const Collisions& collisions);

/// Returns the caption of the chart: the meaning of the bound, and the pairs that it leaves out.
std::vector<std::string> clearance_caption(const Collisions& collisions);

}  // namespace abbe::sim
