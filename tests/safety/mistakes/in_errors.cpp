#include "tests/safety/mistakes/mistake.h"

namespace abbe::safety {
namespace {

const std::string straightness =
    "[EYX]\nkind = \"legendre\"\ncoefficients_um = [0.00, -0.25, -2.20, 1.85, "
    "-0.68]\nhalf_range_mm = 400";

}  // namespace

std::vector<Mistake> mistakes_in_errors() {
  return {
      warning("squareness in rad", "face",
              {{"errors.toml", "EC0Y_urad = 24.0", "EC0Y_urad = 24e-6"}},
              "implausibly small for a machine"),
      warning("squareness in degrees", "face",
              {{"errors.toml", "EC0Y_urad = 24.0", "EC0Y_urad = 0.0014"}},
              "implausibly small for a machine"),
      warning("straightness in mm", "face",
              {{"errors.toml", "coefficients_um = [0.00, -0.25, -2.20, 1.85, -0.68]",
                "coefficients_um = [0.00, -0.00025, -0.00220, 0.00185, -0.00068]"}},
              "errors.EYX is at most"),
      warning("straightness in nm", "face",
              {{"errors.toml", "coefficients_um = [0.00, -0.25, -2.20, 1.85, -0.68]",
                "coefficients_um = [0.00, -250, -2200, 1850, -680]"}},
              "errors.EYX is"),
      input_error("half range in m", "face",
                  {{"errors.toml", "half_range_mm = 400", "half_range_mm = 0.4"}},
                  "that move the tip by at most 1000 mm"),
      warning("half range of the whole travel missed", "face",
              {{"errors.toml", "half_range_mm = 400", "half_range_mm = 40"}},
              "evaluated beyond their stated range"),
      warning("screw pitch in m", "face", {{"errors.toml", "period_mm = 12", "period_mm = 0.012"}},
              "period_mm is 0.012: looks like m"),
      warning("errors of another machine", "face",
              {{"errors.toml", "", library("errors/platform_peng.toml")}},
              "which is implausible for a machine"),
      input_error("errors of a gantry with rotary axes", "face",
                  {{"errors.toml", "", library("errors/gantry_typical.toml")}},
                  "an element that fits the machine"),
      input_error("table of another travel", "face",
                  {{"errors.toml", straightness,
                    "[EYX]\nkind = \"table\"\nq_mm = [0, 10, 20]\nvalue_um = [0, 1, 2]"}},
                  "errors that are defined at the datum"),
      input_error("table reversed", "face",
                  {{"errors.toml", straightness,
                    "[EYX]\nkind = \"table\"\nq_mm = [400, 0, -400]\nvalue_um = [0, 1, 2]"}},
                  "ascending positions"),
      input_error("table with a row twice", "face",
                  {{"errors.toml", straightness,
                    "[EYX]\nkind = \"table\"\nq_mm = [-400, 0, 0, 400]\nvalue_um = [0, 1, 1, 2]"}},
                  "a position above 0"),
      input_error("table of unequal columns", "face",
                  {{"errors.toml", straightness,
                    "[EYX]\nkind = \"table\"\nq_mm = [-400, 0, 400]\nvalue_um = [0, 1]"}},
                  "as many values as positions"),
      warning("positions of a table in m", "face",
              {{"errors.toml", straightness,
                "[EYX]\nkind = \"table\"\nq_mm = [-0.4, 0, 0.4]\nvalue_um = [0, 1, 2]\noutside = "
                "\"hold\""}},
              "tables hold their last value"),
      warning("table holds beyond its range", "face",
              {{"errors.toml", straightness,
                "[EYX]\nkind = \"table\"\nq_mm = [-40, 0, 40]\nvalue_um = [0, 1, 2]\noutside = "
                "\"hold\""}},
              "tables hold their last value"),
      input_error("element named in another standard", "face", {{"errors.toml", "[EYX]", "[DYX]"}},
                  "nearest: errors.EYX"),
      input_error("element of an axis that is not there", "face",
                  {{"errors.toml", "[EYX]", "[EYW]"}}, "an element that fits the machine"),
      warning("scale of errors as percent", "face",
              {{"scene.toml", "errors = \"errors.toml\"", "errors = \"errors.toml\""},
               {"errors.toml", "name = \"three axes, typical\"",
                "name = \"three axes, typical\"\nscale = 100"}},
              "which is implausible for a machine"),
      warning("reversal in mm", "face",
              {{"errors.toml", straightness, "[EYX]\nkind = \"backlash\"\nhalf_um = 0.002"}},
              "errors.EYX is"),
  };
}

}  // namespace abbe::safety
