#include "sim/scene/unidentified.h"

#include <fmt/format.h>

#include "sim/scene/fields.h"
#include "sim/scene/toml_text.h"

namespace abbe::sim {
namespace {

constexpr const char* unidentified_name = "unidentified";

UnidentifiedNumber read_number(const Node& node, Faults& faults) {
  TableReader reader(node, unidentified_name, faults);
  UnidentifiedNumber result{reader.text("number"), {}};
  const std::vector<std::string> names = reader.texts("hidden_by");
  if (!names.empty()) {
    const Eigen::VectorXd amounts = reader.numbers("amounts", int(names.size()));
    for (Eigen::Index i = 0; i < amounts.size(); ++i)
      result.hidden_by.emplace_back(names[std::size_t(i)], amounts[i]);
  }
  reader.close();
  return result;
}

}  // namespace

std::vector<UnidentifiedNumber> unidentified_numbers(const Node& errors) {
  std::vector<UnidentifiedNumber> numbers;
  if (errors.array())
    for (const Node& table : *errors.array())
      for (UnidentifiedNumber& one : unidentified_numbers(table)) numbers.push_back(std::move(one));
  const Node* list = errors.table() ? errors.find(unidentified_name) : nullptr;
  for (const Node& node : list && list->array() ? *list->array() : Node::Array{}) {
    Faults faults;
    UnidentifiedNumber number = read_number(node, faults);
    if (faults.empty()) numbers.push_back(std::move(number));
  }
  return numbers;
}

void read_unidentified(TableReader& reader) {
  for (const Node* node : reader.tables(unidentified_name)) read_number(*node, reader.faults());
}

Key unidentified_key() {
  Key key = key_of(unidentified_name, Key::Kind::Tables,
                   "numbers at 0 that the readings behind a belief could not tell, as `abbe "
                   "identify` writes them; a study asks for a prior of them");
  key.keys = {key_of(must("number"), Key::Kind::Text, "`EY0A`, `EAX[1]`"),
              key_of("hidden_by", Key::Kind::Texts,
                     "numbers that took on a part of it, none: no reading feels it"),
              key_of("amounts", Key::Kind::Numbers,
                     "how much of each, um or urad a um or urad of the number")};
  return key;
}

std::string unidentified_text(const std::vector<UnidentifiedNumber>& numbers) {
  if (numbers.empty()) return "";
  std::string text = "unidentified = [\n";
  for (const UnidentifiedNumber& one : numbers) {
    text += fmt::format("  {{ number = {}", to_toml_value(one.number));
    std::string names, amounts;
    for (const auto& [name, amount] : one.hidden_by) {
      names += (names.empty() ? "" : ", ") + to_toml_value(name);
      amounts += fmt::format("{}{}", amounts.empty() ? "" : ", ", amount);
    }
    if (!names.empty()) text += fmt::format(", hidden_by = [{}], amounts = [{}]", names, amounts);
    text += " },\n";
  }
  return text + "]\n";
}

}  // namespace abbe::sim
