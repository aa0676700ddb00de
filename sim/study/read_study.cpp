#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "errors/coefficients.h"
#include "kinematics/hash.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/files/versions.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene_names.h"
#include "sim/scene/scene_tree.h"
#include "sim/scene/toml_reader.h"
#include "sim/scene/trust.h"
#include "sim/study/histories.h"
#include "sim/study/plan.h"
#include "sim/study/study.h"

namespace abbe::sim::study {
namespace {

using Kind = Distribution::Kind;

constexpr std::int64_t most_cases = 10'000'000;  // their answers are kept in memory
constexpr std::size_t most_inputs = 2000;
constexpr std::size_t most_sweeps = 1000;

constexpr double most_spread = 1e12;  // of anything in any unit: beyond, sums lose their digits
constexpr double infinity = std::numeric_limits<double>::infinity();

/// The scenes of the arms, in their order, to check what inputs name.
using Scenes = std::vector<Scene>;

std::string shown(const Distribution& d) {
  return fmt::format("centre {}, spread {}, from {} to {}", d.centre, d.spread, d.low, d.high);
}

/// centre, spread, low and high as they are written.
Distribution read_distribution(TableReader& reader, double centre, double spread) {
  Distribution d;
  d.kind = reader.choice<Kind>("distribution",
                               {{"normal", Kind::Normal},
                                {"uniform", Kind::Uniform},
                                {"triangular", Kind::Triangular},
                                {"log_normal", Kind::LogNormal}},
                               Kind::Normal);
  d.centre = reader.number("centre", any_number, centre);
  d.spread = reader.number("spread", {0.0, most_spread, true, false}, spread);
  d.low = reader.number("low", any_number, -infinity);
  d.high = reader.number("high", any_number, infinity);
  if (d.centre < d.low || d.centre > d.high)
    reader.refuse("centre", "a centre within low and high, as the base machine stands there",
                  fmt::format("{}", d.centre));
  if (const char* fault = fault_of(d)) reader.refuse("spread", fault, shown(d));
  return d;
}

Distribution scaled(Distribution d, double base) {
  const double size = std::abs(base);
  d.centre *= base;
  d.spread *= d.kind == Kind::LogNormal ? 1.0 : size;
  const double low = d.low * base, high = d.high * base;
  d.low = std::min(low, high);
  d.high = std::max(low, high);
  return d;
}

std::uint64_t hash_of(std::string_view text, std::uint64_t hash = fnv_1a_basis) {
  return fnv_1a(text, hash);
}

std::uint64_t hash_of_file(const std::filesystem::path& file, std::uint64_t hash);

/// Of every data file that a tree names: another mesh under the old name is another study.
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
  hash = hash_of(read_text(file, std::size_t(1) << 31), hash);
  if (file.extension() != ".toml") return hash;
  Faults ignored;  // another scene, from which something is learnt: reported when it is used
  const std::optional<Node> tree = read_tree(file, ignored);
  return tree ? hash_of_files(*tree, hash_of(to_toml(*tree), hash)) : hash;
}

/// A name that is not known, with the one that may be meant.
std::string with_meant(const std::string& name, const std::set<std::string>& known) {
  const auto meant = nearest(name, known);
  return "\"" + name + "\"" + (meant ? " (nearest: \"" + *meant + "\")" : "");
}

/// This very build: another one may give other bits.
std::string program() {
  const std::filesystem::path self = "/proc/self/exe";
  std::error_code failure;
  const bool known = std::filesystem::is_regular_file(self, failure);
  return versions().dump() +
         (known ? std::to_string(hash_of(read_text(self, std::size_t(1) << 31))) : "");
}

std::string identity_of(const Scene& scene) {
  const std::uint64_t files = hash_of_files(parse_toml(scene.resolved, "scene"), 0);
  return scene.resolved + std::to_string(files);
}

/// Reads one study; every fault is collected.
class StudyReader {
 public:
  StudyReader(const Node& tree, const std::filesystem::path& file, Faults& faults)
      : reader_(tree, "", faults), faults_(faults) {
    study_.file = file;
  }

  Study read();

