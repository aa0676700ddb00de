#include "sim/report/rendered_result.h"

#if ABBE_RENDER

#include "cutting/part/primitive.h"
#include "render/residual_field.h"
#include "tests/cutting/map_over.h"
#include "tests/sim/scene_folder.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

/// A map whose form is its slope.
render::Field sloping(const cutting::Design& design, double slope) {
  const auto value = [&](const Vector3d& p, const Vector3d&) {
    return 1e-3 * (slope * p.x() + std::sin(20.0 * p.y()));
  };
  render::Field field = render::make_field(design, cutting::map_over(design, value));
  field.form_um = slope * design.vertices.col(0);
  return field;
}

TEST(RenderedResult, ADifferenceHasTheDifferenceOfTheForms) {
  const SceneFolder folder;
  const cutting::Design plane = cutting::tessellate(cutting::RectanglePlane{8.0, 6.0}, {300});
  for (const auto& [name, slope] : {std::pair{"one", 5.0}, {"other", 2.0}}) {
    fs::create_directories(folder.path() / name);
    render::write_residual(folder.path() / name / "residual.vtp", sloping(plane, slope));
  }
  RenderOptions options;
  options.result = folder.path() / "one";
  options.minus = folder.path() / "other";
  options.out = folder.path() / "difference";
  options.size = {400, 320};
  render_result(options);
  const render::Field made = render::read_residual(options.out / "difference.vtp");
  const VectorXd expected = 3.0 * plane.vertices.col(0);
  EXPECT_LT((made.deviation_um - expected).cwiseAbs().maxCoeff(), 1e-12);
  ASSERT_EQ(made.form_um.size(), expected.size());
  EXPECT_LT((made.form_um - expected).cwiseAbs().maxCoeff(), 1e-12);
}

}  // namespace
}  // namespace abbe::sim

#endif
