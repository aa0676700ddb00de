#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "sim/scene/case_name.h"
#include "sim/scene/scene_sections.h"
#include "sim/scene/scene_tree.h"

namespace abbe::sim {

namespace {

constexpr std::size_t max_variants = 1000;

void read_cases(TableReader& reader, std::vector<CaseDescription>& cases) {
  const Node* list = reader.know("cases");
  if (list && !list->array()) reader.refuse("cases", "a list of case names", shown(*list));
  for (const Node& name : list && list->array() ? *list->array() : Node::Array{}) {
    if (!name.text()) {
      reader.faults().add(name.place, "a case name such as \"perfect-iterated-ideal\"",
                          shown(name));
      continue;
    }
    try {
      const CaseDescription one = parse_case(*name.text());
      const bool twice = std::any_of(cases.begin(), cases.end(),
                                     [&](const auto& other) { return other.name == one.name; });
      if (twice) reader.faults().add(name.place, "each case once", shown(name) + " again");
      cases.push_back(one);
    } catch (const std::invalid_argument& fault) {
      reader.faults().add(name.place, "a case that this version has", fault.what());
    }
  }
}

void read_set(TableReader& reader, Variant& variant) {
  const Node* set = reader.section("set");
  if (!set && !reader.has("set")) reader.missing("set", "a table of changes");
  if (!set) return;
  for (const Change& change : changes_of_set(*set)) {
    variant.set.push_back(override_of(change));
    if (change.path.starts_with("variant"))
      reader.faults().add(change.value.place, "a path outside of variants", change.path);
  }
}

const Fields<Variant>& variant_fields() {
  static const Fields<Variant> fields =
      Fields<Variant>()
          .text(must("name"), &Variant::name, "of its folder and its row, each once")
          .custom({key_of(must("set"), Key::Kind::Any,
                          "changes by dotted path: `{ \"errors.scale\" = 2.0, part.vertices = 5000 "
                          "}`; tried when the scene is read")},
                  read_set, [](const Variant& variant, Node::Table& table) {
                    Node::Table set;
                    for (const Override& one : variant.set)
                      put(set, one.path, parse_toml("v = " + one.value, "").find("v")->value);
                    put(table, "set", std::move(set));
                  });
  return fields;
}

}  // namespace

const Fields<std::vector<CaseDescription>>& compare_fields() {
  static const Fields<std::vector<CaseDescription>> fields =
      Fields<std::vector<CaseDescription>>().custom(
          {key_of("cases", Key::Kind::Texts,
                  "compensators beside the uncompensated part: belief, strategy and channel, "
                  "`\"fused-iterated-pulses\"`, or the file of one of your own")},
          read_cases, [](const std::vector<CaseDescription>& cases, Node::Table& table) {
            Node::Array names;
            for (const CaseDescription& one : cases) names.push_back(Node{{}, one.name});
            put(table, "cases", std::move(names));
          });
  return fields;
}

std::vector<Key> variant_keys() { return variant_fields().keys(); }

std::vector<Variant> read_variants(TableReader& scene) {
  std::vector<Variant> variants;
  const std::vector<const Node*> list = scene.tables("variant");
  if (list.size() > max_variants) {
    scene.refuse("variant", fmt::format("at most {} variants", max_variants),
                 std::to_string(list.size()));
    return variants;
  }
  for (const Node* node : list) {
    TableReader reader(*node, "variant", scene.faults());
    Variant variant = variant_fields().read(reader);
    const bool taken = variant.name == "error_free" || variant.name == "uncompensated" ||
                       std::any_of(variants.begin(), variants.end(), [&](const Variant& other) {
                         return other.name == variant.name;
                       });
    if (reader.has("name") && !names_a_folder(variant.name)) {
      reader.refuse("name", "a name of letters, digits, blanks, _ - . for a variant's folder",
                    "\"" + variant.name + "\"");
    } else if (taken) {
      reader.refuse("name", "a name that no other case has", "\"" + variant.name + "\" again");
    }
    reader.close();
    variants.push_back(std::move(variant));
  }
  return variants;
}

Node::Table written_variant(const Variant& variant) { return variant_fields().written(variant); }

}  // namespace abbe::sim
