#include "sim/scene/scene_sections.h"

namespace abbe::sim {

const Fields<Scene>& sampling_fields() {
  static const Fields<Scene> fields =
      Fields<Scene>()
          .number(
              "chord_tolerance_nm", &Scene::chord_tolerance, {0.01, 1e6, false, false},
              "how far the commanded tool may be from its path between two samples of it; how far "
              "errors bend in between is reported, between_samples: see max_step_mm")
          .number(
              "max_step_mm", &Scene::max_step, positive,
              "between two samples at most; an error of amplitude a and period p is followed to "
              "a (pi step / p)^2 / 2");
  return fields;
}

const Fields<Scene>& search_fields() {
  static const Fields<Scene> fields = Fields<Scene>().number(
      "band_mm", &Scene::band, positive,
      "how far the machined surface is sought along the normal; a gouge deeper than it is followed "
      "to ten bands, counted apart and left out of PV and RMS");
  return fields;
}

const Fields<ViewDescription>& view_fields() {
  static const Fields<ViewDescription> fields =
      Fields<ViewDescription>()
          .direction("from", &ViewDescription::from,
                     "direction from the part to the camera, in the part frame")
          .direction("up", &ViewDescription::up, "what is up in the picture, in the part frame")
          .number_as_written(KeyName("range_um").otherwise("fitted"), &ViewDescription::range_um,
                             positive, "the colour scale runs from -range to range")
          .check([](TableReader& reader, ViewDescription& view) {
            if (view.from.cross(view.up).norm() < 1e-6 * view.from.norm())
              reader.refuse("up", "a direction across view.from for view.up", "one along it");
          });
  return fields;
}

const Fields<Limits>& limits_fields() {
  static const Fields<Limits> fields =
      Fields<Limits>()
          .number_as_written("pv_um", &Limits::pv_um, non_negative,
                             "of the residual; exceeded, `abbe` exits with 1, and a gouge deeper "
                             "than the band exceeds each limit")
          .number_as_written("rms_um", &Limits::rms_um, non_negative, "the same")
          .number_as_written("max_abs_um", &Limits::max_abs_um, non_negative, "the same")
          .number_as_written("form_pv_um", &Limits::form_pv_um, non_negative,
                             "the same of `form_um`, the residual through the areal filter")
          .number_as_written("form_rms_um", &Limits::form_rms_um, non_negative, "the same")
          .number_as_written("texture_sa_um", &Limits::texture_sa_um, non_negative,
                             "the same of `texture_um`, what that filter leaves out")
          .number_as_written("texture_sq_um", &Limits::texture_sq_um, non_negative, "the same")
          .number_as_written("texture_sz_um", &Limits::texture_sz_um, non_negative, "the same")
          .boolean("tolerance", &Limits::tolerance,
                   "whether a verdict of FAIL (`part.tolerance_um`) makes `abbe` exit with 1, too");
  return fields;
}

}  // namespace abbe::sim
