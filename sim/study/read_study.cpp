#include <limits>
#include <set>

#include <fmt/format.h>

#include "sim/scene/library.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene_names.h"
#include "sim/scene/scene_tree.h"
#include "sim/scene/trust.h"
#include "sim/study/study_checks.h"
#include "sim/study/study_fields.h"
#include "sim/study/study_identity.h"
#include "sim/study/study_inputs.h"

namespace abbe::sim::study {
namespace {

const Fields<Study>& title_fields() {
  static const Fields<Study> fields = Fields<Study>().text(
      KeyName("title").otherwise("name of the file"), &Study::title, "of tables and pictures");
  return fields;
}

/// Reads one study; every fault is collected.
class StudyReader {
 public:
  StudyReader(const Node& tree, const std::filesystem::path& file, Faults& faults)
      : reader_(tree, "", faults), faults_(faults) {
    study_.file = file;
    study_.title = file.stem().string();
  }

  Study read();

 private:
  void read_scene_of_study();
  void read_arms();
  bool is_case(const std::string& name);
  void note_program(const std::string& name);
  void check_variant(const std::string& name);
  void read_scenes();
  void read_stated_inputs();
  void refuse_without_centre();

  TableReader reader_;
  Faults& faults_;
  Study study_;
  std::vector<Scene> scenes_;  ///< of the arms, to check what inputs name
  std::vector<Place> places_;  ///< of the inputs
  std::vector<WithoutCentre> without_centre_;
};

void StudyReader::read_scene_of_study() {
  const std::string scene = reader_.text("scene");
  study_.scene = scene;
  if (const Node* set = reader_.section("set"))
    for (const Change& change : changes_of_set(*set))
      study_.overrides.push_back(override_of(change));
  if (scene.empty()) return;
  try {
    study_ = with_scene(study_);
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.faults) faults_.add(fault);
  }
}

void StudyReader::read_arms() {
  std::vector<std::string> cases = reader_.texts("cases");
  std::vector<std::string> variants = reader_.texts("variants");
  if (cases.empty()) cases = {"uncompensated"};
  if (variants.empty()) variants = {""};
  std::erase_if(cases, [&](const std::string& one) { return !is_case(one); });
  for (const std::string& variant : variants) {
    check_variant(variant);
    for (const std::string& one : cases) {
      const std::string name = variant.empty() ? one : variant + " " + one;
      for (const Arm& other : study_.arms)
        if (other.name == name)
          reader_.refuse(variant.empty() ? "cases" : "variants", "each of them once",
                         "\"" + name + "\" again");
      study_.arms.push_back({name, variant, one});
    }
  }
}

bool StudyReader::is_case(const std::string& name) {
  if (name == "uncompensated") return true;
  try {
    const CaseDescription one = parse_case(name);
    note_program(name);
    std::error_code failure;
    if (!one.plug_in.empty() && !std::filesystem::is_regular_file(one.plug_in, failure))
      reader_.refuse("cases", "the file of a compensator", "no file \"" + name + "\"");
    return true;
  } catch (const std::invalid_argument& fault) {
    reader_.refuse("cases", "\"uncompensated\" or a compensator",
                   "\"" + name + "\" (" + fault.what() + ")");
    return false;
  }
}

/// Programs among the cases, with their places.
void StudyReader::note_program(const std::string& name) {
  const Node* cases = reader_.know("cases");
  const auto note = [&](const Node& one) {
    if (!one.text() || *one.text() != name) return;
    if (const auto program = program_named(one)) {
      study_.programs.push_back(*program);
      study_.files.push_back(program->program);
    }
  };
  if (cases && cases->array())
    for (const Node& one : *cases->array()) note(one);
  else if (cases)
    note(*cases);
}

void StudyReader::check_variant(const std::string& name) {
  if (name.empty() || !study_.scene_tree) return;  // a scene that was refused is reported already
  std::set<std::string> known;
  for (const Variant& variant : study_.variants) known.insert(variant.name);
  if (known.count(name)) return;
  reader_.refuse("variants",
                 known.empty() ? "no variant, as the scene has none" : "a variant of the scene",
                 with_meant(name, known));
}

void StudyReader::read_scenes() {
  if (!faults_.empty() || !study_.scene_tree) return;
  try {
    for (const Arm& arm : study_.arms) scenes_.push_back(scene_of(study_, arm));
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.faults) faults_.add(fault);
    scenes_.clear();
  }
}

