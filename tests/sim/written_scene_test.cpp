#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <set>

#include "sim/scene/read_scene.h"
#include "sim/scene/scene_fields.h"
#include "sim/scene/scene_tree.h"

/// A scene written with every key that it has is the same scene, and no key is without effect.
namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

const fs::path scenes = fs::path(ABBE_SOURCE_DIR) / "scenes";

std::vector<fs::path> packaged_scenes() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(scenes))
    if (entry.path().extension() == ".toml") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

struct Round {
  void operator()(double& v) const { v = std::stod(fmt::format("{:.12e}", v)); }
  void operator()(Node::Array& v) const {
    for (Node& one : v) std::visit(*this, one.value);
  }
  void operator()(Node::Table& v) const {
    for (Node::Entry& one : v) std::visit(*this, one.node.value);
  }
  void operator()(auto&) const {}
};

/// Numbers are written in the unit of their key: read again they may differ in the last digit.
std::string rounded(const Node& node) {
  Node copy = node;
  std::visit(Round{}, copy.value);
  return to_toml(copy);
}

/// Without variants: their changes are those of the scene as its file has it.
Node written_alone(const Scene& scene) {
  Node table = written(scene);
  std::erase_if(*table.table(), [](const Node::Entry& one) { return one.key == "variant"; });
  return table;
}

class WrittenScene : public testing::TestWithParam<fs::path> {};

TEST_P(WrittenScene, IsReadAsTheSameScene) {
  const Scene scene = read_scene(GetParam());
  const Node table = written_alone(scene);
  Faults faults;
  try {
    EXPECT_EQ(rounded(written(scene_of_tree(table, GetParam(), {}))), rounded(table));
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.faults) ADD_FAILURE() << fault.what();
  }
}

/// Every leaf of a tree that may be changed alone, first numbers of lists only.
void leaves(Node& node, const std::string& path,
            std::vector<std::pair<std::string, Node*>>& found) {
  if (Node::Table* table = node.table()) {
    for (Node::Entry& entry : *table) leaves(entry.node, path + "." + entry.key, found);
  } else if (Node::Array* array = node.array()) {
    if (!array->empty()) leaves(array->front(), path + "[0]", found);
  } else {
    found.emplace_back(path, &node);
  }
}

bool change(Node& leaf) {
  if (auto* number = std::get_if<double>(&leaf.value)) {
    *number = *number == 0.0 ? 1e-3 : *number * 1.001;
  } else if (auto* whole = std::get_if<std::int64_t>(&leaf.value)) {
    *whole += 1;
  } else if (auto* yes = std::get_if<bool>(&leaf.value)) {
    *yes = !*yes;
  } else {
    return false;  // words are tried by the tests of their sections
  }
  return true;
}

TEST_P(WrittenScene, ChangesWithEveryNumberOfIt) {
  const Scene scene = read_scene(GetParam());
  Node table = written_alone(scene);
  std::vector<std::pair<std::string, Node*>> found;
  leaves(table, "", found);
  const std::string before = to_toml(written(scene_of_tree(table, GetParam(), {})));
  // all of them take minutes
  const std::size_t stride = std::getenv("ABBE_LONG") ? 1 : 1 + found.size() / 30;
  std::set<std::string> without_effect;
  int tried = 0, refused = 0;
  for (std::size_t i = 0; i < found.size(); i += stride) {
    const auto& [path, leaf] = found[i];
    const Node kept = *leaf;
    if (!change(*leaf)) continue;
    ++tried;
    try {
      if (to_toml(written(scene_of_tree(table, GetParam(), {}))) == before)
        without_effect.insert(path);
    } catch (const BadScene&) {
      ++refused;
    }
    *leaf = kept;
  }
  std::cout << tried << " numbers changed, " << refused << " refused\n";
  EXPECT_GT(tried - refused, 10);
  for (const std::string& path : without_effect) ADD_FAILURE() << path << " changes nothing";
}

INSTANTIATE_TEST_SUITE_P(Packaged, WrittenScene, testing::ValuesIn(packaged_scenes()),
                         [](const auto& scene) { return scene.param.stem().string(); });

}  // namespace
}  // namespace abbe::sim
