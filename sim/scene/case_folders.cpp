#include "sim/scene/case_folders.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

namespace abbe::sim {
namespace {

/// A folder and what it is for.
struct CaseFolder {
  std::string name;
  std::string of;  ///< in words
  Place place;
};

/// Of the cases of the scene, or of the name of a variant.
Place place_of_cases(const Node& scene) {
  const Node* compare = scene.find("compare");
  const Node* cases = compare ? compare->find("cases") : nullptr;
  return cases ? cases->place : scene.place;
}

Place place_of_variant(const Node& scene, std::size_t index) {
  const Node* list = scene.find("variant");
  if (!list || !list->array() || index >= list->array()->size()) return scene.place;
  const Node& variant = (*list->array())[index];
  const Node* name = variant.find("name");
  return name ? name->place : variant.place;
}

std::vector<CaseFolder> listed(const Node& scene, const ComparedNames& names) {
  std::vector<CaseFolder> all;
  const Place cases = place_of_cases(scene);
  for (const char* name : {"error_free", "uncompensated"})
    all.push_back({name, fmt::format("the case \"{}\"", name), cases});
  for (const CaseDescription& one : names.cases)
    all.push_back({one.name, fmt::format("the case \"{}\"", one.name), cases});
  for (std::size_t i = 0; i < names.variants.size(); ++i) {
    const auto& [variant, own] = names.variants[i];
    const Place place = place_of_variant(scene, i);
    all.push_back({variant, fmt::format("the variant \"{}\"", variant), place});
    for (const CaseDescription& one : own)
      all.push_back({case_folder(variant, one.name),
                     fmt::format("the case \"{}\" of the variant \"{}\"", one.name, variant),
                     place});
  }
  return all;
}

}  // namespace

std::string case_folder(const std::string& variant, const std::string& case_name) {
  if (variant.empty()) return case_name;
  return case_name == "uncompensated" ? variant : variant + "-" + case_name;
}

std::vector<std::string> case_folders(const ComparedNames& names) {
  std::vector<std::string> all;
  for (CaseFolder& one : listed({}, names)) all.push_back(std::move(one.name));
  return all;
}

void check_case_folders(const Node& scene, const ComparedNames& names, Faults& faults) {
  std::map<std::string, std::string> taken;
  for (const char* name : result_names) taken.emplace(name, "a file of the results");
  for (const CaseFolder& one : listed(scene, names)) {
    const auto [other, is_new] = taken.emplace(one.name, one.of);
    if (!is_new)
      faults.add(one.place, "a folder of its own for every case",
                 fmt::format("\"{}\" for {} and for {}", one.name, one.of, other->second));
  }
}

}  // namespace abbe::sim
