#include <algorithm>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/scene/joined_errors.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {
namespace {

using Belief = CaseDescription::Belief;
using Force = BeliefDescription::Force;
using From = Force::From;

constexpr std::size_t max_thermal_belief_bytes = std::size_t(16) << 20;

void read_thermal_belief(TableReader& reader, BeliefDescription& belief) {
  const Node* node = reader.section("thermal");
  if (!node) return;
  TableReader thermal(*node, reader.name_of("thermal"), reader.faults());
  const std::string file = thermal.text("file");
  thermal.close();
  if (file.empty()) return;
  belief.thermal_file = file;
  try {
    belief.thermal =
        compensation::thermal_belief_of_text(read_text(file, max_thermal_belief_bytes), file);
  } catch (const BadInput& fault) {
    reader.faults().add(fault);
  }
}

void put_thermal_belief(const BeliefDescription& belief, Node::Table& table) {
  if (!belief.thermal) return;
  Node::Table thermal;
  put(thermal, "file", belief.thermal_file.string());
  put(table, "thermal", std::move(thermal));
}

Key thermal_key() {
  Key thermal =
      key_of("thermal", Key::Kind::Table, "what heat adds, by the temperatures that are read");
  thermal.keys = {key_of(must("file"), Key::Kind::Text,
                         "what `abbe identify --method thermal` wrote, or `--method composite` as "
                         "`NAME_thermal.txt`; its sensors must be those of the scene")};
  return thermal;
}

/// The scene of a training part and what measures it.
Fields<Force> training_fields() {
  return Fields<Force>()
      .text(must("file"), &Force::training, "scene of that part")
      .text(must("instrument"), &Force::instrument, "of that scene, which measures it");
}

/// The keys that a way to the force brings.
Fields<Force> fields_from(From from, const MachineDescription& machine) {
  Fields<Force> fields;
  if (from != From::Model)
    fields.number("smoothing_ms", &Force::smoothing_s, non_negative,
                  "of what is read: the mean of the time just passed; 0: none");
  fields.whole("passes", &Force::passes, 1, 20,
               "runs from which is learnt, each corrected by what the last taught");
  if (from == From::Current)
    return fields.table(must("training"), itself, training_fields(),
                        "the part from which a law is fitted, d = c1 x + c2 x², x the current "
                        "above that in air; the tool gives way by d along its own z");
  Key compliance = key_of(must("compliance"), Key::Kind::Table,
                          "as `[compliance]`, as it is believed", compliance_keys());
  compliance.or_file = true;
  return fields.custom(
      {compliance},
      [machine](TableReader& reader, Force& force) {
        if (const Node* node = reader.section("compliance"))
          force.compliance = read_compliance(*node, machine, reader.faults());
        else if (!reader.has("compliance"))
          reader.missing("compliance", "a table or a file");
      },
      [machine](const Force& force, Node::Table& table) {
        put(table, "compliance", written_compliance(force.compliance, machine));
      });
}

Fields<Force> force_fields(const MachineDescription& machine) {
  Key from = key_of(must("from"), Key::Kind::Text, "what the force is known by");
  const std::array ways{From::Current, From::Dynamometer, From::Model};
  from.words = {{"current", "read, `[signals]` must have it", {}},
                {"dynamometer", "read, `[signals]` must have it", {}},
                {"model",
                 "computed, the scene's blank and material on a machine that is right but as soft "
                 "as `compliance` says",
                 {}}};
  for (std::size_t i = 0; i < ways.size(); ++i)
    from.words[i].keys = fields_from(ways[i], machine).keys();
  return Fields<Force>().custom(
      {from},
      [from, ways, machine](TableReader& reader, Force& force) {
        const auto word = reader.word("from", words_of(from), true);
        force.from = ways.front();
        for (std::size_t i = 0; i < ways.size(); ++i)
          if (word == from.words[i].word) force.from = ways[i];
        force = fields_from(force.from, machine).read(reader, force);
      },
      [from, ways, machine](const Force& force, Node::Table& table) {
        for (std::size_t i = 0; i < ways.size(); ++i)
          if (force.from == ways[i]) put(table, "from", from.words[i].word);
        put_all(table, fields_from(force.from, machine).written(force));
      });
}

Fields<BeliefDescription::Part> believed_part_fields() {
  using Part = BeliefDescription::Part;
  return Fields<Part>()
      .text(must("instrument"), &Part::instrument,
            "name of a `cmm` or `touch_probe` of the scene, whose `case` is not looked at")
      .whole("passes", &Part::passes, 1, 20, "parts cut and measured before the one that counts");
}

Fields<BeliefDescription> belief_fields(const MachineDescription& machine) {
  using Description = BeliefDescription;
  Key identified =
      key_of("identified", Key::Kind::Tables,
             "geometric errors as `errors`; mostly what `abbe identify` wrote", errors_keys());
  identified.or_file = true;
  return Fields<Description>()
      .custom(
          {identified},
          [machine](TableReader& reader, Description& belief) {
            if (const Node* node = reader.know("identified"))
              belief.identified =
                  joined({read_errors(*node, machine, 0, reader.faults())}, machine);
          },
          [machine](const Description& belief, Node::Table& table) {
            if (belief.identified)
              put(table, "identified", written_errors({*belief.identified, 1.0}, machine));
          })
      .custom({thermal_key()}, read_thermal_belief, put_thermal_belief)
      .table("force", &Description::force, force_fields(machine), "how far the cut bends")
      .table("part", &Description::part, believed_part_fields(),
             "what was measured of a part that was cut before; beside other beliefs (`fused`) they "
             "act while the first part is cut, and it wants a `cmm`: a probe on a machine that "
             "nothing corrects would undo them")
      .number("scale", &Description::scale, {-1e6, 1e6},
              "factor of what `identified` and `thermal` say; 0 believes in nothing");
}

}  // namespace

