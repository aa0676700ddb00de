#pragma once

#include "tests/test.h"

/// Warnings of packaged scenes that are true and stay.
namespace abbe::sim {

struct Remark {
  std::string scene;         ///< without ending
  std::string text;          ///< part of the warning
  bool is_of_check = false;  ///< `check` gives it, else only a cut
};

/// Returns every one, with its reason.
inline std::vector<Remark> packaged_remarks() {
  const std::string coarse = "the map is too coarse for the machined surface";
  std::vector<Remark> remarks{// the scene is there to show this collision
                              {"clamped_dome", "tall clamp and holder collide on line", true},
                              // the scene is there to show a mesh whose facets count
                              {"gantry_mesh", "its facets deviate from the true surface"},
                              // its vertices lie under the passes on purpose, cusps between them
                              {"on_machine_measurement", coarse}};
  // The number of vertices is chosen so that the scene takes seconds: what is read from it is the
  // form, the machine's part or the heat, not the cusps.
  for (const char* scene :
       {"gantry_channels", "gantry_force", "gantry_fused", "gantry_perfect", "gantry_tilted_flat",
        "gantry_warmup_training", "platform_perfect", "step_diagonal", "thermal_protocol",
        "thermal_protocol_chen", "yang_axis", "yang_composite"})
    remarks.push_back({scene, coarse});
  return remarks;
}

inline bool is_remark(const std::string& scene, const std::string& warning) {
  for (const Remark& remark : packaged_remarks())
    if (remark.scene == scene && warning.find(remark.text) != std::string::npos) return true;
  return false;
}

}  // namespace abbe::sim
