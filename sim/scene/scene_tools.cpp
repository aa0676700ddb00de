#include "sim/scene/scene_tools.h"

#include <algorithm>
#include <stdexcept>

namespace abbe::sim {

std::vector<ToolDescription> tools_of(const Scene& scene) {
  std::vector<ToolDescription> tools{scene.tool};
  tools.insert(tools.end(), scene.more_tools.begin(), scene.more_tools.end());
  return tools;
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