BeliefDescription read_belief(const Node& table, const MachineDescription& machine,
                              Faults& faults) {
  return belief_fields(machine).read_table(table, "belief", faults);
}
Node::Table written_belief(const BeliefDescription& belief, const MachineDescription& machine) {
  return belief_fields(machine).written(belief);
}
std::vector<Key> belief_keys() { return belief_fields({}).keys(); }

void check_beliefs(const Scene& scene, const std::vector<CaseDescription>& cases,
                   TableReader& reader) {
  using From = BeliefDescription::Force::From;
  const BeliefDescription& given = scene.belief;
  for (const CaseDescription& one : cases) {
    if (!one.plug_in.empty()) continue;
    const auto wants = [&](Belief kind, bool is, const char* what) {
      const bool named =
          one.belief == kind || (one.belief == Belief::Composite &&
                                 (kind == Belief::Identified || kind == Belief::Thermal));
      if (named && !is) reader.refuse("compare", fmt::format("{} for {}", what, one.name), "none");
    };
    wants(Belief::Identified, given.identified.has_value(), "belief.identified");
    wants(Belief::Thermal, given.thermal.has_value(), "[belief.thermal]");
    wants(Belief::Force, given.force.has_value(), "[belief.force]");
    wants(Belief::Part, given.part.has_value(), "[belief.part]");
    wants(Belief::Fused, given.identified || given.thermal || given.force || given.part,
          "something in [belief]");
    const bool probes =
        given.part &&
        std::any_of(scene.part_instruments.begin(), scene.part_instruments.end(),
                    [&](const PartInstrumentDescription& instrument) {
                      return instrument.name == given.part->instrument &&
                             std::holds_alternative<errors::metrology::TouchProbe>(instrument.how);
                    });
    if (one.belief == Belief::Fused && probes && (given.identified || given.thermal))
      reader.refuse("compare",
                    "a part measured apart (cmm) for " + one.name +
                        ": a probe on the machine that nothing corrects would undo the rest",
                    "a touch probe");
    const bool feels = given.force && (one.belief == Belief::Force || one.belief == Belief::Fused);
    if (!feels) continue;
    const bool cuts = scene.cutting && scene.cutting->material;
    if (!cuts) reader.refuse("compare", "[cutting] with a material for " + one.name, "none");
    if (given.force->from == From::Current && !scene.signals.current)
      reader.refuse("compare", "[signals.current] for " + one.name, "none");
    if (given.force->from == From::Dynamometer && !scene.signals.dynamometer)
      reader.refuse("compare", "[signals.dynamometer] for " + one.name, "none");
  }
}

}  // namespace abbe::sim
