#include <cmath>
#include <iostream>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/loop/compensate.h"
#include "sim/report/verdict.h"
#include "sim/scene/read_scene.h"

namespace abbe::sim {
namespace {

/// Machine's part of the map of a case, mm RMS.
double machine_rms(const Job& job, const std::optional<CaseDescription>& compensator) {
  const Verdict error_free = judge(job, cut_error_free(job), nullptr);
  return judge(job, cut(job, compensator), &error_free).machine_contribution->rms.value();
}

Job coarse_job(const std::vector<Override>& more = {}) {
  std::vector<Override> overrides{{"part.vertices", "1500"},
                                  {"program.step_over_mm", "2"},
                                  {"program.step_mm", "2"},
                                  {"cutting.spacing_mm", "1"}};
  overrides.insert(overrides.end(), more.begin(), more.end());
  return prepare(read_scene(std::filesystem::path(ABBE_SOURCE_DIR) / "scenes" / "gantry_fused.toml",
                            overrides));
}

TEST(FusedBelief, OneCorrectionServesGeometryHeatAndForce) {
  const Job job = coarse_job();
  const double before = machine_rms(job, std::nullopt);
  const double composite = machine_rms(job, parse_case("composite-iterated-ideal"));
  const double fused = machine_rms(job, parse_case("fused-iterated-ideal"));
  std::cout << "machine's part " << before / units::um << " um RMS, geometry and heat compensated "
            << composite / units::um << ", force too " << fused / units::um << "\n";
  EXPECT_LT(fused, 0.05 * before);
  EXPECT_LT(fused, composite);
}

TEST(FusedBelief, PartThatWasMeasuredIsNotCorrectedTwice) {
  const Job job = coarse_job({{"belief.part", "{instrument = \"cmm\"}"}});
  const double before = machine_rms(job, std::nullopt);
  const double composite = machine_rms(job, parse_case("composite-iterated-ideal"));
  const double fused = machine_rms(job, parse_case("fused-iterated-ideal"));
  std::cout << "machine's part " << before / units::um << " um RMS, geometry and heat compensated "
            << composite / units::um << ", force and part too " << fused / units::um << "\n";
  EXPECT_LT(fused, 0.05 * before);
}

}  // namespace
}  // namespace abbe::sim
