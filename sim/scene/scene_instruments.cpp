#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {
namespace {

namespace metrology = errors::metrology;
using metrology::Instrument;
using metrology::Kind;

constexpr Range quality{0.0, 1e4, false, false};  // um or urad: beyond, nothing is measured
constexpr Range wait_s{0.0, 1e6};
constexpr Range speed{1e-3, 1e9, false, false};  // mm/min: below, no day is long enough

constexpr const char *cmm = "cmm", *touch_probe = "touch_probe";

bool measures_the_part(const std::string& word) { return word == cmm || word == touch_probe; }

std::string read_kind(TableReader& reader) {
  std::set<std::string> words{cmm, touch_probe};
  for (const Kind one : metrology::all_kinds()) words.insert(metrology::to_string(one));
  std::string word = reader.text("kind");
  if (word.empty() || words.count(word)) return word;
  std::string list;
  for (const std::string& one : words) list += (list.empty() ? "" : ", ") + one;
  const auto meant = nearest(word, words);
  reader.refuse("kind", "one of " + list,
                "\"" + word + "\"" + (meant ? " (did you mean " + *meant + "?)" : ""));
  return "";
}

void read_quality(TableReader& reader, Instrument& one) {
  one.noise = reader.number("noise_um", quality, one.noise);
  one.noise_rad = reader.number("noise_urad", quality, one.noise_rad);
  one.resolution = reader.number("resolution_um", quality, one.resolution);
  one.resolution_rad = reader.number("resolution_urad", quality, one.resolution_rad);
  one.rotation_sigma = reader.number("alignment_urad", {0.0, 1e4}, one.rotation_sigma);
  one.position_sigma = reader.number("position_um", {0.0, 1e4}, one.position_sigma);
  one.scale_sigma = reader.number("scale_um_per_m", {0.0, 1e4}, one.scale_sigma);
  one.drift_sigma = reader.number("drift_um_per_h", non_negative, one.drift_sigma);
}

void read_axes(TableReader& reader, Instrument& one) {
  const Node* list = reader.know("axes");
  if (!list) return;
  one.axes.clear();
  if (!list->array())
    reader.refuse("axes", "a list of letters such as [\"X\", \"Y\"]", shown(*list));
  for (const Node& letter : list->array() ? *list->array() : Node::Array{}) {
    if (letter.text() && letter.text()->size() == 1)
      one.axes.push_back(letter.text()->front());
    else
      reader.faults().add(letter.place, "the letter of an axis", shown(letter));
  }
}

void read_sampling(TableReader& reader, Instrument& one) {
  read_axes(reader, one);
  one.runs = int(reader.integer("runs", 1, 1000, one.runs));
  one.targets = int(reader.integer("targets", 2, 10000, one.targets));
  one.both_ways = reader.boolean("both_ways", one.both_ways);
  one.margin = reader.number("margin", {0.0, 0.4, true, true}, one.margin);
  one.scatter = reader.number("scatter", {0.0, 0.45}, one.scatter);
  one.up_b = reader.direction("up", one.up_b);
  if (reader.has("at_mm")) one.at_w = reader.vector("at_mm");
  one.reflector_t = reader.vector("reflector_mm", one.reflector_t);
  one.radius = reader.number("radius_mm", positive, one.radius);
  one.lever = reader.number("lever_mm", positive, one.lever);
  one.from_rad = reader.number("from_deg", any_number, one.from_rad);
  one.to_rad = reader.number("to_deg", any_number, one.to_rad);
  one.interval_s = reader.number("interval_s", positive, one.interval_s);
  one.duration_s = reader.number("duration_h", {0.0, 1e5}, one.duration_s);
  const bool over_time = one.kind == Kind::Drift || one.kind == Kind::Temperature;
  if (over_time && one.interval_s > one.duration_s)
    reader.refuse("interval_s",
                  "an instrument.interval_s of at most instrument.duration_h, so that "
                  "something is read twice",
                  fmt::format("{:g} s in {:g} h", one.interval_s, one.duration_s / 3600.0));
  one.speed = reader.number("speed_mm_per_min", speed, one.speed);
  one.dwell_s = reader.number("dwell_s", wait_s, one.dwell_s);
  one.set_up_s = reader.number("set_up_min", {0.0, 1e5}, one.set_up_s);
  one.spindle_speed = reader.number("spindle_rpm", non_negative, one.spindle_speed);
}

std::vector<double> read_starts(TableReader& reader) {
  const Node* node = reader.know("start_h");
  if (!node) return {0.0};
  if (!node->array()) return {reader.number("start_h", any_number)};
  const Eigen::VectorXd starts = reader.numbers("start_h");
  return {starts.begin(), starts.end()};
}

InstrumentDescription read_instrument(TableReader& reader, Kind kind, const std::string& name,
                                      const MachineDescription& machine) {
  const std::size_t before = reader.faults().list().size();
  InstrumentDescription description{metrology::typical(kind), {}};
  Instrument& one = description.instrument;
  one.name = name;
  read_quality(reader, one);
  read_sampling(reader, one);
  description.starts_s = read_starts(reader);
  reader.close();
  if (reader.faults().list().size() != before || machine.joints.empty()) return description;
  try {
    metrology::plan(one, kinematics::Chain(machine.joints, machine.T_bw, machine.T_bs));
  } catch (const std::invalid_argument& fault) {
    reader.refuse("kind", "an instrument that can measure this machine", fault.what());
  }
  return description;
}

metrology::CoordinateMachine read_cmm(TableReader& reader) {
  metrology::CoordinateMachine machine;
  machine.noise = reader.number("noise_um", quality, machine.noise);
  machine.resolution = reader.number("resolution_um", quality, machine.resolution);
  machine.alignment_sigma = reader.number("position_um", {0.0, 1e4}, machine.alignment_sigma);
  machine.alignment_sigma_rad =
      reader.number("alignment_urad", {0.0, 1e4}, machine.alignment_sigma_rad);
  machine.best_fit = reader.boolean("best_fit", machine.best_fit);
  machine.interval_s = reader.number("interval_s", non_negative, machine.interval_s);
  return machine;
}

metrology::TouchProbe read_touch_probe(TableReader& reader, const MachineDescription& machine) {
  metrology::TouchProbe probe;
  probe.centre_t = reader.vector("centre_mm", probe.centre_t);
  probe.radius = reader.number("ball_radius_mm", {1e-3, 1e3}, probe.radius);
  probe.noise = reader.number("noise_um", quality, probe.noise);
  probe.resolution = reader.number("resolution_um", quality, probe.resolution);
  probe.clearance = reader.number("clearance_mm", positive, probe.clearance);
  probe.speed = reader.number("speed_mm_per_min", speed, probe.speed);
  probe.dwell_s = reader.number("dwell_s", wait_s, probe.dwell_s);
  probe.start_s = reader.number("start_h", any_number, probe.start_s);
  probe.q = kinematics::AxisVector::Zero(Eigen::Index(machine.joints.size()));
  if (const Node* pose = reader.section("pose")) {
    TableReader words(*pose, "instrument.pose", reader.faults());
    probe.q = read_axis_words(words, machine.joints);
    words.close();
  }
  return probe;
}

PartInstrumentDescription read_part_instrument(TableReader& reader, const std::string& kind,
                                               const std::string& name,
                                               const MachineDescription& machine) {
  PartInstrumentDescription description;
  description.name = name;
  description.case_name = reader.text("case", "");
  description.spacing = reader.number("spacing_mm", positive, description.spacing);
  if (kind == cmm)
    description.how = read_cmm(reader);
  else
    description.how = read_touch_probe(reader, machine);
  reader.close();
  return description;
}

}  // namespace

