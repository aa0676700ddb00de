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
#include "sim/study/configuration.h"
#include "sim/study/study.h"
#include "sim/study/study_fields.h"
#include "sim/study/study_inputs.h"

namespace abbe::sim::study {

namespace {

std::uint64_t hash_of_file(const std::filesystem::path& file, std::uint64_t hash);

/// Returns the hash of all data files that a tree names: with a changed mesh under the same name
/// the study counts as a different one.
std::uint64_t hash_of_files(const Node& node, std::uint64_t hash) {
  if (const Node::Array* array = node.array())
    for (const Node& element : *array) hash = hash_of_files(element, hash);
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

/// Returns the hash of a file; for a TOML file also of the files that it names.
std::uint64_t hash_of_file(const std::filesystem::path& file, std::uint64_t hash) {
  hash = fnv_1a(read_text(file, std::size_t(1) << 31), hash);
  if (file.extension() != ".toml") return hash;
  // The file is a scene from which a belief is learnt; its errors are reported when it is used.
  InputErrors ignored;
  const std::optional<Node> tree = read_tree(file, ignored);
  return tree ? hash_of_files(*tree, fnv_1a(to_toml(*tree), hash)) : hash;
}

/// Returns the identity of the abbe build, because the results of another build may differ in bits.
std::string build_identity() {
  const std::filesystem::path executable = program_file();
  std::error_code failure;
  const bool is_readable = std::filesystem::is_regular_file(executable, failure);
  return versions().dump() +
         (is_readable ? std::to_string(fnv_1a(read_text(executable, std::size_t(1) << 31))) : "");
}

/// Returns the scene with the hash of its data files.
std::string scene_identity(const Scene& scene) {
  std::uint64_t files = hash_of_files(parse_toml(scene.resolved, "scene"), 0);
  for (const std::filesystem::path& file : material_files(scene.part))
    files = hash_of_file(file, files);
  return scene.resolved + std::to_string(files);
}

/// Returns the identity of a study, 16 hexadecimal digits: a hash of everything that its responses
/// depend on, i.e. its text, its scenes with all data files that they name, plug-in compensators,
/// and the abbe build.
/// @param scenes  of the configurations
std::string study_identity(const Study& study, const std::vector<Scene>& scenes) {
  std::string contents = study.text + build_identity();
  for (const Scene& scene : scenes) contents += scene_identity(scene);
  for (const Configuration& configuration : study.configurations) {
    if (configuration.case_name == "uncompensated") continue;
    const std::filesystem::path plug_in = parse_case(configuration.case_name).plug_in;
    if (!plug_in.empty()) contents += std::to_string(hash_of_file(plug_in, fnv_1a_basis));
  }
  return fmt::format("{:016x}", fnv_1a(contents));
}

/// Adds an input error for each analysis or input that the engine cannot compute.
void check_engine(const Study& study, const std::vector<SourcePosition>& locations,
                  TableReader& reader) {
  const auto require_maps = [&](bool is_requested, const char* key) {
    if (is_requested && study.engine == Engine::Full)
      reader.report_invalid("engine", fmt::format("\"influence\" or \"both\" for [{}]", key),
                            "\"full\"");
  };
  require_maps(study.worst_case.has_value(), "worst_case");
  require_maps(study.tolerance.has_value(), "tolerance");
  require_maps(study.uncertainty.has_value(), "uncertainty");
  if (study.engine == Engine::Both && !study.monte_carlo)
    reader.report_invalid("engine", "[monte_carlo] with \"both\", whose first cases are the proof",
                          "none");
  if (study.monte_carlo && reader.has("proofs") &&
      study.verification_cases > study.monte_carlo->cases)
    reader.report_invalid(
        "proofs",
        fmt::format("at most {}, the number of cases of [monte_carlo]", study.monte_carlo->cases),
        std::to_string(study.verification_cases));
  if (study.engine == Engine::Full) return;
  for (std::size_t i = 0; i < study.inputs.size(); ++i)
    if (is_reshaping(study.inputs[i]))
      reader.input_errors().add(
          locations[i],
          "engine = \"full\" for an input that changes part, program, nominal machine or "
          "stock",
          study.inputs[i].name);
}

bool has_tolerance(const PartDescription& part) {
  return part.tolerance || std::ranges::any_of(part.regions, [](const PartRegion& region) {
           return region.tolerance.has_value();
         });
}

/// Adds an input error for each limit or response that could not be computed.
void check_responses(const Study& study, const std::vector<Scene>& scenes, TableReader& reader) {
  const auto is_requested = [&](Response response) {
    const auto& responses = study.responses;
    return std::find(responses.begin(), responses.end(), response) != responses.end();
  };
  for (const auto& [response, limit] : study.limits)
    if (!is_requested(response))
      reader.report_invalid("limits", "limits of responses listed in `responses`",
                            std::string(name_of(response)) + "_um");
  for (std::size_t a = 0; a < scenes.size(); ++a)
    if (is_requested(Response::InTolerance) && !has_tolerance(scenes[a].part))
      reader.report_invalid("responses", "a part with tolerance_um for in_tolerance",
                            "none in " + study.configurations[a].name);
}

/// Adds an input error if the number of inputs or cases, or their correlation, does not fit the
/// analyses.
void check_inputs(const Study& study, TableReader& reader) {
  if (study.sobol && !study.copula.groups().empty())
    reader.report_invalid("sobol_indices", "independent inputs", "correlated ones");
  const bool needs_inputs = study.one_at_a_time || study.monte_carlo || study.sobol ||
                            !study.sweeps.empty() || study.worst_case || study.tolerance ||
                            study.uncertainty || !study.histories;
  if (study.inputs.empty() && needs_inputs)
    reader.input_errors().add(reader.position(), "at least one [[input]] or [[inputs]]", "none");
  // Each of the 1800 inputs takes two of the 3600 dimensions of the sequence.
  if (study.sobol && study.inputs.size() > 1800)
    reader.report_invalid("sobol_indices", "at most 1800 inputs",
                          std::to_string(study.inputs.size()));
  if (const std::uint64_t cases = make_plan(study).cases; cases > max_cases)
    reader.input_errors().add(reader.position(), fmt::format("at most {} cases in all", max_cases),
                              std::to_string(cases));
}

/// Returns the location of the input that sets an invalid value of the scene; if no input sets it,
/// the location in the scene.
SourcePosition error_location(const BadInput& error, const Study& study,
                              const std::vector<SourcePosition>& locations) {
  for (std::size_t i = 0; i < study.inputs.size(); ++i)
    for (const Setting& setting : study.inputs[i].settings)
      if (error.file.starts_with("--set " + setting.path + "=")) return locations[i];
  return {std::make_shared<const std::string>(error.file), error.line, error.column};
}

/// Sets all inputs of a configuration at their centres, and every swept input at its ends. Adds the
/// input errors that result.
void check_configuration(const Study& study, const Configuration& configuration, const Scene& scene,
                         const std::vector<SourcePosition>& locations, InputErrors& input_errors) {
  std::set<std::string> known_names;
  for (const errors::Element& element : scene.geometric.elements)
    known_names.insert(errors::to_string(element.name));
  for (const errors::Coefficient& coefficient : errors::coefficients(scene.geometric.elements))
    known_names.insert(errors::name_of(coefficient, scene.geometric.elements));
  for (std::size_t i = 0; i < study.inputs.size(); ++i) {
    const Input& input = study.inputs[i];
    if (const std::string name = input.element + input.number;
        !name.empty() && !known_names.count(name))
      input_errors.add(locations[i], "an element or coefficient of the scene's errors",
                       with_suggestion(name, known_names));
  }
  if (!input_errors.empty()) return;
  try {
    scene_at(study, configuration, scene, centre(study));
    for (const Sweep& sweep : study.sweeps)
      // A sweep may leave the range of the distribution, so its ends are checked too.
      for (const double value : {sweep.values.minCoeff(), sweep.values.maxCoeff()}) {
        Eigen::VectorXd x = centre(study);
        x[sweep.input] = value;
        scene_at(study, configuration, scene, x);
      }
  } catch (const BadScene& exception) {
    for (const BadInput& error : exception.input_errors)
      input_errors.add(error_location(error, study, locations), error.expected, error.seen);
  }
}

/// Checks that engine, responses, inputs and analyses are consistent. Input errors are added to
/// those of the reader.
/// @param scenes  of the configurations
/// @param locations  locations of the inputs in the file
void check_consistency(const Study& study, const std::vector<Scene>& scenes,
                       const std::vector<SourcePosition>& locations, TableReader& reader) {
  check_engine(study, locations, reader);
  check_responses(study, scenes, reader);
  check_inputs(study, reader);
}

/// Sets every path once in every configuration, so that errors are reported before any case is
/// computed.
void check_paths(const Study& study, const std::vector<Scene>& scenes,
                 const std::vector<SourcePosition>& locations, InputErrors& input_errors) {
  for (std::size_t i = 0; i < study.configurations.size(); ++i)
    check_configuration(study, study.configurations[i], scenes[i], locations, input_errors);
}

/// Checks the days of [histories]. They are cut after all cases, but an error in them is reported
/// before.
void check_days(const Study& study, TableReader& reader) {
  const Histories& histories = *study.histories;
  std::set<std::string> days(histories.train.begin(), histories.train.end());
  days.insert(histories.test.begin(), histories.test.end());
  try {
    histories_compensator(study);
    for (const std::string& day : days) base_scene(study, {day, day, "uncompensated"});
  } catch (const BadScene& exception) {
    for (const BadInput& error : exception.input_errors)
      reader.input_errors().add(reader.accept_key("histories")->position, error.expected,
                                error.seen);
  } catch (const BadInput& error) {
    reader.report_invalid("histories", error.expected, error.seen);
  }
}

const Fields<Study>& title_fields() {
  static const Fields<Study> fields =
      Fields<Study>().text(KeyName("title").with_fallback("name of the file"), &Study::title,
                           "title of tables and pictures");
  return fields;
}

/// Reads a study and collects all input errors.
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
  void record_program(const std::string& name);
  void check_variant(const std::string& name);
  void read_scenes();
  void read_declared_inputs();
  void report_missing_centres();

  TableReader reader_;
  InputErrors& input_errors_;
  Study study_;
  std::vector<Scene> scenes_;              ///< of the configurations, to check the names in inputs
  std::vector<SourcePosition> locations_;  ///< locations of the inputs
  std::vector<MissingCentre> missing_centres_;
};

/// Reads the path of the scene and `set`, then the scene.
void StudyReader::read_scene_of_study() {
  const std::string scene = reader_.text("scene");
  study_.scene = scene;
  if (const Node* set = reader_.section("set"))
    for (const Change& change : changes_from_set(*set))
      study_.overrides.push_back(make_override(change));
  if (scene.empty()) return;
  try {
    study_ = load_scene(study_);
  } catch (const BadScene& exception) {
    for (const BadInput& error : exception.input_errors) input_errors_.add(error);
  }
}

/// Reads `cases` and `variants`, which form the configurations.
void StudyReader::read_configurations() {
  std::vector<std::string> cases = reader_.texts("cases");
  std::vector<std::string> variants = reader_.texts("variants");
  if (cases.empty()) cases = {"uncompensated"};
  if (variants.empty()) variants = {""};
  std::erase_if(cases, [&](const std::string& case_name) { return !is_case(case_name); });
  for (const std::string& variant : variants) {
    check_variant(variant);
    for (const std::string& case_name : cases) {
      const std::string name = variant.empty() ? case_name : variant + " " + case_name;
      for (const Configuration& other : study_.configurations)
        if (other.name == name)
          reader_.report_invalid(variant.empty() ? "cases" : "variants", "each of them once",
                                 "\"" + name + "\" again");
      study_.configurations.push_back({name, variant, case_name});
    }
  }
}

/// Returns true if the name is that of a case; else adds an input error. A plug-in is added to the
/// programs of the study.
bool StudyReader::is_case(const std::string& name) {
  if (name == "uncompensated") return true;
  try {
    const CaseDescription description = parse_case(name);
    record_program(name);
    std::error_code failure;
    if (!description.plug_in.empty() &&
        !std::filesystem::is_regular_file(description.plug_in, failure))
      reader_.report_invalid("cases", "the file of a compensator", "no file \"" + name + "\"");
    return true;
  } catch (const std::invalid_argument& error) {
    reader_.report_invalid("cases", "\"uncompensated\" or a compensator",
                           "\"" + name + "\" (" + error.what() + ")");
    return false;
  }
}

/// Adds the program that a case runs, with its location, to the programs of the study.
void StudyReader::record_program(const std::string& name) {
  const Node* cases = reader_.accept_key("cases");
  const auto record = [&](const Node& node) {
    if (!node.text() || *node.text() != name) return;
    if (const auto program = named_program(node)) {
      study_.programs.push_back(*program);
      study_.files.push_back(program->program);
    }
  };
  if (cases && cases->array())
    for (const Node& node : *cases->array()) record(node);
  else if (cases)
    record(*cases);
}

/// Adds an input error if the scene has no such variant.
void StudyReader::check_variant(const std::string& name) {
  if (name.empty() || !study_.scene_tree) return;  // a scene with input errors is reported already
  std::set<std::string> known_names;
  for (const Variant& variant : study_.variants) known_names.insert(variant.name);
  if (known_names.count(name)) return;
  reader_.report_invalid(
      "variants",
      known_names.empty() ? "no variant, as the scene has none" : "a variant of the scene",
      with_suggestion(name, known_names));
}

/// Reads the scenes of all configurations; none if there are input errors.
void StudyReader::read_scenes() {
  if (!input_errors_.empty() || !study_.scene_tree) return;
  try {
    for (const Configuration& configuration : study_.configurations)
      scenes_.push_back(base_scene(study_, configuration));
  } catch (const BadScene& exception) {
    for (const BadInput& error : exception.input_errors) input_errors_.add(error);
    scenes_.clear();
  }
}

/// Reads the inputs and builds their copula.
void StudyReader::read_declared_inputs() {
  DeclaredInputs declared = read_inputs(reader_, scenes_);
  study_.inputs = std::move(declared.inputs);
  study_.unidentified = std::move(declared.unidentified);
  study_.completion = std::move(declared.completion);
  for (Scene& scene : scenes_)
    scene.geometric.elements.insert(scene.geometric.elements.end(), study_.completion.begin(),
                                    study_.completion.end());
  locations_ = std::move(declared.locations);
  missing_centres_ = std::move(declared.missing_centres);
  if (!input_errors_.empty()) return;
  try {
    study_.copula = Copula(int(study_.inputs.size()), declared.correlations);
  } catch (const std::invalid_argument& error) {
    const Node* correlation = reader_.accept_key("correlation");
    input_errors_.add(correlation ? correlation->position : reader_.position(),
                      "valid correlations", error.what());
  }
}

/// Adds an input error for each input whose centre is stated nowhere.
void StudyReader::report_missing_centres() {
  for (const MissingCentre& report_missing : missing_centres_)
    input_errors_.add(
        locations_[std::size_t(report_missing.input)],
        fmt::format(
            "centre = {} for the input {}, as the scene does not state {}",
            report_missing.nominal
                ? fmt::format("{:g} (the nominal value) or another number", *report_missing.nominal)
                : "a number",
            study_.inputs[std::size_t(report_missing.input)].name, report_missing.path),
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
  study_ = analysis_fields().read(reader_, std::move(study_));
  reader_.close();
  if (scenes_.size() == study_.configurations.size())
    check_paths(study_, scenes_, locations_, input_errors_);
  if (input_errors_.empty()) report_missing_centres();
  if (input_errors_.empty()) check_consistency(study_, scenes_, locations_, reader_);
  if (input_errors_.empty() && study_.histories) check_days(study_, reader_);
  study_.text = to_toml(reader_.node());
  if (input_errors_.empty()) study_.identity = study_identity(study_, scenes_);
  return std::move(study_);
}

/// Returns the key of a table or a list of tables.
Key table_key(const char* name, Key::Kind kind, std::vector<Key> keys, const char* sentence) {
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
  add({make_key(required_key("scene"), Kind::Text, "a scene file, relative to the study"),
       make_key("set", Kind::Any,
                "changes of the scene, as in `[[variant]]`: `{ part.vertices = 10000 }`")});
  add(engine_fields().keys());
  add({make_key(KeyName("cases").with_fallback("[\"uncompensated\"]"), Kind::Texts,
                "cases whose part is judged: `\"uncompensated\"` and compensators, side by side"),
       make_key(KeyName("variants").with_fallback("[\"\"]"), Kind::Texts,
                "names of variants of the scene, `\"\"` for the scene itself; every case is run "
                "for each")});
  add(response_fields().keys());
  add({table_key("input", Kind::Tables, single_input_keys(), "one uncertain quantity"),
       table_key("inputs", Kind::Tables, input_group_keys(), "many inputs at once"),
       table_key("correlation", Kind::Tables, correlation_keys(), "correlation of two inputs")});
  add(analysis_fields().keys());
  return keys;
}

Study read_study(const std::filesystem::path& file, const std::vector<Override>& overrides) {
  InputErrors input_errors;
  Node tree;
  try {
    tree = read_toml_file(file);
  } catch (const BadInput& error) {
    throw BadScene({error});
  }
  if (!tree.find("scene") && tree.find("machine") && tree.find("part"))
    throw BadScene({BadInput(file.string(), 0, 0, "a study with the key `scene`",
                             "a scene, which is run by abbe run and abbe compare")});
  tree = apply_changes(std::move(tree), overrides, file.parent_path(), input_errors);
  if (Node* scene = tree.find("scene"); scene && scene->text())
    scene->value = std::filesystem::absolute(locate_file({*scene->text(), scene->position, ""},
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
    return false;  // the error is reported when the file is read as a scene
  }
}

}  // namespace abbe::sim::study
