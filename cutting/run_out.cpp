#include "cutting/run_out.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "cutting/hollow_outline.h"

namespace abbe::cutting {
namespace {

void expect_amount(const char* name, double value) {
  if (std::isfinite(value) && value >= 0.0) return;
  throw std::invalid_argument(
      fmt::format("expected {} run-out of 0 mm or more, seen {}", name, value));
}

}  // namespace

Cutter with_run_out(const Cutter& cutter, double radial, double axial) {
  check_cutter(cutter);
  expect_amount("radial", radial);
  expect_amount("axial", axial);
  if (cutter.outline) return form_cutter(widened(*cutter.outline, radial, axial));
  Cutter result = cutter;
  result.radius += radial;
  result.flank_length += 2.0 * axial;
  return result;
}

}  // namespace abbe::cutting
