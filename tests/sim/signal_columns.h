#pragma once

#include "sim/cut/signals.h"
#include "tests/test.h"

namespace abbe::sim {

/// Columns by name.
inline std::map<std::string, VectorXd> columns(const Signals& signals) {
  std::map<std::string, VectorXd> all;
  for (std::size_t k = 0; k < signals.columns.size(); ++k)
    all[signals.columns[k]] = signals.rows.col(Index(k));
  EXPECT_EQ(all.size(), signals.columns.size()) << "a column twice";
  return all;
}

}  // namespace abbe::sim
