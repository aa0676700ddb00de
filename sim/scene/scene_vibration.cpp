#include <stdexcept>

#include "kinematics/units.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {

namespace {

using errors::Vibration;

/// How fast and how much: amplitude in um or urad as the element asks.
Fields<Vibration> harmonic_fields(const std::string& amplitude) {
  return Fields<Vibration>()
      .number("order", &Vibration::order, positive,
              "per turn of the spindle: 1, or the number of teeth")
      .number(must(amplitude), &Vibration::amplitude, any_number, "at the speed `at_rpm`")
      .number("exponent", &Vibration::exponent, any_number,
              "of the speed, at least 0: 2 for unbalance, 0 for an amplitude that does not change "
              "with speed");
}

Fields<Vibration> speed_fields(bool required) {
  const KeyName at = KeyName("at_rpm").otherwise("must be given unless `exponent` is 0");
  return Fields<Vibration>().number(required ? must(at) : at, &Vibration::reference_speed, positive,
                                    "speed of the spindle at which the amplitude is stated");
}

Fields<Vibration> resonance_fields() {
  Key resonance = key_of("resonance_Hz", Key::Kind::Number, "near it the amplitude is magnified");
  resonance.range = positive;
  return Fields<Vibration>()
      .number("phase_deg", &Vibration::phase, any_number, "at the spindle's angle 0")
      .custom(
          {resonance},
          [](TableReader& reader, Vibration& vibration) {
            if (const auto hertz = reader.maybe_number("resonance_Hz", positive))
              vibration.resonance = 2 * pi * *hertz;
          },
          [](const Vibration& vibration, Node::Table& table) {
            if (vibration.resonance) put(table, "resonance_Hz", *vibration.resonance / (2 * pi));
          })
      .number("damping", &Vibration::damping, positive, "of the resonance, as a part of critical");
}

std::string amplitude_key(const Vibration& vibration) {
  return vibration.name.is_angle() ? "amplitude_urad" : "amplitude_um";
}

}  // namespace

std::vector<Key> vibration_keys() {
  std::vector<Key> keys{key_of(must("element"), Key::Kind::Text,
                               "an error motion of any axis or the spindle: `\"EXS\"`, `\"EAZ\"`")};
  for (const auto& fields :
       {harmonic_fields("amplitude_<unit>"), speed_fields(false), resonance_fields()})
    for (Key& key : fields.keys()) {
      if (key.name == "amplitude_<unit>") key.pattern = "amplitude_(um|urad)";
      keys.push_back(std::move(key));
    }
  return keys;
}

errors::Vibration read_vibration(const Node& node, const MachineDescription& machine,
                                 Faults& faults) {
  TableReader reader(node, "vibration", faults);
  Vibration vibration;
  try {
    vibration.name = errors::parse_element_name(reader.text("element", "EXS"));
  } catch (const std::invalid_argument& fault) {
    reader.refuse("element", "an element such as EXS", fault.what());
  }
  if (!reader.has("element")) reader.missing("element", "an element such as EXS");
  vibration = harmonic_fields(amplitude_key(vibration)).read(reader, vibration);
  vibration = speed_fields(vibration.exponent != 0.0).read(reader, vibration);
  vibration = resonance_fields().read(reader, vibration);
  reader.close();
  try {
    errors::bind({vibration}, kinematics::Chain(machine.joints, machine.T_bw, machine.T_bs));
  } catch (const std::invalid_argument& fault) {
    if (!machine.joints.empty())
      reader.refuse("element", "a vibration that the machine can have", fault.what());
  }
  return vibration;
}

Node::Table written_vibration(const Vibration& vibration) {
  Node::Table table;
  put(table, "element", errors::to_string(vibration.name));
  for (const auto& fields :
       {harmonic_fields(amplitude_key(vibration)), speed_fields(true), resonance_fields()})
    for (Node::Entry& entry : fields.written(vibration)) table.push_back(std::move(entry));
  return table;
}

}  // namespace abbe::sim