Instruments read_instruments(const std::vector<const Node*>& tables,
                             const MachineDescription& machine, Faults& faults) {
  Instruments instruments;
  std::set<std::string> names;
  for (const Node* node : tables) {
    TableReader reader(*node, "instrument", faults);
    const std::string kind = read_kind(reader);
    const std::string name = reader.text("name", kind.empty() ? "?" : kind);
    if (!names_a_folder(name))
      reader.refuse("name", "a name of letters, digits, blanks, _ - . for a file", name);
    if (!kind.empty() && !names.insert(name).second)
      reader.refuse(reader.has("name") ? "name" : "kind", "a name that no other instrument has",
                    "\"" + name + "\" again");
    if (!reader.has("kind")) reader.refuse("kind", "a kind such as \"laser\"", "none");
    if (kind.empty()) continue;
    if (measures_the_part(kind))
      instruments.of_part.push_back(read_part_instrument(reader, kind, name, machine));
    else
      instruments.of_machine.push_back(
          read_instrument(reader, *metrology::kind_of(kind), name, machine));
  }
  return instruments;
}

namespace {

/// The keys of how sensors are chosen, which `[sensor_choice]` and the ways beside it share.
void read_way(TableReader& reader, errors::identification::SensorChoiceOptions& choice) {
  using namespace errors::identification;
  choice.count = int(reader.integer("count", 1, 100, choice.count));
  enum class Word { Deng, Absolute, Relative, Comprehensive, Correlation };
  const Word word = reader.choice<Word>("likeness",
                                        {{"deng", Word::Deng},
                                         {"absolute", Word::Absolute},
                                         {"relative", Word::Relative},
                                         {"comprehensive", Word::Comprehensive},
                                         {"correlation", Word::Correlation}},
                                        Word::Deng);
  choice.likeness = word == Word::Correlation ? Likeness::Correlation : Likeness::Grey;
  choice.grey.kind = word == Word::Absolute        ? GreyKind::Absolute
                     : word == Word::Relative      ? GreyKind::Relative
                     : word == Word::Comprehensive ? GreyKind::Comprehensive
                                                   : GreyKind::Deng;
  choice.grey.image = reader.choice<Image>(
      "image", {{"initial", Image::Initial}, {"mean", Image::Mean}, {"interval", Image::Interval}},
      choice.grey.image);
  choice.screening = reader.choice<Screening>(
      "screening", {{"degree", Screening::Degree}, {"regression", Screening::Regression}},
      choice.screening);
  choice.threshold = reader.maybe_number("threshold", {0.0, 1.0});
  choice.groups = int(reader.integer("groups", 1, 1000, choice.groups));
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

SensorChoiceDescription::Way read_way_beside(const Node& table, Faults& faults) {
  TableReader reader(table, "sensor_choice.beside", faults);
  SensorChoiceDescription::Way way;
  way.name = reader.text("name");
  way.choice.fixed = read_names(reader, "sensors");
  way.drifts = read_names(reader, "for");
  if (way.choice.fixed.empty()) read_way(reader, way.choice);
  reader.close();
  return way;
}

}  // namespace

SensorChoiceDescription read_sensor_choice(const Node& table, Faults& faults) {
  using namespace errors::identification;
  TableReader reader(table, "sensor_choice", faults);
  SensorChoiceDescription description;
  ThermalStudyOptions& study = description.study;
  description.instrument = reader.text("instrument", description.instrument);
  read_way(reader, study.choice);
  study.model.kind = reader.choice<ModelKind>("model",
                                              {{"linear", ModelKind::Linear},
                                               {"ridge", ModelKind::Ridge},
                                               {"lasso", ModelKind::Lasso},
                                               {"support_vectors", ModelKind::SupportVectors},
                                               {"kernel_ridge", ModelKind::KernelRidge},
                                               {"network", ModelKind::Network}},
                                              ModelKind::Linear);
  study.features.since_start = reader.boolean("since_start", study.features.since_start);
  study.features.lag_rows = reader.number("lag_rows", non_negative, study.features.lag_rows);
  study.random_subsets = int(reader.integer("random_subsets", 0, 10000, study.random_subsets));
  std::set<std::string> names;
  for (const Node* node : reader.tables("beside")) {
    description.beside.push_back(read_way_beside(*node, faults));
    const std::string& name = description.beside.back().name;
    if (!name.empty() && !names.insert(name).second)
      faults.add(node->place, "a name that no other way beside has", "\"" + name + "\" again");
  }
  reader.close();
  return description;
}

}  // namespace abbe::sim
