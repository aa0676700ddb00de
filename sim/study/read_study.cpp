#include <algorithm>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "errors/coefficients.h"
#include "kinematics/hash.h"
#include "kinematics/text.h"
#include "sim/files/program_file.h"
#include "sim/scene/cases.h"
#include "sim/scene/document.h"
#include "sim/scene/library.h"
#include "sim/scene/part.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"
#include "sim/scene/trust.h"
#include "sim/study/case_plan.h"
#include "sim/study/histories.h"
#include "sim/study/study.h"
#include "sim/study/study_fields.h"
#include "sim/study/study_inputs.h"

namespace abbe::sim::study {

/// Returns the identity of a study, 16 hexadecimal digits: a hash of everything that its responses
/// depend on, i.e. its text, its scenes with every data file that they name, plug-in compensators,
/// and the abbe build.
/// @param scenes  of the configurations
std::string study_identity(const Study& study, const std::vector<Scene>& scenes);

/// Checks that engine, responses, inputs and analyses are consistent, before an hour's work; input
/// errors are added to those of the reader.
/// @param scenes  of the configurations
/// @param places  locations of the inputs in the file
void check_consistency(const Study& study, const std::vector<Scene>& scenes,
                       const std::vector<Place>& places, TableReader& reader);

/// Sets every path once, with its input at its centre, in every configuration, so that a mistake is
/// reported now and not when its case is computed.
void check_paths(const Study& study, const std::vector<Scene>& scenes,
                 const std::vector<Place>& places, InputErrors& input_errors);

/// Checks the days of [histories]: they are cut after all cases, but a mistake in them is reported
/// first.
void check_days(const Study& study, TableReader& reader);

namespace {

std::uint64_t hash_of_file(const std::filesystem::path& file, std::uint64_t hash);

/// Returns the hash of every data file that a tree names: a changed mesh under the old name makes
/// another study.
std::uint64_t hash_of_files(const Node& node, std::uint64_t hash) {
  if (const Node::Array* array = node.array())
    for (const Node& one : *array) hash = hash_of_files(one, hash);
  if (const Node::Table* table = node.table())
    for (const Node::Entry& entry : *table) {
      const std::string* name = entry.node.text();
      std::error_code failure;
      if (entry.key == "file" && name && std::filesystem::is_regular_file(*name, failure))
        hash = hash_of_file(*name, hash);
      else
        hash = hash_of_files(entry.node, hash);
    }
  return hash;
}

std::uint64_t hash_of_file(const std::filesystem::path& file, std::uint64_t hash) {
  hash = fnv_1a(read_text(file, std::size_t(1) << 31), hash);
  if (file.extension() != ".toml") return hash;
  InputErrors ignored;  // a scene from which something is learnt; its errors are reported when it
                        // is used
  const std::optional<Node> tree = read_tree(file, ignored);
  return tree ? hash_of_files(*tree, fnv_1a(to_toml(*tree), hash)) : hash;
}

/// Returns the identity of the abbe build: another build may give other bits.
std::string program() {
  const std::filesystem::path self = program_file();
  std::error_code failure;
  const bool known = std::filesystem::is_regular_file(self, failure);
  return versions().dump() +
         (known ? std::to_string(fnv_1a(read_text(self, std::size_t(1) << 31))) : "");
}

std::string identity_of_scene(const Scene& scene) {
  std::uint64_t files = hash_of_files(parse_toml(scene.resolved, "scene"), 0);
  for (const std::filesystem::path& file : material_files(scene.part))
    files = hash_of_file(file, files);
  return scene.resolved + std::to_string(files);
}

}  // namespace

std::string study_identity(const Study& study, const std::vector<Scene>& scenes) {
  std::string all = study.text + program();
  for (const Scene& scene : scenes) all += identity_of_scene(scene);
  for (const Configuration& arm : study.arms) {
    if (arm.case_name == "uncompensated") continue;
    const std::filesystem::path plug_in = parse_case(arm.case_name).plug_in;
    if (!plug_in.empty()) all += std::to_string(hash_of_file(plug_in, fnv_1a_basis));
  }
  return fmt::format("{:016x}", fnv_1a(all));
}

namespace {

void check_engine(const Study& study, const std::vector<Place>& places, TableReader& reader) {
  const auto needs = [&](bool asked, const char* key) {
    if (asked && study.engine == Engine::Full)
      reader.refuse("engine", fmt::format("\"influence\" or \"both\" for [{}]", key), "\"full\"");
  };
  needs(study.worst_case.has_value(), "worst_case");
  needs(study.tolerance.has_value(), "tolerance");
  needs(study.uncertainty.has_value(), "uncertainty");
  if (study.engine == Engine::Both && !study.monte_carlo)
    reader.refuse("engine", "[monte_carlo] with \"both\": the first of its cases are the proof",
                  "none");
  if (study.monte_carlo && reader.has("proofs") && study.proofs > study.monte_carlo->cases)
    reader.refuse("proofs",
                  fmt::format("at most {}, the cases of [monte_carlo]", study.monte_carlo->cases),
                  std::to_string(study.proofs));
  if (study.engine == Engine::Full) return;
  for (std::size_t i = 0; i < study.inputs.size(); ++i)
    if (is_reshaping(study.inputs[i]))
      reader.input_errors().add(
          places[i],
          "engine = \"full\" for an input that changes part, program, nominal machine or "
          "stock",
          study.inputs[i].name);
}

bool has_tolerance(const PartDescription& part) {
  return part.tolerance || std::ranges::any_of(part.regions, [](const PartRegion& region) {
           return region.tolerance.has_value();
         });
}

/// Reports figures that could not be computed.
void check_judged(const Study& study, const std::vector<Scene>& scenes, TableReader& reader) {
  const auto is_asked = [&](Response response) {
    const auto& all = study.responses;
    return std::find(all.begin(), all.end(), response) != all.end();
  };
  for (const auto& [response, limit] : study.limits)
    if (!is_asked(response))
      reader.refuse("limits", "limits of what `responses` asks for",
                    std::string(name_of(response)) + "_um");
  for (std::size_t a = 0; a < scenes.size(); ++a)
    if (is_asked(Response::InTolerance) && !has_tolerance(scenes[a].part))
      reader.refuse("responses", "a part with tolerance_um for in_tolerance",
                    "none of " + study.arms[a].name);
}

void check_inputs(const Study& study, TableReader& reader) {
  if (study.sobol && !study.copula.groups().empty())
    reader.refuse("sobol_indices", "independent inputs", "correlated ones");
  const bool asks = study.one_at_a_time || study.monte_carlo || study.sobol ||
                    !study.sweeps.empty() || study.worst_case || study.tolerance ||
                    study.uncertainty;
  if (study.inputs.empty() && (asks || !study.histories))
    reader.input_errors().add(reader.place(), "at least one [[input]] or [[inputs]]", "none");
  // Each of the 1800 inputs takes two of the 3600 dimensions of the sequence.
  if (study.sobol && study.inputs.size() > 1800)
    reader.refuse("sobol_indices", "at most 1800 inputs", std::to_string(study.inputs.size()));
  if (const std::uint64_t cases = plan_of(study).cases; cases > max_cases)
    reader.input_errors().add(reader.place(), fmt::format("at most {} cases in all", max_cases),
                              std::to_string(cases));
}

/// Returns the location of the input that sets an invalid value of the scene; else the location in
/// the scene itself.
Place place_of(const BadInput& fault, const Study& study, const std::vector<Place>& places) {
  for (std::size_t i = 0; i < study.inputs.size(); ++i)
    for (const Setting& one : study.inputs[i].settings)
      if (fault.file.starts_with("--set " + one.path + "=")) return places[i];
  return {std::make_shared<const std::string>(fault.file), fault.line, fault.column};
}

void check_configuration(const Study& study, std::size_t at, const Scene& scene,
                         const std::vector<Place>& places, InputErrors& input_errors) {
  const Configuration& arm = study.arms[at];
  std::set<std::string> known;
  for (const errors::Element& element : scene.geometric.elements)
    known.insert(errors::to_string(element.name));
  for (const errors::Coefficient& one : errors::coefficients(scene.geometric.elements))
    known.insert(errors::name_of(one, scene.geometric.elements));
  for (std::size_t i = 0; i < study.inputs.size(); ++i) {
    const Input& input = study.inputs[i];
    if (const std::string name = input.element + input.number; !name.empty() && !known.count(name))
      input_errors.add(places[i], "an element or number that the scene's errors have",
                       with_suggestion(name, known));
  }
  if (!input_errors.empty()) return;
  try {
    scene_at(study, arm, scene, centre(study));
    for (const Sweep& sweep : study.sweeps)
      // Distributions are checked at their centres; a sweep may go anywhere, so both its ends are.
      for (const double value : {sweep.values.minCoeff(), sweep.values.maxCoeff()}) {
        Eigen::VectorXd x = centre(study);
        x[sweep.input] = value;
        scene_at(study, arm, scene, x);
      }
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.input_errors)
      input_errors.add(place_of(fault, study, places), fault.expected, fault.seen);
  }
}

}  // namespace

