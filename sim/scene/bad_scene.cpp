#include "sim/scene/bad_scene.h"

#include <string>

namespace abbe::sim {
namespace {

std::string text_of(const std::vector<BadInput>& faults) {
  std::string text;
  for (const BadInput& fault : faults)
    text += (text.empty() ? "" : "\n") + std::string(fault.what());
  return text;
}

}  // namespace

BadScene::BadScene(std::vector<BadInput> list)
    : std::runtime_error(text_of(list)), faults(std::move(list)) {}

}  // namespace abbe::sim
