#pragma once

#include <optional>

#include "cutting/cutter_entry.h"

namespace abbe::cutting {

struct BallAnswer {
  bool decided = false;
  std::optional<Entry> entry;
};

/// `first_entry` for a ball end (the common case) where its flank and top cannot matter; undecided
/// elsewhere. Which way a value is found does not depend on `limit`.
BallAnswer ball_entry(const Cutter& cutter, const Move& move, const Ray& ray, double limit);

}  // namespace abbe::cutting
