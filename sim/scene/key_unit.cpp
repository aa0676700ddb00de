#include "sim/scene/key_unit.h"

#include <array>

#include "kinematics/units.h"

namespace abbe::sim {

namespace {

struct Unit {
  std::string_view suffix;
  double factor;
};
// Longer suffixes first: "_mm_per_min" also ends in a unit of its own.
constexpr std::array known_units{
    Unit{"_Nm_per_rpm", 1e3},
    Unit{"_Nm_per_urad", 1e9},
    Unit{"_urad_per_m_K", 1e-9},
    Unit{"_urad_per_m", 1e-9},
    Unit{"_um_per_m_K", 1e-6},
    Unit{"_urad_per_K", units::urad},
    Unit{"_N_s_per_mm", 1.0},
    Unit{"_N_per_mm2", 1.0},
    Unit{"_um_per_K", units::um},
    Unit{"_um_per_N", units::um},
    Unit{"_um_urad", 1.0},  // each number as its element is: um or urad
    Unit{"_um_per_m", 1e-6},
    Unit{"_um_per_h", units::um / 3600.0},
    Unit{"_N_per_um", 1e3},
    Unit{"_Nm_per_A", 1e3},
    Unit{"_N_per_mm", 1.0},
    Unit{"_J_per_K", 1.0},
    Unit{"_W_per_K", 1.0},
    Unit{"_deg_per_min", units::deg / 60.0},
    Unit{"_mm_per_min", units::mm_per_min},
    Unit{"_mm_per_rev", 1.0},
    Unit{"_um_per_rev", units::um},
    Unit{"_deg_per_s", units::deg},
    Unit{"_mm_per_s", 1.0},
    Unit{"_arcsec", units::deg / 3600.0},
    Unit{"_urad", units::urad},
    Unit{"_mrad", 1e-3},
    Unit{"_rad", 1.0},
    Unit{"_GPa", 1e3},
    Unit{"_MPa", 1.0},
    Unit{"_deg", units::deg},
    Unit{"_rpm", units::rpm},
    Unit{"_inch", units::inch},
    Unit{"_min", 60.0},
    Unit{"_um", units::um},
    Unit{"_nm", units::nm},
    Unit{"_mm", 1.0},
    Unit{"_ms", 1e-3},
    Unit{"_kg", 1.0},
    Unit{"_Hz", 1.0},
    Unit{"_Nm_s", 1e3},
    Unit{"_Nm", 1e3},
    Unit{"_cm", 10.0},
    Unit{"_m", 1000.0},
    Unit{"_s", 1.0},
    Unit{"_h", 3600.0},
    Unit{"_W", 1.0},
    Unit{"_K", 1.0},
    Unit{"_C", 1.0},
    Unit{"_N", 1.0},
    Unit{"_A", 1.0},
};

const Unit* unit_at_end(std::string_view key) {
  for (const Unit& unit : known_units) {
    if (key.size() > unit.suffix.size() && key.ends_with(unit.suffix)) return &unit;
  }
  return nullptr;
}

}  // namespace

double unit_of(std::string_view key) {
  const Unit* unit = unit_at_end(key);
  return unit ? unit->factor : 1.0;
}

std::string_view stem_of(std::string_view key) {
  const Unit* unit = unit_at_end(key);
  return unit ? key.substr(0, key.size() - unit->suffix.size()) : key;
}

std::string unit_name(std::string_view key) {
  const Unit* unit = unit_at_end(key);
  return unit ? std::string(unit->suffix.substr(1)) : std::string("no unit");
}

}  // namespace abbe::sim
