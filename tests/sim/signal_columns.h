#pragma once

#include <map>
#include <string>

#include <gtest/gtest.h>

#include "sim/cut/signals.h"

namespace abbe::sim {

/// Columns by name.
inline std::map<std::string, Eigen::VectorXd> columns(const Signals& signals) {
  std::map<std::string, Eigen::VectorXd> all;
  for (std::size_t k = 0; k < signals.columns.size(); ++k)
    all[signals.columns[k]] = signals.rows.col(Eigen::Index(k));
  EXPECT_EQ(all.size(), signals.columns.size()) << "a column twice";
  return all;
}

}  // namespace abbe::sim
