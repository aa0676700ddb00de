#pragma once

#include "render/stock_picture.h"
#include "sim/report/stock_check.h"

namespace abbe::sim {

/// The body as `stock.vtp` has it, in the workpiece frame.
render::StockField stock_field(const StockCheck& check);

/// What `stock.vtp` says of itself.
render::Facts stock_facts(const StockCheck& check);

/// `stock.png`: in the part frame, as the map, with the three largest findings of each kind.
render::StockPicture stock_picture(const Job& job, const Verdict& verdict, const StockCheck& check,
                                   const render::StockField& field);

}  // namespace abbe::sim
