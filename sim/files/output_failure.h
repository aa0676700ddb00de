#pragma once

#include <stdexcept>

namespace abbe::sim {

/// Output could not be written, or would touch what abbe did not make: exit 5.
struct OutputFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline constexpr const char* mark_name = ".abbe-result";

}  // namespace abbe::sim
