#include "sim/scene/scene_sections.h"

namespace abbe::sim {

namespace {

const Fields<cutting::CuttingCoefficients>& material_fields() {
  using K = cutting::CuttingCoefficients;
  static const Fields<K> fields =
      Fields<K>()
          .text(must("name"), &K::name, "of the material and the tool")
          .text(must("source"), &K::source, "where the figures come from")
          .number(must("K_tc_N_per_mm2"), &K::K_tc, positive, "tangential force per chip area")
          .number(must("K_rc_N_per_mm2"), &K::K_rc, non_negative, "radial force per chip area")
          .number(must("K_ac_N_per_mm2"), &K::K_ac, any_number, "axial force per chip area")
          .number(must("K_te_N_per_mm"), &K::K_te, non_negative, "tangential force per edge length")
          .number(must("K_re_N_per_mm"), &K::K_re, non_negative, "radial force per edge length")
          .number(must("K_ae_N_per_mm"), &K::K_ae, any_number, "axial force per edge length");
  return fields;
}

}  // namespace

cutting::CuttingCoefficients read_material(const Node& table, Faults& faults) {
  return material_fields().read_table(table, "material", faults);
}

Node::Table written_material(const cutting::CuttingCoefficients& material) {
  return material_fields().written(material);
}

std::vector<Key> material_keys() { return material_fields().keys(); }

}  // namespace abbe::sim
