#pragma once

#include <stdexcept>

#include "sim/cut/job.h"

namespace abbe::sim {

/// What a table of the errors that is left says, as a fault of the scene.
template <typename Act>
auto inside_tables(const Job& job, const Act& act) {
  try {
    return act();
  } catch (const std::out_of_range& left) {
    throw BadInput(job.scene.file.string(), 0, 0, "a program inside the tables of the errors",
                   left.what());
  }
}

}  // namespace abbe::sim