void StudyReader::read_stated_inputs() {
  StatedInputs stated = read_inputs(reader_, scenes_);
  study_.inputs = std::move(stated.inputs);
  study_.unidentified = std::move(stated.unidentified);
  study_.completion = std::move(stated.completion);
  for (Scene& scene : scenes_)
    scene.geometric.elements.insert(scene.geometric.elements.end(), study_.completion.begin(),
                                    study_.completion.end());
  places_ = std::move(stated.places);
  without_centre_ = std::move(stated.without_centre);
  if (!faults_.empty()) return;
  try {
    study_.copula = Copula(int(study_.inputs.size()), stated.correlations);
  } catch (const std::invalid_argument& fault) {
    const Node* written = reader_.know("correlation");
    faults_.add(written ? written->place : reader_.place(), "correlations that can be",
                fault.what());
  }
}

void StudyReader::refuse_without_centre() {
  for (const WithoutCentre& one : without_centre_)
    faults_.add(
        places_[std::size_t(one.input)],
        fmt::format("centre = {} for the input {}, as the scene does not state {}",
                    one.nominal ? fmt::format("{:g} (the nominal one) or another", *one.nominal)
                                : "a number",
                    study_.inputs[std::size_t(one.input)].name, one.path),
        "neither");
}

Study StudyReader::read() {
  study_ = title_fields().read(reader_, std::move(study_));
  read_scene_of_study();
  study_ = engine_fields().read(reader_, std::move(study_));
  read_arms();
  study_ = response_fields().read(reader_, std::move(study_));
  read_scenes();
  read_stated_inputs();
  study_ = question_fields().read(reader_, std::move(study_));
  reader_.close();
  if (scenes_.size() == study_.arms.size()) try_paths(study_, scenes_, places_, faults_);
  if (faults_.empty()) refuse_without_centre();
  if (faults_.empty()) check_together(study_, scenes_, places_, reader_);
  if (faults_.empty() && study_.histories) try_days(study_, reader_);
  study_.text = to_toml(reader_.node());
  if (faults_.empty()) study_.identity = identity_of(study_, scenes_);
  return std::move(study_);
}

Key table_of(const char* name, Key::Kind kind, std::vector<Key> keys, const char* sentence) {
  Key key = key_of(name, kind, sentence);
  key.keys = std::move(keys);
  return key;
}

}  // namespace

std::vector<Key> study_keys() {
  using Kind = Key::Kind;
  std::vector<Key> keys = title_fields().keys();
  const auto add = [&](std::vector<Key> more) {
    for (Key& key : more) keys.push_back(std::move(key));
  };
  add({key_of(must("scene"), Kind::Text, "a scene file, relative to the study"),
       key_of("set", Kind::Any,
              "changes of the scene, as of `[[variant]]`: `{ part.vertices = 10000 }`")});
  add(engine_fields().keys());
  add({key_of(KeyName("cases").otherwise("[\"uncompensated\"]"), Kind::Texts,
              "whose part is judged: `\"uncompensated\"` and compensators, side by side"),
       key_of(KeyName("variants").otherwise("[\"\"]"), Kind::Texts,
              "names of the scene's variants, `\"\"` the scene itself; every case for each")});
  add(response_fields().keys());
  add({table_of("input", Kind::Tables, one_input_keys(), "one thing that nobody knows exactly"),
       table_of("inputs", Kind::Tables, many_inputs_keys(), "many at once"),
       table_of("correlation", Kind::Tables, correlation_keys(), "of two inputs")});
  add(question_fields().keys());
  return keys;
}

Study read_study(const std::filesystem::path& file, const std::vector<Override>& overrides) {
  Faults faults;
  Node tree;
  try {
    tree = read_toml_file(file);
  } catch (const BadInput& fault) {
    throw BadScene({fault});
  }
  if (!tree.find("scene") && tree.find("machine") && tree.find("part"))
    throw BadScene({BadInput(file.string(), 0, 0, "a study, which names its scene in `scene`",
                             "a scene, which abbe run and abbe compare take")});
  tree = changed(std::move(tree), overrides, file.parent_path(), faults);
  if (Node* scene = tree.find("scene"); scene && scene->text())
    scene->value = std::filesystem::absolute(
                       located({*scene->text(), scene->place, ""}, file.parent_path(), faults))
                       .string();
  Study study = StudyReader(tree, file, faults).read();
  if (!faults.empty()) throw BadScene(faults.list());
  study.files.push_back(file);
  return study;
}

Study read_trusted_study(const std::filesystem::path& file, const std::vector<Override>& overrides,
                         const Permissions& permissions) {
  Study study = read_study(file, overrides);
  study.trusted = trusted_programs(study.programs, permissions);
  return study;
}

bool is_study(const std::filesystem::path& file) {
  try {
    return read_toml_file(file).find("scene") != nullptr;
  } catch (const BadInput&) {
    return false;  // whoever reads it as a scene names the fault
  }
}

}  // namespace abbe::sim::study
