#include "sim/files/one_lined.h"

#include <string>

#include <nlohmann/json.hpp>

#include "kinematics/escape.h"

namespace abbe::sim {

using nlohmann::ordered_json;

ordered_json one_lined(const ordered_json& json) {
  if (json.is_string()) return escaped(json.get_ref<const std::string&>());
  if (json.is_array()) {
    ordered_json all = ordered_json::array();
    for (const ordered_json& one : json) all.push_back(one_lined(one));
    return all;
  }
  if (!json.is_object()) return json;
  ordered_json all = ordered_json::object();
  for (const auto& [key, value] : json.items()) all[escaped(key)] = one_lined(value);
  return all;
}

}  // namespace abbe::sim
