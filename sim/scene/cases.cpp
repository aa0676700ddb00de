#include "sim/scene/cases.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <set>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "sim/scene/document.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

namespace {

using Belief = CaseDescription::Belief;
using Channel = CaseDescription::Channel;
using compensation::Strategy;

template <typename T, std::size_t n>
using TokenTable = std::array<std::pair<const char*, T>, n>;

constexpr TokenTable<Belief, 7> beliefs{{{"perfect", Belief::Perfect},
                                         {"identified", Belief::Identified},
                                         {"thermal", Belief::Thermal},
                                         {"composite", Belief::Composite},
                                         {"force", Belief::Force},
                                         {"part", Belief::Part},
                                         {"fused", Belief::Fused}}};
constexpr TokenTable<Strategy, 3> strategies{{{"position", Strategy::Position},
                                              {"decoupled", Strategy::Decoupled},
                                              {"iterated", Strategy::Iterated}}};
constexpr TokenTable<Channel, 7> channels{{{"ideal", Channel::Ideal},
                                           {"program", Channel::Program},
                                           {"pulses", Channel::PulseInsertion},
                                           {"open", Channel::Open},
                                           {"origin", Channel::Origin},
                                           {"table", Channel::Table},
                                           {"piezo", Channel::Piezo}}};

/// Returns the value that a token names.
/// @param kind  noun for the message, such as "belief"
/// @throws std::invalid_argument with the values the token may take
template <typename T, std::size_t n>
T parse_token(const TokenTable<T, n>& table, const std::string& token, const char* kind) {
  std::string choices;
  std::set<std::string> names;
  for (const auto& [name, value] : table) {
    if (token == name) return value;
    choices += (choices.empty() ? "" : ", ") + std::string(name);
    names.insert(name);
  }
  const auto suggestion = nearest(token, names);
  throw std::invalid_argument(fmt::format("expected a {} ({}), seen \"{}\"{}", kind, choices, token,
                                          suggestion ? " (nearest: \"" + *suggestion + "\")" : ""));
}

std::vector<std::string> split_case_name(const std::string& name) {
  std::vector<std::string> tokens(1);
  for (const char c : name) {
    if (c == '-')
      tokens.emplace_back();
    else
      tokens.back() += c;
  }
  return tokens;
}

}  // namespace

bool is_folder_name(const std::string& name) {
  // Bytes of 0x80 and above belong to UTF-8 letters, and a leading dot would hide the folder.
  return !name.empty() && name.size() <= 80 && name.front() != '.' && escaped(name) == name &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return c >= 0x80 || std::isalnum(c) || c == '_' || c == '-' || c == '.' || c == ' ';
         });
}

CaseDescription parse_case(const std::string& name) {
  // Case names contain neither dots nor slashes, so either character marks a file.
  if (name.find_first_of("./") != std::string::npos) return plug_in_case(name);
  CaseDescription description;
  description.name = name;
  const std::vector<std::string> tokens = split_case_name(name);
  if (tokens.size() != 3)
    throw std::invalid_argument(
        fmt::format("expected belief-strategy-channel such as perfect-iterated-ideal, or a plug-in "
                    "file such as ./mine.py, seen \"{}\"",
                    name));
  description.belief = parse_token(beliefs, tokens[0], "belief");
  description.strategy = parse_token(strategies, tokens[1], "strategy");
  description.channel = parse_token(channels, tokens[2], "channel");
  return description;
}

CaseDescription plug_in_case(const std::filesystem::path& file) {
  CaseDescription description;
  description.name = file.filename().string();
  // The absolute name contains a slash, so it is recognised as a file when the scene is read again.
  description.plug_in = std::filesystem::absolute(file).lexically_normal();
  // Both names are reserved for the reference cases that every comparison writes.
  if (description.name == "error_free" || description.name == "uncompensated")
    throw std::invalid_argument(
        "expected a plug-in with a name other than that of a case, seen \"" + description.name +
        "\"");
  if (!is_folder_name(description.name))
    throw std::invalid_argument(fmt::format(
        "expected a plug-in whose file name has only letters, digits, blanks, _ - ., seen \"{}\"",
        file.string()));
  return description;
}

