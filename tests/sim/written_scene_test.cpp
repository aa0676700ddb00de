#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <iostream>
#include <set>

#include "sim/scene/document.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/scene_fields.h"
#include "tests/sim/small_scene.h"

/// A scene written with every key that it has is the same scene, and no key is without effect.
namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> packaged_files() {
  std::vector<fs::path> files;
  for (const std::string& name : packaged_scenes()) files.push_back(packaged(name));
  return files;
}

/// Where two trees differ by more than the last digits: numbers are written in the unit of their
/// key.
std::string difference(const Node& a, const Node& b, const std::string& path = "") {
  const auto* x = std::get_if<double>(&a.value);
  const auto* y = std::get_if<double>(&b.value);
  if (x && y) {
    const bool near = *x == *y || std::abs(*x - *y) <= 1e-12 + 1e-9 * std::abs(*x);
    return near ? "" : path + ": " + to_toml_value(*x) + " and " + to_toml_value(*y);
  }
  std::string all;
  if (a.table() && b.table() && a.table()->size() == b.table()->size()) {
    for (std::size_t i = 0; i < a.table()->size(); ++i) {
      const Node::Entry &of_a = (*a.table())[i], &of_b = (*b.table())[i];
      all += of_a.key == of_b.key ? difference(of_a.node, of_b.node, path + "." + of_a.key)
                                  : path + ": keys " + of_a.key + " and " + of_b.key;
    }
  } else if (a.array() && b.array() && a.array()->size() == b.array()->size()) {
    for (std::size_t i = 0; i < a.array()->size(); ++i)
      all += difference((*a.array())[i], (*b.array())[i], path + "[]");
  } else if (to_toml_value(a) != to_toml_value(b)) {
    return path + ": another value";
  }
  return all;
}

/// Without variants: their changes are those of the scene as its file has it.
Node written_alone(const Scene& scene) {
  Node table = to_table(scene);
  std::erase_if(*table.table(), [](const Node::Entry& one) { return one.key == "variant"; });
  return table;
}

class WrittenScene : public testing::TestWithParam<fs::path> {};

TEST_P(WrittenScene, IsReadAsTheSameScene) {
  const Scene scene = read_scene(GetParam());
  const Node table = written_alone(scene);
  InputErrors input_errors;
  try {
    EXPECT_EQ(difference(written_alone(scene_from_tree(table, GetParam(), {})), table), "");
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.input_errors) ADD_FAILURE() << fault.what();
  }
}

/// Every leaf of a tree that may be changed alone, first numbers of lists only.
void leaves(Node& node, const std::string& path,
            std::vector<std::pair<std::string, Node*>>& found) {
  if (Node::Table* table = node.table()) {
    for (Node::Entry& entry : *table) leaves(entry.node, path + "." + entry.key, found);
  } else if (Node::Array* array = node.array()) {
    // of a direction the one that is zero: a longer one is the same direction
    std::size_t one = 0;
    for (std::size_t i = array->size(); i-- > 0;)
      if (const auto* number = std::get_if<double>(&(*array)[i].value); number && *number == 0.0)
        one = i;
    if (!array->empty()) leaves((*array)[one], path + "[" + std::to_string(one) + "]", found);
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
  const std::string before = to_toml(to_table(scene_from_tree(table, GetParam(), {})));
  // all of them take minutes
  const std::size_t stride = std::getenv("ABBE_LONG") ? 1 : 1 + found.size() / 30;
  std::set<std::string> without_effect;
  int tried = 0, refused = 0;
  for (std::size_t i = 0; i < found.size(); i += stride) {
    const auto& [path, leaf] = found[i];
    if (path.starts_with(".machine.nose.x[")) continue;  // made square to the axis of the nose
    const Node kept = *leaf;
    if (!change(*leaf)) continue;
    ++tried;
    try {
      if (to_toml(to_table(scene_from_tree(table, GetParam(), {}))) == before)
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

INSTANTIATE_TEST_SUITE_P(Packaged, WrittenScene, testing::ValuesIn(packaged_files()),
                         [](const auto& scene) { return scene.param.stem().string(); });

}  // namespace
}  // namespace abbe::sim