 private:
  void read_scene_of_study();
  void read_arms();
  bool is_case(const std::string& name);
  void note_program(const std::string& name);
  void check_variant(const std::string& name);
  void read_responses();
  void read_limits();
  void read_inputs();
  void read_one(const Node& node);
  void read_many(const Node& node);
  std::optional<double> stated_at(const std::string& path) const;
  void add_covariance(const Node& node, double cost);
  void add(Input input, const Place& place);
  void read_correlations();
  void read_analyses();
  void read_sweep(const Node& node);
  void read_influence();
  void read_histories();
  void check_engine();
  void check_judged();
  void check_inputs();
  void check_together();
  void try_paths();
  void try_arm(const Arm& arm, const Scene& scene);
  void try_days();
  void add_identity();
  Place place_of(const BadInput& fault) const;
  std::set<std::string> input_names() const;
  int input_named(TableReader& reader, const std::string& key);
  std::vector<std::string> texts(TableReader& reader, const std::string& key);

  TableReader reader_;
  Faults& faults_;
  Study study_;
  Scenes scenes_;
  std::map<std::string, int> index_;
  std::vector<Place> places_;    ///< of the inputs
  std::set<std::string> taken_;  ///< what inputs set
  std::vector<int>
      without_centre_;  ///< inputs of which neither study nor scene says where they are
  std::vector<Correlation> correlations_;
  std::set<std::pair<int, int>> correlated_;  ///< lower index first
};

std::vector<std::string> StudyReader::texts(TableReader& reader, const std::string& key) {
  std::vector<std::string> all;
  const Node* list = reader.know(key);
  if (!list) return all;
  if (list->text()) return {*list->text()};
  if (!list->array()) reader.refuse(key, "a list of texts", shown(*list));
  for (const Node& one : list->array() ? *list->array() : Node::Array{}) {
    if (one.text())
      all.push_back(*one.text());
    else
      faults_.add(one.place, "a text", shown(one));
  }
  return all;
}

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
  std::vector<std::string> cases = texts(reader_, "cases");
  std::vector<std::string> variants = texts(reader_, "variants");
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

void StudyReader::read_responses() {
  const std::vector<std::string> asked = texts(reader_, "responses");
  for (const std::string& name : asked) {
    bool known = false;
    for (const Response response : {Response::Pv, Response::Rms, Response::Mean, Response::Std,
                                    Response::MaxAbs, Response::P95Abs, Response::InTolerance}) {
      if (name != name_of(response)) continue;
      known = true;
      const auto& had = study_.responses;
      if (std::find(had.begin(), had.end(), response) == had.end())
        study_.responses.push_back(response);
    }
    if (!known)
      reader_.refuse("responses", "pv, rms, mean, std, max_abs, p95_abs or in_tolerance", name);
  }
  if (study_.responses.empty()) study_.responses = {Response::Pv, Response::Rms};
  study_.machine_part = reader_.choice<bool>("of", {{"residual", false}, {"machine", true}}, false);
}

void StudyReader::read_limits() {
  const Node* node = reader_.section("limits");
  if (!node) return;
  TableReader limits(*node, "limits", faults_);
  for (const Response response :
       {Response::Pv, Response::Rms, Response::Std, Response::MaxAbs, Response::P95Abs})
    if (const auto limit = limits.maybe_number(std::string(name_of(response)) + "_um", positive))
      study_.limits.emplace_back(response, *limit);
  limits.close();
}

void StudyReader::add(Input input, const Place& place) {
  if (study_.inputs.size() == most_inputs)
    faults_.add(place, fmt::format("at most {} inputs", most_inputs), "more");
  if (study_.inputs.size() >= most_inputs) return;
  if (!index_.emplace(input.name, int(study_.inputs.size())).second)
    faults_.add(place, "a name for every input that no other has", "\"" + input.name + "\" again");
  std::vector<std::string> sets{input.element + input.number};  // one of them, or none
  for (const Setting& one : input.settings) sets.push_back(one.path);
  for (const std::string& one : sets)
    if (!one.empty() && !taken_.insert(one).second)
      faults_.add(place, "an input of its own for " + one, "\"" + input.name + "\" sets it again");
  places_.push_back(place);
  study_.inputs.push_back(std::move(input));
}

/// What the key at the end of a path says of the unit: "_um" is "um".
std::string unit_of_path(const std::string& path) {
  std::string last = path;
  // an index at the end belongs to the key before it
  while (true) {
    const std::size_t dot = last.rfind('.');
    const std::string part = last.substr(dot == std::string::npos ? 0 : dot + 1);
    const bool index = !part.empty() && part.find_first_not_of("0123456789") == std::string::npos;
    if (!index || dot == std::string::npos) {
      last = part;
      break;
    }
    last = last.substr(0, dot);
  }
  const std::string_view stem = stem_of(last);
  return stem.size() < last.size() ? last.substr(stem.size() + 1) : "";
}

void StudyReader::read_one(const Node& node) {
  TableReader reader(node, "input", faults_);
  Input input;
  const std::vector<std::string> paths = texts(reader, "path");
  input.element = reader.text("element", "");
  input.number = reader.text("number", "");
  const int ways = int(!paths.empty()) + int(!input.element.empty()) + int(!input.number.empty());
  if (ways != 1)
    reader.refuse("path", "one of path, element (\"EXX\") and number (\"EXX[1]\")",
                  ways == 0 ? "none" : "several");
  const double factor = reader.number("factor", any_number, 1.0);
  if (reader.has("factor") && paths.empty()) reader.refuse("factor", "a path beside it", "none");
  for (const std::string& path : paths) input.settings.push_back({path, factor});
  std::string name = !paths.empty()           ? paths.front()
                     : !input.element.empty() ? input.element
                                              : input.number;
  input.name = reader.text("name", name);
  const bool angle = input.number.size() > 1 && input.number[1] >= 'A' && input.number[1] <= 'C';
  input.unit = !paths.empty()          ? unit_of_path(paths.front())
               : !input.number.empty() ? (angle ? "urad" : "um")
                                       : "";
  input.cost = reader.number("cost", positive, 1.0);
  if (!reader.has("spread")) reader.missing("spread", "a number in the unit of the path's key");
  const std::optional<double> stated = paths.empty() ? std::nullopt : stated_at(paths.front());
  const double own = stated && factor != 0.0 ? *stated / factor : input.element.empty() ? 0.0 : 1.0;
  input.distribution = read_distribution(reader, own, 1.0);
  // what setup does not say is zero
  if (!paths.empty() && !stated && !reader.has("centre") && !paths.front().starts_with("setup."))
    without_centre_.push_back(int(study_.inputs.size()));
  reader.close();
  add(std::move(input), node.place);
}

/// The number that the scene of the first arm states at a path, as it is written.
std::optional<double> StudyReader::stated_at(const std::string& path) const {
  if (scenes_.empty()) return {};
  const Node tree = parse_toml(scenes_.front().resolved, "scene");
  const Node* node = &tree;
  for (std::size_t from = 0; node && from <= path.size();) {
    const std::size_t dot = std::min(path.find('.', from), path.size());
    const std::string part = path.substr(from, dot - from);
    const Node::Array* list = node->array();
    const bool index = !part.empty() && part.find_first_not_of("0123456789") == std::string::npos;
    if (list && index && part.size() < 7 && std::size_t(std::stoi(part)) < list->size())
      node = &(*list)[std::size_t(std::stoi(part))];
    else
      node = list ? nullptr : node->find(part);
    from = dot + 1;
  }
  if (!node) return {};
  if (const auto* whole = std::get_if<std::int64_t>(&node->value)) return double(*whole);
  if (const auto* number = std::get_if<double>(&node->value)) return *number;
  return {};
}

/// Numbers of a belief, each known to its standard uncertainty, correlated as they are.
void StudyReader::add_covariance(const Node& node, double cost) {
  if (scenes_.empty()) return;
  const errors::GeometricErrors& belief = scenes_.front().geometric;
  const errors::Covariance& known = belief.covariance;
  if (known.of.empty()) {
    faults_.add(node.place, "errors with a covariance, as `abbe identify` writes them",
                "errors that are taken as they stand");
    return;
  }
  const int before = int(study_.inputs.size());
  std::vector<Eigen::Index> rows;
  for (std::size_t k = 0; k < known.of.size(); ++k) {
    const auto i = Eigen::Index(k);
    const double sd = std::sqrt(known.matrix(i, i));
    if (!(sd > 0.0)) continue;  // zero by convention
    const errors::Element& element = belief.elements[std::size_t(known.of[k].element)];
    const double unit = element.name.is_angle() ? units::urad : units::um;
    Input input;
    input.name = input.number = errors::name_of(known.of[k], belief.elements);
    input.unit = element.name.is_angle() ? "urad" : "um";
    const auto all = errors::coefficients(belief.elements);
    const auto at = std::find(all.begin(), all.end(), known.of[k]) - all.begin();
    input.distribution.centre = errors::values(belief.elements)[at] / unit;
    input.distribution.spread = sd / unit;
    input.cost = cost;
    rows.push_back(i);
    add(std::move(input), node.place);
  }
  for (std::size_t a = 0; a < rows.size(); ++a)
    for (std::size_t b = 0; b < a; ++b) {
      const double rho = known.matrix(rows[a], rows[b]) /
                         std::sqrt(known.matrix(rows[a], rows[a]) * known.matrix(rows[b], rows[b]));
      if (rho == 0.0) continue;
      correlations_.push_back({before + int(a), before + int(b), rho});
      correlated_.emplace(before + int(b), before + int(a));
    }
}

void StudyReader::read_many(const Node& node) {
  TableReader reader(node, "inputs", faults_);
  enum class Every { Element, Number, Covariance };
  const Every every = reader.choice<Every>(
      "every",
      {{"element", Every::Element}, {"number", Every::Number}, {"covariance", Every::Covariance}});
  const double cost = reader.number("cost", positive, 1.0);
  if (every == Every::Covariance) {
    reader.close();
    add_covariance(node, cost);
    return;
  }
  const std::vector<std::string> wanted = texts(reader, "of");
  const Distribution d = read_distribution(reader, 0.0, 1.0);
  reader.close();
  if (scenes_.empty()) return;
  const std::vector<errors::Element>& elements = scenes_.front().geometric.elements;
  std::set<std::string> known;
  for (const errors::Element& element : elements) known.insert(errors::to_string(element.name));
  for (const std::string& name : wanted)
    if (!known.count(name))
      reader.refuse("of", "elements that the scene has", with_meant(name, known));
  const auto is_wanted = [&](const errors::Element& element) {
    const std::string name = errors::to_string(element.name);
    return wanted.empty() || std::find(wanted.begin(), wanted.end(), name) != wanted.end();
  };
  if (every == Every::Element) {
    for (const errors::Element& element : elements) {
      if (!is_wanted(element)) continue;
      const std::string name = errors::to_string(element.name);
      add({name, "", {}, name, "", d, cost}, node.place);
    }
    return;
  }
  const Eigen::VectorXd values = errors::values(elements);
  Eigen::Index at = 0;
  for (const errors::Coefficient& one : errors::coefficients(elements)) {
    const errors::Element& element = elements[std::size_t(one.element)];
    const bool angle = element.name.is_angle();
    const double base = values[at++] / (angle ? units::urad : units::um);
    if (!is_wanted(element) || base == 0.0) continue;  // zero: by convention, mostly
    const std::string name = errors::name_of(one, elements);
    const Distribution own = scaled(d, base);
    if (const char* fault = fault_of(own))
      faults_.add(node.place, fmt::format("{}, {} {} being its unit", fault, name, base),
                  shown(own));
    add({name, angle ? "urad" : "um", {}, "", name, own, cost}, node.place);
  }
}

void StudyReader::read_inputs() {
  for (const Node* node : reader_.tables("input")) read_one(*node);
  for (const Node* node : reader_.tables("inputs")) read_many(*node);
}

std::set<std::string> StudyReader::input_names() const {
  std::set<std::string> names;
  for (const auto& [one, ignored] : index_) names.insert(one);
  return names;
}

int StudyReader::input_named(TableReader& reader, const std::string& key) {
  const std::string name = reader.text(key);
  const auto found = index_.find(name);
  if (found != index_.end()) return found->second;
  if (!name.empty()) reader.refuse(key, "the name of an input", with_meant(name, input_names()));
  return 0;
}

void StudyReader::read_correlations() {
  for (const Node* node : reader_.tables("correlation")) {
    TableReader reader(*node, "correlation", faults_);
    const int a = input_named(reader, "first"), b = input_named(reader, "second");
    const double rho = reader.number("rho", {-1.0, 1.0, false, false});
    reader.close();
    if (!faults_.empty()) continue;
    if (a == b)
      reader.refuse("second", "another input than the first", study_.inputs[std::size_t(b)].name);
    if (!correlated_.insert(std::minmax(a, b)).second)
      faults_.add(node->place, "every pair of inputs once",
                  study_.inputs[std::size_t(a)].name + " and " +
                      study_.inputs[std::size_t(b)].name + " again");
    correlations_.push_back({a, b, rho});
  }
  if (!faults_.empty()) return;
  try {
    study_.copula = Copula(int(study_.inputs.size()), correlations_);
  } catch (const std::invalid_argument& fault) {
    const Node* written = reader_.know("correlation");
    faults_.add(written ? written->place : reader_.place(), "correlations that can be",
                fault.what());
  }
}

void StudyReader::read_sweep(const Node& node) {
  TableReader reader(node, "sweep", faults_);
  Sweep sweep;
  sweep.input = input_named(reader, "input");
  if (reader.has("values")) {
    sweep.values = reader.numbers("values");
  } else {
    const double from = reader.number("from", any_number), to = reader.number("to", any_number);
    const auto steps = reader.integer("steps", 2, 10000, 11);
    if (!std::isfinite(to - from))
      reader.refuse("to", "a stretch of finite length", fmt::format("{} to {}", from, to));
    sweep.values = Eigen::VectorXd::LinSpaced(Eigen::Index(steps), from, to);
  }
  reader.close();
  if (study_.sweeps.size() == most_sweeps)
    faults_.add(node.place, fmt::format("at most {} sweeps", most_sweeps), "more");
  if (study_.sweeps.size() < most_sweeps) study_.sweeps.push_back(std::move(sweep));
}

void StudyReader::read_influence() {
  InfluenceOptions& o = study_.influence;
  const Node* node = reader_.section("influence");
  if (!node) return;
  TableReader reader(*node, "influence", faults_);
  o.reach = reader.number("reach_um", positive, o.reach);
  o.most_rivals = int(reader.integer("most_rivals", 1, 64, o.most_rivals));
  o.checks = int(reader.integer("checks", 0, 1000, o.checks));
  o.flag = reader.number("flag_um", positive, o.flag);
  o.sheet = reader.boolean("sheet", o.sheet);
  o.pictures = texts(reader, "pictures");
  for (const std::string& name : o.pictures)
    if (!index_.count(name))
      reader.refuse("pictures", "names of inputs", with_meant(name, input_names()));
  reader.close();
}

void StudyReader::read_histories() {
  const Node* node = reader_.section("histories");
  if (!node) return;
  TableReader reader(*node, "histories", faults_);
  Histories histories;
  histories.train = texts(reader, "train");
  histories.test = texts(reader, "test");
  histories.case_name = reader.text("case", histories.case_name);
  if (histories.train.empty()) reader.missing("train", "a list of variants, \"\" for the scene");
  if (histories.test.empty()) reader.missing("test", "a list of variants, \"\" for the scene");
  reader.close();
  study_.histories = histories;
}

void StudyReader::read_analyses() {
  const auto section = [&](const char* key, const auto& read) {
    const Node* node = reader_.section(key);
    if (!node) return;
    TableReader reader(*node, key, faults_);
    read(reader);
    reader.close();
  };
  section("one_at_a_time", [&](TableReader& reader) {
    study_.one_at_a_time = OneAtATime{reader.number("step", positive, 1.0)};
  });
  section("monte_carlo", [&](TableReader& reader) {
    MonteCarlo mc;
    mc.cases = std::uint64_t(reader.integer("cases", 2, most_cases, 1000));
    mc.sampling = reader.choice<Sampling>(
        "sampling", {{"sobol", Sampling::Sobol}, {"random", Sampling::Random}}, Sampling::Sobol);
    study_.monte_carlo = mc;
  });
  section("sobol_indices", [&](TableReader& reader) {
    study_.sobol = SobolStudy{std::uint64_t(reader.integer("base_points", 8, 1 << 24, 1024))};
  });
  for (const Node* node : reader_.tables("sweep")) read_sweep(*node);
  section("worst_case", [&](TableReader& reader) {
    study_.worst_case = WorstCase{reader.number("coverage", positive, 3.0)};
  });
  section("tolerance", [&](TableReader& reader) {
    Tolerance tolerance;
    tolerance.response = reader.choice<Response>(
        "response", {{"pv", Response::Pv}, {"rms", Response::Rms}}, Response::Pv);
    tolerance.limit = reader.number("limit_um", positive);
    tolerance.confidence = reader.number("confidence", {0.5, 0.999, false, false}, 0.95);
    tolerance.machines = std::uint64_t(reader.integer("machines", 200, 1'000'000, 4000));
    study_.tolerance = tolerance;
  });
  section("uncertainty", [&](TableReader& reader) {
    Uncertainty uncertainty;
    uncertainty.confidence = reader.number("confidence", {0.5, 0.999, false, false}, 0.95);
    uncertainty.machines = std::uint64_t(reader.integer("machines", 100, 100'000, 2000));
    study_.uncertainty = uncertainty;
  });
}

void StudyReader::check_engine() {
  const auto needs = [&](bool asked, const char* key) {
    if (asked && study_.engine == Engine::Full)
      reader_.refuse("engine", fmt::format("\"influence\" or \"both\" for [{}]", key), "\"full\"");
  };
  needs(study_.worst_case.has_value(), "worst_case");
  needs(study_.tolerance.has_value(), "tolerance");
  needs(study_.uncertainty.has_value(), "uncertainty");
  if (study_.engine == Engine::Both && !study_.monte_carlo)
    reader_.refuse("engine", "[monte_carlo] with \"both\": the first of its cases are the proof",
                   "none");
  if (study_.engine == Engine::Full) return;
  for (std::size_t i = 0; i < study_.inputs.size(); ++i)
    if (reshapes(study_.inputs[i]))
      faults_.add(places_[i],
                  "engine = \"full\" for an input that changes part, program, nominal machine or "
                  "stock",
                  study_.inputs[i].name);
}

/// Figures that nobody would get.
void StudyReader::check_judged() {
  const auto is_asked = [&](Response response) {
    const auto& all = study_.responses;
    return std::find(all.begin(), all.end(), response) != all.end();
  };
  for (const auto& [response, limit] : study_.limits)
    if (!is_asked(response))
      reader_.refuse("limits", "limits of what `responses` asks for",
                     std::string(name_of(response)) + "_um");
  for (std::size_t a = 0; a < scenes_.size(); ++a)
    if (is_asked(Response::InTolerance) && !(scenes_[a].part.tolerance > 0.0))
      reader_.refuse("responses", "a part with tolerance_um for in_tolerance",
                     "none of " + study_.arms[a].name);
}

void StudyReader::check_inputs() {
  if (study_.sobol && !study_.copula.groups().empty())
    reader_.refuse("sobol_indices", "independent inputs", "correlated ones");
  const bool asks = study_.one_at_a_time || study_.monte_carlo || study_.sobol ||
                    !study_.sweeps.empty() || study_.worst_case || study_.tolerance ||
                    study_.uncertainty;
  if (study_.inputs.empty() && (asks || !study_.histories))
    faults_.add(reader_.place(), "at least one [[input]] or [[inputs]]", "none");
  if (study_.sobol && study_.inputs.size() > 1800)
    reader_.refuse("sobol_indices", "at most 1800 inputs", std::to_string(study_.inputs.size()));
  if (const std::uint64_t cases = plan_of(study_).cases; cases > most_cases)
    faults_.add(reader_.place(), fmt::format("at most {} cases in all", most_cases),
                std::to_string(cases));
}

/// What engine, inputs and questions ask of each other.
void StudyReader::check_together() {
  check_engine();
  check_judged();
  check_inputs();
}

/// Where an input sets what the scene refuses; else the fault's own place.
Place StudyReader::place_of(const BadInput& fault) const {
  for (std::size_t i = 0; i < study_.inputs.size(); ++i)
    for (const Setting& one : study_.inputs[i].settings)
      if (fault.file.starts_with("--set " + one.path + "=")) return places_[i];
  return {std::make_shared<const std::string>(fault.file), fault.line, fault.column};
}

void StudyReader::try_arm(const Arm& arm, const Scene& scene) {
  std::set<std::string> known;
  for (const errors::Element& element : scene.geometric.elements)
    known.insert(errors::to_string(element.name));
  for (const errors::Coefficient& one : errors::coefficients(scene.geometric.elements))
    known.insert(errors::name_of(one, scene.geometric.elements));
  for (std::size_t i = 0; i < study_.inputs.size(); ++i) {
    const Input& input = study_.inputs[i];
    if (const std::string name = input.element + input.number; !name.empty() && !known.count(name))
      faults_.add(places_[i], "an element or number that the scene's errors have",
                  with_meant(name, known));
  }
  if (!faults_.empty()) return;
  try {
    scene_at(study_, arm, scene, centre(study_));
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.faults)
      faults_.add(place_of(fault), fault.expected, fault.seen);
  }
}

/// Every path is set once, so that a mistake is reported now and not when its case comes.
void StudyReader::try_paths() {
  for (std::size_t a = 0; a < study_.arms.size(); ++a) try_arm(study_.arms[a], scenes_[a]);
}

/// Days are cut when all cases are done; a mistake in them is reported before.
void StudyReader::try_days() {
  const Histories& histories = *study_.histories;
  std::set<std::string> days(histories.train.begin(), histories.train.end());
  days.insert(histories.test.begin(), histories.test.end());
  try {
    case_of_histories(study_);
    for (const std::string& day : days) scene_of(study_, {day, day, "uncompensated"});
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.faults)
      faults_.add(reader_.know("histories")->place, fault.expected, fault.seen);
  } catch (const BadInput& fault) {
    reader_.refuse("histories", fault.expected, fault.seen);
  }
}

Study StudyReader::read() {
  study_.title = reader_.text("title", study_.file.stem().string());
  read_scene_of_study();
  study_.engine = reader_.choice<Engine>(
      "engine", {{"influence", Engine::Influence}, {"full", Engine::Full}, {"both", Engine::Both}},
      Engine::Influence);
  study_.seed =
      std::uint64_t(reader_.integer("seed", 0, std::numeric_limits<std::int64_t>::max(), 1));
  study_.proofs = std::uint64_t(reader_.integer("proofs", 1, most_cases, 50));
  read_arms();
  read_responses();
  read_limits();
  if (faults_.empty() && study_.scene_tree) {
    try {
      for (const Arm& arm : study_.arms) scenes_.push_back(scene_of(study_, arm));
    } catch (const BadScene& bad) {
      for (const BadInput& fault : bad.faults) faults_.add(fault);
      scenes_.clear();
    }
  }
  read_inputs();
  read_correlations();
  read_analyses();
  read_influence();
  read_histories();
  reader_.close();
  if (scenes_.size() == study_.arms.size()) try_paths();
  for (const int i : faults_.empty() ? without_centre_ : std::vector<int>())
    faults_.add(places_[std::size_t(i)], "a centre, as the scene does not state the value",
                "\"" + study_.inputs[std::size_t(i)].name + "\" without one");
  if (faults_.empty()) check_together();
  if (faults_.empty() && study_.histories) try_days();
  if (faults_.empty()) add_identity();
  return std::move(study_);
}

/// Of the scenes with their files, and of compensators of the user's own.
void StudyReader::add_identity() {
  for (const Scene& scene : scenes_) study_.identity += identity_of(scene);
  for (const Arm& arm : study_.arms) {
    if (arm.case_name == "uncompensated") continue;
    const std::filesystem::path plug_in = parse_case(arm.case_name).plug_in;
    if (!plug_in.empty()) study_.identity += std::to_string(hash_of_file(plug_in, hash_of("")));
  }
}

}  // namespace

Study read_study(const std::filesystem::path& file, const std::vector<Override>& overrides) {
  Faults faults;
  Node tree;
  try {
    tree = read_toml_file(file);
  } catch (const BadInput& fault) {
    throw BadScene({fault});
  }
  std::vector<Change> changes;
  for (const Override& override : overrides) {
    try {
      changes.push_back(parse_override(override));
    } catch (const BadInput& fault) {
      faults.add(fault);
    }
  }
  tree = changed(std::move(tree), changes, file.parent_path(), faults);
  if (Node* scene = tree.find("scene"); scene && scene->text())
    scene->value =
        std::filesystem::absolute(file.parent_path() / *scene->text()).lexically_normal().string();
  Study study = StudyReader(tree, file, faults).read();
  if (!faults.empty()) throw BadScene(faults.list());
  study.text = to_toml(tree);
  study.identity = fmt::format("{:016x}", hash_of(study.text + program() + study.identity));
  study.files.push_back(file);
  return study;
}

Study read_trusted_study(const std::filesystem::path& file, const std::vector<Override>& overrides,
                         const Permissions& permissions) {
  Study study = read_study(file, overrides);
  study.trusted = trusted_programs(study.programs, permissions);
  return study;
}

}  // namespace abbe::sim::study