CaseDescription parse_plug_in_method(const std::string& text) {
  const std::vector<std::string> tokens = split_case_name(text);
  if (tokens.size() != 2)
    throw std::invalid_argument(
        fmt::format("expected strategy-channel such as iterated-ideal, seen \"{}\"", text));
  CaseDescription method;
  method.strategy = parse_token(strategies, tokens[0], "strategy");
  method.channel = parse_token(channels, tokens[1], "channel");
  // A compensation table requests corrections at single positions, whereas a plug-in answers for a
  // whole path.
  if (method.channel == Channel::Table)
    throw std::invalid_argument(
        "expected a channel other than table, which requests one position at a time; a plug-in can "
        "itself be a table");
  return method;
}

std::string plug_in_method(const CaseDescription& plug_in) {
  return fmt::format("{}-{}", strategies.at(std::size_t(plug_in.strategy)).first,
                     channels.at(std::size_t(plug_in.channel)).first);
}

namespace {

/// A folder and the case it holds.
struct CaseFolder {
  std::string name;
  std::string owner;  ///< the case or variant, in words for messages
  SourcePosition position;
};

/// Returns the position of the cases of the scene, for messages.
SourcePosition place_of_cases(const Node& scene) {
  const Node* compare = scene.find("compare");
  const Node* list = compare ? compare->find("cases") : nullptr;
  return list ? list->position : scene.position;
}

SourcePosition variant_position(const Node& scene, std::size_t index) {
  const Node* list = scene.find("variant");
  if (!list || !list->array() || index >= list->array()->size()) return scene.position;
  const Node& variant = (*list->array())[index];
  const Node* name = variant.find("name");
  return name ? name->position : variant.position;
}

/// Returns the folders of the reference cases, of the cases of the scene and of each variant.
std::vector<CaseFolder> compared_folders(const Node& scene, const ComparedNames& names) {
  std::vector<CaseFolder> folders;
  const SourcePosition cases_position = place_of_cases(scene);
  // Every comparison writes these two reference cases, so their folder names are always in use.
  for (const char* name : {"error_free", "uncompensated"})
    folders.push_back({name, fmt::format("the case \"{}\"", name), cases_position});
  for (const CaseDescription& description : names.cases)
    folders.push_back(
        {description.name, fmt::format("the case \"{}\"", description.name), cases_position});
  for (std::size_t i = 0; i < names.variants.size(); ++i) {
    const auto& [variant, variant_cases] = names.variants[i];
    const SourcePosition position = variant_position(scene, i);
    folders.push_back({variant, fmt::format("the variant \"{}\"", variant), position});
    for (const CaseDescription& description : variant_cases)
      folders.push_back(
          {case_folder(variant, description.name),
           fmt::format("the case \"{}\" of the variant \"{}\"", description.name, variant),
           position});
  }
  return folders;
}

}  // namespace

std::string case_folder(const std::string& variant, const std::string& case_name) {
  if (variant.empty()) return case_name;
  // Every variant has an uncompensated case; its folder has the name of the variant alone.
  return case_name == "uncompensated" ? variant : variant + "-" + case_name;
}

std::vector<std::string> case_folders(const ComparedNames& names) {
  std::vector<std::string> folders;
  for (CaseFolder& folder : compared_folders({}, names)) folders.push_back(std::move(folder.name));
  return folders;
}

void check_case_folders(const Node& scene, const ComparedNames& names, InputErrors& input_errors) {
  std::map<std::string, std::string> owners;
  // Result files come first, so that a conflict is reported at the case and not at the file.
  for (const char* name : result_names) owners.emplace(name, "a result file");
  for (const CaseFolder& folder : compared_folders(scene, names)) {
    const auto [first_owner, is_new] = owners.emplace(folder.name, folder.owner);
    if (!is_new)
      input_errors.add(
          folder.position, "a separate folder for every case",
          fmt::format("\"{}\" for {} and for {}", folder.name, folder.owner, first_owner->second));
  }
}