void check_consistency(const Study& study, const std::vector<Scene>& scenes,
                       const std::vector<Place>& places, TableReader& reader) {
  check_engine(study, places, reader);
  check_judged(study, scenes, reader);
  check_inputs(study, reader);
}

void check_paths(const Study& study, const std::vector<Scene>& scenes,
                 const std::vector<Place>& places, InputErrors& input_errors) {
  for (std::size_t a = 0; a < study.arms.size(); ++a)
    check_configuration(study, a, scenes[a], places, input_errors);
}

void check_days(const Study& study, TableReader& reader) {
  const Histories& histories = *study.histories;
  std::set<std::string> days(histories.train.begin(), histories.train.end());
  days.insert(histories.test.begin(), histories.test.end());
  try {
    case_of_histories(study);
    for (const std::string& day : days) scene_of(study, {day, day, "uncompensated"});
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.input_errors)
      reader.input_errors().add(reader.accept_key("histories")->place, fault.expected, fault.seen);
  } catch (const BadInput& fault) {
    reader.refuse("histories", fault.expected, fault.seen);
  }
}

namespace {

const Fields<Study>& title_fields() {
  static const Fields<Study> fields = Fields<Study>().text(
      KeyName("title").otherwise("name of the file"), &Study::title, "of tables and pictures");
  return fields;
}

/// Reads one study and collects every input error.
class StudyReader {
 public:
  StudyReader(const Node& tree, const std::filesystem::path& file, InputErrors& input_errors)
      : reader_(tree, "", input_errors), input_errors_(input_errors) {
    study_.file = file;
    study_.title = file.stem().string();
  }

