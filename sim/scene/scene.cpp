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
const dialects::TableTool* in_table(const Scene& scene, const ToolDescription& tool) {
  if (!scene.program.tools || !tool.number) return nullptr;
  const auto& known = scene.program.tools->table.tools;
  const auto found = known.find(*tool.number);
  return found == known.end() ? nullptr : &found->second;
}

/// Returns "a length of 80.005 mm, 5 um more than the true one"; empty if both agree.
std::string apart(const char* what, double believed, double truly) {
  constexpr double same = 1e-6;  // mm; tables have four to six decimals
  const double more = believed - truly;
  if (std::abs(more) <= same) return "";
  return fmt::format("a {} of {:.10g} mm, {:.6g} um {} than the true {:.10g} mm", what, believed,
                     std::abs(more) / units::um, more > 0.0 ? "more" : "less", truly);
}

}  // namespace

double control_tool_length(const Scene& scene, const ToolDescription& tool) {
  const dialects::TableTool* known = in_table(scene, tool);
  if (known && known->length) return *known->length;
  return scene.control.tool_length.value_or(tool.length);
}

std::vector<std::string> tool_table_warnings(const Scene& scene) {
  if (!scene.program.tools) return {};
  std::vector<std::string> warnings;
  for (const ToolDescription& tool : all_tools(scene)) {
    const dialects::TableTool* known = in_table(scene, tool);
    // The program may never call the tool, so its absence is a warning and not an error.
    if (!known) {
      warnings.push_back(
          fmt::format("the tool table of the control has no T{}: a program that "
                      "calls it is refused",
                      tool.number.value_or(0)));
      continue;
    }
    std::string text;
    const auto add = [&](const std::string& one) {
      if (!one.empty()) text += (text.empty() ? "" : ", and ") + one;
    };
    if (known->length) add(apart("length", *known->length, tool.actual_length));
    const auto* cutter = std::get_if<cutting::Cutter>(&tool.actual);
    // Only milling cutters have a radius that can be compared.
    if (cutter && known->radius) add(apart("radius", *known->radius, cutter->radius));
    if (!text.empty())
      warnings.push_back(
          fmt::format("the control believes T{} to have {}", tool.number.value_or(0), text));
  }
  return warnings;
}

Scene with_tool(Scene scene, int number) {
  const std::vector<ToolDescription> tools = all_tools(scene);
  const auto wanted = std::ranges::find_if(
      tools, [&](const ToolDescription& tool) { return tool.number == number; });
  if (wanted == tools.end()) throw std::out_of_range("a tool that the scene describes");
  scene.tool = *wanted;
  scene.additional_tools.clear();
  return scene;
}

}  // namespace abbe::sim