namespace {

constexpr std::size_t max_variants = 1000;

void read_cases(TableReader& reader, std::vector<CaseDescription>& cases) {
  const Node* list = reader.accept_key("cases");
  if (list && !list->array())
    reader.report_invalid("cases", "a list of case names", display_text(*list));
  for (const Node& name : list && list->array() ? *list->array() : Node::Array{}) {
    if (!name.text()) {
      reader.input_errors().add(name.position, "a case name such as \"perfect-iterated-ideal\"",
                                display_text(name));
      continue;
    }
    try {
      const CaseDescription description = parse_case(*name.text());
      // A repeated case is reported and still added: the scene is rejected anyway, and later checks
      // need the full list.
      const bool is_repeated = std::any_of(cases.begin(), cases.end(), [&](const auto& other) {
        return other.name == description.name;
      });
      if (is_repeated)
        reader.input_errors().add(name.position, "each case once", display_text(name) + " again");
      cases.push_back(description);
    } catch (const std::invalid_argument& error) {
      reader.input_errors().add(name.position, "a case that this version supports", error.what());
    }
  }
}

void read_set(TableReader& reader, Variant& variant) {
  const Node* set = reader.section("set");
  if (!set && !reader.has("set")) reader.report_missing("set", "a table of changes");
  if (!set) return;
  for (const Change& change : changes_from_set(*set)) {
    variant.set.push_back(make_override(change));
    // A variant of variants would have no defined order of application.
    if (change.path.starts_with("variant"))
      reader.input_errors().add(change.value.position, "a path outside [[variant]]", change.path);
  }
}

const Fields<Variant>& variant_fields() {
  static const Fields<Variant> fields =
      Fields<Variant>()
          .text(required_key("name"), &Variant::name,
                "name of its folder and of its table row; must be unique")
          .custom_field({make_key(required_key("set"), Key::Kind::Any,
                                  "changes by dotted path: `{ \"errors.scale\" = 2.0, "
                                  "part.vertices = 5000 }`; checked when the scene is read")},
                        read_set, [](const Variant& variant, Node::Table& table) {
                          Node::Table set;
                          for (const Override& change : variant.set)
                            // Parsing the text of the override gives a node of the right type.
                            put_value(set, change.path,
                                      parse_toml("v = " + change.value, "").find("v")->value);
                          put_value(table, "set", std::move(set));
                        });
  return fields;
}

}  // namespace

const Fields<std::vector<CaseDescription>>& compare_fields() {
  static const Fields<std::vector<CaseDescription>> fields =
      Fields<std::vector<CaseDescription>>().custom_field(
          {make_key(
              "cases", Key::Kind::Texts,
              "compensators to compare with the uncompensated part: belief, strategy and channel, "
              "such as `\"fused-iterated-pulses\"`, or the file of your own compensator")},
          read_cases, [](const std::vector<CaseDescription>& cases, Node::Table& table) {
            Node::Array names;
            for (const CaseDescription& description : cases)
              names.push_back(Node{{}, description.name});
            put_value(table, "cases", std::move(names));
          });
  return fields;
}

std::vector<Key> variant_keys() { return variant_fields().keys(); }

std::vector<Variant> read_variants(TableReader& scene) {
  std::vector<Variant> variants;
  const std::vector<const Node*> list = scene.tables("variant");
  if (list.size() > max_variants) {
    scene.report_invalid("variant", fmt::format("at most {} variants", max_variants),
                         std::to_string(list.size()));
    return variants;
  }
  for (const Node* node : list) {
    TableReader reader(*node, "variant", scene.input_errors());
    Variant variant = variant_fields().read(reader);
    // Variant names become folders beside those of the two reference cases.
    const bool is_name_taken =
        variant.name == "error_free" || variant.name == "uncompensated" ||
        std::any_of(variants.begin(), variants.end(),
                    [&](const Variant& other) { return other.name == variant.name; });
    if (reader.has("name") && !is_folder_name(variant.name)) {
      reader.report_invalid("name",
                            "a name of letters, digits, blanks, _ - . for the folder of a variant",
                            "\"" + variant.name + "\"");
    } else if (is_name_taken) {
      reader.report_invalid("name", "a name that no other case has",
                            "\"" + variant.name + "\" again");
    }
    reader.close();
    variants.push_back(std::move(variant));
  }
  return variants;
}

Node::Table variant_to_table(const Variant& variant) { return variant_fields().to_table(variant); }

}  // namespace abbe::sim
