#include <array>

#include "sim/scene/scene_sections.h"

namespace abbe::sim {
namespace {

using namespace errors::identification;
using Way = SensorChoiceDescription::Way;

/// What a word of `likeness` stands for.
struct LikenessWord {
  const char* word;
  Likeness likeness;
  GreyKind grey;
  const char* sentence;
};
constexpr std::array likeness_words{
    LikenessWord{"deng", Likeness::Grey, GreyKind::Deng, "Deng's grey degree"},
    LikenessWord{"absolute", Likeness::Grey, GreyKind::Absolute, "Liu's grey degree of areas"},
    LikenessWord{"relative", Likeness::Grey, GreyKind::Relative,
                 "Liu's, of series divided by their first values"},
    LikenessWord{"comprehensive", Likeness::Grey, GreyKind::Comprehensive, "the mean of these two"},
    LikenessWord{"correlation", Likeness::Correlation, GreyKind::Deng, "absolute correlation"},
};

Key likeness_key() {
  Key key = key_of(KeyName("likeness").otherwise(likeness_words.front().word), Key::Kind::Text,
                   "how like an error a sensor must run");
  for (const LikenessWord& one : likeness_words) key.words.push_back({one.word, one.sentence, {}});
  return key;
}

/// The keys of how sensors are chosen, which `[sensor_choice]` and the ways beside it share.
Fields<SensorChoiceOptions> way_fields() {
  using Options = SensorChoiceOptions;
  const Key likeness = likeness_key();
  return Fields<Options>()
      .whole("count", &Options::count, 1, 100, "sensors wanted, one set for X, Y and Z together")
      .custom(
          {likeness},
          [likeness](TableReader& reader, Options& choice) {
            const auto word = reader.word(likeness.name, words_of(likeness), false);
            for (const LikenessWord& one : likeness_words)
              if (word == one.word) {
                choice.likeness = one.likeness;
                choice.grey.kind = one.grey;
              }
          },
          [likeness](const Options& choice, Node::Table& table) {
            for (const LikenessWord& one : likeness_words)
              if (choice.likeness == one.likeness && choice.grey.kind == one.grey)
                put(table, likeness.name, std::string(one.word));
          })
      .word(
          "image", [](auto& choice) -> auto& { return choice.grey.image; },
          {{"initial", Image::Initial, "x / x(1)"},
           {"mean", Image::Mean, "x / mean"},
           {"interval", Image::Interval, "(x - min) / (max - min)"}},
          "what Deng's degree makes of a series")
      .word("screening", &Options::screening,
            {{"degree", Screening::Degree, "those that resemble the error most"},
             {"regression", Screening::Regression,
              "one after another, what lowers the residual most"}},
            "of the groups' leaders")
      .number(KeyName("threshold").otherwise("as high as makes at most `groups` groups"),
              &Options::threshold, {0.0, 1.0}, "sensors this alike stand in one group")
      .whole("groups", &Options::groups, 1, 1000, "at most, where there is no `threshold`");
}

std::vector<std::string> read_names(TableReader& reader, const std::string& key) {
  const Node* list = reader.know(key);
  if (!list) return {};
  std::vector<std::string> names;
  for (const Node& one : list->array() ? *list->array() : Node::Array{})
    if (one.text() && !one.text()->empty())
      names.push_back(*one.text());
    else
      reader.faults().add(one.place, "a name", shown(one));
  if (names.empty()) reader.refuse(key, "a list of names", shown(*list));
  return names;
}

template <typename M>
void add_names(Fields<Way>& fields, const KeyName& name, M member, const char* sentence) {
  const Key key = key_of(name, Key::Kind::Texts, sentence);
  fields.custom(
      {key},
      [key, member](TableReader& reader, Way& way) {
        std::invoke(member, way) = read_names(reader, key.name);
      },
      [key, member](const Way& way, Node::Table& table) {
        Node::Array names;
        for (const std::string& one : std::invoke(member, way)) names.push_back(Node{{}, one});
        if (!names.empty()) put(table, key.name, std::move(names));
      });
}

Fields<Way> beside_fields() {
  Fields<Way> fields;
  fields.text(must("name"), &Way::name, "of this way");
  add_names(
      fields, "sensors", [](auto& way) -> auto& { return way.choice.fixed; },
      "names that are taken as they are; then nothing is chosen");
  add_names(fields, KeyName("for").otherwise("all"), &Way::drifts,
            "displacements to choose for: [\"Z\"]");
  return fields.custom(
      way_fields().keys(),
      [](TableReader& reader, Way& way) {
        if (way.choice.fixed.empty()) way.choice = way_fields().read(reader, way.choice);
      },
      [](const Way& way, Node::Table& table) {
        if (!way.choice.fixed.empty()) return;
        put_all(table, way_fields().written(way.choice));
      });
}

void read_beside(TableReader& reader, SensorChoiceDescription& description) {
  std::set<std::string> names;
  for (const Node* node : reader.tables("beside")) {
    description.beside.push_back(
        beside_fields().read_table(*node, reader.name_of("beside"), reader.faults()));
    const std::string& name = description.beside.back().name;
    if (!name.empty() && !names.insert(name).second)
      reader.faults().add(node->place, "a name that no other way beside has",
                          "\"" + name + "\" again");
  }
}

void put_beside(const SensorChoiceDescription& description, Node::Table& table) {
  Node::Array all;
  for (const Way& way : description.beside) all.push_back(Node{{}, beside_fields().written(way)});
  if (!all.empty()) put(table, "beside", std::move(all));
}

Key beside_key() {
  Key beside =
      key_of("beside", Key::Kind::Tables, "other ways to choose, graded beside by the same model");
  beside.keys = beside_fields().keys();
  return beside;
}

const Fields<SensorChoiceDescription>& sensor_choice_fields() {
  using Description = SensorChoiceDescription;
  static const Fields<Description> fields =
      Fields<Description>()
          .text("instrument", &Description::instrument, "name of the drift instrument")
          .all_of(
              [](auto& d) -> auto& { return d.study.choice; }, way_fields())
          .word(
              "model", [](auto& d) -> auto& { return d.study.model.kind; },
              {{"linear", ModelKind::Linear},
               {"ridge", ModelKind::Ridge},
               {"lasso", ModelKind::Lasso},
               {"support_vectors", ModelKind::SupportVectors},
               {"kernel_ridge", ModelKind::KernelRidge},
               {"network", ModelKind::Network}},
              "of the drift, by the temperatures of the sensors chosen")
          .boolean(
              "since_start", [](auto& d) -> auto& { return d.study.features.since_start; },
              "temperatures count from the start of the day")
          .number(
              "lag_rows", [](auto& d) -> auto& { return d.study.features.lag_rows; }, non_negative,
              "beside each temperature its copy behind a lag of so many readings; 0: none")
          .whole(
              "random_subsets", [](auto& d) -> auto& { return d.study.random_subsets; }, 0, 10000,
              "as large as the choice, to compare with")
          .custom({beside_key()}, read_beside, put_beside);
  return fields;
}

}  // namespace

SensorChoiceDescription read_sensor_choice(const Node& table, Faults& faults) {
  return sensor_choice_fields().read_table(table, "sensor_choice", faults);
}
Node::Table written_sensor_choice(const SensorChoiceDescription& choice) {
  return sensor_choice_fields().written(choice);
}
std::vector<Key> sensor_choice_keys() { return sensor_choice_fields().keys(); }

}  // namespace abbe::sim