  Study read();

 private:
  void read_scene_of_study();
  void read_configurations();
  bool is_case(const std::string& name);
  void note_program(const std::string& name);
  void check_variant(const std::string& name);
  void read_scenes();
  void read_declared_inputs();
  void throw_missing_centre();

  TableReader reader_;
  InputErrors& input_errors_;
  Study study_;
  std::vector<Scene> scenes_;  ///< of the configurations, to check the names in inputs
  std::vector<Place> places_;  ///< locations of the inputs
  std::vector<MissingCentre> missing_centres_;
};

void StudyReader::read_scene_of_study() {
  const std::string scene = reader_.text("scene");
  study_.scene = scene;
  if (const Node* set = reader_.section("set"))
    for (const Change& change : changes_from_set(*set))
      study_.overrides.push_back(make_override(change));
  if (scene.empty()) return;
  try {
    study_ = load_scene(study_);
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.input_errors) input_errors_.add(fault);
  }
}

void StudyReader::read_configurations() {
  std::vector<std::string> cases = reader_.texts("cases");
  std::vector<std::string> variants = reader_.texts("variants");
  if (cases.empty()) cases = {"uncompensated"};
  if (variants.empty()) variants = {""};
  std::erase_if(cases, [&](const std::string& one) { return !is_case(one); });
  for (const std::string& variant : variants) {
    check_variant(variant);
    for (const std::string& one : cases) {
      const std::string name = variant.empty() ? one : variant + " " + one;
      for (const Configuration& other : study_.arms)
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

/// Notes the programs among the cases with their locations.
void StudyReader::note_program(const std::string& name) {
  const Node* cases = reader_.accept_key("cases");
  const auto note = [&](const Node& one) {
    if (!one.text() || *one.text() != name) return;
    if (const auto program = named_program(one)) {
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
  if (name.empty() || !study_.scene_tree) return;  // a scene with input errors is reported already
  std::set<std::string> known;
  for (const Variant& variant : study_.variants) known.insert(variant.name);
  if (known.count(name)) return;
  reader_.refuse("variants",
                 known.empty() ? "no variant, as the scene has none" : "a variant of the scene",
                 with_suggestion(name, known));
}

void StudyReader::read_scenes() {
  if (!input_errors_.empty() || !study_.scene_tree) return;
  try {
    for (const Configuration& arm : study_.arms) scenes_.push_back(scene_of(study_, arm));
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.input_errors) input_errors_.add(fault);
    scenes_.clear();
  }
}

void StudyReader::read_declared_inputs() {
  DeclaredInputs stated = read_inputs(reader_, scenes_);
  study_.inputs = std::move(stated.inputs);
  study_.unidentified = std::move(stated.unidentified);
  study_.completion = std::move(stated.completion);
  for (Scene& scene : scenes_)
    scene.geometric.elements.insert(scene.geometric.elements.end(), study_.completion.begin(),
                                    study_.completion.end());
  places_ = std::move(stated.places);
  missing_centres_ = std::move(stated.missing_centres);
  if (!input_errors_.empty()) return;
  try {
    study_.copula = Copula(int(study_.inputs.size()), stated.correlations);
  } catch (const std::invalid_argument& fault) {
    const Node* written = reader_.accept_key("correlation");
    input_errors_.add(written ? written->place : reader_.place(), "correlations that can be",
                      fault.what());
  }
}

void StudyReader::throw_missing_centre() {
  for (const MissingCentre& one : missing_centres_)
    input_errors_.add(
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
  read_configurations();
  study_ = response_fields().read(reader_, std::move(study_));
  read_scenes();
  read_declared_inputs();
  study_ = question_fields().read(reader_, std::move(study_));
  reader_.close();
  if (scenes_.size() == study_.arms.size()) check_paths(study_, scenes_, places_, input_errors_);
  if (input_errors_.empty()) throw_missing_centre();
  if (input_errors_.empty()) check_consistency(study_, scenes_, places_, reader_);
  if (input_errors_.empty() && study_.histories) check_days(study_, reader_);
  study_.text = to_toml(reader_.node());
  if (input_errors_.empty()) study_.identity = study_identity(study_, scenes_);
  return std::move(study_);
}

Key table_of(const char* name, Key::Kind kind, std::vector<Key> keys, const char* sentence) {
  Key key = make_key(name, kind, sentence);
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
  add({make_key(must("scene"), Kind::Text, "a scene file, relative to the study"),
       make_key("set", Kind::Any,
                "changes of the scene, as of `[[variant]]`: `{ part.vertices = 10000 }`")});
  add(engine_fields().keys());
  add({make_key(KeyName("cases").otherwise("[\"uncompensated\"]"), Kind::Texts,
                "whose part is judged: `\"uncompensated\"` and compensators, side by side"),
       make_key(KeyName("variants").otherwise("[\"\"]"), Kind::Texts,
                "names of the scene's variants, `\"\"` the scene itself; every case for each")});
  add(response_fields().keys());
  add({table_of("input", Kind::Tables, one_input_keys(), "one thing that nobody knows exactly"),
       table_of("inputs", Kind::Tables, many_inputs_keys(), "many at once"),
       table_of("correlation", Kind::Tables, correlation_keys(), "of two inputs")});
  add(question_fields().keys());
  return keys;
}

Study read_study(const std::filesystem::path& file, const std::vector<Override>& overrides) {
  InputErrors input_errors;
  Node tree;
  try {
    tree = read_toml_file(file);
  } catch (const BadInput& fault) {
    throw BadScene({fault});
  }
  if (!tree.find("scene") && tree.find("machine") && tree.find("part"))
    throw BadScene({BadInput(file.string(), 0, 0, "a study, which names its scene in `scene`",
                             "a scene, which abbe run and abbe compare take")});
  tree = changed(std::move(tree), overrides, file.parent_path(), input_errors);
  if (Node* scene = tree.find("scene"); scene && scene->text())
    scene->value = std::filesystem::absolute(locate_file({*scene->text(), scene->place, ""},
                                                         file.parent_path(), input_errors))
                       .string();
  Study study = StudyReader(tree, file, input_errors).read();
  if (!input_errors.empty()) throw BadScene(input_errors.list());
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
    return false;  // a reader that takes it for a scene reports the error
  }
}

}  // namespace abbe::sim::study
