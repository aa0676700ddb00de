#include "sim/scene/scene.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim {

Scene::Scene() = default;
Scene::Scene(const Scene&) = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(const Scene&) = default;
Scene& Scene::operator=(Scene&&) noexcept = default;
Scene::~Scene() = default;

std::vector<ToolDescription> all_tools(const Scene& scene) {
  std::vector<ToolDescription> tools{scene.tool};
  tools.insert(tools.end(), scene.additional_tools.begin(), scene.additional_tools.end());
  return tools;
}

namespace {

/// Returns the entry of a tool in the control's table; null without a table or an entry.
const dialects::ControlTableTool* find_table_entry(const Scene& scene,
                                                   const ToolDescription& tool) {
  if (!scene.program.tools || !tool.number) return nullptr;
  const auto& entries = scene.program.tools->table.tools;
  const auto entry = entries.find(*tool.number);
  return entry == entries.end() ? nullptr : &entry->second;
}

/// Returns a text such as "a length of 80.005 mm, 5 um more than the true 80 mm"; empty if both
/// values agree.
/// @param quantity  "length" or "radius"
std::string difference_text(const char* quantity, double believed, double actual) {
  constexpr double tolerance = 1e-6;  // mm; tables have four to six decimals
  const double difference = believed - actual;
  if (std::abs(difference) <= tolerance) return "";
  return fmt::format("a {} of {:.10g} mm, {:.6g} um {} than the true {:.10g} mm", quantity,
                     believed, std::abs(difference) / units::um, difference > 0.0 ? "more" : "less",
                     actual);
}

}  // namespace

double control_tool_length(const Scene& scene, const ToolDescription& tool) {
  const dialects::ControlTableTool* entry = find_table_entry(scene, tool);
  if (entry && entry->length) return *entry->length;
  return scene.control.tool_length.value_or(tool.length);
}

std::vector<std::string> tool_table_warnings(const Scene& scene) {
  if (!scene.program.tools) return {};
  std::vector<std::string> warnings;
  for (const ToolDescription& tool : all_tools(scene)) {
    const dialects::ControlTableTool* entry = find_table_entry(scene, tool);
    // The program may never call the tool, so this is a warning and not an input error.
    if (!entry) {
      warnings.push_back(fmt::format(
          "the tool table of the control has no T{}; a program that calls it is rejected",
          tool.number.value_or(0)));
      continue;
    }
    std::string differences;
    const auto add = [&](const std::string& difference) {
      if (!difference.empty()) differences += (differences.empty() ? "" : ", and ") + difference;
    };
    if (entry->length) add(difference_text("length", *entry->length, tool.actual_length));
    const auto* cutter = std::get_if<cutting::Cutter>(&tool.actual);
    // Only milling cutters have a radius that can be compared.
    if (cutter && entry->radius) add(difference_text("radius", *entry->radius, cutter->radius));
    if (!differences.empty())
      warnings.push_back(
          fmt::format("the control believes T{} to have {}", tool.number.value_or(0), differences));
  }
  return warnings;
}

Scene select_tool(Scene scene, int number) {
  const std::vector<ToolDescription> tools = all_tools(scene);
  const auto tool = std::ranges::find_if(
      tools, [&](const ToolDescription& candidate) { return candidate.number == number; });
  if (tool == tools.end()) throw std::out_of_range("a tool that the scene describes");
  scene.tool = *tool;
  scene.additional_tools.clear();
  return apply_tool_sections(std::move(scene));
}

bool has_cutting_force(const Scene& scene) {
  const auto has_material = [](const ToolDescription& tool) { return tool.material.has_value(); };
  return scene.cutting &&
         (scene.cutting->material || std::ranges::any_of(all_tools(scene), has_material));
}

Scene apply_tool_sections(Scene scene) {
  const ToolDescription& tool = scene.tool;
  if (scene.cutting && tool.flutes) scene.cutting->flutes = *tool.flutes;
  if (scene.cutting && tool.material) scene.cutting->material = tool.material;
  // Without [compliance] everything but the tool is stiff.
  if (tool.compliance && !scene.compliance) scene.compliance.emplace();
  if (tool.compliance) scene.compliance->tool = *tool.compliance;
  return scene;
}

}  // namespace abbe::sim
