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

std::vector<ToolDescription> tools_of(const Scene& scene) {
  std::vector<ToolDescription> tools{scene.tool};
  tools.insert(tools.end(), scene.more_tools.begin(), scene.more_tools.end());
  return tools;
}

namespace {

/// A tool of the scene in the control's table; null where there is no table or it has none.
const dialects::TableTool* in_table(const Scene& scene, const ToolDescription& tool) {
  if (!scene.program.tools || !tool.number) return nullptr;
  const auto& known = scene.program.tools->table.tools;
  const auto found = known.find(*tool.number);
  return found == known.end() ? nullptr : &found->second;
}

/// "a length of 80.005 mm, 5 um more than the true one"; empty where they agree.
std::string length_mismatch_text(const char* what, double believed, double truly) {
  constexpr double same = 1e-6;  // mm: tables have four to six decimals
  const double more = believed - truly;
  if (std::abs(more) <= same) return "";
  return fmt::format("a {} of {:.10g} mm, {:.6g} um {} than the true {:.10g} mm", what, believed,
                     std::abs(more) / units::um, more > 0.0 ? "more" : "less", truly);
}

}  // namespace

double believed_length(const Scene& scene, const ToolDescription& tool) {
  const dialects::TableTool* known = in_table(scene, tool);
  if (known && known->length) return *known->length;
  return scene.control.tool_length.value_or(tool.length);
}

std::vector<std::string> tool_table_warnings(const Scene& scene) {
  if (!scene.program.tools) return {};
  std::vector<std::string> warnings;
  for (const ToolDescription& tool : tools_of(scene)) {
    const dialects::TableTool* known = in_table(scene, tool);
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
    if (known->length) add(length_mismatch_text("length", *known->length, tool.actual_length));
    const auto* cutter = std::get_if<cutting::Cutter>(&tool.actual);
    if (cutter && known->radius)
      add(length_mismatch_text("radius", *known->radius, cutter->radius));
    if (!text.empty())
      warnings.push_back(
          fmt::format("the control believes T{} to have {}", tool.number.value_or(0), text));
  }
  return warnings;
}

Scene with_tool(Scene scene, int number) {
  const std::vector<ToolDescription> tools = tools_of(scene);
  const auto wanted = std::ranges::find_if(
      tools, [&](const ToolDescription& tool) { return tool.number == number; });
  if (wanted == tools.end()) throw std::out_of_range("a tool that the scene describes");
  scene.tool = *wanted;
  scene.more_tools.clear();
  return scene;
}

}  // namespace abbe::sim
