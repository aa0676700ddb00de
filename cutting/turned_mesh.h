#pragma once

#include "cutting/engagement.h"

namespace abbe::cutting {

/// A turned part as a closed mesh: its profile, thinned to where it bends by more than 1 um or
/// where skin and cut meet, turned around the spindle line. `line` as in TurnedStock.
/// @param around  vertices on a circle, >= 3
StockMesh stock_mesh(const TurnedStock& stock, int around = 180);

}  // namespace abbe::cutting
