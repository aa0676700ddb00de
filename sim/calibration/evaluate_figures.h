#pragma once

#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "kinematics/units.h"

namespace abbe::sim {

/// Figures of one test in its unit, um or urad.
class Figures {
 public:
  Figures(nlohmann::ordered_json& test, bool angle) : test_(test), angle_(angle) {}
  void put(const std::string& name, double value) { test_[key(name)] = in_unit(value); }
  void put(const std::string& name, const std::optional<double>& value) {
    test_[key(name)] =
        value ? nlohmann::ordered_json(in_unit(*value)) : nlohmann::ordered_json(nullptr);
  }

 private:
  std::string key(const std::string& name) const { return name + (angle_ ? "_urad" : "_um"); }
  double in_unit(double value) const { return value / (angle_ ? units::urad : units::um); }
  nlohmann::ordered_json& test_;
  bool angle_;
};

inline nlohmann::ordered_json test_json(const std::string& name, const char* standard) {
  return {{"name", name}, {"standard", standard}};
}

}  // namespace abbe::sim
